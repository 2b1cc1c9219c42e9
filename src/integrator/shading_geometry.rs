//! Surface hits and corrections of shading normals.

use super::wave::{Vertices, get};
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::compile::CompiledMaterial;
use crate::math::{Frame, Hit, Vec3, select};
use crate::scene::RayKinds;
use crate::shape::Surface;

/// Where a ray hit a surface.
#[derive(Clone, Copy)]
pub(super) struct HitPoint<'a> {
    pub surface: Surface,
    pub hit: Hit,
    pub material: &'a CompiledMaterial,
    /// The ray came from behind.
    pub is_back: bool,
    /// When, where something moves.
    pub time: f32,
    /// The path that arrives, as far as graphs of nodes ask.
    pub path: PathOrigin,
}

/// A material evaluated at a hit.
#[derive(Clone, Copy)]
pub(super) struct EvaluatedMaterial {
    pub bsdf: Bsdf,
    /// Shading normal, on the side of the geometric one.
    pub ns: Vec3,
    pub mapping: Mapping,
}

/// Effect of maps and bumps on a shading normal.
#[derive(Clone, Copy)]
pub(super) struct Mapping {
    /// The normal that they count against: without maps and bumps, but with the bumps of a displacement.
    pub smooth: Vec3,
    /// They gave another shading normal than that of the mesh.
    pub is_mapped: bool,
    /// A displacement's bumps are all over the surface.
    pub has_bumps: bool,
}

// Values of `Vertices::relief`: how light is shadowed near the horizon of a surface whose normal a map or a bump may have given.

/// None did.
pub(super) const UNMAPPED: f32 = 0.0;

/// Facets alone reflect, or the bumps are the surface's: nothing is shadowed.
pub(super) const WHOLE_LIGHT: f32 = 1.0;

/// Diffuse bases: by the relief that the normal is part of.
pub(super) const RELIEF: f32 = 2.0;

/// [`RELIEF`] on the bumps of a displacement.
pub(super) const RELIEF_ON_BUMPS: f32 = 3.0;

/// The squared GGX alpha of that relief, over the squared tangent of the normal's angle to the surface's.
const RELIEF_ALPHA: f32 = 0.125;

impl Mapping {
    /// A surface without maps and bumps.
    pub const fn none(ns: Vec3) -> Mapping {
        Mapping { smooth: ns, is_mapped: false, has_bumps: false }
    }

    /// The mapping of the other side of the surface where `side` is -1.
    pub fn on_side(self, side: f32) -> Mapping {
        Mapping { smooth: self.smooth * side, ..self }
    }
}

impl EvaluatedMaterial {
    /// How its relief shadows light.
    pub fn relief(&self) -> f32 {
        let Mapping { smooth, is_mapped, has_bumps } = self.mapping;
        match is_mapped {
            false => UNMAPPED,
            true if !self.bsdf.has_base() || has_bumps && smooth == self.ns => WHOLE_LIGHT,
            true if has_bumps => RELIEF_ON_BUMPS,
            true => RELIEF,
        }
    }
}

/// Path properties that node graphs read.
#[derive(Clone, Copy)]
pub(super) struct PathOrigin {
    /// Kinds of its ray; none where that isn't known.
    pub kinds: RayKinds,
    /// The ray was reflected or refracted into one direction alone.
    pub is_singular: bool,
    /// Bounces before.
    pub bounces: u16,
}

impl PathOrigin {
    /// Nothing is known.
    pub const UNKNOWN: PathOrigin = PathOrigin { kinds: RayKinds::NONE, is_singular: false, bounces: 0 };
}

/// Smallest cosine between the viewer and the normal that lobes are evaluated around.
const MIN: f32 = 1e-4;

/// Largest cosine by which the mirror direction is lifted above the surface.
const LIFT: f32 = 0.01;

/// The normal that lobes are evaluated around: the shading normal `ns`, tilted towards the geometric one as far as needed for the mirror
/// direction not to lead into the surface, where reflections would be lost and leave black spots. The viewer is on the same side of it
/// as of the surface then. All vectors have unit length; `ns` is on the side of `ng`.
///
/// With `n = (x, z)` in the plane of both normals, z along `ng`, and `w = (u, v)` the viewer in that plane, the mirror direction has the
/// height `t` where `2 (n . w) z - v = t`: `z^2 = (a + v t - u sqrt(a - t^2)) / (2 a)` with `a = u^2 + v^2`. Cycles solves the same
/// (`ensure_valid_specular_reflection`). Bending towards the viewer, out of that plane (Keller et al. 2017, "The Iray Light Transport
/// Simulation and Rendering System", section 3.3), made plastic whose normals lean by 55 degrees 5 % brighter or darker than there.
#[inline(always)]
pub(super) fn scattering_normal(ns: Vec3, ng: Vec3, wo: Vec3) -> Vec3 {
    bent_normal(ns, ng, wo).0
}

/// [`scattering_normal`], and whether that is another normal than `ns`, but for rounding.
#[inline(always)]
pub(super) fn bent_normal(ns: Vec3, ng: Vec3, wo: Vec3) -> (Vec3, bool) {
    let side = if ng.dot(wo) < 0.0 { -1.0 } else { 1.0 };
    let (n, g) = (ns * side, ng * side);
    let seen = wo.dot(g);
    let above = 2.0 * n.dot(wo) * n.dot(g) - seen;
    // A viewer at grazing incidence sees mirror directions at grazing angles.
    let least = if seen < LIFT { 0.9 * seen } else { LIFT };
    let x = n - g * n.dot(g);
    let length = x.length();
    let x = x / if length > 0.0 { length } else { 1.0 };
    let along = wo.dot(x);
    let a = along * along + seen * seen;
    let rest = a - least * least;
    let root = if rest > 0.0 { rest } else { 0.0 }.sqrt();
    let squared = 0.5 * (a + seen * least - along * root) / if a > 1e-30 { a } else { 1e-30 };
    // All is computed, then chosen from: loops over many normals vectorise.
    let squared = if squared < 1.0 { squared } else { 1.0 };
    let squared = if squared > 0.0 { squared } else { 0.0 };
    let bent = x * (1.0 - squared).sqrt() + g * squared.sqrt();
    let is_flat = (ns.x == ng.x) & (ns.y == ng.y) & (ns.z == ng.z);
    let sinks = (above < least) & !is_flat;
    (select(sinks, bent * side, ns), sinks)
}

/// A viewer's direction in the frame of a normal, on the side of that frame that the viewer is on by the geometric normal.
#[inline(always)]
pub(super) fn local_viewer(frame: &Frame, wo: Vec3, ng: Vec3) -> Vec3 {
    let local = frame.to_local(wo);
    let is_below = wo.dot(ng) < 0.0;
    let agrees = (local.z < 0.0) == is_below;
    Vec3::new(
        local.x,
        local.y,
        if agrees { local.z } else { MIN.copysign(if is_below { -1.0 } else { 1.0 }) },
    )
}

/// The height over the geometric surface at which light is whole, over the sine of the angle between the normals.
const WHOLE: f32 = 0.5;

/// Share of uniform light that a diffuse surface would lose by the softened terminator alone, over the squared sine of the angle
/// between the normals, up to the angle of this cosine: 0.158 to 0.166 by quadrature. Beyond, it falls off with the
/// cosine.
const LOST: f32 = 0.16;
const STEEP: f32 = 0.45;

/// The factor on light from `wi` to a surface shaded with `ns` (Chiang, Li, Burley 2019, "Taming the Shadow
/// Terminator", eq. 3 and 4): falls to 0 where the light sinks below the geometric surface, which otherwise cuts it off
/// along the edges of triangles. 1 where both normals are the same or `wi` is on the far side.
///
/// Deviations: the paper's term takes light from far above the horizon as well, in even light 3.5 % where the normals are
/// 10 degrees apart and 9.5 % at 25. Here light that is higher than [`WHOLE`] times the sine of that angle is not dimmed, and
/// of the paper's term and a ramp up to there the larger counts: that takes 0.5 % and 2.9 %. All is divided by what
/// is left of even light then, so that a diffuse surface reflects as much of it as where the triangles cut it off.
/// Glossy lobes that see nothing of the horizon are brighter by that. Like the paper's term it depends on the light's
/// direction and not on the viewer's: it is not reciprocal, and paths from lights apply it to the same end.
#[inline(always)]
fn terminator(ns: Vec3, ng: Vec3, wi: Vec3) -> f32 {
    let (of_surface, of_shading, cosine) = (wi.dot(ng), wi.dot(ns), ng.dot(ns));
    let below = of_shading * cosine;
    let squared = 1.0 - cosine * cosine;
    let squared = if squared > 0.0 { squared } else { 0.0 };
    let whole = WHOLE * squared.sqrt();
    let height = if below < whole { below } else { whole };
    let ratio = of_surface / if height > 0.0 { height } else { 1.0 };
    let is_above = of_surface > 0.0;
    let g = if is_above & (height > 0.0) & (ratio < 1.0) { ratio } else { 1.0 };
    let left = 1.0 - LOST * squared * if cosine < STEEP { cosine * (1.0 / STEEP) } else { 1.0 };
    g * (1.0 + g * (1.0 - g)) / if is_above { left } else { 1.0 }
}

/// The terminator where a map or a bump gave `ns`, as in Cycles: shadowing by the microfacets that most likely have such a normal (Conty
/// Estevez, Lecocq, Stein 2019, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem", eq. 12.3 and 12.5).
/// Light that sees both sides of the relief is that of the mapped normal alone: such normals lean by tens of degrees, where
/// making up for the loss in even light would brighten lights visibly (12 % at 55 degrees). The relief is one of the smooth surface
/// that triangles stand for, `smooth` its normal: no light comes from below.
#[inline(always)]
fn mapped_terminator([ns, smooth, wi]: [Vec3; 3]) -> f32 {
    let squared_tangent = |cosine: f32| {
        let squared = cosine * cosine;
        (1.0 - squared) / if squared > 1e-12 { squared } else { 1e-12 }
    };
    let height = wi.dot(smooth);
    let squared_alpha = RELIEF_ALPHA * squared_tangent(smooth.dot(ns));
    let squared_alpha = if squared_alpha < 1.0 { squared_alpha } else { 1.0 };
    let masked = squared_alpha * squared_tangent(height);
    let masked = if masked > 0.0 { masked } else { 0.0 };
    if height > 0.0 { 2.0 / (1.0 + (1.0 + masked).sqrt()) } else { 0.0 }
}

/// The factor on light to a surface shaded with `ns`, by [`terminator`] where no map gave that normal; where one did, by that of the
/// normal `smooth` beneath. Cycles 5.0 doesn't soften what the bumps of a displacement shadow. Normals and `wi` are on
/// the same side of the surface.
#[inline(always)]
pub(super) fn terminator_at(relief: f32, [ns, smooth, ng]: [Vec3; 3], wi: Vec3) -> f32 {
    let is_softened = (relief == UNMAPPED) | (relief == RELIEF);
    let soft = terminator(select(relief == RELIEF, smooth, ns), ng, wi);
    if is_softened { soft } else { 1.0 }
}

/// The factor on what a surface reflects diffusely besides, where a map gave its normal: [`mapped_terminator`].
///
/// Facets keep all light. Cycles cuts off light samples below the smooth normal, but not what facets reflect of the sky: balls of
/// roughness 0.4 in even light come within 0.4 % of its like this and lose 3 % by a cut.
#[inline(always)]
pub(super) fn relief_at(relief: f32, [ns, smooth]: [Vec3; 2], wi: Vec3) -> f32 {
    let mapped = mapped_terminator([ns, smooth, wi]);
    if relief >= RELIEF { mapped } else { 1.0 }
}

/// A value of which the diffuse part is dimmed by a relief.
#[inline(always)]
pub(super) fn under_relief(value: Rgb, diffuse: Rgb, relief: f32) -> Rgb {
    value - diffuse.min(value) * (1.0 - relief)
}

/// Correction of shading normals for light near the horizon.
pub(super) trait Horizon: Copy + Sync {
    /// Is there anything to ask for?
    const SOFTENS: bool = true;

    /// Are there mapped normals?
    const HAS_RELIEF: bool = false;

    /// The factor on light from `wi` at vertex `i`, whose shading normal is `ns` and geometric one `ng`, both on the side of `wi`; `side` is -1 where those
    /// of the vertex are on the other side.
    fn light_factor(self, v: &Vertices, i: usize, normals: [Vec3; 2], side: f32, wi: Vec3) -> f32;

    /// The factor on the diffuse part besides, with `ns` and `side` as above.
    #[inline(always)]
    fn relief(self, _: &Vertices, _: usize, _: Vec3, _: f32, _: Vec3) -> f32 {
        1.0
    }
}

/// Which of them a scene needs.
#[derive(Clone, Copy)]
pub(super) enum Terminator {
    Sharp,
    Soft,
    Relief,
    SharpRelief,
}

impl Terminator {
    /// What is left of a BSDF value and its diffuse part for light from `wi`: the value on the relief, and a factor. `normals` are the normal that lobes
    /// are evaluated around, the smooth and the geometric one; the relief is that of `ns`.
    pub fn left(
        self,
        (value, diffuse): (Rgb, Rgb),
        relief: f32,
        (ns, normals): (Vec3, [Vec3; 3]),
        wi: Vec3,
    ) -> (Rgb, f32) {
        let on_relief = || under_relief(value, diffuse, relief_at(relief, [ns, normals[1]], wi));
        match self {
            Terminator::Sharp => (value, 1.0),
            Terminator::SharpRelief => (on_relief(), 1.0),
            Terminator::Soft | Terminator::Relief => (on_relief(), terminator_at(relief, normals, wi)),
        }
    }
}

/// Surfaces cut off light where their triangles do.
#[derive(Clone, Copy)]
pub(super) struct Sharp;

/// Shadow terminators are softened, in scenes without mapped normals.
#[derive(Clone, Copy)]
pub(super) struct Soft;

/// [`Soft`] in scenes with mapped normals.
#[derive(Clone, Copy)]
pub(super) struct Relief;

/// [`Sharp`] in scenes with mapped normals, whose relief shadows light.
#[derive(Clone, Copy)]
pub(super) struct SharpRelief;

impl Horizon for SharpRelief {
    const HAS_RELIEF: bool = true;

    #[inline(always)]
    fn light_factor(self, _: &Vertices, _: usize, _: [Vec3; 2], _: f32, _: Vec3) -> f32 {
        1.0
    }

    #[inline(always)]
    fn relief(self, v: &Vertices, i: usize, ns: Vec3, side: f32, wi: Vec3) -> f32 {
        Relief.relief(v, i, ns, side, wi)
    }
}

impl Horizon for Sharp {
    const SOFTENS: bool = false;

    #[inline(always)]
    fn light_factor(self, _: &Vertices, _: usize, _: [Vec3; 2], _: f32, _: Vec3) -> f32 {
        1.0
    }
}

impl Horizon for Soft {
    #[inline(always)]
    fn light_factor(self, _: &Vertices, _: usize, [ns, ng]: [Vec3; 2], _: f32, wi: Vec3) -> f32 {
        terminator(ns, ng, wi)
    }
}

impl Horizon for Relief {
    const HAS_RELIEF: bool = true;

    #[inline(always)]
    fn light_factor(self, v: &Vertices, i: usize, [ns, ng]: [Vec3; 2], side: f32, wi: Vec3) -> f32 {
        terminator_at(v.relief[i], [ns, get(&v.smooth, i) * side, ng], wi)
    }

    #[inline(always)]
    fn relief(self, v: &Vertices, i: usize, ns: Vec3, side: f32, wi: Vec3) -> f32 {
        relief_at(v.relief[i], [ns, get(&v.smooth, i) * side], wi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;

    /// Where one viewer leaves a normal as it is, what others make of it is what they make of the original.
    #[test]
    fn normals_that_are_not_bent_are_the_original() {
        let mut random = Random::new(12);
        let (mut straight, mut bent) = (0, 0);
        for _ in 0..100_000 {
            let (ng, mut first, mut second) = (random.direction(), random.direction(), random.direction());
            first *= first.dot(ng).signum();
            second *= second.dot(ng).signum();
            let ns = (ng + 0.8 * random.direction()).normalize();
            if ns.dot(ng) <= 0.0 {
                continue;
            }
            let (of_first, is_bent) = bent_normal(ns, ng, first);
            if is_bent {
                bent += 1;
                continue;
            }
            straight += 1;
            assert!(of_first.distance(ns) < 1e-6, "{ns} {of_first}");
            let ((a, is_a_bent), (b, is_b_bent)) =
                (bent_normal(ns, ng, second), bent_normal(of_first, ng, second));
            // Rounding may decide at the very edge.
            assert!(is_a_bent == is_b_bent && a.distance(b) < 1e-4 || a.distance(b) < 2e-3, "{ns}: {a} {b}");
            assert!(is_a_bent || a.distance(ns) < 1e-6);
        }
        assert!(straight > 10_000 && bent > 10_000, "{straight} {bent}");
    }

    #[test]
    fn viewers_and_mirror_directions_are_above() {
        let mut random = Random::new(11);
        for _ in 0..100_000 {
            let (ng, mut ns, wo) = (random.direction(), random.direction(), random.direction());
            if ns.dot(ng) < 0.0 {
                ns = -ns;
            }
            let side = ng.dot(wo).signum();
            if ng.dot(wo).abs() < 1e-3 {
                continue;
            }
            let n = scattering_normal(ns, ng, wo);
            assert!((n.length() - 1.0).abs() < 1e-5);
            assert!(n.dot(wo) * side > 0.0, "{ng} {ns} {wo}: {n}");
            let mirror = n * (2.0 * n.dot(wo)) - wo;
            assert!(mirror.dot(ng) * side > 0.0, "{ng} {ns} {wo}: {n}, {}", mirror.dot(ng));
        }
    }

    #[test]
    fn good_normals_stay() {
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let ns = Vec3::new(-0.1, 0.2, 1.0).normalize();
        assert!((scattering_normal(ns, Vec3::Z, wo) - ns).length() < 1e-6);
        assert_eq!(scattering_normal(Vec3::Z, Vec3::Z, wo), Vec3::Z);
    }

    /// A diffuse surface reflects as much of even light as where its triangles cut light off, but for rounding and the fit.
    #[test]
    fn the_terminator_keeps_even_light() {
        for degrees in [1.0f64, 5.0, 10.0, 25.0, 40.0, 60.0, 75.0, 85.0] {
            let angle = degrees.to_radians();
            let ns = Vec3::new(angle.sin() as f32, 0.0, angle.cos() as f32);
            let (mut cut, mut soft) = (0.0f64, 0.0f64);
            // Midpoints, closer to each other at the horizon.
            let n = 400;
            for (i, k) in (0..n).flat_map(|i| (0..2 * n).map(move |k| (i, k))) {
                let root = (f64::from(i) + 0.5) / f64::from(n);
                let azimuth = (f64::from(k) + 0.5) / f64::from(2 * n) * std::f64::consts::PI;
                let z = root * root;
                let r = (1.0 - z * z).sqrt();
                let wi = Vec3::new((r * azimuth.cos()) as f32, (r * azimuth.sin()) as f32, z as f32);
                let light = root * f64::from(wi.dot(ns).max(0.0));
                cut += light;
                soft += light * f64::from(terminator(ns, Vec3::Z, wi));
            }
            let most = if degrees <= 60.0 { 0.004 } else { 0.01 };
            assert!((soft / cut - 1.0).abs() < most, "{degrees}: {}", soft / cut);
        }
    }

    /// Lamps overhead light a relief as its normal says; towards the horizon light fades out, by what Cycles 5.0 shows of a plane
    /// whose normals all lean by 54.7 degrees.
    #[test]
    fn mapped_normals_are_lit_as_in_cycles() {
        let ns = Vec3::new(1.0, -1.0, 1.0).normalize();
        for (degrees, kept) in
            [(0.0f32, 1.0), (50.0, 0.70361 / 0.76134), (60.0, 0.86101), (80.0, 0.34485 / 0.69060)]
        {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let wi = Vec3::new(sine * 0.6, sine * 0.8, cosine);
            let found =
                terminator_at(RELIEF, [ns, Vec3::Z, Vec3::Z], wi) * relief_at(RELIEF, [ns, Vec3::Z], wi);
            assert!((found - kept).abs() < 5e-4, "{degrees}: {found}, {kept} in Cycles");
        }
        let wi = Vec3::new(0.8, 0.0, 0.6);
        assert_eq!(terminator_at(RELIEF, [Vec3::Z; 3], wi), 1.0);
        assert_eq!(relief_at(RELIEF, [Vec3::Z; 2], wi), 1.0);
    }

    #[test]
    fn the_terminator_is_smooth() {
        let (ng, ns) = (Vec3::Z, Vec3::new(0.5, 0.0, 0.75f32.sqrt()));
        let at = |sine: f32| terminator(ns, ng, Vec3::new((1.0 - sine * sine).sqrt(), 0.0, sine));
        let whole = 1.0 / (1.0 - LOST * 0.25);
        assert!(at(1e-3) < 0.01 && (at(0.999) - whole).abs() < 1e-6);
        let mut last = 0.0;
        for i in 1..100 {
            let value = at(i as f32 / 100.0);
            assert!(value >= last && value <= whole + 1e-6);
            last = value;
        }
        assert_eq!(terminator(ng, ng, Vec3::new(0.6, 0.0, 0.8)), 1.0);
    }
}
