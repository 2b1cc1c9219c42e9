//! Colour spaces of linear RGB by their primaries and white, and what turns one into another.

use super::white_balance::{CONES_FROM_XYZ, Matrix, apply};

/// Primaries and white point, x and y of each (CIE 1931).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primaries {
    /// Red.
    pub red: [f64; 2],
    /// Green.
    pub green: [f64; 2],
    /// Blue.
    pub blue: [f64; 2],
    /// What equal amounts of them are.
    pub white: [f64; 2],
}

impl Primaries {
    /// ITU-R BT.709-6, table 1: also those of sRGB.
    pub const REC709: Primaries =
        Primaries { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: [0.3127, 0.3290] };
    /// ACEScg: AP1 (Academy S-2014-004, table 1), with the white of ACES (about D60).
    pub const AP1: Primaries = Primaries {
        red: [0.713, 0.293],
        green: [0.165, 0.830],
        blue: [0.128, 0.044],
        white: [0.32168, 0.33767],
    };

    /// The matrix that gives linear Rec. 709; `None` where colours are that already, or this is no space of colours.
    pub fn to_rec709(&self) -> Option<[[f64; 3]; 3]> {
        // Headers hold single floats: what is nearly the identity is.
        let is_identity = |m: &[[f64; 3]; 3]| {
            (0..3).all(|row| (0..3).all(|c| (m[row][c] - f64::from(u8::from(row == c))).abs() < 1e-4))
        };
        self.to(&Primaries::REC709).filter(|matrix| !is_identity(matrix))
    }

    /// XYZ of linear RGB, with a luminance of 1 for white (SMPTE RP 177-1993).
    pub(super) fn xyz_from_rgb(&self) -> Option<Matrix> {
        let columns = [self.red, self.green, self.blue].map(xyz);
        let rows = transposed(&columns);
        let amounts = apply(&inverse(&rows)?, xyz(self.white));
        Some(rows.map(|row| [0, 1, 2].map(|c| row[c] * amounts[c])))
    }

    /// Linear RGB of XYZ, as it is: white stays what it is.
    pub(super) fn rgb_from_xyz(&self) -> Option<Matrix> {
        inverse(&self.xyz_from_rgb()?)
    }

    /// The matrix on linear colours of this space that gives those of another, with its white for white: adapted as by Bradford
    /// (Lam 1985). `None` if one of them is no space of colours.
    pub fn to(&self, other: &Primaries) -> Option<[[f64; 3]; 3]> {
        let [own, others] = [self.white, other.white].map(|white| apply(&CONES_FROM_XYZ, xyz(white)));
        let scaled = [0, 1, 2].map(|cone| CONES_FROM_XYZ[cone].map(|v| v * others[cone] / own[cone]));
        let adaptation = product(&inverse(&CONES_FROM_XYZ)?, &scaled);
        let xyz = product(&adaptation, &self.xyz_from_rgb()?);
        let matrix = product(&inverse(&other.xyz_from_rgb()?)?, &xyz);
        matrix.as_flattened().iter().all(|v| v.is_finite()).then_some(matrix)
    }
}

/// XYZ of a luminance of 1.
fn xyz([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

fn transposed(m: &Matrix) -> Matrix {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| m[column][row]))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let columns = transposed(b).map(|column| apply(a, column));
    transposed(&columns)
}

/// By cofactors; `None` if there is none.
fn inverse(m: &Matrix) -> Option<Matrix> {
    let minor = |row: usize, column: usize| {
        let [r0, r1] = [(row + 1) % 3, (row + 2) % 3];
        let [c0, c1] = [(column + 1) % 3, (column + 2) % 3];
        m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0]
    };
    let determinant: f64 = (0..3).map(|column| m[0][column] * minor(0, column)).sum();
    let is_regular = determinant.is_finite() && determinant != 0.0;
    is_regular.then(|| [0, 1, 2].map(|row| [0, 1, 2].map(|column| minor(column, row) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(matrix: &Matrix, published: &Matrix, within: f64) {
        for (own, theirs) in matrix.as_flattened().iter().zip(published.as_flattened()) {
            assert!((own - theirs).abs() < within, "{matrix:?}, not {published:?}");
        }
    }

    /// As in OpenColorIO's built-in transforms (`ACEScg_to_LINEAR-REC709_BFD`, inverted) and in ACES's configurations of it.
    #[test]
    fn acescg_is_as_published() {
        let matrix = Primaries::REC709.to(&Primaries::AP1).expect("spaces of colours");
        let published = [
            [0.613_097_402_4, 0.339_523_146_2, 0.047_379_451_4],
            [0.070_193_722_5, 0.916_353_879_1, 0.013_452_398_5],
            [0.020_615_592_9, 0.109_569_772_9, 0.869_814_634_2],
        ];
        assert_near(&matrix, &published, 1e-6);
        let back = Primaries::AP1.to(&Primaries::REC709).expect("spaces of colours");
        let identity = product(&matrix, &back);
        assert_near(&identity, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 1e-12);
        assert_near(&Primaries::AP1.to(&Primaries::AP1).expect("itself"), &identity, 1e-12);
    }

    /// IEC 61966-2-1, and Academy S-2014-004 for AP1.
    #[test]
    fn luminances_are_as_published() {
        let of = |space: Primaries| space.xyz_from_rgb().expect("a space of colours")[1];
        for (own, published) in [
            (of(Primaries::REC709), [0.212_639, 0.715_169, 0.072_192]),
            (of(Primaries::AP1), [0.272_228_72, 0.674_081_77, 0.053_689_52]),
        ] {
            assert!(own.iter().zip(published).all(|(a, b)| (a - b).abs() < 1e-6), "{own:?}");
        }
    }

    #[test]
    fn what_is_no_space_of_colours_has_no_matrix() {
        let line = Primaries { blue: [0.64, 0.33], ..Primaries::REC709 };
        assert_eq!(Primaries::REC709.to(&line), None);
        assert_eq!(Primaries { white: [0.3, 0.0], ..Primaries::AP1 }.to(&Primaries::REC709), None);
    }
}
