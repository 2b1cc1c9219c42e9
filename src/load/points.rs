//! Point clouds (vertices without faces) as spheres.

use super::{LoadOptions, Loaded};
use crate::error::{Choice, Error, Result, Warning};
use crate::math::DVec3;
use crate::scene::{Material, MaterialId, Shape};
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Maximum number of distinct colours; with more, colours are quantized.
const MAX_COLORS: usize = 1 << 15;
/// Quantization steps of each channel's square root, which is nearly perceptually uniform.
const LEVELS: f32 = 31.0;

/// The points of a file.
pub(super) struct Cloud<'a> {
    /// Relative to the origin, metres.
    pub positions: &'a [[f32; 3]],
    /// Linear RGBA per point; empty if the file has none.
    pub colors: &'a [[f32; 4]],
    /// World-space origin of the positions, metres.
    pub origin: DVec3,
}

impl Cloud<'_> {
    /// Adds the points as spheres of the requested radius, else of a radius estimated from their spacing.
    ///
    /// # Errors
    /// A usage error for an invalid radius.
    pub fn add(&self, path: &Path, options: &LoadOptions, loaded: &mut Loaded) -> Result<()> {
        let radius = match options.point_radius {
            Some(radius) if radius > 0.0 && radius.is_finite() => radius,
            Some(_) => return Err(Error::usage("the radius of points must be a finite number above 0")),
            None => self.radius_by_spacing(path, loaded),
        };
        let quantized = |i: usize| self.color(i).map(|c| ((c.sqrt() * LEVELS).round() / LEVELS).powi(2));
        let is_quantized = self.distinct_colors() > MAX_COLORS;
        if is_quantized {
            let message =
                format!("the points have more than {MAX_COLORS} colours, which are rounded to 32 levels");
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
            let albedo = if is_quantized { quantized(i) } else { self.color(i) };
            let scene = &mut loaded.scene;
            let material = *materials.entry(albedo.map(f32::to_bits)).or_insert_with(|| {
                scene.materials.push(Material::lambert("point", albedo));
                MaterialId(scene.materials.len() as u32 - 1)
            });
            scene.shapes.push(Shape::sphere(center, radius, material));
        }
        if dropped > 0 {
            let message = format!("{dropped} points with positions that aren't finite were dropped");
            loaded.warnings.push(Warning::new(path, "", ("points-not-finite", message)));
        }
        Ok(())
    }

    /// A radius estimated from the spacing, with a note.
    fn radius_by_spacing(&self, path: &Path, loaded: &mut Loaded) -> f64 {
        let radius = radius(self.positions);
        let message = format!(
            "a point cloud: {} points are shown as spheres of radius {radius:.3e}, by their spacing ({})",
            self.positions.len(),
            Choice::PointRadius
        );
        loaded.notes.push(Warning::new(path, "", ("point-cloud", message)));
        radius
    }

    fn color(&self, i: usize) -> [f32; 3] {
        self.colors.get(i).map_or([0.8; 3], |c| [c[0], c[1], c[2]].map(clamped))
    }

    /// Number of distinct colours, at most the maximum plus one.
    fn distinct_colors(&self) -> usize {
        let mut seen = HashSet::new();
        for i in 0..self.colors.len() {
            seen.insert(self.color(i).map(f32::to_bits));
            if seen.len() > MAX_COLORS {
                break;
            }
        }
        seen.len()
    }
}

fn clamped(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

// Radius from the spacing of the points.

/// Maximum number of points at which the spacing is measured.
const MAX_SAMPLES: usize = 2000;
/// The spacing is the distance of the k-th nearest neighbour: points of a square grid have four at the same distance.
const NEAREST: usize = 4;
/// Ratio of radius to spacing: half a square's diagonal, so that spheres on a grid leave no gaps.
const RADIUS_OVER_SPACING: f64 = 0.71;
/// Expected number of points per cell of the search grid, for points on a surface.
const POINTS_PER_CELL: f64 = 4.0;
/// Maximum radius relative to the diagonal of the cloud's bounding box, for clouds of few points.
const MAX_RADIUS: f64 = 0.02;
/// Radius of clouds whose spacing is 0, relative to the diagonal of their bounding box; in metres for a box of size 0.
const MIN_RADIUS: f64 = 1e-3;

/// Sphere radius from the median distance of the fourth nearest neighbour; above 0.
fn radius(positions: &[[f32; 3]]) -> f64 {
    let points: Vec<DVec3> =
        positions.iter().map(|p| DVec3::from(p.map(f64::from))).filter(|p| p.is_finite()).collect();
    let min = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let max = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = if points.is_empty() { 0.0 } else { (max - min).length() };
    if size <= 0.0 {
        return MIN_RADIUS;
    }
    let grid = Grid::new(&points, min, size * (POINTS_PER_CELL / points.len() as f64).sqrt().min(1.0));
    let step = points.len().div_ceil(MAX_SAMPLES);
    let mut distances: Vec<f64> = points.iter().step_by(step).filter_map(|&p| grid.neighbour(p)).collect();
    distances.sort_by(f64::total_cmp);
    let median = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
    if median > 0.0 { (RADIUS_OVER_SPACING * median).min(MAX_RADIUS * size) } else { MIN_RADIUS * size }
}

/// Uniform grid of points for neighbour search.
struct Grid<'p> {
    points: &'p [DVec3],
    min: DVec3,
    side: f64,
    cells: HashMap<[i32; 3], Vec<u32>>,
}

impl Grid<'_> {
    fn new(points: &[DVec3], min: DVec3, side: f64) -> Grid<'_> {
        let mut grid = Grid { points, min, side, cells: HashMap::new() };
        for (i, &p) in (0u32..).zip(points) {
            let cell = grid.cell(p);
            grid.cells.entry(cell).or_default().push(i);
        }
        grid
    }

    fn cell(&self, p: DVec3) -> [i32; 3] {
        ((p - self.min) / self.side).floor().as_ivec3().to_array()
    }

    /// Distance of the k-th nearest neighbour that doesn't coincide with `p`, among the 27 cells around it: exact up to the
    /// cell size; the farthest if there are fewer.
    fn neighbour(&self, p: DVec3) -> Option<f64> {
        let middle = self.cell(p);
        let mut near: Vec<f64> = Vec::new();
        for k in 0..27 {
            let cell = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
            let at: [i32; 3] = std::array::from_fn(|c| middle[c].saturating_add(cell[c]));
            let found = self.cells.get(&at).into_iter().flatten();
            near.extend(found.map(|&i| self.points[i as usize].distance(p)).filter(|&d| d > 0.0));
        }
        near.sort_by(f64::total_cmp);
        near.get(NEAREST - 1).or(near.last()).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spheres_on_a_grid_leave_no_gaps() {
        let row = |y: u16| (0..100u16).map(move |x| [f32::from(x) * 0.5, f32::from(y) * 0.5, 0.0]);
        let points: Vec<[f32; 3]> = (0..100).flat_map(row).collect();
        let found = radius(&points);
        assert!((found - 0.355).abs() < 1e-6, "{found}");
    }

    #[test]
    fn clouds_without_extent_have_a_radius() {
        for points in [vec![], vec![[1.0; 3]], vec![[2.0; 3]; 9], vec![[f32::NAN; 3]; 3]] {
            assert!(radius(&points) > 0.0);
        }
    }
}
