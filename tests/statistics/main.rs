//! Samplers, lobes and intersections, judged by many draws.

mod accel_stress;
mod bsdf;
mod phase;
mod sampling_lights;
