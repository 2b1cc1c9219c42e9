//! Surface hits and corrections of shading normals.

use super::wave::{Vertices, get};
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::compile::{CompiledMaterial, SurfaceCoordinates};
use crate::math::{Frame, Hit, Vec3, select};
use crate::sampling::sampler::SobolPoint;
use crate::scene::RayKinds;
use crate::shape::Surface;
use crate::texture::GraphResults;

/// A hit of a ray, with the surface evaluated.
#[derive(Clone, Copy)]
pub(super) struct HitPoint<'a> {
    pub surface: Surface,
    pub hit: Hit,
    pub material: &'a CompiledMaterial,
    /// The ray hit the back side.
    pub is_back: bool,
    /// Shutter time, 0 to 1.
    pub time: f32,
    /// Properties of the arriving path for node graphs.
    pub path: PathOrigin,
}

/// Results of node graphs at the hits of a wave.
#[derive(Default)]
pub(super) struct HitGraphs {
    /// By hit: index in `evaluated`; [`NOT_EVALUATED`] without.
    pub indices: Vec<u32>,
    pub evaluated: Vec<EvaluatedHit>,
    /// The results at one hit after the other.
    pub values: Vec<[f32; 3]>,
    /// Material and index of each hit to evaluate, sorted.
    pub hits: Vec<(u32, u32)>,
}

const NOT_EVALUATED: u32 = u32::MAX;

/// A hit at which graphs were evaluated.
pub(super) struct EvaluatedHit {
    pub surface: Surface,
    pub is_back: bool,
    pub coordinates: SurfaceCoordinates,
    /// Index of the first of its results.
    pub first_value: u32,
}

impl HitGraphs {
    /// Hit `i`, if graphs were evaluated there.
    #[inline]
    pub fn at(&self, i: usize) -> Option<&EvaluatedHit> {
        self.evaluated.get(*self.indices.get(i)? as usize)
    }

    /// The results at a hit of a material.
    #[inline]
    pub fn results<'a>(&'a self, hit: &EvaluatedHit, at: &HitPoint<'a>) -> Option<GraphResults<'a>> {
        let textures = &at.material.graphs.as_ref()?.textures;
        let values = &self.values[hit.first_value as usize..][..textures.len()];
        Some(GraphResults { textures, values, is_back: at.is_back })
    }

    /// Forgets all results.
    pub fn clear(&mut self, hits: usize) {
        self.indices.clear();
        self.indices.resize(hits, NOT_EVALUATED);
        self.evaluated.clear();
        self.values.clear();
        self.hits.clear();
    }
}

/// A material evaluated at a hit.
#[derive(Clone, Copy)]
pub(super) struct EvaluatedMaterial {
    pub bsdf: Bsdf,
    /// Shading normal, on the side of the geometric normal.
    pub ns: Vec3,
    pub mapping: Mapping,
}

/// Effect of normal and bump maps on a shading normal.
#[derive(Clone, Copy)]
pub(super) struct Mapping {
    /// Normal of the smooth surface: without normal and bump maps, but with the bump normal of a displacement.
    pub smooth_normal: Vec3,
    /// Does the shading normal differ from the mesh's by a normal or bump map?
    pub is_mapped: bool,
    /// Is a displacement rendered as bumps?
    pub has_bumps: bool,
}

// Values of `Vertices::bump_mode`: the bump terminator (shadowing near the horizon by the microgeometry that a normal or bump map
// represents) of a vertex.

/// The normal is not mapped.
pub(super) const UNMAPPED: f32 = 0.0;

/// No bump terminator: no diffuse base, or the normal is that of a displacement's bumps.
pub(super) const NO_BUMP_SHADOWING: f32 = 1.0;

/// Bump terminator for the diffuse base.
pub(super) const BUMP_SHADOWING: f32 = 2.0;

/// [`BUMP_SHADOWING`] on the bumps of a displacement.
pub(super) const BUMP_SHADOWING_ON_DISPLACEMENT: f32 = 3.0;

/// Squared GGX alpha of the microgeometry, over the squared tangent of the angle between mapped and smooth normal.
const BUMP_ALPHA: f32 = 0.125;

impl Mapping {
    /// A surface without normal and bump maps.
    pub const fn none(ns: Vec3) -> Mapping {
        Mapping { smooth_normal: ns, is_mapped: false, has_bumps: false }
    }

    /// Flips the normal if `side` is -1.
    pub fn on_side(self, side: f32) -> Mapping {
        Mapping { smooth_normal: self.smooth_normal * side, ..self }
    }
}

impl EvaluatedMaterial {
    /// The value of `Vertices::bump_mode`.
    pub fn bump_mode(&self) -> f32 {
        let Mapping { smooth_normal, is_mapped, has_bumps } = self.mapping;
        match is_mapped {
            false => UNMAPPED,
            true if !self.bsdf.has_base() || has_bumps && smooth_normal == self.ns => NO_BUMP_SHADOWING,
            true if has_bumps => BUMP_SHADOWING_ON_DISPLACEMENT,
            true => BUMP_SHADOWING,
        }
    }
}

/// Path properties that node graphs read.
#[derive(Clone, Copy)]
pub(super) struct PathOrigin {
    /// Kinds of the arriving ray; none if unknown.
    pub kinds: RayKinds,
    /// The ray was scattered specularly.
    pub is_singular: bool,
    /// Number of bounces before.
    pub bounces: u16,
    /// The path's random numbers for rays of node graphs; `None` if unknown.
    pub sample: Option<SobolPoint>,
    /// All lobes that scattered the path are sharp.
    pub is_sharp: bool,
}

impl PathOrigin {
    /// No known properties.
    pub const UNKNOWN: PathOrigin =
        PathOrigin { kinds: RayKinds::NONE, is_singular: false, bounces: 0, sample: None, is_sharp: false };

    /// A ray of these kinds, without further properties.
    pub const fn of_kinds(kinds: RayKinds) -> PathOrigin {
        PathOrigin { kinds, ..PathOrigin::UNKNOWN }
    }
}

/// Minimum cosine between the viewer and the shading normal.
const MIN: f32 = 1e-4;

/// Minimum cosine between the mirror direction and the geometric normal.
const LIFT: f32 = 0.01;

/// The bent normal: the shading normal `ns`, tilted towards the geometric normal `ng` as far as needed to keep the mirror direction above
/// the surface, where reflections would otherwise be lost and leave black spots. The viewer is then on the same side of both normals. All
/// vectors have unit length; `ns` is on the side of `ng`.
///
/// With `n = (x, z)` in the plane of both normals, z along `ng`, and `w = (u, v)` the viewer projected to that plane, the mirror
/// direction has cosine `t` to `ng` where `2 (n . w) z - v = t`: `z^2 = (a + v t - u sqrt(a - t^2)) / (2 a)` with `a = u^2 + v^2`. Cycles
/// solves the same equation (`ensure_valid_specular_reflection`). Bending towards the viewer, out of that plane (Keller et al. 2017, "The
/// Iray Light Transport Simulation and Rendering System", section 3.3), differed from Cycles by 5 % on plastic with normals tilted by 55
/// degrees.
#[inline(always)]
pub(super) fn scattering_normal(ns: Vec3, ng: Vec3, wo: Vec3) -> Vec3 {
    bent_normal(ns, ng, wo).0
}

/// [`scattering_normal`], and whether it differs from `ns` by more than rounding.
#[inline(always)]
pub(super) fn bent_normal(ns: Vec3, ng: Vec3, wo: Vec3) -> (Vec3, bool) {
    let side = if ng.dot(wo) < 0.0 { -1.0 } else { 1.0 };
    let (n, g) = (ns * side, ng * side);
    let viewer_cosine = wo.dot(g);
    let mirror_cosine = 2.0 * n.dot(wo) * n.dot(g) - viewer_cosine;
    // At grazing incidence, mirror directions may be grazing too.
    let least = if viewer_cosine < LIFT { 0.9 * viewer_cosine } else { LIFT };
    let x = n - g * n.dot(g);
    let length = x.length();
    let x = x / if length > 0.0 { length } else { 1.0 };
    let along = wo.dot(x);
    let a = along * along + viewer_cosine * viewer_cosine;
    let rest = a - least * least;
    let root = if rest > 0.0 { rest } else { 0.0 }.sqrt();
    let squared = 0.5 * (a + viewer_cosine * least - along * root) / if a > 1e-30 { a } else { 1e-30 };
    // Free of branches, so that loops vectorise.
    let squared = if squared < 1.0 { squared } else { 1.0 };
    let squared = if squared > 0.0 { squared } else { 0.0 };
    let bent = x * (1.0 - squared).sqrt() + g * squared.sqrt();
    let is_flat = (ns.x == ng.x) & (ns.y == ng.y) & (ns.z == ng.z);
    let is_bent = (mirror_cosine < least) & !is_flat;
    (select(is_bent, bent * side, ns), is_bent)
}

/// The viewer's direction in the frame of a shading normal, clamped to the side given by the geometric normal.
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

/// Cosine to the geometric normal above which light is not dimmed, over the sine of the angle between the normals.
const UNDIMMED: f32 = 0.5;

/// Fraction of uniform incident light lost by the softened terminator on a diffuse surface, over the squared sine of the angle between
/// the normals: 0.158 to 0.166 by quadrature if the cosine of that angle is at least [`LOSS_COSINE`]; below, the loss falls off with the
/// cosine.
const LOSS: f32 = 0.16;
const LOSS_COSINE: f32 = 0.45;

/// Softened shadow terminator: factor on light from `wi` to a surface with shading normal `ns` (Chiang, Li, Burley 2019, "Taming the
/// Shadow Terminator", equations 3 and 4). Falls to 0 towards the horizon of the geometric surface, instead of a cut-off along triangle
/// edges. 1 if both normals are equal or `wi` is on the far side.
///
/// Deviations: the paper's term also dims light from far above the horizon, under uniform light by 3.5 % for normals 10 degrees apart and
/// by 9.5 % at 25. Here light above [`UNDIMMED`] times the sine of that angle is not dimmed, and below the larger of the paper's term and
/// a ramp applies: 0.5 % and 2.9 %. The factor is divided by the remaining fraction of uniform light, so that a diffuse surface reflects
/// as much of it as with the cut-off. Glossy lobes away from the horizon become brighter by that. Like the paper's, the term depends on
/// the light's direction only: it is not reciprocal, and light paths apply it to the same direction.
#[inline(always)]
fn terminator(ns: Vec3, ng: Vec3, wi: Vec3) -> f32 {
    let (cosine_ng, cosine_ns, cosine) = (wi.dot(ng), wi.dot(ns), ng.dot(ns));
    let paper = cosine_ns * cosine;
    let squared = 1.0 - cosine * cosine;
    let squared = if squared > 0.0 { squared } else { 0.0 };
    let undimmed = UNDIMMED * squared.sqrt();
    let height = if paper < undimmed { paper } else { undimmed };
    let ratio = cosine_ng / if height > 0.0 { height } else { 1.0 };
    let is_above = cosine_ng > 0.0;
    let g = if is_above & (height > 0.0) & (ratio < 1.0) { ratio } else { 1.0 };
    let kept = 1.0 - LOSS * squared * if cosine < LOSS_COSINE { cosine * (1.0 / LOSS_COSINE) } else { 1.0 };
    g * (1.0 + g * (1.0 - g)) / if is_above { kept } else { 1.0 }
}

/// Bump terminator for a mapped normal `ns`, as in Cycles: shadowing by the microfacet distribution that most likely has such a normal
/// (Conty Estevez, Lecocq, Stein 2019, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem", equations 12.3 and
/// 12.5). Not normalized for uniform light: mapped normals are tilted by tens of degrees, where normalization would brighten small lights
/// visibly (12 % at 55 degrees). No light comes from below the smooth surface with normal `smooth`.
#[inline(always)]
fn bump_terminator([ns, smooth, wi]: [Vec3; 3]) -> f32 {
    let squared_tangent = |cosine: f32| {
        let squared = cosine * cosine;
        (1.0 - squared) / if squared > 1e-12 { squared } else { 1e-12 }
    };
    let cosine = wi.dot(smooth);
    let squared_alpha = BUMP_ALPHA * squared_tangent(smooth.dot(ns));
    let squared_alpha = if squared_alpha < 1.0 { squared_alpha } else { 1.0 };
    let masked = squared_alpha * squared_tangent(cosine);
    let masked = if masked > 0.0 { masked } else { 0.0 };
    if cosine > 0.0 { 2.0 / (1.0 + (1.0 + masked).sqrt()) } else { 0.0 }
}

/// [`terminator`] of a vertex: by `ns` if the normal is not mapped, else by `smooth`; none for bumps of a displacement, as in Cycles 5.0.
/// Normals and `wi` are on the same side of the surface.
#[inline(always)]
pub(super) fn terminator_at(bump_mode: f32, [ns, smooth, ng]: [Vec3; 3], wi: Vec3) -> f32 {
    let is_softened = (bump_mode == UNMAPPED) | (bump_mode == BUMP_SHADOWING);
    let soft = terminator(select(bump_mode == BUMP_SHADOWING, smooth, ns), ng, wi);
    if is_softened { soft } else { 1.0 }
}

/// [`bump_terminator`] of a vertex, a factor on the diffuse base; 1 if the normal is not mapped.
///
/// Glossy lobes are not shadowed. Cycles cuts off light samples below the smooth normal, but not BSDF samples that hit the sky: spheres of
/// roughness 0.4 under uniform light differ by 0.4 % from Cycles without the cut-off, and by 3 % with it.
#[inline(always)]
pub(super) fn bump_terminator_at(bump_mode: f32, [ns, smooth]: [Vec3; 2], wi: Vec3) -> f32 {
    let mapped = bump_terminator([ns, smooth, wi]);
    if bump_mode >= BUMP_SHADOWING { mapped } else { 1.0 }
}

/// Multiplies the diffuse part of a BSDF value by `factor` of the bump terminator.
#[inline(always)]
pub(super) fn shadow_diffuse(value: Rgb, diffuse: Rgb, factor: f32) -> Rgb {
    value - diffuse.min(value) * (1.0 - factor)
}

/// A [`Terminator`] correction at compile time.
pub(super) trait TerminatorCorrection: Copy + Sync {
    /// Can any factor differ from 1?
    const SOFTENS: bool = true;

    /// Can [`TerminatorCorrection::bump_factor`] differ from 1?
    const HAS_BUMPS: bool = false;

    /// Factor on light from `wi` at vertex `i`. `normals` are shading and geometric normal on the side of `wi`; `side` is -1 if the
    /// vertex's are on the other side.
    fn light_factor(self, v: &Vertices, i: usize, normals: [Vec3; 2], side: f32, wi: Vec3) -> f32;

    /// Further factor on the diffuse part (bump terminator), with `ns` and `side` as above.
    #[inline(always)]
    fn bump_factor(self, _: &Vertices, _: usize, _: Vec3, _: f32, _: Vec3) -> f32 {
        1.0
    }
}

/// Corrections of the shadow terminator: hard or softened, without or with the bump terminator. By type: [`TerminatorCorrection`].
#[derive(Clone, Copy)]
pub(super) enum Terminator {
    Sharp,
    Soft,
    SoftBumps,
    SharpBumps,
}

impl Terminator {
    /// Applies the correction to a BSDF value with diffuse part `diffuse` for light from `wi`: returns the value under the bump
    /// terminator, and the factor of the softened terminator. `normals` are bent, smooth and geometric normal; `ns` is the mapped one.
    pub fn apply(
        self,
        (value, diffuse): (Rgb, Rgb),
        bump_mode: f32,
        (ns, normals): (Vec3, [Vec3; 3]),
        wi: Vec3,
    ) -> (Rgb, f32) {
        let apply_bump_terminator =
            || shadow_diffuse(value, diffuse, bump_terminator_at(bump_mode, [ns, normals[1]], wi));
        match self {
            Terminator::Sharp => (value, 1.0),
            Terminator::SharpBumps => (apply_bump_terminator(), 1.0),
            Terminator::Soft | Terminator::SoftBumps => {
                (apply_bump_terminator(), terminator_at(bump_mode, normals, wi))
            }
        }
    }
}

/// No correction: light is cut off at the geometric horizon.
#[derive(Clone, Copy)]
pub(super) struct Sharp;

/// Softened shadow terminator, for scenes without mapped normals.
#[derive(Clone, Copy)]
pub(super) struct Soft;

/// [`Soft`] with the bump terminator.
#[derive(Clone, Copy)]
pub(super) struct SoftBumps;

/// [`Sharp`] with the bump terminator.
#[derive(Clone, Copy)]
pub(super) struct SharpBumps;

impl TerminatorCorrection for SharpBumps {
    const HAS_BUMPS: bool = true;

    #[inline(always)]
    fn light_factor(self, _: &Vertices, _: usize, _: [Vec3; 2], _: f32, _: Vec3) -> f32 {
        1.0
    }

    #[inline(always)]
    fn bump_factor(self, v: &Vertices, i: usize, ns: Vec3, side: f32, wi: Vec3) -> f32 {
        SoftBumps.bump_factor(v, i, ns, side, wi)
    }
}

impl TerminatorCorrection for Sharp {
    const SOFTENS: bool = false;

    #[inline(always)]
    fn light_factor(self, _: &Vertices, _: usize, _: [Vec3; 2], _: f32, _: Vec3) -> f32 {
        1.0
    }
}

impl TerminatorCorrection for Soft {
    #[inline(always)]
    fn light_factor(self, _: &Vertices, _: usize, [ns, ng]: [Vec3; 2], _: f32, wi: Vec3) -> f32 {
        terminator(ns, ng, wi)
    }
}

impl TerminatorCorrection for SoftBumps {
    const HAS_BUMPS: bool = true;

    #[inline(always)]
    fn light_factor(self, v: &Vertices, i: usize, [ns, ng]: [Vec3; 2], side: f32, wi: Vec3) -> f32 {
        terminator_at(v.bump_mode[i], [ns, get(&v.smooth_normal, i) * side, ng], wi)
    }

    #[inline(always)]
    fn bump_factor(self, v: &Vertices, i: usize, ns: Vec3, side: f32, wi: Vec3) -> f32 {
        bump_terminator_at(v.bump_mode[i], [ns, get(&v.smooth_normal, i) * side], wi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;

    /// A normal that is not bent for one viewer bends for another viewer like the original.
    #[test]
    fn unbent_normals_equal_the_original() {
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
            // Rounding decides at the threshold.
            assert!(is_a_bent == is_b_bent && a.distance(b) < 1e-4 || a.distance(b) < 2e-3, "{ns}: {a} {b}");
            assert!(is_a_bent || a.distance(ns) < 1e-6);
        }
        assert!(straight > 10_000 && bent > 10_000, "{straight} {bent}");
    }

    #[test]
    fn viewer_and_mirror_direction_are_above_the_surface() {
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
    fn valid_normals_are_not_bent() {
        let wo = Vec3::new(0.6, 0.0, 0.8);
        let ns = Vec3::new(-0.1, 0.2, 1.0).normalize();
        assert!((scattering_normal(ns, Vec3::Z, wo) - ns).length() < 1e-6);
        assert_eq!(scattering_normal(Vec3::Z, Vec3::Z, wo), Vec3::Z);
    }

    /// A diffuse surface reflects as much of uniform light as with the cut-off, up to rounding and the fit.
    #[test]
    fn softened_terminator_preserves_uniform_light() {
        for degrees in [1.0f64, 5.0, 10.0, 25.0, 40.0, 60.0, 75.0, 85.0] {
            let angle = degrees.to_radians();
            let ns = Vec3::new(angle.sin() as f32, 0.0, angle.cos() as f32);
            let (mut cut, mut soft) = (0.0f64, 0.0f64);
            // Midpoint rule, denser near the horizon.
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

    /// No shadowing from overhead, fading towards the horizon: values of Cycles 5.0 for a plane with all normals tilted by 54.7 degrees.
    #[test]
    fn bump_terminator_matches_cycles() {
        let ns = Vec3::new(1.0, -1.0, 1.0).normalize();
        for (degrees, kept) in
            [(0.0f32, 1.0), (50.0, 0.70361 / 0.76134), (60.0, 0.86101), (80.0, 0.34485 / 0.69060)]
        {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let wi = Vec3::new(sine * 0.6, sine * 0.8, cosine);
            let found = terminator_at(BUMP_SHADOWING, [ns, Vec3::Z, Vec3::Z], wi)
                * bump_terminator_at(BUMP_SHADOWING, [ns, Vec3::Z], wi);
            assert!((found - kept).abs() < 5e-4, "{degrees}: {found}, {kept} in Cycles");
        }
        let wi = Vec3::new(0.8, 0.0, 0.6);
        assert_eq!(terminator_at(BUMP_SHADOWING, [Vec3::Z; 3], wi), 1.0);
        assert_eq!(bump_terminator_at(BUMP_SHADOWING, [Vec3::Z; 2], wi), 1.0);
    }

    #[test]
    fn softened_terminator_is_monotonic() {
        let (ng, ns) = (Vec3::Z, Vec3::new(0.5, 0.0, 0.75f32.sqrt()));
        let at = |sine: f32| terminator(ns, ng, Vec3::new((1.0 - sine * sine).sqrt(), 0.0, sine));
        let whole = 1.0 / (1.0 - LOSS * 0.25);
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
