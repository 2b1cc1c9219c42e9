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
//! The radiance that y scatters into a direction must be known for every prefix. A Lambertian surface scatters the same everywhere. Of glTF
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

use crate::bsdf::{ShadingModel, above};
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

/// Samples between two changes of the groups.
pub const INTERVAL: u32 = 8;

/// The shape of groups of pixels that share their paths.
///
/// A group has `width` by `height` pixels, one of each cell of `spacing` by `spacing` pixels, so that `spacing * spacing`
/// groups lie within each other. With a spacing of 1, a group is a solid block. With a larger one, the pixels of each cell
/// belong to different groups: error that is correlated within a group covers a larger area, and differences between groups are
/// noise of high frequency, which the eye and denoisers remove easily.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupShape {
    width: u32,
    height: u32,
    spacing: u32,
}

impl GroupShape {
    /// Largest extent of a group, in pixels.
    const MAX_EDGE: u32 = 32;
    /// Maximum number of pixels of a group.
    pub(super) const MAX_PIXELS: u32 = 64;

    /// Groups of `width` by `height` pixels; `None` unless these and `spacing` are powers of two, a group has from 2 to
    /// 64 pixels, and `spacing` times its edges is at most 32.
    pub fn new(width: u32, height: u32, spacing: u32) -> Option<GroupShape> {
        let is_shape = [width, height, spacing].iter().all(|v| v.is_power_of_two());
        let edge = width.max(height).checked_mul(spacing)?;
        // No overflow: both are at most 32 if the first two conditions hold.
        let is_possible = is_shape
            && edge <= GroupShape::MAX_EDGE
            && (2..=GroupShape::MAX_PIXELS).contains(&(width * height));
        is_possible.then_some(GroupShape { width, height, spacing })
    }

    /// Pixels of a group.
    pub fn pixels(self) -> u32 {
        self.width * self.height
    }

    /// Edge of the squares of pixels whose samples are traced together: a multiple of the groups.
    fn region(self) -> u32 {
        (self.width.max(self.height) * self.spacing).max(16)
    }
}

impl fmt::Display for GroupShape {
    /// `4x4/2`: four by four pixels, one of each cell of two by two.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}/{}", self.width, self.height, self.spacing)
    }
}

impl FromStr for GroupShape {
    type Err = Error;

    /// Reads what `Display` writes; a spacing that is left out is the largest up to 4 that is possible.
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

/// The groups of some samples: a grid of square regions, each divided alike. The grid is shifted and the groups change from
/// pass to pass, so that no two pixels are always in different groups.
#[derive(Clone, Debug)]
pub struct Tiling {
    /// Edge of a region in pixels.
    region: u32,
    /// Shift of the regions to the left and up, in pixels, less than the edge.
    shift: (u32, u32),
    /// Pixels of a group.
    group: usize,
    /// By pixel of a region, row by row: the place of its samples among those of the region with the same index. The
    /// members of a group follow each other.
    places: Vec<u16>,
}

impl Tiling {
    /// The groups of the samples from `first_sample` to the next multiple of [`INTERVAL`].
    pub fn new(shape: GroupShape, first_sample: u32) -> Tiling {
        let pass = first_sample / INTERVAL;
        let region = shape.region();
        let places = (0..region * region).map(|i| place(shape, pass, i % region, i / region)).collect();
        Tiling { region, shift: shift(pass, region), group: shape.pixels() as usize, places }
    }

    /// Edge of a region in pixels. Blocks begin and end where regions do, or the picture does.
    pub fn region(&self) -> u32 {
        self.region
    }

    /// Shift of the regions to the left and up, in pixels.
    pub fn shift(&self) -> (u32, u32) {
        self.shift
    }

    /// Pixels of a group.
    pub fn group(&self) -> usize {
        self.group
    }

    /// The places of all samples of a block that is one wave. Members of a group have places that follow each other, from
    /// a multiple of their number on; places of pixels beyond the block stay empty.
    pub(super) fn number(&self, block: &Block, count: usize, places: &mut [u16; LENGTH]) {
        let (edge, (left, top)) = (self.region, self.shift);
        let column_of = |x: u32| (x + left) / edge;
        let (first_column, first_row) = (column_of(block.x0), (block.y0 + top) / edge);
        let columns = column_of(block.x0 + block.width - 1) - first_column + 1;
        let mut at = SampleCursor::new(block, 0);
        for place in &mut places[..count.min(WAVE)] {
            let (x, y) = (at.x + left, at.y + top);
            let region = (y / edge - first_row) * columns + x / edge - first_column;
            let pixel = self.places[(y % edge * edge + x % edge) as usize];
            let first = (region * block.samples + at.sample as u32) * edge * edge;
            *place = first as u16 + pixel;
            at.advance(u64::from(block.samples));
        }
    }
}

/// The place of a pixel of a region.
fn place(shape: GroupShape, pass: u32, x: u32, y: u32) -> u16 {
    let GroupShape { width, height, spacing } = shape;
    let (column, row) = (x / spacing, y / spacing);
    let columns = shape.region() / spacing;
    // A permutation by cell assigns its pixels to groups.
    let key = hash32(pass.wrapping_mul(0x9e37_79b9) ^ hash32(row * columns + column));
    let (dx, dy) = ((x ^ key) % spacing, (y ^ (key >> 8)) % spacing);
    let (dx, dy) = if (key >> 16) & 1 == 0 { (dx, dy) } else { (dy, dx) };
    let block = row / height * (columns / width) + column / width;
    let group = (block * spacing + dy) * spacing + dx;
    let member = row % height * width + column % width;
    (group * shape.pixels() + member) as u16
}

/// Shift of the regions in a pass, by a low-discrepancy sequence.
fn shift(pass: u32, region: u32) -> (u32, u32) {
    let [x, y] = r2_sequence(pass).map(|fraction| fraction >> (32 - region.trailing_zeros()));
    (x, y)
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
    /// Only prefixes with equal keys share suffixes: see the file `connect.rs`.
    pub keys: Words,
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
    /// Required key of prefixes (see [`Prefixes::keys`]); no prefix has the value used without a suffix.
    pub keys: Words,
    /// Density per square metre with which the prefix samples the suffix's start.
    pub density: Lanes,
    /// Transmittance of the suffix's layer towards the prefix.
    pub rest: Lanes,
    /// Contribution to the prefix of a radiance of 1 from the suffix, without the density of suffixes.
    pub value: RgbLanes,
}

/// Buffers of a wave for path sharing.
pub(super) struct Reuse {
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

    /// The path with this index of radiance doesn't end its prefix at this bounce after all: its direction is sampled with another density than
    /// the BSDF's.
    pub fn leave_out(&mut self, bounce: u32, sample: u32) {
        let k = self.place(sample);
        if self.prefixes.bounce[k] == bounce {
            self.prefixes.class[k] = NONE;
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
    fn shapes_are_read_as_they_are_written() {
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

    /// A group has one pixel of each cell, and its pixels have a range of places of their own.
    #[test]
    fn groups_have_a_pixel_of_each_cell() {
        for (text, pass) in SHAPES.iter().flat_map(|s| [0, 3].map(|pass| (*s, pass))) {
            let (shape, tiling) = tiling(text, 8 * pass);
            let all: HashSet<u16> = tiling.places.iter().copied().collect();
            assert_eq!(all.len() as u32, tiling.region * tiling.region, "{text}");
            let mut groups: HashMap<u32, Vec<(u32, u32)>> = HashMap::new();
            for (i, &place) in tiling.places.iter().enumerate() {
                let (x, y) = (i as u32 % tiling.region, i as u32 / tiling.region);
                let cell = (x / shape.spacing, y / shape.spacing);
                groups.entry(u32::from(place) / shape.pixels()).or_default().push(cell);
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

    /// Samples of blocks, whole or cut off, have places of their own, and groups hold one sample index of one region.
    #[test]
    fn samples_of_a_wave_have_places() {
        for (text, samples) in [("4x4/4", 8), ("4x4/4", 3), ("8x8/4", 2), ("2x1/1", 1), ("8x8/4", 1)] {
            let (shape, tiling) = tiling(text, 16);
            let (left, top) = tiling.shift();
            let regions = (WAVE as u32 / (tiling.region * tiling.region * samples)).min(2);
            let blocks =
                [(0, 0, tiling.region * regions - left, tiling.region - top), (64 - left, 32 - top, 7, 9)];
            for (x0, y0, width, height) in blocks {
                let block = Block { x0, y0, width, height, first_sample: 16, samples };
                let count = (width * height * samples) as usize;
                let mut places = [0; LENGTH];
                tiling.number(&block, count, &mut places);
                let mut seen = HashSet::new();
                let mut groups: HashMap<u32, (u32, u32, u32)> = HashMap::new();
                for (i, &place) in places[..count].iter().enumerate() {
                    assert!(usize::from(place) < WAVE && seen.insert(place), "{text}: {place}");
                    let (pixel, sample) = (i as u32 / samples, i as u32 % samples);
                    let (x, y) = (x0 + pixel % width + left, y0 + pixel / width + top);
                    let key = (x / tiling.region, y / tiling.region, sample);
                    let group = u32::from(place) / shape.pixels();
                    assert_eq!(*groups.entry(group).or_insert(key), key, "{text}");
                }
            }
        }
    }
}
