//! Wavefront path tracing (Laine, Karras, Aila 2013, "Megakernels Considered Harmful"): a few thousand paths advance together, so that
//! rays are traced in batches and loops over paths vectorise.
//!
//! A wave starts at the camera; then each bounce runs the list of `stages`, which is the place to start reading.
//!
//! Direct light is estimated by light sampling and BSDF sampling, weighted by the power heuristic (Veach 1997, section 9.2). With path
//! reuse, paths are cut into prefixes and suffixes and connected to each other at the end of the wave: see [`reuse`]. Results depend
//! only on the scene, the options and the sample (with reuse, on its group of samples), not on threads or on the grouping of samples
//! into waves.

mod caustics;
mod cells;
mod direct_light;
mod emission;
mod first_hit;
mod generate;
mod guiding;
mod interfaces;
mod interior;
mod lifted_rays;
mod light_lobes;
mod light_samples;
mod light_visibility;
mod limits;
mod medium_segment;
mod mis;
mod mixes;
mod node_graphs;
mod node_rays;
mod pane_refraction;
mod panes;
mod radiance_buffer;
mod random_walks;
mod refracted_lights;
pub mod reuse;
mod sampling;
mod scatter;
mod shading_geometry;
mod shading_groups;
mod stages;
mod surface;
mod transparency;
mod visibility;
mod volumes;
mod walk_guide;
mod wave;
mod workspace;

pub use caustics::{CausticPlan, CausticStats};
pub use cells::Grid;
pub use guiding::{BlockSamples, CellSamples, Guide, TrainedCells, TrainingSample};
pub use light_visibility::{LightSampleRecord, LightVisibility};
pub use sampling::{Block, SamplePlan};

pub use wave::WAVE;
pub use workspace::{RayCounts, Workspace};

use crate::compile::{CompiledScene, View};
use crate::film::{Aov, AovSet, AovSpace, FilterSampler, MatteIds, Source};
use crate::sampling::sampler::Dimensions;
use crate::scene::{BounceLimits, Clamp, ShadowTerminator, SkippedCaustics};
use interior::CameraInterior;
use radiance_buffer::Layers;
use reuse::Tiling;
use sampling::Purpose;
use shading_geometry::Terminator;
use shading_groups::{ShadingGroup, groups_of};
use walk_guide::RandomWalks;
use wave::{OptionalState, StateConditions};

#[derive(Clone, Debug)]
pub struct IntegratorOptions<'a> {
    /// Maximum number of bounces; with 0, only emission is visible.
    pub max_depth: u32,
    /// Maximum numbers of bounces by kind.
    pub bounces: BounceLimits,
    /// Clamping of path contributions (fireflies).
    pub clamp: Clamp,
    /// Strength of the glossy filter; 0 is off.
    pub filter_glossy: f32,
    /// Disabled caustics.
    pub skip_caustics: SkippedCaustics,
    /// Sample counts and random number sequences of pixels.
    pub plan: SamplePlan<'a>,
    /// Reconstruction filter.
    pub filter: &'a FilterSampler,
    /// Requested AOVs of first hits and light passes.
    pub aovs: AovSet,
    /// Space of position and direction AOVs.
    pub aov_space: AovSpace,
    /// Ids of the Cryptomatte AOVs.
    pub mattes: &'a MatteIds,
    /// Number of light groups recorded separately: all of the scene's or 0.
    pub light_groups: usize,
    /// Record the light on shadow catchers with and without shadow casters. Excludes path reuse and splitting.
    pub catchers: bool,
    /// Make samples transparent that see the background through clear glass.
    pub transparent_glass: bool,
    /// Correction of the shadow terminator of triangles with shading normals.
    pub terminator: ShadowTerminator,
    /// Groups of samples that reuse each other's paths, if any. Each block is then one wave and ends at region borders.
    pub reuse: Option<Tiling>,
    /// Path splitting: number of paths that continue from the first surface of each sample; a power of two, 1 with path reuse.
    pub branches: u32,
    /// Also record the baseline: estimates without path reuse and splitting.
    pub records_baseline: bool,
    /// Light tracing of caustics, if any.
    pub caustics: Option<&'a CausticPlan>,
    /// Connections of light paths contribute to a single pixel each, drawn by the filter, instead of to all pixels that it covers.
    pub single_pixel_splats: bool,
    /// Path guide, if any.
    pub guide: Option<&'a Guide>,
    /// Learned weights of light selection, if any.
    pub light_visibility: Option<&'a LightVisibility>,
    /// Record whether light samples are occluded, to learn light selection.
    pub records_light_samples: bool,
    /// Record training samples for a guide, which may be blank. Excludes path reuse and splitting.
    pub records_training: bool,
}

/// A finished sample.
#[derive(Clone, Copy, Debug)]
pub struct PathSample<'a> {
    /// Pixel index in the block, row-major.
    pub pixel: u32,
    /// Radiance, linear Rec. 709.
    pub rgb: [f32; 3],
    /// Alpha, 0 to 1: 1 if the ray hit an object, less behind clear glass.
    pub alpha: f32,
    /// Components of the requested AOVs of the first hit, if any, in the order of the table of AOVs.
    pub first_hit: Option<&'a [f32]>,
    /// Radiance of the requested light passes, then of the light groups.
    pub layers: &'a [[f32; 3]],
    /// Radiance of the baseline (without path reuse and splitting), if recorded.
    pub baseline: [f32; 3],
}

/// Traces paths through a scene.
pub struct Integrator<'a> {
    scene: &'a CompiledScene,
    view: &'a View,
    options: IntegratorOptions<'a>,
    /// Shading group of each material.
    groups: Vec<ShadingGroup>,
    /// By material: may rays pass through unscattered (alpha, visibility, one-sided)?
    may_pass_through: Vec<bool>,
    /// By material: excluded when shadow catchers are rendered without shadow casters?
    excluded: Vec<bool>,
    /// By material: `may_pass_through` or `excluded`.
    pass_through_or_excluded: Vec<bool>,
    /// Requested AOVs of first hits.
    first_hits: AovSet,
    /// Light passes and light groups recorded.
    layers: Layers,
    /// Solids around the camera.
    camera_interior: CameraInterior,
    /// Media with subsurface random walks.
    random_walks: RandomWalks,
    /// Optional path state in use.
    optional: OptionalState,
    /// Index of the scene's only light, if it has a vectorised sampler.
    only_light: Option<u32>,
    /// Prepared Sobol dimensions of the camera and of the first bounces.
    dimensions: Vec<Dimensions>,
}

/// Bounces whose Sobol dimensions are prepared in advance.
const PREPARED_BOUNCES: u32 = 32;

impl<'a> Integrator<'a> {
    pub fn new(scene: &'a CompiledScene, view: &'a View, options: IntegratorOptions<'a>) -> Integrator<'a> {
        let sets = 1 + 2 * PREPARED_BOUNCES.min(options.max_depth);
        let groups = groups_of(scene, options.filter_glossy > 0.0);
        let dimensions = (0..sets).map(Dimensions::new).collect();
        let layers = Layers::new(options.aovs, options.light_groups, options.catchers);
        let excluded = scene.materials.iter().map(|m| m.casts_on_catchers()).collect();
        let pass_through_or_excluded =
            scene.materials.iter().map(|m| m.may_pass_through() || m.casts_on_catchers()).collect();
        let may_pass_through = scene.materials.iter().map(|m| m.may_pass_through()).collect();
        Integrator {
            scene,
            view,
            groups,
            may_pass_through,
            excluded,
            pass_through_or_excluded,
            first_hits: options.aovs.of(Source::FirstHit),
            layers,
            camera_interior: CameraInterior::of(scene, view),
            random_walks: RandomWalks::of(scene),
            optional: OptionalState::of(&StateConditions {
                features: &scene.features,
                selects_by_normal: scene.lights.use_tree(),
                bounce_limits: options.bounces.limit_scattering(),
                transparent_limit: options.bounces.transparent < u32::MAX && scene.features.transparency,
                filter_glossy: options.filter_glossy > 0.0,
                skips_caustics: options.skip_caustics != SkippedCaustics::NONE,
                light_passes: layers.has_passes(),
                caustics: options.caustics.is_some(),
                path_reuse: options.reuse.is_some(),
                guiding: options.guide.is_some(),
                transparent_glass: options.transparent_glass,
                first_hits: options.aovs.of(Source::FirstHit).any(),
                denoising_guides: options.aovs.contains(Aov::DenoisingAlbedo)
                    || options.aovs.contains(Aov::DenoisingNormal),
            }),
            only_light: scene.lights.is_vectorised().then_some(0),
            options,
            dimensions,
        }
    }

    /// The shadow terminator correction in use.
    fn terminator(&self) -> Terminator {
        let has_bumps = self.scene.features.mapped_normals;
        match self.options.terminator {
            _ if !self.scene.features.bent_normals => Terminator::Sharp,
            ShadowTerminator::Soft if has_bumps => Terminator::SoftBumps,
            ShadowTerminator::Soft => Terminator::Soft,
            ShadowTerminator::Lifted if has_bumps => Terminator::SharpBumps,
            ShadowTerminator::Lifted | ShadowTerminator::Off => Terminator::Sharp,
        }
    }

    /// Do shadow rays start at the smooth surface (see [`lifted_rays`])?
    fn lifts_shadow_rays(&self) -> bool {
        self.options.terminator == ShadowTerminator::Lifted && self.scene.features.normals
    }

    fn dimensions(&self, bounce: u32, purpose: Purpose) -> Dimensions {
        let set = purpose.dimension_set(bounce);
        self.dimensions.get(set as usize).copied().unwrap_or_else(|| Dimensions::new(set))
    }
}

#[cfg(test)]
mod tests {
    use super::direct_light::{Direct, DirectParams};
    use super::light_samples::{
        EnvironmentSampler, RectangleSampler, SampleLight, VectorSampler, VerticesByLight,
    };
    use super::mis::LightPdf;
    use super::sampling::ScatterParams;
    use super::scatter::Scatter;
    use super::shading_geometry::{Soft, scattering_normal};
    use super::shading_groups::{
        GeneralClass, LambertClass, MetalRoughClass, VertexClass, prepare, store_material,
    };
    use super::wave::{Wave, get, get_rgb, set, set_rgb};
    use crate::bsdf::{Bsdf, Isotropic, Lambert, LayerFresnel, MetalRough};
    use crate::color::Rgb;
    use crate::image::Image;
    use crate::light::{
        AreaLight, AreaShape, Edges, EnvironmentLight, LightSample, LightSource, Lights, PunctualLight,
        Radiance,
    };
    use crate::math::{DVec3, Vec3};
    use crate::sampling::chi2::Random;
    use crate::sampling::sampler::{Dimensions, SobolPoint};
    use crate::scene::{self, EnergyCompensation, Environment, FresnelModel, ImageId, LightKind};
    use crate::shape::{Analytic, FacingDisk};
    use crate::simd::{Kernel, dispatch};
    use crate::texture::CompiledTextures;

    /// Number of vertices in a test.
    const COUNT: usize = 1500;

    fn color(random: &mut Random) -> Rgb {
        Rgb::new(random.next(), random.next(), random.next())
    }

    /// Random vertices with normals on the viewer's side, light samples of all kinds, and path states.
    fn random_wave(random: &mut Random) -> Box<Wave> {
        let mut wave: Box<Wave> = bytemuck::zeroed_box();
        let Wave { paths, vertices: v, .. } = &mut *wave;
        for i in 0..COUNT {
            let (ng, mut wo) = (random.direction(), random.direction());
            if wo.dot(ng) < 0.0 {
                wo = -wo;
            }
            let bent = (ng + 0.3 * random.direction()).normalize();
            let ns = scattering_normal(if i % 3 == 0 { ng } else { bent }, ng, wo);
            set(&mut v.p, i, 2.0 * random.direction());
            set(&mut v.ng, i, ng);
            set(&mut v.ns, i, ns);
            set(&mut v.wo, i, wo);
            v.offset[i] = 1e-6;
            set(&mut v.light.wi, i, random.direction());
            set(&mut v.light.target, i, 5.0 * random.direction());
            v.light.is_infinite[i] = f32::from(u8::from(i % 2 == 0));
            set_rgb(&mut v.light.radiance, i, color(random));
            v.light.pdf[i] = [
                LightPdf::NONE,
                LightPdf::delta(1.0),
                LightPdf::new(random.next()),
                LightPdf::new(10.0 * random.next()),
            ][i % 4];
            set_rgb(&mut paths.state.throughput, i, color(random));
            paths.state.roulette_scale[i] = 1.0;
            (paths.state.seed[i], paths.state.index_rev[i]) =
                SobolPoint::new(i as u32 * 747_796_405, i as u32).to_parts();
        }
        wave
    }

    fn copy(wave: &Wave) -> Box<Wave> {
        let mut other: Box<Wave> = bytemuck::zeroed_box();
        let (from, to) = (&wave.vertices, &mut other.vertices);
        (to.p, to.ng, to.ns, to.wo, to.offset) = (from.p, from.ng, from.ns, from.wo, from.offset);
        (to.light.wi, to.light.target, to.light.is_infinite) =
            (from.light.wi, from.light.target, from.light.is_infinite);
        (to.light.radiance, to.light.pdf) = (from.light.radiance, from.light.pdf);
        let (from, to) = (&wave.paths.state, &mut other.paths.state);
        (to.throughput, to.roulette_scale) = (from.throughput, from.roulette_scale);
        (to.seed, to.index_rev) = (from.seed, from.index_rev);
        other
    }

    fn assert_close(a: Rgb, b: Rgb, what: &str) {
        let (difference, size) = ((a - b).to_array(), a.max_element().max(b.max_element()));
        assert!(difference.iter().all(|d| d.abs() <= 2e-4 * size.max(1e-3)), "{what}: {a:?} {b:?}");
    }

    /// Compares the direct-light and scattering kernels of a class, at the best CPU level, with the general kernels for equal BSDFs.
    fn compare(mut wave: Box<Wave>, class: impl VertexClass + Copy, bsdfs: &[Bsdf]) {
        let mut general_wave = copy(&wave);
        let general = || GeneralClass { bsdfs, first: 0 };
        let params = DirectParams { branches: 1.0, inverse_light_samples: 1.0 };
        dispatch(Direct { correction: Soft, wave: &mut wave, class, range: 0..COUNT, params });
        Direct { correction: Soft, wave: &mut general_wave, class: general(), range: 0..COUNT, params }.run();
        let mut lit = 0;
        for i in 0..COUNT {
            let of = |w: &Wave| get_rgb(&w.vertices.light.contribution, i);
            let (own, other) = (of(&wave), of(&general_wave));
            // Directions below the shading normal only: contributions may be negative or 0.
            assert_close(own.max(Rgb::ZERO), other.max(Rgb::ZERO), &format!("contribution {i}"));
            if own.max_element() > 0.0 {
                lit += 1;
                for lanes in [|w: &Wave| w.vertices.light.origin, |w: &Wave| w.vertices.light.direction] {
                    assert_eq!(get(&lanes(&wave), i), get(&lanes(&general_wave), i), "shadow ray {i}");
                }
            }
        }
        assert!(lit > COUNT / 8, "{lit} lit");

        let params = ScatterParams { dimensions: &Dimensions::new(2), roulette: true, branches: 1.0 };
        dispatch(Scatter { correction: Soft, wave: &mut wave, class, range: 0..COUNT, params });
        Scatter { correction: Soft, wave: &mut general_wave, class: general(), range: 0..COUNT, params }
            .run();
        let (mut scattered, mut borderline) = (0, 0);
        for i in 0..COUNT {
            let pdf = |w: &Wave| w.paths.state.pdf[i];
            let (own, other) = (pdf(&wave), pdf(&general_wave));
            if own.has_ended() != other.has_ended() {
                // Rounding decides survival.
                borderline += 1;
                continue;
            }
            if own.has_ended() {
                continue;
            }
            let (own, other) = (own.value(), other.value());
            scattered += 1;
            assert!((own - other).abs() <= 5e-4 * own.max(1e-3), "pdf {i}: {own} {other}");
            let direction = |w: &Wave| get(&w.vertices.next_direction, i);
            assert!((direction(&wave) - direction(&general_wave)).length() < 1e-5, "direction {i}");
            let throughput = |w: &Wave| get_rgb(&w.paths.state.throughput, i);
            assert_close(throughput(&wave), throughput(&general_wave), &format!("throughput {i}"));
        }
        assert!(scattered > COUNT / 4 && borderline <= 2, "{scattered} scattered, {borderline} borderline");
    }

    #[test]
    fn lambert_kernels_match_the_general_ones() {
        let mut random = Random::new(3);
        let mut wave = random_wave(&mut random);
        let mut bsdfs = Vec::new();
        for i in 0..COUNT {
            let albedo = color(&mut random);
            set_rgb(&mut wave.vertices.albedo, i, albedo);
            bsdfs.push(Bsdf::Lambert(Lambert { albedo }));
        }
        compare(wave, LambertClass, &bsdfs);
    }

    #[test]
    fn gltf_kernels_match_the_general_ones() {
        let fresnels = [FresnelModel::Exact, FresnelModel::Schlick];
        let compensations = [EnergyCompensation::On, EnergyCompensation::Off];
        for fresnel in fresnels {
            let mut random = Random::new(5);
            let mut wave = random_wave(&mut random);
            let mut bsdfs = Vec::new();
            for i in 0..COUNT {
                let alpha = random.next();
                let material = MetalRough {
                    diffuse: color(&mut random),
                    layer_f0: 0.1 * color(&mut random),
                    layer_f90: random.next(),
                    layer_fresnel: LayerFresnel::new(fresnel, 1.1 + random.next()),
                    metal_f0: color(&mut random),
                    metallic: random.next(),
                    surface: Isotropic { alpha: if i % 7 == 0 { 0.0 } else { 0.05 + 0.95 * alpha } },
                    energy_compensation: compensations[i / 3 % 2],
                };
                store_material(&mut wave.vertices.metal_rough, i, &material);
                bsdfs.push(Bsdf::MetalRough(material));
            }
            prepare(&mut wave, 0..COUNT, fresnel);
            compare(wave, MetalRoughClass, &bsdfs);
        }
    }

    /// Compares the vectorised sampling of a light with scalar sampling.
    fn compare_samples(sampler: impl VectorSampler, sample: impl Fn(Vec3, [f32; 2]) -> LightSample) {
        let mut random = Random::new(7);
        let mut wave = random_wave(&mut random);
        let dimensions = &Dimensions::new(1);
        dispatch(SampleLight { wave: &mut wave, count: COUNT, dimensions, sampler });
        let lit = compare_light(&wave, |i| {
            let path = &wave.paths.state;
            let [a, b, ..] = path.sobol_point(i).sample_4d(dimensions);
            sample(get(&wave.vertices.p, i), [a, b])
        });
        assert!(lit > COUNT / 4, "{lit} lit");
    }

    /// Compares light samples with scalar ones, whose pdf includes the selection probability; returns the number of lit vertices.
    fn compare_light(wave: &Wave, one: impl Fn(usize) -> LightSample) -> usize {
        let v = &wave.vertices;
        let mut lit = 0;
        for i in 0..COUNT {
            let one = one(i);
            let (pdf, expected) = (v.light.pdf[i].value(), one.pdf_solid_angle);
            assert!((pdf - expected).abs() <= 1e-4 * expected, "pdf {i}: {pdf} {expected}");
            if expected > 0.0 {
                lit += 1;
                assert!((get(&v.light.wi, i) - one.wi).length() < 1e-5, "wi {i}");
                assert_close(get_rgb(&v.light.radiance, i), one.radiance, &format!("radiance {i}"));
                assert_eq!(v.light.is_infinite[i] > 0.0, one.is_infinite);
                if !one.is_infinite {
                    assert!((get(&v.light.target, i) - one.target).length() < 1e-5, "target {i}");
                }
            }
        }
        lit
    }

    #[test]
    fn vectorised_rectangle_samples_match_scalar_ones() {
        let edges = Edges { corner: Vec3::new(-0.5, 3.0, -0.5), edge_u: Vec3::X, edge_v: Vec3::Z };
        let radiance = Radiance::Constant(Rgb::new(3.0, 2.0, 1.0));
        let light = AreaLight::new(AreaShape::Rectangle(edges), true, radiance);
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let lights = Lights::new(vec![light], Vec::new(), None, &textures);
        let sampler = RectangleSampler::of(&lights).expect("one rectangle");
        compare_samples(sampler, |p, u| light.sample(&textures, p, u));
    }

    /// Lights of all kinds: rectangles, triangles, facing disks, spheres, an emissive texture, a sun and an image.
    fn lights_of_all_kinds(random: &mut Random) -> Lights {
        let mut area = Vec::new();
        for k in 0..20 {
            let mut vector = || Vec3::new(random.next(), random.next(), random.next());
            let (corner, color) = (vector() * 8.0 - 4.0, vector());
            let (along, across) = vector().any_orthonormal_pair();
            let (width, height) = (0.1 + random.next(), 0.1 + random.next());
            let edges = Edges { corner, edge_u: along * width, edge_v: across * height };
            let shape = match k % 4 {
                0 => AreaShape::Rectangle(edges),
                1 => AreaShape::Triangle(edges),
                2 => AreaShape::Analytic(Analytic::FacingDisk(FacingDisk { center: corner, radius: width })),
                _ => AreaShape::Parallelogram(Edges { edge_u: along * width + across * 0.1, ..edges }),
            };
            let radiance = Radiance::Constant(Rgb::new(color.x, color.y, color.z));
            area.push(AreaLight::new(shape, k % 3 == 0, radiance));
        }
        let sun = LightKind::Sun { direction: DVec3::NEG_Y, angle_rad: 0.01 };
        let sun = PunctualLight::new(&scene::Light::new(sun, [2.0; 3]), DVec3::ZERO);
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        Lights::new(area, vec![sun], random_image(random), &textures)
    }

    #[test]
    fn vectorised_samples_of_many_lights_match_scalar_ones() {
        let mut random = Random::new(29);
        let lights = lights_of_all_kinds(&mut random);
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let mut wave = random_wave(&mut random);
        for i in 0..COUNT {
            wave.vertices.light.index[i] = i as u32 % lights.len() as u32;
            wave.vertices.light.pdf_discrete[i] = if i % 5 == 0 { 0.0 } else { random.next() };
            (wave.scratch[0][i], wave.scratch[1][i]) = (random.next(), random.next());
        }
        let mut lists = VerticesByLight::default();
        let others = lists.sample(COUNT, &lights, &mut wave).to_vec();
        // Parallelograms and the sun.
        let is_other = |i: &u32| matches!(i % lights.len() as u32, 3 | 7 | 11 | 15 | 19 | 20);
        assert_eq!(others, (0..COUNT as u32).filter(is_other).collect::<Vec<_>>());
        for &i in &others {
            wave.vertices.light.pdf[i as usize] = LightPdf::new(0.0);
        }
        let lit = compare_light(&wave, |i| {
            let (v, u) = (&wave.vertices.light, [wave.scratch[0][i], wave.scratch[1][i]]);
            let sample = lights.sample(&textures, v.index[i], get(&wave.vertices.p, i), u);
            let factor = if others.contains(&(i as u32)) { 0.0 } else { v.pdf_discrete[i] };
            LightSample { pdf_solid_angle: sample.pdf_solid_angle * factor, ..sample }
        });
        assert!(lit > COUNT / 4, "{lit} lit");
    }

    /// An environment of random pixels.
    fn random_image(random: &mut Random) -> Option<EnvironmentLight> {
        let pixels: Vec<f32> = (0..32 * 16 * 3).map(|_| random.next() * random.next() * 4.0).collect();
        let image = Image::from_linear_rgb("random", 32, 16, pixels);
        let environment = Environment::Image { image: ImageId(0), rotation_rad: 0.3, strength: 2.0 };
        EnvironmentLight::new(&environment, &[image], true)
    }

    #[test]
    fn vectorised_environment_samples_match_scalar_ones() {
        let mut random = Random::new(13);
        let textures = CompiledTextures::resident(&[], &[], Vec3::ZERO);
        let lights = Lights::new(Vec::new(), Vec::new(), random_image(&mut random), &textures);
        let sampler = EnvironmentSampler::of(&lights).expect("one image environment");
        compare_samples(sampler, |p, u| lights.sample(&textures, 0, p, u));
    }

    const _: () = assert!(COUNT <= super::WAVE);
}
