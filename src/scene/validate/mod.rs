//! Validation of a scene before compilation: references and value ranges, so that later stages need no checks. Loaders run it
//! last and `compile` first, so that scenes built in code get the same errors as files.
//!
//! Not reported, since later stages repair them: fractions outside 0..1 (clamped), normals of any length (normalised), and
//! primitives that are degenerate, farther than 1e18 m or under a singular transform (dropped with a warning).

mod findings;
mod geometry;
mod lights;
mod materials;

use super::{BounceLimits, Camera, Clamp, Scene, Settings};
use crate::error::Problem;
use findings::Findings;

impl Scene {
    /// All errors of the scene: broken references and values out of range, each with the place (`lights[3] 'lamp', intensity`),
    /// the value and the allowed range. Beyond a few, problems of one kind are only counted. A scene without problems
    /// compiles, unless it exceeds the maximum number of triangles or vertices.
    pub fn validate(&self) -> Vec<Problem> {
        let mut findings = Findings::default();
        geometry::check_meshes(self, &mut findings);
        geometry::check_objects(self, &mut findings);
        geometry::check_curves(self, &mut findings);
        materials::check_materials(self, &mut findings);
        materials::check_textures(self, &mut findings);
        materials::check_images(self, &mut findings);
        lights::check_lights(self, &mut findings);
        lights::check_environment(self, &mut findings);
        materials::check_media(self, &mut findings);
        lights::check_groups(self, &mut findings);
        geometry::check_motion(self, &mut findings);
        for (i, camera) in self.cameras.iter().enumerate() {
            lights::check_camera(camera, i, &mut findings);
        }
        check_settings(&self.settings, &mut findings);
        findings.into_problems()
    }
}

impl Camera {
    /// [`Scene::validate`] for a camera outside a scene.
    pub fn validate(&self) -> Vec<Problem> {
        let mut findings = Findings::default();
        lights::check_camera(self, 0, &mut findings);
        findings.into_problems()
    }
}

// Render settings.

const PLACE: &str = "settings";

fn check_settings(settings: &Settings, findings: &mut Findings) {
    let counts = [("width", settings.width), ("height", settings.height), ("samples", settings.samples)];
    for (field, count) in counts {
        if let Some(count) = count {
            findings.require(count > 0, PLACE, field, count, "at least 1");
        }
    }
    for (field, value) in [("noise", settings.noise), ("white_balance", settings.white_balance)] {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
            findings.require(false, PLACE, field, value, "a number above 0");
        }
    }
    for (kind, limit) in settings.bounces.iter().flat_map(BounceLimits::iter) {
        findings.require(limit > 0, format!("{PLACE}, bounces"), kind, limit, "at least 1");
    }
    for (kind, limit) in settings.clamp.iter().flat_map(Clamp::iter) {
        findings.require(limit > 0.0, format!("{PLACE}, clamp"), kind, limit, "a number above 0");
    }
    if let Some(strength) = settings.filter_glossy {
        let is_valid = strength.is_finite() && strength >= 0.0;
        findings.require(is_valid, PLACE, "filter_glossy", strength, "a finite number from 0 up");
    }
    if let Some(radius) = settings.filter_radius {
        let is_valid = (0.005..=16.0).contains(&radius);
        findings.require(is_valid, PLACE, "filter_radius", radius, "a number of pixels from 0.005 to 16");
    }
    if let Some(exposure) = settings.exposure {
        findings.require(exposure.is_finite(), PLACE, "exposure", exposure, "a finite number");
    }
}

#[cfg(test)]
mod tests {
    use crate::error::Warning;
    use crate::image::{Damage, Encoded, Image, ImageSource, Pixels};
    use crate::math::{DAffine3, DVec3};
    use crate::scene::{
        Camera, ColorSlot, Environment, ImageId, Instance, Light, LightKind, Mapping, Material, MaterialId,
        Mesh, MeshId, MeshPart, Model, PbrMaterial, Projection, Scene, Settings, Shape, Texture, TextureId,
    };

    fn problems(scene: &Scene) -> Vec<String> {
        scene.validate().iter().map(ToString::to_string).collect()
    }

    /// A scene of one triangle.
    fn triangle() -> Scene {
        let mesh = Mesh {
            name: "sail".into(),
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            parts: vec![MeshPart { first_triangle: 0, triangle_count: 1, material: MaterialId(0) }],
            ..Mesh::default()
        };
        let materials = vec![Material::lambert("cloth", [0.5; 3])];
        Scene { meshes: vec![mesh], materials, ..Scene::default() }
    }

    /// Problems of [`triangle`] after a change of its mesh.
    fn mesh_problems(change: impl FnOnce(&mut Mesh)) -> Vec<String> {
        let mut scene = triangle();
        change(&mut scene.meshes[0]);
        problems(&scene)
    }

    #[test]
    fn meshes() {
        assert_eq!(mesh_problems(|_| {}), [""; 0]);
        assert_eq!(
            mesh_problems(|m| m.triangles[0][1] = 3),
            ["meshes[0] 'sail', triangles: is 3, but must be indices below the number of positions"]
        );
        assert_eq!(
            mesh_problems(|m| {
                m.normals = vec![[0.0, f32::NAN, f32::INFINITY]; 3];
                m.colors = vec![[1.0; 4]; 2];
            }),
            [
                "meshes[0] 'sail', normals: 6 of 9 numbers are NaN or infinite, but must be finite numbers",
                "meshes[0] 'sail', length of colors: is 2, but must be the number of positions, or 0",
            ]
        );
        for parts in [
            vec![],
            vec![MeshPart { first_triangle: 0, triangle_count: 2, material: MaterialId(0) }],
            vec![MeshPart { first_triangle: 1, triangle_count: 1, material: MaterialId(0) }],
            vec![MeshPart { first_triangle: 0, triangle_count: u32::MAX, material: MaterialId(0) }; 2],
        ] {
            let problems = mesh_problems(|m| m.parts = parts);
            assert!(problems.len() == 1 && problems[0].contains("cover all triangles"), "{problems:?}");
        }
        let problems = mesh_problems(|m| m.parts[0].material = MaterialId(7));
        assert!(problems[0].contains("MaterialId(7)"), "{problems:?}");
    }

    #[test]
    fn problems_of_one_kind_are_counted() {
        let mut scene = triangle();
        scene.instances = vec![Instance::new(MeshId(9), DAffine3::IDENTITY); 100_000];
        let problems = problems(&scene);
        assert_eq!(problems.len(), 9);
        assert_eq!(problems[0], "instances[0], mesh: is MeshId(9), but must be one of the scene's meshes");
        assert_eq!(problems[8], "99992 more of this kind: mesh must be one of the scene's meshes");
    }

    #[test]
    fn textures_and_images() {
        let checker = |even, odd| Texture::Checker {
            even: TextureId(even),
            odd: TextureId(odd),
            cell_size: 1.0,
            mapping: Mapping::World,
        };
        let mut scene = Scene { textures: vec![checker(0, 5)], ..Scene::default() };
        assert_eq!(
            problems(&scene),
            [
                "textures[0], even: is TextureId(0), but must be a texture that comes before this one",
                "textures[0], odd: is TextureId(5), but must be a texture that comes before this one",
            ]
        );
        // Each contains the previous one.
        scene.textures = (0..64).map(|i| if i == 0 { Texture::Normal } else { checker(i - 1, 0) }).collect();
        assert_eq!(problems(&scene), [""; 0]);
        scene.textures.push(checker(63, 63));
        assert_eq!(
            problems(&scene),
            ["textures[64], nesting: is 65, but must be at most 64 nested textures"]
        );
        let mix = |a, b, factor| Texture::Mix { a: TextureId(a), b: TextureId(b), factor: TextureId(factor) };
        scene.textures[64] = mix(0, 62, 63);
        assert_eq!(problems(&scene).len(), 1);
        scene.textures = vec![Texture::Normal, mix(0, 1, 2), mix(0, 0, 1)];
        assert_eq!(
            problems(&scene),
            [
                "textures[1], b: is TextureId(1), but must be a texture that comes before this one",
                "textures[1], factor: is TextureId(2), but must be a texture that comes before this one",
            ]
        );
        // Each evaluates the previous one three times: up to 3^8 = 6561.
        scene.textures =
            (0..9).map(|i| if i == 0 { Texture::Normal } else { mix(i - 1, i - 1, i - 1) }).collect();
        assert_eq!(
            problems(&scene),
            ["textures[8], mixes: is 6561, but must be made of at most 4096 textures other than mixes"]
        );
        let mut image = Image::from_linear_rgb("sky", 2, 1, vec![0.0, 1.0, f32::NAN, 3.0, 4.0, 5.0]);
        (image.width, image.channels) = (3, 5);
        let texture = Texture::Image {
            image: ImageId(0),
            wrap_u: Default::default(),
            wrap_v: Default::default(),
            interpolation: Default::default(),
            mapping: Mapping::default(),
        };
        scene = Scene { images: vec![image], textures: vec![texture], ..Scene::default() };
        scene.environment = Environment::Image { image: ImageId(1), strength: -1.0, rotation_rad: 0.0 };
        assert_eq!(
            problems(&scene),
            [
                "images[0] 'sky', channels: is 5, but must be 1 to 4",
                "images[0] 'sky', length of pixels: is 6, but must be width * height * channels",
                "images[0] 'sky', pixels: 1 of 6 numbers are NaN or infinite, but must be finite numbers",
                "environment, strength: is -1.0, but must be a finite number from 0 up",
                "environment, image: is ImageId(1), but must be one of the scene's images",
            ]
        );
    }

    /// The size of an encoded image must not be changed: lookups would be out of bounds.
    #[test]
    fn encoded_images_keep_their_size() {
        #[derive(Debug)]
        struct Source(Image);

        impl ImageSource for Source {
            fn decode(&self, _: &mut Vec<Warning>) -> Result<Image, Damage> {
                Ok(self.0.clone())
            }

            fn with_bytes(&self, _: &mut dyn FnMut(&[u8])) {}
        }

        let image = Image::from_linear_rgb("wood", 2, 1, vec![0.5; 6]);
        let source = std::sync::Arc::new(Source(image.clone()));
        let pixels = std::sync::Arc::new(Pixels::Encoded(Encoded { size: [2, 1, 3], bits: 8, source }));
        let problems_of = |width, height, channels| {
            let image = Image { width, height, channels, pixels: pixels.clone(), ..image.clone() };
            problems(&Scene { images: vec![image], ..Scene::default() })
        };
        assert_eq!(problems_of(2, 1, 3), [""; 0]);
        for (width, height, channels) in [(3, 1, 3), (2, 2, 3), (2, 1, 4)] {
            let problems = problems_of(width, height, channels);
            assert!(problems.len() == 1 && problems[0].contains("images[0] 'wood'"), "{problems:?}");
        }
    }

    #[test]
    fn materials() {
        let mut scene = Scene::default();
        let tint = ColorSlot { factor: [1.0, -0.5, f32::NAN], texture: Some(TextureId(3)) };
        let model = Model::Dielectric { ior: 0.0, tint, fresnel: Default::default() };
        scene.materials.push(Material::new("pane", model));
        let pbr = PbrMaterial { ior: -0.5, attenuation_distance: 0.0, ..PbrMaterial::default() };
        scene.materials.push(Material::new("jelly", Model::Pbr(Box::new(pbr))));
        assert_eq!(
            problems(&scene),
            [
                "materials[0] 'pane', tint: is TextureId(3), but must be one of the scene's textures",
                "materials[0] 'pane', tint: is [1.0, -0.5, NaN], but must be finite numbers from 0 up",
                "materials[0] 'pane', ior: is 0.0, but must be a finite number above 0",
                "materials[1] 'jelly', ior: is -0.5, but must be a finite number from 0 up",
                "materials[1] 'jelly', attenuation_distance: is 0.0, but must be above 0, or infinite",
            ]
        );
    }

    #[test]
    fn lights_cameras_shapes_and_settings() {
        let mut scene = triangle();
        let (position, direction) = (DVec3::ZERO, DVec3::ZERO);
        let (inner_angle_rad, outer_angle_rad) = (0.5, 0.4);
        let kind = LightKind::Spot {
            position,
            direction,
            inner_angle_rad,
            outer_angle_rad,
            falloff: Default::default(),
        };
        scene.lights.push(Light { name: "lamp".into(), ..Light::new(kind, [f32::INFINITY, 0.0, 0.0]) });
        scene.shapes.push(Shape { name: "ball".into(), ..Shape::sphere(DVec3::ZERO, -1.0, MaterialId(0)) });
        let eye = Camera::new(DAffine3::IDENTITY, Projection::Perspective { vfov_rad: 4.0 });
        scene.cameras.push(Camera { name: "eye".into(), ..eye });
        scene.settings = Settings { width: Some(0), ..Settings::default() };
        assert_eq!(
            problems(&scene),
            [
                "shapes[0] 'ball', radius: is -1.0, but must be a finite number above 0",
                "lights[0] 'lamp', intensity: is [inf, 0.0, 0.0], but must be finite numbers from 0 up",
                "lights[0] 'lamp', direction: is (0.0, 0.0, 0.0), but must be a finite vector other than 0",
                "lights[0] 'lamp', inner_angle_rad: is 0.5, but must be from 0 to the outer angle",
                "cameras[0] 'eye', vfov_rad: is 4.0, but must be above 0 and below pi",
                "settings, width: is 0, but must be at least 1",
            ]
        );
        let mut camera = scene.cameras[0].clone();
        camera.projection = Projection::Orthographic { half_height: 1.0 };
        assert_eq!(camera.validate(), []);
        camera.world_from_camera.matrix3.y_axis = DVec3::X;
        assert_eq!(camera.validate().len(), 1);
    }

    #[test]
    fn media_are_checked() {
        use crate::scene::{EmissionGrid, Fog, Grid, GridId, Medium, MediumTextures, TextureId};
        let good = Medium::scattering([1.0; 3]);
        let grid = |values: &[f32], size| {
            let (name, values) = ("smoke".to_string(), std::sync::Arc::new(values.to_vec()));
            Grid::in_box(name, size, values, DVec3::ZERO, DVec3::ONE)
        };
        let problems_with = |medium: Medium, grids: Vec<Grid>| {
            let mut scene = Scene { grids, ..Scene::default() };
            scene.add_material(Material { medium: Some(medium), ..Material::lambert("body", [0.5; 3]) });
            scene.validate()
        };
        assert!(problems_with(good, Vec::new()).is_empty());
        let one_voxel = |values: &[f32]| vec![grid(values, [1; 3])];
        let transformed =
            |scale| vec![Grid { world_from_voxels: DAffine3::from_scale(scale), ..grid(&[1.0], [1; 3]) }];
        let gridded = Medium { grid: Some(GridId(0)), ..good };
        assert!(problems_with(gridded, one_voxel(&[1.0])).is_empty());
        assert!(problems_with(Medium { emission: [1.0; 3], ..gridded }, one_voxel(&[1.0])).is_empty());
        assert!(
            problems_with(Medium { extinction: [1.0, 2.0, 1.0], ..gridded }, one_voxel(&[1.0])).is_empty()
        );
        let black_body =
            |kelvin| Some(EmissionGrid::Temperatures { grid: GridId(0), kelvin, scales_with_power: false });
        let glow = |grid| Some(EmissionGrid::Factors(GridId(grid)));
        assert!(
            problems_with(Medium { emission_grid: black_body(1500.0), ..gridded }, one_voxel(&[1.0]))
                .is_empty()
        );
        let colored = Medium { grid: Some(GridId(1)), scattering_grids: Some([GridId(0); 3]), ..good };
        assert!(problems_with(colored, [one_voxel(&[0.5]), one_voxel(&[1.0])].concat()).is_empty());
        let textures = MediumTextures { color: Some(TextureId(0)), ..MediumTextures::default() };
        for (medium, grids, words) in [
            (Medium { emission_grid: glow(0), ..good }, one_voxel(&[1.0]), "none without a density grid"),
            (Medium { emission_grid: glow(1), ..gridded }, one_voxel(&[1.0]), "one of the scene's grids"),
            (Medium { emission_grid: black_body(0.0), ..gridded }, one_voxel(&[1.0]), "kelvin"),
            (Medium { emission_grid: black_body(f32::NAN), ..gridded }, one_voxel(&[1.0]), "kelvin"),
            (colored, [one_voxel(&[1.5]), one_voxel(&[1.0])].concat(), "scattering_grids"),
            (Medium { textures, ..good }, Vec::new(), "textures"),
            (Medium { extinction: [1.0, -0.1, 1.0], ..good }, Vec::new(), "extinction"),
            (Medium { extinction: [f32::NAN; 3], ..good }, Vec::new(), "extinction"),
            (Medium { albedo: [1.1; 3], ..good }, Vec::new(), "albedo"),
            (Medium { anisotropy: -1.0, ..good }, Vec::new(), "anisotropy"),
            (Medium { anisotropy: f32::NAN, ..good }, Vec::new(), "anisotropy"),
            (Medium { emission: [f32::INFINITY; 3], ..good }, Vec::new(), "emission"),
            (gridded, Vec::new(), "one of the scene's grids"),
            (good, one_voxel(&[-1.0]), "from 0 up"),
            (good, one_voxel(&[f32::NAN]), "NaN"),
            (good, vec![grid(&[1.0], [2, 1, 1])], "size"),
            (good, vec![grid(&[], [0, 1, 1])], "size"),
            (good, transformed(DVec3::new(1.0, 0.0, 1.0)), "finite and invertible"),
            (good, transformed(DVec3::new(1.0, f64::NAN, 1.0)), "finite and invertible"),
            (good, transformed(DVec3::splat(1e-40)), "1e-18"),
            (gridded, one_voxel(&[1e6]), "mean free paths"),
        ] {
            let problems = problems_with(medium, grids);
            assert!(problems.iter().any(|p| p.to_string().contains(words)), "{words}: {problems:?}");
        }
        // Attenuation can't be combined with a density grid.
        let with_attenuation = |medium: Medium| {
            let pbr = PbrMaterial {
                has_volume: true,
                attenuation_color: [0.9, 0.5, 0.1],
                attenuation_distance: 2.0,
                ..Default::default()
            };
            let mut scene = Scene { grids: one_voxel(&[1.0]), ..Scene::default() };
            scene.add_material(Material { medium: Some(medium), ..Material::gltf("jade", pbr) });
            scene.validate()
        };
        assert!(with_attenuation(good).is_empty());
        let problems = with_attenuation(gridded);
        assert!(problems.iter().any(|p| p.to_string().contains("attenuation_distance")), "{problems:?}");
        let with_fog = |medium, radius| Scene {
            fog: Some(Fog { medium, center: DVec3::ZERO, radius }),
            ..Scene::default()
        };
        assert!(!with_fog(good, f64::NAN).validate().is_empty());
        let emissive = Medium { emission: [1.0; 3], ..Medium::scattering([1.0, 0.0, 1.0]) };
        assert!(!with_fog(emissive, f64::INFINITY).validate().is_empty());
    }
}
