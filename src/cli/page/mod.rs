//! The page in the browser that shows a picture while it renders, and its server. [`state`] is shared by the server's threads
//! and the rendering thread.

mod edits;
mod http;
mod pixels;
mod pose;
mod server;
mod state;

use super::args::RenderArgs;
pub(super) use edits::{Edits, LightInfo, set_environment_strength};
use oscura::error::Result;
use oscura::film::Aov;
use oscura::output::PngOptions;
use oscura::render::Rendering;
use oscura::scene::Camera;
pub(super) use pose::Pose;
pub(super) use server::{Page, bind};
pub(super) use state::{
    Frame, PAGE_AOVS, PageDisplay, RenderRequest, SceneInfo, Shared, ViewRequest, own_command,
};
use std::time::{Duration, Instant};

/// Minimum time between two pictures.
const FRAME_INTERVAL: Duration = Duration::from_millis(250);
/// Time for pages to fetch the last picture before the program ends.
const LAST_FETCH: Duration = Duration::from_millis(300);

/// The read-only page of `oscura render --preview`.
pub(crate) struct PagePreview {
    page: Page,
    shown: Option<Instant>,
}

impl PagePreview {
    /// Serves the page, and opens it in a browser if `opens`.
    ///
    /// # Errors
    /// A usage error if no port is free.
    pub fn open(args: &RenderArgs, opens: bool) -> Result<PagePreview> {
        let server = bind(0)?;
        let pose = Pose::new(Camera::look_at([0.0, 0.0, 1.0], [0.0; 3], 30.0), 1.0);
        let request = ViewRequest::new(pose, (1, 1));
        let scene_info = SceneInfo {
            name: args.scene.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            command: std::iter::once("oscura".to_string()).chain(state::arguments()).collect(),
            ..SceneInfo::default()
        };
        let display = PageDisplay::new(PngOptions::default());
        let shared = Shared::new(request, display, scene_info, Vec::new());
        Ok(PagePreview { page: Page::open(server, shared, args, opens), shown: None })
    }

    /// Starts a new picture.
    pub fn begin(&mut self, rendering: &Rendering, png: &PngOptions, camera: &Camera, triangles: u64) {
        let film = rendering.film();
        let has = |aov: &&Aov| film.aov(**aov).is_some();
        let size = (film.width(), film.height());
        self.shown = None;
        self.page.shared.request(|state| {
            state.request.pose = Pose::new(camera.clone(), 1.0);
            state.request.size = size;
            let PageDisplay { aov, denoise, split, .. } = state.display;
            state.display = PageDisplay { aov, denoise, split, ..PageDisplay::new(png.clone()) };
            state.scene_info.sizes = vec![size];
            state.scene_info.cameras = vec![camera.name.clone()];
            state.scene_info.triangles = triangles;
            let passes = Aov::ALL.iter().filter(has);
            state.scene_info.passes = passes.map(|aov| (aov.info().option, aov.info().about)).collect();
            state.scene_info.samples = rendering.samples();
        });
    }

    /// When to show the picture next.
    pub fn next_show(&self) -> Instant {
        self.shown.map_or_else(Instant::now, |shown| shown + FRAME_INTERVAL)
    }

    /// Shows the picture so far, unless the last one is too recent.
    pub fn show(&mut self, rendering: &Rendering, is_finished: bool) {
        if !is_finished && self.shown.is_some_and(|shown| shown.elapsed() < FRAME_INTERVAL) {
            return;
        }
        let request_number = self.page.shared.lock().request_number;
        let frame = Frame::of(rendering, is_finished, request_number);
        self.page.shared.show(|state| state.frame = Some(frame.into()));
        self.shown = Some(Instant::now());
    }
}

impl Drop for PagePreview {
    fn drop(&mut self) {
        if self.shown.is_some() {
            std::thread::sleep(LAST_FETCH);
        }
    }
}
