//! Rooms: a hall with many lights, one lit through a slit, one with a window and many materials.

use std::fmt::Write;

/// A box of white walls from the origin to `[w, h, d]`, seen from its open end at `z = d`.
fn walls([w, h, d]: [f64; 3]) -> String {
    let mut out = String::new();
    let quads = [
        ("floor", [0.0, 0.0, d], [w, 0.0, 0.0], [0.0, 0.0, -d]),
        ("wall", [0.0, h, 0.0], [w, 0.0, 0.0], [0.0, 0.0, d]),
        ("wall", [0.0, 0.0, 0.0], [w, 0.0, 0.0], [0.0, h, 0.0]),
        ("red", [0.0, 0.0, d], [0.0, 0.0, -d], [0.0, h, 0.0]),
        ("green", [w, 0.0, 0.0], [0.0, 0.0, d], [0.0, h, 0.0]),
    ];
    for (material, corner, u, v) in quads {
        let _ = write!(
            out,
            "\n[[objects]]\nquad = {{ corner = {corner:?}, u = {u:?}, v = {v:?} }}\nmaterial = \"{material}\"\n"
        );
    }
    out
}

const WALLS: &str = r#"
floor = { type = "lambert", color = 0.5 }
wall = { type = "lambert", color = 0.75 }
red = { type = "lambert", color = [0.6, 0.1, 0.08] }
green = { type = "lambert", color = [0.1, 0.45, 0.12] }
"#;

/// A hall with `lamps` small square lights on ceiling and walls, in rows; the total power is constant.
pub fn hall(lamps: u32) -> String {
    let mut out = format!(
        "camera = {{ look_from = [10, 3, 29], look_at = [10, 2.2, 0], vfov = 45, aspect_ratio = 1.5 }}\n\n[materials]{WALLS}"
    );
    let radiance = 60_000.0 / f64::from(lamps);
    let _ = writeln!(
        out,
        "lamp = {{ type = \"emissive\", radiance = [{radiance}, {}, {}] }}",
        0.8 * radiance,
        0.6 * radiance
    );
    out += &walls([20.0, 6.0, 30.0]);
    let columns = (f64::from(lamps) * 20.0 / 30.0).sqrt().ceil().max(1.0) as u32;
    let rows = lamps.div_ceil(columns);
    for i in 0..lamps {
        let (column, row) = (i % columns, i / columns);
        let x = 20.0 * (f64::from(column) + 0.5) / f64::from(columns);
        let z = 30.0 * (f64::from(row) + 0.5) / f64::from(rows);
        // Heights differ, so that the picture shows light from near and far.
        let y = 5.9 - 2.5 * f64::from(i * 7 % 11) / 11.0;
        let _ = write!(
            out,
            "\n[[objects]]\nquad = {{ corner = [{x}, {y}, {z}], u = [0.05, 0, 0], v = [0, 0, 0.05] }}\nmaterial = \"lamp\"\n"
        );
    }
    for i in 0..12 {
        let (x, z) = (2.0 + f64::from(i % 4) * 5.0, 4.0 + f64::from(i / 4) * 7.0);
        let top = 0.6 + f64::from(i * 5 % 7) * 0.3;
        let _ = write!(
            out,
            "\n[[objects]]\nbox = {{ min = [{x}, 0, {z}], max = [{}, {top}, {}] }}\nmaterial = \"wall\"\n",
            x + 1.2,
            z + 1.2
        );
    }
    out
}

/// A room lit only through a slit next to a wall, behind which the light is.
pub fn slit() -> String {
    let head = format!(
        "camera = {{ look_from = [2, 1.6, 7.5], look_at = [2, 1.4, 0], vfov = 50, aspect_ratio = 1 }}\n\n[materials]{WALLS}\
         lamp = {{ type = \"emissive\", radiance = [600, 500, 400] }}\n"
    );
    let inside = r#"
[[objects]]
box = { min = [0, 0, 2], max = [3.7, 3, 2.1] }
material = "wall"

[[objects]]
quad = { corner = [0, 0, 8], u = [0, 3, 0], v = [4, 0, 0] }
material = "wall"

[[objects]]
quad = { corner = [0.5, 2.95, 0.5], u = [1, 0, 0], v = [0, 0, 1] }
material = "lamp"

[[objects]]
sphere = { center = [1.2, 0.5, 4], radius = 0.5 }
material = "wall"

[[objects]]
box = { min = [2.4, 0, 3.4], max = [3.2, 1, 4.2] }
material = "green"
"#;
    // A coloured wall at the slit would tint all light.
    head + &walls([4.0, 3.0, 8.0]).replace("\"green\"", "\"wall\"") + inside
}

/// A room with a window, a light, and thirty objects of as many materials.
pub fn interior() -> String {
    let mut out = format!(
        "environment = {{ image = \"sky.hdr\" }}\n\
         camera = {{ look_from = [3, 1.7, 7.6], look_at = [3, 1, 0], vfov = 48, aspect_ratio = 1.5 }}\n\n[textures]\n\
         planks = {{ type = \"marble\", frequency = 2, low = [0.2, 0.1, 0.05], high = [0.5, 0.3, 0.15] }}\n\
         tiles = {{ type = \"checker\", even = 0.8, odd = 0.3, size = 0.3 }}\n\n[materials]{WALLS}\
         lamp = {{ type = \"emissive\", radiance = [25, 22, 18] }}\n"
    );
    for i in 0..30 {
        let share = f64::from(i) / 29.0;
        let color = [0.2 + 0.6 * share, 0.8 - 0.6 * share, 0.3 + 0.5 * f64::from(i % 3) / 2.0];
        let _ = match i % 6 {
            0 => writeln!(
                out,
                "m{i} = {{ type = \"pbr\", base_color = \"planks\", roughness = {} }}",
                0.2 + 0.6 * share
            ),
            1 => writeln!(
                out,
                "m{i} = {{ type = \"pbr\", base_color = {color:?}, metallic = 1, roughness = {} }}",
                0.1 + 0.5 * share
            ),
            2 => writeln!(
                out,
                "m{i} = {{ type = \"pbr\", base_color = {color:?}, clearcoat = 1, roughness = 0.6 }}"
            ),
            3 => writeln!(
                out,
                "m{i} = {{ type = \"dielectric\", roughness = {} }}",
                if i > 15 { 0.2 } else { 0.0 }
            ),
            4 => writeln!(out, "m{i} = {{ type = \"lambert\", color = \"tiles\" }}"),
            _ => writeln!(
                out,
                "m{i} = {{ type = \"pbr\", base_color = {color:?}, sheen_color = [0.8, 0.8, 0.8], sheen_roughness = 0.4 }}"
            ),
        };
    }
    out += &walls([6.0, 3.0, 8.0]).replacen("material = \"green\"", "material = \"red\"", 1).replace(
        // The wall with the window is made of four parts.
        "corner = [6.0, 0.0, 0.0], u = [0.0, 0.0, 8.0], v = [0.0, 3.0, 0.0]",
        "corner = [6.0, 0.0, 0.0], u = [0.0, 0.0, 8.0], v = [0.0, 1.0, 0.0]",
    );
    out += r#"
[[objects]]
quad = { corner = [6, 2.4, 0], u = [0, 0, 8], v = [0, 0.6, 0] }
material = "wall"

[[objects]]
quad = { corner = [6, 1, 0], u = [0, 0, 2.5], v = [0, 1.4, 0] }
material = "wall"

[[objects]]
quad = { corner = [6, 1, 5], u = [0, 0, 3], v = [0, 1.4, 0] }
material = "wall"

[[objects]]
quad = { corner = [0, 0, 8], u = [0, 3, 0], v = [6, 0, 0] }
material = "wall"

[[objects]]
quad = { corner = [2.6, 2.95, 3], u = [0.8, 0, 0], v = [0, 0, 0.8] }
material = "lamp"
"#;
    for i in 0..30 {
        let (x, z) = (0.5 + f64::from(i % 10) * 0.55, 1.0 + f64::from(i / 10) * 1.4);
        let shape = match i % 2 {
            0 => format!("sphere = {{ center = [{x}, 0.25, {z}], radius = 0.25 }}"),
            _ => format!(
                "box = {{ min = [{}, 0, {}], max = [{}, 0.6, {}] }}",
                x - 0.2,
                z - 0.2,
                x + 0.2,
                z + 0.2
            ),
        };
        let _ = write!(out, "\n[[objects]]\n{shape}\nmaterial = \"m{i}\"\n");
    }
    out
}
