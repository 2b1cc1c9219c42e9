//! A scene of meshes and instances, and representative rays of a path tracer.

use oscura::accel::{Accel, AccelInput, AccelInstance, Geometry, TreeQuality};
use oscura::math::{Bounds3, Frame, Hit, Ray, Vec3};

/// Width of the picture in rays.
const SIDE: usize = 1024;

/// A small random number generator (PCG, O'Neill 2014).
pub struct Random(pub u64);

impl Random {
    /// From 0 to 1, exclusive.
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        (x.rotate_right((self.0 >> 59) as u32) >> 8) as f32 / 16_777_216.0
    }
}

/// Geometry and instances.
#[derive(Default)]
pub struct World {
    /// The first is in world space.
    pub geometries: Vec<Geometry>,
    /// Transforms of the others.
    pub instances: Vec<AccelInstance>,
}

impl World {
    /// A world of a single mesh.
    pub fn flat(mesh: Geometry) -> World {
        World { geometries: vec![mesh], instances: Vec::new() }
    }

    /// The acceleration structure.
    pub fn build(&self, quality: TreeQuality) -> Accel {
        let geometries: Vec<&Geometry> = self.geometries.iter().collect();
        let (first_moving, first_changing) = (self.instances.len(), geometries.len());
        let instances = &self.instances;
        Accel::try_build(&AccelInput {
            geometries: &geometries,
            instances,
            first_moving,
            first_changing,
            moving: &[],
            quality,
            counter: None,
        })
        .expect("it can be addressed")
    }

    /// The ray sets by their names.
    pub fn ray_sets(&self, accel: &Accel) -> Vec<(&'static str, Vec<Ray>)> {
        let bounds = self.bounds();
        let mut random = Random(1);
        let primary = camera_rays(&bounds);
        let points = self.surface(accel, &primary);
        let first = bounce(&points, &mut random);
        let again = self.surface(accel, &first);
        let second = bounce(&again, &mut random);
        let shadow = shadow_rays(&points, &bounds, &mut random);
        vec![("primary", primary), ("bounce1", first), ("bounce2", second), ("shadow", shadow)]
    }

    fn bounds(&self) -> Bounds3 {
        let of = |g: &Geometry| Bounds3::of(g.positions.iter().map(|p| Vec3::from(*p)));
        let bounds: Vec<Bounds3> = self.geometries.iter().map(of).collect();
        let placed = self.instances.iter().flat_map(|i| {
            let place = |p: Vec3| i.world_from_object.transform_point3(p.as_dvec3()).as_vec3();
            bounds[i.geometry as usize].corners().map(place)
        });
        placed.fold(bounds[0], Bounds3::with)
    }

    /// The world-space vertices of a hit triangle.
    fn vertices(&self, hit: &Hit) -> [Vec3; 3] {
        let instance = hit.instance.checked_sub(1).map(|i| &self.instances[i as usize]);
        let mesh = &self.geometries[instance.map_or(0, |i| i.geometry as usize)];
        let object = mesh.triangles[hit.prim as usize].map(|i| Vec3::from(mesh.positions[i as usize]));
        match instance {
            None => object,
            Some(i) => object.map(|p| i.world_from_object.transform_point3(p.as_dvec3()).as_vec3()),
        }
    }

    /// Hit points, with the normal on the ray's side.
    fn surface(&self, accel: &Accel, rays: &[Ray]) -> Vec<(Vec3, Vec3)> {
        let mut hits = vec![Hit::MISS; rays.len()];
        accel.closest(rays, &mut hits);
        let mut points = Vec::with_capacity(rays.len());
        for (ray, hit) in rays.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
            let [a, b, c] = self.vertices(hit);
            let n = (b - a).cross(c - a).normalize_or_zero();
            let n = if n.dot(ray.direction) > 0.0 { -n } else { n };
            let p = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
            points.push((p + n * (p.abs().max_element() * 1e-5), n));
        }
        points
    }
}

/// Primary rays of a camera that looks at the scene from above one side, in tiles of 32 x 32.
fn camera_rays(bounds: &Bounds3) -> Vec<Ray> {
    let extent = bounds.extent();
    let target = bounds.center() - Vec3::Y * extent.y * 0.1;
    let eye = target + Vec3::new(0.25, 0.35, 0.9) * extent.max_element() * 1.05;
    let frame = Frame::from_normal((target - eye).normalize());
    let (right, up) = {
        let right = frame.n.cross(Vec3::Y).normalize();
        (right, right.cross(frame.n))
    };
    let mut rays = Vec::with_capacity(SIDE * SIDE);
    for tile in 0..(SIDE / 32) * (SIDE / 32) {
        for pixel in 0..1024 {
            let x = (tile % (SIDE / 32)) * 32 + pixel % 32;
            let y = (tile / (SIDE / 32)) * 32 + pixel / 32;
            let film = |i: usize| (i as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0;
            let direction = frame.n + (right * film(x) - up * film(y)) * 0.45;
            rays.push(Ray::new(eye, direction.normalize()));
        }
    }
    rays
}

/// A cosine-distributed direction from each point.
fn bounce(points: &[(Vec3, Vec3)], random: &mut Random) -> Vec<Ray> {
    let direction = |n: Vec3, random: &mut Random| {
        let (r, phi) = (random.unit().sqrt(), random.unit() * std::f32::consts::TAU);
        let z = (1.0 - r * r).max(1e-6).sqrt();
        Frame::from_normal(n).to_world(Vec3::new(r * phi.cos(), r * phi.sin(), z))
    };
    points.iter().map(|(p, n)| Ray::new(*p, direction(*n, random))).collect()
}

/// A segment from each point to a random one on a square above the scene.
fn shadow_rays(points: &[(Vec3, Vec3)], bounds: &Bounds3, random: &mut Random) -> Vec<Ray> {
    let (center, extent) = (bounds.center(), bounds.extent());
    let mut light = || {
        let at = Vec3::new(random.unit() - 0.5, 0.0, random.unit() - 0.5) * extent * 0.4;
        center + at + Vec3::Y * extent.y * 0.49
    };
    points.iter().map(|(p, _)| Ray::segment(*p, light() - *p)).collect()
}
