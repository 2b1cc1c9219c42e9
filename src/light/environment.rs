//! The environment light: a constant, a gradient or an equirectangular image (HDRI).

use super::portals::Portals;
use super::traits::{LightBounds, LightSample, LightSource};
use crate::color::{Rgb, luminance};
use crate::image::Image;
use crate::math::{DVec3, Vec3, Vec4, poly};
use crate::sampling::{BilinearDistribution, DistributionSample, DistributionSamples, warp};
use crate::scene::{self, Environment};
use crate::simd::{Table, prefer_huge_pages};
use crate::texture::CompiledTextures;
use std::f32::consts::{FRAC_1_PI, PI};

/// Minimum sine of the angle to the poles, which keeps pdfs finite.
const MIN_SIN: f32 = 1e-6;

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentSample {
    /// Direction to the light, unit length.
    pub direction: Vec3,
    /// Radiance from that direction.
    pub radiance: Rgb,
    /// Pdf per solid angle; 0 (by rounding, at the edge of the pdf's support) for no contribution.
    pub pdf_solid_angle: f32,
}

/// A compiled environment.
#[derive(Clone, Debug)]
pub struct EnvironmentLight {
    kind: EnvironmentKind,
    pub(super) portals: Portals,
    /// Is light sampling enabled?
    is_sampled: bool,
    /// Are constant and gradient skies light-sampled, too, because shadow rays and scattered rays see different objects?
    needs_shadow_rays: bool,
}

#[derive(Clone, Debug)]
enum EnvironmentKind {
    Constant(Rgb),
    /// Radiance is `horizon + slope * y`.
    Gradient {
        horizon: Rgb,
        slope: Rgb,
    },
    Image(Box<ImageMap>),
}

/// An equirectangular image and its sampling distribution.
#[derive(Clone, Debug)]
pub struct ImageMap {
    width: usize,
    height: usize,
    /// Per texel: linear RGB times the strength, and the sampling pdf over the unit square. Row-major from the top; padded by the first
    /// texel of each row and by a copy of the last row, so that all texels have right and lower neighbours.
    texels: Vec<Vec4>,
    mean_luminance: f32,
    map: BilinearDistribution,
    /// Sine and cosine of the rotation.
    sine: f32,
    cosine: f32,
}

/// Bilinear lookup position.
#[derive(Clone, Copy, Debug)]
pub struct TexelPosition {
    /// Index of the upper left of four texels.
    pub first: u32,
    /// Bilinear weights of the right and of the lower texels, 0 to 1.
    pub weights: [f32; 2],
}

impl EnvironmentLight {
    /// Memory of the image, bytes; 0 for other environments.
    pub fn bytes(&self) -> usize {
        match &self.kind {
            EnvironmentKind::Constant(_) | EnvironmentKind::Gradient { .. } => 0,
            EnvironmentKind::Image(image) => size_of_val(&image.texels[..]) + image.map.bytes(),
        }
    }

    /// Compiles an environment; `None` for a black one. `images` are the scene's; missing images, and negative and non-finite texels,
    /// count as black.
    ///
    /// `mis_compensation` subtracts the mean from the sampling distribution (Karlík, Šik, Vévoda, Skřivan, Křivánek 2019, "MIS
    /// Compensation"): less noise in combination with BSDF sampling by MIS, but biased without. Ignored for images of constant luminance.
    pub fn new(
        environment: &Environment,
        images: &[Image],
        mis_compensation: bool,
    ) -> Option<EnvironmentLight> {
        let kind = match *environment {
            Environment::Black => return None,
            Environment::Constant(c) => EnvironmentKind::Constant(Rgb::from_array(c)),
            Environment::Gradient { nadir, zenith } => {
                let (nadir, zenith) = (Rgb::from_array(nadir), Rgb::from_array(zenith));
                EnvironmentKind::Gradient { horizon: (nadir + zenith) * 0.5, slope: (zenith - nadir) * 0.5 }
            }
            Environment::Image { image, strength, rotation_rad } => {
                let image = images.get(image.index())?;
                EnvironmentKind::Image(Box::new(ImageMap::new(
                    image,
                    strength,
                    rotation_rad,
                    mis_compensation,
                )?))
            }
        };
        match &kind {
            EnvironmentKind::Constant(c) if *c == Rgb::ZERO => None,
            EnvironmentKind::Gradient { horizon, slope } if *horizon == Rgb::ZERO && *slope == Rgb::ZERO => {
                None
            }
            _ => Some(EnvironmentLight {
                kind,
                portals: Portals::default(),
                is_sampled: true,
                needs_shadow_rays: false,
            }),
        }
    }

    /// Radiance from a unit direction.
    #[inline]
    pub fn radiance(&self, direction: Vec3) -> Rgb {
        match &self.kind {
            EnvironmentKind::Constant(c) => *c,
            EnvironmentKind::Gradient { horizon, slope } => *horizon + *slope * direction.y,
            EnvironmentKind::Image(map) => map.lookup(map.uv(direction)),
        }
    }

    /// Samples a direction: by luminance for images, else uniformly.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> EnvironmentSample {
        match &self.kind {
            EnvironmentKind::Image(map) => map.sample(u),
            _ => {
                let direction = warp::uniform_sphere(u);
                EnvironmentSample {
                    direction,
                    radiance: self.radiance(direction),
                    pdf_solid_angle: warp::UNIFORM_SPHERE_PDF_SOLID_ANGLE,
                }
            }
        }
    }

    /// Pdf per solid angle of [`EnvironmentLight::sample`].
    #[inline]
    pub fn pdf_solid_angle(&self, direction: Vec3) -> f32 {
        match &self.kind {
            EnvironmentKind::Image(map) => {
                map.read(&map.locate(map.uv(direction))).1 * solid_angle_density(direction)
            }
            _ => warp::UNIFORM_SPHERE_PDF_SOLID_ANGLE,
        }
    }

    /// The image, for vectorised loops; `None` for other environments.
    #[inline(always)]
    pub fn image_map(&self) -> Option<&ImageMap> {
        match &self.kind {
            EnvironmentKind::Image(map) => Some(map),
            _ => None,
        }
    }

    /// Enables sampling through portals; positions become relative to `anchor`.
    pub fn set_portals(&mut self, portals: &[scene::Portal], anchor: DVec3) {
        self.portals = Portals::new(portals, |direction| self.radiance(direction), anchor, &self.portals);
    }

    /// Enables or disables light sampling; without it, only BSDF sampling estimates the environment. `needs_shadow_rays`: shadow rays
    /// and scattered rays see different objects.
    pub fn set_sampled(&mut self, is_sampled: bool, needs_shadow_rays: bool) {
        (self.is_sampled, self.needs_shadow_rays) = (is_sampled, needs_shadow_rays);
    }

    /// Is the environment light-sampled? Constant and gradient skies are not (unless shadow rays and scattered rays see different
    /// objects): BSDF sampling has little noise, and light samples are better spent on other lights.
    #[inline(always)]
    pub fn is_sampled(&self) -> bool {
        self.is_sampled && (self.needs_shadow_rays || !self.is_constant_or_linear())
    }

    /// Is the radiance constant or linear in y, without portals?
    pub fn is_constant_or_linear(&self) -> bool {
        self.image_map().is_none() && !self.has_portals()
    }

    /// Are there portals, so that sampling depends on the receiver?
    #[inline(always)]
    pub fn has_portals(&self) -> bool {
        !self.portals.is_empty()
    }

    /// Mean luminance over all directions.
    pub fn mean_luminance(&self) -> f32 {
        match &self.kind {
            EnvironmentKind::Constant(c) => c.luminance(),
            EnvironmentKind::Gradient { horizon, .. } => horizon.luminance(),
            EnvironmentKind::Image(map) => map.mean_luminance,
        }
    }
}

impl LightSource for EnvironmentLight {
    /// Through a portal if the point is in front of one.
    #[inline]
    fn sample(&self, _textures: &CompiledTextures, reference: Vec3, u: [f32; 2]) -> LightSample {
        let portal_sample = if self.has_portals() { self.portals.sample(reference, u) } else { None };
        let s = match portal_sample {
            Some((direction, pdf_solid_angle)) => {
                EnvironmentSample { direction, radiance: self.radiance(direction), pdf_solid_angle }
            }
            None => self.sample(u),
        };
        LightSample {
            wi: s.direction,
            target: Vec3::ZERO,
            is_infinite: true,
            is_delta: false,
            radiance: s.radiance,
            pdf_solid_angle: s.pdf_solid_angle,
        }
    }

    fn pdf_solid_angle(&self, reference: Vec3, to: Vec3) -> f32 {
        let portal_pdf = self.portals.pdf_solid_angle(reference, to);
        portal_pdf.unwrap_or_else(|| self.pdf_solid_angle(to))
    }

    fn radiance(&self, _textures: &CompiledTextures, _reference: Vec3, to: Vec3) -> Rgb {
        self.radiance(to)
    }

    fn power(&self, _textures: &CompiledTextures) -> f32 {
        self.mean_luminance() * PI * PI
    }

    fn bounds(&self, _textures: &CompiledTextures) -> Option<LightBounds> {
        None
    }
}

/// Factor from a pdf over the unit square of map coordinates to a pdf per solid angle: the Jacobian at a direction.
#[inline(always)]
pub fn solid_angle_density(direction: Vec3) -> f32 {
    let sine = (direction.x * direction.x + direction.z * direction.z).sqrt();
    FRAC_1_PI * FRAC_1_PI * 0.5 / if sine > MIN_SIN { sine } else { MIN_SIN }
}

impl ImageMap {
    fn new(image: &Image, strength: f32, rotation_rad: f64, mis_compensation: bool) -> Option<ImageMap> {
        let (width, height) = (image.width as usize, image.height as usize);
        let clean = |v: f32| if v.is_finite() { (v * strength).clamp(0.0, f32::MAX) } else { 0.0 };
        let texels: Vec<[f32; 3]> = (0..image.height)
            .flat_map(|y| (0..image.width).map(move |x| (x, y)))
            .map(|(x, y)| {
                let [r, g, b, _] = image.rgba(x, y);
                [clean(r), clean(g), clean(b)]
            })
            .collect();
        let mut light: Vec<f32> = texels.iter().map(|&t| luminance(t)).collect();
        if !light.iter().any(|&l| l > 0.0) {
            return None;
        }
        let mean = mean_luminance(width, &texels) as f32;
        if mis_compensation {
            // The threshold excludes rounding residues of constant images.
            let brighter: Vec<f32> = light.iter().map(|l| (l - mean).max(0.0)).collect();
            if brighter.iter().any(|&l| l > 1e-4 * mean) {
                light = brighter;
            }
        }
        for (y, row) in light.chunks_exact_mut(width).enumerate() {
            let sine = ((y as f64 + 0.5) / height as f64 * std::f64::consts::PI).sin() as f32;
            row.iter_mut().for_each(|l| *l *= sine);
        }
        let map = BilinearDistribution::new(width, height, &light);
        Some(ImageMap {
            width,
            height,
            texels: with_pdf(&texels, &map),
            mean_luminance: mean,
            map,
            sine: rotation_rad.sin() as f32,
            cosine: rotation_rad.cos() as f32,
        })
    }

    /// Map coordinates of a direction, both in 0..1.
    #[inline(always)]
    pub fn uv(&self, d: Vec3) -> [f32; 2] {
        // A counter-clockwise rotation of the environment, seen from above, rotates the direction clockwise.
        let x = d.x * self.cosine - d.z * self.sine;
        let z = d.x * self.sine + d.z * self.cosine;
        let sine = (d.x * d.x + d.z * d.z).sqrt();
        let u = 0.5 + poly::atan2(z, x) * (0.5 * FRAC_1_PI);
        // Arc tangent, since the arc cosine loses precision near the poles.
        [u, poly::atan2(sine, d.y) * FRAC_1_PI]
    }

    /// The direction of map coordinates.
    #[inline(always)]
    pub fn direction(&self, [u, v]: [f32; 2]) -> Vec3 {
        let (s, c) = poly::sin_cos_turns(u - 0.5);
        let (sine, y) = poly::sin_cos_turns(0.5 * v);
        let sine = if sine > MIN_SIN { sine } else { MIN_SIN };
        let (x, z) = (sine * c, sine * s);
        Vec3::new(x * self.cosine + z * self.sine, y, z * self.cosine - x * self.sine)
    }

    /// Samples map coordinates by luminance.
    #[inline(always)]
    pub fn sample_uv(&self, u: [f32; 2]) -> DistributionSample {
        self.map.sample(u)
    }

    /// [`ImageMap::sample_uv`] for many pairs of random numbers, as a structure of arrays.
    #[inline(always)]
    pub fn sample_many_uv<const N: usize>(&self, u: [[f32; N]; 2]) -> DistributionSamples<N> {
        self.map.sample_many(u)
    }

    /// Bilinear radiance at map coordinates; wraps along u, clamps along v.
    #[inline(always)]
    pub fn lookup(&self, uv: [f32; 2]) -> Rgb {
        self.read(&self.locate(uv)).0
    }

    /// The texels around map coordinates.
    #[inline(always)]
    pub fn locate(&self, [u, v]: [f32; 2]) -> TexelPosition {
        let (width, height) = (self.width as u32, self.height as u32);
        let x = u * width as f32 - 0.5;
        let x = if x < 0.0 { x + width as f32 } else { x };
        let y = v * height as f32 - 0.5;
        let y = if y > 0.0 { y } else { 0.0 };
        let (i, j) = ((x as u32).min(width - 1), (y as u32).min(height - 1));
        TexelPosition { first: j * (width + 1) + i, weights: [x - i as f32, y - j as f32] }
    }

    /// Prefetches the texels that [`ImageMap::read`] will read.
    #[inline(always)]
    pub fn prefetch(&self, first: u32) {
        let texels = Table::new(&self.texels);
        texels.prefetch(first);
        texels.prefetch(first.wrapping_add(self.width as u32 + 1));
    }

    /// Radiance, and the sampling pdf over the unit square: stored in the same texels, since lookups in different directions miss the
    /// cache.
    #[inline(always)]
    pub fn read(&self, at: &TexelPosition) -> (Rgb, f32) {
        let texels = Table::new(&self.texels);
        let (first, below, [s, t]) = (at.first, at.first + self.width as u32 + 1, at.weights);
        let (a, b, c, d) = (texels.at(first), texels.at(first + 1), texels.at(below), texels.at(below + 1));
        let (top, bottom) = (a + (b - a) * s, c + (d - c) * s);
        let rgb = (top + (bottom - top) * t).truncate();
        // The same order of operations as in `BilinearDistribution::pdf_area`, for equal bits.
        let (left, right) = (a + (c - a) * t, b + (d - b) * t);
        (Rgb::from_array(rgb.to_array()), (left + (right - left) * s).w)
    }

    fn sample(&self, u: [f32; 2]) -> EnvironmentSample {
        let chosen = self.sample_uv(u);
        let direction = self.direction(chosen.uv);
        EnvironmentSample {
            direction,
            radiance: self.lookup(chosen.uv),
            pdf_solid_angle: chosen.pdf_area * solid_angle_density(direction),
        }
    }
}

/// Texels with their sampling pdf, in the layout of [`ImageMap::texels`].
fn with_pdf(texels: &[[f32; 3]], map: &BilinearDistribution) -> Vec<Vec4> {
    let [width, height] = map.size();
    let mut all = Vec::with_capacity((width + 1) * (height + 1));
    prefer_huge_pages(&mut all);
    for y in (0..height).chain([height - 1]) {
        let (colors, densities) = (&texels[y * width..(y + 1) * width], map.row(y));
        let around = colors.iter().chain(&colors[..1]);
        all.extend(around.zip(densities).map(|(&c, &density)| Vec3::from_array(c).extend(density)));
    }
    all
}

/// Mean luminance of an equirectangular image over all directions.
fn mean_luminance(width: usize, texels: &[[f32; 3]]) -> f64 {
    let height = texels.len() / width;
    let (mut sum, mut weights) = (0.0, 0.0);
    for (y, row) in texels.chunks_exact(width).enumerate() {
        let sine = f64::from(((y as f32 + 0.5) / height as f32 * PI).sin());
        sum += sine * row.iter().map(|&t| f64::from(luminance(t))).sum::<f64>();
        weights += sine * width as f64;
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::{Chi2, Random, SphericalDomain};
    use crate::scene::ImageId;

    /// A dim sky over darker ground, with a very bright sun of one texel.
    fn sunny(width: u32, height: u32, rotation_rad: f64, mis_compensation: bool) -> EnvironmentLight {
        let mut rgb = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let sky = if y < height / 2 { 0.4 } else { 0.1 } + 0.05 * ((x % 7) as f32);
                let sun = (x, y) == (width / 3, height / 4);
                rgb.extend(if sun { [5e4, 4e4, 3e4] } else { [sky * 0.8, sky, sky * 1.3] });
            }
        }
        let image = Image::from_linear_rgb("sky", width, height, rgb);
        let environment = Environment::Image { image: ImageId(0), strength: 2.0, rotation_rad };
        EnvironmentLight::new(&environment, &[image], mis_compensation).unwrap()
    }

    /// Chi-square test in map coordinates, in which the pdf is smooth within cells.
    fn check(name: &str, light: &EnvironmentLight, rotation: f64, cells: [usize; 2]) {
        let unrotated = |d: Vec3| {
            let (s, c) = rotation.sin_cos();
            let d = d.as_dvec3();
            let (x, z) = (d.x * c - d.z * s, d.x * s + d.z * c);
            let v = d.x.hypot(d.z).atan2(d.y) / std::f64::consts::PI;
            [(0.5 + z.atan2(x) / std::f64::consts::TAU).rem_euclid(1.0), v]
        };
        Chi2::new(name, 3).cells(cells[0], cells[1]).assert(
            |u| Some(unrotated(light.sample([u[0], u[1]]).direction)),
            |[u, v]| {
                let (s, c) = ((u - 0.5) * std::f64::consts::TAU).sin_cos();
                let (sine, y) = (v * std::f64::consts::PI).sin_cos();
                let (x, z) = (sine * c, sine * s);
                let (s, c) = rotation.sin_cos();
                let d = Vec3::new((x * c + z * s) as f32, y as f32, (z * c - x * s) as f32);
                f64::from(light.pdf_solid_angle(d)) * sine * 2.0 * std::f64::consts::PI.powi(2)
            },
        );
        let mut random = Random::new(5);
        for _ in 0..100_000 {
            let s = light.sample([random.next(), random.next()]);
            let (radiance, pdf) = (light.radiance(s.direction), light.pdf_solid_angle(s.direction));
            // Next to the sun, a rounding error of 1e-7 in the coordinates changes radiance and pdf visibly.
            let relative = (s.pdf_solid_angle / pdf - 1.0).abs();
            let length = |c: Rgb| Vec3::from_array(c.to_array()).length();
            let of_radiance = length(s.radiance - radiance) / length(radiance);
            assert!((s.direction.length() - 1.0).abs() < 1e-6);
            assert!(relative < 0.02 || pdf < 1.0, "{name}: {s:?} {pdf}");
            assert!(of_radiance < 0.02 || pdf < 1.0, "{name}: {s:?} {radiance}");
        }
    }

    #[test]
    fn sunny_skies_pass_chi_square() {
        check("sunny", &sunny(64, 32, 0.0, false), 0.0, [64, 32]);
        check("sunny, rotated", &sunny(64, 32, 2.1, false), 2.1, [64, 32]);
        check("sunny, compensated", &sunny(64, 32, -0.7, true), -0.7, [64, 32]);
    }

    #[test]
    fn constant_and_gradient_pass_chi_square() {
        let gradient = Environment::Gradient { nadir: [1.0; 3], zenith: [0.5, 0.7, 1.0] };
        let light = EnvironmentLight::new(&gradient, &[], true).unwrap();
        Chi2::new("gradient", 1).assert_directions(
            &SphericalDomain::sphere(),
            |u| Some(light.sample([u[0], u[1]]).direction),
            |d| light.pdf_solid_angle(d),
        );
        assert!((light.radiance(Vec3::Y) - Rgb::new(0.5, 0.7, 1.0)).abs().max_element() < 1e-6);
        assert!((light.radiance(-Vec3::Y) - Rgb::ONE).abs().max_element() < 1e-6);
        assert!(EnvironmentLight::new(&Environment::Black, &[], true).is_none());
        assert!(EnvironmentLight::new(&Environment::Constant([0.0; 3]), &[], true).is_none());
    }

    /// Radiance over pdf is nearly constant: pdf and lookup match.
    #[test]
    fn importance_sampling_has_little_variance() {
        let light = sunny(1024, 512, 0.3, false);
        let mut random = Random::new(9);
        let (mut sum, mut squares) = (0.0, 0.0);
        let n = 100_000;
        for _ in 0..n {
            let s = light.sample([random.next(), random.next()]);
            let x = f64::from(luminance(s.radiance.to_array()) / s.pdf_solid_angle);
            sum += x;
            squares += x * x;
        }
        let mean = sum / f64::from(n);
        let relative_variance = squares / f64::from(n) / (mean * mean) - 1.0;
        assert!(relative_variance < 1e-3, "{relative_variance}");
        let exact = f64::from(light.mean_luminance()) * 4.0 * std::f64::consts::PI;
        assert!((mean / exact - 1.0).abs() < 2e-3, "{mean} {exact}");
    }

    #[test]
    fn texel_centers_follow_the_convention() {
        let mut rgb = vec![0.0; 8 * 4 * 3];
        rgb[3 * (8 + 6)] = 1.0;
        let image = Image::from_linear_rgb("one", 8, 4, rgb);
        // u = 6.5 / 8 = 0.5 + atan2(z, x) / 2 pi, v = 1.5 / 4.
        let phi = (6.5f32 / 8.0 - 0.5) * 2.0 * PI;
        let theta = 1.5f32 / 4.0 * PI;
        for turn in [0.0f64, 0.8] {
            let e = Environment::Image { image: ImageId(0), strength: 3.0, rotation_rad: turn };
            let light = EnvironmentLight::new(&e, std::slice::from_ref(&image), false).unwrap();
            // Counter-clockwise seen from above (+y towards the viewer, z down the page): from x towards -z.
            let phi = phi - turn as f32;
            let d = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            assert!((light.radiance(d).r - 3.0).abs() < 1e-5, "{turn}");
        }
    }

    #[test]
    fn stored_pdf_equals_that_of_the_map() {
        let EnvironmentLight { kind: EnvironmentKind::Image(image), .. } = sunny(64, 32, 0.3, true) else {
            panic!("an image");
        };
        let mut random = Random::new(21);
        for k in 0..10_000 {
            // Includes the edges.
            let edge = |u: f32, k: u32| if k.is_multiple_of(8) { (u * 4.0).floor() / 3.0 } else { u };
            let uv = [edge(random.next(), k), edge(random.next(), k / 8)];
            let (_, density) = image.read(&image.locate(uv));
            assert_eq!(density.to_bits(), image.map.pdf_area(uv).to_bits(), "{uv:?}");
        }
    }

    #[test]
    fn constant_images_ignore_mis_compensation() {
        let image = Image::from_linear_rgb("grey", 16, 8, vec![0.5; 16 * 8 * 3]);
        let e = Environment::Image { image: ImageId(0), strength: 1.0, rotation_rad: 0.0 };
        let light = EnvironmentLight::new(&e, &[image], true).unwrap();
        assert!(light.pdf_solid_angle(Vec3::X) > 0.05);
    }
}
