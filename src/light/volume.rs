//! Emissive media as lights.
//!
//! Points in the medium are sampled in proportion to the emission of grid cells, with a volume pdf (Villemin, Hery 2013, "Practical
//! Illumination from Flames"). Scattered rays integrate emission along their length. To use the MIS weights of surfaces for both, a point
//! stands for a layer of fixed depth that emits depth times radiance per metre: its solid-angle pdf is the volume pdf times the squared
//! distance times the depth. This pdf vanishes close to the reference point, where scattered rays get all the weight.

use super::{LightBounds, LightSample, LightSource};
use crate::color::Rgb;
use crate::math::{Bounds3, Mat3, Vec3};
use crate::sampling::CellDistribution;
use crate::sampling::hash::{hash32, unit};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// An emissive medium within a parallelepiped.
#[derive(Clone, Debug)]
pub struct VolumeLight {
    /// Index of the medium.
    medium: u16,
    cells: CellDistribution,
    /// Corner of the parallelepiped.
    corner: Vec3,
    /// Edges from the corner, metres, as columns.
    edges: Mat3,
    unit_from_world: Mat3,
    /// Reciprocal of the volume, 1/m^3.
    per_volume: f32,
    /// Luminance of the radiant intensity, W/sr.
    intensity: f32,
    /// Depth of the layer for which a point stands, metres.
    depth: f32,
}

impl VolumeLight {
    /// A medium with mean luminance `emission` per cell, W/(sr m^3), x fastest; `None` without emission or volume.
    pub fn new(
        medium: u16,
        (corner, edges): (Vec3, Mat3),
        size: [usize; 3],
        emission: &[f32],
    ) -> Option<VolumeLight> {
        let cells = CellDistribution::new(size, emission)?;
        let volume = edges.determinant().abs();
        if !(volume.is_normal() && (1.0 / volume).is_normal()) {
            return None;
        }
        let sum = cells.sum();
        let positive = emission.iter().map(|&e| f64::from(e)).filter(|e| e.is_finite() && *e > 0.0);
        let squares = positive.fold(0.0, |squares, value| squares + value * value);
        let volume_of_cell = f64::from(volume) / emission.len() as f64;
        Some(VolumeLight {
            medium,
            cells,
            corner,
            edges,
            unit_from_world: edges.inverse(),
            per_volume: 1.0 / volume,
            intensity: (sum * volume_of_cell) as f32,
            // Edge of a cube of the effective volume of the emission.
            depth: (sum * sum / squares * volume_of_cell).cbrt() as f32,
        })
    }

    /// Index of the medium.
    #[inline(always)]
    pub fn medium(&self) -> u16 {
        self.medium
    }

    /// Depth of the layer for which a point stands, metres: ratio of radiance to emission per metre.
    #[inline(always)]
    pub fn depth(&self) -> f32 {
        self.depth
    }

    /// Center of the parallelepiped.
    pub fn center(&self) -> Vec3 {
        self.corner + self.edges * Vec3::splat(0.5)
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of::<VolumeLight>() + self.cells.bytes()
    }
}

impl LightSource for VolumeLight {
    /// The radiance is for an emission of 1 per metre, to be multiplied by the medium's emission at the target.
    fn sample(&self, _textures: &CompiledTextures, reference: Vec3, u: [f32; 2]) -> LightSample {
        let third = unit(hash32(u[0].to_bits() ^ hash32(u[1].to_bits())));
        let target = self.corner + self.edges * Vec3::from_array(self.cells.sample([u[0], u[1], third]));
        let pdf_solid_angle = self.pdf_solid_angle(reference, target);
        if pdf_solid_angle <= 0.0 {
            return LightSample::NONE;
        }
        let wi = (target - reference).normalize_or_zero();
        let radiance = Rgb::splat(self.depth);
        LightSample { wi, target, radiance, pdf_solid_angle, ..LightSample::NONE }
    }

    #[inline]
    fn pdf_solid_angle(&self, reference: Vec3, to: Vec3) -> f32 {
        let point = (self.unit_from_world * (to - self.corner)).to_array();
        let pdf_volume = self.cells.pdf_volume(point) * self.per_volume;
        pdf_volume * (to - reference).length_squared() * self.depth
    }

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.intensity * (4.0 * PI)
    }

    fn bounds(&self, _textures: &CompiledTextures) -> Option<LightBounds> {
        let size = self.cells.size();
        let (mut low, mut high) = (size, [0; 3]);
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in (0..size[0]).filter(|&x| self.cells.probability([x, y, z]) > 0.0) {
                    for (axis, at) in [x, y, z].into_iter().enumerate() {
                        (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at + 1));
                    }
                }
            }
        }
        let point = |cell: [usize; 3]| Vec3::from_array([0, 1, 2].map(|a| cell[a] as f32 / size[a] as f32));
        let corners = Bounds3 { min: point(low), max: point(high) }.corners();
        let bounds = Bounds3::of(corners.map(|corner| self.corner + self.edges * corner));
        let axis = Vec3::Z;
        Some(LightBounds { bounds, weight: self.intensity, axis, normals_rad: PI, emission_rad: 0.5 * PI })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;

    /// A skewed box of 2 x 1 x 3 metres that emits only in the last quarter along x.
    fn light() -> VolumeLight {
        let edges = Mat3::from_cols(Vec3::X * 2.0, Vec3::new(0.5, 1.0, 0.0), Vec3::Z * 3.0);
        let emission = [0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0];
        VolumeLight::new(3, (Vec3::new(-1.0, 0.0, 0.0), edges), [4, 2, 1], &emission).expect("it emits")
    }

    #[test]
    fn samples_estimate_the_intensity_from_afar() {
        // Far away, the irradiance on a surface that faces the light is intensity over squared distance.
        let (light, mut random) = (light(), Random::new(2));
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let reference = Vec3::new(200.0, 300.0, -400.0);
        let (mut sum, n) = (0.0, 20_000);
        for _ in 0..n {
            let sample = light.sample(&textures, reference, [random.next(), random.next()]);
            let unit = (light.unit_from_world * (sample.target - light.corner)).to_array();
            assert!(unit[0] >= 0.75 - 1e-5, "{unit:?}");
            let emission = if unit[1] < 0.5 { 5.0 } else { 1.0 };
            sum += f64::from(sample.radiance.r * emission / sample.pdf_solid_angle);
        }
        let (irradiance, squared) = (sum / f64::from(n), f64::from(reference.length_squared()));
        let intensity = (5.0 + 1.0) * 6.0 / 8.0;
        assert!((irradiance * squared / intensity - 1.0).abs() < 0.01, "{}", irradiance * squared);
        assert!((f64::from(light.intensity) - intensity).abs() < 1e-5, "{}", light.intensity);
        let bounds = light.bounds(&textures).expect("a place").bounds;
        assert!((bounds.min.x - 0.5).abs() < 1e-5 && bounds.extent().z == 3.0, "{bounds:?}");
    }

    #[test]
    fn dark_or_flat_media_are_not_lights() {
        assert!(VolumeLight::new(1, (Vec3::ZERO, Mat3::IDENTITY), [2, 1, 1], &[0.0; 2]).is_none());
        let flat = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::ZERO);
        assert!(VolumeLight::new(1, (Vec3::ZERO, flat), [2, 1, 1], &[1.0; 2]).is_none());
    }
}
