//! `--preview`: a picture is shown while it renders.

use super::args::RenderArgs;
use super::page::PagePreview;
use super::preview_arg::PreviewArg;
use super::report::Said;
use super::tev::Tev;
use oscura::error::Result;
use oscura::output::PngOptions;
use oscura::render::Rendering;
use oscura::scene::Camera;
use std::time::Instant;

/// Who looks on.
pub(super) enum Preview {
    /// A page.
    Page(PagePreview),
    /// Another program.
    Tev(Tev),
}

impl Preview {
    /// Begins to show what is asked for.
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
        said: &mut Said,
    ) {
        match self {
            Preview::Page(page) => page.begin(rendering, png, camera, triangles),
            Preview::Tev(tev) => tev.begin(rendering, said),
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
    pub fn show(&mut self, rendering: &Rendering, is_finished: bool, said: &mut Said) {
        match self {
            Preview::Page(page) => page.show(rendering, is_finished),
            Preview::Tev(tev) => tev.show(rendering, is_finished, said),
        }
    }
}
