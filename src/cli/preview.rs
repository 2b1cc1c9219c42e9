//! `--preview`: shows a picture while it renders.

use super::args::RenderArgs;
use super::page::PagePreview;
use super::parsers::PreviewArg;
use super::report::PrintedMessages;
use oscura::error::{Error, Result, Warning};
use oscura::film::Values;
use oscura::output::PngOptions;
use oscura::render::Rendering;
use oscura::scene::Camera;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::time::{Duration, Instant};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

/// The viewer of a preview.
pub(super) enum Preview {
    Page(PagePreview),
    Tev(Tev),
}

impl Preview {
    /// Starts the requested preview.
    ///
    /// # Errors
    /// The page can't be served, or tev can't be reached.
    pub fn open(args: &RenderArgs, preview: &PreviewArg) -> Result<Preview> {
        match preview {
            PreviewArg::Page => PagePreview::open(args, true).map(Preview::Page),
            PreviewArg::Address => PagePreview::open(args, false).map(Preview::Page),
            PreviewArg::Tev(address) => Tev::open(address, &args.scene).map(Preview::Tev),
        }
    }

    /// Starts a new picture.
    pub fn begin(
        &mut self,
        rendering: &Rendering,
        png: &PngOptions,
        camera: &Camera,
        triangles: u64,
        printed: &mut PrintedMessages,
    ) {
        match self {
            Preview::Page(page) => page.begin(rendering, png, camera, triangles),
            Preview::Tev(tev) => tev.begin(rendering, printed),
        }
    }

    /// When to show the picture next; `None` if the viewer is gone.
    pub fn next_show(&self) -> Option<Instant> {
        match self {
            Preview::Page(page) => Some(page.next_show()),
            Preview::Tev(tev) => tev.next_show(),
        }
    }

    /// Shows the picture so far, unless the last one is too recent.
    pub fn show(&mut self, rendering: &Rendering, is_finished: bool, printed: &mut PrintedMessages) {
        match self {
            Preview::Page(page) => page.show(rendering, is_finished),
            Preview::Tev(tev) => tev.show(rendering, is_finished, printed),
        }
    }
}

/// Timeout of connecting and sending.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Minimum time between two pictures.
const MIN_INTERVAL: Duration = Duration::from_millis(500);
/// Minimum time between two pictures, as a multiple of the time of sending one.
const MIN_INTERVAL_FACTOR: u32 = 10;

/// A connection to tev, a viewer of high dynamic range pictures, which shows the picture with all passes.
pub(super) struct Tev {
    /// `None` after the connection broke.
    client: Option<TevClient>,
    address: String,
    /// Name of the picture in tev.
    name: String,
    next: Instant,
}

impl Tev {
    /// Connects to tev; the picture is named after the scene.
    ///
    /// # Errors
    /// tev can't be reached.
    pub fn open(address: &str, scene: &Path) -> Result<Tev> {
        let failed = |error: std::io::Error| {
            Error::usage(format!("--preview: can't connect to tev at {address}: {error}")).with_help(
                "start tev first; its default address is 127.0.0.1:14158, others are set by its --host and by =tev:HOST:PORT",
            )
        };
        let mut failure = std::io::Error::other("no such address");
        for socket in address.to_socket_addrs().map_err(failed)? {
            let stream = TcpStream::connect_timeout(&socket, TIMEOUT)
                .and_then(|stream| stream.set_write_timeout(Some(TIMEOUT)).map(|()| stream));
            match stream {
                Ok(stream) => {
                    let client = Some(TevClient::wrap(stream));
                    let name = scene.file_name().unwrap_or_default().to_string_lossy();
                    let (address, name) = (address.to_string(), name.replace('\0', ""));
                    return Ok(Tev { client, address, name, next: Instant::now() });
                }
                Err(error) => failure = error,
            }
        }
        Err(failed(failure))
    }

    /// Starts a new picture, which replaces the previous one.
    pub fn begin(&mut self, rendering: &Rendering, printed: &mut PrintedMessages) {
        self.next = Instant::now();
        let film = rendering.film();
        let names: Vec<String> = film.names().map(String::from).collect();
        let packet = PacketCreateImage {
            image_name: &self.name,
            grab_focus: true,
            width: film.width(),
            height: film.height(),
            channel_names: &names,
        };
        let sent = self.client.as_mut().map(|client| client.send(packet));
        self.check(sent, printed);
    }

    /// When to send the picture next; `None` if tev is gone.
    pub fn next_show(&self) -> Option<Instant> {
        self.client.as_ref().map(|_| self.next)
    }

    /// Sends the picture so far, unless the last one is too recent.
    pub fn show(&mut self, rendering: &Rendering, is_finished: bool, printed: &mut PrintedMessages) {
        let start = Instant::now();
        let Some(client) = self.client.as_mut().filter(|_| is_finished || start >= self.next) else { return };
        let film = rendering.shown();
        let (mut names, mut data) = (Vec::new(), Vec::new());
        for plane in film.planes() {
            names.push(plane.name.to_string());
            match plane.values {
                Values::Uint(numbers) => data.extend(numbers.into_iter().map(|number| number as f32)),
                values => data.extend(values.into_floats()),
            }
        }
        let pixels = u64::from(film.width()) * u64::from(film.height());
        let offsets: Vec<u64> = (0..names.len() as u64).map(|channel| channel * pixels).collect();
        let sent = client.send(PacketUpdateImage {
            image_name: &self.name,
            grab_focus: false,
            channel_names: &names,
            channel_offsets: &offsets,
            channel_strides: &vec![1; names.len()],
            x: 0,
            y: 0,
            width: film.width(),
            height: film.height(),
            data: &data,
        });
        self.check(Some(sent), printed);
        self.next = Instant::now() + MIN_INTERVAL.max(start.elapsed() * MIN_INTERVAL_FACTOR);
    }

    /// Warns if sending failed; rendering continues without the preview.
    fn check(&mut self, sent: Option<std::io::Result<()>>, printed: &mut PrintedMessages) {
        if let Some(Err(error)) = sent {
            self.client = None;
            let text = format!("tev at {} no longer shows the picture: {error}", self.address);
            printed.warnings(&[Warning::general(text)]);
        }
    }
}
