//! Nodes that trace rays: ambient occlusion and bevels.
//!
//! Where no rays are traced (displacement at load time, environments, shadow rays), nothing is occluded and nothing bevelled, as in Cycles.

use crate::math::{Frame, OriginPrimitive, Ray, Vec3, offset_ray_origin, poly};
use crate::sampling::warp::cosine_hemisphere;
use crate::scene::nodes::MAX_NODE_RAYS;
use crate::texture::{HitData, RayOrigin};

/// Settings of an ambient occlusion node.
#[derive(Clone, Copy, Debug)]
pub struct AmbientOcclusion {
    /// Number of rays.
    pub samples: u32,
    /// Rays start into the object.
    pub inside: bool,
    /// Only the hit object occludes.
    pub only_local: bool,
}

/// The hit and the origin of rays, if rays are traced there.
fn origin<'h>(hit: Option<&'h HitData<'h>>) -> Option<(&'h HitData<'h>, &'h RayOrigin<'h>)> {
    hit.and_then(|hit| Some((hit, hit.rays.as_ref()?)))
}

impl AmbientOcclusion {
    /// The fraction of cosine-distributed rays around `normal`, world space, that are unoccluded within a distance, metres.
    pub fn at(&self, hit: Option<&HitData<'_>>, distance: f32, normal: Vec3) -> f32 {
        let (Some((hit, from)), Some(normal)) = (origin(hit), normal.try_normalize()) else { return 1.0 };
        let samples = self.samples.min(MAX_NODE_RAYS);
        if !(distance > 0.0 && samples > 0) {
            return 1.0;
        }
        let frame = Frame::from_normal(if self.inside { -normal } else { normal });
        let mut rays = [Ray::new(Vec3::ZERO, Vec3::Z); MAX_NODE_RAYS as usize];
        for (ray, u) in rays.iter_mut().zip(from.random_pairs(from.dimension_sets[0], samples)) {
            let direction = frame.to_world(cosine_hemisphere(u));
            let origin = offset_ray_origin(hit.point, from.p_error, hit.true_normal, direction);
            let origin_primitive = OriginPrimitive::from(&from.hit);
            *ray = Ray { t_max: distance, origin_primitive, ..Ray::new(origin, direction) };
        }
        let count = from.scene.count_unoccluded(from, &rays[..samples as usize], self.only_local);
        count as f32 / samples as f32
    }
}

/// The density of bevel weights by distance from the point, not normalized: `(radius - distance)^3`.
fn profile(radius: f32, distance: f32) -> f32 {
    let rest = (radius - distance).max(0.0);
    rest * rest * rest
}

/// A distance on a disk of radius 1 by a uniform random number, with a pdf by area proportional to [`profile`]: inverts the cumulative
/// distribution `10 x^2 - 20 x^3 + 15 x^4 - 4 x^5` by Newton's method within bounds.
fn sample_distance(u: f32) -> f32 {
    const STEPS: u32 = 16;
    let (mut low, mut high, mut x) = (0.0f32, 1.0f32, 0.25f32);
    for _ in 0..STEPS {
        let rest = 1.0 - x;
        let error = x * x * (10.0 + x * (-20.0 + x * (15.0 - 4.0 * x))) - u;
        (low, high) = if error < 0.0 { (x, high) } else { (low, x) };
        let next = x - error / (20.0 * x * rest * rest * rest);
        x = if next >= low && next <= high { next } else { 0.5 * (low + high) };
    }
    x
}

/// A ray through the sphere around a point that a bevel averages normals in.
#[derive(Clone, Copy)]
struct Probe {
    ray: Ray,
    /// Distance of the point from the ray's line, metres.
    distance: f32,
    /// The axes of a frame, that of the ray first, with the probabilities of rays along them.
    axes: [(Vec3, f32); 3],
}

impl Probe {
    /// A random ray around a point, along an axis of the frame of `normal`. Half of the rays are along the normal (King, Kulla, Conty, Fajardo
    /// 2013, "BSSRDF Importance Sampling").
    fn new(point: Vec3, normal: Vec3, radius: f32, [u, v]: [f32; 2]) -> Probe {
        let frame = Frame::from_normal(normal);
        let [n, t, b] = [(normal, 0.5), (frame.to_world(Vec3::X), 0.25), (frame.to_world(Vec3::Y), 0.25)];
        let (axes, turn) = match u {
            u if u < 0.5 => ([n, t, b], u * 2.0),
            u if u < 0.75 => ([t, n, b], (u - 0.5) * 4.0),
            u => ([b, t, n], (u - 0.75) * 4.0),
        };
        let [(up, _), (along, _), (across, _)] = axes;
        let (sine, cosine) = poly::sin_cos_turns(turn);
        let distance = radius * sample_distance(v);
        let height = (radius * radius - distance * distance).max(0.0).sqrt();
        let origin = point + up * height + (along * cosine + across * sine) * distance;
        Probe { ray: Ray { t_max: 2.0 * height, ..Ray::new(origin, -up) }, distance, axes }
    }

    /// The weight of a crossing at a distance from the point: its density over that of the rays along all axes, by the power heuristic.
    fn weight(&self, radius: f32, distance: f32, ng: Vec3) -> f32 {
        let densities = self.axes.map(|(axis, probability)| probability * axis.dot(ng).abs());
        let squares: f32 = densities.iter().map(|density| density * density).sum();
        let weight = densities[0] * profile(radius, distance) / (squares * profile(radius, self.distance));
        if weight.is_finite() { weight } else { 0.0 }
    }
}

/// The normal, world space, on the viewer's side, of a surface whose edges are rounded by a radius, metres: the weighted mean of those around
/// the hit. What differs from the shading normal is added to `normal`.
pub fn bevel(hit: Option<&HitData<'_>>, samples: u32, radius: f32, normal: Vec3) -> Vec3 {
    let Some((hit, from)) = origin(hit).filter(|(_, from)| from.is_sharp && radius > 0.0) else {
        return normal;
    };
    let numbers = from.random_pairs(from.dimension_sets[1], samples.min(MAX_NODE_RAYS));
    let mut sum = Vec3::ZERO;
    for probe in numbers.map(|u| Probe::new(hit.point, hit.true_normal, radius, u)) {
        from.scene.visit_crossings(from, &probe.ray, &mut |crossing| {
            sum += crossing.ns * probe.weight(radius, crossing.point.distance(hit.point), crossing.ng);
        });
    }
    let Some(mean) = sum.try_normalize() else { return normal };
    let mean = if hit.is_back { -mean } else { mean };
    (normal + (mean - hit.shading_normal)).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DMat4, DVec3, Hit};
    use crate::sampling::sampler::SobolPoint;
    use crate::scene::{MaterialId, Shape};
    use crate::texture::{CameraData, Crossing, HitAttributes, ObjectData, PathData, RayQueries};

    /// The edge of a solid with a right angle: the planes y = 0 and x = 0, where the other coordinate is negative. Rays that rise steeply
    /// are occluded.
    struct Edge;

    impl RayQueries for Edge {
        fn count_unoccluded(&self, _: &RayOrigin<'_>, rays: &[Ray], _: bool) -> u32 {
            rays.iter().filter(|ray| ray.direction.y < 0.5 && ray.t_max == 2.0).count() as u32
        }

        fn visit_crossings(&self, _: &RayOrigin<'_>, ray: &Ray, visit: &mut dyn FnMut(&Crossing)) {
            for (normal, other) in [(Vec3::Y, Vec3::X), (Vec3::X, Vec3::Y)] {
                let t = -ray.origin.dot(normal) / ray.direction.dot(normal);
                let point = ray.at(t);
                if t > 0.0 && t < ray.t_max && point.dot(other) < 0.0 {
                    visit(&Crossing { point, ng: normal, ns: normal });
                }
            }
        }
    }

    /// Evaluates `f` with the data of a hit at `p`, on the plane y = 0 of [`Edge`].
    fn with_hit<T>(p: Vec3, is_sharp: bool, f: impl Fn(&HitData<'_>) -> T) -> T {
        let shape = Shape::sphere(DVec3::ZERO, 1.0, MaterialId(0));
        let object = ObjectData::of_shape(&shape, DVec3::ZERO);
        let from = RayOrigin {
            scene: &Edge,
            hit: Hit::MISS,
            p_error: Vec3::ZERO,
            time: 0.0,
            sample: SobolPoint::new(5, 3),
            dimension_sets: [7, 8],
            is_sharp,
        };
        f(&HitData {
            attributes: HitAttributes::default(),
            object: &object,
            camera: CameraData { camera_from_world: &DMat4::IDENTITY, ndc_from_world: None },
            object_point: p,
            shading_normal: Vec3::Y,
            true_normal: Vec3::Y,
            incoming: Vec3::Y,
            is_back: false,
            parametric: [0.0; 2],
            corners: None,
            corner_uv: None,
            point: p,
            tangent_frame: None,
            material_index: 0.0,
            path: PathData::default(),
            strand: None,
            rays: Some(from),
        })
    }

    #[test]
    fn distances_follow_the_profile() {
        for i in 0..1000 {
            let u = i as f32 / 1000.0;
            let x = sample_distance(u);
            let expected = x * x * (10.0 + x * (-20.0 + x * (15.0 - 4.0 * x)));
            assert!((expected - u).abs() < 1e-5 && (0.0..=1.0).contains(&x), "{u}: {x}");
        }
    }

    #[test]
    fn ambient_occlusion_is_the_fraction_of_cosine_distributed_rays() {
        let node = AmbientOcclusion { samples: 128, inside: false, only_local: false };
        let at = |node: AmbientOcclusion, distance, normal| {
            with_hit(Vec3::ZERO, true, |hit| node.at(Some(hit), distance, normal))
        };
        // The squared sine of the angle to the normal is uniform.
        assert!((at(node, 2.0, Vec3::Y * 3.0) - 0.25).abs() < 0.01);
        assert_eq!(at(AmbientOcclusion { inside: true, ..node }, 2.0, Vec3::Y), 1.0);
        assert_eq!(
            (at(node, 0.0, Vec3::Y), at(node, 2.0, Vec3::ZERO), node.at(None, 2.0, Vec3::Y)),
            (1.0, 1.0, 1.0)
        );
        let few = at(AmbientOcclusion { samples: 3, ..node }, 2.0, Vec3::Y) * 3.0;
        assert_eq!(few, few.round());
    }

    /// The normal turns from that of the plane to the diagonal at the edge.
    #[test]
    fn bevels_round_edges() {
        let at = |distance: f32, is_sharp| {
            with_hit(Vec3::new(-distance, 0.0, 0.0), is_sharp, |hit| bevel(Some(hit), 128, 0.1, Vec3::Y))
        };
        let angles =
            [1e-5, 0.02, 0.05, 0.1].map(|distance| at(distance, true).angle_between(Vec3::Y).to_degrees());
        assert!((angles[0] - 45.0).abs() < 4.0 && angles[3] < 1e-3, "{angles:?}");
        assert!(angles.is_sorted_by(|a, b| a > b), "{angles:?}");
        assert_eq!(at(0.02, false), Vec3::Y);
        let tilted = Vec3::new(0.0, 0.8, 0.6);
        let bevelled = with_hit(Vec3::new(-0.05, 0.0, 0.0), true, |hit| bevel(Some(hit), 128, 0.1, tilted));
        assert!(bevelled.distance((tilted + at(0.05, true) - Vec3::Y).normalize()) < 1e-6);
    }
}
