//! Checks of the project's structure in its sources.

mod imports;
mod layering;
mod sizes;
mod source;
mod texts;
