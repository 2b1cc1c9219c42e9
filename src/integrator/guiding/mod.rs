//! Paths are guided to where light came from (Müller, Gross, Novák 2017, "Practical Path Guiding for Efficient Light-Transport
//! Simulation"), and ended where little is expected of them (Vorba, Křivánek 2016, "Adjoint-Driven Russian Roulette and
//! Splitting in Light Transport Simulation").
//!
//! Before the first pass, some paths find out how much light comes to the places of a scene from which directions; they
//! bring nothing to the picture. A [`Guide`] keeps that by cells of space and of normals: for each a histogram over the unit
//! square from which directions are made by the map to the cosine lobe, and the mean of what comes. So a direction's density
//! is that of the cosine lobe times the histogram's, the product with the cosine comes for free, and part of each
//! histogram is even, so that no direction is left out.
//!
//! Lambertian vertices are guided, and the diffuse lobe of opaque glTF materials: it is chosen as often as without, and its directions
//! by the histogram. Which cell a vertex uses depends on its place, its normal and the path's random
//! numbers for that alone; all weights against other ways to find the same light (light samples, shared paths) have the
//! guided density. So pictures have the same mean with any guide.
//!
//! What a path may still bring is its throughput times the albedo times the mean of the cell. Roulette compares that with the
//! same at the path's first guided vertex.

pub(super) mod guide;
mod scatter;
mod training;

pub use guide::{CellSamples, Grid, Guide, TrainedCells, TrainingSample};
pub(super) use scatter::{Guided, scatter, scatter_metal_rough};
pub use training::BlockSamples;

use super::Integrator;
use super::shading_groups::{MetalRoughClass, SortedVertices, VertexClass};
use super::wave::{Vertices, WAVE, Wave, get};
use super::workspace::Workspace;
use crate::math::{Frame, Vec3};
use crate::sampling::hash::hash32;
use crate::sampling::warp;
use crate::simd::{Kernel, Table, dispatch};
use std::ops::Range;

impl Integrator<'_> {
    /// Finds the cells of the vertices that are guided.
    pub(super) fn find_cells(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        let (Some(guide), range) = (self.options.guide, sorted.guided()) else { return };
        let wave = &mut *w.wave;
        dispatch(FindKeys { grid: guide.grid, wave, range: range.clone(), bounce });
        let v = &mut wave.vertices.guided;
        for i in range {
            v.cell[i] = guide.find(v.key_low[i], v.key_high[i]);
        }
    }

    /// Finds how densely the vertices would have chosen the directions of their light samples.
    pub(super) fn weigh_light_samples(&self, sorted: &SortedVertices, w: &mut Workspace) {
        if let Some(guide) = self.options.guide {
            let densities = guide.densities();
            let vertices = &mut w.wave.vertices;
            dispatch(LightDensities { vertices, range: sorted.guided(), densities });
            dispatch(LightFactors { vertices, range: sorted.metal_rough() });
        }
    }

    /// The density, over that without a guide, with which vertex `i` might choose the direction of its light sample.
    pub(super) fn light_density(&self, v: &Vertices, i: usize) -> f32 {
        if self.options.guide.is_some() { v.guided.light_density[i] } else { 1.0 }
    }

    /// The density with which vertex `i` would have chosen its path's direction unguided, instead of `pdf`.
    pub(super) fn unguided(&self, pdf: f32, wave: &Wave, i: usize) -> f32 {
        if self.options.guide.is_some() { pdf / wave.vertices.guided.density[i] } else { pdf }
    }
}

/// Where in the densities of all cells ([`Guide::densities`]) is that of a direction at a vertex with this normal?
#[inline(always)]
pub(super) fn place(cell: u32, ns: Vec3, wi: Vec3) -> u32 {
    let local = Frame::from_normal(ns).to_local(wi);
    cell * guide::BINS as u32 + guide::bin(warp::square_of_cosine_hemisphere(local))
}

struct LightDensities<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
    densities: Table<'a, f32>,
}

impl Kernel for LightDensities<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let place = place(v.guided.cell[i], get(&v.ns, i), get(&v.light.wi, i));
            v.guided.light_density[i] = self.densities.at(place);
        }
    }
}

/// Makes the densities of light samples at opaque glTF materials, of which only the diffuse lobe is guided, factors of the whole
/// density.
struct LightFactors<'a> {
    vertices: &'a mut Vertices,
    range: Range<usize>,
}

impl Kernel for LightFactors<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let v = self.vertices;
        for i in self.range.start..self.range.end.min(WAVE) {
            let closure = MetalRoughClass.closure(v, i);
            v.guided.light_density[i] = closure.guided(get(&v.light.wi, i), v.guided.light_density[i]);
        }
    }
}

/// Keeps the random numbers here apart from all others of a path.
const SEED: u32 = 0x51ed_270b;

/// Finds the halves of the keys of vertices. Points are moved along the surface, by at most half a cell either way, so that the
/// borders between cells are blurred.
struct FindKeys<'a> {
    grid: Grid,
    wave: &'a mut Wave,
    range: Range<usize>,
    bounce: u32,
}

impl Kernel for FindKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v, .. } = self.wave;
        let salt = hash32(self.bounce ^ SEED);
        for i in self.range.start..self.range.end.min(WAVE) {
            let n = get(&v.ns, i);
            let frame = Frame::from_normal(n);
            let hash = hash32(hash32(paths.carried.seed[i] ^ salt) ^ paths.carried.shuffled[i]);
            let (s, t) = ((hash & 0xffff) as i32 as f32, (hash >> 16) as i32 as f32);
            let (s, t) = (s * (1.0 / 65_536.0) - 0.5, t * (1.0 / 65_536.0) - 0.5);
            let p = get(&v.p, i) * self.grid.scale + frame.s * s + frame.t * t;
            let [low, high] = self.grid.halves(p, n);
            (v.guided.key_low[i], v.guided.key_high[i]) = (low, high);
        }
    }
}
