//! The rough surface of solid glass, and where light goes that one facet sends into the shadow of others.

use super::microsurface::Microsurface;
use super::rough_dielectric::RoughDielectric;
use super::{BsdfEval, fresnel, ggx};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::EnergyCompensation;

/// Facets of a solid as one direction sees them: how [`RoughDielectric`] scatters.
pub struct SolidGlassClosure<'a> {
    glass: &'a RoughDielectric,
    /// The direction, with z above 0, in the frame of the facets' axis.
    wo: Vec3,
    /// Its root in Smith's masking.
    root: f32,
    /// Index of refraction of the other side over that of its own.
    eta: f32,
    shadowed: Option<Shadowed>,
}

/// Where shadowed light goes.
#[derive(Clone, Copy)]
struct Shadowed {
    /// Share of what is shadowed on the rarer side that stays there.
    stays: f32,
    /// Share of what the inside mirrors against the surface that leaves through it.
    passes: f32,
    rarer: Lift,
    denser: Lift,
}

impl Shadowed {
    /// From the rarer side, what stays is what a second facet would mirror at normal incidence. From the denser side, odds of
    /// leaving were fitted to walks for alphas of 0.3 to 1, indices of 1.02 to 2.4 and cosines of 0.4 to 0.95 (errors of
    /// most shares below 0.07; more for steep views within an index near 1): by the view's cosine beside that of total
    /// reflection, whose square is near 2 (n - 1), and by how rough the facets are. Lifts were chosen so that light from everywhere leaves nearly evenly.
    #[inline(always)]
    fn new(cosine: f32, eta: f32, surface: &Microsurface) -> Shadowed {
        let [a, b] = surface.alpha();
        let alpha = 0.5 * (a + b);
        let (rarer, denser) = (Lift { reach: 0.5 * alpha }, Lift { reach: 4.0 * alpha });
        if eta >= 1.0 {
            return Shadowed { stays: fresnel::f0_from_eta(eta), passes: 0.0, rarer, denser };
        }
        let steep = cosine * cosine * eta / (2.0 * (1.0 - eta)).max(1e-9);
        let odds = steep * steep + 1.0 / 6.0;
        let share = |odds: f32| odds / (1.0 + odds);
        Shadowed {
            stays: share(odds * (0.6 + 0.8 * alpha)),
            passes: share(odds * (0.075 + 0.375 * alpha)),
            rarer,
            denser,
        }
    }
}

/// Turns directions of cosine z to z' with z'^2 = z (z + reach) / (1 + reach): those far above `reach` hardly, those below
/// so that light spread evenly over z falls off at the horizon as the cosine.
#[derive(Clone, Copy)]
struct Lift {
    reach: f32,
}

impl Lift {
    #[inline(always)]
    fn up(self, v: Vec3) -> Vec3 {
        let (a, z) = (self.reach, v.z.abs());
        let tangent = ((1.0 + z + a) / ((1.0 + a) * (1.0 + z))).sqrt();
        let lifted = (z * (z + a) / (1.0 + a)).sqrt();
        Vec3::new(v.x * tangent, v.y * tangent, lifted.copysign(v.z)).normalize()
    }

    /// The direction that [`Lift::up`] turns to this one, and how much denser directions lie there: dz / dz'.
    #[inline(always)]
    fn down(self, v: Vec3) -> (Vec3, f32) {
        let (a, lifted) = (self.reach, v.z.abs());
        let root = (a * a + 4.0 * (1.0 + a) * lifted * lifted).sqrt();
        let z = 2.0 * (1.0 + a) * lifted * lifted / (a + root);
        let tangent = ((1.0 + z) * (1.0 + a) / (1.0 + z + a)).sqrt();
        let low = Vec3::new(v.x * tangent, v.y * tangent, z.copysign(v.z));
        (low, 2.0 * (1.0 + a) * lifted / root)
    }
}

/// Some of a facet's light.
#[derive(Clone, Copy)]
struct Light {
    color: Rgb,
    /// Probability of sampling it.
    probability: f32,
}

impl Light {
    const NONE: Light = Light { color: Rgb::ZERO, probability: 0.0 };

    #[inline(always)]
    fn plus(self, other: Light) -> Light {
        Light { color: self.color + other.color, probability: self.probability + other.probability }
    }

    #[inline(always)]
    fn times(self, factor: f32) -> Light {
        Light { color: self.color * factor, probability: self.probability * factor }
    }

    #[inline(always)]
    fn tinted(self, tint: Rgb) -> Light {
        Light { color: self.color * tint, ..self }
    }
}

/// What a facet sends along one direction, and what along that direction lifted.
#[derive(Clone, Copy)]
struct Part {
    direction: Vec3,
    open: Light,
    lifted: Light,
}

impl SolidGlassClosure<'_> {
    /// A direction with z above 0, in the surface's frame.
    #[inline(always)]
    pub fn new(glass: &RoughDielectric, above: Vec3, eta: f32) -> SolidGlassClosure<'_> {
        let wo = glass.surface.to_axis(above);
        let shadowed = (glass.energy_compensation == EnergyCompensation::On)
            .then(|| Shadowed::new(wo.z, eta, &glass.surface));
        SolidGlassClosure { glass, wo, root: glass.surface.smith_root(wo), eta, shadowed }
    }

    /// What a facet sends along its mirrored and its refracted direction. `known` are these directions where they are at
    /// hand, with all their digits.
    #[inline(always)]
    fn split(&self, normal: Vec3, known: [Option<Vec3>; 2]) -> [Part; 2] {
        let (wo, eta) = (self.wo, self.eta);
        let c = wo.dot(normal).clamp(0.0, 1.0);
        let facet = self.glass.facet(c, eta);
        let part = |direction, color, probability| Part {
            direction,
            open: Light { color, probability },
            lifted: Light::NONE,
        };
        let mut mirrored =
            part(known[0].unwrap_or(normal * (2.0 * c) - wo), facet.reflected, facet.probability_reflected);
        let mut refracted = part(
            known[1].unwrap_or(normal * (c / eta - facet.cos_transmitted) - wo / eta),
            facet.transmitted,
            facet.probability_transmitted,
        );
        let open = [self.open_mirrored(mirrored.direction), self.open_refracted(refracted.direction)];
        match &self.shadowed {
            None => {
                mirrored.open.color *= open[0];
                refracted.open.color *= open[1];
            }
            Some(shadowed) if eta >= 1.0 => {
                self.redirect(shadowed, (&mut mirrored, open[0]), (&mut refracted, open[1]));
            }
            Some(shadowed) => {
                self.redirect(shadowed, (&mut refracted, open[1]), (&mut mirrored, open[0]));
            }
        }
        [mirrored, refracted]
    }

    /// Leaves a facet's parts the light that no other facet shadows, and shares out the rest.
    #[inline(always)]
    fn redirect(&self, shadowed: &Shadowed, rarer: (&mut Part, f32), denser: (&mut Part, f32)) {
        let ((rarer, open), (denser, open_denser)) = (rarer, denser);
        // What leads to the wrong side does not stay.
        let stays = if open > 0.0 { shadowed.stays } else { 0.0 };
        let hidden = rarer.open.times(1.0 - open);
        rarer.lifted = hidden.times(stays);
        rarer.open = rarer.open.times(open);
        // It crosses once more than it would have.
        let joining = hidden.times(1.0 - stays).tinted(self.glass.tint);
        denser.lifted = denser.open.times(1.0 - open_denser).plus(joining);
        denser.open = denser.open.times(open_denser);
    }

    /// Share of light along a mirrored direction that no facet shadows, G2 / G1(wo).
    #[inline(always)]
    fn open_mirrored(&self, v: Vec3) -> f32 {
        if v.z <= 0.0 {
            return 0.0;
        }
        let root = self.glass.surface.smith_root(v);
        (v.z * (self.wo.z + self.root) / (v.z * self.root + self.wo.z * root)).min(1.0)
    }

    /// Share of light along a refracted direction that no facet shadows, G1(wi).
    #[inline(always)]
    fn open_refracted(&self, v: Vec3) -> f32 {
        if v.z >= 0.0 {
            return 0.0;
        }
        (2.0 * v.z / (v.z - self.glass.surface.smith_root(v))).min(1.0)
    }

    /// How light is lifted on the other side, or on this one.
    #[inline(always)]
    fn lift(&self, shadowed: &Shadowed, crosses: bool) -> Lift {
        if (self.eta >= 1.0) == crosses { shadowed.denser } else { shadowed.rarer }
    }

    /// Chooses a direction; z below 0 is the other side. None where light is lost.
    #[inline]
    pub fn sample(&self, u: [f32; 3]) -> Option<Vec3> {
        let surface = &self.glass.surface;
        let normal = ggx::sample_visible_normal(self.wo, surface.alpha(), [u[0], u[1]]);
        let [mirrored, refracted] = self.split(normal, [None; 2]);
        let mut rest = u[2];
        for (part, mirrors) in [(mirrored, true), (refracted, false)] {
            if rest < part.open.probability {
                let is_seen = (part.direction.z > 0.0) == mirrors;
                return is_seen.then(|| surface.from_axis(part.direction.normalize()));
            }
            rest -= part.open.probability;
            if rest < part.lifted.probability {
                let (shadowed, mut wi) = (self.shadowed?, part.direction.normalize());
                if mirrors && wi.z <= 0.0 && rest >= part.lifted.probability * shadowed.passes {
                    wi.z = -wi.z;
                }
                return Some(surface.from_axis(self.lift(&shadowed, wi.z < 0.0).up(wi)));
            }
            rest -= part.lifted.probability;
        }
        None
    }

    /// Value and density for a direction; z below 0 is the other side.
    #[inline]
    pub fn eval(&self, wi: Vec3) -> BsdfEval {
        let wi = self.glass.surface.to_axis(wi);
        let crosses = wi.z < 0.0;
        let toward = |v: Vec3| if crosses { self.refracted(v) } else { self.mirrored(v) };
        let [mut light, _] = toward(wi);
        if let Some(shadowed) = &self.shadowed {
            let (low, stretch) = self.lift(shadowed, crosses).down(wi);
            let [_, mut lifted] = toward(low);
            if self.eta < 1.0 && low.z.abs() < self.wo.z {
                let [_, against] = self.mirrored(Vec3::new(low.x, low.y, -low.z.abs()));
                lifted = lifted.plus(match crosses {
                    true => against.times(shadowed.passes).tinted(self.glass.tint),
                    false => against.times(1.0 - shadowed.passes),
                });
            }
            light = light.plus(lifted.times(stretch));
        }
        // Radiance of the other medium.
        let scale = if crosses { self.glass.refraction.at(self.eta).weight } else { 1.0 };
        BsdfEval { f_cos: light.color * scale, pdf_solid_angle: light.probability }
    }

    /// Open and lifted light that facets mirror along a direction, which may lead below the surface.
    #[inline(always)]
    fn mirrored(&self, wi: Vec3) -> [Light; 2] {
        let half = self.wo + wi;
        if half.z <= 0.0 {
            return [Light::NONE; 2];
        }
        let [part, _] = self.split(half.normalize(), [Some(wi), None]);
        let density = self.glass.surface.distribution(half) * 0.5 / (self.wo.z + self.root);
        [part.open.times(density), part.lifted.times(density)]
    }

    /// Open and lifted light that facets refract along a direction.
    #[inline(always)]
    fn refracted(&self, wi: Vec3) -> [Light; 2] {
        let (wo, eta) = (self.wo, self.eta);
        // Walter et al. 2007, eq. 16, turned to the side of wo: wo + eta wi, so that the digits stay for eta near 1.
        let half = ((wo + wi) + wi * (eta - 1.0)) * if eta > 1.0 { -1.0 } else { 1.0 };
        let length = half.length();
        if half.z <= 0.0 {
            return [Light::NONE; 2];
        }
        let (cos_o, cos_i) = (wo.dot(half) / length, wi.dot(half) / length);
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return [Light::NONE; 2];
        }
        let [_, part] = self.split(half / length, [None, Some(wi)]);
        // D G1(wo) |wo.h| / wo.z times dh / dwi = eta^2 |wi.h| / |wo + eta wi|^2.
        let stretch = cos_o * -cos_i * (eta / length) * (eta / length);
        let density = self.glass.surface.distribution(half) * 2.0 / (wo.z + self.root) * stretch;
        [part.open.times(density), part.lifted.times(density)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::ggx::MIN_ALPHA;
    use crate::sampling::chi2::Random;

    #[test]
    fn lifts_are_undone() {
        let mut random = Random::new(6);
        for reach in [0.5 * MIN_ALPHA, 0.01, 0.3, 4.0] {
            let lift = Lift { reach };
            for _ in 0..1000 {
                let v = random.direction();
                let up = lift.up(v);
                let (low, stretch) = lift.down(up);
                assert!(
                    (low - v).length() < 1e-5 && up.z.abs() >= v.z.abs() - 1e-6,
                    "{reach} {v} {up} {low}"
                );
                // Directions as dense as the measure says: dz / dz'.
                let step = 1e-3f32.copysign(up.z);
                let next = if up.z.abs() < 0.9 { up.z + step } else { up.z - step };
                let tangent = (1.0 - next * next).max(0.0).sqrt();
                let other = lift.down(Vec3::new(tangent, 0.0, next)).0;
                let slope = (other.z - low.z) / (next - up.z);
                assert!(
                    (slope - stretch).abs() < 0.02 || up.z.abs() < 0.05,
                    "{reach} {v}: {slope} {stretch}"
                );
            }
        }
    }
}
