//! The program from outside: exit codes, messages, files, and every command of the README.

#[cfg(unix)]
mod blender;
mod comparing;
mod defaults;
mod denoisers;
mod desktop;
mod errors;
mod examples;
mod farms;
mod finishing;
mod inspect;
mod keeping;
mod layers;
mod layouts;
mod limits;
mod long;
mod new_sidecar;
mod options;
mod output;
mod program;
mod readme;
mod sequence;
mod showcase;
#[cfg(target_os = "linux")]
mod signals;
#[path = "../common/skip.rs"]
mod skip;
mod stage;
mod teaching;
mod terminal;
mod tev;
mod video;
#[cfg(target_os = "linux")]
mod view;
mod views;
