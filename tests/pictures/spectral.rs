//! Spectral rendering against closed forms, and against RGB rendering where both agree.

use crate::support::{camera, gltf_glass, material, options, pbr, quad, sphere, walls};
use oscura::color::spectral::{Curve, rgb_of};
use oscura::compile::{CompileOptions, compile};
use oscura::math::DVec3;
use oscura::render::{Caustics, PassOutcome, RenderOptions, Rendering};
use oscura::scene::{
    Beam, ColorSlot, EmitterTraits, Environment, FloatSlot, FresnelModel, Iridescence, Material, Model,
    PbrMaterial, Projection, Scene, ShadingModel, Texture, TextureId,
};
use std::path::Path;
use std::sync::Arc;

/// The pixels of a picture.
pub fn pixels(scene: &Scene, options: &RenderOptions, spectral: bool) -> Vec<[f32; 4]> {
    let shading = ShadingModel { spectral, ..ShadingModel::default() };
    let (compiled, _) =
        compile(scene, &CompileOptions { shading, ..CompileOptions::default() }).expect("compiles");
    let mut rendering = Rendering::new(compiled, &scene.cameras[0], *options).expect("the film fits");
    assert_eq!(rendering.run(), PassOutcome::Done);
    assert_eq!(rendering.statistics().invalid_samples, 0);
    rendering.into_picture().into_film().rgba()
}

/// Means by channel over some seeds, each with its standard error.
pub fn means(scene: &Scene, options: &RenderOptions, spectral: bool, seeds: u32) -> [(f64, f64); 3] {
    let of_seed = |seed: u32| {
        let pixels = pixels(scene, &options.seed(seed * 7919 + 3), spectral);
        [0, 1, 2].map(|c| pixels.iter().map(|p| f64::from(p[c])).sum::<f64>() / pixels.len() as f64)
    };
    let all: Vec<[f64; 3]> = (0..seeds).map(of_seed).collect();
    let n = f64::from(seeds);
    [0, 1, 2].map(|c| {
        let mean = all.iter().map(|m| m[c]).sum::<f64>() / n;
        let variance = all.iter().map(|m| (m[c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    })
}

/// Close to the truth within the noise, which is small.
pub fn assert_means(what: &str, found: [(f64, f64); 3], truth: [f64; 3], precision: f64) {
    println!("{what}: {found:.5?}, truth {truth:.5?}");
    for ((mean, error), truth) in found.into_iter().zip(truth) {
        assert!(error < precision, "{what}: standard error {error}");
        assert!(
            (mean - truth).abs() < 4.5 * error + 0.1 * precision,
            "{what}: {mean} +- {error}, truth {truth}"
        );
    }
}

/// A sphere of a material in a uniform environment that fills the picture.
fn in_furnace(light: [f32; 3], of: impl FnOnce(&mut Scene) -> Material) -> Scene {
    let mut scene = Scene { environment: Environment::Constant(light), ..Scene::default() };
    let own = of(&mut scene);
    let own = material(&mut scene, own);
    sphere(&mut scene, [0.0; 3], 1.0, own);
    let mut view = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height: 0.7 };
    scene.cameras.push(view);
    scene
}

#[test]
fn white_stays_white() {
    let glass =
        Model::Dielectric { ior: 1.5, tint: ColorSlot::constant([1.0; 3]), fresnel: FresnelModel::Exact };
    let dispersive = PbrMaterial { has_volume: true, dispersion: 1.0, ..gltf_glass(0.0) };
    let bodies = [
        ("plaster", Material::lambert("white", [1.0; 3])),
        ("metal", pbr("metal", [1.0; 3], 1.0, 0.0)),
        ("glass", Material::new("glass", glass)),
        ("dispersive glass", Material::new("flint", Model::Pbr(Box::new(dispersive)))),
    ];
    for (what, body) in bodies {
        let scene = in_furnace([1.0; 3], |_| body);
        // Dispersive glass leaves single wavelengths, which are noisier.
        let precision = if what == "dispersive glass" { 1e-2 } else { 2e-3 };
        assert_means(what, means(&scene, &options(16, 64, 100), true, 8), [1.0; 3], precision);
    }
}

/// Furnace test: a convex diffuse object has the colour of its albedo in white light, however that is specified.
#[test]
fn spectral_upsampling_round_trips() {
    for color in [[0.8, 0.2, 0.1], [0.05, 0.6, 0.3], [0.9, 0.85, 0.2], [0.02, 0.03, 0.9]] {
        let truth = color.map(f64::from);
        let constant = in_furnace([1.0; 3], |_| Material::lambert("constant", color));
        assert_means("constant", means(&constant, &options(16, 64, 8), true, 8), truth, 3e-3);
        let light = in_furnace(color, |_| Material::lambert("white", [1.0; 3]));
        assert_means("light", means(&light, &options(16, 64, 8), true, 8), truth, 3e-3);
        let textured = in_furnace([1.0; 3], |scene| {
            let solid = |scene: &mut Scene| {
                scene.textures.push(Texture::Solid(color));
                TextureId(scene.textures.len() as u32 - 1)
            };
            // Two identical textures: not constant for the compiler, but the same colour.
            let (even, odd) = (solid(scene), solid(scene));
            scene.textures.push(Texture::Noise {
                kind: Default::default(),
                frequency: 1.0,
                octaves: 1,
                low: color,
                high: color.map(|c| c * 0.999),
                seed: 0,
            });
            let mapping = oscura::scene::Mapping::World;
            scene.textures.push(Texture::Checker {
                even,
                odd: TextureId(odd.0 + 1),
                cell_size: 0.3,
                mapping,
            });
            let slot = ColorSlot::texture(TextureId(scene.textures.len() as u32 - 1));
            Material::new("texture", Model::Lambert { albedo: slot })
        });
        // The upsampling table is accurate to 1e-3 on average, up to 1e-2 (bounded by its unit tests).
        assert_means("texture", means(&textured, &options(16, 64, 8), true, 8), truth, 2e-2);
    }
}

#[test]
fn measured_spectra_integrate_to_their_colour() {
    let nodes = [(400.0, 0.1), (480.0, 0.9), (530.0, 0.1), (640.0, 0.7)];
    let curve = Arc::new(Curve::reflectance(&nodes));
    let emitter_traits = Arc::new(Curve::black_body(2700.0, 1.0));
    let scene = in_furnace([1.0; 3], |scene| {
        scene.textures.push(Texture::Spectrum(curve.clone()));
        Material::new("paint", Model::Lambert { albedo: ColorSlot::texture(TextureId(0)) })
    });
    let truth = rgb_of(|nm| curve.at(nm as f32).into());
    assert_means("paint in daylight", means(&scene, &options(16, 64, 8), true, 8), truth, 3e-3);
    // A sphere inside a larger emissive one.
    let mut scene = Scene { environment: Environment::Black, ..scene };
    scene.textures.push(Texture::Spectrum(emitter_traits.clone()));
    let mut shell = Material::emitter("lamp", [1.0; 3], true);
    shell.emission.iter_mut().for_each(|e| e.radiance = ColorSlot::texture(TextureId(1)));
    let shell = material(&mut scene, shell);
    sphere(&mut scene, [0.0; 3], 9.0, shell);
    let truth = rgb_of(|nm| f64::from(curve.at(nm as f32) * emitter_traits.at(nm as f32)));
    assert_means("paint in lamplight", means(&scene, &options(16, 64, 8), true, 8), truth, 4e-3);
}

/// A grey room with all types of surfaces.
fn grey_room() -> Scene {
    let mut scene = Scene::default();
    walls(&mut scene, [1.0; 3], |scene, i| {
        material(scene, Material::lambert("wall", [[0.8, 0.5, 0.4, 0.7, 0.6, 0.3][i]; 3]))
    });
    let emitter_traits = material(&mut scene, Material::emitter("lamp", [6.0; 3], true));
    quad(&mut scene, [-0.3, 0.98, -0.3], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6], emitter_traits);
    let plastic = material(&mut scene, pbr("plastic", [0.4; 3], 0.0, 0.3));
    sphere(&mut scene, [-0.5, -0.7, -0.4], 0.3, plastic);
    let metal = material(&mut scene, pbr("metal", [0.8; 3], 1.0, 0.3));
    sphere(&mut scene, [0.2, -0.75, -0.2], 0.25, metal);
    let absorbing = PbrMaterial {
        has_volume: true,
        attenuation_color: [0.3; 3],
        attenuation_distance: 0.2,
        ..gltf_glass(0.0)
    };
    let glass = material(&mut scene, Material::new("glass", Model::Pbr(Box::new(absorbing))));
    sphere(&mut scene, [0.55, -0.8, 0.3], 0.2, glass);
    scene.cameras.push(camera(DVec3::new(-0.6, 0.2, 0.95), DVec3::new(0.0, -0.4, -0.5), DVec3::Y, 75.0));
    scene
}

#[test]
fn grey_scenes_match_rgb_rendering() {
    let scene = grey_room();
    let options = options(24, 64, 20);
    let ways = [false, true].map(|spectral| means(&scene, &options, spectral, 12));
    println!("{ways:.5?}");
    for ((rgb, rgb_error), (lanes, lanes_error)) in ways[0].into_iter().zip(ways[1]) {
        let error = (rgb_error.powi(2) + lanes_error.powi(2)).sqrt();
        assert!(error < 5e-3 * rgb, "{error}");
        assert!((rgb - lanes).abs() < 4.5 * error, "{rgb} +- {rgb_error}, {lanes} +- {lanes_error}");
    }
}

/// Beer's law by wavelength: a slab of glass of index 1 has its specified transmission colour.
#[test]
fn absorbing_solids_have_their_transmission_colour() {
    let color = [0.9, 0.4, 0.15];
    let scene = in_furnace([1.0; 3], |_| {
        let glass = PbrMaterial {
            ior: 1.0,
            has_volume: true,
            attenuation_color: color,
            attenuation_distance: 2.0,
            ..gltf_glass(0.0)
        };
        Material::new("glass", Model::Pbr(Box::new(glass)))
    });
    // Through the centre the path length is the sphere's diameter.
    let mut scene = scene;
    scene.cameras[0].projection = Projection::Orthographic { half_height: 0.005 };
    assert_means("slab", means(&scene, &options(16, 64, 20), true, 8), color.map(f64::from), 3e-3);
}

/// A thin film on a mirror at normal incidence, against the Airy formula integrated over wavelengths.
#[test]
fn thin_film_interference_agrees_with_airy() {
    let (film_ior, thickness_nm, base) = (1.4f64, 520.0f64, 0.3f64);
    let mut scene = in_furnace([1.0; 3], |_| {
        let mirror = PbrMaterial {
            base_color: ColorSlot::constant([base as f32; 3]),
            roughness: FloatSlot::constant(0.0),
            iridescence: Some(Iridescence {
                factor: FloatSlot::constant(1.0),
                ior: film_ior as f32,
                thickness_min_nm: 0.0,
                thickness_max_nm: thickness_nm as f32,
                thickness_texture: None,
            }),
            ..PbrMaterial::default()
        };
        Material::new("film", Model::Pbr(Box::new(mirror)))
    });
    scene.cameras[0].projection = Projection::Orthographic { half_height: 0.005 };
    let base_ior = (1.0 + base.sqrt()) / (1.0 - base.sqrt());
    let (r1, r2) = ((1.0 - film_ior) / (1.0 + film_ior), (film_ior - base_ior) / (film_ior + base_ior));
    let airy = |nm: f64| {
        let cross = 2.0 * r1 * r2 * (std::f64::consts::TAU * 2.0 * film_ior * thickness_nm / nm).cos();
        (r1 * r1 + r2 * r2 + cross) / (1.0 + r1 * r1 * r2 * r2 + cross)
    };
    assert_means("film", means(&scene, &options(16, 64, 20), true, 8), rgb_of(airy), 3e-3);
}

/// The direction refracted at a normal, from index `from` to `to` (Snell's law).
fn refracted(direction: DVec3, normal: DVec3, from: f64, to: f64) -> DVec3 {
    let eta = from / to;
    let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
    let cosine = -normal.dot(direction);
    let other = (1.0 - eta * eta * (1.0 - cosine * cosine)).sqrt();
    direction * eta + normal * (eta * cosine - other)
}

const SCREEN: DVec3 = DVec3::new(1.533, 0.19, 0.6155);
const ALONG: DVec3 = DVec3::new(0.408_45, 0.0, -0.912_78);

/// The prism scene with a narrow beam of one wavelength, and a camera that sees only the screen.
fn prism(nm: f64) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/prism.toml");
    let mut scene = oscura::load::load(&path, &Default::default()).expect("the scene loads").scene;
    scene.environment = Environment::Black;
    // Light from the floor onto the screen moves the centroid of blue by 1.7 mm (+- 0.3).
    for floor in scene.materials.iter_mut().filter(|m| m.name == "floor") {
        floor.model = Model::Lambert { albedo: ColorSlot::constant([0.0; 3]) };
    }
    let line = [(nm - 4.0, 0.0), (nm, 1.0), (nm + 4.0, 0.0)];
    scene.textures.push(Texture::Spectrum(Arc::new(Curve::light(&line, 1.0))));
    let texture = ColorSlot::texture(TextureId(scene.textures.len() as u32 - 1));
    for emitter_traits in scene.materials.iter_mut().filter(|m| m.emission.is_some()) {
        emitter_traits.emission.iter_mut().for_each(|e| e.radiance = texture);
        emitter_traits.emitter_traits = Some(EmitterTraits {
            beam: Beam::Grid { half_angle_rad: 0.03 },
            ..emitter_traits.emitter_traits.unwrap_or_default()
        });
    }
    let normal = ALONG.cross(DVec3::Y);
    let normal = if normal.x > 0.0 { -normal } else { normal };
    scene.cameras = vec![camera(SCREEN + normal * 0.8, SCREEN, DVec3::Y, 40.0)];
    scene
}

/// Centroid of the light on the screen, in metres from its centre.
fn centroid(scene: &Scene, options: &RenderOptions) -> f64 {
    let size = f64::from(options.width);
    let half = 0.8 * 20f64.to_radians().tan();
    let right = scene.cameras[0].world_from_camera.matrix3.x_axis.dot(ALONG).signum();
    let (mut sum, mut moment) = (0.0, 0.0);
    for (i, pixel) in pixels(scene, options, true).into_iter().enumerate() {
        let light: f64 = pixel[..3].iter().map(|&c| f64::from(c)).sum();
        let x = ((i as f64 % size + 0.5) / size * 2.0 - 1.0) * half * right;
        sum += light;
        moment += light * x;
    }
    moment / sum
}

#[test]
fn prism_disperses_by_snells_law() {
    let index = |nm: f64| {
        let inverse_square = |nm: f64| 1e6 / (nm * nm);
        let b = 0.62 / 20.0 / (inverse_square(486.1) - inverse_square(656.3));
        1.62 + b * (inverse_square(nm) - inverse_square(587.6))
    };
    let (emitter_traits, target) = (DVec3::new(-0.988, 0.2, 0.365), DVec3::new(-0.075, 0.19, -0.043));
    let edges =
        [[0.0, -0.173_205], [-0.15, 0.086_602_5], [0.15, 0.086_602_5]].map(|[x, z]| DVec3::new(x, 0.0, z));
    let hit = |from: DVec3, way: DVec3, on: DVec3, normal: DVec3| {
        from + way * ((on - from).dot(normal) / way.dot(normal))
    };
    let mut places = Vec::new();
    for nm in [440.0, 500.0, 560.0, 640.0] {
        let way = (target - emitter_traits).normalize();
        let [first, second] =
            [edges[1], edges[2]].map(|other| (other - edges[0]).cross(DVec3::Y).normalize());
        let entry = hit(emitter_traits, way, edges[0], first);
        let within = refracted(way, first, 1.0, index(nm));
        let exit = hit(entry, within, edges[0], second);
        let out = refracted(within, second, index(nm), 1.0);
        let place = (hit(exit, out, SCREEN, ALONG.cross(DVec3::Y)) - SCREEN).dot(ALONG);
        // Few light paths have a wavelength in so narrow a band. Means of many pictures are off by -0.29 +- 0.18, -0.24 +-
        // 0.15, 0.00 +- 0.18 and 0.02 +- 0.41 mm, of which the beam's width makes -0.2 to -0.1.
        let found = centroid(&prism(nm), &options(256, 32, 8).caustics(Caustics::On));
        println!("{nm} nm: {found:.4} m, by Snell's law {place:.4} m");
        assert!((found - place).abs() < 2e-3, "{nm} nm: {found} {place}");
        places.push(place);
    }
    // Blue is refracted most, and the lines are centimetres apart.
    assert!(places.windows(2).all(|p| (p[0] - p[1]).abs() > 0.01), "{places:?}");
}

/// The same picture at any number of threads and CPU level.
#[test]
fn spectral_rendering_is_deterministic() {
    let scene = prism(520.0);
    let options = options(24, 16, 8);
    let bits = |threads| {
        let picture =
            oscura::render::in_pool(Some(threads), || pixels(&scene, &options, true)).expect("threads");
        picture.into_iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>()
    };
    assert!(bits(1) == bits(3));
}
