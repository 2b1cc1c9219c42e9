//! Caustics from the lamp: light that reaches a diffuse surface by way of smooth glass, mirrors and polished metal is found by
//! paths that start at lamps, and connected to the camera ("light tracing", Arvo 1986, "Backward Ray Tracing"; Dutre, Lafortune,
//! Willems 1993). Paths from the camera find it by chance only, and never where lamps have no size.
//!
//! With E the camera, D a surface that catches caustics ([`Role::Catches`](crate::compile::Role)), S one that sends light on
//! ([`Role::Sends`](crate::compile::Role)) and L a lamp, these paths take all of `E D S+ L`, and nothing else. Paths from the
//! camera leave out just that: each carries along whether it has come from the camera by one D and then S only. What a surface is
//! follows from its material and so is the same from both sides. The environment is no lamp here: what it sends is found from the
//! camera.
//!
//! From lamps without a size (points, spots, suns without an angle) light by way of perfectly smooth surfaces is found by no path
//! from the camera, and so is taken at every surface that scatters it to the camera.
//!
//! The measure of what a path from a lamp brings is flux: radiance, times the cosine over the density of its start, times what
//! BSDFs leave of it. BSDFs are evaluated for the viewer on the camera's side, so that values are those of paths from the camera,
//! also where a BSDF isn't symmetric; what shading normals change in measures is Veach 1997, "Robust Monte Carlo Methods for
//! Light Transport Simulation", section 5.3. Perfect reflection and refraction can't be asked for a viewer: there, light is
//! left to paths from the camera where the normal would be bent for their viewer.

mod catch;
mod follow;
mod passage;
mod path;
mod plan;
mod send;
mod trace;

pub(super) use follow::leaves_light;
pub use path::CausticTally;
pub use plan::CausticPlan;
