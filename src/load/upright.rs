//! Rotation of models to y up, and a guess of the up axis for formats that don't define it.

pub use super::options::{Up, UpHint};
use super::{LoadOptions, Loaded};
use crate::error::{Choice, Warning};
use crate::math::{DAffine3, DQuat, DVec2, DVec3};
use crate::scene::{Environment, Scene};
use std::path::Path;

/// Rotates a model with the up axis `up` to y up.
pub(super) fn rotate_to_y_up(scene: &mut Scene, up: Up) {
    if matches!(up, Up::Auto | Up::Y) {
        return;
    }
    let rotation = up.rotation();
    let y_up_from_model = DAffine3::from_mat3(rotation);
    for instance in &mut scene.instances {
        instance.world_from_object = y_up_from_model * instance.world_from_object;
    }
    for curves in &mut scene.curves {
        curves.world_from_object = y_up_from_model * curves.world_from_object;
    }
    let quaternion = DQuat::from_mat3(&rotation);
    for shape in &mut scene.shapes {
        shape.center = rotation * shape.center;
        shape.rotation = quaternion * shape.rotation;
    }
}

/// Rotates a model with its offset.
fn rotate_loaded(loaded: &mut Loaded, up: Up) {
    rotate_to_y_up(&mut loaded.scene, up);
    loaded.offset = up.rotation() * loaded.offset;
}

/// Rotates a model by the up axis of the options. Call before the sidecar is applied, which is in y-up coordinates.
pub(super) fn apply_up_option(options: &LoadOptions, loaded: &mut Loaded) {
    if options.up != Up::Auto {
        rotate_loaded(loaded, options.up);
    }
}

/// Rotates a model by its guessed up axis, unless the options define the axis or the file has a camera, light or environment.
pub(super) fn apply_guessed_up(path: &Path, options: &LoadOptions, loaded: &mut Loaded) {
    let scene = &loaded.scene;
    let is_bare = scene.cameras.is_empty() && scene.lights.is_empty();
    if options.up != Up::Auto || !is_bare || scene.environment != Environment::Black {
        return;
    }
    let (up, why) = guess_up(loaded);
    if up != Up::Y {
        let message = ("up-guessed", format!("{} points up, by {why} ({} decides)", up.name(), Choice::Up));
        loaded.notes.push(Warning::new(path, "", message));
        rotate_loaded(loaded, up);
    } else if let Some(why) = Some(why).filter(|why| !why.is_empty()) {
        let message = ("up-guessed", format!("y points up, by {why} ({} decides)", Choice::Up));
        loaded.notes.push(Warning::new(path, "", message));
    }
}

// A guess of the up axis: y or z, the only common ones.
//
// After Fu, Cohen-Or, Dror, Sheffer 2008, "Upright Orientation of Man-Made Objects": objects stand on flat or wide bases
// below their centre, and have left-right, but no up-down symmetry. Weights and thresholds were tuned on a dozen models and
// rotated copies of them.

/// Maximum number of triangles that are examined.
const MAX_TRIANGLES: usize = 200_000;
/// Fraction of the height that counts as the base.
const BASE: f64 = 0.03;
/// Cells along each axis of the grid for the symmetry test.
const CELLS: usize = 16;
/// Minimum lead of one axis's score over the other's as evidence.
const MIN_LEAD: f64 = 0.1;
/// Minimum lead of z's score over y's in mostly y-up formats.
const MIN_LEAD_OF_Z: f64 = 0.45;
/// Minimum number of triangles of a terrain.
const TERRAIN: usize = 100;

/// The up axis, and the reason for messages, empty without evidence. The model's position is not used, so that translated
/// copies get the same up axis.
fn guess_up(loaded: &Loaded) -> (Up, &'static str) {
    let UpHint { writer, is_mostly_y } = loaded.up_hint;
    if let Some((up, why)) = writer {
        return (up, why);
    }
    let surface = Surface::of(&loaded.scene);
    if surface.points.len() < 8 {
        return (Up::Y, "");
    }
    if let Some(axis) =
        [(2, Up::Y), (1, Up::Z)].iter().find(|(axis, _)| surface.size[*axis] < 1e-4 * surface.size.x)
    {
        return (axis.1, "its flat shape, as of a drawing");
    }
    if let Some(up) = surface.terrain() {
        return (up, "its shape, as of terrain");
    }
    let lead = surface.up_score(2) - surface.up_score(1);
    match lead > if is_mostly_y { MIN_LEAD_OF_Z } else { MIN_LEAD } {
        true => (Up::Z, "its shape: base and symmetry"),
        false if lead < -MIN_LEAD => (Up::Y, "its shape: base and symmetry"),
        false => (Up::Y, "convention, as its shape gives no evidence"),
    }
}

/// Sampled faces of a model.
struct Surface {
    /// Vertices and centres of faces and edges, or the points of a cloud.
    points: Vec<DVec3>,
    /// Centres and area-weighted normals of faces.
    faces: Vec<(DVec3, DVec3)>,
    min: DVec3,
    size: DVec3,
}

impl Surface {
    fn of(scene: &Scene) -> Surface {
        let total: usize = scene.meshes.iter().map(|m| m.triangles.len()).sum();
        let step = total.div_ceil(MAX_TRIANGLES).max(1);
        let (mut points, mut faces) = (Vec::new(), Vec::new());
        for instance in &scene.instances {
            let Some(mesh) = scene.meshes.get(instance.mesh.index()) else { continue };
            for triangle in mesh.triangles.iter().step_by(step) {
                let corner = |i: u32| {
                    let p = mesh.positions.get(i as usize).copied().unwrap_or_default();
                    instance.world_from_object.transform_point3(DVec3::from(p.map(f64::from)))
                };
                let [a, b, c] = triangle.map(corner);
                let middle = (a + b + c) / 3.0;
                points.extend([a, b, c, middle, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5]);
                faces.push((middle, (b - a).cross(c - a) * 0.5));
            }
        }
        points.extend(scene.shapes.iter().map(|s| s.center));
        scene.curves.iter().for_each(|curves| curves.visit(&mut |p, _| points.push(p)));
        let min = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let max = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        Surface { points, faces, min, size: (max - min).max(DVec3::splat(1e-300)) }
    }

    /// The up axis if the model is a terrain: an open surface whose normals mostly point along one axis.
    fn terrain(&self) -> Option<Up> {
        let all: f64 = self.faces.iter().map(|f| f.1.length()).sum();
        let sum: DVec3 = self.faces.iter().map(|f| f.1).sum();
        let faces_along = |axis: usize| self.faces.len() >= TERRAIN && sum[axis].abs() > 0.6 * all;
        let is_flat = |axis: usize| 3.0 * self.size[axis] < self.size[3 - axis].min(self.size.x);
        let is_cloud = self.faces.is_empty();
        [(1, Up::Y), (2, Up::Z)]
            .into_iter()
            .find(|&(axis, _)| faces_along(axis) || is_cloud && is_flat(axis))
            .map(|f| f.1)
    }

    fn up_score(&self, axis: usize) -> f64 {
        2.0 * self.flat_base(axis) + self.support(axis) - 1.5 * self.mirror_symmetry(axis)
    }

    /// Projection onto the two other axes.
    fn without_axis(&self, p: DVec3, axis: usize) -> DVec2 {
        DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3])
    }

    /// Fraction of the bounding box's floor covered by downward faces of the base.
    fn flat_base(&self, axis: usize) -> f64 {
        let top = self.min[axis] + BASE * self.size[axis];
        let down = self
            .faces
            .iter()
            .filter(|(middle, area)| middle[axis] < top && -area[axis] > 0.98 * area.length());
        let step = self.points.len() as f64 / (7.0 * self.faces.len().max(1) as f64);
        let floor = self.without_axis(self.size, axis);
        (down.map(|f| -f.1[axis]).sum::<f64>() * step / (floor.x * floor.y)).min(1.0)
    }

    /// Stability: 0.4 plus the area of the base's convex hull relative to the box's floor if the centre is above the hull; less,
    /// or negative, if the model would tip over.
    fn support(&self, axis: usize) -> f64 {
        let top = self.min[axis] + BASE * self.size[axis];
        let low =
            self.points.iter().filter(|p| p[axis] <= top).map(|&p| self.without_axis(p, axis)).collect();
        let hull = hull(low);
        let middle = self.points.iter().sum::<DVec3>() / self.points.len() as f64;
        let middle = self.without_axis(middle, axis);
        let (mut area, mut is_inside) = (0.0, hull.len() > 2);
        for (i, &a) in hull.iter().enumerate() {
            let b = hull[(i + 1) % hull.len()];
            area += 0.5 * a.perp_dot(b);
            is_inside &= (b - a).perp_dot(middle - a) >= 0.0;
        }
        let floor = self.without_axis(self.size, axis);
        let fraction = (area / (floor.x * floor.y)).clamp(0.0, 1.0);
        if is_inside { 0.4 + fraction } else { 0.5 * fraction - 0.3 }
    }

    /// Mirror symmetry along an axis, 0 to 1: from the intersection over union of the occupied cells and their mirror image.
    fn mirror_symmetry(&self, axis: usize) -> f64 {
        let scale = self.size.max_element();
        let cells = (self.size / scale * CELLS as f64).max(DVec3::ONE);
        let mut occupied = vec![false; CELLS.pow(3)];
        let cell = |p: DVec3, is_mirrored: bool| {
            let mut at = ((p - self.min) / self.size).clamp(DVec3::ZERO, DVec3::ONE);
            if is_mirrored {
                at[axis] = 1.0 - at[axis];
            }
            let at = (at * cells).min(cells - 1.0);
            (at.x as usize * CELLS + at.y as usize) * CELLS + at.z as usize
        };
        let mut image = occupied.clone();
        for &p in &self.points {
            occupied[cell(p, false)] = true;
            image[cell(p, true)] = true;
        }
        let both = occupied.iter().zip(&image).filter(|(a, b)| **a && **b).count() as f64;
        let either = occupied.iter().zip(&image).filter(|(a, b)| **a || **b).count() as f64;
        ((both / either.max(1.0) - 0.55) / 0.35).clamp(0.0, 1.0)
    }
}

/// The convex hull, counter-clockwise (Andrew 1979, "Another Efficient Algorithm for Convex Hulls in Two Dimensions").
fn hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(p - a) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut around = chain(&mut points.iter().copied());
    around.extend(chain(&mut points.iter().rev().copied()));
    around
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_convex_hull_of_a_square_has_four_corners() {
        let square = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 2.0], [0.5, 0.2], [1.0, 0.0]];
        let found = hull(square.map(DVec2::from).to_vec());
        assert_eq!(found, [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(DVec2::from));
    }
}
