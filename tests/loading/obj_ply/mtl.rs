//! MTL files.

use super::load_files;
use image::{DynamicImage, ImageFormat, Rgb, RgbImage, Rgba, RgbaImage};
use oscura::load::Loaded;
use oscura::math::Vec2;
use oscura::scene::{AlphaMode, Mapping, Material, Model, PbrMaterial, Texture, TextureId, Wrap};

#[test]
fn statements_select_the_material_model() {
    let mtl = b"newmtl a\nKd 0.1 0.2 0.3\nnewmtl b\nKd 1 1 1\nPr 0.4\nPm 1\nnewmtl c\nKe 3 2 1\nnewmtl g\nNi 1.45\nillum 7\n";
    let text = b"mtllib missing.mtl\nmtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\n\
                 f 1 2 3\nusemtl c\nf 1 2 3\nusemtl g\nf 1 2 3\n";
    let loaded = load_files(&[("a.obj", &text[..]), ("m.mtl", mtl)]).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.warnings.iter().any(|w| w.message.contains("missing.mtl")), "{:?}", loaded.warnings);
    let by_name = |n: &str| loaded.scene.materials.iter().find(|m| m.name == n).expect("the material");
    assert!(matches!(by_name("a").model, Model::Lambert { albedo } if albedo.factor == [0.1, 0.2, 0.3]));
    assert!(
        matches!(&by_name("b").model, Model::Pbr(p) if p.roughness.factor == 0.4 && p.metallic.factor == 1.0)
    );
    assert_eq!(by_name("c").emission.expect("it emits").radiance.factor, [3.0, 2.0, 1.0]);
    assert!(matches!(by_name("g").model, Model::Dielectric { ior, .. } if ior == 1.45));
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";

/// A triangle with the material `m` of these statements, and two images.
fn with_material(statements: &str) -> Loaded {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let rgb = RgbImage::from_pixel(4, 4, Rgb([10, 200, 30]));
    DynamicImage::from(rgb).write_to(&mut bytes, ImageFormat::Png).expect("encoded");
    let plain = bytes.into_inner();
    let mut bytes = std::io::Cursor::new(Vec::new());
    let rgba = RgbaImage::from_pixel(4, 4, Rgba([128, 128, 255, 100]));
    DynamicImage::from(rgba).write_to(&mut bytes, ImageFormat::Png).expect("encoded");
    let normals = bytes.into_inner();
    let mtl = format!("newmtl m\n{statements}");
    let obj = format!("mtllib a.mtl\nusemtl m\n{TRIANGLE}");
    let files: [(&str, &[u8]); 4] = [
        ("a.obj", obj.as_bytes()),
        ("a.mtl", mtl.as_bytes()),
        ("maps/wood grain.png", &plain),
        ("maps/alpha.png", &normals),
    ];
    load_files(&files).unwrap_or_else(|e| panic!("{e}"))
}

fn material(loaded: &Loaded) -> &Material {
    &loaded.scene.materials[0]
}

fn pbr(loaded: &Loaded) -> &PbrMaterial {
    match &material(loaded).model {
        Model::Pbr(p) => p,
        other => panic!("not the glTF model: {other:?}"),
    }
}

fn mapping(loaded: &Loaded, id: TextureId) -> (Vec2, Vec2, Wrap) {
    match loaded.scene.textures[id.index()] {
        Texture::Image { wrap_u, mapping: Mapping::Uv { transform, .. }, .. } => {
            (transform.scale, transform.offset, wrap_u)
        }
        _ => panic!("not an image"),
    }
}

#[test]
fn map_options_and_file_names_of_other_systems() {
    let loaded = with_material("Kd 0 0 0\nmap_Kd -s 2 3 1 -o 0.25 0.5 -clamp on maps\\Wood Grain.PNG\n");
    assert!(loaded.warnings.iter().all(|w| w.file.is_none()), "{:?}", loaded.warnings);
    let Model::Lambert { albedo } = material(&loaded).model else { panic!("not Lambertian") };
    assert_eq!(albedo.factor, [1.0; 3]);
    let (scale, offset, wrap) = mapping(&loaded, albedo.texture.expect("a map"));
    // v flipped: 1 - (v s + o) with v = 1 - v'.
    assert_eq!((scale, offset, wrap), (Vec2::new(2.0, 3.0), Vec2::new(0.25, 1.0 - 3.0 - 0.5), Wrap::Clamp));
}

#[test]
fn pbr_keys_and_their_maps() {
    let loaded = with_material(
        "Kd 1 1 1\nPr 0.3\nPm 0.25\nPs 0.5\nPc 0.75\nPcr 0.1\naniso 0.5\nanisor 0.25\n\
         map_Pr -imfchan g maps/wood grain.png\n",
    );
    let p = pbr(&loaded);
    assert_eq!((p.roughness.factor, p.roughness.texture.map(|t| t.1)), (1.0, Some(1)));
    assert_eq!(p.metallic.factor, 0.25);
    let coat = p.clearcoat.expect("a coat");
    assert_eq!((coat.factor.factor, coat.roughness.factor), (0.75, 0.1));
    assert_eq!(p.sheen.expect("sheen").color.factor, [0.5; 3]);
    let aniso = p.anisotropy.expect("anisotropy");
    assert!(aniso.strength == 0.5 && (aniso.rotation_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
}

#[test]
fn classic_highlights() {
    let loaded = with_material("Kd 0.5 0.5 0.5\nKs 0.5 0.25 0.25\nNs 30\nillum 2\n");
    let p = pbr(&loaded);
    assert_eq!((p.specular_color.factor, p.ior), ([1.0, 0.5, 0.5], 1.5));
    // alpha^2 = 2 / (30 + 2), roughness its fourth root.
    assert!((p.roughness.factor - 0.0625f32.powf(0.25)).abs() < 1e-6);
    // The file disables the highlight.
    let loaded = with_material("Kd 0.5 0.5 0.5\nKs 0.5 0.25 0.25\nillum 1\n");
    assert!(matches!(material(&loaded).model, Model::Lambert { .. }));
    let loaded = with_material("Kd 0 0 0\nKs 0.9 0.8 0.7\nNs 1000\nillum 3\n");
    assert!(
        matches!(material(&loaded).model, Model::SchlickMetal { color, .. } if color.factor == [0.9, 0.8, 0.7])
    );
    let loaded = with_material("Ni 1.3\nTf 0.9 1 0.9\nillum 7\n");
    assert!(
        matches!(material(&loaded).model, Model::Dielectric { tint, .. } if tint.factor == [0.9, 1.0, 0.9])
    );
}

#[test]
fn opacity_as_number_and_map() {
    for (statements, opacity) in [("d 0.25\n", 0.25), ("Tr 0.75\n", 0.25), ("d 0.5\nTr 0.9\n", 0.5)] {
        let loaded = with_material(statements);
        assert_eq!(
            (material(&loaded).alpha_mode, material(&loaded).alpha.factor),
            (AlphaMode::Blend, opacity)
        );
    }
    assert_eq!(material(&with_material("d 1\n")).alpha_mode, AlphaMode::Opaque);
    let channel = |file: &str| {
        let loaded = with_material(&format!("map_d {file}\n"));
        material(&loaded).alpha.texture.expect("a map").1
    };
    assert_eq!((channel("maps/alpha.png"), channel("maps/wood grain.png")), (3, 0));
    assert_eq!(channel("-imfchan b maps/alpha.png"), 2);
}

#[test]
fn bump_maps_are_heights_or_normals() {
    // The image is a normal map, whatever the statement says.
    let loaded = with_material("map_Bump -bm 0.5 maps/alpha.png\n");
    assert_eq!((material(&loaded).normal_map.expect("a map").scale, loaded.scene.images.len()), (0.5, 1));
    let loaded = with_material("norm maps/alpha.png\n");
    assert_eq!(material(&loaded).normal_map.expect("a map").scale, 1.0);
    // Heights are converted to a normal map.
    let loaded = with_material("bump maps/wood grain.png\n");
    assert!(material(&loaded).normal_map.is_some());
    assert_eq!(loaded.scene.images.len(), 2);
    assert_eq!(loaded.scene.images[1].channels, 3);
}

#[test]
fn emission_and_its_map() {
    let emission = |s: &str| material(&with_material(s)).emission;
    assert!(emission("Ke 0 0 0\n").is_none());
    assert_eq!(emission("Ke 1 2 3\n").expect("it emits").radiance.factor, [1.0, 2.0, 3.0]);
    let mapped = emission("map_Ke maps/alpha.png\n").expect("it emits").radiance;
    assert!(mapped.factor == [1.0; 3] && mapped.texture.is_some());
}

#[test]
fn several_libraries_with_a_missing_one_and_spaces() {
    let obj = format!(
        "mtllib none.mtl\nmtllib my colours.mtl\nmtllib sub\\b.mtl none2.mtl\nusemtl red\n{TRIANGLE}usemtl blue\nf 1 2 3\n"
    );
    let loaded = load_files(&[
        ("a.obj", obj.as_bytes()),
        ("my colours.mtl", b"newmtl red\nKd 1 0 0\n"),
        ("sub/b.mtl", b"newmtl blue\nKd 0 0 1\nnewmtl red\nKd 0 1 0\nnewmtl unused\nmap_Kd missing.png\n"),
    ])
    .unwrap_or_else(|e| panic!("{e}"));
    let kd = |name: &str| match loaded.scene.materials.iter().find(|m| m.name == name).map(|m| &m.model) {
        Some(Model::Lambert { albedo }) => albedo.factor,
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!((kd("red"), kd("blue")), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]));
    let about = |part: &str| loaded.warnings.iter().filter(|w| w.message.contains(part)).count();
    assert_eq!((about("'none.mtl'"), about("'none2.mtl'"), about("missing.png")), (1, 1, 0));
    assert!(loaded.left_out.iter().any(|l| l.contains("'unused'")), "{:?}", loaded.left_out);
}

#[test]
fn images_are_decoded_once_and_missing_ones_reported() {
    let loaded = with_material("map_Kd maps/alpha.png\nmap_Ke maps/ALPHA.png\nmap_d none.png\n");
    assert_eq!(loaded.scene.images.len(), 1);
    let missing = loaded.warnings.iter().find(|w| w.message.contains("none.png")).expect("a warning");
    assert_eq!(missing.place, "line 4");
}

/// Green is 200 of 255, red 10: that much of 0.5 along the normal.
#[test]
fn displacement_maps_move_vertices() {
    let placed = |statements: &str| {
        let loaded = with_material(statements);
        let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
        let warned = loaded.warnings.iter().any(|w| w.to_string().contains("-bm"));
        (mesh.triangles.len(), mesh.positions.iter().map(|p| p[2]).fold(0.0, f32::max), warned)
    };
    let (triangles, height, warned) = placed("disp -bm 0.5 maps/wood grain.png\n");
    assert!(triangles > 10_000 && !warned, "{triangles}");
    assert!((height - 0.5 * 10.0 / 255.0).abs() < 1e-6, "{height}");
    let (_, height, _) = placed("disp -bm 0.5 -imfchan g maps/wood grain.png\n");
    assert!((height - 0.5 * 200.0 / 255.0).abs() < 1e-6, "{height}");
    assert_eq!(placed("disp maps/wood grain.png\n"), (1, 0.0, true));
}

#[test]
fn invisible_materials_and_missing_texture_coordinates_are_reported() {
    for (statements, expected) in
        [("d 0", "'d 0' makes it invisible"), ("Tr 1", "'Tr' of 1 materials is taken as their opacity")]
    {
        let loaded = with_material(statements);
        assert!(loaded.warnings.iter().any(|w| w.message.contains(expected)), "{:?}", loaded.warnings);
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = DynamicImage::from(RgbImage::from_pixel(4, 4, Rgb([10, 200, 30])));
    picture.write_to(&mut bytes, ImageFormat::Png).expect("encoded");
    let (obj, mtl) =
        ("mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "newmtl m\nmap_Kd p.png\n");
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes()), ("p.png", bytes.get_ref())];
    let loaded = load_files(&files).unwrap_or_else(|e| panic!("{e}"));
    let shown: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert!(shown.iter().any(|w| w.contains("'m'") && w.contains("('vt')")), "{shown:?}");
    // With coordinates nothing is reported.
    assert!(with_material("map_Kd plain.png").warnings.iter().all(|w| !w.message.contains("('vt')")));
}
