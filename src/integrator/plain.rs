//! Plain vertices: Lambertian ones of constant albedo on triangles and quads, made in vectorised loops.

use super::Integrator;
use super::surface::store;
use super::wave::{Lanes3, WAVE, Wave, Workspace, get, get_rgb, set, set_rgb};
use crate::compile::{Surface, shading_normal, triangle_surface};
use crate::simd::{Kernel, dispatch};

impl Integrator<'_> {
    /// Collects what a plain vertex is made of.
    #[inline(always)]
    pub(super) fn gather(&self, bounce: u32, i: usize, k: usize, w: &mut Workspace) {
        let (hit, material) = (&w.hits[i], &self.scene.materials[w.materials[i] as usize]);
        let Some(corners) = self.scene.geometries.corners(hit) else { return };
        w.arriving.copy_to(i, &mut w.wave.paths, k);
        let v = &mut w.wave.vertices;
        for c in 0..3 {
            set(&mut v.corners[c], k, corners.positions[c].into());
        }
        if self.scene.features.normals {
            for c in 0..3 {
                set(&mut v.normals[c], k, corners.normals[c].into());
            }
        }
        (v.weights[0][k], v.weights[1][k]) = (hit.u, hit.v);
        v.one_sided[k] = f32::from(u8::from(!material.is_two_sided));
        set(&mut v.wo, k, -w.rays[i].direction);
        set_rgb(&mut v.albedo, k, material.albedo);
        if bounce == 0 {
            w.radiance[w.arriving.sample[i] as usize][3] = 1.0;
        }
    }

    /// Makes the first vertices, which are plain, from their corners.
    pub(super) fn make_plain(&self, count: usize, wave: &mut Wave) {
        if self.scene.features.normals {
            dispatch(PlainVertices::<true> { wave, count });
        } else {
            dispatch(PlainVertices::<false> { wave, count });
        }
    }
}

/// Makes the plain vertices from their corners, with shading normals or without.
struct PlainVertices<'a, const SMOOTH: bool> {
    wave: &'a mut Wave,
    count: usize,
}

impl<const SMOOTH: bool> Kernel for PlainVertices<'_, SMOOTH> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = &mut self.wave.vertices;
        for i in 0..self.count.min(WAVE) {
            let at = |lanes: &[Lanes3; 3]| [0, 1, 2].map(|c| get(&lanes[c], i).to_array());
            let (a, b) = (v.weights[0][i], v.weights[1][i]);
            let surface = triangle_surface(at(&v.corners), a, b);
            let mut ns = surface.ng;
            if SMOOTH {
                ns = shading_normal(at(&v.normals), a, b, surface.ng);
            }
            let is_back = surface.ng.dot(get(&v.wo, i)) < 0.0;
            let side = if is_back { -1.0 } else { 1.0 };
            let surface = Surface { ng: surface.ng * side, ns: ns * side, ..surface };
            store(v, i, &surface);
            let is_dark = is_back & (v.one_sided[i] > 0.0);
            let albedo = get_rgb(&v.albedo, i) * if is_dark { 0.0 } else { 1.0 };
            set_rgb(&mut v.albedo, i, albedo);
        }
    }
}
