//! What pictures for compositing show of surfaces: the colours of what they scatter diffusely, reflect and let pass, their
//! roughness, and how much of what a pair of directions scatters is diffuse. Diffuse are, as in Cycles, also sheen and what
//! passes a surface diffusely.

use super::dielectric::{Dielectric, ThinDielectric};
use super::diffuse::Lambert;
use super::diffuse::OrenNayar;
use super::fresnel::f0_from_eta;
use super::hair::Hair;
use super::layered::Layered;
use super::metal::Conductor;
use super::metal::SchlickMetal;
use super::metal_rough::MetalRough;
use super::phong::Phong;
use super::rough_dielectric::RoughDielectric;
use super::{Facets, Lobe, ggx};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::GlassReflection;
use std::f32::consts::FRAC_1_PI;

/// What a surface looks like, whatever the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Colour of what it scatters diffusely.
    pub diffuse: Rgb,
    /// Colour of what its facets reflect, seen along the normal.
    pub glossy: Rgb,
    /// Colour of what it lets pass.
    pub transmission: Rgb,
    /// The root of its facets' GGX alpha (the geometric mean of two); 1 where it has none.
    pub roughness: f32,
}

impl Look {
    /// Of what scatters nothing.
    pub const BLACK: Look =
        Look { diffuse: Rgb::ZERO, glossy: Rgb::ZERO, transmission: Rgb::ZERO, roughness: 1.0 };

    fn of_glass(ior: f32, tint: Rgb, roughness: f32) -> Look {
        Look { diffuse: Rgb::ZERO, glossy: Rgb::splat(f0_from_eta(ior)), transmission: tint, roughness }
    }

    fn of_metal_rough<S: Facets>(m: &MetalRough<S>, alpha: [f32; 2]) -> Look {
        let glossy = m.layer_f0 * (1.0 - m.metallic) + m.metal_f0 * m.metallic;
        Look { diffuse: m.diffuse, glossy: glossy.min(Rgb::ONE), roughness: roughness(alpha), ..Look::BLACK }
    }
}

fn roughness([a, b]: [f32; 2]) -> f32 {
    (a * b).sqrt().sqrt()
}

/// A lobe that can be shown.
pub trait Shown {
    /// What it looks like.
    fn look(&self) -> Look;

    /// The diffuse part of what [`Lobe::eval`] gives for these directions.
    fn diffuse_part(&self, _wo: Vec3, _wi: Vec3) -> Rgb {
        Rgb::ZERO
    }
}

impl Shown for Lambert {
    fn look(&self) -> Look {
        Look { diffuse: self.albedo, ..Look::BLACK }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.eval(wo, wi).f_cos
    }
}

impl Shown for OrenNayar {
    fn look(&self) -> Look {
        Look { diffuse: self.color, ..Look::BLACK }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.eval(wo, wi).f_cos
    }
}

impl Shown for Phong {
    /// Its lobe is about as wide as that of facets of this alpha (Walter et al. 2007, section 5.2).
    fn look(&self) -> Look {
        let alpha = (2.0 / (self.exponent + 2.0)).sqrt();
        Look { diffuse: self.diffuse, glossy: self.specular, roughness: roughness([alpha; 2]), ..Look::BLACK }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let is_reflected = (wo.z < 0.0) == (wi.z < 0.0);
        self.diffuse * if is_reflected { FRAC_1_PI * wi.z.abs() } else { 0.0 }
    }
}

impl Shown for SchlickMetal {
    fn look(&self) -> Look {
        Look { glossy: self.f0, roughness: roughness([self.alpha; 2]), ..Look::BLACK }
    }
}

impl Shown for Conductor {
    fn look(&self) -> Look {
        Look { glossy: self.albedo(), roughness: roughness(self.surface.alpha()), ..Look::BLACK }
    }
}

impl Shown for Hair {
    /// As Cycles, which counts all that hair scatters as gloss.
    fn look(&self) -> Look {
        Look { glossy: self.albedo(), ..Look::BLACK }
    }
}

impl Shown for MetalRough {
    fn look(&self) -> Look {
        Look::of_metal_rough(self, [self.surface.alpha; 2])
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let is_reflected = (wo.z < 0.0) == (wi.z < 0.0);
        let diffuse = self.closure(ggx::above(wo)).diffuse;
        diffuse * if is_reflected { FRAC_1_PI * wi.z.abs() } else { 0.0 }
    }
}

impl Shown for Dielectric {
    fn look(&self) -> Look {
        Look::of_glass(self.ior, self.tint, 0.0)
    }
}

impl Shown for ThinDielectric {
    fn look(&self) -> Look {
        Look::of_glass(self.ior, self.tint, 0.0)
    }
}

impl Shown for RoughDielectric {
    fn look(&self) -> Look {
        let look = Look::of_glass(self.ior, self.tint, roughness(self.surface.alpha()));
        let color = match self.reflectance.color() {
            GlassReflection::White => Rgb::ONE,
            GlassReflection::Tinted => self.tint,
            GlassReflection::None => Rgb::ZERO,
        };
        Look { glossy: look.glossy * color, ..look }
    }
}

impl Shown for Layered {
    fn look(&self) -> Look {
        let opaque = Look::of_metal_rough(&self.opaque, self.opaque.surface.alpha());
        let glass = self.glass.look();
        let mix = |a: Rgb, b: Rgb| (a * (1.0 - self.glass_share) + b * self.glass_share).min(Rgb::ONE);
        Look {
            diffuse: mix(opaque.diffuse + self.through + self.sheen.color, Rgb::ZERO),
            glossy: mix(opaque.glossy, glass.glossy),
            transmission: mix(Rgb::ZERO, glass.transmission),
            roughness: opaque.roughness,
        }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.eval_diffuse(wo, wi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{Bsdf, Isotropic, LayerFresnel};
    use crate::sampling::chi2::Random;
    use crate::scene::EnergyCompensation;

    /// The diffuse part of a material with a layer is what the material would be without its facets.
    #[test]
    fn the_parts_of_glossy_materials_add_up() {
        let m = MetalRough {
            diffuse: Rgb::new(0.5, 0.3, 0.1),
            layer_f0: Rgb::splat(0.04),
            layer_f90: 1.0,
            layer_fresnel: LayerFresnel::Schlick,
            metal_f0: Rgb::ZERO,
            metallic: 0.0,
            surface: Isotropic { alpha: 0.3 },
            energy_compensation: EnergyCompensation::On,
        };
        let layered = Layered {
            opaque: m.on(crate::bsdf::microsurface::Microsurface::isotropic(0.3)),
            diffuse_roughness: 0.0,
            through: Rgb::ZERO,
            glass: RoughDielectric {
                surface: crate::bsdf::microsurface::Microsurface::isotropic(0.3),
                ior: 1.5,
                walls: crate::bsdf::Walls::Thin,
                refraction: crate::bsdf::Refraction::Scales,
                tint: Rgb::ONE,
                reflectance: crate::bsdf::GlassReflectance::Plain,
                energy_compensation: EnergyCompensation::On,
            },
            glass_share: 0.0,
            film: crate::bsdf::ThinFilm::NONE,
            sheen: crate::bsdf::Sheen::NONE,
            coat: crate::bsdf::Coat::NONE,
        };
        let mut random = Random::new(5);
        for _ in 0..1000 {
            let (mut wo, mut wi) = (random.direction(), random.direction());
            (wo.z, wi.z) = (wo.z.abs(), wi.z.abs());
            let all = m.eval(wo, wi).f_cos.to_array();
            let facets = MetalRough { diffuse: Rgb::ZERO, ..m }.eval(wo, wi).f_cos.to_array();
            let diffuse = Bsdf::MetalRough(m).diffuse_part(wo, wi).to_array();
            let other = Bsdf::Layered(layered).diffuse_part(wo, wi).to_array();
            for c in 0..3 {
                assert!((all[c] - facets[c] - diffuse[c]).abs() < 1e-5 * all[c].max(1.0), "{wo} {wi}");
                assert!((diffuse[c] - other[c]).abs() < 1e-5, "{wo} {wi}");
            }
        }
        assert_eq!(m.look().diffuse, m.diffuse);
        assert!((m.look().roughness - 0.3f32.sqrt()).abs() < 1e-6);
    }
}
