//! The guide: what the program does, page by page.

#[doc = include_str!("rendering.md")]
pub mod rendering {}

#[doc = include_str!("scene_files.md")]
pub mod scene_files {}

#[doc = include_str!("compositing.md")]
pub mod compositing {}

#[doc = include_str!("formats.md")]
pub mod formats {}

#[doc = include_str!("speed.md")]
pub mod speed {}

#[doc = include_str!("exactness.md")]
pub mod exactness {}

#[doc = include_str!("internals.md")]
pub mod internals {}
