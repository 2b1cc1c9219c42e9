//! View transforms from scene-referred linear Rec. 709 to display values.

mod table;

use super::{Matrix, apply, luminance, srgb_from_linear};
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;
pub use table::ViewTable;

/// A view transform (tone mapping and display encoding).
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum ViewTransform {
    /// The sRGB transfer function; values above 1 are clipped.
    #[default]
    Srgb,
    /// A filmic curve with highlight roll-off (Narkowicz 2016, "ACES Filmic Tone Mapping Curve", with the author's exposure
    /// factor of 0.6 that matches the brightness of ACES), then sRGB.
    Filmic,
    /// Blender's AgX.
    Agx,
    /// Blender's AgX with the look "Punchy".
    AgxPunchy,
    /// Khronos PBR Neutral (2024): base colours below 0.8 are reproduced exactly, highlights are compressed and desaturated.
    PbrNeutral,
    /// False colours of luminance in stops from middle grey (0.18): blue below -4.5, then cyan, green, grey around 0, yellow,
    /// orange, red above 3.5; black below -10, white above 6.5.
    FalseColor,
    /// A power of 1 / 2.2; values above 1 are clipped.
    Gamma,
    /// A lookup table (LUT) from a file.
    Table(Arc<ViewTable>),
}

impl ViewTransform {
    /// All built-in views, with names and descriptions.
    pub const NAMED: [(ViewTransform, &'static str, &'static str); 7] = [
        (ViewTransform::Srgb, "srgb", "sRGB; values above 1 are clipped"),
        (ViewTransform::Filmic, "filmic", "A filmic curve (Narkowicz 2016)"),
        (ViewTransform::Agx, "agx", "Blender's AgX"),
        (ViewTransform::AgxPunchy, "agx-punchy", "Blender's AgX with its look Punchy"),
        (ViewTransform::PbrNeutral, "pbr-neutral", "Khronos PBR Neutral: keeps base colours"),
        (ViewTransform::FalseColor, "false-color", "False colours: stops from middle grey"),
        (ViewTransform::Gamma, "gamma", "A power of 1 / 2.2"),
    ];

    /// The built-in view of that name.
    pub fn from_name(name: &str) -> Option<ViewTransform> {
        ViewTransform::NAMED.into_iter().find(|named| named.1 == name).map(|named| named.0)
    }

    /// Is this the name of a LUT file, which has an extension, rather than of a built-in view?
    pub fn is_file(name: &str) -> bool {
        Path::new(name).extension().is_some()
    }

    /// Decodes a LUT file: cinespace (`.csp`), or `.view` of the Blender exporter.
    ///
    /// # Errors
    /// A description of the error; for text with the line.
    pub fn from_table(bytes: &[u8], path: &Path) -> Result<ViewTransform, String> {
        Ok(ViewTransform::Table(Arc::new(ViewTable::read(bytes, path)?)))
    }

    /// The name of a built-in view, or the path of the LUT file.
    pub fn name(&self) -> Cow<'static, str> {
        let named = ViewTransform::NAMED.into_iter().find(|named| named.0 == *self).map(|named| named.1);
        match self {
            ViewTransform::Table(table) => table.path().display().to_string().into(),
            _ => named.unwrap_or_default().into(),
        }
    }

    /// The display values in 0..1 of a linear colour.
    pub fn encode(&self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            ViewTransform::Srgb => rgb.map(srgb_from_linear),
            ViewTransform::Filmic => rgb.map(|v| srgb_from_linear(filmic(v))),
            ViewTransform::Agx => agx(rgb, false).map(|v| srgb_from_linear(v as f32)),
            ViewTransform::AgxPunchy => agx(rgb, true).map(|v| srgb_from_linear(v as f32)),
            ViewTransform::PbrNeutral => pbr_neutral(rgb).map(srgb_from_linear),
            ViewTransform::FalseColor => false_color(luminance(rgb)),
            ViewTransform::Gamma => rgb.map(|v| v.clamp(0.0, 1.0).powf(1.0 / 2.2)),
            ViewTransform::Table(table) => table.encode(rgb),
        }
    }
}

fn filmic(linear: f32) -> f32 {
    // Clamped, since infinity / infinity is NaN.
    let x = if linear > 0.0 { 0.6 * linear.min(1e6) } else { 0.0 };
    x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
}

/// "Khronos PBR Neutral Tone Mapper", Khronos Group 2024, section "Tone Mapper".
fn pbr_neutral(rgb: [f32; 3]) -> [f32; 3] {
    /// Normal-incidence Fresnel reflectance of dielectrics (named F90 in the specification), subtracted from all colours.
    const F90: f32 = 0.04;
    const START: f32 = 0.8 - F90;
    const DESATURATION: f32 = 0.15;
    let rgb = rgb.map(|v| if v > 0.0 { v.min(1e6) } else { 0.0 });
    let darkest = rgb[0].min(rgb[1]).min(rgb[2]);
    let offset = if darkest < 2.0 * F90 { darkest - darkest * darkest / (4.0 * F90) } else { F90 };
    let rgb = rgb.map(|v| v - offset);
    let peak = rgb[0].max(rgb[1]).max(rgb[2]);
    if peak < START {
        return rgb;
    }
    let d = 1.0 - START;
    let compressed = 1.0 - d * d / (peak + d - START);
    let mix = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    rgb.map(|v| v * compressed / peak * (1.0 - mix) + compressed * mix)
}

/// Bands of false colours: upper bound in stops from middle grey, and display colour.
const BANDS: [(f32, [f32; 3]); 10] = [
    (-10.0, [0.0, 0.0, 0.0]),
    (-4.5, [0.1, 0.1, 0.7]),
    (-2.5, [0.0, 0.5, 0.8]),
    (-1.0, [0.0, 0.6, 0.3]),
    (-0.25, [0.35, 0.5, 0.35]),
    (0.25, [0.5, 0.5, 0.5]),
    (1.5, [0.75, 0.75, 0.3]),
    (3.5, [0.95, 0.6, 0.1]),
    (6.5, [0.8, 0.1, 0.1]),
    (f32::INFINITY, [1.0, 1.0, 1.0]),
];

fn false_color(luminance: f32) -> [f32; 3] {
    let stops = if luminance > 0.0 { (luminance / 0.18).log2() } else { f32::NEG_INFINITY };
    BANDS.iter().find(|(below, _)| stops < *below).map_or([1.0; 3], |(_, color)| *color)
}

// AgX (T. Sobotka), as in the OpenColorIO configuration of Blender 5.0 and in E. Y. Chow's generator of its tables. The display
// values of random colours over fourteen stops differ from Blender's by 0.006 (RMS), at most by 0.08: that is for saturated
// colours, which Blender maps into the display gamut by a table of its own.

/// Rec. 2020 from Rec. 709, and the inverse (ITU-R BT.2087-0).
const REC2020_FROM_REC709: Matrix = [
    [0.627_403_9, 0.329_283_04, 0.043_313_066],
    [0.069_097_29, 0.919_540_4, 0.011_362_316],
    [0.016_391_44, 0.088_013_31, 0.895_595_25],
];
const REC709_FROM_REC2020: Matrix = [
    [1.660_491, -0.587_641_1, -0.072_849_86],
    [-0.124_550_47, 1.132_899_9, -0.008_349_42],
    [-0.018_150_76, -0.100_578_9, 1.118_729_7],
];
/// Moves the primaries inwards, so that bright colours desaturate; from the configuration's colour space "AgX Log".
const INSET: Matrix = [
    [0.856_627_15, 0.095_121_24, 0.048_251_606],
    [0.137_318_97, 0.761_242, 0.101_439_04],
    [0.111_898_21, 0.076_799_42, 0.811_302_4],
];
/// Moves the primaries outwards again; the matrix for Blender's AgX in Filament's `ToneMapper.cpp`.
const OUTSET: Matrix = [
    [1.127_100_6, -0.110_606_64, -0.016_493_94],
    [-0.141_329_76, 1.157_823_7, -0.016_493_94],
    [-0.141_329_76, -0.110_606_64, 1.251_936_4],
];

/// Lower end of the log2 range, and its width, stops.
const MIN_LOG2: f64 = -12.473_93;
const STOPS: f64 = 16.5;
/// Width of the log2 range in which looks are applied, stops.
const LOOK_STOPS: f64 = 25.0;
const DISPLAY_POWER: f64 = 2.4;
/// Slope of the contrast curve at its pivot, middle grey (0.18).
const SLOPE: f64 = 2.4;
const CURVATURE: f64 = 1.5;
/// Fraction of the curve's change of hue that is kept.
const HUE_SHIFT: f64 = 0.4;

/// Blender's look "AgX - Punchy": an exponent, and tones of the shadows at multiples of 1/32, measured on Blender's greys.
const PUNCHY_POWER: f64 = 1.0912;
const PUNCHY_SHADOWS: [f64; 14] = [
    0.0, 0.03, 0.065, 0.085, 0.1030, 0.1102, 0.1246, 0.1490, 0.1889, 0.2421, 0.2923, 0.3356, 0.3735, 0.40625,
];

/// AgX: the linear display colour in 0..1 of a scene-referred colour, with or without the look "Punchy".
fn agx(rgb: [f32; 3], is_punchy: bool) -> [f64; 3] {
    let wide = apply(&REC2020_FROM_REC709, rgb.map(|v| f64::from(v).clamp(-1e6, 1e6)));
    let inset = apply(&INSET, wide).map(|v| v.max(1e-10));
    let contrasted = inset.map(|v| {
        let stops = v.log2() - MIN_LOG2;
        let stops = if is_punchy { punchy(stops / LOOK_STOPS) * LOOK_STOPS } else { stops };
        curve((stops / STOPS).clamp(0.0, 1.0)).powf(DISPLAY_POWER)
    });
    let hue = mixed_hue(hue(inset), hue(contrasted));
    let outset = apply(&OUTSET, with_hue(contrasted, hue));
    apply(&REC709_FROM_REC2020, outset).map(|v| v.clamp(0.0, 1.0))
}

/// The contrast curve: two hyperbolic branches that meet at middle grey with a given slope.
fn curve(x: f64) -> f64 {
    let pivot = (-MIN_LOG2 + 0.18f64.log2()) / STOPS;
    let value = 0.18f64.powf(1.0 / DISPLAY_POWER);
    let (run, rise, sign) = if x >= pivot { (1.0 - pivot, 1.0 - value, 1.0) } else { (pivot, value, -1.0) };
    let bend = (SLOPE * run / rise).powf(CURVATURE) - 1.0;
    let scale = sign * ((SLOPE * run).powf(-CURVATURE) * bend).powf(-1.0 / CURVATURE);
    let term = SLOPE * (x - pivot) / scale;
    (scale * term / (1.0 + term.powf(CURVATURE)).powf(1.0 / CURVATURE) + value).clamp(0.0, 1.0)
}

/// The look "Punchy" for a log-encoded value in 0..1.
fn punchy(x: f64) -> f64 {
    let scaled = x.clamp(0.0, 1.0) * 32.0;
    let low = scaled as usize;
    let toned = match PUNCHY_SHADOWS.get(low..low + 2) {
        Some(pair) => pair[0] + (pair[1] - pair[0]) * scaled.fract(),
        None => scaled / 32.0,
    };
    toned.powf(PUNCHY_POWER)
}

/// Hue in turns, 0 for red.
fn hue([r, g, b]: [f64; 3]) -> f64 {
    let (max, min) = (r.max(g).max(b), r.min(g).min(b));
    let range = max - min;
    let sixths = match () {
        () if range <= 0.0 => 0.0,
        () if max == r => (g - b) / range,
        () if max == g => 2.0 + (b - r) / range,
        () => 4.0 + (r - g) / range,
    };
    (sixths / 6.0).rem_euclid(1.0)
}

/// Interpolates between two hues, the shorter way around.
fn mixed_hue(before: f64, after: f64) -> f64 {
    let turn = (after - before + 0.5).rem_euclid(1.0) - 0.5;
    (before + HUE_SHIFT * turn).rem_euclid(1.0)
}

/// The colour with another hue and the same largest and smallest channel.
fn with_hue(color: [f64; 3], hue: f64) -> [f64; 3] {
    let max = color.into_iter().fold(f64::MIN, f64::max);
    let min = color.into_iter().fold(f64::MAX, f64::min);
    [5.0, 3.0, 1.0].map(|n| {
        let k = (n + hue * 6.0).rem_euclid(6.0);
        max - (max - min) * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(found: [f32; 3], expected: [f32; 3], tolerance: f32) {
        let is_near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < tolerance);
        assert!(is_near, "{found:?}, not {expected:?}");
    }

    /// Display values of Blender 5.0.1 (16-bit PNG by `Image.save_render`).
    #[test]
    fn agx_matches_blender() {
        let base = [
            ([0.18; 3], [0.4613, 0.4613, 0.4614]),
            ([1.0; 3], [0.771; 3]),
            ([0.02; 3], [0.125; 3]),
            ([16.0; 3], [0.9986; 3]),
            ([1.0, 0.0, 0.0], [0.858, 0.2241, 0.1292]),
            ([0.0, 1.0, 0.0], [0.4325, 0.7726, 0.3184]),
            ([0.5, 0.2, 0.1], [0.6833, 0.4793, 0.361]),
            ([8.0, 2.0, 0.5], [0.9919, 0.847, 0.781]),
            ([0.1, 0.3, 0.9], [0.4326, 0.5896, 0.7795]),
        ];
        base.iter().for_each(|(rgb, shown)| assert_near(ViewTransform::Agx.encode(*rgb), *shown, 0.004));
        assert_near(ViewTransform::Agx.encode([0.0, 0.0, 1.0]), [0.0791, 0.3376, 0.8215], 0.04);
        let punchy = [
            ([0.18; 3], [0.3463; 3]),
            ([1.0; 3], [0.6923; 3]),
            ([0.02; 3], [0.0395; 3]),
            ([16.0; 3], [0.977; 3]),
            ([0.5, 0.2, 0.1], [0.5677, 0.3626, 0.2455]),
            ([8.0, 2.0, 0.5], [0.9714, 0.7878, 0.7039]),
            ([0.1, 0.3, 0.9], [0.2869, 0.4788, 0.694]),
        ];
        punchy
            .iter()
            .for_each(|(rgb, shown)| assert_near(ViewTransform::AgxPunchy.encode(*rgb), *shown, 0.01));
    }

    /// By the specification, dielectrics under white light are displayed with their base colour; and a highlight, worked out by hand.
    #[test]
    fn pbr_neutral_keeps_base_colours() {
        assert_near(pbr_neutral([0.54, 0.34, 0.14]), [0.5, 0.3, 0.1], 1e-6);
        // Peak 3.96, compressed to 1 - 0.0576 / 3.44, and desaturated by 0.31.
        assert_near(pbr_neutral([4.0, 1.0, 1.0]), [0.983_256, 0.468_299, 0.468_299], 1e-4);
        assert_near(pbr_neutral([0.04; 3]), [0.01; 3], 1e-6);
    }

    #[test]
    fn false_colours_follow_stops_from_middle_grey() {
        let shown = |stops: f32| ViewTransform::FalseColor.encode([0.18 * stops.exp2(); 3]);
        assert_eq!(shown(0.0), [0.5; 3]);
        assert_eq!((shown(-11.0), shown(7.0)), ([0.0; 3], [1.0; 3]));
        assert_eq!(shown(5.0), [0.8, 0.1, 0.1]);
        assert_eq!(ViewTransform::FalseColor.encode([0.0; 3]), [0.0; 3]);
    }

    #[test]
    fn all_views_stay_in_range() {
        use ViewTransform::*;
        for view in [Srgb, Filmic, Agx, AgxPunchy, PbrNeutral, FalseColor, Gamma] {
            for v in [-1.0, 0.0, 1e-9, 0.5, 1.0, 50.0, 1e30, f32::INFINITY, f32::NAN] {
                let shown = view.encode([v, 0.3, 1.0]);
                // NaN becomes 0 on conversion to bytes.
                assert!(
                    shown.iter().all(|c| c.is_nan() || (0.0..=1.0).contains(c)),
                    "{view:?} {v}: {shown:?}"
                );
            }
        }
    }
}
