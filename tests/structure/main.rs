//! The project's structure, checked in its sources.

mod layering;
