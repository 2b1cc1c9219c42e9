//! The rough surface of solid glass, and where light goes that one facet sends into the shadow of others.

use super::microsurface::Microsurface;
use super::rough_dielectric::RoughDielectric;
use super::{BsdfEval, fresnel, ggx};
use crate::math::Vec3;
use crate::scene::Microfacet;

/// Facets of a solid as one direction sees them.
///
/// A facet splits light by Fresnel's equations between a mirrored and a refracted direction. Other facets shadow both:
/// reflection by the height-correlated Smith term as on metals, transmission by the separable one, which is nearer to the
/// exact beta function of Heitz et al. 2016, "Multiple-Scattering Microfacet BSDFs with the Smith Model", eq. 20. With
/// [`Microfacet::Single`] what is shadowed is lost.
///
/// With [`Microfacet::Multi`] it is not. On walks among facets (the model of that paper) nearly all of it ends in the
/// denser medium, where total reflection holds it. So a facet's direction on the rarer side keeps what is not
/// shadowed and a share [`Lost::stays`] of what is; its direction on the denser side takes everything else and is not
/// shadowed at all. What is mirrored against the surface from within leaves it in a share [`Lost::passes`], and is turned back
/// otherwise. No light is lost or gained, whatever the roughnesses, index and reflectance, without a table, and value and
/// density are in closed form: samples of white glass weigh exactly 1.
pub struct SolidView<'a> {
    glass: &'a RoughDielectric,
    /// The direction, with z above 0, in the frame of the facets' axis.
    wo: Vec3,
    /// Its root in Smith's masking.
    root: f32,
    /// Index of refraction of the other side over that of its own.
    eta: f32,
    lost: Option<Lost>,
}

/// Where light goes that single scattering loses.
#[derive(Clone, Copy)]
struct Lost {
    /// Share of what is shadowed on the rarer side that stays there.
    stays: f32,
    /// Share of what the inside mirrors against the surface that leaves through it.
    passes: f32,
}

impl Lost {
    /// From the rarer side, what stays is what a second facet would mirror. From the denser side, odds of leaving were
    /// fitted to walks for alphas of 0.3 to 1, indices of 1.02 to 2.4 and cosines of 0.4 to 0.95 (errors of most shares
    /// below 0.05).
    #[inline(always)]
    fn new(cosine: f32, eta: f32, surface: &Microsurface) -> Lost {
        if eta >= 1.0 {
            return Lost { stays: fresnel::f0_from_eta(eta), passes: 0.0 };
        }
        let [a, b] = surface.alpha();
        let alpha = 0.5 * (a + b);
        let steep = cosine * cosine * eta / (2.0 * (1.0 - eta)).max(1e-9);
        let odds = steep * steep + 1.0 / 6.0;
        let share = |odds: f32| odds / (1.0 + odds);
        Lost { stays: share(odds * (0.6 + 0.8 * alpha)), passes: share(odds * (0.075 + 0.375 * alpha)) }
    }
}

/// What a facet sends along one direction.
#[derive(Clone, Copy)]
struct Part {
    direction: Vec3,
    color: Vec3,
    /// Chance of sampling it.
    chance: f32,
}

impl SolidView<'_> {
    /// A direction with z above 0, in the surface's frame.
    #[inline(always)]
    pub fn new(glass: &RoughDielectric, above: Vec3, eta: f32) -> SolidView<'_> {
        let wo = glass.surface.to_axis(above);
        let lost = (glass.microfacet == Microfacet::Multi).then(|| Lost::new(wo.z, eta, &glass.surface));
        SolidView { glass, wo, root: glass.surface.smith_root(wo), eta, lost }
    }

    /// What a facet sends along its mirrored and its refracted direction. `known` are these directions where they are at
    /// hand, with all their digits.
    #[inline(always)]
    fn split(&self, normal: Vec3, known: [Option<Vec3>; 2]) -> [Part; 2] {
        let (wo, eta) = (self.wo, self.eta);
        let c = wo.dot(normal).clamp(0.0, 1.0);
        let facet = self.glass.facet(c, eta);
        let mut mirrored = Part {
            direction: known[0].unwrap_or(normal * (2.0 * c) - wo),
            color: facet.reflected,
            chance: facet.p_reflected,
        };
        let mut refracted = Part {
            direction: known[1].unwrap_or(normal * (c / eta - facet.cos_transmitted) - wo / eta),
            color: facet.transmitted,
            chance: facet.p_transmitted,
        };
        match self.lost {
            None => {
                mirrored.color *= self.unshadowed_mirrored(mirrored.direction);
                refracted.color *= self.unshadowed_refracted(refracted.direction);
            }
            Some(lost) if eta >= 1.0 => {
                let seen = self.unshadowed_mirrored(mirrored.direction);
                mirrored.hand_over(lost.kept(seen), &mut refracted);
            }
            Some(lost) => {
                let seen = self.unshadowed_refracted(refracted.direction);
                refracted.hand_over(lost.kept(seen), &mut mirrored);
            }
        }
        [mirrored, refracted]
    }

    /// Share of light along a mirrored direction that no facet shadows, G2 / G1(wo).
    #[inline(always)]
    fn unshadowed_mirrored(&self, v: Vec3) -> f32 {
        if v.z <= 0.0 {
            return 0.0;
        }
        let root = self.glass.surface.smith_root(v);
        v.z * (self.wo.z + self.root) / (v.z * self.root + self.wo.z * root)
    }

    /// Share of light along a refracted direction that no facet shadows, G1(wi).
    #[inline(always)]
    fn unshadowed_refracted(&self, v: Vec3) -> f32 {
        if v.z >= 0.0 { 0.0 } else { 2.0 * v.z / (v.z - self.glass.surface.smith_root(v)) }
    }

    /// Chooses a direction; z below 0 is the other side. None where light is lost.
    #[inline]
    pub fn sample(&self, u: [f32; 3]) -> Option<Vec3> {
        let surface = &self.glass.surface;
        let normal = ggx::sample_visible_normal(self.wo, surface.alpha(), [u[0], u[1]]);
        let [mirrored, refracted] = self.split(normal, [None; 2]);
        let is_mirrored = u[2] < mirrored.chance;
        let mut wi = if is_mirrored { mirrored.direction } else { refracted.direction.normalize() };
        if (wi.z > 0.0) != is_mirrored {
            let lost = self.lost.filter(|_| is_mirrored)?;
            if u[2] >= mirrored.chance * lost.passes {
                wi.z = -wi.z;
            }
        }
        Some(surface.from_axis(wi))
    }

    /// Value and density for a direction; z below 0 is the other side.
    #[inline]
    pub fn eval(&self, wi: Vec3) -> BsdfEval {
        let wi = self.glass.surface.to_axis(wi);
        let mut sum = if wi.z < 0.0 { self.refracted(wi) } else { self.mirrored(wi) };
        if let Some(lost) = self.lost
            && self.eta < 1.0
            && wi.z.abs() < self.wo.z
        {
            let against = self.mirrored(Vec3::new(wi.x, wi.y, -wi.z.abs()));
            let share = if wi.z < 0.0 { lost.passes } else { 1.0 - lost.passes };
            sum.f_cos += against.f_cos * share;
            sum.pdf_solid_angle += against.pdf_solid_angle * share;
        }
        if wi.z < 0.0 {
            // Radiance of the other medium.
            sum.f_cos /= self.eta * self.eta;
        }
        sum
    }

    /// Facets that mirror light along a direction, which may lead below the surface.
    #[inline(always)]
    fn mirrored(&self, wi: Vec3) -> BsdfEval {
        let half = self.wo + wi;
        let length_squared = half.length_squared();
        if half.z <= 0.0 || length_squared < 1e-30 {
            return BsdfEval::ZERO;
        }
        let [part, _] = self.split(half / length_squared.sqrt(), [Some(wi), None]);
        part.times(self.glass.surface.distribution(half) * 0.5 / (self.wo.z + self.root))
    }

    /// Facets that refract light along a direction.
    #[inline(always)]
    fn refracted(&self, wi: Vec3) -> BsdfEval {
        let (wo, eta) = (self.wo, self.eta);
        // Walter et al. 2007, eq. 16, turned to the side of wo: wo + eta wi, so that the digits stay for eta near 1.
        let half = ((wo + wi) + wi * (eta - 1.0)) * if eta > 1.0 { -1.0 } else { 1.0 };
        let length = half.length();
        if half.z <= 0.0 || length == 0.0 {
            return BsdfEval::ZERO;
        }
        let (cos_o, cos_i) = (wo.dot(half) / length, wi.dot(half) / length);
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return BsdfEval::ZERO;
        }
        let [_, part] = self.split(half / length, [None, Some(wi)]);
        // D G1(wo) |wo.h| / wo.z times dh / dwi = eta^2 |wi.h| / |wo + eta wi|^2.
        let stretch = cos_o * -cos_i * (eta / length) * (eta / length);
        part.times(self.glass.surface.distribution(half) * 2.0 / (wo.z + self.root) * stretch)
    }
}

impl Lost {
    /// What a direction on the rarer side keeps.
    #[inline(always)]
    fn kept(&self, unshadowed: f32) -> f32 {
        // Nothing at all of what leads to the wrong side.
        if unshadowed > 0.0 { (unshadowed + (1.0 - unshadowed) * self.stays).min(1.0) } else { 0.0 }
    }
}

impl Part {
    /// Keeps a share, and gives the rest to another direction.
    #[inline(always)]
    fn hand_over(&mut self, kept: f32, other: &mut Part) {
        other.color += self.color * (1.0 - kept);
        other.chance += self.chance * (1.0 - kept);
        self.color *= kept;
        self.chance *= kept;
    }

    #[inline(always)]
    fn times(&self, density: f32) -> BsdfEval {
        BsdfEval { f_cos: self.color * density, pdf_solid_angle: self.chance * density }
    }
}
