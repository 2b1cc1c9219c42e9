//! Textured vertices, many at a time: texture frames and bent normals in vectorised loops, before and after textures are
//! read.

use super::Integrator;
use super::closure_metal_rough::{load_material, store_material};
use super::first_hit::FirstHit;
use super::flat::corners;
use super::hit_point::HitPoint;
use super::lanes::{WAVE, get, set};
use super::wave::{CornerLanes, TexturedLanes, Vertices};
use super::workspace::Workspace;
use crate::bsdf::{Bsdf, LocalFrame, MetalRough};
use crate::color::Rgb;
use crate::math::{Vec2, Vec3, select};
use crate::shape::Surface;
use crate::simd::{Kernel, dispatch, map_each};
use crate::texture::{PointReader, TexturePoint};
use std::ops::Range;

impl Integrator<'_> {
    /// Collects what textured vertex `k`, where ray `i` hit a triangle, is made of.
    #[inline(always)]
    pub(super) fn gather_textured(&self, i: usize, k: usize, w: &mut Workspace) {
        self.gather_corners(i, k, w);
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

    /// Makes textured vertices from their corners and textures.
    pub(super) fn make_textured(&self, bounce: u32, range: Range<usize>, w: &mut Workspace) {
        let vertices = &mut w.wave.vertices;
        self.make_surfaces(range.clone(), vertices);
        dispatch(TextureFrames { vertices, range: range.clone() });
        for k in range.clone() {
            self.read_textures(bounce, k, w);
        }
        dispatch(BendNormals { vertices: &mut w.wave.vertices, range: range.clone() });
        if bounce == 0 && self.first_hits.any() {
            for k in range {
                self.record_first_hit(k, w);
            }
        }
    }

    /// Keeps what outputs besides colour show of vertex `k`, the first of its path.
    fn record_first_hit(&self, k: usize, w: &mut Workspace) {
        let v = &w.wave.vertices;
        let i = v.textured.ray[k] as usize;
        let surface = Surface {
            p: get(&v.p, k),
            p_error: Vec3::ZERO,
            ng: get(&v.ng, k),
            ns: get(&v.ns, k),
            material: w.materials[i],
        };
        let bsdf = Bsdf::MetalRough(load_material(&v.metal_rough, k, self.scene.shading));
        // Nothing that moves is in this group.
        let hit = FirstHit { hit: w.hits[i], time: 0.0, surface, wo: get(&v.wo, k), bsdf: &bsdf };
        w.first_hits.record(w.wave.paths.carried.sample[k] as usize, &hit, &self.shown());
    }

    /// Reads the textures of vertex `k`: what its normal map says, its material, its emission.
    fn read_textures(&self, bounce: u32, k: usize, w: &mut Workspace) {
        let v = &mut w.wave.vertices;
        let i = v.textured.ray[k] as usize;
        let material = &self.scene.materials[w.materials[i] as usize];
        let (p, ng) = (get(&v.p, k), get(&v.ng, k));
        let uv = Vec2::new(v.textured.uv[0][k], v.textured.uv[1][k]);
        let point = TexturePoint {
            uv: [uv, Vec2::ZERO],
            world: p,
            normal: ng,
            // What depends on it is shaded elsewhere.
            cosine: 1.0,
            width: w.arriving.footprints.width[i],
            uv_per_metre: [v.textured.uv_per_metre[k], 0.0],
        };
        let reader = PointReader::new(&self.scene.textures, point);
        set(&mut v.textured.mapped, k, material.mapped(&reader));
        let read = match material.bsdf(&reader, &LocalFrame::STRAIGHT, Rgb::ONE) {
            Bsdf::MetalRough(m) => m,
            _ => MetalRough::BLACK,
        };
        store_material(&mut v.metal_rough, k, &read);
        if material.emission.is_some() {
            let is_back = ng.dot(get(&v.wo, k)) < 0.0;
            let surface = Surface { p, p_error: Vec3::ZERO, ng, ns: ng, material: w.materials[i] };
            let hit = w.hits[i];
            self.emit(bounce, i, &HitPoint { surface, hit, material, is_back, time: 0.0 }, w);
        }
    }
}

/// Texture coordinates and tangents from corners and shading normals.
struct TextureFrames<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for TextureFrames<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let CornerLanes { positions, weights: [second, third], .. } = &v.corners;
            let weights = [1.0 - second[i] - third[i], second[i], third[i]];
            let n = get(&v.ns, i);
            let corners = map_each(corners(positions, i), Vec3::from_array);
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
