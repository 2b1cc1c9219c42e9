//! A model, a sky, and scenes using them.

/// Rings of the model and vertices per ring: 2 * 400 * 200 = 160,000 triangles.
pub const RINGS: u32 = 400;
/// Vertices of a ring.
pub const SIDES: u32 = 200;

/// Size of the environment image.
const SKY: (u32, u32) = (256, 128);

/// Metal and plastic under an environment image.
pub const ENVIRONMENT: &str = r#"
environment = { image = "sky.hdr" }
camera = { look_from = [3, 1.5, 5], look_at = [0, 0.7, 0], vfov = 35, aspect_ratio = 1.5 }

[materials]
ground = { type = "lambert", color = 0.5 }
gold = { type = "metal", color = [1, 0.77, 0.34], roughness = 0.3 }
plastic = { type = "pbr", base_color = [0.1, 0.3, 0.6], roughness = 0.4 }

[[objects]]
sphere = { center = [-1.1, 1, 0], radius = 1 }
material = "gold"

[[objects]]
sphere = { center = [1.1, 1, 0], radius = 1 }
material = "plastic"

[[objects]]
quad = { corner = [-20, 0, 20], u = [40, 0, 0], v = [0, 0, -40] }
material = "ground"
"#;

/// A model under a soft sky.
pub const MODEL: &str = r#"
environment = { sky = {} }
camera = { look_from = [1.5, 2.5, 3], look_at = [0, 0, 0], vfov = 40, aspect_ratio = 1.5 }

[materials]
clay = { type = "lambert", color = [0.7, 0.5, 0.4] }

[[objects]]
mesh = "model.ply"
material = "clay"
"#;

/// The model in rough metal under the environment image.
pub const METAL: &str = r#"
environment = { image = "sky.hdr" }
camera = { look_from = [1.5, 2.5, 3], look_at = [0, 0, 0], vfov = 40, aspect_ratio = 1 }

[materials]
silver = { type = "metal", name = "silver", roughness = 0.35 }
ground = { type = "lambert", color = 0.4 }

[[objects]]
mesh = "model.ply"
material = "silver"

[[objects]]
quad = { corner = [-20, -0.45, 20], u = [40, 0, 0], v = [0, 0, -40] }
material = "ground"
"#;

/// Textured spheres on a textured floor under the environment image.
pub const TEXTURED: &str = r#"
environment = { image = "sky.hdr" }
camera = { look_from = [0, 1.2, 5], look_at = [0, 0.9, 0], vfov = 38, aspect_ratio = 1.5 }

[textures]
marble = { type = "marble", frequency = 6, low = [0.05, 0.04, 0.03], high = [0.9, 0.8, 0.7] }
tiles = { type = "checker", even = 0.75, odd = [0.1, 0.12, 0.2], size = 0.15 }

[materials]
stone = { type = "pbr", base_color = "marble", roughness = 0.3 }
steel = { type = "pbr", base_color = "tiles", metallic = 1, roughness = 0.25 }
floor = { type = "pbr", base_color = "tiles", roughness = 0.4 }

[[objects]]
sphere = { center = [-1.1, 1, 0], radius = 1 }
material = "stone"

[[objects]]
sphere = { center = [1.1, 1, 0], radius = 1 }
material = "steel"

[[objects]]
quad = { corner = [-20, 0, 20], u = [40, 0, 0], v = [0, 0, -40] }
material = "floor"
"#;

/// The model a hundred kilometres from the origin.
pub const FAR: &str = r#"
environment = { sky = {} }
camera = { look_from = [100001.5, 2.5, 100003], look_at = [100000, 0, 100000], vfov = 40, aspect_ratio = 1.5 }

[materials]
clay = { type = "lambert", color = [0.7, 0.5, 0.4] }

[[objects]]
mesh = "model.ply"
material = "clay"
transform = [{ translate = [100000, 0, 100000] }]
"#;

/// A wavy torus of radii 1 and 0.4 as binary PLY: `2 * rings * sides` triangles.
pub fn torus(rings: u32, sides: u32) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        rings * sides,
        2 * rings * sides
    );
    let mut bytes = header.into_bytes();
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    for (i, j) in (0..rings).flat_map(|i| (0..sides).map(move |j| (i, j))) {
        let (u, v) = (turn(i, rings), turn(j, sides));
        let radius = 0.4 + 0.05 * (9.0 * u).sin() * (5.0 * v).cos();
        let ring = 1.0 + radius * v.cos();
        for x in [ring * u.cos(), radius * v.sin(), -ring * u.sin()] {
            bytes.extend((x as f32).to_le_bytes());
        }
    }
    let at = |i: u32, j: u32| (i % rings) * sides + j % sides;
    for (i, j) in (0..rings).flat_map(|i| (0..sides).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        for corner in [[a, b, c], [a, c, d]] {
            bytes.push(3);
            bytes.extend(corner.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    bytes
}

/// A blue sky over grey ground with a sun of 4 texels, 2000 times as bright as the sky, as uncompressed Radiance HDR.
pub fn sky() -> Vec<u8> {
    let (width, height) = SKY;
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        // A value is mantissa * 2^(exponent - 136).
        let sun = (30..32).contains(&y) && (60..62).contains(&x);
        bytes.extend(match sun {
            true => [250, 225, 190, 139],
            false if 2 * y < height => [100, 140, 220, 128],
            false => [80, 75, 70, 127],
        });
    }
    bytes
}
