//! Small seed scenes that together use everything a scene can contain.

use crate::support::{camera, disk, material, quad, sphere};
use oscura::color::spectral::Metal;
use oscura::image::{Encoding, Image, Pixels};
use oscura::math::{DAffine3, DQuat, DVec3, Vec2, Vec3};
use oscura::scene::{
    AlphaMode, Anisotropy, Aperture, Beam, Clearcoat, ColorSlot, CurveBasis, Curves, DiffuseTransmission,
    Emission, EmitterTraits, Environment, FloatSlot, FresnelModel, ImageId, Instance, Interpolation,
    Iridescence, Light, LightKind, LightProfile, Mapping, Material, MaterialId, Mesh, MeshId, MeshPart,
    Model, Motion, NoiseKind, NormalMap, ObjectTraits, PbrMaterial, Projection, Scene, Sheen, SpotFalloff,
    Texture, TextureId, TextureTransform, ThinLens, VertexAttribute, Wrap,
};
use std::sync::Arc;

/// All of them, by name.
pub fn all() -> Vec<(String, Scene)> {
    let built = [
        ("shapes", shapes()),
        ("textures", textures()),
        ("materials", materials()),
        ("layers", layers()),
        ("media", crate::media::everything()),
    ];
    built.into_iter().map(|(name, scene)| (name.to_string(), scene)).collect()
}

/// Gaussian splats among other objects.
pub fn splats() -> Vec<(String, Scene)> {
    vec![("splats".to_string(), crate::splats::busy())]
}

/// A bent sheet of 2 n x n triangles over -1..1 with all attributes, in two parts.
fn sheet(n: u32, first: MaterialId, second: MaterialId) -> Mesh {
    let share = |i: u32| i as f32 / n as f32;
    let vertices: Vec<[f32; 2]> = (0..=n).flat_map(|j| (0..=n).map(move |i| [share(i), share(j)])).collect();
    let triangles: Vec<[u32; 3]> = (0..n * n)
        .map(|k| k / n * (n + 1) + k % n)
        .flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]])
        .collect();
    let half = n * n;
    Mesh {
        name: "sheet".into(),
        positions: vertices
            .iter()
            .map(|[s, t]| [2.0 * s - 1.0, 2.0 * t - 1.0, 0.2 * (5.0 * s).sin()])
            .collect(),
        normals: vertices
            .iter()
            .map(|[s, _]| Vec3::new(-0.5 * (5.0 * s).cos(), 0.0, 1.0).normalize().into())
            .collect(),
        uv_sets: vec![vertices.clone(), vertices.iter().map(|[s, t]| [3.0 * t, 2.0 * s]).collect()],
        tangents: vec![[1.0, 0.0, 0.0, 1.0]; vertices.len()],
        colors: vertices.iter().map(|[s, t]| [*s, *t, 0.5, 0.9]).collect(),
        attributes: vec![VertexAttribute {
            name: "place".into(),
            width: 2,
            values: vertices.iter().flatten().copied().collect(),
        }],
        parts: vec![
            MeshPart { first_triangle: 0, triangle_count: half, material: first },
            MeshPart { first_triangle: half, triangle_count: half, material: second },
        ],
        triangles,
        ..Mesh::default()
    }
}

fn place(scene: &mut Scene, mesh: u32, at: DVec3, material: Option<MaterialId>, motion: Motion) {
    let world_from_object = DAffine3::from_translation(at) * DAffine3::from_rotation_y(0.3);
    scene.instances.push(Instance {
        name: "placed".into(),
        material,
        motion,
        ..Instance::new(MeshId(mesh), world_from_object)
    });
}

fn image(name: &str, width: u32, height: u32, channels: u32, encoding: Encoding, pixels: Pixels) -> Image {
    Image { name: name.into(), width, height, channels, encoding, pixels: Arc::new(pixels) }
}

/// Images of every format, and a texture of each.
fn add_images(scene: &mut Scene) {
    let numbers = |count: u32| (0..count).map(|i| (i * 7919 % 251) as u8);
    let floats = |count: u32| numbers(count).map(|v| f32::from(v) / 250.0).collect();
    scene.images = vec![
        image("bytes", 4, 3, 4, Encoding::Srgb, Pixels::U8(numbers(48).collect())),
        image(
            "words",
            3,
            2,
            2,
            Encoding::Srgb,
            Pixels::U16(numbers(12).map(|v| u16::from(v) * 200).collect()),
        ),
        image("floats", 8, 4, 3, Encoding::Linear, Pixels::F32(floats(96))),
        image("grey", 5, 1, 1, Encoding::Linear, Pixels::U8(numbers(5).collect())),
        image("dot", 1, 1, 3, Encoding::Srgb, Pixels::U8(vec![200, 100, 50])),
    ];
    let ways = [
        (Wrap::Repeat, Interpolation::Trilinear),
        (Wrap::Mirror, Interpolation::Bilinear),
        (Wrap::Clamp, Interpolation::Nearest),
    ];
    let turned =
        TextureTransform { offset: Vec2::new(0.1, 0.2), rotation_rad: 0.5, scale: Vec2::new(2.0, -1.0) };
    let mappings = [
        Mapping::default(),
        Mapping::Uv { set: 1, transform: turned },
        Mapping::Triplanar { size: 0.7 },
        Mapping::World,
    ];
    for (i, mapping) in (0..scene.images.len()).zip(mappings.into_iter().cycle()) {
        let (wrap, interpolation) = ways[i % 3];
        let image = ImageId(i as u32);
        scene.textures.push(Texture::Image {
            image,
            wrap_u: wrap,
            wrap_v: ways[(i + 1) % 3].0,
            interpolation,
            mapping,
        });
    }
}

/// Strands of both shapes that points may have, one of them of hair.
fn add_curves(scene: &mut Scene, grey: MaterialId) {
    let fibre = Model::Hair {
        color: ColorSlot::texture(TextureId(0)),
        roughness: FloatSlot::constant(0.3),
        radial_roughness: FloatSlot { factor: 0.8, texture: Some((TextureId(2), 1)) },
        ior: 1.55,
        tilt_rad: -0.04,
        coat: FloatSlot::constant(0.2),
    };
    let fibre = material(scene, Material::new("fibre", fibre));
    for (basis, material) in [(CurveBasis::BSpline, fibre), (CurveBasis::Linear, grey)] {
        let points: Vec<[f32; 3]> =
            (0..9).map(|i| [-1.0 + 0.2 * i as f32, 1.5 - 0.1 * (i % 3) as f32, 0.7]).collect();
        scene.curves.push(Curves {
            name: "strands".into(),
            basis,
            strands: vec![4, 5],
            radii: (0..9).map(|i| 0.05 * (i % 4) as f32).collect(),
            colors: points.iter().map(|p| p.map(f32::abs)).collect(),
            points,
            world_from_object: DAffine3::from_translation(DVec3::new(0.0, 0.1, 0.0)),
            material,
            traits: ObjectTraits::default(),
            info: Default::default(),
        });
    }
}

/// Shapes of all kinds, lit by all kinds of lights.
fn shapes() -> Scene {
    let mut scene = Scene { name: "shapes".into(), ..Scene::default() };
    add_images(&mut scene);
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    let mut painted = Material::new(
        "painted",
        Model::Pbr(Box::new(PbrMaterial {
            base_color: ColorSlot::texture(TextureId(0)),
            roughness: FloatSlot { factor: 0.8, texture: Some((TextureId(2), 1)) },
            ..PbrMaterial::default()
        })),
    );
    painted.normal_map = Some(NormalMap { texture: TextureId(2), scale: 0.8 });
    painted.use_vertex_colors = true;
    let painted = material(&mut scene, painted);
    let mut lattice = Material::lambert("lattice", [0.8, 0.2, 0.2]);
    (lattice.alpha_mode, lattice.alpha) =
        (AlphaMode::Mask { cutoff: 0.5 }, FloatSlot { factor: 1.0, texture: Some((TextureId(0), 3)) });
    let lattice = material(&mut scene, lattice);
    let mut veil = Material::lambert("veil", [0.2, 0.8, 0.2]);
    (veil.alpha_mode, veil.alpha, veil.double_sided) = (AlphaMode::Blend, FloatSlot::constant(0.5), false);
    let veil = material(&mut scene, veil);
    let emitter_traits = material(&mut scene, Material::emitter("lamp", [4.0; 3], true));
    let mut glow = Material::lambert("glow", [0.5; 3]);
    glow.emission = Some(Emission { radiance: ColorSlot::texture(TextureId(2)), two_sided: false });
    let glow = material(&mut scene, glow);
    scene.meshes = vec![sheet(2, painted, lattice), sheet(23, grey, painted), sheet(1, glow, emitter_traits)];
    scene.meshes[1].tangents.clear();
    place(&mut scene, 0, DVec3::ZERO, None, Motion::Still);
    place(&mut scene, 1, DVec3::new(-2.5, 0.0, -1.0), None, Motion::Moves);
    place(&mut scene, 1, DVec3::new(2.5, 0.0, -1.0), Some(grey), Motion::Deforms);
    place(&mut scene, 2, DVec3::new(0.0, 2.5, -1.0), None, Motion::Still);
    add_curves(&mut scene, grey);
    sphere(&mut scene, [-1.2, -1.0, 0.6], 0.5, grey);
    sphere(&mut scene, [1.3, 1.0, 0.4], 0.3, glow);
    disk(&mut scene, [1.2, -1.0, 0.5], [0.3, 1.0, 0.8], 0.5, veil);
    disk(&mut scene, [-1.3, 1.2, 0.5], [0.3, -1.0, 0.8], 0.4, emitter_traits);
    quad(&mut scene, [-3.0, -2.0, -2.0], [6.0, 0.0, 0.0], [0.0, 0.3, 5.0], painted);
    quad(&mut scene, [-0.5, 3.0, 1.0], [1.0, 0.0, 0.0], [0.2, -0.4, -1.0], glow);
    add_lamps(&mut scene);
    add_lights(&mut scene);
    scene.environment = Environment::Gradient { nadir: [0.1; 3], zenith: [0.3, 0.4, 0.6] };
    scene.cameras.push(camera(DVec3::new(0.3, 0.6, 6.0), DVec3::ZERO, DVec3::Y, 50.0));
    let aperture = Aperture { blades: 5, rotation_rad: 0.1, ratio: 1.5 };
    scene.cameras[0].lens = Some(ThinLens { defocus_angle_rad: 0.02, focus_distance: 5.5, aperture });
    scene
}

/// Lights that rays pass, with spread.
fn add_lamps(scene: &mut Scene) {
    let direction = DVec3::new(0.3, -1.0, -0.5).normalize();
    let (inner_angle_rad, outer_angle_rad, falloff) = (0.3, 0.7, SpotFalloff::Smooth);
    let cone = Beam::Cone { direction, inner_angle_rad, outer_angle_rad, falloff };
    let profile = scene.add_profile(Arc::new(LightProfile {
        vertical_deg: vec![0.0, 180.0],
        horizontal_deg: vec![0.0],
        values: vec![1.0, 0.2],
    }));
    let measured = Beam::Profile { profile, rotation: DQuat::IDENTITY, cone: Some([0.3, 2.0]) };
    let beams = [Beam::Lambertian, Beam::Grid { half_angle_rad: 0.6 }, cone, measured];
    for (i, beam) in beams.into_iter().enumerate() {
        let mut bulb = Material::emitter("bulb", [3.0; 3], false);
        bulb.emitter_traits = Some(EmitterTraits {
            visible_to: if i == 0 { oscura::scene::RayKinds::ALL } else { oscura::scene::RayKinds::SHADOW },
            is_obstacle: false,
            beam,
        });
        let bulb = material(scene, bulb);
        let x = i as f64 - 1.0;
        match i {
            1 => quad(scene, [x, 1.6, 1.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5], bulb),
            _ => sphere(scene, [x, 1.8, 1.0], 0.2, bulb),
        }
    }
}

fn add_lights(scene: &mut Scene) {
    let position = DVec3::new(1.0, 2.0, 3.0);
    let direction = -position.normalize();
    let spot = |falloff| LightKind::Spot {
        position,
        direction,
        inner_angle_rad: 0.3,
        outer_angle_rad: 0.7,
        falloff,
    };
    let kinds = [
        LightKind::Point { position: DVec3::new(-2.0, 1.0, 2.0) },
        spot(SpotFalloff::Square),
        spot(SpotFalloff::Smooth),
        LightKind::Directional { direction: DVec3::new(0.1, -1.0, -0.2).normalize() },
        LightKind::Sun { direction: DVec3::new(-0.1, -1.0, -0.2).normalize(), angle_rad: 0.02 },
    ];
    scene.lights = kinds.map(|kind| Light::new(kind, [1.0, 0.9, 0.8])).into();
    let rotation = DQuat::from_rotation_arc(DVec3::NEG_Z, direction);
    let kind = LightKind::Profiled { position, rotation, cone: Some([0.3, 0.7]) };
    let profile = LightProfile {
        vertical_deg: vec![0.0, 90.0],
        horizontal_deg: vec![0.0, 90.0],
        values: vec![1.0, 0.0, 0.5, 0.0],
    };
    scene.lights.push(Light { profile: Some(Arc::new(profile)), ..Light::new(kind, [1.0, 0.9, 0.8]) });
}

/// A row of spheres, disks and sheets, one for each material of the scene, with a floor.
fn show(scene: &mut Scene) {
    let count = scene.materials.len() as u32;
    for i in 0..count {
        let (x, y) = (f64::from(i % 5) - 2.0, f64::from(i / 5) - 1.0);
        let id = MaterialId(i);
        match i % 3 {
            0 => disk(scene, [x, y, 0.0], [0.2, 0.3, 1.0], 0.45, id),
            _ => sphere(scene, [x, y, 0.0], 0.45, id),
        }
    }
    scene.meshes.push(sheet(2, MaterialId(0), MaterialId(count - 1)));
    place(scene, 0, DVec3::new(0.0, 0.0, -0.5), None, Motion::Still);
    place(scene, 0, DVec3::new(0.0, 1.5, -0.5), Some(MaterialId(count / 2)), Motion::Still);
}

/// Textures of all kinds on a few materials, under an image environment, with an orthographic camera.
fn textures() -> Scene {
    let mut scene = Scene { name: "textures".into(), ..Scene::default() };
    add_images(&mut scene);
    scene.textures.push(Texture::Solid([0.2, 0.5, 0.9]));
    scene.textures.push(Texture::Normal);
    for kind in [NoiseKind::Perlin, NoiseKind::Turbulence, NoiseKind::Marble] {
        let (low, high) = ([0.1, 0.0, 0.0], [1.0, 0.8, 0.6]);
        scene.textures.push(Texture::Noise { kind, frequency: 3.0, octaves: 4, low, high, seed: 7 });
    }
    for (even, odd, mapping) in
        [(5, 6, Mapping::World), (10, 0, Mapping::default()), (11, 9, Mapping::Triplanar { size: 1.0 })]
    {
        let (even, odd) = (TextureId(even), TextureId(odd));
        scene.textures.push(Texture::Checker { even, odd, cell_size: 0.4, mapping });
    }
    scene.textures.push(Texture::Facing([[0.9, 0.1, 0.1], [0.1, 0.9, 0.1], [0.2; 3]].into()));
    for i in 0..scene.textures.len() as u32 {
        let mut painted = Material::lambert("painted", [0.8; 3]);
        painted.model = Model::Lambert { albedo: ColorSlot::texture(TextureId(i)) };
        painted.use_vertex_colors = i % 2 == 0;
        if i % 4 == 3 {
            painted.emission = Some(Emission { radiance: ColorSlot::texture(TextureId(i)), two_sided: true });
        }
        if i % 3 == 1 {
            painted.normal_map = Some(NormalMap { texture: TextureId(i), scale: 1.0 });
        }
        material(&mut scene, painted);
    }
    show(&mut scene);
    scene.environment = Environment::Image { image: ImageId(2), strength: 1.5, rotation_rad: 0.7 };
    let mut parallel = camera(DVec3::new(0.2, 0.3, 6.0), DVec3::ZERO, DVec3::Y, 50.0);
    (parallel.projection, parallel.aspect_ratio) = (Projection::Orthographic { half_height: 2.5 }, Some(1.5));
    scene.cameras.push(parallel);
    scene
}

/// All BSDF models except glTF's.
fn materials() -> Scene {
    let mut scene = Scene { name: "materials".into(), ..Scene::default() };
    add_images(&mut scene);
    let color = ColorSlot::constant([0.9, 0.7, 0.5]);
    let smooth = FloatSlot::constant(0.0);
    let rough = FloatSlot { factor: 0.7, texture: Some((TextureId(0), 1)) };
    let glass = |roughness, is_thin| Model::Glass { ior: 1.5, tint: color, roughness, is_thin };
    let mut models: Vec<Model> = Model::PLAIN.iter().map(|(_, default)| default()).collect();
    models.extend([
        Model::Black,
        Model::SchlickMetal { color, roughness: rough },
        Model::SchlickMetal { color, roughness: smooth },
        Model::Conductor {
            eta: [0.2, 0.9, 1.1],
            k: [3.9, 2.4, 2.1],
            metal: Metal::named("copper"),
            roughness: FloatSlot::constant(0.3),
        },
        Model::Conductor { eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.1], metal: None, roughness: smooth },
        Model::Dielectric { ior: 1.5, tint: color, fresnel: FresnelModel::Exact },
        Model::Dielectric { ior: 2.4, tint: color, fresnel: FresnelModel::Schlick },
        glass(smooth, true),
        glass(FloatSlot::constant(0.4), false),
        glass(rough, true),
    ]);
    for model in models {
        material(&mut scene, Material::new("model", model));
    }
    show(&mut scene);
    // A bubble in the glass.
    sphere(&mut scene, [-2.0, 1.0, 0.0], 0.2, MaterialId(8));
    let emitter_traits = material(&mut scene, Material::emitter("lamp", [6.0; 3], false));
    quad(&mut scene, [-1.0, 3.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0], emitter_traits);
    scene.environment = Environment::Constant([0.3, 0.35, 0.4]);
    scene.cameras.push(camera(DVec3::new(0.2, 0.3, 6.0), DVec3::ZERO, DVec3::Y, 50.0));
    scene
}

/// Materials of glTF with each layer alone, and all together.
fn layers() -> Scene {
    let mut scene = Scene { name: "layers".into(), ..Scene::default() };
    add_images(&mut scene);
    let plain = || PbrMaterial {
        base_color: ColorSlot::constant([0.8, 0.6, 0.4]),
        metallic: FloatSlot { factor: 0.3, texture: Some((TextureId(2), 2)) },
        roughness: FloatSlot::constant(0.4),
        ..PbrMaterial::default()
    };
    let share = FloatSlot::constant;
    let textured = |factor, channel| FloatSlot { factor, texture: Some((TextureId(0), channel)) };
    let bumps = Some(NormalMap { texture: TextureId(2), scale: 0.6 });
    let clearcoat = Some(Clearcoat { factor: share(0.8), roughness: textured(0.5, 1), normal_map: bumps });
    let sheen = Some(Sheen { color: ColorSlot::texture(TextureId(2)), roughness: share(0.6) });
    let anisotropy = Some(Anisotropy { strength: 0.7, rotation_rad: 0.4, texture: Some(TextureId(2)) });
    let iridescence = Some(Iridescence {
        factor: share(0.9),
        ior: 1.3,
        thickness_min_nm: 100.0,
        thickness_max_nm: 500.0,
        thickness_texture: Some((TextureId(0), 1)),
    });
    let through = Some(DiffuseTransmission {
        factor: share(0.5),
        color: ColorSlot::constant([0.9, 0.5, 0.5]),
        subsurface: None,
    });
    let clear = |has_volume, roughness| PbrMaterial {
        metallic: share(0.0),
        transmission: share(1.0),
        roughness: share(roughness),
        has_volume,
        attenuation_color: [0.4, 0.9, 0.8],
        attenuation_distance: 0.5,
        ..plain()
    };
    let all = PbrMaterial {
        clearcoat,
        sheen,
        anisotropy,
        iridescence,
        diffuse_transmission: through,
        ..clear(true, 0.3)
    };
    let models = [
        plain(),
        PbrMaterial { clearcoat, ..plain() },
        PbrMaterial { sheen, ..plain() },
        PbrMaterial { anisotropy, ..plain() },
        PbrMaterial { iridescence, ..plain() },
        PbrMaterial { diffuse_transmission: through, ..plain() },
        clear(true, 0.0),
        clear(false, 0.0),
        clear(true, 0.5),
        clear(false, 0.5),
        PbrMaterial { dispersion: 2.0, ..clear(true, 0.0) },
        PbrMaterial { transmission: textured(0.8, 0), specular: share(0.5), ..clear(true, 0.2) },
        PbrMaterial { anisotropy, ..clear(true, 0.4) },
        PbrMaterial { ior: 0.0, ..plain() },
        PbrMaterial { metallic: share(0.0), specular_color: ColorSlot::constant([3.0, 1.0, 0.5]), ..plain() },
        all,
    ];
    for model in models {
        let mut layered = Material::new("layered", Model::Pbr(Box::new(model)));
        layered.normal_map = bumps.filter(|_| scene.materials.len() % 4 == 1);
        material(&mut scene, layered);
    }
    show(&mut scene);
    add_lights(&mut scene);
    scene.environment = Environment::Image { image: ImageId(2), strength: 1.0, rotation_rad: 0.0 };
    scene.cameras.push(camera(DVec3::new(0.2, 0.3, 6.0), DVec3::ZERO, DVec3::Y, 50.0));
    scene
}
