//! What a wave keeps to share its paths: ends of prefixes and starts of suffixes, by place (see [`super::Tiling`]).

use crate::bsdf::{ShadingModel, above};
use crate::color::Rgb;
use crate::integrator::radiance_buffer::Layers;
use crate::integrator::shading_groups::load_material;
use crate::integrator::wave::FirstBounces;
use crate::integrator::wave::{LENGTH, Lanes, Lanes3, RgbLanes, WAVE, Words, get_rgb};
use crate::integrator::wave::{MetalRoughMaterials, Vertices};
use crate::math::{Frame, Vec3};
use bytemuck::Zeroable;

/// No vertex.
pub const NONE: u32 = 0;
/// A Lambertian vertex.
pub const LAMBERT: u32 = 1;
/// A vertex of an opaque glTF material.
pub const METAL_ROUGH: u32 = 2;

/// Ends of prefixes.
#[derive(Zeroable)]
pub struct Prefixes {
    /// The surfaces. `next_origin` is where rays start there; only what closures are made of is there besides.
    pub vertices: Vertices,
    /// Throughput from the camera up to the surface.
    pub throughput: RgbLanes,
    /// Which class of vertices: [`NONE`], [`LAMBERT`] or [`METAL_ROUGH`].
    pub class: Words,
    /// Number of earlier bounces of the path.
    pub bounce: Words,
    /// That, and whether light that suffixes find is left to paths from lamps, as a number: only prefixes alike share suffixes.
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
    /// Towards the end of the prefix.
    pub wo: Lanes3,
    /// Where shadow rays to the surface end.
    pub target: Lanes3,
    /// Throughput of the path there, and the density per solid angle with which its direction was chosen.
    pub throughput: RgbLanes,
    pub pdf: Lanes,
    /// Of glTF materials.
    pub material: MetalRoughMaterials,
    /// Which share of the diffuse part the layer leaves towards the end of the prefix.
    pub rest: Lanes,
    /// Of glTF materials: the diffuse share of the radiance from the light sample, and from where the path goes on, before
    /// what the layer takes.
    pub direct_share: RgbLanes,
    pub scattered_share: RgbLanes,
    /// Radiance that leaves towards everybody; of glTF materials, before what the layer takes.
    pub radiance: RgbLanes,
    /// First bounce of the path. Used with light passes only.
    pub first_bounces: FirstBounces,
}

impl Suffixes {
    /// Divides what arrives at a suffix from its light samples and from where the path goes on into what leaves towards
    /// everybody, of glTF materials before what the layer takes, and what leaves towards its owner beside that.
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

/// A round: at each place, a prefix and the suffix of its group whose turn it is.
#[derive(Zeroable)]
pub struct Pairs {
    /// Where the suffix starts, and its normal.
    pub y: Lanes3,
    pub ng: Lanes3,
    /// Required end of prefixes (see [`Prefixes::ends`]); no prefix has the value used without a suffix.
    pub ends: Words,
    /// Density per area with which the prefix might have found the suffix.
    pub density: Lanes,
    /// Which share of the radiance from the suffix the layer there leaves towards the prefix.
    pub rest: Lanes,
    /// What a radiance of 1 from the suffix would bring to the prefix, with all factors but the density of suffixes.
    pub value: RgbLanes,
}

/// What a wave keeps to share its paths.
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
    /// By place: what prefixes got from the suffixes of their group.
    pub gained: Box<RgbLanes>,
    /// The same of the layers that are asked for.
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
    /// So many are tried before it is judged whether they help.
    const TRIED_AT_LEAST: u32 = 32;

    /// Counts one, in which some rays had to be tested one by one or none.
    pub fn count(&mut self, is_lost: bool) {
        self.tried += 1;
        self.lost += u32::from(is_lost);
    }

    /// Were most of them a help?
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

/// Index of the radiance that arrives there from where the path goes on.
pub const SCATTERED: u32 = 2 * WAVE as u32;

// The layer of glTF materials above their diffuse part, whose transmittance depends on the direction.

/// Least share that a layer must leave for a viewer: below, few directions are sampled for the diffuse part, and what they
/// bring would be scaled up for others.
pub const LEAST_REST: f32 = 0.1;

/// The share that the layer of material `k` leaves towards a viewer.
pub fn layer_rest(m: &MetalRoughMaterials, k: usize, ns: Vec3, wo: Vec3, shading: ShadingModel) -> f32 {
    let material = load_material(m, k, shading);
    material.closure(above(Frame::from_normal(ns).to_local(wo))).rest
}

// Buffers for sharing light passes and light groups: see `connect.rs`.

/// What a wave keeps to share the layers of its paths, by place.
#[derive(Default)]
pub struct SharedLayers {
    /// Of light passes: the diffuse parts of what pairs would get, of the throughputs of suffixes, and of what prefixes got;
    /// nothing without passes.
    pub diffuse: Option<Box<Diffuse>>,
    /// Of groups of lights.
    pub groups: Vec<Box<GroupLanes>>,
}

/// What concerns the diffuse passes.
#[derive(Zeroable)]
pub struct Diffuse {
    pub value: RgbLanes,
    pub throughput: RgbLanes,
    pub gained: RgbLanes,
}

/// What leaves suffixes of the light of a group, and what prefixes got of it.
#[derive(Zeroable)]
pub struct GroupLanes {
    pub radiance: RgbLanes,
    pub gained: RgbLanes,
}

impl SharedLayers {
    /// Empties them for a wave.
    pub fn reset(&mut self, layers: Layers) {
        self.diffuse = layers.has_passes().then(bytemuck::zeroed_box);
        self.groups.clear();
        self.groups.resize_with(layers.groups(), bytemuck::zeroed_box);
    }
}
