//! Optional decoders, one Cargo feature each.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

/// An optional decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decoder {
    /// Compressed glTF meshes.
    Draco,
    /// Basis Universal textures in KTX2 files.
    Ktx2,
    Tiff,
    WebP,
}

impl Decoder {
    /// Whether the decoder is in this build, its Cargo feature, and the content that it decodes.
    fn properties(self) -> (bool, &'static str, &'static str) {
        match self {
            Decoder::Draco => (cfg!(feature = "draco"), "draco", "Draco meshes"),
            Decoder::Ktx2 => (cfg!(feature = "ktx2"), "ktx2", "Basis Universal textures"),
            Decoder::Tiff => (cfg!(feature = "tiff"), "tiff", "TIFF images"),
            Decoder::WebP => (cfg!(feature = "webp"), "webp", "WebP images"),
        }
    }

    /// Whether the decoder is in this build.
    pub fn is_built_in(self) -> bool {
        self.properties().0
    }

    /// Error message for a build without the decoder.
    pub fn missing_message(self) -> String {
        format!("this build of oscura doesn't support {}", self.properties().2)
    }

    /// Help text: how to build with the decoder.
    pub fn remedy(self) -> String {
        format!("build it with `--features {}`", self.properties().1)
    }
}

// Panics of third-party decoders on damaged data become errors and aren't printed.

thread_local! {
    /// Nesting depth of [`catch_panic`] on this thread.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// Guard that increments [`DEPTH`] during a call of [`catch_panic`].
struct DepthGuard;

impl DepthGuard {
    fn new() -> DepthGuard {
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let earlier = take_hook();
            set_hook(Box::new(move |info| {
                // A thread without thread-local storage is ending, so it isn't in `catch_panic`.
                if DEPTH.try_with(Cell::get).unwrap_or(0) == 0 {
                    earlier(info);
                }
            }));
        });
        DEPTH.with(|depth| depth.set(depth.get() + 1));
        DepthGuard
    }
}

impl Drop for DepthGuard {
    fn drop(&mut self) {
        DEPTH.with(|depth| depth.set(depth.get() - 1));
    }
}

/// Runs a decoder and turns a panic into an error message. The first call wraps the process's panic hook so that panics
/// within `catch_panic` aren't printed; other panics are reported as before.
///
/// A panic must not leave inconsistent state that outlives `work`.
pub(super) fn catch_panic<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let guard = DepthGuard::new();
    let outcome = catch_unwind(AssertUnwindSafe(work));
    drop(guard);
    outcome.map_err(|payload| panic_message(payload.as_ref()))
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    format!("its decoder failed: {}", text.unwrap_or("no message"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    /// Environment variable set for the child process that panics.
    const INNER: &str = "OSCURA_TEST_GUARD";

    /// A panic hook prints to the process's standard error, so the test runs in a child process.
    #[test]
    fn only_panics_inside_are_silent() {
        if std::env::var_os(INNER).is_some() {
            let table: Vec<i32> = Vec::new();
            assert_eq!(catch_panic(|| 7), Ok(7));
            let inside = catch_panic(|| table[std::hint::black_box(3)]).unwrap_err();
            assert!(inside.contains("index is 3"), "{inside}");
            assert!(catch_panic(|| catch_panic(|| panic!("innermost")).is_err()).unwrap());
            assert_eq!(
                catch_panic(|| panic!("in the middle")),
                Err::<(), _>("its decoder failed: in the middle".to_string())
            );
            let other = std::thread::spawn(|| panic!("other thread"));
            assert!(other.join().is_err() && catch_unwind(|| panic!("after")).is_err());
            return;
        }
        let this = std::env::current_exe().expect("this program");
        let name = "load::decoders::tests::only_panics_inside_are_silent";
        let output = Command::new(this).args(["--exact", name, "--nocapture"]).env(INNER, "1").output();
        let output = output.expect("it runs");
        let printed = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{printed}");
        assert!(printed.contains("other thread") && printed.contains("after"), "{printed}");
        for hidden in ["in the middle", "innermost", "index is 3"] {
            assert!(!printed.contains(hidden), "{printed}");
        }
    }
}
