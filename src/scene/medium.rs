//! Participating media and their voxel grids.

use super::slot::{Parameters, parameters_of_fields};
use super::{GridId, TextureId};
use crate::math::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// A participating medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Extinction coefficient by channel, per metre.
    pub extinction: [f32; 3],
    /// Single-scattering albedo by channel, 0..1.
    pub albedo: [f32; 3],
    /// Mean cosine g of the Henyey-Greenstein phase function, between -1 (backward) and 1 (forward); 0 is isotropic.
    pub anisotropy: f32,
    /// Emitted radiance per metre.
    pub emission: [f32; 3],
    /// Density: factors on the extinction, and on the emission unless `emission_grid` is set.
    pub grid: Option<GridId>,
    /// Factors on the extinction by channel, in place of `grid`, which must have the same voxels and bound their values.
    pub extinction_grids: Option<[GridId; 3]>,
    /// Scattering coefficients by channel, likewise; at most the extinction.
    pub scattering_grids: Option<[GridId; 3]>,
    /// Grids of the emission, in place of `grid`.
    pub emission_grid: Option<EmissionGrid>,
    /// Factors on the coefficients. The loader bakes these textures to grids; a scene to be rendered has none.
    pub textures: MediumTextures,
}

/// 3D textures of the coefficients of a medium.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MediumTextures {
    /// Factors on the extinction.
    pub density: Option<TextureId>,
    /// Factors on the albedo.
    pub color: Option<TextureId>,
    /// Factors on the emission.
    pub emission: Option<TextureId>,
    /// Voxels along the longest edge of a solid's bounding box; 0 for the default.
    pub resolution: u32,
}

impl MediumTextures {
    /// Whether there are no textures.
    pub fn is_empty(&self) -> bool {
        self.density.is_none() && self.color.is_none() && self.emission.is_none()
    }
}

parameters_of_fields! {
    MediumTextures { density, color, emission, resolution }
}

/// Grids of emission factors or temperatures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EmissionGrid {
    /// Factors on the emission.
    Factors(GridId),
    /// Factors on the emission by channel.
    Channels([GridId; 3]),
    /// Black-body emission; [`Medium::emission`] is the luminance per metre at [`EmissionGrid::REFERENCE_KELVIN`].
    Temperatures {
        /// Temperatures, in units of `kelvin`.
        grid: GridId,
        /// Temperature where the grid is 1, kelvin.
        kelvin: f32,
        /// The luminance is proportional to the fourth power of the temperature, like the total power (Stefan-Boltzmann law), instead
        /// of following Planck's law.
        scales_with_power: bool,
    },
}

impl EmissionGrid {
    /// Temperature at which the luminance of a black body is that of [`Medium::emission`], kelvin.
    pub const REFERENCE_KELVIN: f32 = 1500.0;

    /// All grids, with repetitions.
    pub fn grids(&self) -> impl Iterator<Item = GridId> + use<> {
        let grids = match *self {
            EmissionGrid::Factors(grid) | EmissionGrid::Temperatures { grid, .. } => [grid; 3],
            EmissionGrid::Channels(grids) => grids,
        };
        grids.into_iter()
    }
}

/// The medium outside all solids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// The medium.
    pub medium: Medium,
    /// Centre of the ball that it fills, metres.
    pub center: DVec3,
    /// Radius of the ball, metres; infinite for unbounded fog, which hides the environment and distant lights.
    pub radius: f64,
}

impl Medium {
    /// A medium with isotropic scattering and no absorption.
    pub fn scattering(extinction: [f32; 3]) -> Medium {
        Medium {
            extinction,
            albedo: [1.0; 3],
            anisotropy: 0.0,
            emission: [0.0; 3],
            grid: None,
            extinction_grids: None,
            scattering_grids: None,
            emission_grid: None,
            textures: MediumTextures::default(),
        }
    }

    /// The medium with mean free paths `radius` (metres) whose half space, with an index-matched surface, has the diffuse
    /// reflectance `color`.
    ///
    /// The single-scattering albedo is from van de Hulst's fit for diffuse illumination, as inverted by Kulla and Conty (2017,
    /// "Revisiting Physically Based Shading at Imageworks", equations 9 and 10).
    pub fn subsurface(color: [f32; 3], radius: [f32; 3], anisotropy: f32) -> Medium {
        Medium {
            albedo: color.map(|c| Medium::albedo_of_color(c, anisotropy)),
            anisotropy,
            ..Medium::scattering(radius.map(f32::recip))
        }
    }

    /// Single-scattering albedo of [`Medium::subsurface`] for one channel of the colour.
    pub fn albedo_of_color(color: f32, anisotropy: f32) -> f32 {
        let (c, g) = (f64::from(color.clamp(0.0, 1.0)), f64::from(anisotropy));
        let s = 4.09712 + 4.20863 * c - (9.59217 + 41.6808 * c + 17.7126 * c * c).sqrt();
        ((1.0 - s * s) / (1.0 - g * s * s)).clamp(0.0, 1.0) as f32
    }

    /// Diffuse reflectance of a half space of the medium: the inverse of [`Medium::subsurface`].
    pub fn color(&self) -> [f32; 3] {
        let g = f64::from(self.anisotropy);
        self.albedo.map(|albedo| {
            let albedo = f64::from(albedo.clamp(0.0, 1.0));
            let s = ((1.0 - albedo) / (1.0 - g * albedo)).sqrt();
            ((1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)) as f32
        })
    }
}

/// Only its textures are parameters.
impl Parameters for Medium {
    fn visit(&self, name: &'static str, visitor: &mut dyn FnMut(&'static str, super::Parameter<'_>)) {
        self.textures.visit(name, visitor);
    }

    fn visit_mut(
        &mut self,
        name: &'static str,
        visitor: &mut dyn FnMut(&'static str, super::ParameterMut<'_>),
    ) {
        self.textures.visit_mut(name, visitor);
    }
}

/// Extinction coefficients (Beer's law) from the transmittance over a distance (KHR_materials_volume); `None` without
/// attenuation.
pub fn coefficients(color: [f32; 3], distance: f32) -> Option<[f32; 3]> {
    let is_clear = color == [1.0; 3] || !distance.is_finite() || distance <= 0.0;
    // Avoids infinite coefficients for a transmittance of 0.
    let sigma = |c: f32| -f64::from(c.clamp(f32::MIN_POSITIVE, 1.0)).ln() / f64::from(distance);
    (!is_clear).then(|| color.map(|c| sigma(c) as f32))
}

/// A voxel grid that fills an arbitrarily transformed box.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Name in reports.
    pub name: String,
    /// Numbers of voxels along x, y and z.
    pub size: [u32; 3],
    /// Values at voxel centres, from 0; x varies fastest, then y. Interpolated trilinearly, and clamped to the outermost voxels
    /// towards the faces of the box.
    pub values: Arc<Vec<f32>>,
    /// From voxel coordinates to world space (metres), any affine map. The box spans 0 to `size`; values outside are 0.
    pub world_from_voxels: DAffine3,
}

impl Grid {
    /// A grid in an axis-aligned box in world space, metres.
    pub fn in_box(name: String, size: [u32; 3], values: Arc<Vec<f32>>, min: DVec3, max: DVec3) -> Grid {
        let voxel = (max - min) / DVec3::from_array(size.map(f64::from));
        let world_from_voxels = DAffine3::from_mat3_translation(DMat3::from_diagonal(voxel), min);
        Grid { name, size, values, world_from_voxels }
    }

    /// Maximum optical thickness of the box at the grid's maximum density: bounds the number of lookups along a ray, up to a small
    /// factor.
    pub const MAX_MEAN_FREE_PATHS: f64 = 1e5;

    /// Length of the longest diagonal of the box, metres.
    pub fn longest_diagonal(&self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|k| self.world_from_voxels.matrix3.col(k) * f64::from(self.size[k]));
        [x + y + z, x + y - z, x - y + z, x - y - z]
            .into_iter()
            .fold(0.0, |longest, diagonal| diagonal.length().max(longest))
    }

    /// Minimum and maximum of the axis-aligned bounding box in world space, metres.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let corner = |k: u32| {
            let at = [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { f64::from(self.size[axis]) } else { 0.0 });
            self.world_from_voxels.transform_point3(DVec3::from_array(at))
        };
        (1..8).map(corner).fold((corner(0), corner(0)), |(low, high), at| (low.min(at), high.max(at)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn color_inverts_subsurface() {
        for (color, anisotropy) in [(0.0, 0.0), (0.1, 0.3), (0.5, -0.4), (0.9, 0.8), (1.0, 0.0)] {
            let [r, _, b] = Medium::subsurface([color, 0.5, color], [0.1; 3], anisotropy).color();
            assert!((r - color).abs() < 1e-4 && r == b, "{color} {anisotropy}: {r}");
        }
    }

    #[test]
    fn grid_bounds() {
        let (min, max) = (DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 3.0, 4.5));
        let (size, values) = ([4, 2, 5], Arc::new(vec![0.0; 40]));
        let aligned = Grid::in_box(String::new(), size, values, min, max);
        assert_eq!(aligned.bounds(), (min, max));
        let turn = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_4);
        let rotated = Grid { world_from_voxels: turn * aligned.world_from_voxels, ..aligned };
        let (low, high) = rotated.bounds();
        let expected = (DVec3::new(1.0, 0.0, 1.0), DVec3::new(5.5, 3.0, 5.5));
        let root = DVec3::new(0.5f64.sqrt(), 1.0, 0.5f64.sqrt());
        assert!(
            (low - expected.0 * root).length() < 1e-12 && (high - expected.1 * root).length() < 1e-12,
            "{low} {high}"
        );
    }
}
