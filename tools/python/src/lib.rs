//! The Python module `oscura._oscura`: scenes, rendering, and the program. `python/oscura/_oscura.pyi` documents it for users.

mod arrays;
mod choices;
mod errors;
mod lights;
mod load;
mod materials;
mod objects;
mod picture;
mod render;
mod scene;
mod stage;
mod watch;

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the program with these arguments, the first of which is its name; returns its exit code.
#[pyfunction]
fn run_program(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| oscura::cli::main(words.into_iter()))
}

/// The names of all AOVs, with descriptions.
#[pyfunction]
fn aovs() -> Vec<(&'static str, &'static str)> {
    let all = oscura::film::Aov::ALL.iter().map(|aov| aov.info());
    all.map(|info| (info.option, info.about)).collect()
}

#[pymodule]
mod _oscura {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::errors::{Error, InputError, OutputError, UsageError};
    #[pymodule_export]
    use super::load::load;
    #[pymodule_export]
    use super::picture::Picture;
    #[pymodule_export]
    use super::render::render;
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::{aovs, run_program};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
