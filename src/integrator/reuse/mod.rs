//! Neighbouring pixels share the paths that they find (Bekaert, Sbert, Halton 2002, "Accelerating Path Tracing by Re-Using
//! Paths").
//!
//! Samples of the same index in a group of pixels (see [`Tiling`]) trace their paths as ever. Each path that scatters at a
//! diffuse or rough surface, at x, and then hits another such surface, at y, is cut between them: its prefix ends at x,
//! its suffix starts at y. When all paths of the group have ended, each prefix is connected to each suffix. With `T` the
//! throughput of a prefix, `p` the density per solid angle of its sampling, `G` the cosine at y over the squared distance, and
//! `L` the radiance that leaves y, found by its suffix, pixel k gets from all suffixes j
//!
//! ```text
//! sum_j  T_k f(x_k, y_j) cos G(x_k, y_j) V(x_k, y_j) L_j / sum_m p_m(y_j) G(x_m, y_j) V(x_m, y_j)
//! ```
//!
//! which is the balance heuristic between the ways in which the group might have found y. The visibilities `V` in the
//! denominator are needed for that. The expected value is that of path tracing, but for filtered textures at y, which
//! have the width that the finder of y covers. Where y is Lambertian, no contribution is larger than the one that the
//! prefix would have got had it found y by itself.
//!
//! What y sends into a direction must be known for every prefix. A Lambertian surface sends the same everywhere. Of glTF
//! materials the diffuse part is shared, scaled for each viewer by what the layer above leaves of it, and the glossy part
//! goes to the owner of the suffix. Other surfaces, and what glass or mirrors show, stay with the owner.
//!
//! Whether a prefix takes part at some y may depend on y and on the direction of the prefix from there, and on nothing
//! else; it must be asked for the owner and for all others alike, and prefixes that don't take part have no density.
//!
//! So surfaces that rays pass at random (alpha, sheets, panes, boundaries of media) end connections, and a suffix that its owner found
//! through one is its own. Where the component of a mix was selected at y, its weight belongs to the suffix. No prefix ends at a
//! vertex that samples directions with lobes towards refracted lights. Surfaces whose parameters depend on the viewer or on the path
//! that arrives are not shared.
//!
//! Where a prefix ends depends on the random numbers before its last scattering only, and each scattering has a set of
//! dimensions of its own, scrambled independently. So suffixes are independent of whether others take part.

mod connect;
pub(super) mod tiling;

pub use tiling::{GroupShape, INTERVAL, Tiling};

use super::wave::WAVE;
use super::workspace::Workspace;
use super::{Block, Integrator};
use tiling::{Fans, NONE, Reuse};

impl Integrator<'_> {
    /// Prepares to share the paths of a block that is one wave.
    pub(super) fn begin_reuse(&self, tiling: &Tiling, block: &Block, count: usize, w: &mut Workspace) {
        debug_assert!(count <= WAVE, "a block is one wave");
        let reuse = w.reuse.get_or_insert_with(|| Box::new(Reuse::new()));
        tiling.number(block, count, &mut reuse.places);
        for (sample, &place) in reuse.places[..count].iter().enumerate() {
            reuse.samples[usize::from(place)] = sample as u16;
        }
        reuse.fans = Fans::default();
        reuse.prefixes.class.fill(NONE);
        reuse.suffixes.class.fill(NONE);
        reuse.layers.reset(self.layers);
        w.radiance_buffer.extend(3 * WAVE);
    }
}
