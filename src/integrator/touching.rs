//! Solids that touch: where the surface of one lies on that of another, as that of a liquid on its glass, paths meet both
//! at once.
//!
//! Either of the two may be hit first, by rounding, and a path that goes on behind it starts behind the other one. So the
//! other is looked for where a solid is hit. What comes of it is what an overlap of no thickness would do: all of them
//! are crossed, light is refracted once, from what was on the near side to what is on the far side, and takes the colours of all
//! whose edges these are. The surface that refracts is that of the solid of the higher priority, and among equals
//! of the denser one, so that the ways of light in both directions agree.

use super::Integrator;
use super::hit_point::HitPoint;
use super::media::{Boundary, hidden};
use super::wave::Paths;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::CompiledMaterial;
use crate::math::{Ray, Vec3, gamma};

/// Surfaces in one place, beside the one that was hit.
const MOST: usize = 3;

/// How far apart surfaces in one place may be, in bounds on the rounding of both together.
const NEAR: f32 = 4.0;

/// Cosine between the normals of surfaces that lie on each other.
const PARALLEL: f32 = 0.9999;

/// Least cosine of a ray with a surface for which others are looked for as far along the ray as they may be.
const GRAZING: f32 = 0.01;

/// The surface of a solid that a path meets.
#[derive(Clone, Copy)]
pub(super) struct Met<'a> {
    pub at: HitPoint<'a>,
    pub bsdf: Bsdf,
    /// Shading normal.
    pub ns: Vec3,
    /// What the path covers there.
    pub width: f32,
}

/// The surfaces that touch one.
pub(super) type Touching<'a> = [Option<HitPoint<'a>>; MOST];

impl Integrator<'_> {
    /// The surfaces of other solids that lie on the one that a ray hit, if there are any.
    #[inline]
    pub(super) fn touching(&self, ray: &Ray, at: &HitPoint<'_>) -> Option<Touching<'_>> {
        if self.scene.features.touching { self.find_touching(ray, at) } else { None }
    }

    fn find_touching(&self, ray: &Ray, at: &HitPoint<'_>) -> Option<Touching<'_>> {
        let mut list = [None; MOST];
        let rounding = |at: &HitPoint<'_>| at.surface.ng.abs().dot(at.surface.p_error);
        // Objects are placed in the world, whose origin may be far away.
        let place = (self.scene.anchor.as_vec3() + at.surface.p).abs().max_element() * gamma(4);
        let reach = |own: f32| NEAR * own + place;
        let cosine = at.surface.ng.dot(ray.direction).abs().max(GRAZING);
        let hit = at.hit;
        let mut next = Ray {
            t_min: hit.t.next_down(),
            t_max: hit.t + reach(2.0 * rounding(at)) / cosine,
            origin_primitive: (&hit).into(),
            ..*ray
        };
        let mut count = 0;
        // The triangles around an edge or a corner count once, and may be many.
        for _ in 0..4 * MOST {
            let hit = self.scene.accel.closest_one_in_time(&next, at.time);
            if !hit.is_hit() || count == MOST {
                break;
            }
            (next.t_min, next.origin_primitive) = (hit.t, (&hit).into());
            let other = self.point_of(ray, hit, self.scene.geometries.material(&hit), at.time);
            let way = other.surface.p - at.surface.p;
            let lies_there = other.surface.ng.dot(at.surface.ng).abs() >= PARALLEL
                && way.dot(at.surface.ng).abs() <= reach(rounding(at) + rounding(&other));
            let is_solid = other.material.medium_index != 0 && !other.material.is_boundary;
            let known = || list.iter().flatten().chain([at]);
            let is_known = || known().any(|k| is_same_crossing(k, &other));
            if lies_there && is_solid && !is_known() {
                list[count] = Some(other);
                count += 1;
            }
        }
        (count > 0).then_some(list)
    }

    /// What a path finds where the surfaces of several solids lie on each other, as one surface: the one that counts, with all
    /// of them within its error.
    pub(super) fn boundary_of_touching<'a>(
        &'a self,
        first: Met<'a>,
        touching: Touching<'a>,
        wo: Vec3,
        (bounce, i): (u32, usize),
        paths: &mut Paths,
        waves: Option<&Wavelengths>,
    ) -> (Met<'a>, Boundary) {
        let width = first.width;
        let others = touching.iter().flatten().map(|at| {
            let (bsdf, ns) = self.read_material(at, width, wo, waves);
            Met { at: *at, bsdf, ns, width }
        });
        let all = || std::iter::once(first).chain(others.clone());
        if let Some(left) = all().find(|met| met.at.is_back) {
            self.assume_inside(left.at.material, first.at.hit.t, i, paths, waves);
        }
        let here = paths.interior[i];
        let mut beyond = here;
        for own in all().filter(|met| met.at.is_back).map(|met| met.at.material.medium_index) {
            beyond = beyond.left(if beyond.contains(own) { own } else { beyond.medium() });
        }
        for entered in all().filter(|met| !met.at.is_back) {
            beyond = self.entered(beyond, entered.at.material.medium_index);
        }
        let (near, far) = (here.medium(), beyond.medium());
        let counts = |met: &Met<'_>| {
            near != far && met.at.material.medium_index == if met.at.is_back { near } else { far }
        };
        let best = all()
            .filter(counts)
            .reduce(|a, b| if self.rank(b.at.material) > self.rank(a.at.material) { b } else { a });
        // Those that end or begin here, unless the surface that counts is theirs.
        let counted = best.map(|met| met.at.material.medium_index);
        let is_edge = |medium: u16| here.contains(medium) != beyond.contains(medium);
        let tint = all()
            .filter(|met| Some(met.at.material.medium_index) != counted)
            .filter(|met| is_edge(met.at.material.medium_index))
            .fold(Rgb::ONE, |tint, met| tint * met.bsdf.crossing_tint());
        let mut met = best.unwrap_or(first);
        for other in all() {
            let way = (other.at.surface.p - met.at.surface.p).abs();
            met.at.surface.p_error = met.at.surface.p_error.max(way + other.at.surface.p_error);
        }
        let Some(best) = best else {
            return (met, Boundary { bsdf: hidden(tint), is_inverted: false, beyond });
        };
        let sides = if best.at.is_back { [near, far] } else { [far, near] };
        let (bsdf, is_inverted) = self.interface(best.bsdf, (sides, false), (bounce, i), paths, waves);
        let bsdf = if tint == Rgb::ONE { bsdf } else { bsdf.tinted(tint) };
        (met, Boundary { bsdf, is_inverted, beyond })
    }

    /// Which of two solids that touch has the surface that counts: the one of the higher rank.
    fn rank(&self, material: &CompiledMaterial) -> (i32, f32, u16) {
        let medium = &self.scene.media[usize::from(material.medium_index)];
        let ior = medium.iors.map_or(f32::INFINITY, |[_, green, _]| green);
        (medium.priority, ior, material.medium_index)
    }
}

/// Do two points lie on the surface of one body, which is crossed once there?
fn is_same_crossing(a: &HitPoint<'_>, b: &HitPoint<'_>) -> bool {
    a.material.medium_index == b.material.medium_index && a.is_back == b.is_back
}
