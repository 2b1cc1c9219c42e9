//! The camera that frames a model.

use super::options::StageOptions;
use crate::math::{DAffine3, DQuat, DVec3};
use crate::scene::{
    Camera, Curves, Environment, Extent, MeshHulls, Projection, Scene, Settings, Shape, scene_extent,
};

/// Margin on each side of the model, as a fraction of the picture's shorter side.
const MARGIN: f64 = 0.1;

/// A camera and its target, relative to the outline's offset.
pub(super) struct Framed {
    pub camera: Camera,
    /// The centre of the model.
    pub target: DVec3,
}

/// Tangents of the half angles that the model may fill, horizontal and vertical.
fn tangents(options: &StageOptions, settings: &Settings) -> [f64; 2] {
    let scene_aspect = match (settings.width, settings.height) {
        (Some(w), Some(h)) if w > 0 && h > 0 => f64::from(w) / f64::from(h),
        _ => 16.0 / 9.0,
    };
    let aspect = options.aspect.unwrap_or(scene_aspect).clamp(1e-3, 1e3);
    let half = (options.vfov_degrees.to_radians() / 2.0).tan();
    let shorter = aspect.min(1.0);
    [half * (aspect - 2.0 * MARGIN * shorter), half * (1.0 - 2.0 * MARGIN * shorter)]
}

/// The nearest camera in the view direction that frames the whole model with margins.
pub(super) fn frame(outline: &Outline, options: &StageOptions, settings: &Settings) -> Framed {
    let axes = options.view.axes();
    let center = outline.center();
    let points: Vec<DVec3> = match options.is_orbit {
        false => outline.points.iter().map(|&p| axes.transpose() * (p - center)).collect(),
        true => orbited(outline).into_iter().map(|p| axes.transpose() * p).collect(),
    };
    let size = outline.radius();
    let local = fit(&points, tangents(options, settings), size);
    let eye = on_grid(center + axes * local, size);
    let vfov_rad = 2.0 * ((options.vfov_degrees.to_radians() / 2.0).tan() / options.zoom).atan();
    let world_from_camera = DAffine3::from_mat3_translation(axes, eye);
    let projection = Projection::Perspective { vfov_rad };
    let camera = Camera { name: "default".to_string(), ..Camera::new(world_from_camera, projection) };
    Framed { camera, target: on_grid(center, size) }
}

/// The outline's points relative to its centre, rotated about the vertical axis in 48 steps.
fn orbited(outline: &Outline) -> Vec<DVec3> {
    let center = outline.center();
    // Only the largest distance from the axis at each height matters.
    const HEIGHTS: usize = 128;
    let height = (outline.max.y - outline.min.y).max(1e-300);
    let mut rings: Vec<Option<DVec3>> = vec![None; HEIGHTS];
    let radius = |p: DVec3| p.x.hypot(p.z);
    for p in outline.points.iter().map(|&p| p - center) {
        let at = (((p.y / height + 0.5) * HEIGHTS as f64) as usize).min(HEIGHTS - 1);
        if rings[at].is_none_or(|before| radius(p) > radius(before)) {
            rings[at] = Some(p);
        }
    }
    let rotated = |p: DVec3| {
        (0..48).map(move |i| {
            let (s, c) = (f64::from(i) / 48.0 * std::f64::consts::TAU).sin_cos();
            DVec3::new(radius(p) * c, p.y, radius(p) * s)
        })
    };
    rings.into_iter().flatten().flat_map(rotated).collect()
}

/// The eye position (right, up, back) from which the points fill a frustum with these half-angle tangents.
///
/// From an eye (x, y, z) a point p is within the tangent t if p.x - x and x - p.x are at most t (z - p.z): each of the four
/// frustum planes bounds a sum of the eye's coordinates by a maximum over all points. The tighter direction determines z; in
/// the other the model is centred.
fn fit(points: &[DVec3], [tan_x, tan_y]: [f64; 2], size: f64) -> DVec3 {
    let max = |value: &dyn Fn(&DVec3) -> f64| points.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    let bound = |axis: usize, tan: f64| {
        let high = max(&|p| p[axis] + tan * p.z);
        let low = max(&|p| -p[axis] + tan * p.z);
        (high + low) / (2.0 * tan)
    };
    let nearest = max(&|p| p.z) + 0.05 * size;
    let z = bound(0, tan_x).max(bound(1, tan_y)).max(nearest);
    DVec3::new(centered(points, 0, z), centered(points, 1, z), z)
}

/// The eye coordinate along an axis that centres the image of the points, by bisection.
fn centered(points: &[DVec3], axis: usize, z: f64) -> f64 {
    let offset = |eye: f64| {
        let slopes = points.iter().map(|p| (p[axis] - eye) / (z - p.z));
        let (low, high) =
            slopes.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| (low.min(s), high.max(s)));
        low + high
    };
    let ends = points.iter().map(|p| p[axis]);
    let (mut low, mut high) =
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    for _ in 0..60 {
        let eye = 0.5 * (low + high);
        if offset(eye) > 0.0 { low = eye } else { high = eye }
    }
    0.5 * (low + high)
}

/// Directions are binned into cells of a cube map: `CELLS` by `CELLS` per face.
const CELLS: usize = 32;

/// Maximum coordinate of models that can be framed, metres: squares of larger ones overflow.
const MAX_COORDINATE: f64 = 1e150;

/// The farthest points of a scene in all directions; their hull approximates the scene's.
pub(super) struct Outline {
    /// Relative to the offset of [`Outline::of`], metres.
    pub points: Vec<DVec3>,
    /// Minimum corner of the bounds.
    pub min: DVec3,
    /// Maximum corner of the bounds.
    pub max: DVec3,
    /// Description of outliers, which are left out.
    pub outliers: Option<String>,
}

impl Outline {
    /// The outline of a scene, relative to `offset`. A scene without objects gets a box of 2 m.
    pub fn of(scene: &Scene, offset: DVec3) -> Outline {
        let hulls = MeshHulls::of(scene);
        let extents = hulls.instance_extents();
        let bounds = scene_extent(scene, &extents).0;
        let fits = |p: DVec3| p.is_finite() && p.abs().max_element() < MAX_COORDINATE;
        let Some((min, max)) = bounds.filter(|&(min, max)| fits(min) && fits(max)) else {
            let (min, max) = (DVec3::splat(-1.0), DVec3::splat(1.0));
            return Outline { points: corners(min, max).to_vec(), min, max, outliers: None };
        };
        let limit = limit(scene, &extents);
        let visit = |each: &mut dyn FnMut(DVec3)| {
            let mut near = |p: DVec3| {
                if limit.as_ref().is_none_or(|limit| limit.contains(p)) {
                    each(p);
                }
            };
            hulls.visit(&mut near);
            for shape in &scene.shapes {
                visit_shape(shape, scene.shapes.len(), &mut near);
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
        // Meshes of one point have an empty list.
        let points = if points.is_empty() { corners(min, max).to_vec() } else { points };
        Outline { points, min, max, outliers: limit.map(|limit| limit.outliers) }
    }

    /// The centre of the bounds.
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Half the diagonal of the bounds, above 0.
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

/// Points on the surface of a shape's ellipsoid; fewer in scenes of many shapes.
fn visit_shape(shape: &Shape, count: usize, add: &mut dyn FnMut(DVec3)) {
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

/// The farthest point from a centre in each cell of directions. The error relative to the true hull is less than
/// the width of a cell, a few percent of the model's size for smooth surfaces, and zero at corners.
struct Farthest {
    center: DVec3,
    /// Scale from the bounding box to a cube, so that its sides have equally many cells.
    scale: DVec3,
    /// All points, while they are no more than the cells.
    all: Vec<DVec3>,
    /// Squared distance and position of the farthest point.
    cells: Vec<Option<(f64, DVec3)>>,
}

impl Farthest {
    fn new(center: DVec3, half: DVec3) -> Farthest {
        let scale = half.max(DVec3::splat(1e-6 * half.max_element().max(1e-300))).recip();
        Farthest { center, scale, all: Vec::new(), cells: vec![None; 6 * CELLS * CELLS] }
    }

    fn add(&mut self, p: DVec3) {
        if self.all.len() <= self.cells.len() && p.is_finite() {
            self.all.push(p);
        }
        let d = (p - self.center) * self.scale;
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
        match self.all.len() <= self.cells.len() {
            true => self.all,
            false => self.cells.into_iter().flatten().map(|(_, p)| p).collect(),
        }
    }
}

/// A position rounded to a multiple of a power of two well below `size`: sums with large coordinates stay exact.
pub(super) fn on_grid(p: DVec3, size: f64) -> DVec3 {
    let step = (size.max(1e-300).log2().floor() - 20.0).exp2();
    if step > 0.0 && step.is_finite() { (p / step).round() * step } else { p }
}

// Outliers: objects so distant that the rest would be tiny in a picture of all.

/// Objects at least this many times as far from the centre as all nearer ones are outliers.
const GAP: f64 = 20.0;
/// Fraction of the scene's weight that must be nearer than a gap. Each triangle has weight 1; all other shapes together weigh
/// as much as all triangles.
const MIN_NEARER: f64 = 0.9;
/// Maximum number of triangles examined; larger meshes are subsampled.
const MAX_TRIANGLES: usize = 1 << 19;
/// Maximum number of items for the median; more are subsampled.
const MAX_MEDIAN_ITEMS: usize = 50_000;
/// Maximum number of names in a message.
const MAX_LISTED: usize = 3;

/// The bounds of a part of the scene.
#[derive(Clone, Copy)]
struct Item {
    min: DVec3,
    max: DVec3,
    weight: f64,
}

impl Item {
    fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Distance of the box from a point.
    fn min_distance(&self, p: DVec3) -> f64 {
        (self.min - p).max(p - self.max).max(DVec3::ZERO).length()
    }

    /// Distance of the box's farthest corner from a point.
    fn max_distance(&self, p: DVec3) -> f64 {
        (self.min - p).abs().max((self.max - p).abs()).length()
    }
}

/// The sphere that contains the scene without outliers.
pub(super) struct Limit {
    center: DVec3,
    radius: f64,
    /// Names and distance of the outliers.
    pub outliers: String,
}

impl Limit {
    /// Whether the sphere contains a point.
    pub fn contains(&self, p: DVec3) -> bool {
        p.distance(self.center) <= self.radius
    }
}

/// Finds the gap that separates outliers from the scene; `None` without such a gap. The scene need not be valid.
fn limit(scene: &Scene, extents: &[Extent]) -> Option<Limit> {
    let items = Items::of(scene);
    if items.count == 0 {
        return limit_of_splats(scene);
    }
    let (center, all) = items.median()?;
    let (mut far, mut weight) = (0.0f64, 0.0);
    for bin in items.by_distance(center) {
        if bin.near > GAP * far && far > 0.0 && weight >= MIN_NEARER * all {
            let radius = 0.5 * (far + bin.near);
            let outliers = outliers(scene, extents, center, radius, bin.near);
            return Some(Limit { center, radius, outliers });
        }
        far = far.max(bin.far);
        weight += bin.weight;
    }
    None
}

/// Items within an octave of distances from the centre.
#[derive(Clone, Copy)]
struct Bin {
    /// Distance of the nearest box.
    near: f64,
    /// Distance of the farthest corner.
    far: f64,
    weight: f64,
}

impl Bin {
    const EMPTY: Bin = Bin { near: f64::INFINITY, far: 0.0, weight: 0.0 };
}

/// Maximum number of splats examined.
const MAX_SPLATS: usize = 100_000;
/// Radius of the limit of splats: a quantile of their distances, and a factor on it.
const SPLAT_LIMIT: (f64, f64) = (0.9, 1.5);

/// The limit of a scan, which often has distant splats (the surroundings of the subject) without a gap.
fn limit_of_splats(scene: &Scene) -> Option<Limit> {
    let placed = scene.instances.iter().filter_map(|i| Some((i, scene.meshes.get(i.mesh.index())?)));
    let placed = placed.filter(|(_, mesh)| mesh.splats.is_some());
    let total: usize = placed.clone().map(|(_, mesh)| mesh.positions.len()).sum();
    let step = total.div_ceil(MAX_SPLATS).max(1);
    let centers = placed.flat_map(|(instance, mesh)| {
        let world = |p: &[f32; 3]| instance.world_from_object.transform_point3(DVec3::from(p.map(f64::from)));
        mesh.positions.iter().step_by(step).map(world)
    });
    let centers: Vec<DVec3> = centers.filter(|p| p.is_finite()).collect();
    let median = |axis: usize| {
        let mut all: Vec<f64> = centers.iter().map(|p| p[axis]).collect();
        all.sort_unstable_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    };
    let center = DVec3::new(median(0)?, median(1)?, median(2)?);
    let mut distances: Vec<f64> = centers.iter().map(|p| p.distance(center)).collect();
    distances.sort_unstable_by(f64::total_cmp);
    let (quantile, factor) = SPLAT_LIMIT;
    let radius = factor * distances[(quantile * (distances.len() - 1) as f64) as usize];
    let outliers = distances.len() - distances.partition_point(|d| *d <= radius);
    let farthest = *distances.last()?;
    (outliers > 0 && radius > 0.0).then(|| Limit {
        center,
        radius,
        outliers: format!("about {} splats, up to {farthest:.3} m from the centre", outliers * step),
    })
}

/// Visits the parts of a scene without allocating a list.
struct Items<'s> {
    scene: &'s Scene,
    /// Every `step`-th triangle is an item.
    step: usize,
    /// Weight of an item that is not a triangle.
    weight: f64,
    /// Number of items, including those with positions that aren't finite.
    count: usize,
    boxes_of_curves: Vec<(DVec3, DVec3)>,
}

impl<'s> Items<'s> {
    fn of(scene: &'s Scene) -> Items<'s> {
        let placed = || scene.instances.iter().filter_map(|i| scene.meshes.get(i.mesh.index()));
        let total = placed().fold(0usize, |sum, mesh| sum.saturating_add(mesh.triangles.len()));
        let step = total.div_ceil(MAX_TRIANGLES).max(1);
        let others = scene.shapes.len() + scene.quads.len() + scene.curves.len();
        Items {
            scene,
            step,
            weight: total.max(1) as f64 / others.max(1) as f64,
            count: placed().map(|mesh| mesh.triangles.len().div_ceil(step)).sum::<usize>() + others,
            boxes_of_curves: scene.curves.iter().filter_map(curves_box).collect(),
        }
    }

    fn visit(&self, mut each: impl FnMut(Item)) {
        let mut finite = |min: DVec3, max: DVec3, weight: f64| {
            if min.is_finite() && max.is_finite() {
                each(Item { min, max, weight });
            }
        };
        for instance in &self.scene.instances {
            let Some(mesh) = self.scene.meshes.get(instance.mesh.index()) else { continue };
            let corner = |i: u32| {
                let p = mesh.positions.get(i as usize)?;
                Some(instance.world_from_object.transform_point3(DVec3::from(p.map(f64::from))))
            };
            for &[a, b, c] in mesh.triangles.iter().step_by(self.step) {
                if let (Some(a), Some(b), Some(c)) = (corner(a), corner(b), corner(c)) {
                    finite(a.min(b).min(c), a.max(b).max(c), self.step as f64);
                }
            }
        }
        for s in &self.scene.shapes {
            let half = s.half_extent();
            finite(s.center - half, s.center + half, self.weight);
        }
        for q in &self.scene.quads {
            let (u, v) = (q.edge_u, q.edge_v);
            let low = u.min(DVec3::ZERO) + v.min(DVec3::ZERO);
            let high = u.max(DVec3::ZERO) + v.max(DVec3::ZERO);
            finite(q.corner + low, q.corner + high, self.weight);
        }
        self.boxes_of_curves.iter().for_each(|&(min, max)| finite(min, max, self.weight));
    }

    /// The weighted median of the centres, per axis, and the weight of all items.
    fn median(&self) -> Option<(DVec3, f64)> {
        let step = self.count.div_ceil(MAX_MEDIAN_ITEMS).max(1);
        let (mut picked, mut at, mut all) = (Vec::new(), 0, 0.0);
        self.visit(|item| {
            if at % step == 0 {
                picked.push((item.center(), item.weight));
            }
            at += 1;
            all += item.weight;
        });
        let half = 0.5 * picked.iter().map(|(_, weight)| weight).sum::<f64>();
        let mut along = |axis: usize| {
            picked.sort_unstable_by(|a, b| a.0[axis].total_cmp(&b.0[axis]));
            let mut sum = 0.0;
            let median = picked.iter().find(|(_, weight)| {
                sum += weight;
                sum >= half
            });
            median.map(|(p, _)| p[axis])
        };
        Some((DVec3::new(along(0)?, along(1)?, along(2)?), all))
    }

    /// The items binned by distance from `center`, in ascending octaves. As a gap is wider than an octave, all nearer items are
    /// in lower bins, and bins find the same gaps as sorting.
    fn by_distance(&self, center: DVec3) -> impl Iterator<Item = Bin> {
        const { assert!(GAP > 2.0) };
        let mut bins = vec![Bin::EMPTY; 1 << 11];
        self.visit(|item| {
            let (near, far) = (item.min_distance(center), item.max_distance(center));
            // The exponent of a non-negative number.
            let bin = &mut bins[(near.to_bits() >> 52) as usize];
            *bin = Bin { near: bin.near.min(near), far: bin.far.max(far), weight: bin.weight + item.weight };
        });
        bins.into_iter().filter(|bin| bin.weight > 0.0)
    }
}

/// The box around the points of curves.
fn curves_box(curves: &Curves) -> Option<(DVec3, DVec3)> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    curves.visit(&mut |p, _| (min, max) = (min.min(p), max.max(p)));
    (min.x <= max.x).then_some((min, max))
}

/// Describes the objects beyond `radius`, metres; the nearest is at the distance `near`.
fn outliers(scene: &Scene, extents: &[Extent], center: DVec3, radius: f64, near: f64) -> String {
    let box_of = |(min, max)| Item { min, max, weight: 1.0 };
    let mut names: Vec<String> = Vec::new();
    let mut add = |name: &str, item: Item| {
        if item.max_distance(center) > radius {
            let part = if item.min_distance(center) < radius { "parts of " } else { "" };
            let name = if name.is_empty() { "an object".to_string() } else { format!("'{name}'") };
            names.push(format!("{part}{name}"));
        }
    };
    for (instance, extent) in scene.instances.iter().zip(extents) {
        extent.0.into_iter().for_each(|bounds| add(&instance.name, box_of(bounds)));
    }
    for shape in &scene.shapes {
        let half = shape.half_extent();
        add(&shape.name, box_of((shape.center - half, shape.center + half)));
    }
    for quad in &scene.quads {
        let far = quad.corner + quad.edge_u + quad.edge_v;
        add(&quad.name, box_of((quad.corner.min(far), quad.corner.max(far))));
    }
    for curves in &scene.curves {
        curves_box(curves).into_iter().for_each(|bounds| add(&curves.name, box_of(bounds)));
    }
    let more = names.len().saturating_sub(MAX_LISTED);
    names.truncate(MAX_LISTED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    // Three significant digits.
    let unit = 10f64.powf(near.log10().floor() - 2.0);
    let meters = (near / unit).round() * unit;
    format!("{}{more}, about {meters} m away", names.join(", "))
}

/// The axis of a turntable animation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turntable {
    /// A point of the vertical axis, world space.
    center: DVec3,
    /// The stage's light rotates with the camera, as if the model rotated.
    rotates_light: bool,
}

impl Turntable {
    /// A turntable about the vertical axis through a point.
    pub fn new(center: DVec3, rotates_light: bool) -> Turntable {
        Turntable { center, rotates_light }
    }

    /// The centre of the orbited objects.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// The camera orbited by an angle, radians, counter-clockwise seen from above, without motion.
    pub fn camera(&self, camera: &Camera, angle_rad: f64) -> Camera {
        let orbit = DAffine3::from_translation(self.center)
            * DAffine3::from_quat(DQuat::from_rotation_y(angle_rad))
            * DAffine3::from_translation(-self.center);
        Camera { world_from_camera: orbit * camera.world_from_camera, motion: None, ..camera.clone() }
    }

    /// Rotates the stage's light by the same angle.
    pub fn light(&self, scene: &mut Scene, angle_rad: f64) {
        if let Environment::Image { rotation_rad, .. } = &mut scene.environment
            && self.rotates_light
        {
            *rotation_rad = angle_rad;
        }
    }
}
