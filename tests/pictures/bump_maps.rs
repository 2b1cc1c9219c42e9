//! Bump and normal maps: every file format gives the same picture.

use crate::support::options;
use oscura::film::Film;
use oscura::load::load;
use std::path::Path;

/// A square of 2 x 2 metres as an OBJ and as a glTF file; v points up in OBJ and down in glTF.
const OBJ: &str = "mtllib a.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                   usemtl a\nf 1/1 2/2 3/3 4/4\n";

fn write_gltf(folder: &Path, scale: f32) {
    let corners = [
        [-1.0, -1.0, 0.0, 0.0, 1.0],
        [1.0, -1.0, 0.0, 1.0, 1.0],
        [1.0, 1.0, 0.0, 1.0, 0.0],
        [-1.0, 1.0, 0.0, 0.0, 0.0],
    ];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|x: &f32| x.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    std::fs::write(folder.join("a.bin"), &bytes).expect("written");
    let asset = serde_json::json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{
            "normalTexture": {"index": 0, "scale": scale},
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}
        }],
        "textures": [{"source": 0}], "images": [{"uri": "normals.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4, "byteOffset": 0},
            {"bufferView": 0, "componentType": 5126, "type": "VEC2", "count": 4, "byteOffset": 12},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 80, "byteStride": 20}, {"buffer": 0, "byteOffset": 80, "byteLength": 12}
        ],
        "buffers": [{"byteLength": 92, "uri": "a.bin"}]
    });
    std::fs::write(folder.join("a.gltf"), asset.to_string()).expect("written");
}

/// A folder with meshes, height maps (a slope and waves), and a normal map that tilts to the right and up.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("a.obj"), OBJ).expect("written");
    std::fs::write(at("a.mtl"), "newmtl a\nKd 0.5 0.5 0.5\nillum 1\nbump -bm 8 heights.png\n")
        .expect("written");
    std::fs::write(at("plain.obj"), OBJ.replace("mtllib a.mtl\n", "").replace("usemtl a\n", ""))
        .expect("written");
    let heights = image::GrayImage::from_fn(32, 32, |x, y| {
        let wave = (x as f32 * 0.39).sin() * 60.0 + (y as f32 * 0.2 + 1.0).sin() * 50.0;
        image::Luma([(120.0 + wave) as u8])
    });
    heights.save(at("heights.png")).expect("saved");
    let normals = image::RgbImage::from_fn(8, 8, |x, y| {
        let (nx, ny) = ((x as f32 - 2.0) / 10.0, (y as f32 - 1.0) / 12.0);
        let length = (1.0 + nx * nx + ny * ny).sqrt();
        image::Rgb([nx, ny, 1.0].map(|c| ((c / length + 1.0) * 127.5).round() as u8))
    });
    normals.save(at("normals.png")).expect("saved");
    write_gltf(folder.path(), 0.75);
    folder
}

/// A scene file with a material and an object, lit from the upper left.
fn picture(folder: &Path, material: &str, object: &str) -> Film {
    let text = format!(
        "[camera]\nlook_from = [0, 0, 5]\nlook_at = [0, 0, 0]\nvfov = 20\nwidth = 16\nheight = 16\n\
         {material}\n[[lights]]\nsun = {{ direction = [1, -0.6, -0.8], irradiance = 3 }}\n[[objects]]\n{object}\n"
    );
    let path = folder.join("scene.toml");
    std::fs::write(&path, &text).expect("written");
    let loaded = load(&path, &Default::default()).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    crate::support::picture(&loaded.scene, &options(16, 64, 1))
}

/// The largest difference between two pictures, and the range of values of one.
fn compared(a: &Film, b: &Film) -> (f32, f32) {
    let pixels = || (0..16).flat_map(|y| (0..16).map(move |x| (x, y)));
    let red = |film: &Film, (x, y)| film.mean_rgba(x, y)[0];
    let worst = pixels().map(|at| (red(a, at) - red(b, at)).abs()).fold(0.0, f32::max);
    let (low, high) =
        pixels().map(|at| red(a, at)).fold((f32::MAX, 0.0f32), |(l, h), v| (l.min(v), h.max(v)));
    (worst, high - low)
}

const LAMBERT: &str = "[materials.a]\ntype = \"lambert\"\ncolor = 0.5\n";

#[test]
fn scene_file_and_mtl_bump_maps_agree() {
    let folder = folder();
    let of_mtl = picture(folder.path(), "", "mesh = \"a.obj\"");
    let object = "mesh = \"plain.obj\"\nmaterial = \"a\"";
    let messages = format!("{LAMBERT}bump = {{ image = \"heights.png\", scale = 8 }}\n");
    let of_scene = picture(folder.path(), &messages, object);
    let (worst, range) = compared(&of_mtl, &of_scene);
    assert!(range > 0.1 && worst < 1e-5, "{worst} of {range}");
    // Quads have built-in texture coordinates: the corner is the top left of the image.
    let turned = OBJ.replace("vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1", "vt 1 0\nvt 0 0\nvt 0 1\nvt 1 1");
    std::fs::write(folder.path().join("turned.obj"), turned).expect("written");
    let of_mesh = picture(folder.path(), "", "mesh = \"turned.obj\"");
    let quad = "quad = { corner = [1, 1, 0], u = [-2, 0, 0], v = [0, -2, 0] }\nmaterial = \"a\"";
    let (worst, range) = compared(&of_mesh, &picture(folder.path(), &messages, quad));
    assert!(range > 0.1 && worst < 2e-3 * range, "quad: {worst} of {range}");
    let flat = picture(folder.path(), LAMBERT, object);
    assert!(compared(&of_mtl, &flat).0 > 0.3 * range);
}

#[test]
fn scene_file_and_gltf_normal_maps_agree() {
    let folder = folder();
    let of_gltf = picture(folder.path(), "", "mesh = \"a.gltf\"");
    let pbr = "[materials.a]\ntype = \"pbr\"\nbase_color = 0.5\n";
    let messages = format!("{pbr}normal = {{ image = \"normals.png\", scale = 0.75 }}\n");
    let of_scene = picture(folder.path(), &messages, "mesh = \"plain.obj\"\nmaterial = \"a\"");
    let (worst, range) = compared(&of_gltf, &of_scene);
    assert!(range > 0.1 && worst < 2e-3 * range, "{worst} of {range}");
    let upside_down = messages.replace("0.75", "-0.75");
    let other = picture(folder.path(), &upside_down, "mesh = \"plain.obj\"\nmaterial = \"a\"");
    assert!(compared(&of_gltf, &other).0 > 0.3 * range);
}

/// Heights that increase to the east tilt a sphere's normals to the west, and those that increase to the north tilt them to the
/// south, as for a sphere mesh.
#[test]
fn bump_maps_on_spheres_match_sphere_meshes() {
    let folder = folder();
    let messages = format!("{LAMBERT}bump = {{ image = \"heights.png\", scale = 20, repeat = [3, 2] }}\n");
    let mut text = String::new();
    // u and v of the sphere of "Ray Tracing in One Weekend", whose rows count from the north pole.
    let (columns, rows) = (192, 96);
    for i in 0..=rows {
        for j in 0..=columns {
            let (u, v) = (f64::from(j) / f64::from(columns), f64::from(i) / f64::from(rows));
            let (phi, theta) = (u * std::f64::consts::TAU, v * std::f64::consts::PI);
            let (x, y, z) = (-phi.cos() * theta.sin(), theta.cos(), phi.sin() * theta.sin());
            text += &format!("v {x} {y} {z}\nvt {u} {}\nvn {x} {y} {z}\n", 1.0 - v);
        }
    }
    for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
        let at = |i: i32, j: i32| i * (columns + 1) + j + 1;
        let corner = |k: i32| format!("{k}/{k}/{k}");
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)].map(corner);
        text += &format!("f {a} {b} {c} {d}\n");
    }
    std::fs::write(folder.path().join("ball.obj"), text).expect("written");
    let of_mesh = picture(folder.path(), &messages, "mesh = \"ball.obj\"\nmaterial = \"a\"");
    let ball = "sphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"";
    let of_sphere = picture(folder.path(), &messages, ball);
    let smooth = picture(folder.path(), LAMBERT, ball);
    let difference = |a: &Film, b: &Film| {
        let pixels = (0..16).flat_map(|y| (0..16).map(move |x| (x, y)));
        pixels.map(|(x, y)| (a.mean_rgba(x, y)[0] - b.mean_rgba(x, y)[0]).abs()).sum::<f32>() / 256.0
    };
    let (error, effect) = (difference(&of_mesh, &of_sphere), difference(&smooth, &of_sphere));
    assert!(effect > 0.01 && error < 0.05 * effect, "{error} of {effect}");
}

/// Scale of the object, tiling, and slope of the bump map along the object's x axis: Cycles' normal pass (Blender 5.0.1) to four
/// digits, for bump-only displacement in object and world space, and with true displacement.
const LEANING: [([f64; 3], u32, f32); 6] = [
    ([1.0, 1.0, 1.0], 1, 1.0),
    ([3.0, 3.0, 3.0], 1, 1.0),
    ([3.0, 3.0, 3.0], 0, 1.0 / 3.0),
    ([1.0, 1.0, 3.0], 1, 3.0),
    ([3.0, 1.0, 1.0], 1, 1.0 / 3.0),
    ([3.0, 3.0, 3.0], 2, 3.0),
];

#[test]
fn bump_maps_on_scaled_objects_match_cycles() {
    let folder = folder();
    for (scale, power, slope) in LEANING {
        let nodes = format!(
            "[materials.a]\ntype = \"nodes\"\nsurface = \"shown\"\n[materials.a.nodes]\n\
             at = {{ type = \"texture_coordinate\" }}\n\
             height = {{ type = \"separate_xyz\", vector = \"at.object\" }}\n\
             bump = {{ type = \"bump\", distance = 1, height = \"height.x\", object_scale = {power} }}\n\
             above = {{ type = \"vector_math\", operation = \"add\", a = \"bump.normal\", b = [1, 1, 1] }}\n\
             shown = {{ type = \"emission\", color = \"above.vector\" }}\n"
        );
        let object = format!("mesh = \"plain.obj\"\nmaterial = \"a\"\ntransform = [{{ scale = {scale:?} }}]");
        let shown = picture(folder.path(), &nodes, &object).mean_rgba(8, 8);
        let length = (1.0 + slope * slope).sqrt();
        for (c, truth) in [-slope / length, 0.0, 1.0 / length].into_iter().enumerate() {
            let found = shown[c] - 1.0;
            assert!((found - truth).abs() < 1e-3, "scale {scale:?}, {power}: {shown:?} for slope {slope}");
        }
    }
}

/// The coat of a Principled BSDF ignores the base normal, as in Cycles, where the coat normal has no link.
#[test]
fn coat_keeps_its_normal_without_a_link() {
    let folder = folder();
    let shader = |normal: &str, coat: f32| {
        format!(
            "[materials.a]\ntype = \"nodes\"\nsurface = \"p\"\n[materials.a.nodes]\nplace = {{ type = \"geometry\" }}\n\
             sum = {{ type = \"vector_math\", operation = \"add\", a = \"place.normal\", b = [0.4, 0.2, 0] }}\n\
             lean = {{ type = \"vector_math\", operation = \"normalize\", a = \"sum.vector\" }}\n\
             p = {{ type = \"principled_bsdf\", base_color = {}, specular_ior_level = 0, coat_weight = {coat}, \
             coat_roughness = 0.3{normal} }}\n",
            if coat > 0.0 { 0.0 } else { 0.5 }
        )
    };
    let ball = "sphere = { center = [0, 0, 0], radius = 0.8 }\nmaterial = \"a\"";
    let pictures =
        |coat| ["", ", normal = \"lean.vector\""].map(|n| picture(folder.path(), &shader(n, coat), ball));
    let [flat, bumped] = pictures(1.0);
    let (worst, range) = compared(&flat, &bumped);
    assert!(range > 0.1 && worst < 1e-3 * range, "{worst} of {range}");
    let [flat, bumped] = pictures(0.0);
    let (worst, range) = compared(&flat, &bumped);
    assert!(worst > 0.1 * range, "the base is bumped: {worst} of {range}");
}

/// Bumps finer than a pixel tilt normals by height differences over a pixel, as in Cycles 5.0, also where no image needs ray
/// differentials: a plane of fractal noise in sunlight, in blocks of 40 x 40 pixels.
#[test]
fn subpixel_bumps_match_cycles() {
    const CYCLES: [[f64; 4]; 4] = [
        [0.2075, 0.1886, 0.1912, 0.1896],
        [0.1922, 0.1947, 0.1918, 0.1783],
        [0.1929, 0.1980, 0.1853, 0.1991],
        [0.1830, 0.1926, 0.1910, 0.1883],
    ];
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("a.obj"), "v -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nf 1 2 3 4\n").expect("written");
    let (sine, cosine) = 0.9f64.sin_cos();
    let (east, north) = 0.7f64.sin_cos();
    let text = format!(
        "[camera]\ntype = \"orthographic\"\nview_height = 2\nlook_from = [0, {}, {}]\nlook_at = [0, 0, 0]\nwidth = 160\nheight = 160\n\
         [materials.a]\ntype = \"nodes\"\nup = \"z\"\nsurface = \"diffuse\"\n[materials.a.nodes]\n\
         at = {{ type = \"texture_coordinate\" }}\n\
         noise = {{ type = \"noise_texture\", vector = \"at.object\", scale = 5, detail = 7, roughness = 0.5 }}\n\
         bump = {{ type = \"bump\", height = \"noise.factor\", distance = 1, filter_width = 1 }}\n\
         diffuse = {{ type = \"diffuse_bsdf\", color = 0.6, normal = \"bump.normal\" }}\n\
         [[lights]]\nsun = {{ direction = [{}, {}, {}], irradiance = 3 }}\n\
         [[objects]]\nmesh = \"a.obj\"\nmaterial = \"a\"\n\
         transform = [{{ matrix = [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1] }}]\n",
        20.0 * cosine,
        20.0 * sine,
        -east * sine,
        -cosine,
        -north * sine,
    );
    std::fs::write(at("scene.toml"), &text).expect("written");
    let loaded = load(at("scene.toml"), &Default::default()).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let film = crate::support::picture(&loaded.scene, &options(160, 16, 1));
    for (i, expected) in CYCLES.as_flattened().iter().enumerate() {
        let (column, row) = (i as u32 % 4 * 40, i as u32 / 4 * 40);
        let pixels = (0..40).flat_map(|y| (0..40).map(move |x| (column + x, row + y)));
        let found = pixels.map(|(x, y)| f64::from(film.mean_rgba(x, y)[1])).sum::<f64>() / 1600.0;
        assert!((found / expected - 1.0).abs() < 0.02, "block {i}: {found} for {expected}");
    }
}
