//! Options for the stage of a bare model.

use crate::image::Image;
use crate::math::{DMat3, DVec3};
use std::fmt;
use std::str::FromStr;

/// The lighting of scenes without lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StageLight {
    /// A soft sky without ground and backdrop.
    #[default]
    Soft,
    /// Three-point lighting with distant softboxes: a large key light from the camera's left, a fill and a rim light.
    Studio,
    /// A blue sky with a hazy sun.
    Sky,
    /// A low, warm sun.
    Sunset,
    /// Constant white environment.
    White,
    /// No light.
    None,
}

impl StageLight {
    /// Whether the stage has a ground and default materials.
    pub(super) fn is_stage(self) -> bool {
        !matches!(self, StageLight::Soft | StageLight::None)
    }

    /// Radiance of the stage's background in the view direction, W/sr/m2.
    pub(super) fn background(self) -> [f32; 3] {
        match self {
            StageLight::Sky => [0.42, 0.50, 0.60],
            StageLight::Sunset => [0.46, 0.33, 0.26],
            StageLight::White => [1.0; 3],
            _ => [0.4; 3],
        }
    }
}

impl fmt::Display for StageLight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            StageLight::Soft => "a soft sky",
            StageLight::Studio => "studio light",
            StageLight::Sky => "sky light",
            StageLight::Sunset => "sunset light",
            StageLight::White => "white light from all directions",
            StageLight::None => "no light",
        })
    }
}

named_enum! {
    /// The ground of a model without camera and light.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Ground {
        /// No ground.
        None = "none",
        /// A ground of the background's colour, with shadows and a faint reflection.
        Shadow = "shadow",
        /// A darker, glossy floor.
        Floor = "floor",
    }
}

impl Ground {
    /// Description in the note about the stage, with a comma in front.
    pub(super) fn description(self) -> &'static str {
        match self {
            Ground::None => "",
            Ground::Shadow => ", on a ground that catches shadows",
            Ground::Floor => ", on a glossy floor",
        }
    }
}

/// The background for camera rays, instead of the environment.
#[derive(Clone, Debug)]
pub enum Background {
    /// Transparent, alpha 0.
    Transparent,
    /// Linear Rec. 709.
    Color([f32; 3]),
    /// An image, scaled to cover the whole frame.
    Picture(Image),
}

/// The stage of models without camera or light.
#[derive(Clone, Debug)]
pub struct StageOptions {
    /// The lighting of scenes without lights.
    pub light: StageLight,
    /// The light was set by the caller: it also applies to scenes with a camera.
    pub is_light_chosen: bool,
    /// The ground; `None`: depends on light and background.
    pub ground: Option<Ground>,
    /// The background; `None`: depends on the light. Applies to all scenes.
    pub background: Option<Background>,
    /// The camera's direction.
    pub view: ViewFrom,
    /// The view was set by the caller.
    pub is_view_chosen: bool,
    /// Factor on the size of the model in the picture, above 0; 1 leaves margins of a tenth of the shorter side.
    pub zoom: f64,
    /// Full vertical angle of view, degrees, above 0 and below 180.
    pub vfov_degrees: f64,
    /// Width over height of the picture; `None`: of the scene's settings, else 16:9.
    pub aspect: Option<f64>,
    /// The camera will orbit the model: keep it in view from all azimuths.
    pub is_orbit: bool,
    /// Only report the additions to a scene with a camera.
    pub is_dry_run: bool,
}

impl Default for StageOptions {
    /// A camera and a soft sky.
    fn default() -> StageOptions {
        StageOptions {
            light: StageLight::Soft,
            is_light_chosen: false,
            ground: None,
            background: None,
            view: ViewFrom::default(),
            is_view_chosen: false,
            zoom: 1.0,
            vfov_degrees: 30.0,
            aspect: None,
            is_orbit: false,
            is_dry_run: false,
        }
    }
}

impl StageOptions {
    /// Studio light, for product shots.
    pub fn studio() -> StageOptions {
        StageOptions { light: StageLight::Studio, ..StageOptions::default() }
    }

    /// Radiance of the stage's backdrop, W/sr/m2.
    pub(super) fn backdrop(&self) -> [f32; 3] {
        match self.background {
            Some(Background::Color(color)) => color,
            _ => self.light.background(),
        }
    }

    /// The ground of a bare model; `is_lit`: the scene has its own light.
    pub(super) fn ground_for(&self, is_lit: bool) -> Ground {
        let default = match self.light.is_stage() && !is_lit {
            true => Ground::Shadow,
            false => Ground::None,
        };
        self.ground.unwrap_or(default)
    }
}

/// Direction from the model, with front +z, to the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewFrom {
    /// From the front towards x, degrees.
    pub azimuth_degrees: f64,
    /// Above the horizon, degrees, from -90 to 90.
    pub elevation_degrees: f64,
}

/// Named views: azimuth and elevation, degrees.
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
    /// Three-quarter view: from the front, right and above.
    fn default() -> ViewFrom {
        let (_, azimuth_degrees, elevation_degrees) = NAMED[0];
        ViewFrom { azimuth_degrees, elevation_degrees }
    }
}

impl ViewFrom {
    /// The names of the named views.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMED.iter().map(|(name, ..)| *name)
    }

    /// Unit vector from the model to the camera.
    fn to_camera(self) -> DVec3 {
        let (sin, cos) = self.elevation_degrees.to_radians().sin_cos();
        let (x, z) = self.azimuth_degrees.to_radians().sin_cos();
        DVec3::new(x * cos, sin, z * cos).normalize()
    }

    /// Camera axes as columns: right, up, back.
    pub(super) fn axes(self) -> DMat3 {
        let back = self.to_camera();
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
