//! Gaussian splats: what radiance fields of photographs are made of (Kerbl, Kopanas, Leimkuehler, Drettakis 2023, "3D Gaussian
//! Splatting for Real-Time Radiance Field Rendering").

pub use half::f16;

/// Gaussians around the vertices of a mesh, one a vertex. With `c` the vertex, `R` the rotation and `S` the diagonal matrix of
/// scales, a splat's opacity at the point `p` is `opacity exp(-|S^-1 R^T (p - c)|^2 / 2)`. Rays see it by its largest opacity
/// along them, and it emits the radiance that its coefficients give for their direction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Standard deviations along the splat's axes, in object space, above 0.
    pub scales: Vec<[f32; 3]>,
    /// Unit quaternions (x, y, z, w) that turn its axes to object space.
    pub rotations: Vec<[f32; 4]>,
    /// Opacities of the middles, 0 to 1.
    pub opacities: Vec<f32>,
    /// Degree of the spherical harmonics, 0 to [`Splats::MAX_DEGREE`].
    pub degree: u8,
    /// Coefficients of the real spherical harmonics, by splat: [`Splats::coefficients_of`] its degree, in the order l, then m = -l to
    /// l. Their relative error is at most 2^-11: of a colour channel near 1 less than a tenth of a step of 8 bits.
    pub coefficients: Vec<[f16; 3]>,
    /// What the coefficients give, plus 0.5, is linear; else it is encoded as sRGB, as photographs are.
    pub is_linear: bool,
}

impl Splats {
    /// The spherical harmonic of degree 0: half the root of 1 / pi. Times the first coefficient it is the colour less 0.5.
    pub const FIRST_HARMONIC: f32 = 0.282_094_8;

    /// The highest degree of spherical harmonics.
    pub const MAX_DEGREE: u8 = 3;

    /// The opacity below which a splat is nothing, where its surface ends: 1/255, with which the splats of the paper are optimised.
    /// Of its projection, the outermost 1 / (255 opacity) are cut off: 0.4 % where it is opaque.
    pub const MIN_OPACITY: f32 = 1.0 / 255.0;

    /// Coefficients of a splat, for a degree of spherical harmonics.
    pub fn coefficients_of(degree: u8) -> usize {
        (usize::from(degree) + 1).pow(2)
    }

    /// The degree that so many coefficients are of.
    pub fn degree_of(coefficients: usize) -> Option<u8> {
        (0..=Splats::MAX_DEGREE).find(|&degree| Splats::coefficients_of(degree) == coefficients)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.opacities.len()
    }

    /// Is there none?
    pub fn is_empty(&self) -> bool {
        self.opacities.is_empty()
    }
}
