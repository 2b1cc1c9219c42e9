//! Light passes and light groups, which add up to the beauty pass, and Cryptomatte coverage.

use crate::support::{camera, material, quad, sphere, walls};
use oscura::Renderer;
use oscura::film::{Aov, AovSet, Film, Source, matte_id};
use oscura::math::DVec3;
use oscura::render::{Caustics, PathReuse, in_pool};
use oscura::scene::{
    AlphaMode, ColorSlot, Environment, Filter, FloatSlot, FresnelModel, Light, Material, Model, PbrMaterial,
    Scene, Sheen,
};
use oscura::simd::{Level, limit_level};

const SHARED: &str = "4x4/2";

fn pbr(color: [f32; 3], metallic: f32, roughness: f32) -> PbrMaterial {
    PbrMaterial {
        base_color: ColorSlot::constant(color),
        metallic: FloatSlot::constant(metallic),
        roughness: FloatSlot::constant(roughness),
        ..PbrMaterial::default()
    }
}

fn glass() -> Model {
    Model::Dielectric { ior: 1.5, tint: ColorSlot::constant([1.0, 0.9, 0.9]), fresnel: FresnelModel::Exact }
}

/// A room with a window and all types of surfaces, with lights of three groups and of none.
fn room() -> Scene {
    let mut scene = Scene { environment: Environment::Constant([0.3, 0.4, 0.6]), ..Scene::default() };
    scene.environment_group = "sky".into();
    let plastic = Material::gltf("plastic", pbr([0.2, 0.7, 0.3], 0.0, 0.3));
    let metal = Material::gltf("half metal", pbr([0.8, 0.7, 0.6], 0.5, 0.4));
    let surfaces = [
        Material::lambert("red", [0.8, 0.2, 0.1]),
        plastic.clone(),
        metal,
        Material::lambert("white", [0.8; 3]),
        plastic,
        Material::lambert("green", [0.1, 0.7, 0.2]),
    ];
    walls(&mut scene, [1.0; 3], |scene, i| material(scene, surfaces[i].clone()));
    // The window.
    scene.quads.remove(3);
    let clear = material(&mut scene, Material::new("glass", glass()));
    sphere(&mut scene, [0.4, -0.6, 0.1], 0.25, clear);
    let mut cloth = pbr([0.5, 0.2, 0.5], 0.0, 0.8);
    cloth.sheen = Some(Sheen { color: ColorSlot::constant([0.5; 3]), roughness: FloatSlot::constant(0.4) });
    let cloth = material(&mut scene, Material::gltf("cloth", cloth));
    sphere(&mut scene, [-0.5, -0.7, -0.3], 0.3, cloth);
    let mut lamp = Material::emitter("lamp", [20.0, 15.0, 9.0], false);
    lamp.light_group = "lamp".into();
    let lamp = material(&mut scene, lamp);
    quad(&mut scene, [-0.3, 0.3, -0.3], [0.0, 0.0, 0.6], [0.6, 0.0, 0.0], lamp);
    let glow = material(&mut scene, Material::emitter("glow", [0.5, 1.0, 2.0], true));
    sphere(&mut scene, [-0.2, 0.0, -0.2], 0.1, glow);
    let frosted = Model::Glass {
        ior: 1.5,
        tint: ColorSlot::constant([0.8; 3]),
        roughness: FloatSlot::constant(0.5),
        is_thin: true,
    };
    let frosted = material(&mut scene, Material::new("frosted", frosted));
    quad(&mut scene, [0.1, 0.0, -0.3], [0.5, 0.0, 0.0], [0.0, 0.6, 0.0], frosted);
    let mut bulb = Light::point([0.8, 0.0, 0.8], [0.2, 0.1, 0.1]);
    bulb.group = "bulb".into();
    scene.lights.push(bulb);
    let eye = DVec3::new(0.2, 0.1, 0.95);
    scene.cameras.push(camera(eye, DVec3::new(0.0, -0.1, 0.0), DVec3::Y, 80.0));
    scene
}

fn shot(scene: &Scene, samples: u32, seed: u32, reuse: &str, aovs: AovSet) -> Film {
    shot_by(scene, samples, seed, (reuse, Caustics::Auto), aovs)
}

fn shot_by(
    scene: &Scene,
    samples: u32,
    seed: u32,
    (reuse, caustics): (&str, Caustics),
    aovs: AovSet,
) -> Film {
    let picture = Renderer::new(scene.clone())
        .size(48, 48)
        .samples(samples)
        .seed(seed)
        .filter(Filter::Box)
        .aovs(aovs)
        .light_groups(true)
        .path_reuse(reuse.parse().expect("a choice"))
        .caustics(caustics)
        .render()
        .expect("it renders");
    picture.into_film()
}

fn plane(film: &Film, name: &str) -> Vec<f32> {
    film.plane(name).unwrap_or_else(|| panic!("there is no {name}")).into_floats()
}

fn passes() -> AovSet {
    AovSet::all().of(Source::PartOfColor)
}

/// Asserts that passes of these names add up to the beauty pass, and returns the mean of each.
fn assert_sum(film: &Film, layers: &[String], what: &str) -> Vec<f64> {
    let mut means = vec![0.0; layers.len()];
    for (c, component) in ["R", "G", "B"].into_iter().enumerate() {
        let planes: Vec<Vec<f32>> = layers.iter().map(|l| plane(film, &format!("{l}.{component}"))).collect();
        for (i, pixel) in film.rgba().iter().enumerate() {
            let sum: f64 = planes.iter().map(|plane| f64::from(plane[i])).sum();
            let off = (sum - f64::from(pixel[c])).abs();
            assert!(off <= 1e-5 * f64::from(pixel[c]) + 1e-9, "{what}, pixel {i}: {sum} for {}", pixel[c]);
        }
        for (mean, plane) in means.iter_mut().zip(&planes) {
            assert!(plane.iter().all(|v| *v >= 0.0), "{what}: a layer is negative");
            *mean += plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64;
        }
    }
    means
}

fn names(aovs: AovSet) -> Vec<String> {
    aovs.iter().map(|aov| aov.info().names[0].trim_end_matches(".R").to_string()).collect()
}

fn group_names(scene: &Scene) -> Vec<String> {
    scene.light_groups().iter().map(|group| format!("RGBA_{group}")).collect()
}

/// With and without path sharing; no pass is empty.
#[test]
fn passes_and_groups_add_up() {
    let scene = room();
    assert_eq!(scene.light_groups(), ["bulb", "default", "lamp", "sky"]);
    for reuse in ["off", "2x2/1", SHARED, "8x8/4"] {
        let film = shot(&scene, 16, 3, reuse, passes());
        for layers in [names(passes()), group_names(&scene)] {
            let means = assert_sum(&film, &layers, reuse);
            println!("{reuse}: {:?}", layers.iter().zip(&means).collect::<Vec<_>>());
            let empty = layers.iter().zip(&means).find(|(_, mean)| **mean <= 0.0);
            assert!(empty.is_none(), "{reuse}: {empty:?} is black");
        }
    }
}

/// Transparency, lights that rays pass, and thin glass: light belongs to the pass of the surface that scattered it.
#[test]
fn passes_add_up_behind_transparent_surfaces() {
    let mut scene = room();
    let mut paper = Material::lambert("paper", [0.7; 3]);
    (paper.alpha_mode, paper.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.4));
    let paper = material(&mut scene, paper);
    quad(&mut scene, [-0.5, -0.5, -0.2], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0], paper);
    let pane = Model::Glass {
        ior: 1.5,
        tint: ColorSlot::constant([0.9; 3]),
        roughness: FloatSlot::constant(0.0),
        is_thin: true,
    };
    let pane = material(&mut scene, Material::new("pane", pane));
    quad(&mut scene, [0.0, -0.5, 0.2], [0.5, 0.0, 0.0], [0.0, 0.9, 0.0], pane);
    let film = shot(&scene, 16, 3, "off", passes());
    assert_sum(&film, &names(passes()), "passes");
    assert_sum(&film, &group_names(&scene), "groups");
}

/// Each pass has the same mean with and without path sharing.
#[test]
#[ignore = "means of many pictures, which take long"]
fn path_sharing_keeps_the_mean_of_passes() {
    const SEEDS: u32 = 24;
    let scene = room();
    let layers: Vec<String> = names(passes()).into_iter().chain(group_names(&scene)).collect();
    let means = |reuse: &str, seed: u32| -> Vec<f64> {
        let film = shot(&scene, 16, 1 + 7919 * seed, reuse, passes());
        let mean = |layer: &String| {
            let green = plane(&film, &format!("{layer}.G"));
            green.iter().map(|v| f64::from(*v)).sum::<f64>() / green.len() as f64
        };
        layers.iter().map(mean).collect()
    };
    let differences: Vec<Vec<f64>> = (0..SEEDS)
        .map(|seed| means(SHARED, seed).iter().zip(means("off", seed)).map(|(on, off)| on - off).collect())
        .collect();
    let typical = means("off", 0);
    for (i, layer) in layers.iter().enumerate() {
        let values: Vec<f64> = differences.iter().map(|d| d[i]).collect();
        let n = f64::from(SEEDS);
        let mean = values.iter().sum::<f64>() / n;
        let error = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
        println!("{layer}: {mean:.1e} +- {error:.1e} of {:.4}", typical[i]);
        // Student's t with 23 degrees of freedom: one of 12 exceeds it by chance once in 500.
        assert!(mean.abs() <= 4.0 * error + 1e-9, "{layer}: {mean} +- {error}");
        assert!(error < 0.03 * typical[i].max(1e-3), "{layer}: the error {error} can't tell");
    }
}

/// Weighting light groups in post equals rendering with weighted lights: with the same selection probabilities all paths are the
/// same, up to rounding.
#[test]
fn relighting_matches_rendering() {
    let scene = room();
    let luminance = |[r, g, b]: [f32; 3]| 0.212_639 * r + 0.715_169 * g + 0.072_192 * b;
    // Of the same luminance once they are applied to a light of this colour.
    let weights = |color: [f32; 3]| {
        let trial: [f32; 3] = [2.0, 0.7, 0.4];
        let weighted: [f32; 3] = std::array::from_fn(|c| trial[c] * color[c]);
        trial.map(|w| w * luminance(color) / luminance(weighted))
    };
    let product = |a: [f32; 3], b: [f32; 3]| -> [f32; 3] { std::array::from_fn(|c| a[c] * b[c]) };
    let [lamp, sky, bulb] = [[20.0, 15.0, 9.0], [0.3, 0.4, 0.6], [0.2, 0.1, 0.1]].map(weights);
    let mut other = scene.clone();
    let lamp_material = other.materials.iter_mut().find(|m| m.name == "lamp").expect("the lamp");
    let emission = lamp_material.emission.as_mut().expect("it emits");
    emission.radiance.factor = product(emission.radiance.factor, lamp);
    other.environment = Environment::Constant(product([0.3, 0.4, 0.6], sky));
    other.lights[0].intensity = product(other.lights[0].intensity, bulb);
    for reuse in ["off", SHARED] {
        // Light tracing from lights of other colours takes other paths.
        let way = (reuse, Caustics::Off);
        let film = shot_by(&scene, 16, 5, way, AovSet::NONE);
        let relit = shot_by(&other, 16, 5, way, AovSet::NONE);
        let groups = [("lamp", lamp), ("sky", sky), ("bulb", bulb), ("default", [1.0; 3])];
        let (mut worst, mut changed) = (0.0f64, 0.0f64);
        for (c, component) in ["R", "G", "B"].into_iter().enumerate() {
            let planes = groups.map(|(name, w)| (plane(&film, &format!("RGBA_{name}.{component}")), w[c]));
            for (i, (pixel, before)) in relit.rgba().iter().zip(film.rgba()).enumerate() {
                let sum: f64 = planes.iter().map(|(plane, w)| f64::from(plane[i]) * f64::from(*w)).sum();
                let rendered = f64::from(pixel[c]);
                worst = worst.max((sum - rendered).abs() / rendered.max(1e-4));
                changed = changed.max((f64::from(before[c]) - rendered).abs() / rendered.max(1e-4));
            }
        }
        println!("{reuse}: off by {worst:.1e}, changed by {changed:.2}");
        assert!(worst < 1e-4, "{reuse}: {worst}");
        assert!(changed > 0.5, "{reuse}: the weights change nothing");
    }
}

fn bits(film: &Film) -> Vec<u32> {
    film.planes().flat_map(|plane| plane.values.into_floats()).map(f32::to_bits).collect()
}

#[test]
fn passes_are_deterministic_and_keep_the_picture() {
    let scene = room();
    for reuse in ["off", SHARED] {
        let with =
            |threads| in_pool(Some(threads), || shot(&scene, 5, 1, reuse, AovSet::all())).expect("threads");
        let one = with(1);
        assert!(bits(&one) == bits(&with(3)), "{reuse}: threads");
        for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
            limit_level(level);
            assert!(bits(&one) == bits(&with(2)), "{reuse}: {}", level.name());
        }
        limit_level(Level::HIGHEST);
        let plain = Renderer::new(scene.clone()).size(48, 48).samples(5).seed(1).filter(Filter::Box);
        let plain =
            plain.path_reuse(reuse.parse::<PathReuse>().expect("a choice")).render().expect("renders");
        assert_eq!(plain.film().rgba(), one.rgba(), "{reuse}");
    }
}

/// A light in a mirror or behind a pane belongs to the direct passes; seen by the camera it is emission.
#[test]
fn passes_classify_light_paths() {
    let shiny =
        Model::SchlickMetal { color: ColorSlot::constant([0.9; 3]), roughness: FloatSlot::constant(0.0) };
    let pane = Model::Glass {
        ior: 1.0,
        tint: ColorSlot::constant([0.5; 3]),
        roughness: FloatSlot::constant(0.0),
        is_thin: true,
    };
    let cases = [
        ("mirror", Some(shiny), 2.0, Aov::GlossyDirect),
        ("pane", Some(pane), -2.0, Aov::TransmissionDirect),
        ("lamp", None, -2.0, Aov::Emission),
    ];
    for (name, model, side, expected) in cases {
        let mut scene = Scene::default();
        if let Some(model) = model {
            let front = material(&mut scene, Material::new(name, model));
            quad(&mut scene, [-3.0, -3.0, 0.0], [6.0, 0.0, 0.0], [0.0, 6.0, 0.0], front);
        }
        // Behind the camera, or occluded.
        let lamp = material(&mut scene, Material::emitter("lamp", [1.0; 3], true));
        quad(&mut scene, [-50.0, -50.0, side], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0], lamp);
        scene.cameras.push(camera(DVec3::new(0.0, 0.0, 1.0), DVec3::ZERO, DVec3::Y, 40.0));
        let film = shot(&scene, 4, 1, "off", passes());
        for aov in passes().iter() {
            let green = plane(&film, aov.info().names[1]);
            match aov == expected {
                true => assert!(green.iter().all(|v| *v > 0.3), "{name}: {aov:?}"),
                false => assert!(green.iter().all(|v| *v == 0.0), "{name}: {aov:?}"),
            }
        }
    }
}

/// First hits: colours, roughness, texture coordinates, facing.
#[test]
fn first_hit_passes() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let plastic = material(&mut scene, Material::gltf("plastic", pbr([0.2, 0.6, 0.4], 0.0, 0.5)));
    scene.shapes.clear();
    quad(&mut scene, [-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], plastic);
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, 30.0));
    let film = shot(&scene, 4, 1, "off", AovSet::all());
    let middle = 24 * 48 + 24;
    let at = |name: &str| plane(&film, name)[middle];
    assert_eq!([at("DiffCol.R"), at("DiffCol.G"), at("DiffCol.B")], [0.2, 0.6, 0.4]);
    assert!((at("GlossCol.G") - 0.04).abs() < 1e-6 && at("TransCol.G") == 0.0);
    assert!((at("roughness.V") - 0.5).abs() < 1e-6);
    assert!(at("facing.V") > 0.999 && at("Ng.Z") == 1.0);
    assert!((at("UV.U") - 0.5).abs() < 0.03 && (at("UV.V") - 0.5).abs() < 0.03);
    assert!(plane(&film, "UV.U")[middle + 5] > at("UV.U"));
    assert_eq!((at("object.id"), at("material.id")), (1.0, 1.0));
}

/// The ids of a matte in a pixel with their coverage.
fn ranks(film: &Film, kind: &str, pixel: usize) -> Vec<(u32, f32)> {
    let level = |i: usize| {
        let [id, share] = [["R", "G"], ["B", "A"]][i % 2].map(|c| format!("{kind}{:02}.{c}", i / 2));
        (plane(film, &id)[pixel].to_bits(), plane(film, &share)[pixel])
    };
    (0..6).map(level).filter(|(_, share)| *share > 0.0).collect()
}

/// A sheet of partial alpha over a floor: coverage is the fraction of samples that see each.
#[test]
fn mattes_hold_coverage() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let floor = material(&mut scene, Material::lambert("floor", [0.5; 3]));
    quad(&mut scene, [-9.0, -9.0, -1.0], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], floor);
    let mut paper = Material::lambert("paper", [0.7; 3]);
    (paper.alpha_mode, paper.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.25));
    let paper = material(&mut scene, paper);
    quad(&mut scene, [-9.0, -9.0, 0.0], [9.0, 0.0, 0.0], [0.0, 18.0, 0.0], paper);
    scene.quads[0].name = "room/floor".into();
    scene.quads[1].name = "room/desk/sheet".into();
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, 30.0));
    let film = shot(&scene, 64, 1, "off", AovSet::all());
    let (left, right) = (24 * 48 + 10, 24 * 48 + 40);
    let share_of = |kind: &str, pixel: usize, name: &str| {
        ranks(&film, kind, pixel).into_iter().find(|(id, _)| *id == matte_id(name)).map_or(0.0, |(_, s)| s)
    };
    assert_eq!(ranks(&film, "CryptoObject", right), [(matte_id("floor"), 1.0)]);
    for kind in [("CryptoObject", "sheet", "floor"), ("CryptoMaterial", "paper", "floor")] {
        let (above, below) = (share_of(kind.0, left, kind.1), share_of(kind.0, left, kind.2));
        assert!((above - 0.25).abs() < 0.17 && (above + below - 1.0).abs() < 1e-6, "{above} {below}");
    }
    // 48 x 22 pixels of 64 samples each.
    let pixels = (0..48).flat_map(|y| (0..22).map(move |x| y * 48 + x));
    let mean = pixels.map(|p| share_of("CryptoObject", p, "sheet")).sum::<f32>() / (48.0 * 22.0);
    assert!((mean - 0.25).abs() < 0.01, "{mean}");
    assert_eq!(ranks(&film, "CryptoAsset", left), [(matte_id("room"), 1.0)]);
}

/// Denoising guides look through mirrors and glass, while first-hit AOVs don't; requesting them leaves the picture unchanged.
#[test]
fn denoising_guides_follow_mirrors() {
    const WALL: [f32; 3] = [0.6, 0.4, 0.2];
    let clear =
        Model::Dielectric { ior: 1.5, tint: ColorSlot::constant([1.0; 3]), fresnel: FresnelModel::Exact };
    let mirror = Model::SchlickMetal {
        color: ColorSlot::constant([0.9, 0.8, 0.7]),
        roughness: FloatSlot::constant(0.0),
    };
    let guides = AovSet::from([Aov::DenoisingAlbedo, Aov::DenoisingNormal]);
    for wall_model in ["lambert", "gltf"] {
        for (name, model) in
            [("mirror", Some(mirror.clone())), ("glass", Some(clear.clone())), ("none", None)]
        {
            let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
            let wall = match wall_model {
                "lambert" => Material::lambert("wall", WALL),
                _ => Material::gltf("wall", pbr(WALL, 1.0, 0.5)),
            };
            let wall = material(&mut scene, wall);
            // Behind the camera for the mirror, behind the glass sphere otherwise.
            let z = if name == "mirror" { 9.0 } else { -9.0 };
            quad(&mut scene, [-90.0, -90.0, z], [180.0, 0.0, 0.0], [0.0, 180.0, 0.0], wall);
            if let Some(model) = model {
                let own = material(&mut scene, Material::new(name, model));
                match name {
                    "mirror" => {
                        quad(&mut scene, [-3.0, -3.0, 0.0], [6.0, 0.0, 0.0], [0.0, 6.0, 0.0], own);
                    }
                    _ => sphere(&mut scene, [0.0; 3], 1.0, own),
                }
            }
            scene.cameras.push(camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 10.0));
            for reuse in ["off", SHARED] {
                let film = shot(&scene, 64, 1, reuse, guides.with(Aov::Albedo).with(Aov::Normal));
                let middle = |names: &[&str; 3]| names.map(|name| plane(&film, name)[24 * 48 + 24]);
                let albedo = middle(&["denoising_albedo.R", "denoising_albedo.G", "denoising_albedo.B"]);
                let normal = middle(&["denoising_normal.X", "denoising_normal.Y", "denoising_normal.Z"]);
                let (first, first_normal) =
                    (middle(&["albedo.R", "albedo.G", "albedo.B"]), middle(&["N.X", "N.Y", "N.Z"]));
                let (expected, own, facing) = match name {
                    "mirror" => ([0.54, 0.32, 0.14], [0.9, 0.8, 0.7], -1.0),
                    "glass" => ([1.0; 3], [1.0; 3], 1.0),
                    _ => (WALL, WALL, 1.0),
                };
                let context = format!("{name} before {wall_model}, {reuse}: {albedo:?} {normal:?} {first:?}");
                assert!((0..3).all(|c| (albedo[c] - expected[c]).abs() < 1e-5), "{context}");
                assert!((normal[2] - facing).abs() < 1e-2, "{context}");
                assert!((0..3).all(|c| (first[c] - own[c]).abs() < 1e-5), "{context}");
                assert!((first_normal[2] - 1.0).abs() < 1e-2, "{context}");
                let without = shot(&scene, 64, 1, reuse, AovSet::NONE);
                assert!(without.rgba() == film.rgba(), "{name} before {wall_model}, {reuse}");
            }
        }
    }
}

/// Denoised pictures are closer to the converged one, and contain only the requested passes.
#[test]
fn renderer_denoises_and_keeps_requested_passes() {
    let scene = std::sync::Arc::new(room().into());
    let render = |samples, denoise| {
        let renderer = Renderer::shared(std::sync::Arc::clone(&scene)).size(48, 48).samples(samples);
        renderer.aovs([Aov::Depth, Aov::DenoisingAlbedo]).denoise(denoise).render().expect("it renders")
    };
    let [exact, noisy, clean] = [(1024, false), (8, false), (8, true)].map(|(n, denoise)| render(n, denoise));
    let error = |picture: &oscura::Picture| {
        let pairs = picture.film().rgba().into_iter().zip(exact.film().rgba());
        pairs.map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs().min(1.0)).sum::<f32>()).sum::<f32>()
    };
    assert!(error(&clean) < 0.6 * error(&noisy), "{} {}", error(&clean), error(&noisy));
    let has = |aov| clean.film().aov(aov).is_some();
    assert!(has(Aov::Depth) && has(Aov::DenoisingAlbedo) && !has(Aov::DenoisingNormal));
}
