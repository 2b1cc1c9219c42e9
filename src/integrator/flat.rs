//! Vertices on triangles and quads: their corners are gathered path by path, their surfaces made in vectorised loops.

use super::Integrator;
use super::lanes::{Lanes3, WAVE, get, set};
use super::wave::{CornerLanes, Vertices};
use super::workspace::Workspace;
use crate::shape::{Surface, shading_normal, triangle_surface};
use crate::simd::{Kernel, dispatch};
use std::ops::Range;

impl Integrator<'_> {
    /// Collects what vertex `k`, where ray `i` hit a triangle or quad, is made of.
    #[inline(always)]
    pub(super) fn gather_corners(&self, i: usize, k: usize, w: &mut Workspace) {
        let hit = &w.hits[i];
        let Some(corners) = self.scene.geometries.corners(hit) else { return };
        let v = &mut w.wave.vertices;
        for c in 0..3 {
            set(&mut v.corners.positions[c], k, corners.positions[c].into());
        }
        if self.scene.features.normals {
            for c in 0..3 {
                set(&mut v.corners.normals[c], k, corners.normals[c].into());
            }
        }
        (v.corners.weights[0][k], v.corners.weights[1][k]) = (hit.u, hit.v);
        set(&mut v.wo, k, -w.rays[i].direction);
    }

    /// Makes surfaces from corners, with normals on the front.
    pub(super) fn make_surfaces(&self, range: Range<usize>, vertices: &mut Vertices) {
        if self.scene.features.normals {
            dispatch(Surfaces::<true> { vertices, range });
        } else {
            dispatch(Surfaces::<false> { vertices, range });
        }
    }

    /// Makes plain vertices: surfaces, normals towards the viewer.
    pub(super) fn make_plain(&self, range: Range<usize>, vertices: &mut Vertices) {
        self.make_surfaces(range.clone(), vertices);
        dispatch(Orient { vertices, range });
    }
}

/// Keeps a surface.
#[inline(always)]
pub(super) fn store(v: &mut Vertices, k: usize, surface: &Surface) {
    set(&mut v.p, k, surface.p);
    set(&mut v.ng, k, surface.ng);
    set(&mut v.ns, k, surface.ns);
    v.offset[k] = surface.ng.abs().dot(surface.p_error);
}

/// Positions or normals of the corners of vertex `i`.
#[inline(always)]
pub(super) fn corners(lanes: &[Lanes3; 3], i: usize) -> [[f32; 3]; 3] {
    [get(&lanes[0], i).to_array(), get(&lanes[1], i).to_array(), get(&lanes[2], i).to_array()]
}

/// Surfaces from corners, with shading normals or without.
struct Surfaces<'a, const SMOOTH: bool> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl<const SMOOTH: bool> Kernel for Surfaces<'_, SMOOTH> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let CornerLanes { positions, normals, weights: [a, b] } = &v.corners;
            let mut surface = triangle_surface(corners(positions, i), a[i], b[i]);
            if SMOOTH {
                surface.ns = shading_normal(corners(normals, i), a[i], b[i], surface.ng);
            }
            store(v, i, &surface);
        }
    }
}

/// Turns the normals of plain vertices to the viewers.
struct Orient<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for Orient<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (ng, ns) = (get(&v.ng, i), get(&v.ns, i));
            let side = if ng.dot(get(&v.wo, i)) < 0.0 { -1.0 } else { 1.0 };
            set(&mut v.ng, i, ng * side);
            set(&mut v.ns, i, ns * side);
        }
    }
}
