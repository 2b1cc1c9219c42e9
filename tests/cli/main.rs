//! The program from outside: exit codes, messages, files, and every command of the README.

#[cfg(unix)]
mod blender;
mod compare;
mod defaults;
mod denoise;
mod desktop_and_packages;
mod errors;
mod examples;
mod render_farms;
mod postprocessing;
mod inspect;
mod output_safety;
mod aovs;
mod exr_layouts;
mod limits;
mod resume_and_merge;
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
mod help;
mod terminal;
mod tev;
mod video;
#[cfg(target_os = "linux")]
mod view;
mod lookup_tables;
