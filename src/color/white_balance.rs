//! White balance: what is lit by light of some temperature becomes as it would be under daylight.

/// White of Rec. 709 (D65), x and y.
const WHITE: [f64; 2] = [0.3127, 0.3290];

/// Cone responses from XYZ, and back (Bradford; Lam 1985).
pub(super) const CONES_FROM_XYZ: Matrix =
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
const XYZ_FROM_CONES: Matrix = [
    [0.986_992_9, -0.147_054_3, 0.159_962_7],
    [0.432_305_3, 0.518_360_3, 0.049_291_2],
    [-0.008_528_7, 0.040_042_8, 0.968_486_7],
];
/// XYZ from linear Rec. 709, and back (IEC 61966-2-1).
const XYZ_FROM_RGB: Matrix = [
    [0.412_390_8, 0.357_584_34, 0.180_480_79],
    [0.212_639_01, 0.715_168_68, 0.072_192_32],
    [0.019_330_82, 0.119_194_78, 0.950_532_15],
];
const RGB_FROM_XYZ: Matrix = [
    [3.240_969_9, -1.537_383_2, -0.498_610_76],
    [-0.969_243_64, 1.875_967_5, 0.041_555_06],
    [0.055_630_08, -0.203_976_96, 1.056_971_5],
];

pub(super) type Matrix = [[f64; 3]; 3];

/// The matrix on linear Rec. 709 that makes light of a temperature, 1667 to 25000 kelvin, white.
pub fn white_balance(kelvin: f64) -> [[f32; 3]; 3] {
    let cones = |[x, y]: [f64; 2]| apply(&CONES_FROM_XYZ, [x / y, 1.0, (1.0 - x - y) / y]);
    let (from, to) = (cones(chromaticity(kelvin)), cones(WHITE));
    let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let columns = unit.map(|rgb| {
        let own = apply(&CONES_FROM_XYZ, apply(&XYZ_FROM_RGB, rgb));
        let adapted = [0, 1, 2].map(|c| own[c] * to[c] / from[c]);
        apply(&RGB_FROM_XYZ, apply(&XYZ_FROM_CONES, adapted))
    });
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| columns[column][row] as f32))
}

/// x and y: daylight (CIE 15:2004, eq. 3.3 and 3.4) above 4500 K, black bodies (Kang et al. 2002) below 3500 K, and what lies
/// between in between.
fn chromaticity(kelvin: f64) -> [f64; 2] {
    let t = kelvin.clamp(1667.0, 25_000.0);
    let share = ((t - 3500.0) / 1000.0).clamp(0.0, 1.0);
    let (day, body) = (daylight(t.max(4000.0)), black_body(t));
    [0, 1].map(|k| body[k] + share * (day[k] - body[k]))
}

fn daylight(t: f64) -> [f64; 2] {
    let x = match t <= 7000.0 {
        true => -4.6070e9 / t.powi(3) + 2.9678e6 / t.powi(2) + 0.09911e3 / t + 0.244063,
        false => -2.0064e9 / t.powi(3) + 1.9018e6 / t.powi(2) + 0.24748e3 / t + 0.237040,
    };
    [x, -3.0 * x * x + 2.870 * x - 0.275]
}

fn black_body(t: f64) -> [f64; 2] {
    let x = match t <= 4000.0 {
        true => -0.2661239e9 / t.powi(3) - 0.2343589e6 / t.powi(2) + 0.8776956e3 / t + 0.179910,
        false => -3.0258469e9 / t.powi(3) + 2.1070379e6 / t.powi(2) + 0.2226347e3 / t + 0.240390,
    };
    let y = match t {
        t if t <= 2222.0 => ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683,
        t if t <= 4000.0 => ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867,
        _ => ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483,
    };
    [x, y]
}

pub(super) fn apply(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn daylight_stays_and_lamps_become_white() {
        let balanced = |kelvin, rgb: [f32; 3]| {
            white_balance(kelvin).map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2])
        };
        assert!(balanced(6504.0, [1.0; 3]).iter().all(|v| (v - 1.0).abs() < 2e-3));
        // CIE illuminant A: 2856 K, x 0.44758, y 0.40745.
        let [x, y] = [0.44758, 0.40745];
        let lamp = apply(&RGB_FROM_XYZ, [x / y, 1.0, (1.0 - x - y) / y]).map(|v| v as f32);
        let white = balanced(2856.0, lamp);
        assert!(white.iter().all(|v| (v - 1.0).abs() < 0.01), "{lamp:?} {white:?}");
    }
}
