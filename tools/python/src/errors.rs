//! Errors of the renderer as Python exceptions, with the same message.

use oscura::error::{Choice, ErrorKind, Warning};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::prelude::*;

create_exception!(oscura, Error, PyException, "Something that the renderer refuses or that failed.");
create_exception!(oscura, UsageError, Error, "Arguments that make no sense, or not together.");
create_exception!(oscura, InputError, Error, "A scene or file that is missing, broken or not supported.");
create_exception!(oscura, OutputError, Error, "A file that could not be written.");

/// The exception of an error.
pub fn raised(error: oscura::Error) -> PyErr {
    let text = in_words_of_python(error.to_string());
    match error.kind {
        ErrorKind::Usage => UsageError::new_err(text),
        ErrorKind::Input => InputError::new_err(text),
        ErrorKind::Output => OutputError::new_err(text),
        ErrorKind::Interrupted => PyKeyboardInterrupt::new_err(text),
    }
}

/// An error about an argument.
pub fn usage(message: impl Into<String>) -> PyErr {
    UsageError::new_err(message.into())
}

/// Warnings and notes as texts.
pub fn texts(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().map(|warning| in_words_of_python(warning.to_string())).collect()
}

/// The Python argument of a choice.
fn argument(choice: Choice) -> &'static str {
    match choice {
        Choice::AllowExternal => "allow_external=True",
        Choice::Aovs => "aovs=",
        Choice::Background => "background=",
        Choice::NewSidecar => "a file of settings beside the model",
        Choice::Blender => "blender=",
        Choice::Environment => "environment=None",
        Choice::Float => "float32=True",
        Choice::Force => "force=True",
        Choice::Glass => "glass=",
        Choice::Ground => "ground=",
        Choice::LightUnits => "light_units=",
        Choice::MemoryLimit => "the memory limit",
        Choice::NoSidecar => "sidecar=False",
        Choice::PointRadius => "point_radius=",
        Choice::Smooth => "smooth=",
        Choice::Stage => "stage=",
        Choice::Subdivide => "subdivide=",
        Choice::Up => "up=",
        Choice::ViewFrom => "view_from=",
        Choice::Zoom => "zoom=",
    }
}

/// Replaces the library's names of choices by those of Python arguments.
fn in_words_of_python(mut text: String) -> String {
    for choice in Choice::ALL {
        let term = choice.to_string();
        if text.contains(&term) {
            text = text.replace(&term, argument(choice));
        }
    }
    text
}
