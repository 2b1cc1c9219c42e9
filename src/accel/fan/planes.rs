//! The planes of triangles, and those through their edges, as the target of a fan is placed to them.

use super::super::layout::TrianglePacket;
use crate::shape::triangle::LANES;

/// At most as many rays are in a fan.
pub const RAYS: usize = 64;

/// How far a unit in the last place may be off, relative to a number.
pub const ROUNDING: f32 = f32::EPSILON / 2.0;

/// A lane of a vector.
#[inline(always)]
pub fn lane_of(v: &[[f32; LANES]; 3], lane: usize) -> [f32; 3] {
    [v[0][lane], v[1][lane], v[2][lane]]
}

/// A component of a ray's way from the target.
#[inline(always)]
pub fn along(m: [f32; 3], ways: &[[f32; RAYS]; 3], ray: usize) -> f32 {
    m[0] * ways[0][ray] + m[1] * ways[1][ray] + m[2] * ways[2][ray]
}

/// Rays of a run, one bit each.
pub struct Met {
    pub possible: u32,
    pub certain: u32,
}

/// On which side of the planes of four triangles the target of a fan is.
pub struct Sides {
    /// Of the planes, of length about 1, on the side of the target.
    pub normal: [[f32; LANES]; 3],
    /// How far the target is from the planes.
    pub side: [f32; LANES],
    /// Rays whose start is farther from the plane than this, on the side of the target, don't cross it.
    pub margin: [f32; LANES],
    /// Those whose start is below this, which is negative, cross it for certain.
    pub certain_margin: [f32; LANES],
    /// No ray crosses it.
    pub beside: [bool; LANES],
}

impl Sides {
    /// In double precision, since rays start and end next to surfaces.
    #[inline(always)]
    pub fn new(packet: &TrianglePacket, target: [f32; 3], [low, high]: &[[f32; 3]; 2]) -> Sides {
        let mut sides = Sides {
            normal: [[0.0; LANES]; 3],
            side: [0.0; LANES],
            margin: [0.0; LANES],
            certain_margin: [0.0; LANES],
            beside: [false; LANES],
        };
        for lane in 0..LANES {
            let at = |axis: usize, vertex: usize| f64::from(packet.rows[4 * axis + vertex][lane]);
            let edge = |k: usize| [at(0, k) - at(0, 0), at(1, k) - at(1, 0), at(2, k) - at(2, 0)];
            let (e, f) = (edge(1), edge(2));
            let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let scale = 1.0 / (n[0].abs() + n[1].abs() + n[2].abs());
            let n = [n[0] * scale, n[1] * scale, n[2] * scale];
            let height = |k: usize| n[k] * (f64::from(target[k]) - at(k, 0));
            let height = height(0) + height(1) + height(2);
            // How far the roundings of a ray's direction move its end.
            let moved = |k: usize| n[k].abs() * f64::from(low[k].abs().max(high[k].abs()));
            let moved = moved(0) + moved(1) + moved(2);
            // Roundings of the exact test, which count where the triangle reaches much farther than the rays.
            let far = |k: usize| (f64::from(target[k]) - at(k, 0)).abs();
            let exact = (far(0) + far(1) + far(2) + moved) * (1.0 / (1u64 << 49) as f64);
            let is_off = height.abs() > moved * f64::from(1.25 * ROUNDING) + exact;
            let is_well_off = height.abs() > moved * f64::from(4.0 * ROUNDING) + exact;
            let sign = if height > 0.0 { 1.0 } else { -1.0 };
            let (side, mut least) = (height.abs() as f32, height.abs() as f32);
            for k in 0..3 {
                let normal = (n[k] * sign) as f32;
                let (a, b) = (normal * low[k], normal * high[k]);
                least += if a < b { a } else { b };
                sides.normal[k][lane] = normal;
            }
            let margin = 8.0 * ROUNDING * (moved + height.abs()) as f32 + exact as f32;
            sides.side[lane] = side;
            sides.margin[lane] = if is_off { margin } else { f32::INFINITY };
            sides.certain_margin[lane] = if is_well_off { -margin } else { f32::NEG_INFINITY };
            // Unused lanes are NaN, and so are triangles without area, which no ray hits.
            sides.beside[lane] = (is_off & (least > margin)) | height.is_nan();
        }
        sides
    }
}

/// The planes through the target of a fan and the edges of four triangles.
pub struct Edges {
    pub normals: [[[f32; LANES]; 3]; 3],
    /// Starts of rays that are farther from these planes than this are on a side of them.
    pub margin: [f32; LANES],
}

impl Edges {
    #[inline(always)]
    pub fn new(packet: &TrianglePacket, target: [f32; 3], length: f32) -> Edges {
        let mut edges = Edges { normals: [[[0.0; LANES]; 3]; 3], margin: [0.0; LANES] };
        for lane in 0..LANES {
            let at = |k: usize, vertex: usize| packet.rows[4 * k + vertex][lane] - target[k];
            let from = |vertex: usize| [at(0, vertex), at(1, vertex), at(2, vertex)];
            let corners = [from(0), from(1), from(2)];
            let mut greatest = 0.0;
            for e in 0..3 {
                let (a, b) = (corners[e], corners[(e + 1) % 3]);
                for k in 0..3 {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    edges.normals[e][k][lane] = a[i] * b[j] - a[j] * b[i];
                }
                let squared = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
                greatest = if squared > greatest { squared } else { greatest };
            }
            let reach = greatest.sqrt() + length;
            edges.margin[lane] = 32.0 * ROUNDING * length * reach * reach + f32::MIN_POSITIVE;
        }
        edges
    }
}
