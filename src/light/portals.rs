//! Environment sampling through portals: directions through a portal by luminance (Bitterli, Novak, Jarosz 2015, "Portal-Masked
//! Environment Map Sampling").
//!
//! Directions are parametrised in the frame of a portal by two angles, the arc tangents of their slopes. A portal subtends an axis-aligned
//! rectangle in these angles from any point, so a summed-area table of luminance yields the light through it, and is inverted to sample
//! directions. Among several portals, one is selected by the light through each. Points in front of no portal sample the whole
//! environment. Light that comes through no portal is left to BSDF sampling, with MIS weight 1.

use crate::color::{Rgb, luminance};
use crate::math::{DVec3, Vec3, poly};
use crate::scene;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// Texels along each of the two angles, which cover 180 degrees: a third of a degree each.
const SIZE: usize = 512;
/// Minimum value of a texel relative to the mean, since a bright spot may lie between a texel's sample points.
const MIN_SHARE: f64 = 1e-3;

/// The compiled portals of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Portals {
    list: Vec<Portal>,
}

#[derive(Clone, Debug)]
struct Portal {
    corner: Vec3,
    size: [f32; 2],
    axes: Axes,
    table: Arc<SummedArea>,
}

/// Unit vectors along the edges of a portal, and its outward normal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axes {
    x: Vec3,
    y: Vec3,
    out: Vec3,
}

/// The rectangle that a portal subtends from a point, in texels of its table.
#[derive(Clone, Copy, Debug)]
struct Window {
    low: [f64; 2],
    high: [f64; 2],
    /// Sum of luminance over the rectangle.
    sum: f64,
}

/// Summed-area table of luminance.
#[derive(Debug)]
struct SummedArea {
    /// Sums over all texels before each texel corner; row-major, (SIZE + 1)^2.
    sums: Vec<f64>,
    /// Prefix sums within each column, column-major.
    columns: Vec<f64>,
}

impl Portals {
    /// Compiles portals for an environment `radiance`; positions become relative to `anchor`. Tables of `previous` portals with the same
    /// axes are reused.
    pub fn new(
        portals: &[scene::Portal],
        radiance: impl Fn(Vec3) -> Rgb + Sync,
        anchor: DVec3,
        previous: &Portals,
    ) -> Portals {
        let compile = |portal: &scene::Portal| {
            let axes = Axes::of(portal)?;
            let reused =
                previous.list.iter().find(|other| other.axes == axes).map(|other| other.table.clone());
            Some(Portal {
                corner: (portal.corner - anchor).as_vec3(),
                size: [portal.edge_u.length() as f32, portal.edge_v.length() as f32],
                axes,
                table: reused.unwrap_or_else(|| Arc::new(SummedArea::new(&radiance, &axes))),
            })
        };
        Portals { list: portals.iter().filter_map(compile).collect() }
    }

    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Samples a direction from `p` through a portal; returns it with its pdf per solid angle, `None` if `p` is in front of no portal.
    pub fn sample(&self, p: Vec3, u: [f32; 2]) -> Option<(Vec3, f32)> {
        if let [only] = &self.list[..] {
            let window = only.window(p).filter(|window| window.sum > 0.0)?;
            let (at, value) = only.table.sample(&window, [f64::from(u[0]) * window.sum, f64::from(u[1])]);
            let (direction, jacobian) = only.axes.direction(at);
            let pdf = (value / window.sum * TEXELS_PER_SQUARE_RADIAN) as f32 / jacobian;
            return Some((direction, if pdf.is_finite() { pdf } else { 0.0 }));
        }
        let total = self.total(p);
        let (mut chosen, mut rest) = (None, f64::from(u[0]) * total);
        for portal in &self.list {
            let Some(window) = portal.window(p).filter(|window| window.sum > 0.0) else { continue };
            chosen = Some((portal, window));
            if rest < window.sum {
                break;
            }
            rest -= window.sum;
        }
        let (portal, window) = chosen.filter(|_| total > 0.0)?;
        let (at, _) = portal.table.sample(&window, [rest, f64::from(u[1])]);
        let (direction, _) = portal.axes.direction(at);
        // Mixture pdf over all portals that the direction passes.
        let pdf = self.mixture_pdf(p, direction, total);
        Some((direction, if pdf.is_finite() { pdf } else { 0.0 }))
    }

    /// Pdf per solid angle of [`Portals::sample`]; `None` if `p` is in front of no portal.
    pub fn pdf_solid_angle(&self, p: Vec3, direction: Vec3) -> Option<f32> {
        if let [only] = &self.list[..] {
            let window = only.window(p).filter(|window| window.sum > 0.0)?;
            return Some((only.unnormalized_pdf(&window, direction) / window.sum) as f32);
        }
        let total = self.total(p);
        (total > 0.0).then(|| self.mixture_pdf(p, direction, total))
    }

    fn total(&self, p: Vec3) -> f64 {
        self.list.iter().filter_map(|portal| portal.window(p)).map(|window| window.sum).sum()
    }

    fn mixture_pdf(&self, p: Vec3, direction: Vec3, total: f64) -> f32 {
        let pdf = |portal: &Portal| {
            portal.window(p).map_or(0.0, |window| portal.unnormalized_pdf(&window, direction))
        };
        (self.list.iter().map(pdf).sum::<f64>() / total) as f32
    }
}

/// Texels per square radian.
const TEXELS_PER_SQUARE_RADIAN: f64 = (SIZE * SIZE) as f64 / (std::f64::consts::PI * std::f64::consts::PI);

impl Portal {
    /// The rectangle that the portal subtends; `None` behind it and in its plane.
    fn window(&self, p: Vec3) -> Option<Window> {
        let to = self.corner - p;
        let depth = to.dot(self.axes.out);
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let steps = |slope: f32| {
            let at = (poly::atan2(slope, depth) * FRAC_1_PI + 0.5) * SIZE as f32;
            f64::from(at).clamp(0.0, SIZE as f64)
        };
        let first = [to.dot(self.axes.x), to.dot(self.axes.y)];
        let low = first.map(steps);
        let high = [steps(first[0] + self.size[0]), steps(first[1] + self.size[1])];
        let sum = self.table.sum(low, high);
        Some(Window { low, high, sum })
    }

    /// Unnormalised pdf per solid angle: its integral is the window's sum; 0 outside the window.
    fn unnormalized_pdf(&self, window: &Window, direction: Vec3) -> f64 {
        let Some((at, jacobian)) = self.axes.angles(direction) else { return 0.0 };
        let is_inside = (0..2).all(|k| window.low[k] <= at[k] && at[k] <= window.high[k]);
        if is_inside { self.table.texel(at) * TEXELS_PER_SQUARE_RADIAN / f64::from(jacobian) } else { 0.0 }
    }
}

impl Axes {
    fn of(portal: &scene::Portal) -> Option<Axes> {
        let x = portal.edge_u.try_normalize()?;
        let y = (portal.edge_v - x * portal.edge_v.dot(x)).try_normalize()?;
        // The outward normal is opposite to the incoming light.
        Some(Axes { x: x.as_vec3(), y: y.as_vec3(), out: -x.cross(y).as_vec3() })
    }

    /// The unit direction of two angles, in texels, and the solid angle per square radian there.
    fn direction(&self, at: [f64; 2]) -> (Vec3, f32) {
        let angle = |k: usize| ((at[k] / SIZE as f64 - 0.5) * std::f64::consts::PI) as f32;
        let ((sine_x, cosine_x), (sine_y, cosine_y)) = (poly::sin_cos(angle(0)), poly::sin_cos(angle(1)));
        let (x, y, z) = (sine_x * cosine_y, sine_y * cosine_x, cosine_x * cosine_y);
        // As in `angles`, with 1 + u^2 = 1 / cos^2: the length of (x, y, z) is that of (u, v, 1) times both cosines.
        let length = (x * x + y * y + z * z).sqrt();
        let jacobian = z / (length * length * length);
        ((self.x * x + self.y * y + self.out * z) / length, jacobian)
    }

    /// The angles of a direction, in texels, and the solid angle per square radian there; `None` for inward directions.
    ///
    /// With slopes u and v, the solid angle of du dv is (1 + u^2 + v^2)^(-3/2), and du is (1 + u^2) times the differential of the angle.
    fn angles(&self, direction: Vec3) -> Option<([f64; 2], f32)> {
        let local = [direction.dot(self.x), direction.dot(self.y), direction.dot(self.out)];
        if local[2] <= 0.0 {
            return None;
        }
        let steps = |x: f32| f64::from((poly::atan2(x, local[2]) * FRAC_1_PI + 0.5) * SIZE as f32);
        let (u, v) = (local[0] / local[2], local[1] / local[2]);
        let square = 1.0 + u * u + v * v;
        let jacobian = (1.0 + u * u) * (1.0 + v * v) / (square * square.sqrt());
        let is_usable = jacobian.is_finite() && jacobian > 0.0;
        is_usable.then_some(([steps(local[0]), steps(local[1])], jacobian))
    }
}

impl SummedArea {
    fn new(radiance: impl Fn(Vec3) -> Rgb + Sync, axes: &Axes) -> SummedArea {
        let texel = |i: usize| {
            let (column, row) = (i % SIZE, i / SIZE);
            let points = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];
            let values = points.map(|[x, y]| {
                let (direction, jacobian) = axes.direction([column as f64 + x, row as f64 + y]);
                f64::from(luminance(radiance(direction).to_array())) * f64::from(jacobian.max(0.0))
            });
            values.iter().sum::<f64>() / 4.0
        };
        let mut values: Vec<f64> = (0..SIZE * SIZE).into_par_iter().map(texel).collect();
        let least = MIN_SHARE * values.iter().sum::<f64>() / values.len() as f64;
        values.iter_mut().for_each(|value| *value = value.max(least));
        let mut sums = vec![0.0; (SIZE + 1) * (SIZE + 1)];
        for row in 0..SIZE {
            let mut of_row = 0.0;
            for column in 0..SIZE {
                of_row += values[row * SIZE + column];
                sums[(row + 1) * (SIZE + 1) + column + 1] = sums[row * (SIZE + 1) + column + 1] + of_row;
            }
        }
        let mut columns = Vec::with_capacity(SIZE * (SIZE + 1));
        for column in 0..SIZE {
            let mut sum = 0.0;
            columns.push(sum);
            for row in 0..SIZE {
                sum += values[row * SIZE + column];
                columns.push(sum);
            }
        }
        SummedArea { sums, columns }
    }

    fn corner(&self, column: usize, row: usize) -> f64 {
        self.sums[row * (SIZE + 1) + column]
    }

    fn column_prefix(&self, column: usize, row: usize) -> f64 {
        self.columns[column * (SIZE + 1) + row]
    }

    /// The sum over a column between two rows, which may be fractional.
    fn column(&self, column: usize, low: f64, high: f64) -> f64 {
        let up_to = |y: f64| {
            let row = (y as usize).min(SIZE - 1);
            let (a, b) = (self.column_prefix(column, row), self.column_prefix(column, row + 1));
            a + (b - a) * (y - row as f64)
        };
        up_to(high) - up_to(low)
    }

    /// The sum over the columns before column `x`, between two rows, which may be fractional.
    fn sum_before(&self, x: usize, low: f64, high: f64) -> f64 {
        let up_to = |y: f64| {
            let row = (y as usize).min(SIZE - 1);
            let (a, b) = (self.corner(x, row), self.corner(x, row + 1));
            a + (b - a) * (y - row as f64)
        };
        up_to(high) - up_to(low)
    }

    /// [`SummedArea::sum_before`] for a fractional `x`.
    fn integral_before(&self, x: f64, low: f64, high: f64) -> f64 {
        let column = (x as usize).min(SIZE - 1);
        self.sum_before(column, low, high) + self.column(column, low, high) * (x - column as f64)
    }

    fn sum(&self, low: [f64; 2], high: [f64; 2]) -> f64 {
        let sum =
            self.integral_before(high[0], low[1], high[1]) - self.integral_before(low[0], low[1], high[1]);
        sum.max(0.0)
    }

    /// The value of the texel at a point.
    fn texel(&self, at: [f64; 2]) -> f64 {
        let [column, row] = at.map(|x| (x as usize).min(SIZE - 1));
        self.column_prefix(column, row + 1) - self.column_prefix(column, row)
    }

    /// Samples a point of a window: the integral over the window to the left of the point is `integral`, and `u` is the fraction of the
    /// integral over the point's column. Also returns the value of the texel.
    fn sample(&self, window: &Window, [integral, u]: [f64; 2]) -> ([f64; 2], f64) {
        let Window { low, high, .. } = *window;
        let target_sum = self.integral_before(low[0], low[1], high[1]) + integral;
        let (mut first, mut last) = (low[0] as usize, (high[0] as usize).min(SIZE - 1));
        while first < last {
            let middle = (first + last).div_ceil(2);
            match self.sum_before(middle, low[1], high[1]) <= target_sum {
                true => first = middle,
                false => last = middle - 1,
            }
        }
        let column = first;
        let whole = self.column(column, low[1], high[1]);
        let t =
            if whole > 0.0 { (target_sum - self.sum_before(column, low[1], high[1])) / whole } else { 0.5 };
        let x = (column as f64 + t).clamp(low[0], high[0]);
        let target = u * whole;
        let (mut first, mut last) = (low[1] as usize, (high[1] as usize).min(SIZE - 1));
        while first < last {
            let middle = (first + last).div_ceil(2);
            match self.column(column, low[1], middle as f64) <= target {
                true => first = middle,
                false => last = middle - 1,
            }
        }
        let start = low[1].max(first as f64);
        let texel = self.texel([column as f64, first as f64]);
        let rest = target - self.column(column, low[1], start);
        let y = start + if texel > 0.0 { rest / texel } else { 0.5 };
        ([x, y.clamp(low[1], high[1])], texel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::light::{EnvironmentLight, LightSource};
    use crate::sampling::chi2::{Chi2, Random, SphericalDomain};
    use crate::scene::{Environment, ImageId};
    use crate::texture::CompiledTextures;

    fn window(corner: [f64; 3], edge_u: [f64; 3], edge_v: [f64; 3]) -> scene::Portal {
        let [corner, edge_u, edge_v] = [corner, edge_u, edge_v].map(DVec3::from_array);
        scene::Portal { name: "window".to_string(), corner, edge_u, edge_v }
    }

    /// A window in the wall x = 2 and one in the ceiling y = 3, under a sky with a bright side.
    fn room(is_image: bool) -> EnvironmentLight {
        let rgb = (0..64 * 32).flat_map(|i| {
            let (x, y) = (i % 64, i / 64);
            [if (30..34).contains(&x) && y < 16 { 30.0 } else { 0.2 + 0.02 * (i % 5) as f32 }; 3]
        });
        let image = Image::from_linear_rgb("sky", 64, 32, rgb.collect());
        let environment = match is_image {
            true => Environment::Image { image: ImageId(0), strength: 1.0, rotation_rad: 0.4 },
            false => Environment::Gradient { nadir: [0.1; 3], zenith: [1.0; 3] },
        };
        let mut light = EnvironmentLight::new(&environment, &[image], true).expect("it emits");
        let side = window([2.0, 0.5, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.5]);
        let above = window([-1.0, 3.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -2.0]);
        light.set_portals(&[flipped(side), flipped(above)], DVec3::ZERO);
        assert!(light.has_portals());
        light
    }

    /// The portal with the opposite normal.
    fn flipped(portal: scene::Portal) -> scene::Portal {
        let (edge_u, edge_v) = (portal.edge_v, portal.edge_u);
        scene::Portal { edge_u, edge_v, ..portal }
    }

    #[test]
    fn outward_normals_point_out_of_the_room() {
        let light = room(false);
        let normals: Vec<Vec3> = light.portals.list.iter().map(|portal| portal.axes.out).collect();
        assert_eq!(normals, [Vec3::X, Vec3::Y]);
    }

    #[test]
    fn directions_pass_chi_square() {
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        for (is_image, p) in [(false, [1.7, 0.9, 1.4]), (true, [0.0, 0.3, 0.2]), (true, [-0.5, 2.6, -0.3])] {
            let (light, p) = (room(is_image), Vec3::from_array(p));
            Chi2::new(&format!("portals {is_image} {p}"), 1).assert_directions(
                &SphericalDomain::sphere(),
                |u| Some(LightSource::sample(&light, &textures, p, [u[0], u[1]]).wi),
                |d| LightSource::pdf_solid_angle(&light, p, d),
            );
        }
    }

    #[test]
    fn samples_pass_a_portal_and_match_their_pdf() {
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let light = room(true);
        let mut random = Random::new(3);
        let mut differ = 0;
        for _ in 0..20_000 {
            let p = Vec3::new(1.8 * random.next(), 2.8 * random.next(), 2.0 * random.next());
            let sample = LightSource::sample(&light, &textures, p, [random.next(), random.next()]);
            let d = sample.wi;
            let at_side = p + d * ((2.0 - p.x) / d.x);
            let at_top = p + d * ((3.0 - p.y) / d.y);
            let within = |x: f32, low: f32, high: f32| low - 1e-4 <= x && x <= high + 1e-4;
            let is_through = d.x > 0.0 && within(at_side.y, 0.5, 1.5) && within(at_side.z, 1.0, 2.5)
                || d.y > 0.0 && within(at_top.x, -1.0, 0.0) && within(at_top.z, -2.0, 0.0);
            assert!(is_through, "{p} {d}");
            // Rounding may select the adjacent texel.
            differ += u32::from(
                (sample.pdf_solid_angle / LightSource::pdf_solid_angle(&light, p, d) - 1.0).abs() > 1e-3,
            );
        }
        assert!(differ < 100, "{differ} of 20,000");
    }

    /// Radiance over pdf is nearly constant if the table resolves the environment.
    #[test]
    fn light_through_a_window_is_estimated_with_little_variance() {
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let light = room(true);
        let p = Vec3::new(0.4, 1.0, 0.5);
        let mut random = Random::new(8);
        let values: Vec<f64> = (0..50_000)
            .map(|_| {
                let sample = LightSource::sample(&light, &textures, p, [random.next(), random.next()]);
                f64::from(sample.radiance.luminance() / sample.pdf_solid_angle)
            })
            .collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        assert!(variance < 0.01 * mean * mean, "{mean} {variance}");
        // By quadrature over the portals.
        let steps = 600;
        let mut truth = 0.0;
        for portal in &light.portals.list {
            let area = f64::from(portal.size[0] * portal.size[1]) / f64::from(steps * steps);
            for k in 0..steps * steps {
                let [u, v] = [k % steps, k / steps].map(|i| (i as f32 + 0.5) / steps as f32);
                let at = portal.corner
                    + portal.axes.x * (u * portal.size[0])
                    + portal.axes.y * (v * portal.size[1]);
                let to = at - p;
                let cosine = f64::from(to.normalize().dot(portal.axes.out));
                let light = f64::from(light.radiance(to.normalize()).luminance());
                truth += light * cosine * area / f64::from(to.length_squared());
            }
        }
        assert!((mean / truth - 1.0).abs() < 2e-3, "{mean} {truth}");
    }

    #[test]
    fn points_without_a_portal_sample_the_whole_environment() {
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let light = room(true);
        let p = Vec3::new(9.0, 9.0, 0.0);
        assert!(light.portals.pdf_solid_angle(p, Vec3::X).is_none());
        for u in [[0.1, 0.3], [0.8, 0.9]] {
            assert_eq!(LightSource::sample(&light, &textures, p, u).wi, light.sample(u).direction);
        }
    }

    #[test]
    fn angles_invert_directions() {
        let axes = Axes { x: Vec3::X, y: Vec3::Y, out: Vec3::Z };
        // A pyramid with half angles of 80 degrees has the solid angle 4 asin(sin^2 80).
        let widest = f64::to_radians(80.0);
        let (mut total, n) = (0.0, 300);
        for i in 0..n * n {
            let angle = |k: i32| ((f64::from(k) + 0.5) / f64::from(n) * 2.0 - 1.0) * widest;
            let at = [i % n, i / n].map(|k| (angle(k) / std::f64::consts::PI + 0.5) * SIZE as f64);
            let (direction, density) = axes.direction(at);
            let (back, jacobian) = axes.angles(direction).expect("outwards");
            assert!((0..2).all(|k| (back[k] - at[k]).abs() < 2e-2), "{at:?} {back:?}");
            assert!((density / jacobian - 1.0).abs() < 1e-3, "{density} {jacobian}");
            total += f64::from(jacobian) * (2.0 * widest / f64::from(n)).powi(2);
        }
        let truth = 4.0 * widest.sin().powi(2).asin();
        assert!((total / truth - 1.0).abs() < 1e-4, "{total} {truth}");
    }
}
