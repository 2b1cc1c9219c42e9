//! The project's structure, checked in its sources.

mod imports;
mod layering;
mod sizes;
mod source;
mod texts;
