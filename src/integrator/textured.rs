//! Textured vertices, many at a time: their surfaces in vectorised loops, before and after textures are read.

use super::Integrator;
use super::metal_rough;
use super::surface::store;
use super::wave::{Lanes3, TexturedLanes, Vertices, WAVE, Wave, Workspace, get, get_rgb, set, set_rgb};
use crate::bsdf::{Bsdf, LocalFrame, MetalRough};
use crate::color::Rgb;
use crate::compile::{Surface, shading_normal, triangle_surface};
use crate::film::AovSample;
use crate::math::{Vec2, Vec3, select};
use crate::simd::{Kernel, dispatch};
use crate::texture::{PointReader, TexturePoint};
use std::ops::Range;

impl Integrator<'_> {
    /// Collects what a textured vertex is made of.
    #[inline(always)]
    pub(super) fn gather_textured(&self, bounce: u32, i: usize, k: usize, w: &mut Workspace) {
        self.gather(bounce, i, k, w);
        let Some(corners) = self.scene.geometries.texture_corners(&w.hits[i]) else { return };
        let t = &mut w.wave.vertices.textured;
        for c in 0..3 {
            (t.corner_uv[c][0][k], t.corner_uv[c][1][k]) = (corners.uv[c][0], corners.uv[c][1]);
            let [x, y, z, _] = corners.tangents[c];
            set(&mut t.tangents[c], k, Vec3::new(x, y, z));
        }
        let [x, y, z, w] = corners.tangents[0];
        t.handedness[k] = if [x, y, z, w] == [0.0; 4] { 0.0 } else { 1.0f32.copysign(w) };
        t.ray[k] = i as u32;
    }

    /// Makes the vertices from their corners and reads their textures.
    pub(super) fn look_at_textured(&self, bounce: u32, range: Range<usize>, w: &mut Workspace) {
        let wave = &mut *w.wave;
        let (first, last) = (range.clone(), range.clone());
        if self.scene.features.normals {
            dispatch(Surfaces::<true> { wave, range: first });
        } else {
            dispatch(Surfaces::<false> { wave, range: first });
        }
        for k in range.clone() {
            self.read_textures(k, w);
        }
        dispatch(BendNormals { vertices: &mut w.wave.vertices, range: last });
        if bounce == 0 && self.options.aovs {
            for k in range {
                self.describe_first(k, w);
            }
        }
    }

    /// Keeps what AOVs show of the first surface.
    fn describe_first(&self, k: usize, w: &mut Workspace) {
        let v = &w.wave.vertices;
        w.aovs[w.wave.paths.sample[k] as usize] = Some(AovSample {
            depth: self.scene.camera.depth(get(&v.p, k)),
            normal: get(&v.ns, k).to_array(),
            albedo: get_rgb(&v.albedo, k).to_array(),
        });
    }

    fn read_textures(&self, k: usize, w: &mut Workspace) {
        let v = &mut w.wave.vertices;
        let i = v.textured.ray[k] as usize;
        let material = &self.scene.materials[w.materials[i] as usize];
        let (p, ng) = (get(&v.p, k), get(&v.ng, k));
        let uv = Vec2::new(v.textured.uv[0][k], v.textured.uv[1][k]);
        let point = TexturePoint {
            uv: [uv, Vec2::ZERO],
            world: p,
            normal: ng,
            width: w.arriving.cone_width[i],
            uv_per_metre: [v.textured.uv_per_metre[k], 0.0],
        };
        let reader = PointReader::new(&self.scene.textures, point);
        set(&mut v.textured.mapped, k, material.mapped(&reader));
        let is_back = ng.dot(get(&v.wo, k)) < 0.0;
        let seen = match material.bsdf(&reader, &LocalFrame::STRAIGHT, Rgb::ONE) {
            Bsdf::MetalRough(m) if material.is_two_sided || !is_back => m,
            _ => MetalRough::BLACK,
        };
        metal_rough::store(&mut v.metal_rough, k, &seen);
        set_rgb(&mut v.albedo, k, seen.albedo());
        if material.emission.is_some() {
            let surface = Surface { p, p_error: Vec3::ZERO, ng, ns: ng, material: w.materials[i] };
            let hit = w.hits[i];
            self.emit(i, material, &surface, &hit, is_back, w);
        }
    }
}

/// Points, normals on the front, texture coordinates and tangents; with shading normals or without.
struct Surfaces<'a, const SMOOTH: bool> {
    wave: &'a mut Wave,
    range: Range<usize>,
}

impl<const SMOOTH: bool> Kernel for Surfaces<'_, SMOOTH> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = &mut self.wave.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (a, b) = (v.weights[0][i], v.weights[1][i]);
            let mut surface = triangle_surface(corners(&v.corners, i), a, b);
            if SMOOTH {
                surface.ns = shading_normal(corners(&v.normals, i), a, b, surface.ng);
            }
            store(v, i, &surface);
        }
        for i in self.range.start..self.range.end.min(WAVE) {
            let weights = [1.0 - v.weights[0][i] - v.weights[1][i], v.weights[0][i], v.weights[1][i]];
            let n = get(&v.ns, i);
            let corners = corners(&v.corners, i).map(Vec3::from_array);
            let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
            let t = &mut v.textured;
            let uv = |c: usize| Vec2::new(t.corner_uv[c][0][i], t.corner_uv[c][1][i]);
            let (d1, d2) = (uv(1) - uv(0), uv(2) - uv(0));
            let at = uv(0) * weights[0] + uv(1) * weights[1] + uv(2) * weights[2];
            let determinant = d1.x * d2.y - d1.y * d2.x;
            let per_metre = (determinant.abs() / e1.cross(e2).length()).sqrt();
            // Tangents of the vertices where there are some, else where texture coordinates grow; v grows downwards.
            let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
            let by_uv = (e1 * d2.y - e2 * d1.y) * sign;
            let up = (e1 * d2.x - e2 * d1.x) * sign;
            let of_vertices = (0..3).fold(Vec3::ZERO, |sum, c| sum + get(&t.tangents[c], i) * weights[c]);
            let hand_by_uv = if n.cross(by_uv).dot(up) < 0.0 { -1.0 } else { 1.0 };
            let given = flat(of_vertices, n);
            let uses_given = (t.handedness[i] != 0.0) & (given.length_squared() > LEAST_SQUARED);
            let tangent = select(uses_given, given, flat(by_uv, n));
            let hand = if uses_given { t.handedness[i] } else { hand_by_uv };
            let length = tangent.length();
            let scale = if length * length > LEAST_SQUARED { 1.0 / length } else { 0.0 };
            let tangent = tangent * scale;
            let bitangent = n.cross(tangent) * if hand < 0.0 { -1.0 } else { 1.0 };
            (t.uv[0][i], t.uv[1][i]) = (at.x, at.y);
            t.uv_per_metre[i] = per_metre;
            set(&mut t.tangent, i, tangent);
            set(&mut t.bitangent, i, bitangent);
        }
    }
}

/// Shorter tangents count as none.
const LEAST_SQUARED: f32 = 1e-30;

#[inline(always)]
fn corners(lanes: &[Lanes3; 3], i: usize) -> [[f32; 3]; 3] {
    [get(&lanes[0], i).to_array(), get(&lanes[1], i).to_array(), get(&lanes[2], i).to_array()]
}

/// The part of a vector that is perpendicular to a normal.
#[inline(always)]
fn flat(v: Vec3, n: Vec3) -> Vec3 {
    v - n * n.dot(v)
}

/// Bends normals as the maps say, and turns them to the viewers.
struct BendNormals<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for BendNormals<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let (ns, ng) = (get(&v.ns, i), get(&v.ng, i));
            let TexturedLanes { tangent, bitangent, mapped, .. } = &v.textured;
            let (t, m) = (get(tangent, i), get(mapped, i));
            let bent = t * m.x + get(bitangent, i) * m.y + ns * m.z;
            let length = bent.length();
            // Not where the map leads to the other side, nor where it has no directions to go by.
            let is_mapped = (bent.dot(ns) > 0.0) & (length > 0.0) & (t.length_squared() > 0.0);
            let n = select(is_mapped, bent / if length > 0.0 { length } else { 1.0 }, ns);
            let side = if ng.dot(get(&v.wo, i)) < 0.0 { -1.0 } else { 1.0 };
            set(&mut v.ng, i, ng * side);
            set(&mut v.ns, i, n * side);
        }
    }
}
