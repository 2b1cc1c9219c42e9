//! Points that stand for a whole scene when it is framed.

use super::stray;
use crate::math::DVec3;
use crate::scene::{Scene, Shape, instance_extents, scene_extent, visit_points};

/// Directions are told apart by the cells of a cube's faces, each so many by so many.
const CELLS: usize = 32;

/// Models with coordinates beyond this can't be framed: squares of them would be infinite.
const FARTHEST: f64 = 1e150;

/// The farthest points of a scene in all directions.
pub(super) struct Outline {
    /// Relative to the offset it was made with, metres.
    pub points: Vec<DVec3>,
    /// Least corner of the box around them.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
    /// What lies so far away from all else that it is left out, in words.
    pub stray: Option<String>,
}

impl Outline {
    /// Of a scene whose coordinates are far from the origin by `offset`. A scene without anything gets a box of 2 m.
    pub fn of(scene: &Scene, offset: DVec3) -> Outline {
        let bounds = scene_extent(scene, &instance_extents(scene)).0;
        let fits = |p: DVec3| p.is_finite() && p.abs().max_element() < FARTHEST;
        let Some((min, max)) = bounds.filter(|&(min, max)| fits(min) && fits(max)) else {
            let (min, max) = (DVec3::splat(-1.0), DVec3::splat(1.0));
            return Outline { points: corners(min, max).to_vec(), min, max, stray: None };
        };
        let limit = stray::limit(scene);
        let visit = |each: &mut dyn FnMut(DVec3)| {
            let mut near = |p: DVec3| {
                if limit.as_ref().is_none_or(|limit| limit.holds(p)) {
                    each(p);
                }
            };
            visit_points(scene, &mut near);
            for shape in &scene.shapes {
                around(shape, scene.shapes.len(), &mut near);
            }
        };
        let (mut low, mut high) = (min, max);
        if limit.is_some() {
            (low, high) = (max, min);
            visit(&mut |p| (low, high) = (low.min(p), high.max(p)));
        }
        let (min, max) = (low - offset, high - offset);
        let mut far = Farthest::new((min + max) * 0.5, (max - min) * 0.5);
        visit(&mut |p| far.add(p - offset));
        let points = far.points();
        // Meshes of one point are no reason for a division by zero.
        let points = if points.is_empty() { corners(min, max).to_vec() } else { points };
        Outline { points, min, max, stray: limit.map(|limit| limit.beyond) }
    }

    /// The middle of the box.
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Half the diagonal of the box, above 0.
    pub fn radius(&self) -> f64 {
        ((self.max - self.min).length() * 0.5).max(1e-6)
    }
}

/// The corners of a box.
fn corners(min: DVec3, max: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let pick = |k: usize| if i >> k & 1 == 0 { min[k] } else { max[k] };
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

/// Points around a shape: more of them where there are few shapes.
fn around(shape: &Shape, count: usize, add: &mut dyn FnMut(DVec3)) {
    let half = shape.half_extent();
    let rings = if count > 1000 { 2 } else { 16 };
    for ring in 0..=rings {
        let (y, r) = (f64::from(ring) / f64::from(rings) * std::f64::consts::PI).sin_cos();
        for step in 0..2 * rings {
            let (s, c) = (f64::from(step) / f64::from(rings) * std::f64::consts::PI).sin_cos();
            add(shape.center + half * DVec3::new(y * c, r, y * s));
        }
    }
}

/// The farthest point from a middle in each cell of directions. What others hide differs from the true hull by less than
/// a cell is wide, a few percent of the model's size where it is smooth, nothing at its corners.
struct Farthest {
    middle: DVec3,
    /// Factors that make the box around all a cube, so that its sides have equally many cells.
    scale: DVec3,
    /// All points, while they are fewer than cells.
    few: Vec<DVec3>,
    cells: Vec<Option<(f64, DVec3)>>,
}

impl Farthest {
    fn new(middle: DVec3, half: DVec3) -> Farthest {
        let scale = half.max(DVec3::splat(1e-6 * half.max_element().max(1e-300))).recip();
        Farthest { middle, scale, few: Vec::new(), cells: vec![None; 6 * CELLS * CELLS] }
    }

    fn add(&mut self, p: DVec3) {
        if self.few.len() <= self.cells.len() && p.is_finite() {
            self.few.push(p);
        }
        let d = (p - self.middle) * self.scale;
        let a = d.abs();
        let axis = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
            1
        } else {
            2
        };
        let long = a[axis].max(1e-300);
        let cell = |v: f64| (((v / long + 1.0) * 0.5 * CELLS as f64) as usize).min(CELLS - 1);
        let (u, v) = (cell(d[(axis + 1) % 3]), cell(d[(axis + 2) % 3]));
        let face = 2 * axis + usize::from(d[axis] < 0.0);
        let (distance, slot) = (d.length_squared(), &mut self.cells[(face * CELLS + u) * CELLS + v]);
        if distance.is_finite() && slot.is_none_or(|(before, _)| distance > before) {
            *slot = Some((distance, p));
        }
    }

    fn points(self) -> Vec<DVec3> {
        match self.few.len() <= self.cells.len() {
            true => self.few,
            false => self.cells.into_iter().flatten().map(|(_, p)| p).collect(),
        }
    }
}

/// A place rounded to a power of two that is fine beside `size`: sums with coordinates far away stay exact.
pub(super) fn on_grid(p: DVec3, size: f64) -> DVec3 {
    let step = (size.max(1e-300).log2().floor() - 20.0).exp2();
    if step > 0.0 && step.is_finite() { (p / step).round() * step } else { p }
}
