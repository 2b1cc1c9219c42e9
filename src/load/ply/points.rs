//! Point clouds: vertices without faces.

use crate::error::{Choice, Error, Result, Warning};
use crate::load::{LoadOptions, Loaded};
use crate::math::{DQuat, DVec3};
use crate::scene::{Material, MaterialId, Mesh, Shape, ShapeKind};
use std::collections::HashMap;
use std::path::Path;

/// Distinct colours that are kept as they are; more are rounded.
const MOST_COLORS: usize = 1 << 15;
/// Levels of each channel (as its square root, which is nearly even to the eye) where colours are rounded.
const LEVELS: f32 = 31.0;

/// The points as spheres of the radius that the caller wants, in their colours.
///
/// # Errors
/// An input error if the caller gives no radius.
pub(super) fn spheres(path: &Path, mesh: &Mesh, options: &LoadOptions) -> Result<Loaded> {
    let Some(radius) = options.point_radius else {
        let message = format!("is a point cloud: {} vertices and no faces", mesh.positions.len());
        return Err(Error::input(path, message).with_help(format!(
            "show the points as spheres by {}, or mesh them first",
            Choice::PointRadius
        )));
    };
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(Error::usage("the radius of points must be a finite number above 0"));
    }
    let mut loaded = Loaded::default();
    let color = |i: usize| mesh.colors.get(i).map_or([0.8; 3], |c| [c[0], c[1], c[2]].map(sane));
    let exact = distinct(mesh, color);
    let rounded = |i: usize| color(i).map(|c| ((c.sqrt() * LEVELS).round() / LEVELS).powi(2));
    let round = exact > MOST_COLORS;
    if round {
        let message =
            format!("the points have more than {MOST_COLORS} colours, which are rounded to 32 levels");
        loaded.warnings.push(Warning::new(path, "", message));
    }
    let mut materials: HashMap<[u32; 3], MaterialId> = HashMap::new();
    let mut dropped = 0;
    for (i, p) in mesh.positions.iter().enumerate() {
        let center = DVec3::from(p.map(f64::from));
        if !center.is_finite() {
            dropped += 1;
            continue;
        }
        let albedo = if round { rounded(i) } else { color(i) };
        let scene = &mut loaded.scene;
        let material = *materials.entry(albedo.map(f32::to_bits)).or_insert_with(|| {
            scene.materials.push(Material::lambert("point", albedo));
            MaterialId(scene.materials.len() as u32 - 1)
        });
        let rotation = DQuat::IDENTITY;
        let kind = ShapeKind::Sphere;
        scene.shapes.push(Shape { name: String::new(), kind, center, radius, rotation, material });
    }
    if dropped > 0 {
        let message = format!("{dropped} points that are not finite numbers were dropped");
        loaded.warnings.push(Warning::new(path, "", message));
    }
    Ok(loaded)
}

/// The number of different colours, counted up to just beyond the most that are kept.
fn distinct(mesh: &Mesh, color: impl Fn(usize) -> [f32; 3]) -> usize {
    let mut seen = std::collections::HashSet::new();
    for i in 0..mesh.colors.len() {
        seen.insert(color(i).map(f32::to_bits));
        if seen.len() > MOST_COLORS {
            break;
        }
    }
    seen.len()
}

fn sane(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}
