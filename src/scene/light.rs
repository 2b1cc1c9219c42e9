//! Lights without a surface, measured light profiles, light groups, environment and portals.

use super::ImageId;
use super::geometry::Keyframes;
use super::object_traits::{LightLinks, RayKinds};
use crate::image::Image;
use crate::math::{DQuat, DVec3, poly};
use std::sync::Arc;

/// A light without a surface (KHR_lights_punctual).
#[derive(Clone, Debug)]
pub struct Light {
    /// Name, for reports.
    pub name: String,
    /// Kind, with position and direction in world space.
    pub kind: LightKind,
    /// Linear RGB: radiant intensity (W/sr) of point, spot and profiled lights; irradiance (W/m2) of directional lights and
    /// suns, on a surface that faces them.
    pub intensity: [f32; 3],
    /// Directional distribution of [`LightKind::Profiled`], relative to `intensity`.
    pub profile: Option<Arc<LightProfile>>,
    /// Light group, for separate outputs; empty for the default group.
    pub group: String,
    /// Ray visibility: [`RayKinds::DIFFUSE`] is illumination by diffuse reflection, and so on.
    pub visible_to: RayKinds,
    /// Light linking and shadow linking.
    pub links: LightLinks,
    /// Kind at other times, if it moves while the shutter is open.
    pub motion: Option<Keyframes<LightKind>>,
}

/// Kinds of lights without a surface. Directions are unit vectors along which light travels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Isotropic point light.
    Point {
        /// Position, metres.
        position: DVec3,
    },
    /// Spot light with a falloff between two half angles.
    Spot {
        /// Position, metres.
        position: DVec3,
        /// Axis of the cone.
        direction: DVec3,
        /// Half angle of the cone of full intensity, radians.
        inner_angle_rad: f64,
        /// Half angle of the whole cone, radians.
        outer_angle_rad: f64,
        /// Falloff between both.
        falloff: SpotFalloff,
    },
    /// Point light with the distribution of [`Light::profile`].
    Profiled {
        /// Position, metres.
        position: DVec3,
        /// Rotation of the profile to world space: vertical angle 0 is -z, horizontal angles turn from x to y.
        rotation: DQuat,
        /// Half angles, radians, of an optional cone around the axis with a smoothstep falloff between them.
        cone: Option<[f64; 2]>,
    },
    /// Infinitely distant parallel light.
    Directional {
        /// Direction in which light travels.
        direction: DVec3,
    },
    /// Infinitely distant disk, as the sun. Invisible to camera rays, visible in mirrors.
    Sun {
        /// Direction in which light from its centre travels.
        direction: DVec3,
        /// Angular diameter, radians, 1e-5 to pi.
        angle_rad: f64,
    },
}

impl LightKind {
    /// Name of the kind, for reports.
    pub fn name(&self) -> &'static str {
        match self {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Profiled { .. } => "profiled",
            LightKind::Directional { .. } => "directional",
            LightKind::Sun { .. } => "sun",
        }
    }

    /// The position; `None` for infinitely distant lights, whose intensity is an irradiance.
    pub fn position(&self) -> Option<DVec3> {
        match *self {
            LightKind::Point { position }
            | LightKind::Spot { position, .. }
            | LightKind::Profiled { position, .. } => Some(position),
            LightKind::Directional { .. } | LightKind::Sun { .. } => None,
        }
    }

    /// The axis along which light travels; `None` for isotropic lights.
    pub fn direction(&self) -> Option<DVec3> {
        match *self {
            LightKind::Point { .. } => None,
            LightKind::Profiled { rotation, .. } => Some(rotation * DVec3::NEG_Z),
            LightKind::Spot { direction, .. }
            | LightKind::Directional { direction }
            | LightKind::Sun { direction, .. } => Some(direction),
        }
    }

    /// The inner and outer half angle of its cone, radians, if any.
    pub fn cone_rad(&self) -> Option<[f64; 2]> {
        match *self {
            LightKind::Spot { inner_angle_rad, outer_angle_rad, .. } => {
                Some([inner_angle_rad, outer_angle_rad])
            }
            LightKind::Profiled { cone, .. } => cone,
            _ => None,
        }
    }
}

/// Falloff of a spot light between its inner and outer cone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SpotFalloff {
    /// The square of a linear ramp in the cosine, from 1 at the inner cone to 0 at the outer (KHR_lights_punctual).
    #[default]
    Square,
    /// Smoothstep in the cosine of the angle, as in Blender; the inner angle is derived from its blend parameter.
    Smooth,
}

/// A measured distribution of intensity (IES LM-63, photometry of type C): the vertical angle is that with the axis of the
/// light, the horizontal angle the one around it.
#[derive(Clone, Debug, PartialEq)]
pub struct LightProfile {
    /// Increasing, within 0..180 degrees; the intensity outside is 0.
    pub vertical_deg: Vec<f32>,
    /// Increasing, within 0..360 degrees: 0 alone, or from 0 to 90, 180 or 360, or from 90 to 270; the rest follows by
    /// symmetry.
    pub horizontal_deg: Vec<f32>,
    /// Relative intensities, at least 0, vertical angle fastest.
    pub values: Vec<f32>,
}

impl LightProfile {
    /// The intensity at two angles, degrees (0..180 and 0..360), bilinearly interpolated.
    pub fn at(&self, vertical_deg: f32, horizontal_deg: f32) -> f32 {
        let Some((row, down)) = between(&self.vertical_deg, vertical_deg) else { return 0.0 };
        let folded = self.folded(horizontal_deg);
        let (column, around) = between(&self.horizontal_deg, folded).unwrap_or((0, 0.0));
        let rows = self.vertical_deg.len();
        let along = |column: usize| {
            let value = |row: usize| self.values[column * rows + row.min(rows - 1)];
            mix(value(row), value(row + 1), down)
        };
        mix(along(column), along((column + 1).min(self.horizontal_deg.len() - 1)), around)
    }

    /// The equivalent horizontal angle within the file's range, by its symmetry.
    fn folded(&self, horizontal_deg: f32) -> f32 {
        let (first, last) = (self.horizontal_deg[0], self.horizontal_deg[self.horizontal_deg.len() - 1]);
        let turn = horizontal_deg.rem_euclid(360.0);
        let half = if turn > 180.0 { 360.0 - turn } else { turn };
        if first >= 90.0 {
            // Mirrored at the plane of 90 and 270 degrees.
            return if turn < 90.0 {
                180.0 - turn
            } else if turn > 270.0 {
                540.0 - turn
            } else {
                turn
            };
        }
        if last > 180.0 {
            turn
        } else if last > 90.0 {
            half
        } else if last > 0.0 {
            if half > 90.0 { 180.0 - half } else { half }
        } else {
            0.0
        }
    }

    /// The profile with reversed horizontal angles.
    #[must_use]
    pub fn mirrored(mut self) -> LightProfile {
        // Other ranges are symmetric.
        let (first, last) = (self.horizontal_deg[0], self.horizontal_deg[self.horizontal_deg.len() - 1]);
        if first >= 90.0 || last > 180.0 {
            self.horizontal_deg.iter_mut().for_each(|angle| *angle = 360.0 - *angle);
            self.horizontal_deg.reverse();
            let columns = self.values.chunks_exact(self.vertical_deg.len()).rev();
            self.values = columns.flatten().copied().collect();
        }
        self
    }

    /// The maximum intensity.
    pub fn peak(&self) -> f32 {
        self.values.iter().fold(0.0, |max, value| max.max(*value))
    }

    /// The mean over all directions, by quadrature with `steps` rings of equal area and twice as many azimuths.
    pub fn mean(&self, steps: u32) -> f32 {
        let mut sum = 0.0;
        for i in 0..steps {
            let cosine = 1.0 - 2.0 * (i as f32 + 0.5) / steps as f32;
            let vertical_deg = poly::acos(cosine).to_degrees();
            for j in 0..2 * steps {
                sum += f64::from(self.at(vertical_deg, 180.0 * (j as f32 + 0.5) / steps as f32));
            }
        }
        (sum / (2.0 * f64::from(steps) * f64::from(steps))) as f32
    }

    /// Whether the fields satisfy their documented constraints.
    pub fn is_valid(&self) -> bool {
        let increases = |list: &[f32], max: f32| {
            list.windows(2).all(|w| w[0] < w[1])
                && list.first().is_some_and(|first| *first >= 0.0)
                && list.last().is_some_and(|last| *last <= max)
        };
        increases(&self.vertical_deg, 180.0)
            && increases(&self.horizontal_deg, 360.0)
            && self.values.len() == self.vertical_deg.len() * self.horizontal_deg.len()
            && self.values.iter().all(|value| value.is_finite() && *value >= 0.0)
    }
}

/// The index of the last entry of an increasing list at or below a number, and the fraction towards the next; `None` outside
/// the range of the list.
fn between(list: &[f32], number: f32) -> Option<(usize, f32)> {
    let (first, last) = (*list.first()?, *list.last()?);
    // Tolerance for rounding of angles.
    const SLACK: f32 = 1e-3;
    if !(first - SLACK..=last + SLACK).contains(&number) {
        return None;
    }
    let before = list.partition_point(|x| *x <= number).clamp(1, list.len()) - 1;
    let Some(next) = list.get(before + 1) else { return Some((before, 0.0)) };
    Some((before, ((number - list[before]) / (next - list[before])).clamp(0.0, 1.0)))
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// The default light group.
pub const DEFAULT_GROUP: &str = "default";

/// The key of the light group in `extras` of glTF files.
pub const GROUP_KEY: &str = "light_group";

/// The name of a group, [`DEFAULT_GROUP`] if empty.
pub fn group_or_default(name: &str) -> &str {
    if name.is_empty() { DEFAULT_GROUP } else { name }
}

/// Whether a name is valid for a light group. It becomes part of channel names.
pub fn is_group_name(name: &str) -> bool {
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    (1..=64).contains(&name.len()) && name.chars().all(is_allowed)
}

/// The environment, infinitely far away.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// No environment: black.
    #[default]
    Black,
    /// Constant radiance.
    Constant([f32; 3]),
    /// A vertical gradient from `nadir` to `zenith`, linear in the unit direction's y (the sky of "Ray Tracing in One Weekend").
    Gradient {
        /// Radiance straight down.
        nadir: [f32; 3],
        /// Radiance straight up.
        zenith: [f32; 3],
    },
    /// An equirectangular image: direction d maps to u = 0.5 + atan2(d.z, d.x) / 2 pi, v = acos(d.y) / pi from the top
    /// row, texel centres at (i + 0.5) / width.
    Image {
        /// Equirectangular image.
        image: ImageId,
        /// Factor on its values.
        strength: f32,
        /// Rotation around the y axis, counter-clockwise as seen from above, radians.
        rotation_rad: f64,
    },
}

/// The backdrop of transparent pixels, for environments that are invisible to camera rays.
#[derive(Clone, Debug)]
pub enum Backdrop {
    /// A colour, linear Rec. 709.
    Color([f32; 3]),
    /// A picture, centred and scaled uniformly to cover the frame.
    Picture(Image),
}

/// A rectangle, such as a window, that guides the sampling of environment light. It has no surface and only reduces noise. It
/// applies to points on the side of `edge_u` x `edge_v`.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// Name, for reports.
    pub name: String,
    /// A corner, metres.
    pub corner: DVec3,
    /// Edge from the corner.
    pub edge_u: DVec3,
    /// The other edge from the corner, orthogonal to `edge_u`.
    pub edge_v: DVec3,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(vertical_deg: &[f32], horizontal_deg: &[f32], values: &[f32]) -> LightProfile {
        let profile = LightProfile {
            vertical_deg: vertical_deg.into(),
            horizontal_deg: horizontal_deg.into(),
            values: values.into(),
        };
        assert!(profile.is_valid());
        profile
    }

    #[test]
    fn lookups_interpolate_and_use_symmetry() {
        let round = profile(&[0.0, 90.0], &[0.0], &[4.0, 2.0]);
        assert_eq!([0.0, 45.0, 90.0, 91.0].map(|v| round.at(v, 123.0)), [4.0, 3.0, 2.0, 0.0]);
        // Constant in the vertical angle.
        let at = |horizontal: &[f32], values: &[f32], h: f32| {
            let twice: Vec<f32> = values.iter().flat_map(|v| [*v, *v]).collect();
            profile(&[0.0, 180.0], horizontal, &twice).at(30.0, h)
        };
        let quarter = |h| at(&[0.0, 90.0], &[0.0, 9.0], h);
        assert_eq!(
            [0.0, 60.0, 90.0, 120.0, 180.0, 270.0, 330.0].map(quarter),
            [0.0, 6.0, 9.0, 6.0, 0.0, 9.0, 3.0]
        );
        let half = |h| at(&[0.0, 180.0], &[0.0, 18.0], h);
        assert_eq!([0.0, 60.0, 180.0, 240.0, 350.0].map(half), [0.0, 6.0, 18.0, 12.0, 1.0]);
        let side = |h| at(&[90.0, 270.0], &[0.0, 18.0], h);
        assert_eq!([90.0, 180.0, 270.0, 0.0, 60.0, 300.0].map(side), [0.0, 9.0, 18.0, 9.0, 3.0, 15.0]);
        let lists: [(&[f32], &[f32]); 4] = [
            (&[0.0, 100.0, 270.0, 360.0], &[1.0, 2.0, 5.0, 1.0]),
            (&[90.0, 120.0, 270.0], &[0.0, 9.0, 18.0]),
            (&[0.0, 50.0, 180.0], &[0.0, 9.0, 18.0]),
            (&[0.0], &[3.0]),
        ];
        for (horizontal, values) in lists {
            let rows: Vec<f32> = values.iter().flat_map(|v| [*v, 2.0 * *v]).collect();
            let own = profile(&[0.0, 180.0], horizontal, &rows);
            let mirrored = own.clone().mirrored();
            assert!(mirrored.is_valid());
            for degrees in [0.0, 30.0, 90.0, 100.0, 181.0, 300.0] {
                let (found, expected) = (mirrored.at(45.0, degrees), own.at(45.0, 360.0 - degrees));
                assert!((found - expected).abs() < 1e-5, "{horizontal:?} {degrees}: {found} {expected}");
            }
        }
        let all = |h| at(&[0.0, 270.0, 360.0], &[0.0, 27.0, 0.0], h);
        assert_eq!([0.0, 90.0, 315.0, 360.0].map(all), [0.0, 9.0, 13.5, 0.0]);
    }

    /// A hemisphere of intensity 1, and a linear ramp from 1 to 0 over the angle 0..pi, have the mean 1/2.
    #[test]
    fn means_are_taken_over_the_sphere() {
        let half = profile(&[0.0, 90.0], &[0.0], &[1.0, 1.0]);
        assert!((half.mean(64) - 0.5).abs() < 1e-3 && half.peak() == 1.0);
        let line = profile(&[0.0, 180.0], &[0.0], &[1.0, 0.0]);
        assert!((line.mean(64) - 0.5).abs() < 1e-3);
    }
}
