//! Axes of files.

use crate::math::{DMat3, DVec3};

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// Guessed by what the file says about its origin and by the model's shape.
    Auto,
    /// x.
    X,
    /// y, as everywhere here.
    #[default]
    Y,
    /// z, as in Blender and most scans and CAD.
    Z,
    /// Against x.
    NegX,
    /// Against y.
    NegY,
    /// Against z.
    NegZ,
}

/// What a file tells about who wrote it and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UpHint {
    /// The axis that this writer's files have up.
    pub writer: Option<(Up, &'static str)>,
    /// Files of this format mostly have y up; else they have z up about as often.
    pub is_mostly_y: bool,
}

impl Up {
    /// All of them.
    pub const ALL: [Up; 7] = [Up::Auto, Up::X, Up::Y, Up::Z, Up::NegX, Up::NegY, Up::NegZ];

    /// As users write it.
    pub fn name(self) -> &'static str {
        match self {
            Up::Auto => "auto",
            Up::X => "x",
            Up::Y => "y",
            Up::Z => "z",
            Up::NegX => "-x",
            Up::NegY => "-y",
            Up::NegZ => "-z",
        }
    }

    /// The rotation that brings it up, exact in every number. The front stays where most programs have it: -y of models
    /// with z up comes to the front, z.
    pub(super) fn rotation(self) -> DMat3 {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let (x, y, z) = match self {
            Up::Auto | Up::Y => (x, y, z),
            Up::Z => (x, -z, y),
            Up::NegY => (x, -y, -z),
            Up::NegZ => (x, z, -y),
            Up::X => (y, -x, z),
            Up::NegX => (-y, x, z),
        };
        DMat3::from_cols(x, y, z)
    }
}
