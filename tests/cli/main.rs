//! The program from outside: exit codes, messages, files, and every command of the README.

mod aovs;
#[cfg(unix)]
mod blender;
mod compare;
mod defaults;
mod denoise;
mod desktop_and_packages;
mod errors;
mod examples;
mod exr_layouts;
mod help;
mod inspect;
mod limits;
mod lookup_tables;
mod new_sidecar;
mod options;
mod output;
mod output_safety;
mod postprocessing;
mod program;
mod readme;
mod render_farms;
mod resume_and_merge;
mod sequence;
mod showcase;
#[cfg(target_os = "linux")]
mod signals;
#[path = "../common/skip.rs"]
mod skip;
mod stage;
mod terminal;
mod tev;
mod video;
#[cfg(target_os = "linux")]
mod view;
