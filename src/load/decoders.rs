//! Optional decoders: each has a Cargo feature of its name.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decoder {
    /// Compressed meshes of glTF.
    Draco,
    /// Basis Universal textures in KTX2 files.
    Ktx2,
    Tiff,
    WebP,
}

impl Decoder {
    /// Is it in this build; its feature; what it reads.
    fn facts(self) -> (bool, &'static str, &'static str) {
        match self {
            Decoder::Draco => (cfg!(feature = "draco"), "draco", "Draco meshes"),
            Decoder::Ktx2 => (cfg!(feature = "ktx2"), "ktx2", "Basis Universal textures"),
            Decoder::Tiff => (cfg!(feature = "tiff"), "tiff", "TIFF images"),
            Decoder::WebP => (cfg!(feature = "webp"), "webp", "WebP images"),
        }
    }

    /// Is it in this build?
    pub fn is_built_in(self) -> bool {
        self.facts().0
    }

    /// The feature that a build without it lacks.
    pub fn lack(self) -> String {
        format!("this build of oscura reads no {}", self.facts().2)
    }

    /// How to get it.
    pub fn remedy(self) -> String {
        format!("build it with `--features {}`", self.facts().1)
    }
}

// Panics of third-party decoders on damaged data become errors and stay off
// the terminal.

thread_local! {
    /// Calls of [`catch`] that this thread is in.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// Counts a call of [`catch`] for as long as it lives.
struct Quiet;

impl Quiet {
    fn new() -> Quiet {
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let earlier = take_hook();
            set_hook(Box::new(move |info| {
                // Without the thread's storage it is ending, and not in `catch`.
                if DEPTH.try_with(Cell::get).unwrap_or(0) == 0 {
                    earlier(info);
                }
            }));
        });
        DEPTH.with(|depth| depth.set(depth.get() + 1));
        Quiet
    }
}

impl Drop for Quiet {
    fn drop(&mut self) {
        DEPTH.with(|depth| depth.set(depth.get() - 1));
    }
}

/// Runs a decoder. Should it panic, the panic's words are the error and nothing is printed: the first call wraps the
/// process's panic hook so that it skips panics of threads that are in here. Those of all other threads are reported as
/// before.
///
/// `work` must not leave anything half changed that is used after a panic.
pub(super) fn catch<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let quiet = Quiet::new();
    let outcome = catch_unwind(AssertUnwindSafe(work));
    drop(quiet);
    outcome.map_err(|payload| words(payload.as_ref()))
}

fn words(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    format!("its decoder gave up: {}", text.unwrap_or("it gave no reason"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    /// Set for the process in which the panics happen.
    const INNER: &str = "OSCURA_TEST_GUARD";

    /// A panic prints where nobody can catch it, so the test looks at a process of its own.
    #[test]
    fn only_panics_inside_are_silent() {
        if std::env::var_os(INNER).is_some() {
            let table: Vec<i32> = Vec::new();
            assert_eq!(catch(|| 7), Ok(7));
            let inside = catch(|| table[std::hint::black_box(3)]).unwrap_err();
            assert!(inside.contains("index is 3"), "{inside}");
            assert!(catch(|| catch(|| panic!("innermost")).is_err()).unwrap());
            assert_eq!(
                catch(|| panic!("in the middle")),
                Err::<(), _>("its decoder gave up: in the middle".to_string())
            );
            let beside = std::thread::spawn(|| panic!("beside"));
            assert!(beside.join().is_err() && catch_unwind(|| panic!("after")).is_err());
            return;
        }
        let this = std::env::current_exe().expect("this program");
        let name = "load::decoders::tests::only_panics_inside_are_silent";
        let output = Command::new(this).args(["--exact", name, "--nocapture"]).env(INNER, "1").output();
        let output = output.expect("it runs");
        let printed = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{printed}");
        assert!(printed.contains("beside") && printed.contains("after"), "{printed}");
        for hidden in ["in the middle", "innermost", "index is 3"] {
            assert!(!printed.contains(hidden), "{printed}");
        }
    }
}
