//! Renders what the pages want: small at first, then in full, pass by pass.

use super::ViewArgs;
use super::model::Model;
use crate::cli::page::{Frame, Order, Shared, Wish};
use oscura::error::Result;
use oscura::film::{Aov, AovSet};
use oscura::load::SavedFiles;
use oscura::render::{CancelHandle, Guiding, Labels, PassOutcome, Rendering};
use std::time::{Duration, Instant};

/// How long a small first picture may take, seconds.
const PREVIEW_S: f64 = 0.06;
/// Samples a second until the first picture tells.
const FIRST_GUESS: f64 = 5e5;
/// Largest size of the finished picture over that of a first one.
const COARSEST: u32 = 8;

/// Fulfils wishes until all is over.
///
/// # Errors
/// If there is no memory for the first picture.
pub(super) fn run(
    args: &ViewArgs,
    mut model: Model,
    files: &SavedFiles,
    cancel: &CancelHandle,
    shared: &Shared,
) -> Result<()> {
    let (mut done, mut speed) = (0, FIRST_GUESS);
    // Why the scene could not be loaded again; empty if it could.
    let mut broken = String::new();
    while let Some(mut order) = shared.next_order(done) {
        done = order.number;
        if order.wish.loads != model.loads {
            let loaded = model.reload(args, files, cancel, order.wish.loads);
            let taken = loaded.and_then(|()| take_over(args, &model, &mut order.wish, shared));
            broken = taken.err().map_or(String::new(), |error| error.to_string());
        }
        // Whatever went wrong, what was there before is still there and goes on.
        let followed = model.follow(&order.wish);
        tell(shared, followed.err().map_or(broken.clone(), |error| error.to_string()));
        if let Err(error) = render(&model, &order, shared, &mut speed) {
            if shared.lock().frame.is_none() {
                return Err(error);
            }
            tell(shared, error.to_string());
        }
    }
    Ok(())
}

/// Shows what is known of a scene that was loaded again, and brings what is wanted to it.
fn take_over(args: &ViewArgs, model: &Model, wish: &mut Wish, shared: &Shared) -> Result<()> {
    let (facts, poses) = (model.facts(args), model.poses(args));
    let own = model.wish(args, &facts, &poses)?;
    shared.show(|state| {
        let before = std::mem::replace(&mut state.facts, facts).sizes;
        state.poses = poses;
        for wish in [&mut *wish, &mut state.wish] {
            wish.fit(&own, &before, &state.facts, &state.poses);
        }
    });
    Ok(())
}

/// Shows what went wrong, unless it is shown.
fn tell(shared: &Shared, trouble: String) {
    if shared.lock().trouble != trouble {
        shared.show(|state| state.trouble = trouble);
    }
}

/// Renders until all samples are taken or something else is wanted.
fn render(model: &Model, order: &Order, shared: &Shared, speed: &mut f64) -> Result<()> {
    let (width, height) = order.wish.size;
    let pixels = f64::from(width) * f64::from(height);
    let takes_long = |scale: &u32| pixels / f64::from(scale * scale) / *speed > PREVIEW_S;
    let scale = [1, 2, 4].into_iter().find(|scale| !takes_long(scale)).unwrap_or(COARSEST);
    let steps = [(scale, Some(1)), (1, None)];
    for (scale, samples) in steps.into_iter().skip(usize::from(scale == 1)) {
        let is_last = samples.is_none();
        if !render_at(model, order, shared, speed, (scale, samples.unwrap_or(model.samples)), is_last)? {
            break;
        }
    }
    Ok(())
}

/// Renders at the size divided by a scale. Returns whether nothing came between.
fn render_at(
    model: &Model,
    order: &Order,
    shared: &Shared,
    speed: &mut f64,
    (scale, samples): (u32, u32),
    is_last: bool,
) -> Result<bool> {
    let (width, height) = order.wish.size;
    let aovs = [Some(Aov::Depth), order.wish.aov]
        .into_iter()
        .flatten()
        .fold(AovSet::NONE, |all, aov| all.union(aov.into()));
    // A limit makes the first pass one of a single sample.
    let options = model
        .settled
        .options
        .size((width / scale).max(1), (height / scale).max(1))
        .samples(samples)
        .aovs(aovs)
        .time_limit(Some(Duration::from_secs(1 << 30)))
        // The first picture can't wait until paths have learned.
        .guiding(Guiding::Off)
        // Estimated, but never low enough to stop.
        .noise(Some(f32::MIN_POSITIVE));
    let labels = Labels::of(&model.loaded.scene, &options);
    let camera = order.wish.pose.for_rendering();
    let rendering = Rendering::labelled(model.compiled.clone(), labels, &camera, options)?;
    let scene = &model.loaded;
    let mut rendering =
        rendering.with_cancel_handle(order.cancel.clone()).placed(scene.scene.backdrop.clone(), scene.offset);
    loop {
        let (start, before) = (Instant::now(), rendering.statistics().samples);
        let outcome = rendering.next_pass();
        if outcome == PassOutcome::Cancelled {
            return Ok(false);
        }
        let taken = rendering.statistics().samples - before;
        if taken > 0 {
            *speed = taken as f64 / start.elapsed().as_secs_f64().max(1e-4);
        }
        let is_done = outcome != PassOutcome::Progressed;
        let frame = Frame { scale, ..Frame::of(&rendering, is_done && is_last, order.number) };
        // One that came late would take the place of a newer one.
        if order.cancel.is_cancelled() {
            return Ok(false);
        }
        shared.show(|state| state.frame = Some(frame.into()));
        if is_done {
            return Ok(true);
        }
    }
}
