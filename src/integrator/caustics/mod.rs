//! Caustics from the lamp: light that leaves lamps by way of smooth glass, mirrors and polished metal is found by paths that
//! start there, and connected to the camera ("light tracing", Arvo 1986, "Backward Ray Tracing"; Dutre, Lafortune, Willems 1993).
//! Paths from the camera find it by chance only, and never where lamps have no size.
//!
//! With E the camera, D a surface that catches light ([`Role::Catches`](crate::compile::Role)), S one that sends it on
//! ([`Role::Sends`](crate::compile::Role)) and L a lamp, these paths take all of `E D (D|S)* S L`, and nothing else: at each surface
//! that catches light it shows to the camera, and goes on. Paths from the camera leave out just that: each carries along whether it
//! has met a D first, and then D and S only, and whether the last was an S. What a surface is follows from its material and so is
//! the same from both sides. The environment is no lamp here: what it sends is found from the camera.
//!
//! From lamps without a size (points, spots, suns without an angle) light that a perfectly smooth surface sends first is found by no
//! path from the camera, and so goes on at every surface, and is taken at each that scatters it to the camera.
//!
//! The measure of what a path from a lamp brings is flux: radiance, times the cosine over the density of its start, times what
//! BSDFs leave of it. BSDFs are evaluated for the viewer on the camera's side, so that values are those of paths from the camera,
//! also where a BSDF isn't symmetric; what shading normals change in measures is Veach 1997, "Robust Monte Carlo Methods for
//! Light Transport Simulation", section 5.3. Perfect reflection and refraction can't be asked for a viewer: there, light is
//! left to paths from the camera where the normal would be bent for their viewer. Textures of surfaces that scatter light on its way are
//! looked up at points: which width a path from the camera would cover there is not known.
//!
//! Where neighbouring pixels share suffixes of paths, only prefixes do so that leave the same light: see
//! [`Prefixes::ends`](super::reuse::state::Prefixes::ends).

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
