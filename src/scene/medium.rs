//! Participating media, and the grids of densities that they use.

use super::slot::{Parameters, parameters_of_fields};
use super::{GridId, TextureId};
use crate::math::{DAffine3, DMat3, DVec3};
use std::sync::Arc;

/// A medium that scatters, absorbs and emits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Extinction coefficient by channel, per metre.
    pub extinction: [f32; 3],
    /// Single-scattering albedo by channel, 0..1.
    pub albedo: [f32; 3],
    /// Mean cosine of the scattering angle, between -1 and 1 (Henyey, Greenstein 1941): 0 is the same to all sides, above it
    /// light continues as it went.
    pub anisotropy: f32,
    /// Emitted radiance per metre.
    pub emission: [f32; 3],
    /// Factors on the extinction, and on the emission where nothing else is.
    pub grid: Option<GridId>,
    /// Factors on the extinction by channel, in place of `grid`: nowhere above its values, on the same voxels.
    pub extinction_grids: Option<[GridId; 3]>,
    /// Scattering coefficients, likewise, and nowhere above the extinction.
    pub scattering_grids: Option<[GridId; 3]>,
    /// Grids of the emission, in place of `grid`.
    pub glow: Option<EmissionGrid>,
    /// Textures that the coefficients are multiplied by. Loading evaluates them on grids, and leaves none.
    pub textures: MediumTextures,
}

/// Textures in space for the coefficients of a medium.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MediumTextures {
    /// Factors on the extinction.
    pub density: Option<TextureId>,
    /// Factors on the albedo.
    pub color: Option<TextureId>,
    /// Factors on the emission.
    pub emission: Option<TextureId>,
    /// Voxels along the longest edge of the box around a solid; 0 for as many as usual.
    pub resolution: u32,
}

impl MediumTextures {
    /// Are there none?
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
    /// The medium emits as a black body, and its emission is the luminance that each metre of [`EmissionGrid::REFERENCE_KELVIN`] adds.
    Temperatures {
        /// Temperatures.
        grid: GridId,
        /// Kelvins where the grid is 1.
        kelvin: f32,
        /// The luminance goes by the fourth power of the temperature, as all that a black body sends does (Stefan, Boltzmann), not as what
        /// is seen of it (Planck's law).
        scales_with_power: bool,
    },
}

impl EmissionGrid {
    /// The temperature at which black bodies have the emission that is given.
    pub const REFERENCE_KELVIN: f32 = 1500.0;

    /// All of its grids.
    pub fn grids(&self) -> impl Iterator<Item = GridId> + use<> {
        let grids = match *self {
            EmissionGrid::Factors(grid) | EmissionGrid::Temperatures { grid, .. } => [grid; 3],
            EmissionGrid::Channels(grids) => grids,
        };
        grids.into_iter()
    }
}

/// The medium around all solids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// The medium.
    pub medium: Medium,
    /// Middle of the ball that it fills.
    pub center: DVec3,
    /// Radius of the ball, metres; infinite for fog without an end, through which nothing infinitely far away is seen.
    pub radius: f64,
}

impl Medium {
    /// A medium of an extinction coefficient that absorbs nothing and scatters evenly.
    pub fn scattering(extinction: [f32; 3]) -> Medium {
        Medium {
            extinction,
            albedo: [1.0; 3],
            anisotropy: 0.0,
            emission: [0.0; 3],
            grid: None,
            extinction_grids: None,
            scattering_grids: None,
            glow: None,
            textures: MediumTextures::default(),
        }
    }

    /// A medium of mean free paths `radius`, metres, of which a thick body under a surface that neither refracts nor reflects
    /// scatters a share `color` of the light back.
    ///
    /// The share of each event follows by van de Hulst's fit for a half space that is lit diffusely, as inverted by Kulla
    /// and Conty (2017, "Revisiting Physically Based Shading at Imageworks", equations 9 and 10).
    pub fn subsurface(color: [f32; 3], radius: [f32; 3], anisotropy: f32) -> Medium {
        Medium {
            albedo: color.map(|c| Medium::albedo_of_color(c, anisotropy)),
            anisotropy,
            ..Medium::scattering(radius.map(f32::recip))
        }
    }

    /// One channel of that: the share of each event that is scattered.
    pub fn albedo_of_color(color: f32, anisotropy: f32) -> f32 {
        let (c, g) = (f64::from(color.clamp(0.0, 1.0)), f64::from(anisotropy));
        let s = 4.09712 + 4.20863 * c - (9.59217 + 41.6808 * c + 17.7126 * c * c).sqrt();
        ((1.0 - s * s) / (1.0 - g * s * s)).clamp(0.0, 1.0) as f32
    }
}

impl Medium {
    /// The share of diffuse light that a thick body of it scatters back under a surface that neither refracts nor reflects:
    /// the colour of [`Medium::subsurface`].
    pub fn color(&self) -> [f32; 3] {
        let g = f64::from(self.anisotropy);
        self.albedo.map(|albedo| {
            let albedo = f64::from(albedo.clamp(0.0, 1.0));
            let s = ((1.0 - albedo) / (1.0 - g * albedo)).sqrt();
            ((1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)) as f32
        })
    }
}

/// Only its textures: no texture of a material's surface can change its numbers.
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

/// The extinction coefficients of Beer's law from what is left of white light after a distance (KHR_materials_volume); `None`
/// where nothing is lost.
pub fn coefficients(color: [f32; 3], distance: f32) -> Option<[f32; 3]> {
    let is_clear = color == [1.0; 3] || !distance.is_finite() || distance <= 0.0;
    // Black would be infinite; f32's smallest normal number is black enough.
    let sigma = |c: f32| -f64::from(c.clamp(f32::MIN_POSITIVE, 1.0)).ln() / f64::from(distance);
    (!is_clear).then(|| color.map(|c| sigma(c) as f32))
}

/// Values on a grid that fills a box, which may stand anyhow.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// For reports.
    pub name: String,
    /// Voxels along the grid's x, y and z.
    pub size: [u32; 3],
    /// Values in the middles of voxels, from 0 up: those along x follow each other, then those along y. Between them it is
    /// interpolated; towards the box's sides the outermost ones hold.
    pub values: Arc<Vec<f32>>,
    /// From voxels to the world, metres: the box reaches from the origin to `size`, and outside nothing is. May turn, scale,
    /// mirror and shear.
    pub world_from_voxels: DAffine3,
}

impl Grid {
    /// A grid in a box along the axes of the world, from its least to its greatest corner, metres.
    pub fn in_box(name: String, size: [u32; 3], values: Arc<Vec<f32>>, min: DVec3, max: DVec3) -> Grid {
        let voxel = (max - min) / DVec3::from_array(size.map(f64::from));
        let world_from_voxels = DAffine3::from_mat3_translation(DMat3::from_diagonal(voxel), min);
        Grid { name, size, values, world_from_voxels }
    }

    /// Mean free paths across a grid where it is thickest, above which a scene isn't valid: they bound the number of lookups of a ray, up to
    /// a small factor.
    pub const MAX_MEAN_FREE_PATHS: f64 = 1e5;

    /// The longest of the diagonals of its box, metres.
    pub fn longest_diagonal(&self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|k| self.world_from_voxels.matrix3.col(k) * f64::from(self.size[k]));
        [x + y + z, x + y - z, x - y + z, x - y - z]
            .into_iter()
            .fold(0.0, |most, diagonal| diagonal.length().max(most))
    }

    /// The lower and the upper corner of the box along the axes of the world that is around its own, metres.
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
    fn bodies_have_the_color_that_they_were_made_for() {
        for (color, anisotropy) in [(0.0, 0.0), (0.1, 0.3), (0.5, -0.4), (0.9, 0.8), (1.0, 0.0)] {
            let [r, _, b] = Medium::subsurface([color, 0.5, color], [0.1; 3], anisotropy).color();
            assert!((r - color).abs() < 1e-4 && r == b, "{color} {anisotropy}: {r}");
        }
    }
}

#[cfg(test)]
mod grid_tests {
    use super::*;

    #[test]
    fn boxes_around_grids() {
        let (min, max) = (DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 3.0, 4.5));
        let (size, values) = ([4, 2, 5], Arc::new(vec![0.0; 40]));
        let along = Grid::in_box(String::new(), size, values, min, max);
        assert_eq!(along.bounds(), (min, max));
        let turn = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_4);
        let turned = Grid { world_from_voxels: turn * along.world_from_voxels, ..along };
        let (low, high) = turned.bounds();
        let wanted = (DVec3::new(1.0, 0.0, 1.0), DVec3::new(5.5, 3.0, 5.5));
        let root = DVec3::new(0.5f64.sqrt(), 1.0, 0.5f64.sqrt());
        assert!(
            (low - wanted.0 * root).length() < 1e-12 && (high - wanted.1 * root).length() < 1e-12,
            "{low} {high}"
        );
    }
}
