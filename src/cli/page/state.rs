//! What the pages want and what they are shown; shared by the threads that serve them and the one that renders.

use super::frame::{Frame, Look};
use super::pose::Pose;
use oscura::film::Aov;
use oscura::render::CancelHandle;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

/// What the next picture is to be of.
#[derive(Clone, Debug)]
pub(crate) struct Wish {
    pub pose: Pose,
    /// Number of the scene's camera that the pose started at.
    pub camera: usize,
    /// Pixels.
    pub size: (u32, u32),
    /// How far the environment's picture is turned, degrees; without, as the scene has it.
    pub rotation: Option<f64>,
    /// What to record besides colour and depth.
    pub aov: Option<Aov>,
    /// How often the scene was to be loaded again.
    pub loads: u64,
}

impl Wish {
    /// Brings it to a scene that was loaded again, which is shown as `own` says at first; before, there were these sizes.
    pub fn fit(&mut self, own: &Wish, sizes_before: &[(u32, u32)], facts: &Facts, poses: &[Pose]) {
        if !facts.sizes.contains(&self.size) {
            let place = sizes_before.iter().position(|size| *size == self.size);
            self.size = place.and_then(|at| facts.sizes.get(at)).copied().unwrap_or(own.size);
        }
        match poses.get(self.camera) {
            None => (self.camera, self.pose) = (own.camera, own.pose.clone()),
            // A camera that nobody has moved is the file's.
            Some(fresh) if !self.pose.is_changed() => self.pose = fresh.clone(),
            Some(_) => {}
        }
        self.rotation = facts.rotation.and(self.rotation.or(own.rotation));
    }
}

/// What a page tells about the scene.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub(crate) struct Facts {
    pub name: String,
    pub cameras: Vec<String>,
    pub triangles: u64,
    /// Sizes that pictures may have.
    pub sizes: Vec<(u32, u32)>,
    /// Degrees; none without a picture as environment.
    pub rotation: Option<f64>,
    /// Samples of the finished picture.
    pub samples: u32,
    /// Passes that may be shown, with what they are.
    pub passes: Vec<(&'static str, &'static str)>,
    /// Notes and warnings.
    pub notes: Vec<String>,
    /// May pages move the camera and the like? Else they look on.
    pub is_live: bool,
    /// What renders this scene: words of a command, to which follow the choices of pages.
    #[serde(skip)]
    pub command: Vec<String>,
}

pub(crate) struct State {
    pub wish: Wish,
    /// Counts wishes.
    pub wishes: u64,
    pub look: Look,
    pub facts: Facts,
    /// The scene's cameras.
    pub poses: Vec<Pose>,
    /// The latest picture.
    pub frame: Option<Arc<Frame>>,
    /// What went wrong the last time; empty if nothing did.
    pub trouble: String,
    /// Counts all that pages show.
    pub version: u64,
    pub is_over: bool,
    /// Stops the rendering in progress.
    cancel: CancelHandle,
}

/// A wish to fulfil.
pub(crate) struct Order {
    pub wish: Wish,
    /// Which one it is.
    pub number: u64,
    /// Used when a newer one comes.
    pub cancel: CancelHandle,
}

/// The state for many threads.
pub(crate) struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl Shared {
    pub fn new(wish: Wish, look: Look, facts: Facts, poses: Vec<Pose>) -> Shared {
        let state = State {
            wish,
            wishes: 1,
            look,
            facts,
            poses,
            frame: None,
            trouble: String::new(),
            version: 0,
            is_over: false,
            cancel: CancelHandle::new(),
        };
        Shared { state: Mutex::new(state), changed: Condvar::new() }
    }

    /// A thread that panicked leaves a state that is still whole: every change is made in one go.
    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Changes what is wanted: what is being rendered stops.
    pub fn wish(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        change(&mut state);
        state.wishes += 1;
        state.version += 1;
        state.cancel.cancel();
        self.changed.notify_all();
    }

    /// Changes what is shown.
    pub fn show(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        change(&mut state);
        state.version += 1;
        self.changed.notify_all();
    }

    /// Ends everything that waits.
    pub fn end(&self) {
        self.wish(|state| state.is_over = true);
    }

    /// Waits for a newer wish than one that was fulfilled; `None` when all is over.
    pub fn next_order(&self, done: u64) -> Option<Order> {
        let has_news = |state: &mut State| state.wishes <= done && !state.is_over;
        let state = self.changed.wait_while(self.lock(), has_news);
        let mut state = state.unwrap_or_else(|poisoned| poisoned.into_inner());
        if state.is_over {
            return None;
        }
        state.cancel = CancelHandle::new();
        Some(Order { wish: state.wish.clone(), number: state.wishes, cancel: state.cancel.clone() })
    }

    /// Waits until there is more to show than `version`; gives up after a while.
    pub fn wait_for_news(&self, version: u64, most: Duration) -> MutexGuard<'_, State> {
        let is_old =
            |state: &mut State| (state.version <= version || state.frame.is_none()) && !state.is_over;
        let waited = self.changed.wait_timeout_while(self.lock(), most, is_old);
        waited.unwrap_or_else(|poisoned| poisoned.into_inner()).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::scene::Camera;

    #[test]
    fn wishes_fit_a_scene_that_has_changed() {
        let pose = |x: f64| Pose::new(Camera::look_at([x, 0.0, 5.0], [x, 0.0, 0.0], 30.0), 5.0);
        let eye = |wish: &Wish| wish.pose.camera().world_from_camera.translation.x;
        let own = Wish { pose: pose(0.0), camera: 0, size: (40, 30), rotation: None, aov: None, loads: 0 };
        let facts = |width: u32| Facts { sizes: vec![(width / 2, 30), (width, 60)], ..Facts::default() };
        let before = facts(100).sizes;
        let mut wish =
            Wish { pose: pose(1.0), camera: 1, size: (100, 60), rotation: Some(3.0), ..own.clone() };
        wish.fit(&own, &before, &facts(80), &[pose(7.0), pose(8.0)]);
        assert_eq!((wish.size, wish.camera, eye(&wish), wish.rotation), ((80, 60), 1, 8.0, None));
        wish.fit(&own, &before, &facts(80), &[pose(0.0)]);
        assert_eq!((wish.size, wish.camera, eye(&wish)), ((80, 60), 0, 0.0));
        wish.pose.open(1.0);
        wish.fit(&own, &[], &facts(20), &[pose(9.0)]);
        assert_eq!((wish.size, eye(&wish)), (own.size, 0.0), "what hands have done stays");
    }
}
