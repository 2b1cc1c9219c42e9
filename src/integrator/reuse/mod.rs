//! Path reuse between neighbouring pixels (Bekaert, Sbert, Halton 2002, "Accelerating Path Tracing by Re-Using Paths").
//!
//! The paths of samples of the same index in a group of pixels (see [`Tiling`]) are traced independently. A path that scatters at a
//! diffuse or rough surface, at x, and then hits another, at y, is cut between them: the prefix ends at x, the suffix starts at y. When
//! all paths of the group have ended, each prefix is connected to each suffix. With `T` the throughput of a prefix, `p` its solid-angle
//! pdf, `G` the cosine at y over the squared distance, `V` the visibility, and `L` the radiance of the suffix from y, the estimate of
//! pixel k from all suffixes j is
//!
//! ```text
//! sum_j  T_k f(x_k, y_j) cos G(x_k, y_j) V(x_k, y_j) L_j / sum_m p_m(y_j) G(x_m, y_j) V(x_m, y_j)
//! ```
//!
//! which is the balance heuristic over the prefixes of the group that could have sampled y; hence the visibilities in the denominator.
//! The expected value is that of path tracing, except that filtered textures at y keep the footprint of the owner (the path that
//! sampled y). If y is Lambertian, no contribution is larger than if the prefix had sampled y itself.
//!
//! The radiance from y must be known in the direction of every prefix. Lambertian surfaces scatter uniformly. For glTF materials, the
//! radiance of the diffuse base is shared, times the transmittance of the layer above in each direction, and the glossy part is added to
//! the owner only. Other surfaces, and light via glass or mirrors, are not shared.
//!
//! Whether a prefix connects to y may depend only on y and on the prefix's direction from y; the condition must be the same for the owner
//! and for all others, and prefixes that don't connect have pdf 0.
//!
//! So surfaces with stochastic transparency (alpha, sheets, panes, boundaries of media) occlude connections, and a suffix sampled through
//! one is not shared. The weight of a mix component selected at y belongs to the suffix. No prefix ends at a vertex with lobes towards
//! refracted lights. Surfaces whose parameters depend on the viewer or on the arriving path are not shared.
//!
//! Where a prefix ends depends only on random numbers before its last scattering, and each bounce uses its own, independently scrambled
//! dimensions. So suffixes are independent of which prefixes connect.

mod connect;

use crate::bsdf::{ShadingModel, to_upper_side};
use crate::color::Rgb;
use crate::error::{Error, Result};
use crate::integrator::radiance_buffer::Layers;
use crate::integrator::sampling::{Block, SampleCursor};
use crate::integrator::shading_groups::load_material;
use crate::integrator::wave::{
    FirstBounces, LENGTH, Lanes, Lanes3, MetalRoughMaterials, RgbLanes, Vertices, WAVE, Words, get_rgb,
};
use crate::math::{Frame, Vec3};
use crate::sampling::hash::{hash32, r2_sequence};
use bytemuck::Zeroable;
use std::fmt;
use std::str::FromStr;

/// Number of samples per pixel between changes of the groups.
pub const INTERVAL: u32 = 8;

/// The shape of the groups of pixels that reuse each other's paths.
///
/// A group has `width` by `height` pixels, one per cell of `spacing` by `spacing` pixels, so that `spacing * spacing` groups are
/// interleaved. With a spacing of 1, a group is a solid block. With a larger spacing, error correlated within a group is spread over a
/// larger area, and differences between groups are high-frequency noise, which the eye and denoisers remove easily.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupShape {
    width: u32,
    height: u32,
    spacing: u32,
}

impl GroupShape {
    /// Maximum extent of a group, pixels.
    const MAX_EDGE: u32 = 32;
    /// Maximum number of pixels of a group.
    pub(super) const MAX_PIXELS: u32 = 64;

    /// Groups of `width` by `height` pixels; `None` unless these and `spacing` are powers of two, a group has 2 to 64 pixels, and
    /// `spacing` times each edge is at most 32.
    pub fn new(width: u32, height: u32, spacing: u32) -> Option<GroupShape> {
        let is_shape = [width, height, spacing].iter().all(|v| v.is_power_of_two());
        let edge = width.max(height).checked_mul(spacing)?;
        // No overflow: both are at most 32 if the first two conditions hold.
        let is_possible = is_shape
            && edge <= GroupShape::MAX_EDGE
            && (2..=GroupShape::MAX_PIXELS).contains(&(width * height));
        is_possible.then_some(GroupShape { width, height, spacing })
    }

    /// Number of pixels of a group.
    pub fn pixels(self) -> u32 {
        self.width * self.height
    }

    /// Edge, in pixels, of the square regions that groups tile and whose samples are traced in the same wave.
    fn region(self) -> u32 {
        (self.width.max(self.height) * self.spacing).max(16)
    }
}

impl fmt::Display for GroupShape {
    /// `4x4/2`: four by four pixels, one per cell of two by two.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}/{}", self.width, self.height, self.spacing)
    }
}

impl FromStr for GroupShape {
    type Err = Error;

    /// Parses the format of `Display`; without a spacing, the largest possible up to 4.
    ///
    /// # Errors
    /// A usage error.
    fn from_str(text: &str) -> Result<GroupShape> {
        let shape = || {
            let (size, spacing) = text.split_once('/').map_or((text, None), |(size, s)| (size, Some(s)));
            let (width, height) = size.split_once('x')?;
            let (width, height) = (width.parse().ok()?, height.parse().ok()?);
            match spacing {
                Some(spacing) => GroupShape::new(width, height, spacing.parse().ok()?),
                None => [4, 2, 1].into_iter().find_map(|s| GroupShape::new(width, height, s)),
            }
        };
        shape().ok_or_else(|| {
            Error::usage(format!("'{text}' is not the shape of a group of pixels")).with_help(
                "give width and height, powers of two with 2 to 64 pixels together, such as 4x4, and perhaps how far \
                 pixels lie apart, as in 4x4/2; 32 pixels at most from edge to edge",
            )
        })
    }
}

/// The groups of pixels for [`INTERVAL`] samples: a grid of square regions with the same division into groups. The grid's shift and the
/// groups change with each interval, so that no two pixels are always in different groups.
#[derive(Clone, Debug)]
pub struct Tiling {
    /// Edge of a region, pixels.
    region: u32,
    /// Shift of the regions to the left and up, pixels, less than the edge.
    shift: (u32, u32),
    /// Number of pixels of a group.
    group: usize,
    /// By pixel of a region, row-major: slot of its sample. Slots of a group are consecutive.
    slots: Vec<u16>,
}

impl Tiling {
    /// The groups of the samples from `first_sample` to the next multiple of [`INTERVAL`].
    pub fn new(shape: GroupShape, first_sample: u32) -> Tiling {
        let pass = first_sample / INTERVAL;
        let region = shape.region();
        let slots = (0..region * region).map(|i| slot(shape, pass, i % region, i / region)).collect();
        Tiling { region, shift: shift(pass, region), group: shape.pixels() as usize, slots }
    }

    /// Edge of a region, pixels. Blocks are bounded by regions or the picture.
    pub fn region(&self) -> u32 {
        self.region
    }

    /// Shift of the regions to the left and up, pixels.
    pub fn shift(&self) -> (u32, u32) {
        self.shift
    }

    /// Number of pixels of a group.
    pub fn group(&self) -> usize {
        self.group
    }

    /// Assigns slots to all samples of a block, which is one wave. Slots of a group are consecutive and start at a multiple of the group
    /// size; slots of pixels outside the block stay unused.
    pub(super) fn assign_slots(&self, block: &Block, count: usize, slots: &mut [u16; LENGTH]) {
        let (edge, (left, top)) = (self.region, self.shift);
        let column_of = |x: u32| (x + left) / edge;
        let (first_column, first_row) = (column_of(block.x0), (block.y0 + top) / edge);
        let columns = column_of(block.x0 + block.width - 1) - first_column + 1;
        let mut at = SampleCursor::new(block, 0);
        for slot in &mut slots[..count.min(WAVE)] {
            let (x, y) = (at.x + left, at.y + top);
            let region = (y / edge - first_row) * columns + x / edge - first_column;
            let pixel = self.slots[(y % edge * edge + x % edge) as usize];
            let first = (region * block.samples + at.sample as u32) * edge * edge;
            *slot = first as u16 + pixel;
            at.advance(u64::from(block.samples));
        }
    }
}

/// The slot of a pixel (x, y) of a region.
fn slot(shape: GroupShape, pass: u32, x: u32, y: u32) -> u16 {
    let GroupShape { width, height, spacing } = shape;
    let (column, row) = (x / spacing, y / spacing);
    let columns = shape.region() / spacing;
    // A random permutation per cell assigns its pixels to groups.
    let key = hash32(pass.wrapping_mul(0x9e37_79b9) ^ hash32(row * columns + column));
    let (dx, dy) = ((x ^ key) % spacing, (y ^ (key >> 8)) % spacing);
    let (dx, dy) = if (key >> 16) & 1 == 0 { (dx, dy) } else { (dy, dx) };
    let block = row / height * (columns / width) + column / width;
    let group = (block * spacing + dy) * spacing + dx;
    let member = row % height * width + column % width;
    (group * shape.pixels() + member) as u16
}

/// Shift of the regions, by a low-discrepancy sequence.
fn shift(pass: u32, region: u32) -> (u32, u32) {
    let [x, y] = r2_sequence(pass).map(|fraction| fraction >> (32 - region.trailing_zeros()));
    (x, y)
}

/// Unused slot.
pub const NONE: u32 = 0;
/// A Lambertian vertex.
pub const LAMBERT: u32 = 1;
/// A vertex of an opaque glTF material.
pub const METAL_ROUGH: u32 = 2;

/// End vertices of prefixes, by slot.
#[derive(Zeroable)]
pub struct Prefixes {
    /// Closure data, and `next_origin`, the origin of shadow rays.
    pub vertices: Vertices,
    /// Throughput from the camera up to the vertex.
    pub throughput: RgbLanes,
    /// Vertex class: [`NONE`], [`LAMBERT`] or [`METAL_ROUGH`].
    pub class: Words,
    /// Number of bounces before the vertex.
    pub bounce: Words,
    /// Only prefixes with equal keys share suffixes: see `Integrator::prefix_key`.
    pub keys: Words,
    /// First bounce of the path, diffuse for prefixes that end there. Used with light passes only.
    pub first_bounces: FirstBounces,
}

/// Start vertices of suffixes, by slot.
#[derive(Zeroable)]
pub struct Suffixes {
    /// Vertex class, as in [`Prefixes::class`].
    pub class: Words,
    pub p: Lanes3,
    /// Geometric normal, on the side where the path arrived.
    pub ng: Lanes3,
    /// Shading normal.
    pub ns: Lanes3,
    /// Direction to the end of the prefix.
    pub wo: Lanes3,
    /// End point of shadow rays.
    pub target: Lanes3,
    /// Throughput of the owner's path up to the vertex.
    pub throughput: RgbLanes,
    /// Pdf of the owner's direction at the end of the prefix, 1/sr.
    pub pdf_solid_angle: Lanes,
    /// Parameters of glTF materials.
    pub material: MetalRoughMaterials,
    /// Transmittance of the layer above the diffuse base towards the owner's prefix.
    pub layer_transmittance: Lanes,
    /// glTF materials: the diffuse base's fraction, below the layer, of the radiance by the light sample and by the scattered ray.
    pub direct_fraction: RgbLanes,
    pub scattered_fraction: RgbLanes,
    /// Radiance towards all prefixes; of glTF materials, below the layer.
    pub radiance: RgbLanes,
    /// First bounce of the path. Used with light passes only.
    pub first_bounces: FirstBounces,
}

impl Suffixes {
    /// Splits the radiance of a suffix, from its light samples and its scattered ray, into the part shared with all prefixes (of glTF
    /// materials, below the layer) and the rest for the owner.
    #[inline(always)]
    pub fn divide(&self, k: usize, direct: Rgb, scattered: Rgb) -> (Rgb, Rgb) {
        let radiance = direct + scattered;
        if self.class[k] != METAL_ROUGH {
            return (radiance, Rgb::ZERO);
        }
        let shares = [get_rgb(&self.direct_fraction, k), get_rgb(&self.scattered_fraction, k)];
        let diffuse = [direct * shares[0], scattered * shares[1]];
        (diffuse[0] + diffuse[1], radiance - (diffuse[0] + diffuse[1]) * self.layer_transmittance[k])
    }
}

/// Connections of a round, by slot: a prefix and one suffix of its group.
#[derive(Zeroable)]
pub struct Pairs {
    /// Position of the suffix's start.
    pub y: Lanes3,
    /// Geometric normal of the suffix's start.
    pub ng: Lanes3,
    /// Required key of prefixes (see [`Prefixes::keys`]).
    pub keys: Words,
    /// Area pdf, 1/m^2, with which the prefix samples the suffix's start; 0 without a connection.
    pub pdf_area: Lanes,
    /// Transmittance of the suffix's layer towards the prefix.
    pub layer_transmittance: Lanes,
    /// Prefix throughput times BSDF, cosine and geometry term; not divided by a pdf.
    pub value: RgbLanes,
}

/// Buffers of a wave for path reuse.
pub(super) struct Reuse {
    /// Slot of each sample: see [`Tiling::assign_slots`].
    pub slots: [u16; LENGTH],
    /// By slot: the sample.
    pub samples: [u16; LENGTH],
    pub prefixes: Box<Prefixes>,
    pub suffixes: Box<Suffixes>,
    pub pairs: Box<Pairs>,
    /// By slot: radiance received by the prefix from the suffixes of its group.
    pub received: Box<RgbLanes>,
    /// Light passes and light groups.
    pub layers: SharedLayers,
    pub visibility_stats: PointVisibilityStats,
}

/// Statistics of joint visibility tests in a block.
#[derive(Clone, Copy, Default)]
pub struct PointVisibilityStats {
    tests: u32,
    failures: u32,
}

impl PointVisibilityStats {
    /// Number of tests before joint tests may be disabled.
    const MIN_TESTS: u32 = 32;

    /// Counts a test; `has_failed` if most rays had to be traced one by one.
    pub fn count(&mut self, has_failed: bool) {
        self.tests += 1;
        self.failures += u32::from(has_failed);
    }

    /// Have at least half of the tests succeeded, or too few been made?
    pub fn are_worthwhile(self) -> bool {
        self.tests < Self::MIN_TESTS || 2 * self.failures <= self.tests
    }
}

impl Reuse {
    /// Without vertices.
    pub fn new() -> Reuse {
        Reuse {
            slots: [0; LENGTH],
            samples: [0; LENGTH],
            prefixes: bytemuck::zeroed_box(),
            suffixes: bytemuck::zeroed_box(),
            pairs: bytemuck::zeroed_box(),
            received: bytemuck::zeroed_box(),
            layers: SharedLayers::default(),
            visibility_stats: PointVisibilityStats::default(),
        }
    }

    /// Discards the prefix of a path (by radiance index) if it ends at this bounce: its direction is not sampled by the BSDF alone.
    pub fn discard_prefix(&mut self, bounce: u32, sample: u32) {
        let k = self.slot(sample);
        if self.prefixes.bounce[k] == bounce {
            self.prefixes.class[k] = NONE;
        }
    }

    /// The slot of a path by its radiance index.
    pub fn slot(&self, sample: u32) -> usize {
        usize::from(self.slots[sample as usize % WAVE])
    }
}

/// Offset, in the radiance buffer, of the radiance of a sample's suffix by light samples at its first vertex.
pub const DIRECT: u32 = WAVE as u32;

/// Offset of the radiance of a sample's suffix by the ray scattered at its first vertex.
pub const SCATTERED: u32 = 2 * WAVE as u32;

// Transmittance of the layer above the diffuse base of glTF materials.

/// Minimum layer transmittance for reuse: at lower ones the diffuse base is rarely sampled, and its radiance would be scaled up for other
/// prefixes.
pub const MIN_LAYER_TRANSMITTANCE: f32 = 0.1;

/// Transmittance of the layer of the material in slot `k` for direction `wo`.
pub fn layer_transmittance(
    m: &MetalRoughMaterials,
    k: usize,
    ns: Vec3,
    wo: Vec3,
    shading: ShadingModel,
) -> f32 {
    let material = load_material(m, k, shading.fresnel);
    material.closure(to_upper_side(Frame::from_normal(ns).to_local(wo))).layer_transmittance
}

/// Light passes and light groups of connected paths, by slot.
#[derive(Default)]
pub struct SharedLayers {
    /// With light passes only.
    pub diffuse: Option<Box<Diffuse>>,
    /// By light group.
    pub groups: Vec<Box<GroupLanes>>,
}

/// Diffuse parts of [`Pairs::value`], [`Suffixes::throughput`] and `Reuse::received`.
#[derive(Zeroable)]
pub struct Diffuse {
    pub value: RgbLanes,
    pub throughput: RgbLanes,
    pub received: RgbLanes,
}

/// Radiance of suffixes from a light group, and radiance received by prefixes.
#[derive(Zeroable)]
pub struct GroupLanes {
    pub radiance: RgbLanes,
    pub received: RgbLanes,
}

impl SharedLayers {
    /// Resets the buffers for a wave.
    pub fn reset(&mut self, layers: Layers) {
        self.diffuse = layers.has_passes().then(bytemuck::zeroed_box);
        self.groups.clear();
        self.groups.resize_with(layers.groups(), bytemuck::zeroed_box);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{HashMap, HashSet};

    const SHAPES: [&str; 7] = ["2x1/1", "2x2/2", "4x4/1", "4x4/4", "8x8/4", "8x2/4", "1x4/8"];

    fn tiling(shape: &str, first_sample: u32) -> (GroupShape, Tiling) {
        let shape: GroupShape = shape.parse().unwrap();
        (shape, Tiling::new(shape, first_sample))
    }

    #[test]
    fn shapes_round_trip_through_text() {
        for text in SHAPES {
            assert_eq!(text.parse::<GroupShape>().unwrap().to_string(), text);
        }
        assert_eq!("8x8".parse::<GroupShape>().unwrap().to_string(), "8x8/4");
        assert_eq!("16x2".parse::<GroupShape>().unwrap().to_string(), "16x2/2");
        for text in [
            "",
            "4",
            "x",
            "3x4",
            "1x1",
            "4x4/3",
            "16x16",
            "8x8/8",
            "-2x2",
            "4x4/",
            "99999999999x2",
            "70000x70000/0",
        ] {
            assert!(text.parse::<GroupShape>().is_err(), "{text}");
        }
    }

    /// A group has one pixel per cell, and its slots are consecutive.
    #[test]
    fn groups_have_one_pixel_per_cell() {
        for (text, pass) in SHAPES.iter().flat_map(|s| [0, 3].map(|pass| (*s, pass))) {
            let (shape, tiling) = tiling(text, 8 * pass);
            let all: HashSet<u16> = tiling.slots.iter().copied().collect();
            assert_eq!(all.len() as u32, tiling.region * tiling.region, "{text}");
            let mut groups: HashMap<u32, Vec<(u32, u32)>> = HashMap::new();
            for (i, &slot) in tiling.slots.iter().enumerate() {
                let (x, y) = (i as u32 % tiling.region, i as u32 / tiling.region);
                let cell = (x / shape.spacing, y / shape.spacing);
                groups.entry(u32::from(slot) / shape.pixels()).or_default().push(cell);
            }
            for cells in groups.values() {
                let columns: HashSet<u32> = cells.iter().map(|c| c.0).collect();
                let rows: HashSet<u32> = cells.iter().map(|c| c.1).collect();
                let different: HashSet<_> = cells.iter().collect();
                assert_eq!(
                    (columns.len(), rows.len()),
                    (shape.width as usize, shape.height as usize),
                    "{text}"
                );
                assert_eq!(different.len(), shape.pixels() as usize, "{text}");
                let width = columns.iter().max().unwrap() - columns.iter().min().unwrap() + 1;
                assert_eq!(width, shape.width, "{text}: cells of a group are neighbours");
            }
        }
    }

    /// Slots of samples are unique, also in clipped blocks, and a group has one sample index and one region.
    #[test]
    fn samples_of_a_wave_have_unique_slots() {
        for (text, samples) in [("4x4/4", 8), ("4x4/4", 3), ("8x8/4", 2), ("2x1/1", 1), ("8x8/4", 1)] {
            let (shape, tiling) = tiling(text, 16);
            let (left, top) = tiling.shift();
            let regions = (WAVE as u32 / (tiling.region * tiling.region * samples)).min(2);
            let blocks =
                [(0, 0, tiling.region * regions - left, tiling.region - top), (64 - left, 32 - top, 7, 9)];
            for (x0, y0, width, height) in blocks {
                let block = Block { x0, y0, width, height, first_sample: 16, samples };
                let count = (width * height * samples) as usize;
                let mut slots = [0; LENGTH];
                tiling.assign_slots(&block, count, &mut slots);
                let mut seen = HashSet::new();
                let mut groups: HashMap<u32, (u32, u32, u32)> = HashMap::new();
                for (i, &slot) in slots[..count].iter().enumerate() {
                    assert!(usize::from(slot) < WAVE && seen.insert(slot), "{text}: {slot}");
                    let (pixel, sample) = (i as u32 / samples, i as u32 % samples);
                    let (x, y) = (x0 + pixel % width + left, y0 + pixel / width + top);
                    let key = (x / tiling.region, y / tiling.region, sample);
                    let group = u32::from(slot) / shape.pixels();
                    assert_eq!(*groups.entry(group).or_insert(key), key, "{text}");
                }
            }
        }
    }
}
