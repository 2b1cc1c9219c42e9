//! `oscura view`: a page that shows a scene while it renders. One thread renders (on the pool's threads), one takes
//! requests and starts a thread for each ([`Page`]), one watches files and signals.

mod args;
mod model;
mod worker;

pub(crate) use args::{ViewArgs, adapt, refuse_unused};

use super::Outcome;
use super::page::{Page, Shared, bind};
use super::process::cancel_by_signals;
use model::Model;
use oscura::error::Result;
use oscura::load::SavedFiles;
use oscura::render::{CancelHandle, in_pool};
use std::time::{Duration, Instant};

/// How often signals and files are looked at.
const TICK: Duration = Duration::from_millis(50);
const WATCH: Duration = Duration::from_millis(500);

/// Serves the page until a signal ends it.
pub(crate) fn run(args: &ViewArgs) -> Result<Outcome> {
    let mut args = args.clone();
    args.picture.scene = args.picture.scenes.first().cloned().unwrap_or_default();
    let cancel = cancel_by_signals()?;
    let threads = args.picture.threads.map(usize::from);
    in_pool(threads, || show(&args, &cancel))?
}

fn show(args: &ViewArgs, cancel: &CancelHandle) -> Result<Outcome> {
    // A port that is taken is told before the scene is loaded.
    let server = bind(args.port)?;
    let files = SavedFiles::default();
    let model = Model::load(args, &files, cancel)?;
    let (facts, poses) = (model.facts(args), model.poses(args));
    if !args.picture.quiet {
        facts.notes.iter().for_each(|note| say!("note: {note}"));
    }
    let wish = model.wish(args, &facts, &poses)?;
    let shared = Shared::new(wish, model.look(), facts, poses);
    let page = Page::open(server, shared, !args.no_open, args.picture.quiet);
    // Rendering stays on this thread, which belongs to the pool.
    std::thread::scope(|scope| {
        scope.spawn(|| watch_over(args.watch.then_some(&files), cancel, &page.shared));
        let done = worker::run(args, model, &files, cancel, &page.shared);
        page.shared.end();
        done
    })?;
    Ok(Outcome::Done)
}

/// Ends all at a signal, and has the scene loaded again when one of these files was saved.
fn watch_over(files: Option<&SavedFiles>, cancel: &CancelHandle, shared: &Shared) {
    let mut looked = Instant::now();
    while !shared.lock().is_over {
        std::thread::sleep(TICK);
        if cancel.is_cancelled() {
            shared.end();
        }
        let Some(files) = files.filter(|_| looked.elapsed() >= WATCH) else { continue };
        looked = Instant::now();
        if files.have_changed() {
            shared.wish(|state| state.wish.loads += 1);
        }
    }
}
