//! Spectra of colours: measured ones, and smooth ones of colours of Rec. 709.

use super::curve::Curve;
use super::fit::fit;
use super::sigmoid::Sigmoid;
use super::table::table;
use super::wavelengths::Wavelengths;
use crate::color::Rgb;
use std::sync::Arc;

/// A spectrum, relative to D65 where it is light.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// The same at all wavelengths.
    Grey(f32),
    /// The smooth spectrum of a colour.
    Uplifted {
        /// The colour.
        rgb: Rgb,
        /// What the sigmoid is taken times.
        scale: f32,
        /// Its shape.
        shape: Sigmoid,
    },
    /// A measured one.
    Measured(Arc<Curve>),
}

/// The brightest channel that lights are brought to: spectra in the middle between 0 and 1 are the smoothest.
const MIDDLE: f32 = 0.5;

/// What a colour is divided by to lie within 0..1: shares of light as they are.
#[inline(always)]
fn scale_of_share(most: f32) -> f32 {
    if most > 1.0 { most / MIDDLE } else { 1.0 }
}

impl Spectrum {
    /// That of a colour which is a share of light (a reflectance).
    pub fn of_share(rgb: Rgb) -> Spectrum {
        Spectrum::of(rgb, scale_of_share(rgb.max_element()))
    }

    /// That of the colour of a light: white is D65.
    pub fn of_light(rgb: Rgb) -> Spectrum {
        Spectrum::of(rgb, rgb.max_element() / MIDDLE)
    }

    fn of(rgb: Rgb, scale: f32) -> Spectrum {
        let rgb = rgb.max(Rgb::ZERO);
        let [r, g, b] = rgb.to_array();
        if r == g && g == b {
            return Spectrum::Grey(r);
        }
        let within = (rgb / scale).to_array();
        let (start, dark) = table().of(within);
        let wanted = within.map(|c| f64::from(c) / f64::from(dark));
        let (fitted, _) = fit(wanted, start.0.map(f64::from));
        Spectrum::Uplifted { rgb, scale: scale * dark, shape: Sigmoid(fitted.map(|c| c as f32)) }
    }

    /// Its values in the lanes of a path.
    #[inline]
    pub fn at(&self, waves: &Wavelengths) -> Rgb {
        match self {
            Spectrum::Grey(value) => Rgb::splat(*value),
            Spectrum::Uplifted { scale, shape, .. } => waves.map(|nm| shape.at(nm) * scale),
            Spectrum::Measured(curve) => waves.map(|nm| curve.at(nm)),
        }
    }

    /// What it looks like in daylight, or as light: linear Rec. 709.
    pub fn rgb(&self) -> Rgb {
        match self {
            Spectrum::Grey(value) => Rgb::splat(*value),
            Spectrum::Uplifted { rgb, .. } => *rgb,
            Spectrum::Measured(curve) => Rgb::from_array(curve.rgb()),
        }
    }
}

#[inline]
fn uplifted(rgb: Rgb, scale: f32, waves: &Wavelengths) -> Rgb {
    let (shape, dark) = table().of((rgb / scale).to_array());
    waves.map(|nm| shape.at(nm) * (scale * dark))
}

/// The values in the lanes of a path of the spectrum of a colour that is a share of light, by a table: see the module's tests for how
/// near it comes.
#[inline]
pub fn uplifted_share(rgb: Rgb, waves: &Wavelengths) -> Rgb {
    let rgb = rgb.max(Rgb::ZERO);
    let (most, least) = (rgb.max_element(), rgb.min_element());
    if most == least { rgb } else { uplifted(rgb, scale_of_share(most), waves) }
}

/// The same of the colour of a light.
#[inline]
pub fn uplifted_light(rgb: Rgb, waves: &Wavelengths) -> Rgb {
    let rgb = rgb.max(Rgb::ZERO);
    let (most, least) = (rgb.max_element(), rgb.min_element());
    // Infinite light stays what it is, which is counted.
    if most == least || !most.is_finite() { rgb } else { uplifted(rgb, most / MIDDLE, waves) }
}

#[cfg(test)]
mod tests {
    use super::super::wavelengths::rgb_of;
    use super::*;

    /// All colours of a grid, and what their spectra look like.
    fn round_trip(steps: u32, look: impl Fn([f32; 3]) -> [f64; 3]) -> (f64, f64, [f32; 3]) {
        let (mut sum, mut most, mut worst) = (0.0, 0.0, [0.0; 3]);
        let level = |i: u32| (i as f32 + 0.5) / steps as f32;
        for i in 0..steps.pow(3) {
            let rgb = [i % steps, i / steps % steps, i / steps / steps].map(level);
            let found = look(rgb);
            let error = (0..3).map(|c| (found[c] - f64::from(rgb[c])).abs()).fold(0.0, f64::max);
            sum += error;
            if error > most {
                (most, worst) = (error, rgb);
            }
        }
        (sum / f64::from(steps.pow(3)), most, worst)
    }

    #[test]
    fn constant_colours_look_like_themselves() {
        let look = |rgb: [f32; 3]| match Spectrum::of_share(Rgb::from_array(rgb)) {
            Spectrum::Uplifted { scale, shape, .. } => {
                rgb_of(|nm| f64::from(shape.at(nm as f32)) * f64::from(scale))
            }
            other => other.rgb().to_array().map(f64::from),
        };
        let (mean, most, worst) = round_trip(11, look);
        println!("fitted: mean {mean:.2e} most {most:.2e} at {worst:?}");
        assert!(mean < 2e-6 && most < 2e-4, "{mean} {most} {worst:?}");
    }

    #[test]
    fn colours_of_textures_look_nearly_like_themselves() {
        let look = |rgb: [f32; 3]| {
            let (shape, scale) = table().of(rgb);
            rgb_of(|nm| f64::from(shape.at(nm as f32) * scale))
        };
        let (mean, most, worst) = round_trip(23, look);
        println!("table: mean {mean:.2e} most {most:.2e} at {worst:?}");
        assert!(mean < 1e-3 && most < 1e-2, "{mean} {most} {worst:?}");
    }

    #[test]
    fn greys_are_the_same_at_all_wavelengths() {
        let waves = Wavelengths::draw(0.3);
        for value in [0.0, 1e-6, 0.18, 1.0, 40.0] {
            let grey = Rgb::splat(value);
            assert_eq!(uplifted_share(grey, &waves), grey);
            assert_eq!(uplifted_light(grey, &waves), grey);
            assert_eq!(Spectrum::of_light(grey).at(&waves), grey);
        }
    }

    #[test]
    fn lights_keep_their_colour_at_any_strength() {
        let waves = Wavelengths::draw(0.1);
        let dim = uplifted_light(Rgb::new(0.02, 0.01, 0.004), &waves);
        let bright = uplifted_light(Rgb::new(20.0, 10.0, 4.0), &waves);
        let off = (bright / 1000.0 - dim).abs().max_element();
        assert!(off < 1e-6, "{dim} {bright}");
    }
}
