//! Random points and how they become directions, positions and choices.

pub mod sampler;
