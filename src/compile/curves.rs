//! Subdivision of curves into round cone segments.
//!
//! Cubic strands are divided uniformly in their parameter. A segment deviates from its strand by at most [`MAX_ERROR`] of the
//! radius (more in scenes with many millions of segments): the distance of a cubic from its chord is at most 1/8 of its
//! maximum second derivative, which decreases with the square of the number of segments. Points are displaced towards the
//! outside of bends by two thirds of that distance, so that segments deviate equally to both sides of the curve. Diagonal
//! segments are shortened until their bounding boxes are not much larger than the segments. Tangents are those of the curve,
//! for smooth shading.

use super::geometry::{CurveAttributes, Space, SurfaceCoordinates};
use super::limits;
use super::material::CompiledMaterial;
use super::objects::{ObjectIds, ObjectMaterials};
use crate::error::Result;
use crate::math::{DVec3, Vec3, frame_from_tangent};
use crate::sampling::hash::mix64;
use crate::scene::{CurveBasis, Curves, Scene};
use crate::shape::{CurveSegment, CurveSegments, Surface};
use crate::texture::StrandData;
use rayon::prelude::*;

/// Maximum distance of a segment from its curve, as a fraction of the maximum radius.
const MAX_ERROR: f64 = 0.05;
/// Displacement of points to the outside of bends, as a fraction of the distance of the chord from the curve.
const OUTWARD_SHIFT: f64 = 2.0 / 3.0;
/// Maximum square root of the area of a segment's bounding box (without the radius), relative to the radius.
const MAX_BOX_SIZE: f64 = 12.0;
/// Number of segments above which segments are lengthened.
const MAX_FINE_SEGMENTS: usize = 4_000_000;
/// Maximum factor on the length of segments. Their number decreases by this factor, and the maximum error increases with its
/// square, to 0.8 of the radius. (100,000 hairs of 8 spans on a sphere, 0.0015 radii thick.)
const MAX_COARSENESS: f64 = 4.0;
/// Maximum number of segments of one Bezier span.
const MAX_SPAN_SEGMENTS: usize = 64;
/// Number of strands of a parallel task.
const STRANDS_PER_TASK: usize = 256;

/// A control point of a strand.
#[derive(Clone, Copy)]
struct ControlPoint {
    p: DVec3,
    radius: f64,
    color: DVec3,
}

impl ControlPoint {
    fn mix(nodes: [ControlPoint; 4], weights: [f64; 4]) -> ControlPoint {
        let sum = |of: fn(&ControlPoint) -> DVec3| (0..4).map(|i| of(&nodes[i]) * weights[i]).sum();
        let radius = (0..4).map(|i| nodes[i].radius * weights[i]).sum();
        ControlPoint { p: sum(|n| n.p), radius, color: sum(|n| n.color) }
    }
}

/// Segments of some strands, and the attributes of their points.
#[derive(Default)]
struct StrandSegments {
    segments: CurveSegments,
    along: Vec<f32>,
    colors: Vec<[f32; 3]>,
}

/// Converts a strand to cubic Bezier spans.
fn spans(basis: CurveBasis, n: &[ControlPoint]) -> Vec<[ControlPoint; 4]> {
    let last = n.len() - 1;
    let thirds =
        |a: ControlPoint, b: ControlPoint| ControlPoint::mix([a, b, a, a], [2.0 / 3.0, 1.0 / 3.0, 0.0, 0.0]);
    match basis {
        CurveBasis::Linear => {
            n.windows(2).map(|w| [w[0], thirds(w[0], w[1]), thirds(w[1], w[0]), w[1]]).collect()
        }
        CurveBasis::Bezier => {
            (0..last).step_by(3).map(|i| std::array::from_fn(|k| n[(i + k).min(last)])).collect()
        }
        CurveBasis::BSpline => {
            let at = |w: &[ControlPoint], i: usize| {
                ControlPoint::mix([w[i], w[i + 1], w[i + 2], w[i]], [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0])
            };
            n.windows(4).map(|w| [at(w, 0), thirds(w[1], w[2]), thirds(w[2], w[1]), at(w, 1)]).collect()
        }
        CurveBasis::CatmullRom => {
            let beyond =
                |a: ControlPoint, b: ControlPoint| ControlPoint::mix([a, b, a, a], [2.0, -1.0, 0.0, 0.0]);
            let at = |i: isize| match i {
                -1 => beyond(n[0], n[1]),
                i if i as usize > last => beyond(n[last], n[last - 1]),
                i => n[i as usize],
            };
            let span = |i: usize| {
                let [a, b, c, d] = [-1, 0, 1, 2].map(|k| at(i as isize + k));
                let sixth = |at: ControlPoint, to: ControlPoint, from: ControlPoint| {
                    ControlPoint::mix([at, to, from, at], [1.0, 1.0 / 6.0, -1.0 / 6.0, 0.0])
                };
                [b, sixth(b, c, a), sixth(c, b, d), c]
            };
            (0..last).map(span).collect()
        }
    }
}

/// Number of segments of a Bezier span.
fn segment_count(span: &[ControlPoint; 4], coarseness: f64) -> usize {
    let radius = span.iter().map(|n| n.radius).fold(0.0, f64::max);
    let bend = |a: ControlPoint, b: ControlPoint, c: ControlPoint| {
        let of_radius = (a.radius - 2.0 * b.radius + c.radius).abs();
        (a.p - 2.0 * b.p + c.p).length().max(of_radius)
    };
    // The second derivative of a cubic is 6 times an interpolation of these differences.
    let bend = bend(span[0], span[1], span[2]).max(bend(span[1], span[2], span[3]));
    let of_error = (6.0 / 8.0 * OUTWARD_SHIFT * bend / (MAX_ERROR * radius)).sqrt();
    let extent = (span[3].p - span[0].p).abs();
    let of_box =
        (extent.x * extent.y + extent.y * extent.z + extent.z * extent.x).sqrt() / (MAX_BOX_SIZE * radius);
    let max = MAX_SPAN_SEGMENTS as f64;
    // `max` turns the NaN of strands without radius into one segment.
    (of_error.max(of_box) / coarseness).min(max).ceil().max(1.0) as usize
}

fn bezier(span: &[ControlPoint; 4], t: f64) -> ControlPoint {
    let s = 1.0 - t;
    ControlPoint::mix(*span, [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t])
}

/// A point of a strand, displaced to the outside of the bend by [`OUTWARD_SHIFT`] times the distance of the chords from the strand
/// (1/8 of the second difference).
fn displaced_outwards(cuts: &[(ControlPoint, f64)], i: usize) -> DVec3 {
    let here = cuts[i].0.p;
    let neighbours = i.checked_sub(1).and_then(|before| cuts.get(before)).zip(cuts.get(i + 1));
    neighbours.map_or(here, |((before, _), (after, _))| {
        here - (before.p - 2.0 * here + after.p) * (OUTWARD_SHIFT / 8.0)
    })
}

impl StrandSegments {
    /// Appends a strand.
    fn strand(&mut self, basis: CurveBasis, nodes: &[ControlPoint], has_colors: bool, coarseness: f64) {
        let spans = spans(basis, nodes);
        let first = self.segments.points.len();
        let mut cuts = Vec::new();
        for (i, span) in spans.iter().enumerate() {
            let count = segment_count(span, coarseness);
            for k in 0..count {
                let t = k as f64 / count as f64;
                cuts.push((bezier(span, t), (i as f64 + t) / spans.len() as f64));
            }
        }
        cuts.extend(spans.last().map(|span| (span[3], 1.0)));
        let is_straight = basis == CurveBasis::Linear;
        for (i, (node, along)) in cuts.iter().enumerate() {
            let p = if is_straight { node.p } else { displaced_outwards(&cuts, i) };
            let [x, y, z] = p.as_vec3().to_array();
            self.segments.points.push([x, y, z, node.radius.max(0.0) as f32]);
            self.along.push(*along as f32);
            if has_colors {
                self.colors.push(node.color.as_vec3().to_array());
            }
        }
        let points = &self.segments.points[first..];
        self.segments.tangents.extend((0..points.len()).map(|i| tangent(points, i)));
        // Segments without radius are invisible.
        let is_visible = |i: &usize| points[*i][3] > 0.0 || points[i + 1][3] > 0.0;
        let visible = (0..points.len().saturating_sub(1)).filter(is_visible);
        self.segments.segments.extend(visible.map(|i| (first + i) as u32));
    }

    fn append(&mut self, other: StrandSegments) {
        let first = self.segments.points.len() as u32;
        self.segments.points.extend(other.segments.points);
        self.segments.tangents.extend(other.segments.tangents);
        self.segments.segments.extend(other.segments.segments.into_iter().map(|i| i + first));
        self.along.extend(other.along);
        self.colors.extend(other.colors);
    }
}

/// The mean direction of the segments before and after a point; zero at the ends of a strand and at reversals.
fn tangent(points: &[[f32; 4]], i: usize) -> [f32; 3] {
    let at = |i: usize| points.get(i).map(|&[x, y, z, _]| Vec3::new(x, y, z));
    let before = i.checked_sub(1).and_then(at);
    let (Some(before), Some(here), Some(after)) = (before, at(i), at(i + 1)) else { return [0.0; 3] };
    let sum = (here - before).normalize_or_zero() + (after - here).normalize_or_zero();
    if sum.length_squared() > 1e-4 { sum.normalize().to_array() } else { [0.0; 3] }
}

/// The control points of each strand, relative to `origin`.
fn strands(curves: &Curves, origin: DVec3) -> impl IndexedParallelIterator<Item = Vec<ControlPoint>> {
    let scale = curves.radius_scale();
    let node = move |i: usize| ControlPoint {
        p: curves.world_from_object.transform_point3(DVec3::from(curves.points[i].map(f64::from))) - origin,
        radius: f64::from(curves.radii[i]) * scale,
        color: curves.colors.get(i).map_or(DVec3::ONE, |c| DVec3::from(c.map(f64::from))),
    };
    let mut first = 0;
    let ranges = curves.strands.iter().map(|&count| {
        first += count as usize;
        first - count as usize..first
    });
    ranges.collect::<Vec<_>>().into_par_iter().map(move |range| range.map(node).collect())
}

/// Factor on the length of segments, so that their number is at most [`MAX_FINE_SEGMENTS`] if possible.
fn coarseness<'a>(curves: impl Iterator<Item = &'a Curves> + Clone) -> f64 {
    let count = |coarseness: f64| -> usize {
        let of_strand = |basis: CurveBasis, nodes: &[ControlPoint]| -> usize {
            spans(basis, nodes).iter().map(|span| segment_count(span, coarseness)).sum()
        };
        let segment_count_of =
            |c: &Curves| -> usize { strands(c, DVec3::ZERO).map(|n| of_strand(c.basis, &n)).sum() };
        curves.clone().map(segment_count_of).sum()
    };
    let mut coarseness = 1.0;
    while coarseness < MAX_COARSENESS && count(coarseness) > MAX_FINE_SEGMENTS {
        coarseness *= 2.0;
    }
    coarseness
}

/// Subdivides curves, relative to `origin`.
///
/// # Errors
/// If their points exceed 32-bit indices.
fn cut(curves: &Curves, origin: DVec3, has_colors: bool, coarseness: f64) -> Result<StrandSegments> {
    let one = |strands: Vec<Vec<ControlPoint>>| {
        let mut cut = StrandSegments::default();
        for nodes in &strands {
            cut.strand(curves.basis, nodes, has_colors, coarseness);
        }
        cut
    };
    let parts: Vec<StrandSegments> = strands(curves, origin).chunks(STRANDS_PER_TASK).map(one).collect();
    limits::check_curve_points(parts.iter().map(|part| part.segments.points.len()).sum())?;
    Ok(parts.into_iter().fold(StrandSegments::default(), |mut all, part| {
        all.append(part);
        all
    }))
}

impl Space {
    /// Appends all visible curves to the world.
    ///
    /// # Errors
    /// If their points exceed 32-bit indices.
    pub(super) fn append_curves(
        &mut self,
        scene: &Scene,
        materials: &[CompiledMaterial],
        origin: DVec3,
        object_ids: &ObjectIds,
        object_materials: &ObjectMaterials,
    ) -> Result<()> {
        let is_visible = |curves: &&Curves| !materials[curves.material.index()].is_invisible();
        let has_colors =
            scene.curves.iter().filter(is_visible).any(|curves| {
                !curves.colors.is_empty() && materials[curves.material.index()].uses_vertex_colors
            });
        let coarseness = coarseness(scene.curves.iter().filter(is_visible));
        let mut all = StrandSegments::default();
        for (i, curves) in scene.curves.iter().enumerate().filter(|(_, curves)| is_visible(curves)) {
            let materials = &mut self.attributes.materials;
            self.owners.begin(materials.len(), object_ids.curves(i));
            let before = all.segments.len();
            let cut = cut(curves, origin, has_colors, coarseness)?;
            limits::check_curve_points(all.segments.points.len() + cut.segments.points.len())?;
            all.append(cut);
            let count = all.segments.len() - before;
            let material = object_materials.index_of(curves.material, &curves.traits);
            materials.resize(materials.len() + count, material);
        }
        self.shapes.curves = all.segments;
        self.attributes.curves = CurveAttributes { along: all.along, colors: all.colors };
        Ok(())
    }
}

impl CurveAttributes {
    /// Data of the strand at parameter `u` of a segment, for texture nodes; `first` is the index of the segment's first point.
    pub(super) fn strand(
        &self,
        all: &CurveSegments,
        first: u32,
        segment: &CurveSegment,
        u: f32,
    ) -> StrandData {
        let first = first as usize;
        let mut root = first;
        while root > 0 && self.along[root] > 0.0 && self.along[root - 1] < self.along[root] {
            root -= 1;
        }
        let mut length = 0.0;
        let mut tip = root;
        while tip + 1 < all.points.len() && self.along[tip + 1] > self.along[tip] {
            let [a, b] = [tip, tip + 1].map(|i| Vec3::from_slice(&all.points[i][..3]));
            length += a.distance(b);
            tip += 1;
        }
        let random = (mix64(root as u64) >> 40) as f32 / (1u64 << 24) as f32;
        let intercept = self.along[first] + (self.along[first + 1] - self.along[first]) * u;
        let thickness = 2.0 * (segment.radii[0] + (segment.radii[1] - segment.radii[0]) * u);
        StrandData { intercept, length, thickness, tangent: segment.tangent(u).normalize_or_zero(), random }
    }

    /// Texture coordinates, colour and tangents at a point of the surface with parameter `u` of a segment; `first` is the index
    /// of the segment's first point. The texture's u increases from root to tip, v around the curve.
    pub(super) fn coordinates(
        &self,
        first: u32,
        segment: &CurveSegment,
        surface: &Surface,
        u: f32,
    ) -> SurfaceCoordinates {
        let first = first as usize;
        let along = [self.along[first], self.along[first + 1]];
        let uv = segment.texture_coordinates(along, u, surface.ng);
        let color = match self.colors.get(first..first + 2) {
            Some([a, b]) => {
                let [r, g, b] = std::array::from_fn(|c| a[c] + (b[c] - a[c]) * u);
                [r, g, b, 1.0]
            }
            _ => [1.0; 4],
        };
        let tangent_frame = frame_from_tangent(segment.tangent(u), surface.ns, 1.0);
        let length = (segment.ends[1] - segment.ends[0]).length().max(f32::MIN_POSITIVE);
        let per_metre = (along[1] - along[0]) / length;
        SurfaceCoordinates { uv: [uv, uv], color, tangent_frame, uv_per_metre: [per_metre; 2] }
    }
}
