//! Lights without a surface, measured light profiles, and light groups.
//!
//! The environment: radiance of rays that hit nothing, its sun, and portals.

use super::ImageId;
use super::geometry::Keyframes;
use super::object_traits::{LightLinks, RayKinds};
use crate::image::Image;
use crate::math::{DQuat, DVec3, poly};
use std::sync::Arc;

/// A light without a surface (KHR_lights_punctual).
#[derive(Clone, Debug)]
pub struct Light {
    /// For reports.
    pub name: String,
    /// Its kind, with position and direction in world space.
    pub kind: LightKind,
    /// Linear RGB: radiant intensity (W/sr) of point and spot lights, irradiance (W/m2) of
    /// directional ones and suns, on a surface that faces them.
    pub intensity: [f32; 3],
    /// Intensity of a [`LightKind::Profiled`] by direction, relative to `intensity`.
    pub profile: Option<Arc<LightProfile>>,
    /// Its group, whose light pictures may hold apart; empty for the default one.
    pub group: String,
    /// Rays that see it, by kind: [`RayKinds::DIFFUSE`] is diffuse reflection and so on.
    pub visible_to: RayKinds,
    /// Objects that it lights, and objects that cast shadows in its light.
    pub links: LightLinks,
    /// Its kind at other times, if it moves while the picture is taken.
    pub motion: Option<Keyframes<LightKind>>,
}

/// Kinds of lights without a surface. Directions have unit length and point the way the light travels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines equally in all directions.
    Point {
        /// Where it is.
        position: DVec3,
    },
    /// A cone that fades between two half angles.
    Spot {
        /// Where it is.
        position: DVec3,
        /// Its axis.
        direction: DVec3,
        /// Half angle of the fully lit cone, radians.
        inner_angle_rad: f64,
        /// Half angle where it ends, radians.
        outer_angle_rad: f64,
        /// How it fades in between.
        fade: SpotFade,
    },
    /// A point that emits light as [`Light::profile`] says.
    Profiled {
        /// Where it is.
        position: DVec3,
        /// Turns the profile into world space: it emits along -z, and its horizontal angles turn from x to y.
        rotation: DQuat,
        /// Half angles, radians, between which a cone about its axis fades by a smooth step, if there is one.
        cone: Option<[f64; 2]>,
    },
    /// Parallel light from infinitely far.
    Directional {
        /// The way the light travels.
        direction: DVec3,
    },
    /// A disk infinitely far away, as the sun is. Cameras don't see it; mirrors do.
    Sun {
        /// The way the light of its middle travels.
        direction: DVec3,
        /// Its diameter as an angle, radians, from 1e-5 to pi.
        angle_rad: f64,
    },
}

impl LightKind {
    /// A word for reports.
    pub fn name(&self) -> &'static str {
        match self {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Profiled { .. } => "profiled",
            LightKind::Directional { .. } => "directional",
            LightKind::Sun { .. } => "sun",
        }
    }

    /// Where it is; `None` for lights at infinity, whose strength is an irradiance.
    pub fn position(&self) -> Option<DVec3> {
        match *self {
            LightKind::Point { position }
            | LightKind::Spot { position, .. }
            | LightKind::Profiled { position, .. } => Some(position),
            LightKind::Directional { .. } | LightKind::Sun { .. } => None,
        }
    }

    /// The way its light travels along its axis, if it has one.
    pub fn direction(&self) -> Option<DVec3> {
        match *self {
            LightKind::Point { .. } => None,
            LightKind::Profiled { rotation, .. } => Some(rotation * DVec3::NEG_Z),
            LightKind::Spot { direction, .. }
            | LightKind::Directional { direction }
            | LightKind::Sun { direction, .. } => Some(direction),
        }
    }

    /// The half angles of the cone that it shines in, where it is whole and where it ends, radians, if it has one.
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

/// How a spot light fades from its inner cone to its outer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SpotFade {
    /// The square of a line in the cosine of the angle, from 1 at the inner cone to 0 at the outer
    /// (KHR_lights_punctual).
    #[default]
    Square,
    /// A smooth step in the cosine of the angle, as Blender fades; the inner cone stands for its blend, which is
    /// 1 - inner / outer of the cone's cap.
    Smooth,
}

/// Intensities over a sphere, as the files of luminaires hold them (IES LM-63, photometry of type C): the vertical angle is
/// counted from the axis of the light, the horizontal one about it.
#[derive(Clone, Debug, PartialEq)]
pub struct LightProfile {
    /// Increasing, within 0..180 degrees; beyond them it is dark.
    pub vertical_deg: Vec<f32>,
    /// Increasing, within 0..360 degrees: 0 alone, or from 0 to 90, 180 or 360, or from 90 to 270; the rest follows by
    /// symmetry.
    pub horizontal_deg: Vec<f32>,
    /// Relative intensities, from 0 up, those of a horizontal angle one after another.
    pub values: Vec<f32>,
}

impl LightProfile {
    /// The intensity at two angles, degrees, 0..180 and 0..360, linear in both between those of the file.
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

    /// The profile with its horizontal angles the other way round.
    #[must_use]
    pub fn mirrored(mut self) -> LightProfile {
        // The others are symmetric.
        let (first, last) = (self.horizontal_deg[0], self.horizontal_deg[self.horizontal_deg.len() - 1]);
        if first >= 90.0 || last > 180.0 {
            self.horizontal_deg.iter_mut().for_each(|angle| *angle = 360.0 - *angle);
            self.horizontal_deg.reverse();
            let columns = self.values.chunks_exact(self.vertical_deg.len()).rev();
            self.values = columns.flatten().copied().collect();
        }
        self
    }

    /// The largest intensity.
    pub fn peak(&self) -> f32 {
        self.values.iter().fold(0.0, |most, value| most.max(*value))
    }

    /// The mean over all directions, by a sum over `steps` heights of equal area and twice as many directions at each.
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

    /// Is it what the fields say, so that it can be looked up?
    pub fn is_sound(&self) -> bool {
        let increases = |list: &[f32], most: f32| {
            list.windows(2).all(|w| w[0] < w[1])
                && list.first().is_some_and(|first| *first >= 0.0)
                && list.last().is_some_and(|last| *last <= most)
        };
        increases(&self.vertical_deg, 180.0)
            && increases(&self.horizontal_deg, 360.0)
            && self.values.len() == self.vertical_deg.len() * self.horizontal_deg.len()
            && self.values.iter().all(|value| value.is_finite() && *value >= 0.0)
    }
}

/// The index of the last entry of an increasing list at or below a number, and the fraction towards the next; `None` outside the list.
fn between(list: &[f32], number: f32) -> Option<(usize, f32)> {
    let (first, last) = (*list.first()?, *list.last()?);
    // Rounding of angles must not leave a gap.
    const SLACK: f32 = 1e-3;
    if !(first - SLACK..=last + SLACK).contains(&number) {
        return None;
    }
    let before = list.partition_point(|x| *x <= number).clamp(1, list.len()) - 1;
    let Some(next) = list.get(before + 1) else { return Some((before, 0.0)) };
    Some((before, ((number - list[before]) / (next - list[before])).clamp(0.0, 1.0)))
}

fn mix(a: f32, b: f32, share: f32) -> f32 {
    a + (b - a) * share
}

/// The default light group.
pub const DEFAULT_GROUP: &str = "default";

/// The key of `extras` in glTF files that names a group.
pub const GROUP_KEY: &str = "light_group";

/// The name of a group, which users may leave empty.
pub fn group_or_default(name: &str) -> &str {
    if name.is_empty() { DEFAULT_GROUP } else { name }
}

/// May a group be called so? Its name becomes part of the names of channels.
pub fn is_group_name(name: &str) -> bool {
    let is_right = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    (1..=64).contains(&name.len()) && name.chars().all(is_right)
}

/// The environment, infinitely far away.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// Nothing: black.
    #[default]
    Black,
    /// The same radiance from all directions.
    Constant([f32; 3]),
    /// A vertical blend: `nadir` straight down to `zenith` straight up, linear in the unit direction's y
    /// (the sky of "Ray Tracing in One Weekend").
    Gradient {
        /// Radiance straight down.
        nadir: [f32; 3],
        /// Radiance straight up.
        zenith: [f32; 3],
    },
    /// An equirectangular image: direction d maps to u = 0.5 + atan2(d.z, d.x) / 2 pi, v = acos(d.y) / pi from the top
    /// row, texel centres at (i + 0.5) / width.
    Image {
        /// Which image.
        image: ImageId,
        /// Factor on its values.
        strength: f32,
        /// Turns the environment about the y axis, counter-clockwise seen from above.
        rotation_rad: f64,
    },
}

/// The backdrop where the environment is hidden from cameras and nothing else covers a pixel.
#[derive(Clone, Debug)]
pub enum Backdrop {
    /// A colour, linear Rec. 709.
    Color([f32; 3]),
    /// A picture, scaled evenly to cover the whole frame, its middle in the middle.
    Picture(Image),
}

/// A rectangle, such as a window, through which light of the environment is looked for. It is no surface, hides nothing and lets
/// no more light in than there is: it only makes rooms less noisy. It serves what lies in front of it, on the side of
/// `edge_u` x `edge_v`.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// For reports.
    pub name: String,
    /// One corner.
    pub corner: DVec3,
    /// To the next corner.
    pub edge_u: DVec3,
    /// To the corner before, at right angles to the other edge.
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
        assert!(profile.is_sound());
        profile
    }

    #[test]
    fn angles_are_looked_up_linearly_and_by_symmetry() {
        let round = profile(&[0.0, 90.0], &[0.0], &[4.0, 2.0]);
        assert_eq!([0.0, 45.0, 90.0, 91.0].map(|v| round.at(v, 123.0)), [4.0, 3.0, 2.0, 0.0]);
        // Each horizontal angle has one value.
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
            assert!(mirrored.is_sound());
            for degrees in [0.0, 30.0, 90.0, 100.0, 181.0, 300.0] {
                let (found, expected) = (mirrored.at(45.0, degrees), own.at(45.0, 360.0 - degrees));
                assert!((found - expected).abs() < 1e-5, "{horizontal:?} {degrees}: {found} {expected}");
            }
        }
        let all = |h| at(&[0.0, 270.0, 360.0], &[0.0, 27.0, 0.0], h);
        assert_eq!([0.0, 90.0, 315.0, 360.0].map(all), [0.0, 9.0, 13.5, 0.0]);
    }

    /// A half sphere of intensity 1 has the mean 1/2; a line from 1 to 0 over the angle t in 0..pi has the mean
    /// 1/2 as well.
    #[test]
    fn means_are_those_over_the_sphere() {
        let half = profile(&[0.0, 90.0], &[0.0], &[1.0, 1.0]);
        assert!((half.mean(64) - 0.5).abs() < 1e-3 && half.peak() == 1.0);
        let line = profile(&[0.0, 180.0], &[0.0], &[1.0, 0.0]);
        assert!((line.mean(64) - 0.5).abs() < 1e-3);
    }
}
