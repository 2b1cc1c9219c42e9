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
//! Where a prefix ends depends on the random numbers before its last scattering only, and each scattering has a set of
//! dimensions of its own, scrambled independently. So suffixes are independent of whether others take part.
//!
//! A wave has buffers for the ends of prefixes and the starts of suffixes, by place (see [`Tiling`]).

use super::radiance_buffer::Layers;
use super::shading_groups::load_material;
use super::wave::{
    FirstBounces, LENGTH, Lanes, Lanes3, MetalRoughMaterials, RgbLanes, Vertices, WAVE, Words, get_rgb,
};
use super::workspace::Workspace;
use super::{Block, Integrator};
use crate::bsdf::{ShadingModel, above};
use crate::color::Rgb;
use crate::math::{Frame, Vec3};
use bytemuck::Zeroable;
pub use tiling::{GroupShape, INTERVAL, Tiling};

mod connect;
mod tiling;

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

/// No vertex.
pub const NONE: u32 = 0;
/// A Lambertian vertex.
pub const LAMBERT: u32 = 1;
/// A vertex of an opaque glTF material.
pub const METAL_ROUGH: u32 = 2;

/// Ends of prefixes.
#[derive(Zeroable)]
pub struct Prefixes {
    /// The surfaces: the data of closures, and `next_origin`, the origin of rays.
    pub vertices: Vertices,
    /// Throughput from the camera up to the surface.
    pub throughput: RgbLanes,
    /// Which class of vertices: [`NONE`], [`LAMBERT`] or [`METAL_ROUGH`].
    pub class: Words,
    /// Number of earlier bounces of the path.
    pub bounce: Words,
    /// The number of earlier bounces combined with whether suffixes leave out light that light paths find. Only prefixes with equal values
    /// share suffixes.
    pub ends: Words,
    /// First bounce of the path, diffuse for prefixes that end there. Used with light passes only.
    pub first_bounces: FirstBounces,
}

/// Starts of suffixes.
#[derive(Zeroable)]
pub struct Suffixes {
    /// Which class of vertices.
    pub class: Words,
    pub p: Lanes3,
    /// Geometric normal, on the side where the path arrived.
    pub ng: Lanes3,
    /// Shading normal.
    pub ns: Lanes3,
    /// Direction to the end of the prefix.
    pub wo: Lanes3,
    /// Where shadow rays to the surface end.
    pub target: Lanes3,
    /// Throughput of the path there, and the density of its direction, per steradian.
    pub throughput: RgbLanes,
    pub pdf: Lanes,
    /// Parameters of glTF materials.
    pub material: MetalRoughMaterials,
    /// Transmittance of the layer above the diffuse part towards the end of the prefix.
    pub rest: Lanes,
    /// glTF materials: diffuse fraction of the radiance from the light sample and from the scattered ray, below the layer.
    pub direct_share: RgbLanes,
    pub scattered_share: RgbLanes,
    /// Radiance towards all prefixes; of glTF materials, below the layer.
    pub radiance: RgbLanes,
    /// First bounce of the path. Used with light passes only.
    pub first_bounces: FirstBounces,
}

impl Suffixes {
    /// Divides the radiance of a suffix from its light samples and its scattered ray into the part for all prefixes (of glTF materials,
    /// below the layer), and the rest for its owner.
    #[inline(always)]
    pub fn divide(&self, k: usize, direct: Rgb, scattered: Rgb) -> (Rgb, Rgb) {
        let radiance = direct + scattered;
        if self.class[k] != METAL_ROUGH {
            return (radiance, Rgb::ZERO);
        }
        let shares = [get_rgb(&self.direct_share, k), get_rgb(&self.scattered_share, k)];
        let diffuse = [direct * shares[0], scattered * shares[1]];
        (diffuse[0] + diffuse[1], radiance - (diffuse[0] + diffuse[1]) * self.rest[k])
    }
}

/// A round: at each place, a prefix and one suffix of its group.
#[derive(Zeroable)]
pub struct Pairs {
    /// Position and normal of the suffix's start.
    pub y: Lanes3,
    pub ng: Lanes3,
    /// Required end of prefixes (see [`Prefixes::ends`]); no prefix has the value used without a suffix.
    pub ends: Words,
    /// Density per square metre with which the prefix samples the suffix's start.
    pub density: Lanes,
    /// Transmittance of the suffix's layer towards the prefix.
    pub rest: Lanes,
    /// Contribution to the prefix of a radiance of 1 from the suffix, without the density of suffixes.
    pub value: RgbLanes,
}

/// Buffers of a wave for path sharing.
pub struct Reuse {
    /// Place of each sample: see `Tiling::number`.
    pub places: [u16; LENGTH],
    /// By place: the sample.
    pub samples: [u16; LENGTH],
    /// By place.
    pub prefixes: Box<Prefixes>,
    /// By place.
    pub suffixes: Box<Suffixes>,
    pub pairs: Box<Pairs>,
    /// By place: radiance of prefixes from the suffixes of their group.
    pub gained: Box<RgbLanes>,
    /// State of light passes and light groups.
    pub layers: SharedLayers,
    pub fans: Fans,
}

/// Success of visibility tests of whole groups in a block.
#[derive(Clone, Copy, Default)]
pub struct Fans {
    tried: u32,
    lost: u32,
}

impl Fans {
    /// Tests before success is judged.
    const TRIED_AT_LEAST: u32 = 32;

    /// Counts a test; `is_lost` if some rays had to be traced one by one.
    pub fn count(&mut self, is_lost: bool) {
        self.tried += 1;
        self.lost += u32::from(is_lost);
    }

    /// Did most tests succeed?
    pub fn are_worth_it(self) -> bool {
        self.tried < Self::TRIED_AT_LEAST || 2 * self.lost <= self.tried
    }
}

impl Reuse {
    /// Without vertices.
    pub fn new() -> Reuse {
        Reuse {
            places: [0; LENGTH],
            samples: [0; LENGTH],
            prefixes: bytemuck::zeroed_box(),
            suffixes: bytemuck::zeroed_box(),
            pairs: bytemuck::zeroed_box(),
            gained: bytemuck::zeroed_box(),
            layers: SharedLayers::default(),
            fans: Fans::default(),
        }
    }

    /// The place of a path by the index of its radiance.
    pub fn place(&self, sample: u32) -> usize {
        usize::from(self.places[sample as usize % WAVE])
    }
}

/// Index of the radiance that arrives at the suffix of a sample from its light samples.
pub const DIRECT: u32 = WAVE as u32;

/// Index of the radiance that arrives there from the scattered ray.
pub const SCATTERED: u32 = 2 * WAVE as u32;

// The layer of glTF materials above their diffuse part, whose transmittance depends on the direction.

/// Minimum transmittance of a layer for sharing: below, few directions are sampled for the diffuse part, and their radiance would be scaled
/// up for other prefixes.
pub const MIN_REST: f32 = 0.1;

/// Transmittance of the layer of material `k` in direction `wo`.
pub fn layer_rest(m: &MetalRoughMaterials, k: usize, ns: Vec3, wo: Vec3, shading: ShadingModel) -> f32 {
    let material = load_material(m, k, shading);
    material.closure(above(Frame::from_normal(ns).to_local(wo))).rest
}

// Buffers for sharing light passes and light groups: see `connect.rs`.

/// Light passes and light groups of shared paths, by place.
#[derive(Default)]
pub struct SharedLayers {
    /// For light passes: diffuse parts of pairs, of throughputs of suffixes and of radiance of prefixes; none without passes.
    pub diffuse: Option<Box<Diffuse>>,
    /// For light groups.
    pub groups: Vec<Box<GroupLanes>>,
}

/// Diffuse parts.
#[derive(Zeroable)]
pub struct Diffuse {
    pub value: RgbLanes,
    pub throughput: RgbLanes,
    pub gained: RgbLanes,
}

/// Radiance of suffixes from a light group, and of prefixes by it.
#[derive(Zeroable)]
pub struct GroupLanes {
    pub radiance: RgbLanes,
    pub gained: RgbLanes,
}

impl SharedLayers {
    /// Resets the buffers for a wave.
    pub fn reset(&mut self, layers: Layers) {
        self.diffuse = layers.has_passes().then(bytemuck::zeroed_box);
        self.groups.clear();
        self.groups.resize_with(layers.groups(), bytemuck::zeroed_box);
    }
}
