//! The surface of a body with subsurface scattering: light enters diffusely or refracted by facets, and leaves diffusely.

use super::diffuse::LambertTransmission;
use super::ggx;
use super::microsurface::{Facets, Microsurface};
use super::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::SubsurfaceEntry;

/// Smallest GGX alpha of facets that refract light into the medium: the first scattering event hides a narrower lobe.
const MIN_ALPHA: f32 = 0.02;

/// The boundary of a medium with subsurface scattering: transmission into and out of it with albedo 1, without a Fresnel term and
/// without loss by shadowing.
#[derive(Clone, Copy, Debug)]
pub struct SubsurfaceBoundary {
    /// Index of refraction of the inside over the outside.
    ior: f32,
    /// Facets that refract.
    facets: Microsurface,
    /// Fraction of light that enters diffusely; the facets refract the rest.
    diffuse: f32,
}

impl SubsurfaceBoundary {
    /// `facets` are those of the glossy reflection.
    pub fn new(entry: SubsurfaceEntry, mut facets: Microsurface) -> SubsurfaceBoundary {
        facets.roughen(MIN_ALPHA);
        match entry {
            SubsurfaceEntry::Diffuse => SubsurfaceBoundary { ior: 1.0, facets, diffuse: 1.0 },
            SubsurfaceEntry::Skin { ior } => {
                SubsurfaceBoundary { ior, facets: Microsurface::isotropic(1.0), diffuse: 0.5 }
            }
            SubsurfaceEntry::Refraction { ior } => SubsurfaceBoundary { ior, facets, diffuse: 0.0 },
        }
    }

    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let diffuse = LambertTransmission.sample(wo, u);
        if wo.z < 0.0 || u[2] < self.diffuse {
            return diffuse;
        }
        let above = self.facets.to_axis(ggx::to_upper_side(wo));
        let normal = ggx::sample_visible_normal(above, self.facets.alpha(), [u[0], u[1]]);
        let eta = 1.0 / self.ior;
        let cosine = above.dot(normal).clamp(0.0, 1.0);
        let cos_transmitted = (1.0 - eta * eta * (1.0 - cosine * cosine)).max(0.0).sqrt();
        let wi = normal * (cosine * eta - cos_transmitted) - above * eta;
        let wi = self.facets.from_axis(Vec3::new(wi.x, wi.y, -wi.z.abs()).normalize());
        BsdfSample { wi, pdf_solid_angle: self.eval(wo, wi).pdf_solid_angle, ..diffuse }
    }

    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        let diffuse = LambertTransmission.eval(wo, wi);
        if wo.z < 0.0 || self.diffuse >= 1.0 || wi.z >= 0.0 {
            return diffuse;
        }
        let above = self.facets.to_axis(ggx::to_upper_side(wo));
        let view = (above, self.facets.smith_root(above));
        // Directions that facets refract to the outside are mirrored at the surface.
        let density = [wi, Vec3::new(wi.x, wi.y, -wi.z)]
            .map(|wi| self.facets.refraction(view, self.facets.to_axis(wi), self.ior))
            .into_iter()
            .flatten()
            .map(|(_, density)| density)
            .sum::<f32>();
        let pdf_solid_angle = self.diffuse * diffuse.pdf_solid_angle + (1.0 - self.diffuse) * density;
        BsdfEval { f_cos: Rgb::splat(pdf_solid_angle), pdf_solid_angle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::{Chi2, SphericalDomain};
    use std::f32::consts::PI;

    #[test]
    fn samples_follow_the_density_and_all_enter() {
        let entries = [
            SubsurfaceEntry::Skin { ior: 1.4 },
            SubsurfaceEntry::Refraction { ior: 1.01 },
            SubsurfaceEntry::Refraction { ior: 1.5 },
        ];
        for (entry, alpha) in entries.into_iter().flat_map(|entry| [0.2, 1.0].map(|alpha| (entry, alpha))) {
            let body = SubsurfaceBoundary::new(entry, Microsurface::isotropic(alpha));
            for wo in [Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.995, 0.1).normalize()] {
                Chi2::new(&format!("{entry:?} {alpha} {wo}"), 12).samples(200_000).assert_directions(
                    &SphericalDomain::sphere(),
                    |u| Some(body.sample(wo, u).wi),
                    |wi| body.eval(wo, wi).pdf_solid_angle,
                );
            }
        }
    }

    #[test]
    fn light_leaves_diffusely() {
        let body =
            SubsurfaceBoundary::new(SubsurfaceEntry::Refraction { ior: 1.5 }, Microsurface::isotropic(0.1));
        let value = body.eval(Vec3::new(0.6, 0.0, -0.8), Vec3::new(0.0, 0.6, 0.8));
        assert!((value.f_cos.r - 0.8 / PI).abs() < 1e-6 && value.f_cos.r == value.pdf_solid_angle);
    }
}
