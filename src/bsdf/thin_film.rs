//! Thin-film interference (KHR_materials_iridescence).

use super::fresnel;
use super::fresnel::LayerFresnel;
use crate::color::Rgb;
use crate::math::poly;
use std::f32::consts::{PI, TAU};

/// A thin film on an interface (Belcour, Barla 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying
/// Iridescence").
///
/// The film's reflectance at the view angle is converted to an equivalent F0, with which the Fresnel term of the interface below has
/// the same reflectance at that angle, as the extension suggests for rasterisers. Microfacets use this F0: exact for smooth surfaces,
/// and rough ones keep their known albedo. Surfaces with a film are not reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct ThinFilm {
    /// Weight, 0..1; 0 for no film.
    pub factor: f32,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Thickness, nanometres.
    pub thickness_nm: f32,
    /// Wavelengths of the three channels in spectral rendering, nanometres; 0 for RGB.
    pub wavelengths_nm: [f32; 3],
}

impl ThinFilm {
    /// No film.
    pub const NONE: ThinFilm =
        ThinFilm { factor: 0.0, ior: 1.3, thickness_nm: 0.0, wavelengths_nm: [0.0; 3] };

    /// The equivalent F0 for an interface of reflectance `f0` at normal and `f90` at grazing incidence, at a view cosine.
    #[inline]
    pub fn f0(&self, f0: Rgb, f90: f32, below: LayerFresnel, cosine: f32) -> Rgb {
        let reflectance = self.reflectance(f0, below, cosine);
        let weight = below.weight(cosine);
        let rest = (1.0 - weight).max(1e-3);
        let equivalent = ((reflectance - Rgb::splat(f90 * weight)) / rest).clamp(Rgb::ZERO, Rgb::ONE);
        f0 + (equivalent - f0) * self.factor
    }

    /// Reflectance of the film over an interface of reflectance `base_f0` at normal incidence, in linear Rec.709 or by wavelength
    /// (Belcour, Barla 2017, eq. 2 and 9, unpolarised). The lower interface has Schlick's Fresnel term as in the extension, or the
    /// exact one.
    #[inline]
    pub fn reflectance(&self, base_f0: Rgb, below: LayerFresnel, cosine: f32) -> Rgb {
        // The film fades out below a thickness of 0.03 nm.
        let presence = (self.thickness_nm / 0.03).clamp(0.0, 1.0);
        let ior = 1.0 + (self.ior - 1.0) * presence * presence * (3.0 - 2.0 * presence);
        let sin_squared = (1.0 - cosine * cosine) / (ior * ior);
        let cos_inside = (1.0 - sin_squared).max(0.0).sqrt();
        let r12 = fresnel::exact(cosine, ior).reflectance;
        let t121 = 1.0 - r12;
        let r23 = base_f0.to_array().map(|f0| Self::lower_reflectance(f0, below, ior, cos_inside));
        let path_nm = 2.0 * ior * self.thickness_nm * cos_inside;
        let mut sum = [0.0; 3];
        for (c, (r, phase)) in r23.into_iter().enumerate() {
            // Internal reflection at the upper interface has a phase shift of pi.
            let phase = PI + phase;
            let r123 = (r12 * r).clamp(0.0, 0.9999);
            let amplitude = r123.sqrt();
            let rs = t121 * t121 * r / (1.0 - r123);
            let mut value = r12 + rs;
            let mut term = rs - t121;
            if self.wavelengths_nm[c] > 0.0 {
                // The sum over all orders of interference at one wavelength.
                let (_, cosine) = poly::sin_cos((TAU * path_nm / self.wavelengths_nm[c] + phase) % TAU);
                let orders = (amplitude * cosine - r123) / (1.0 - 2.0 * amplitude * cosine + r123);
                sum[c] = value + term * 2.0 * orders;
                continue;
            }
            for order in 1..=2 {
                term *= amplitude;
                let m = order as f32;
                value += term * 2.0 * sensitivity(m * path_nm, m * phase)[c];
            }
            sum[c] = value;
        }
        Rgb::from_array(sum).clamp(Rgb::ZERO, Rgb::ONE)
    }

    /// Reflectance and phase shift (radians) of the lower interface.
    #[inline]
    fn lower_reflectance(f0: f32, below: LayerFresnel, film_ior: f32, cosine: f32) -> (f32, f32) {
        let root = f0.clamp(0.0, 0.9999).sqrt();
        let base_ior = (1.0 + root) / (1.0 - root);
        let eta = base_ior / film_ior;
        let r = match below {
            LayerFresnel::Schlick => scalar_schlick(fresnel::f0_from_eta(eta), cosine),
            LayerFresnel::Exact(_) => fresnel::exact(cosine, eta).reflectance,
        };
        (r, if base_ior < film_ior { PI } else { 0.0 })
    }
}

#[inline(always)]
fn scalar_schlick(f0: f32, cosine: f32) -> f32 {
    f0 + (1.0 - f0) * fresnel::schlick_weight(cosine)
}

/// Linear Rec.709 response (white is 1) to an interference term of an optical path difference in nanometres: the Fourier transform of
/// Gaussians fitted to the CIE 1931 matching functions (Belcour, Barla 2017, supplemental code). A triple (h, p, v) is the Gaussian of
/// integral h sqrt(2 pi v) around the wavenumber p, in 1/m, with variance 2 v.
#[inline]
fn sensitivity(path_nm: f32, shift: f32) -> [f32; 3] {
    const GAUSSIANS: [[f32; 3]; 4] = [
        [5.4856e-13, 1.6810e6, 4.3278e9],
        [4.4201e-13, 1.7953e6, 9.3046e9],
        [5.2481e-13, 2.2084e6, 6.6121e9],
        [9.7470e-14, 2.2399e6, 4.5282e9],
    ];
    let phase = TAU * path_nm * 1e-9;
    let [x, y, z, x2] = GAUSSIANS.map(|[height, position, variance]| {
        let (_, cosine) = poly::sin_cos(position * phase + shift);
        height * (TAU * variance).sqrt() * cosine * poly::exp(-variance * phase * phase) / 1.0685e-7
    });
    RGB_FROM_XYZ.map(|row| row[0] * (x + x2) + row[1] * y + row[2] * z)
}

/// CIE XYZ to linear Rec.709 (IEC 61966-2-1), with rows scaled so that a constant spectrum is white: a film of zero thickness is then
/// colourless.
const RGB_FROM_XYZ: [[f32; 3]; 3] = [
    [2.6883509, -1.2752434, -0.4135924],
    [-1.0220880, 1.9782476, 0.0438207],
    [0.0611459, -0.2242019, 1.1617736],
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::FresnelModel;

    #[test]
    fn film_of_zero_thickness_has_no_effect() {
        let film = ThinFilm { factor: 1.0, ior: 1.8, ..ThinFilm::NONE };
        for f0 in [0.02f32, 0.04, 0.3, 0.9] {
            for cosine in [1.0, 0.7, 0.3] {
                let ior = (1.0 + f0.sqrt()) / (1.0 - f0.sqrt());
                for (below, plain) in [
                    (LayerFresnel::Schlick, scalar_schlick(f0, cosine)),
                    (LayerFresnel::new(FresnelModel::Exact, ior), fresnel::exact(cosine, ior).reflectance),
                ] {
                    let seen = film.reflectance(Rgb::splat(f0), below, cosine);
                    let difference = (seen - Rgb::splat(plain)).abs().max_element();
                    assert!(difference < 2e-3, "{f0} {cosine} {below:?}: {seen} {plain}");
                }
            }
        }
    }

    /// Far beyond the coherence length only the incoherent sum remains.
    #[test]
    fn thick_films_are_colourless() {
        let film = ThinFilm { factor: 1.0, ior: 1.4, thickness_nm: 60_000.0, ..ThinFilm::NONE };
        let r = film.reflectance(Rgb::splat(0.2), LayerFresnel::Schlick, 0.8);
        assert!(r.max_element() - r.min_element() < 1e-4, "{r}");
    }

    /// At normal incidence, compared with the Airy formula integrated over wavelengths with the same matching functions.
    #[test]
    fn rgb_reflectance_agrees_with_the_airy_formula() {
        let gaussian = |wavelength: f64, heights: &[(f64, f64, f64)]| -> f64 {
            heights
                .iter()
                .map(|&(h, p, v)| {
                    let nu = 1.0 / wavelength;
                    h * 0.5f64.sqrt() * (-(nu - p) * (nu - p) / (4.0 * v)).exp()
                })
                .sum::<f64>()
        };
        for (film_ior, thickness, base) in [(1.3f64, 300.0, 0.2), (1.8, 250.0, 0.04), (1.5, 450.0, 0.5f64)] {
            let root = base.sqrt();
            let base_ior = (1.0 + root) / (1.0 - root);
            let (r1, r2) =
                ((1.0 - film_ior) / (1.0 + film_ior), (film_ior - base_ior) / (film_ior + base_ior));
            let curves: [&[(f64, f64, f64)]; 3] = [
                &[(5.4856e-13, 1.6810e6, 4.3278e9), (9.7470e-14, 2.2399e6, 4.5282e9)],
                &[(4.4201e-13, 1.7953e6, 9.3046e9)],
                &[(5.2481e-13, 2.2084e6, 6.6121e9)],
            ];
            let mut sums = [0.0f64; 3];
            for i in 0..4000 {
                let nu = 1.2e6 + 1.5e6 * (f64::from(i) + 0.5) / 4000.0;
                let delta = std::f64::consts::TAU * 2.0 * film_ior * thickness * 1e-9 * nu;
                let (a, b) = (r1 * r1 + r2 * r2 + 2.0 * r1 * r2 * delta.cos(), 2.0 * r1 * r2 * delta.cos());
                let airy = a / (1.0 + r1 * r1 * r2 * r2 + b);
                for (sum, curve) in sums.iter_mut().zip(curves) {
                    *sum += airy * gaussian(1.0 / nu, curve) * 1.5e6 / 4000.0 / 1.0685e-7;
                }
            }
            let exact = RGB_FROM_XYZ.map(|row| (0..3).map(|i| f64::from(row[i]) * sums[i]).sum::<f64>());
            let film = ThinFilm {
                factor: 1.0,
                ior: film_ior as f32,
                thickness_nm: thickness as f32,
                ..ThinFilm::NONE
            };
            let found = film.reflectance(Rgb::splat(base as f32), LayerFresnel::Schlick, 1.0).to_array();
            for c in 0..3 {
                let error = (f64::from(found[c]) - exact[c].clamp(0.0, 1.0)).abs();
                assert!(error < 0.02, "{film_ior} {thickness}: {found:?} {exact:?}");
            }
        }
    }

    /// At normal incidence, for films of higher and lower index than the base.
    #[test]
    fn spectral_reflectance_agrees_with_the_airy_formula() {
        for (film_ior, thickness, base) in
            [(1.3f32, 300.0f32, 0.2f32), (1.8, 250.0, 0.04), (1.5, 4500.0, 0.5)]
        {
            let base_ior = (1.0 + base.sqrt()) / (1.0 - base.sqrt());
            let (r1, r2) =
                ((1.0 - film_ior) / (1.0 + film_ior), (film_ior - base_ior) / (film_ior + base_ior));
            let wavelengths_nm = [412.0, 555.5, 701.0];
            let film = ThinFilm { factor: 1.0, ior: film_ior, thickness_nm: thickness, wavelengths_nm };
            let found = film.reflectance(Rgb::splat(base), LayerFresnel::Schlick, 1.0).to_array();
            for (found, nm) in found.into_iter().zip(wavelengths_nm) {
                let delta = std::f64::consts::TAU * f64::from(2.0 * film_ior * thickness / nm);
                let (r1, r2) = (f64::from(r1), f64::from(r2));
                let cross = 2.0 * r1 * r2 * delta.cos();
                let airy = (r1 * r1 + r2 * r2 + cross) / (1.0 + r1 * r1 * r2 * r2 + cross);
                assert!(
                    (f64::from(found) - airy).abs() < 1e-4,
                    "{film_ior} {thickness} {nm}: {found} {airy}"
                );
            }
        }
    }
}
