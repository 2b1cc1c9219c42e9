//! The program from outside: exit codes, messages, files.

mod comparing;
mod errors;
mod limits;
mod options;
mod program;
#[cfg(target_os = "linux")]
mod signals;
mod teaching;
