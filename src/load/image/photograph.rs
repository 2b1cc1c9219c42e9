//! What photographs ask for: their orientation (EXIF) and their colour profile (ICC.1:2022).
//!
//! Profiles of cameras, telephones and displays are three primaries with tone curves, or one curve for grey: these are applied.
//! Those of printers are tables (`A2B0`), which are not read.

use super::source::be;
use crate::color::converted;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, Rgb32FImage, Rgba32FImage};

/// XYZ of the profile connection space, whose white is D50, to linear Rec. 709, whose white is D65 (adapted by Bradford's matrix;
/// ICC.1:2022, annex E).
const REC709_FROM_PCS: [[f64; 3]; 3] = [
    [3.133_856_1, -1.616_866_7, -0.490_614_6],
    [-0.978_768_4, 1.916_141_5, 0.033_454_0],
    [0.071_945_3, -0.228_991_4, 1.405_242_7],
];

/// The picture the right way up.
pub(super) fn turned(mut picture: DynamicImage, orientation: Option<Orientation>) -> DynamicImage {
    picture.apply_orientation(orientation.unwrap_or(Orientation::NoTransforms));
    picture
}

/// The curve from a stored value to linear light, both 0 to 1.
#[derive(Debug)]
enum ToneCurve {
    Gamma(f64),
    /// Values at even distances, linear between them.
    Table(Vec<u16>),
    /// The general form (function type 4): `(a x + b)^g + e` from `d` on, `c x + f` below.
    Parametric {
        g: f64,
        a: f64,
        b: f64,
        c: f64,
        d: f64,
        e: f64,
        f: f64,
    },
}

/// How stored colours become linear Rec. 709.
pub(super) struct Profile {
    /// By channel; grey has three alike.
    curves: [ToneCurve; 3],
    rec709_from_device: [[f64; 3]; 3],
    is_grey: bool,
}

impl Profile {
    /// A profile of curves; `None` for others and damaged ones.
    pub fn read(bytes: &[u8]) -> Option<Profile> {
        let tag = |name: &[u8; 4]| tag(bytes, name);
        match bytes.get(16..20)? {
            b"GRAY" => {
                let curve = || ToneCurve::read(tag(b"kTRC")?);
                let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                Some(Profile {
                    curves: [curve()?, curve()?, curve()?],
                    rec709_from_device: identity,
                    is_grey: true,
                })
            }
            b"RGB " => {
                let [r, g, b] = [b"rXYZ", b"gXYZ", b"bXYZ"].map(|name| xyz(tag(name)?));
                let columns = [r?, g?, b?];
                let curve = |name| ToneCurve::read(tag(name)?);
                let product =
                    |row: usize, c: usize| (0..3).map(|k| REC709_FROM_PCS[row][k] * columns[c][k]).sum();
                Some(Profile {
                    curves: [curve(b"rTRC")?, curve(b"gTRC")?, curve(b"bTRC")?],
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
            let linear = |level: usize| curve.linear(level as f64 / (levels - 1) as f64) as f32;
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

impl ToneCurve {
    /// `curveType` or `parametricCurveType`.
    fn read(tag: &[u8]) -> Option<ToneCurve> {
        let count = be(tag, 8, 4)?;
        match tag.get(..4)? {
            b"curv" => match count {
                0 => Some(ToneCurve::Gamma(1.0)),
                1 => Some(ToneCurve::Gamma(be(tag, 12, 2)? as f64 / 256.0)),
                _ => {
                    let table = tag.get(12..12usize.checked_add(count.checked_mul(2)?)?)?.as_chunks::<2>().0;
                    Some(ToneCurve::Table(table.iter().map(|pair| u16::from_be_bytes(*pair)).collect()))
                }
            },
            b"para" => {
                let number = |i: usize| fixed(tag, 12 + 4 * i);
                let (mut a, mut b, mut c, mut d, mut e, mut f) = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
                let kind = be(tag, 8, 2)?;
                let g = number(0)?;
                if kind >= 1 {
                    (a, b) = (number(1)?, number(2)?);
                    // Below where the power would be of a negative number.
                    d = if a == 0.0 { 0.0 } else { -b / a };
                }
                match kind {
                    0 | 1 => {}
                    2 => (e, f) = (number(3)?, number(3)?),
                    3 => (c, d) = (number(3)?, number(4)?),
                    4 => (c, d, e, f) = (number(3)?, number(4)?, number(5)?, number(6)?),
                    _ => return None,
                }
                Some(ToneCurve::Parametric { g, a, b, c, d, e, f })
            }
            _ => None,
        }
    }

    fn linear(&self, x: f64) -> f64 {
        let y = match *self {
            ToneCurve::Gamma(gamma) => x.powf(gamma),
            ToneCurve::Table(ref table) => {
                let at = x * (table.len() - 1) as f64;
                let (low, share) = (at as usize, at.fract());
                let [low, high] = [low, (low + 1).min(table.len() - 1)].map(|i| f64::from(table[i]));
                (low + (high - low) * share) / 65535.0
            }
            ToneCurve::Parametric { g, a, b, e, d, .. } if x >= d => (a * x + b).max(0.0).powf(g) + e,
            ToneCurve::Parametric { c, f, .. } => c * x + f,
        };
        if y.is_finite() { y.clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// The bytes of a tag up to the profile's end.
fn tag<'a>(profile: &'a [u8], name: &[u8; 4]) -> Option<&'a [u8]> {
    let tags = be(profile, 128, 4)?.min(1024);
    let entry = (0..tags).map(|i| 132 + 12 * i).find(|at| profile.get(*at..at + 4) == Some(name))?;
    profile.get(be(profile, entry + 4, 4)?..)
}

/// `XYZType`.
fn xyz(tag: &[u8]) -> Option<[f64; 3]> {
    Some([fixed(tag, 8)?, fixed(tag, 12)?, fixed(tag, 16)?])
}

/// `s15Fixed16Number`.
fn fixed(bytes: &[u8], at: usize) -> Option<f64> {
    Some(f64::from(be(bytes, at, 4)? as u32 as i32) / 65536.0)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use image::{GrayImage, RgbImage};

    fn number(value: f64) -> [u8; 4] {
        ((value * 65536.0).round() as i32).to_be_bytes()
    }

    /// A profile of tags after a header that says what its colours are.
    fn profile(space: &[u8; 4], tags: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
        let mut bytes = vec![0; 128];
        bytes[16..20].copy_from_slice(space);
        bytes.extend((tags.len() as u32).to_be_bytes());
        let mut at = 132 + 12 * tags.len();
        for (name, data) in tags {
            bytes.extend(*name);
            bytes.extend((at as u32).to_be_bytes());
            bytes.extend((data.len() as u32).to_be_bytes());
            at += data.len();
        }
        bytes.extend(tags.iter().flat_map(|(_, data)| data.clone()));
        bytes
    }

    fn xyz_tag(xyz: [f64; 3]) -> Vec<u8> {
        [&b"XYZ \0\0\0\0"[..], &xyz.map(number).concat()].concat()
    }

    /// Display P3 as Apple's profile has it, with the curve of sRGB.
    pub fn display_p3() -> Vec<u8> {
        let curve =
            [2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045].map(number).as_flattened().to_vec();
        let curve = [&b"para\0\0\0\0\0\x03\0\0"[..], &curve].concat();
        profile(
            b"RGB ",
            &[
                (b"rXYZ", xyz_tag([0.51512, 0.2412, -0.00105])),
                (b"gXYZ", xyz_tag([0.29198, 0.69225, 0.04189])),
                (b"bXYZ", xyz_tag([0.1571, 0.06657, 0.78407])),
                (b"rTRC", curve.clone()),
                (b"gTRC", curve.clone()),
                (b"bTRC", curve),
            ],
        )
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
    fn curves_of_all_kinds() {
        let at = |tag: &[u8], x: f64| ToneCurve::read(tag).expect("a curve").linear(x);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-4, "{a} {b}");
        near(at(b"curv\0\0\0\0\0\0\0\0", 0.3), 0.3);
        near(at(b"curv\0\0\0\0\0\0\0\x01\x02\0", 0.5), 0.25);
        near(at(b"curv\0\0\0\0\0\0\0\x03\0\0\x20\0\xff\xff", 0.25), 0.0625);
        let parametric = |kind: u8, numbers: &[f64]| {
            let numbers: Vec<u8> = numbers.iter().flat_map(|v| number(*v)).collect();
            [&b"para\0\0\0\0\0"[..], &[kind, 0, 0], &numbers].concat()
        };
        near(at(&parametric(0, &[2.0]), 0.5), 0.25);
        near(at(&parametric(1, &[2.0, 2.0, -0.5]), 0.5), 0.25);
        near(at(&parametric(1, &[2.0, 2.0, -0.5]), 0.2), 0.0);
        near(at(&parametric(2, &[1.0, 0.5, -0.1, 0.2]), 0.1), 0.2);
        near(at(&parametric(4, &[1.0, 0.5, 0.0, 0.25, 0.5, 0.1, 0.05]), 0.4), 0.15);
        near(at(&parametric(4, &[1.0, 0.5, 0.0, 0.25, 0.5, 0.1, 0.05]), 0.6), 0.4);
        assert!(ToneCurve::read(&parametric(9, &[1.0; 7])).is_none());
    }

    #[test]
    fn what_does_not_fit_is_left_alone() {
        let grey = profile(b"GRAY", &[(b"kTRC", b"curv\0\0\0\0\0\0\0\x01\x01\0".to_vec())]);
        let grey = Profile::read(&grey).expect("a curve");
        let picture = DynamicImage::ImageLuma8(GrayImage::from_pixel(1, 1, image::Luma([51])));
        let linear = grey.apply(&picture).expect("grey").into_rgb32f()[(0, 0)].0;
        assert!(linear.iter().all(|v| (v - 0.2).abs() < 1e-6), "{linear:?}");
        assert!(grey.apply(&DynamicImage::new_rgb8(1, 1)).is_none());
        let whole = display_p3();
        assert!(Profile::read(&profile(b"CMYK", &[])).is_none());
        for length in 0..whole.len() {
            let _ = Profile::read(&whole[..length]);
        }
        assert!(Profile::read(&whole[..whole.len() - 8]).is_none());
    }

    #[test]
    fn pictures_are_turned() {
        let picture = || {
            let mut picture = GrayImage::new(2, 1);
            picture[(0, 0)] = image::Luma([9]);
            DynamicImage::ImageLuma8(picture)
        };
        let upright = turned(picture(), Some(Orientation::Rotate90)).into_luma8();
        assert_eq!((upright.dimensions(), upright[(0, 0)].0), ((1, 2), [9]));
        assert_eq!(turned(picture(), None).into_luma8().dimensions(), (2, 1));
    }
}
