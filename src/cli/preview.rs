//! `--preview`: a picture is shown while it renders.

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

/// Who looks on.
pub(super) enum Preview {
    /// A page.
    Page(PagePreview),
    /// Another program.
    Tev(Tev),
}

impl Preview {
    /// Starts the requested preview.
    ///
    /// # Errors
    /// If the page or the viewer isn't there.
    pub fn open(args: &RenderArgs, how: &PreviewArg) -> Result<Preview> {
        match how {
            PreviewArg::Page => PagePreview::open(args, true).map(Preview::Page),
            PreviewArg::Address => PagePreview::open(args, false).map(Preview::Page),
            PreviewArg::Tev(address) => Tev::open(address, &args.scene).map(Preview::Tev),
        }
    }

    /// A picture begins.
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

    /// When the picture so far is to be shown next; `None` if nobody looks any more.
    pub fn next_show(&self) -> Option<Instant> {
        match self {
            Preview::Page(page) => Some(page.next_show()),
            Preview::Tev(tev) => tev.next_show(),
        }
    }

    /// Shows the picture so far, unless one was shown a moment ago.
    pub fn show(&mut self, rendering: &Rendering, is_finished: bool, printed: &mut PrintedMessages) {
        match self {
            Preview::Page(page) => page.show(rendering, is_finished),
            Preview::Tev(tev) => tev.show(rendering, is_finished, printed),
        }
    }
}

// `--preview=tev`: a running tev, a viewer of high dynamic range pictures, shows the picture with all its passes while it
// renders.

/// To wait for a connection, and for a viewer that takes nothing for a while.
const PATIENCE: Duration = Duration::from_secs(5);
/// Between two pictures, or a multiple of the time that sending one took.
const PAUSE: Duration = Duration::from_millis(500);
const SHARE: u32 = 10;

/// A connection to tev.
pub(super) struct Tev {
    /// Until it breaks.
    client: Option<TevClient>,
    address: String,
    /// Name of the picture there.
    name: String,
    next: Instant,
}

impl Tev {
    /// Connects to a tev, which shows the pictures of a scene by its name.
    ///
    /// # Errors
    /// If none listens.
    pub fn open(address: &str, scene: &Path) -> Result<Tev> {
        let failed = |error: std::io::Error| {
            Error::usage(format!("--preview: no tev answers at {address}: {error}")).with_help(
                "start tev first; it listens at 127.0.0.1:14158, or where its --host says (=tev:HOST:PORT)",
            )
        };
        let mut failure = std::io::Error::other("no such address");
        for socket in address.to_socket_addrs().map_err(failed)? {
            let stream = TcpStream::connect_timeout(&socket, PATIENCE)
                .and_then(|stream| stream.set_write_timeout(Some(PATIENCE)).map(|()| stream));
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

    /// A picture begins, in the place of the one before.
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

    /// When the picture so far is to be sent next, if the viewer is still there.
    pub fn next_show(&self) -> Option<Instant> {
        self.client.as_ref().map(|_| self.next)
    }

    /// Sends the picture so far, unless one was sent a moment ago.
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
        self.next = Instant::now() + PAUSE.max(start.elapsed() * SHARE);
    }

    /// A viewer that is closed meanwhile is no reason to lose the picture.
    fn check(&mut self, sent: Option<std::io::Result<()>>, printed: &mut PrintedMessages) {
        if let Some(Err(error)) = sent {
            self.client = None;
            let text = format!("tev at {} no longer shows the picture: {error}", self.address);
            printed.warnings(&[Warning::general(text)]);
        }
    }
}
