//! Lights: how they are chosen and sampled.

pub mod environment;

pub use environment::{EnvironmentLight, EnvironmentSample};
