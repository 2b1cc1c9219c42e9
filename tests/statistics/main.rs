//! Statistical tests of samplers, BSDFs and intersections.

mod accel_stress;
mod bsdf;
mod phase;
mod sampling_lights;
