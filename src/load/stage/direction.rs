//! Directions from which models are seen.

use crate::math::{DMat3, DVec3};
use std::fmt;
use std::str::FromStr;

/// Where the camera stands, seen from the model, whose front is taken to be z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewFrom {
    /// From the front towards x, degrees.
    pub azimuth_degrees: f64,
    /// Above the horizon, degrees, from -90 to 90.
    pub elevation_degrees: f64,
}

/// Views by name: azimuth and elevation.
const NAMED: [(&str, f64, f64); 8] = [
    ("three-quarter", 32.0, 20.0),
    ("front", 0.0, 8.0),
    ("right", 90.0, 8.0),
    ("back", 180.0, 8.0),
    ("left", -90.0, 8.0),
    ("top", 0.0, 90.0),
    ("bottom", 0.0, -90.0),
    ("iso", 45.0, 35.264_389_682_754_654),
];

impl Default for ViewFrom {
    /// Three quarters: from the front, right and above.
    fn default() -> ViewFrom {
        let (_, azimuth_degrees, elevation_degrees) = NAMED[0];
        ViewFrom { azimuth_degrees, elevation_degrees }
    }
}

impl ViewFrom {
    /// The names that it may be parsed from.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMED.iter().map(|(name, ..)| *name)
    }

    /// Unit vector from the model to the camera.
    fn towards(self) -> DVec3 {
        let (sin, cos) = self.elevation_degrees.to_radians().sin_cos();
        let (x, z) = self.azimuth_degrees.to_radians().sin_cos();
        DVec3::new(x * cos, sin, z * cos).normalize()
    }

    /// Columns: right, up, back.
    pub(super) fn axes(self) -> DMat3 {
        let back = self.towards();
        let (x, z) = self.azimuth_degrees.to_radians().sin_cos();
        let right = DVec3::new(z, 0.0, -x);
        DMat3::from_cols(right, back.cross(right), back)
    }
}

impl FromStr for ViewFrom {
    type Err = String;

    /// A name, or azimuth and elevation in degrees: `30,20`.
    fn from_str(text: &str) -> Result<ViewFrom, String> {
        if let Some(&(_, azimuth_degrees, elevation_degrees)) = NAMED.iter().find(|(name, ..)| *name == text)
        {
            return Ok(ViewFrom { azimuth_degrees, elevation_degrees });
        }
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        let numbers = text.split_once(',').and_then(|(a, e)| Some((number(a)?, number(e)?)));
        match numbers {
            Some((azimuth_degrees, elevation_degrees)) if elevation_degrees.abs() <= 90.0 => {
                Ok(ViewFrom { azimuth_degrees, elevation_degrees })
            }
            _ => {
                let names: Vec<&str> = ViewFrom::names().collect();
                Err(format!(
                    "must be {}, or azimuth and elevation in degrees such as 30,20 (elevation from -90 to 90)",
                    names.join(", ")
                ))
            }
        }
    }
}

impl fmt::Display for ViewFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == ViewFrom::default() {
            return f.write_str("the front, right and above");
        }
        let named = NAMED.iter().find(|(_, a, e)| *a == self.azimuth_degrees && *e == self.elevation_degrees);
        match named {
            Some(("iso", ..)) => f.write_str("an isometric direction"),
            Some((name, ..)) => write!(f, "the {name}"),
            None => write!(f, "azimuth {}, elevation {}", self.azimuth_degrees, self.elevation_degrees),
        }
    }
}
