//! Stable codes of problems and warnings, for tests that don't depend on wording.

use oscura::error::{Error, Warning};

/// Is there a warning or note with a code?
pub fn has_code(list: &[Warning], code: &str) -> bool {
    list.iter().any(|warning| warning.code == code)
}

/// The code of an error's first problem.
pub fn code_of(error: &Error) -> &'static str {
    error.problems[0].code
}
