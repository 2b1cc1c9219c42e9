//! The guide: what the program does, page by page. `tools/site` makes a book of it.

#[doc = include_str!("first_picture.md")]
pub mod first_picture {}

#[doc = include_str!("gallery.md")]
pub mod gallery {}

#[doc = include_str!("scans.md")]
pub mod scans {}

#[doc = include_str!("from_blender.md")]
pub mod from_blender {}

#[doc = include_str!("rendering.md")]
pub mod rendering {}

#[doc = include_str!("questions.md")]
pub mod questions {}

#[doc = include_str!("compositing.md")]
pub mod compositing {}

#[doc = include_str!("other_renderers.md")]
pub mod other_renderers {}

#[doc = include_str!("scene_files.md")]
pub mod scene_files {}

#[doc = include_str!("formats.md")]
pub mod formats {}

#[doc = include_str!("exactness.md")]
pub mod exactness {}

#[doc = include_str!("speed.md")]
pub mod speed {}

#[doc = include_str!("limits.md")]
pub mod limits {}

#[doc = include_str!("history.md")]
pub mod history {}

#[doc = include_str!("internals.md")]
pub mod internals {}

#[doc = include_str!("internals_loading.md")]
pub mod internals_loading {}

#[doc = include_str!("internals_compiling.md")]
pub mod internals_compiling {}

#[doc = include_str!("internals_tracing.md")]
pub mod internals_tracing {}

#[doc = include_str!("internals_film.md")]
pub mod internals_film {}

#[doc = include_str!("internals_output.md")]
pub mod internals_output {}

#[doc = include_str!("adding.md")]
pub mod adding {}
