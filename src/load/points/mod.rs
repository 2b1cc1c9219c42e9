//! Point clouds: vertices without faces, shown as spheres.

mod spacing;

use super::{LoadOptions, Loaded};
use crate::error::{Choice, Error, Result, Warning};
use crate::math::DVec3;
use crate::scene::{Material, MaterialId, Shape};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Distinct colours that are kept as they are; more are rounded.
const MOST_COLORS: usize = 1 << 15;
/// Levels of each channel (as its square root, which is nearly even to the eye) where colours are rounded.
const LEVELS: f32 = 31.0;

/// The points of a file.
pub(super) struct Cloud<'a> {
    /// Relative to the origin, metres.
    pub positions: &'a [[f32; 3]],
    /// Linear RGBA of each; empty where the file has none.
    pub colors: &'a [[f32; 4]],
    /// What the positions are relative to.
    pub origin: DVec3,
}

impl Cloud<'_> {
    /// Adds the points as spheres of the radius that the caller wants, else of one by their spacing.
    ///
    /// # Errors
    /// A usage error for a radius that is none.
    pub fn add(&self, path: &Path, options: &LoadOptions, loaded: &mut Loaded) -> Result<()> {
        let radius = match options.point_radius {
            Some(radius) if radius > 0.0 && radius.is_finite() => radius,
            Some(_) => return Err(Error::usage("the radius of points must be a finite number above 0")),
            None => self.radius_by_spacing(path, loaded),
        };
        let exact = self.distinct_colors();
        let rounded = |i: usize| self.color(i).map(|c| ((c.sqrt() * LEVELS).round() / LEVELS).powi(2));
        let round = exact > MOST_COLORS;
        if round {
            let message =
                format!("the points have more than {MOST_COLORS} colours, which are rounded to 32 levels");
            loaded.warnings.push(Warning::new(path, "", message));
        }
        let mut materials: HashMap<[u32; 3], MaterialId> = HashMap::new();
        let mut dropped = 0;
        for (i, p) in self.positions.iter().enumerate() {
            let center = DVec3::from(p.map(f64::from)) + self.origin;
            if !center.is_finite() {
                dropped += 1;
                continue;
            }
            let albedo = if round { rounded(i) } else { self.color(i) };
            let scene = &mut loaded.scene;
            let material = *materials.entry(albedo.map(f32::to_bits)).or_insert_with(|| {
                scene.materials.push(Material::lambert("point", albedo));
                MaterialId(scene.materials.len() as u32 - 1)
            });
            scene.shapes.push(Shape::sphere(center, radius, material));
        }
        if dropped > 0 {
            let message = format!("{dropped} points that are not finite numbers were dropped");
            loaded.warnings.push(Warning::new(path, "", message));
        }
        Ok(())
    }

    /// A radius that closes the gaps between neighbours, with a note.
    fn radius_by_spacing(&self, path: &Path, loaded: &mut Loaded) -> f64 {
        let radius = spacing::radius(self.positions);
        let message = format!(
            "a point cloud: {} points are shown as spheres of radius {radius:.3e}, by their spacing ({})",
            self.positions.len(),
            Choice::PointRadius
        );
        loaded.notes.push(Warning::new(path, "", message));
        radius
    }

    fn color(&self, i: usize) -> [f32; 3] {
        self.colors.get(i).map_or([0.8; 3], |c| [c[0], c[1], c[2]].map(sane))
    }

    /// The number of different colours, counted up to just beyond the most that are kept.
    fn distinct_colors(&self) -> usize {
        let mut seen = HashSet::new();
        for i in 0..self.colors.len() {
            seen.insert(self.color(i).map(f32::to_bits));
            if seen.len() > MOST_COLORS {
                break;
            }
        }
        seen.len()
    }
}

fn sane(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}
