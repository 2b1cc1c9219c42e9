//! Gaussian splats: point and value of the peak opacity along a ray, and view-dependent colour.

use super::traits::{PreparedRay, Surface};
use crate::math::{Bounds3, Mat3, Quat, Vec3, gamma, poly};
use crate::scene::Splats;
use half::f16;
use std::sync::Arc;

/// Gaussian splats of a geometry.
#[derive(Clone, Debug, Default)]
pub struct SplatCloud {
    /// Centres, metres.
    pub centers: Vec<[f32; 3]>,
    /// Other parameters; `None` without splats.
    pub splats: Option<Arc<Splats>>,
}

/// A splat, prepared for intersection.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// Centre, metres.
    pub center: Vec3,
    /// Rows of the matrix (1/metres) that maps the splat to an isotropic Gaussian of standard deviation 1.
    pub rows: [[f32; 3]; 3],
    /// Opacity at the centre, 0..1.
    pub opacity: f32,
}

impl SplatCloud {
    /// No splats.
    pub const EMPTY: SplatCloud = SplatCloud { centers: Vec::new(), splats: None };

    /// Number of splats.
    pub fn count(&self) -> usize {
        self.centers.len()
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        let of = |s: &Splats| {
            size_of_val(&s.scales[..])
                + size_of_val(&s.rotations[..])
                + size_of_val(&s.opacities[..])
                + size_of_val(&s.coefficients[..])
        };
        size_of_val(&self.centers[..]) + self.splats.as_deref().map_or(0, of)
    }

    /// Axes of a splat in object space, and standard deviations along them, metres.
    fn axes(&self, index: usize) -> Option<(Mat3, Vec3)> {
        let splats = self.splats.as_ref()?;
        let axes = Mat3::from_quat(Quat::from_array(*splats.rotations.get(index)?));
        Some((axes, Vec3::from_array(*splats.scales.get(index)?)))
    }

    /// Prepares a splat by its index.
    pub fn get(&self, index: usize) -> Option<Splat> {
        let (axes, scales) = self.axes(index)?;
        let row = |axis: Vec3, scale: f32| (axis / scale).to_array();
        let rows = [row(axes.x_axis, scales.x), row(axes.y_axis, scales.y), row(axes.z_axis, scales.z)];
        let opacity = *self.splats.as_ref()?.opacities.get(index)?;
        Some(Splat { center: Vec3::from_array(*self.centers.get(index)?), rows, opacity })
    }

    /// Bounding box of the part of a splat with an opacity of at least [`Splats::MIN_OPACITY`]; `None` if there is none.
    pub fn bounds_of(&self, index: usize) -> Option<Bounds3> {
        let (axes, scales) = self.axes(index)?;
        let radius = cutoff_radius(*self.splats.as_ref()?.opacities.get(index)?)?;
        // Half extents of an ellipsoid: lengths of the rows of the matrix that maps the unit sphere to it.
        let half = |k: usize| {
            let row = Vec3::new(axes.x_axis[k], axes.y_axis[k], axes.z_axis[k]) * scales;
            // With a margin for rounding of the square root and of the opacity test.
            row.length() * radius * (1.0 + 1e-5)
        };
        let half = Vec3::new(half(0), half(1), half(2));
        let center = Vec3::from_array(*self.centers.get(index)?);
        Some(Bounds3 { min: center - half, max: center + half })
    }

    /// Bounding box of all splats.
    pub fn bounds(&self) -> Bounds3 {
        let all = (0..self.count()).filter_map(|i| self.bounds_of(i));
        all.filter(|b| b.min.is_finite() && b.max.is_finite()).fold(Bounds3::EMPTY, Bounds3::union)
    }

    /// The surface of a splat at point `p` of a ray along `direction`: a disk perpendicular to its shortest axis.
    pub fn surface(&self, index: usize, p: Vec3, direction: Vec3) -> Surface {
        let shortest = self.axes(index).map(|(axes, scales)| axes.col(scales.min_position()));
        let normal = shortest.unwrap_or(Vec3::Z);
        let ng = if normal.dot(direction) > 0.0 { -normal } else { normal };
        Surface { p, p_error: p.abs() * gamma(4), ng, ns: ng, material: 0 }
    }

    /// The linear colour of a splat for a unit direction in object space, from the viewer to the splat.
    pub fn color(&self, index: usize, direction: Vec3) -> [f32; 3] {
        let Some(splats) = &self.splats else { return [0.0; 3] };
        let count = Splats::coefficients_of(splats.degree);
        let own = splats.coefficients.get(index * count..(index + 1) * count).unwrap_or_default();
        let encoded = harmonics(own, direction).map(|sum| (sum + 0.5).max(0.0));
        if splats.is_linear { encoded } else { encoded.map(srgb_decoded) }
    }
}

/// Decodes an sRGB value (IEC 61966-2-1), which may exceed 1; relative error below 3e-6. Bit-identical on all CPUs, unlike the system
/// library's power function.
fn srgb_decoded(encoded: f32) -> f32 {
    match encoded <= 0.040_45 {
        true => encoded / 12.92,
        false => poly::exp(2.4 * poly::ln((encoded + 0.055) / 1.055)),
    }
}

/// Cut-off radius of a splat of an opacity, in standard deviations; `None` if the opacity is below [`Splats::MIN_OPACITY`].
fn cutoff_radius(opacity: f32) -> Option<f32> {
    let over = opacity / Splats::MIN_OPACITY;
    (over >= 1.0).then(|| (2.0 * poly::ln(over)).max(0.0).sqrt())
}

/// Evaluates real spherical harmonics for a unit direction, with the coefficient order and signs (Condon-Shortley phase) of Kerbl et al.
/// 2023 and `KHR_gaussian_splatting`.
fn harmonics(coefficients: &[[f16; 3]], direction: Vec3) -> [f32; 3] {
    let basis = basis(direction);
    let mut sum = [0.0; 3];
    for (coefficient, value) in coefficients.iter().zip(basis) {
        for (sum, c) in sum.iter_mut().zip(coefficient) {
            *sum += c.to_f32() * value;
        }
    }
    sum
}

/// Real spherical harmonics of degrees l = 0..3, ordered by l, then m from -l to l.
fn basis(direction: Vec3) -> [f32; 16] {
    let [x, y, z] = direction.to_array();
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        Splats::FIRST_HARMONIC,
        -0.488_602_5 * y,
        0.488_602_5 * z,
        -0.488_602_5 * x,
        1.092_548_4 * (x * y),
        -1.092_548_4 * (y * z),
        0.315_391_57 * (2.0 * zz - xx - yy),
        -1.092_548_4 * (x * z),
        0.546_274_2 * (xx - yy),
        -0.590_043_6 * (y * (3.0 * xx - yy)),
        2.890_611_4 * (x * y * z),
        -0.457_045_8 * (y * (4.0 * zz - xx - yy)),
        0.373_176_34 * (z * (2.0 * zz - 3.0 * xx - 3.0 * yy)),
        -0.457_045_8 * (x * (4.0 * zz - xx - yy)),
        1.445_305_7 * (z * (xx - yy)),
        -0.590_043_6 * (x * (xx - 3.0 * yy)),
    ]
}

/// Upper bound of the squared cut-off radius, in squared standard deviations: 2 ln 255 for opacity 1, plus rounding.
pub const MAX_SQUARED_RADIUS: f32 = 11.09;

/// The splats of a packet as a structure of arrays.
#[derive(Clone, Copy, Debug)]
pub struct SplatLanes<'a> {
    /// Centres: x, y, z.
    pub center: [&'a [f32; 4]; 3],
    /// The matrices of [`Splat::rows`], row by row.
    pub rows: [&'a [f32; 4]; 9],
    /// Opacities at the centres; 0 in unused lanes.
    pub opacity: &'a [f32; 4],
}

impl SplatLanes<'_> {
    /// For each splat, the ray parameter of the peak opacity, and the squared distance from the centre there, in standard deviations.
    #[inline(always)]
    pub fn peaks(&self, ray: &PreparedRay) -> ([f32; 4], [f32; 4]) {
        let (o, d) = (ray.origin, ray.direction);
        let inverse_squared_length = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        let (mut t, mut squared) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            let from = [o[0] - self.center[0][k], o[1] - self.center[1][k], o[2] - self.center[2][k]];
            // Relative to the ray's point nearest to the centre, so that distant origins lose no precision.
            let near = -(from[0] * d[0] + from[1] * d[1] + from[2] * d[2]) * inverse_squared_length;
            let from = [from[0] + d[0] * near, from[1] + d[1] * near, from[2] + d[2] * near];
            let row = |r: usize, v: [f32; 3]| {
                self.rows[3 * r][k] * v[0] + self.rows[3 * r + 1][k] * v[1] + self.rows[3 * r + 2][k] * v[2]
            };
            let (p, w) = ([row(0, from), row(1, from), row(2, from)], [row(0, d), row(1, d), row(2, d)]);
            let at = -(p[0] * w[0] + p[1] * w[1] + p[2] * w[2]) / (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
            let q = [p[0] + w[0] * at, p[1] + w[1] * at, p[2] + w[2] * at];
            t[k] = near + at;
            squared[k] = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
        }
        (t, squared)
    }

    /// The opacity of a splat at a squared distance in standard deviations; 0 beyond the cut-off radius.
    #[inline(always)]
    pub fn opacity_at(&self, lane: usize, squared: f32) -> f32 {
        let opacity = self.opacity[lane] * poly::exp(-0.5 * squared);
        if opacity >= Splats::MIN_OPACITY { opacity } else { 0.0 }
    }
}

/// Octahedral encoding of a direction of any length to two numbers in -1..1 (Meyer et al. 2010, "On Floating-Point Normal Vectors").
#[inline(always)]
pub fn octahedral(direction: [f32; 3]) -> [f32; 2] {
    let [x, y, z] = direction;
    let sum = x.abs() + y.abs() + z.abs();
    let (u, v) = (x / sum, y / sum);
    if z >= 0.0 { [u, v] } else { [(1.0 - v.abs()).copysign(x), (1.0 - u.abs()).copysign(y)] }
}

/// Decodes [`octahedral`] to a unit vector.
#[inline(always)]
pub fn from_octahedral([u, v]: [f32; 2]) -> Vec3 {
    let z = 1.0 - u.abs() - v.abs();
    let (x, y) = if z >= 0.0 { (u, v) } else { ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)) };
    Vec3::new(x, y, z).normalize_or_zero()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;

    fn cloud(scales: Vec3, rotation: Quat, opacity: f32) -> SplatCloud {
        let splats = Splats {
            scales: vec![scales.to_array()],
            rotations: vec![rotation.to_array()],
            opacities: vec![opacity],
            degree: 0,
            coefficients: vec![[f16::ZERO; 3]],
            is_linear: false,
        };
        SplatCloud { centers: vec![[0.3, -0.2, 0.5]], splats: Some(Arc::new(splats)) }
    }

    /// The opacity of a splat at a point by definition.
    fn opacity_at(cloud: &SplatCloud, p: Vec3) -> f32 {
        let splats = cloud.splats.as_ref().expect("splats");
        let rotation = Quat::from_array(splats.rotations[0]);
        let q = (rotation.inverse() * (p - Vec3::from_array(cloud.centers[0])))
            / Vec3::from_array(splats.scales[0]);
        splats.opacities[0] * (-0.5 * q.length_squared()).exp()
    }

    fn peak(cloud: &SplatCloud, origin: Vec3, direction: Vec3) -> (f32, f32) {
        let splat = cloud.get(0).expect("a splat");
        let fill = |x: f32| [x; 4];
        let center = splat.center.to_array().map(fill);
        let rows: [[f32; 4]; 9] = std::array::from_fn(|i| fill(splat.rows[i / 3][i % 3]));
        let opacity = fill(splat.opacity);
        let lanes = SplatLanes { center: center.each_ref(), rows: rows.each_ref(), opacity: &opacity };
        let ray =
            PreparedRay { origin: origin.to_array(), direction: direction.to_array(), ..PreparedRay::NONE };
        let (t, squared) = lanes.peaks(&ray);
        (t[1], splat.opacity * poly::exp(-0.5 * squared[1]))
    }

    /// Peaks are maxima of the opacity along the ray, and their opacity agrees with the definition.
    #[test]
    fn peaks_are_maxima_of_the_opacity() {
        let mut random = Random::new(4);
        for _ in 0..2000 {
            let rotation = Quat::from_axis_angle(random.direction(), 3.0 * random.next());
            let scales = Vec3::new(0.1 + random.next(), 0.1 + random.next(), 0.05 + 0.1 * random.next());
            let cloud = cloud(scales, rotation, 0.9);
            let origin = random.direction() * 4.0;
            let direction = (Vec3::from_array(cloud.centers[0]) + random.direction() * 0.5 - origin) * 0.7;
            let (t, opacity) = peak(&cloud, origin, direction);
            let there = opacity_at(&cloud, origin + direction * t);
            assert!((there - opacity).abs() < 2e-5, "{there} {opacity}");
            for step in [-0.05, -0.01, 0.01, 0.05] {
                assert!(opacity_at(&cloud, origin + direction * (t + step)) <= there + 1e-6);
            }
            if opacity > Splats::MIN_OPACITY {
                let bounds = cloud.bounds_of(0).expect("bounds");
                let p = origin + direction * t;
                assert!((p - bounds.min).min_element() > -1e-5 && (bounds.max - p).min_element() > -1e-5);
            }
        }
    }

    #[test]
    fn bounding_boxes_are_tight() {
        let mut random = Random::new(5);
        let rotation = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1);
        let cloud = cloud(Vec3::new(0.5, 0.2, 0.1), rotation, 0.7);
        let bounds = cloud.bounds_of(0).expect("bounds");
        let splats = cloud.splats.as_ref().expect("splats");
        let end = cutoff_radius(0.7).expect("a radius");
        let mut sampled = Bounds3::EMPTY;
        for _ in 0..200_000 {
            let on_surface = random.direction() * end * Vec3::from_array(splats.scales[0]);
            let p = Vec3::from_array(cloud.centers[0]) + rotation * on_surface;
            assert!((opacity_at(&cloud, p) - Splats::MIN_OPACITY).abs() < 1e-5);
            sampled = sampled.union(Bounds3 { min: p, max: p });
        }
        assert!((sampled.min - bounds.min).abs().max_element() < 2e-3 && sampled.min.cmpge(bounds.min).all());
        assert!((sampled.max - bounds.max).abs().max_element() < 2e-3 && sampled.max.cmple(bounds.max).all());
        assert!(cutoff_radius(0.003).is_none());
    }

    fn random_cloud(count: usize) -> SplatCloud {
        let mut random = Random::new(9);
        let (mut splats, mut centers) = (Splats::default(), Vec::new());
        for _ in 0..count {
            centers.push((random.direction() * random.next()).to_array());
            let scale = |x: f32| 0.01 + 0.08 * x;
            splats.scales.push([scale(random.next()), scale(random.next()), scale(random.next())]);
            splats.rotations.push(Quat::from_axis_angle(random.direction(), 3.0 * random.next()).to_array());
            splats.opacities.push(0.01 + 0.98 * random.next());
            splats.coefficients.push([f16::ZERO; 3]);
        }
        SplatCloud { centers, splats: Some(Arc::new(splats)) }
    }

    /// All CPU levels, batches and queries accept the same splats; over many times of a ray the fraction of hits is the alpha of sorted
    /// compositing.
    #[test]
    fn acceptance_of_splats_agrees_on_all_levels_and_with_compositing() {
        use crate::accel::{Accel, AccelInstance, Geometry};
        use crate::math::{DAffine3, DVec3, Hit, Ray};
        use crate::simd::Level;
        let geometry = Geometry { splats: random_cloud(3000), ..Geometry::default() };
        let cloud = geometry.splats.clone();
        let world_from_object =
            DAffine3::from_rotation_y(0.7) * DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5));
        let placed = [AccelInstance { geometry: 1, world_from_object }];
        let accel = Accel::build(&[Geometry::default(), geometry], &placed);
        accel.validate().expect("a sound tree");
        assert_eq!(accel.stats().splats, 3000);
        let mut random = Random::new(10);
        let rays: Vec<Ray> = (0..4000)
            .map(|_| {
                let origin = random.direction() * 4.0;
                Ray::new(origin, (random.direction() * random.next() - origin).normalize())
            })
            .collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        accel.closest(&rays, &mut hits);
        assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 1000);
        for level in Level::ALL.into_iter().filter(|level| level.is_available()) {
            let (mut same, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
            accel.closest_at(level, &rays, &mut same);
            accel.occluded_at(level, &rays, &mut occluded);
            assert_eq!(same, hits, "{}", level.name());
            assert!(occluded.iter().zip(&hits).all(|(occluded, hit)| *occluded == hit.is_hit()));
        }
        assert!(rays.iter().zip(&hits).all(|(ray, hit)| accel.closest_one(ray) == *hit));
        let object_from_world = world_from_object.inverse();
        for ray in &rays[..20] {
            let origin = object_from_world.transform_point3(ray.origin.as_dvec3()).as_vec3();
            let direction = object_from_world.transform_vector3(ray.direction.as_dvec3()).as_vec3();
            let transmittance = |i: usize| {
                let one =
                    SplatCloud { centers: vec![cloud.centers[i]], splats: Some(Arc::new(alone(&cloud, i))) };
                let (t, opacity) = peak(&one, origin, direction);
                if t > 0.0 && opacity >= Splats::MIN_OPACITY { f64::from(1.0 - opacity) } else { 1.0 }
            };
            let truth: f64 = 1.0 - (0..cloud.count()).map(transmittance).product::<f64>();
            let times: Vec<f32> = (0..20_000).map(|_| random.next()).collect();
            let (copies, mut hits) = (vec![*ray; times.len()], vec![Hit::MISS; times.len()]);
            accel.closest_in_time(&copies, &times, &mut hits);
            let fraction = hits.iter().filter(|hit| hit.is_hit()).count() as f64 / times.len() as f64;
            let error = (truth * (1.0 - truth) / times.len() as f64).sqrt();
            assert!((fraction - truth).abs() < 4.5 * error + 1e-4, "{fraction}, not {truth} +- {error}");
        }
    }

    /// One splat of a cloud.
    fn alone(cloud: &SplatCloud, i: usize) -> Splats {
        let all = cloud.splats.as_ref().expect("splats");
        Splats {
            scales: vec![all.scales[i]],
            rotations: vec![all.rotations[i]],
            opacities: vec![all.opacities[i]],
            coefficients: vec![all.coefficients[i]],
            degree: 0,
            is_linear: false,
        }
    }

    #[test]
    fn colors_are_decoded_as_srgb() {
        for i in 0..4000 {
            let encoded = i as f32 * 1e-3;
            let expected = crate::color::linear_from_srgb(encoded);
            assert!((srgb_decoded(encoded) - expected).abs() <= 3e-6 * expected, "{encoded}");
        }
        assert!(MAX_SQUARED_RADIUS > 2.0 * (1.0 / Splats::MIN_OPACITY).ln());
    }

    #[test]
    fn octahedral_encoding_is_invertible() {
        let mut random = Random::new(6);
        for _ in 0..10_000 {
            let direction = random.direction();
            let back = from_octahedral(octahedral((direction * 3.7).to_array()));
            assert!((back - direction).length() < 3e-7, "{direction} {back}");
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(from_octahedral(octahedral(axis.to_array())), axis);
            assert_eq!(from_octahedral(octahedral((-axis).to_array())), -axis);
        }
    }

    /// Orthonormality over the sphere determines all constants up to signs.
    #[test]
    fn harmonics_are_orthonormal() {
        let mut sums = [[0.0f64; 16]; 16];
        let (rings, steps) = (400, 200);
        for i in 0..rings {
            let z = (f64::from(i) + 0.5) / f64::from(rings) * 2.0 - 1.0;
            for j in 0..steps {
                let phi = (f64::from(j) + 0.5) / f64::from(steps) * std::f64::consts::TAU;
                let r = (1.0 - z * z).sqrt();
                let values = basis(Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32));
                for a in 0..16 {
                    for b in 0..16 {
                        sums[a][b] += f64::from(values[a]) * f64::from(values[b]);
                    }
                }
            }
        }
        let cell = 4.0 * std::f64::consts::PI / f64::from(rings * steps);
        for (a, row) in sums.iter().enumerate() {
            for (b, sum) in row.iter().enumerate() {
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((sum * cell - expected).abs() < 1e-4, "{a} {b}: {}", sum * cell);
            }
        }
    }

    /// Signs at a direction without symmetry, compared with the formulas of the glTF extension's appendix.
    #[test]
    fn harmonics_have_the_signs_of_the_extension() {
        let direction = Vec3::new(0.2, 0.5, 0.7).normalize();
        let signs: Vec<bool> = basis(direction).iter().map(|value| *value > 0.0).collect();
        let [x, y, z] = direction.to_array().map(f64::from);
        let expected = [
            1.0,
            -y,
            z,
            -x,
            x * y,
            -y * z,
            2.0 * z * z - x * x - y * y,
            -x * z,
            x * x - y * y,
            -y * (3.0 * x * x - y * y),
            x * y * z,
            -y * (4.0 * z * z - x * x - y * y),
            z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y),
            -x * (4.0 * z * z - x * x - y * y),
            z * (x * x - y * y),
            -x * (x * x - 3.0 * y * y),
        ];
        assert_eq!(signs, expected.map(|value| value > 0.0));
    }
}
