//! AgX: the look of Blender since 4.0, as in the OpenColorIO configuration of Blender 5.0 and E. Y. Chow's generator of its
//! tables ("AgX", after T. Sobotka). Of random colours over fourteen stops 0.006 (RMS) from Blender's pictures, 0.08 at most:
//! saturated ones, which Blender brings into the display's gamut by a table of its own.

/// Rec. 2020 from Rec. 709 and back (ITU-R BT.2087-0).
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
/// Moves the primaries inwards, so that bright colours run into white; configuration "AgX Log".
const INSET: Matrix = [
    [0.856_627_15, 0.095_121_24, 0.048_251_606],
    [0.137_318_97, 0.761_242, 0.101_439_04],
    [0.111_898_21, 0.076_799_42, 0.811_302_4],
];
/// Moves them outwards again, by what Filament's `ToneMapper.cpp` has for Blender's.
const OUTSET: Matrix = [
    [1.127_100_6, -0.110_606_64, -0.016_493_94],
    [-0.141_329_76, 1.157_823_7, -0.016_493_94],
    [-0.141_329_76, -0.110_606_64, 1.251_936_4],
];

/// Stops of the darkest value shown, and how many are shown; the curve's pivot is middle grey, 0.18.
const LOWEST: f64 = -12.473_93;
const STOPS: f64 = 16.5;
/// Stops of the space in which looks work.
const STOPS_OF_LOOKS: f64 = 25.0;
const DISPLAY_POWER: f64 = 2.4;
const SLOPE: f64 = 2.4;
const CURVATURE: f64 = 1.5;
/// How much of the change of hue by the curve stays.
const HUE_SHIFT: f64 = 0.4;

/// Blender's look "AgX - Punchy": a power, and shadows that were read off Blender's greys at multiples of 1/32.
const PUNCHY_POWER: f64 = 1.0912;
const PUNCHY_SHADOWS: [f64; 14] = [
    0.0, 0.03, 0.065, 0.085, 0.1030, 0.1102, 0.1246, 0.1490, 0.1889, 0.2421, 0.2923, 0.3356, 0.3735, 0.40625,
];

type Matrix = [[f64; 3]; 3];

/// The linear display colour in 0..1 for a linear colour, with or without the look "Punchy".
pub(super) fn display(rgb: [f32; 3], is_punchy: bool) -> [f64; 3] {
    let wide = product(&REC2020_FROM_REC709, rgb.map(|v| f64::from(v).clamp(-1e6, 1e6)));
    let inset = product(&INSET, wide).map(|v| v.max(1e-10));
    let formed = inset.map(|v| {
        let stops = v.log2() - LOWEST;
        let stops = if is_punchy { punchy(stops / STOPS_OF_LOOKS) * STOPS_OF_LOOKS } else { stops };
        curve((stops / STOPS).clamp(0.0, 1.0)).powf(DISPLAY_POWER)
    });
    let hue = mixed_hue(hue(inset), hue(formed));
    let outset = product(&OUTSET, with_hue(formed, hue));
    product(&REC709_FROM_REC2020, outset).map(|v| v.clamp(0.0, 1.0))
}

/// The contrast curve: two hyperbolic branches that meet at middle grey with a given slope.
fn curve(x: f64) -> f64 {
    let pivot = (-LOWEST + 0.18f64.log2()) / STOPS;
    let value = 0.18f64.powf(1.0 / DISPLAY_POWER);
    let (run, rise, sign) = if x >= pivot { (1.0 - pivot, 1.0 - value, 1.0) } else { (pivot, value, -1.0) };
    let bend = (SLOPE * run / rise).powf(CURVATURE) - 1.0;
    let scale = sign * ((SLOPE * run).powf(-CURVATURE) * bend).powf(-1.0 / CURVATURE);
    let term = SLOPE * (x - pivot) / scale;
    (scale * term / (1.0 + term.powf(CURVATURE)).powf(1.0 / CURVATURE) + value).clamp(0.0, 1.0)
}

/// The look's value for one in 0..1.
fn punchy(x: f64) -> f64 {
    let place = x.clamp(0.0, 1.0) * 32.0;
    let low = place as usize;
    let toned = match PUNCHY_SHADOWS.get(low..low + 2) {
        Some(pair) => pair[0] + (pair[1] - pair[0]) * place.fract(),
        None => place / 32.0,
    };
    toned.powf(PUNCHY_POWER)
}

fn product(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Hue in turns, 0 for red.
fn hue([r, g, b]: [f64; 3]) -> f64 {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let range = most - least;
    let sixths = match () {
        () if range <= 0.0 => 0.0,
        () if most == r => (g - b) / range,
        () if most == g => 2.0 + (b - r) / range,
        () => 4.0 + (r - g) / range,
    };
    (sixths / 6.0).rem_euclid(1.0)
}

/// The hue between two, the short way round.
fn mixed_hue(before: f64, after: f64) -> f64 {
    let turn = (after - before + 0.5).rem_euclid(1.0) - 0.5;
    (before + HUE_SHIFT * turn).rem_euclid(1.0)
}

/// The colour of the same largest and least channel with another hue.
fn with_hue(color: [f64; 3], hue: f64) -> [f64; 3] {
    let most = color.into_iter().fold(f64::MIN, f64::max);
    let least = color.into_iter().fold(f64::MAX, f64::min);
    [5.0, 3.0, 1.0].map(|n| {
        let k = (n + hue * 6.0).rem_euclid(6.0);
        most - (most - least) * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}
