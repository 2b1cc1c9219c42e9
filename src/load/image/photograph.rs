//! What photographs ask for: their orientation (EXIF) and their colour profile (ICC.1:2022).
//!
//! Profiles of cameras, telephones and displays are three primaries with tone curves, or one curve for grey: these are applied.
//! Those of printers are tables (`A2B0`), which are not read.

use crate::color::converted;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, Rgb32FImage, Rgba32FImage};
use moxcms::{ColorProfile, DataColorSpace, ToneCurveEvaluator, ToneReprCurve};

/// XYZ of the profile connection space, whose white is D50, to linear Rec. 709, whose white is D65 (adapted by Bradford's matrix;
/// ICC.1:2022, annex E).
const REC709_FROM_PCS: [[f64; 3]; 3] = [
    [3.133_856_1, -1.616_866_7, -0.490_614_6],
    [-0.978_768_4, 1.916_141_5, 0.033_454_0],
    [0.071_945_3, -0.228_991_4, 1.405_242_7],
];

/// The picture the right way up.
pub(super) fn oriented(mut picture: DynamicImage, orientation: Option<Orientation>) -> DynamicImage {
    picture.apply_orientation(orientation.unwrap_or(Orientation::NoTransforms));
    picture
}

/// How stored colours become linear Rec. 709.
pub(super) struct Profile {
    /// By channel; grey has three alike.
    curves: [Box<dyn ToneCurveEvaluator + Send + Sync>; 3],
    rec709_from_device: [[f64; 3]; 3],
    is_grey: bool,
}

impl Profile {
    /// A profile of curves; `None` for others and damaged ones.
    pub fn read(bytes: &[u8]) -> Option<Profile> {
        let profile = ColorProfile::new_from_slice(bytes).ok()?;
        let curve = |of: &Option<ToneReprCurve>| of.as_ref()?.make_linear_evaluator().ok();
        match profile.color_space {
            DataColorSpace::Gray => {
                let curve = || curve(&profile.gray_trc);
                let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                Some(Profile {
                    curves: [curve()?, curve()?, curve()?],
                    rec709_from_device: identity,
                    is_grey: true,
                })
            }
            DataColorSpace::Rgb if profile.colorant_matrix().determinant()? != 0.0 => {
                let columns = profile.colorant_matrix().v;
                let product =
                    |row: usize, c: usize| (0..3).map(|k| REC709_FROM_PCS[row][k] * columns[k][c]).sum();
                Some(Profile {
                    curves: [curve(&profile.red_trc)?, curve(&profile.green_trc)?, curve(&profile.blue_trc)?],
                    rec709_from_device: std::array::from_fn(|row| std::array::from_fn(|c| product(row, c))),
                    is_grey: false,
                })
            }
            _ => None,
        }
    }

    /// The picture in linear Rec. 709, cut off at 0; `None` if the profile is for pictures of another kind.
    pub fn apply(&self, picture: &DynamicImage) -> Option<DynamicImage> {
        let color = picture.color();
        if color.has_color() == self.is_grey || matches!(color, ColorType::Rgb32F | ColorType::Rgba32F) {
            return None;
        }
        // Integers have few values: each is looked up.
        let levels = if color.bytes_per_pixel() / color.channel_count() == 1 { 256 } else { 65_536 };
        let tables = self.curves.each_ref().map(|curve| {
            let linear = |level: usize| {
                let y = curve.evaluate_value(level as f32 / (levels - 1) as f32);
                if y.is_finite() { y.clamp(0.0, 1.0) } else { 0.0 }
            };
            (0..levels).map(linear).collect::<Vec<f32>>()
        });
        let pixel = |rgb: [f32; 3]| {
            let level = |c: usize| tables[c][(rgb[c] * (levels - 1) as f32).round() as usize];
            converted(&self.rec709_from_device, [level(0), level(1), level(2)]).map(|v| v.max(0.0))
        };
        Some(if color.has_alpha() {
            let mut linear: Rgba32FImage = picture.to_rgba32f();
            linear.pixels_mut().for_each(|p| {
                let [r, g, b, _] = p.0;
                p.0[..3].copy_from_slice(&pixel([r, g, b]));
            });
            DynamicImage::ImageRgba32F(linear)
        } else {
            let mut linear: Rgb32FImage = picture.to_rgb32f();
            linear.pixels_mut().for_each(|p| p.0 = pixel(p.0));
            DynamicImage::ImageRgb32F(linear)
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use image::{GrayImage, RgbImage};

    /// Display P3 with the curve of sRGB.
    pub fn display_p3() -> Vec<u8> {
        ColorProfile::new_display_p3().encode().expect("its parts are known")
    }

    #[test]
    fn colours_of_display_p3() {
        let profile = Profile::read(&display_p3()).expect("primaries and curves");
        let linear = |rgb: [u8; 3]| {
            let picture = DynamicImage::ImageRgb8(RgbImage::from_pixel(1, 1, image::Rgb(rgb)));
            profile.apply(&picture).expect("a picture in colour").into_rgb32f()[(0, 0)].0
        };
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
        assert!(near(linear([255; 3]), [1.0; 3]), "{:?}", linear([255; 3]));
        // 1.2249, -0.0420, -0.0197 by the primaries (SMPTE EG 432-1), cut off at 0.
        assert!(near(linear([255, 0, 0]), [1.2249, 0.0, 0.0]), "{:?}", linear([255, 0, 0]));
        assert!(near(linear([128; 3]), [0.2159; 3]), "{:?}", linear([128; 3]));
    }

    #[test]
    fn what_does_not_fit_is_left_alone() {
        let grey = ColorProfile::new_gray_with_gamma(1.0).encode().expect("its parts are known");
        let grey = Profile::read(&grey).expect("a curve");
        let picture = DynamicImage::ImageLuma8(GrayImage::from_pixel(1, 1, image::Luma([51])));
        let linear = grey.apply(&picture).expect("grey").into_rgb32f()[(0, 0)].0;
        assert!(linear.iter().all(|v| (v - 0.2).abs() < 1e-6), "{linear:?}");
        assert!(grey.apply(&DynamicImage::new_rgb8(1, 1)).is_none());
        let whole = display_p3();
        let mut without_curves = ColorProfile::new_srgb();
        without_curves.red_trc = None;
        assert!(Profile::read(&without_curves.encode().expect("its parts are known")).is_none());
        for length in 0..whole.len() {
            let _ = Profile::read(&whole[..length]);
        }
    }

    #[test]
    fn pictures_are_turned() {
        let picture = || {
            let mut picture = GrayImage::new(2, 1);
            picture[(0, 0)] = image::Luma([9]);
            DynamicImage::ImageLuma8(picture)
        };
        let upright = oriented(picture(), Some(Orientation::Rotate90)).into_luma8();
        assert_eq!((upright.dimensions(), upright[(0, 0)].0), ((1, 2), [9]));
        assert_eq!(oriented(picture(), None).into_luma8().dimensions(), (2, 1));
    }
}
