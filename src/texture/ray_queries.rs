//! Rays that node graphs trace from a hit into the scene. The integrator answers the queries.

use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::hash32;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use std::fmt;

/// Queries of rays in a scene.
pub trait RayQueries: Sync {
    /// The number of unoccluded rays from a hit; with `only_local`, only the object that was hit occludes.
    fn count_unoccluded(&self, from: &RayOrigin<'_>, rays: &[Ray], only_local: bool) -> u32;

    /// Passes the crossings of a ray with the object that was hit, in order of their distance.
    fn visit_crossings(&self, from: &RayOrigin<'_>, ray: &Ray, visit: &mut dyn FnMut(&Crossing));
}

/// Where a ray crosses a surface. Normals are those of the front, unit length, world space.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    pub point: Vec3,
    /// Geometric normal.
    pub ng: Vec3,
    /// Shading normal.
    pub ns: Vec3,
}

/// Where the rays of nodes start: a hit of a path.
#[derive(Clone, Copy)]
pub struct RayOrigin<'a> {
    pub scene: &'a dyn RayQueries,
    pub hit: Hit,
    /// Error bound of the hit point, metres.
    pub p_error: Vec3,
    /// Shutter time, 0..1.
    pub time: f32,
    /// Source of random numbers.
    pub sample: SobolPoint,
    /// Indices of the sets of Sobol dimensions for ambient occlusion and for bevels.
    pub dimension_sets: [u32; 2],
    /// Was the path scattered by sharp lobes only? Others show no bevels.
    pub is_sharp: bool,
}

impl RayOrigin<'_> {
    /// Pairs of random numbers in 0..1 for a number of rays: the start of a Sobol sequence with scrambles of this hit alone. Parts of a
    /// sequence that pixels share would give all pixels of a region similar patterns of rays, on which the mean behind a colour ramp depends.
    pub fn random_pairs(&self, dimension_set: u32, count: u32) -> impl Iterator<Item = [f32; 2]> {
        let dimensions = Dimensions::new(dimension_set);
        let (seed, index_rev) = self.sample.to_parts();
        let own_seed = hash32(seed ^ hash32(index_rev ^ dimension_set));
        (0..count).map(move |i| {
            let [u, v, ..] = SobolPoint::new(own_seed, i).sample_4d(&dimensions);
            [u, v]
        })
    }
}

impl fmt::Debug for RayOrigin<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RayOrigin").field("hit", &self.hit).finish_non_exhaustive()
    }
}
