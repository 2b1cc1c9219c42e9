//! Scene files with too many objects to place by hand.

use crate::random::Random;
use std::fmt::Write;

/// Appends a line to a string; infallible.
macro_rules! line {
    ($text:expr, $($arguments:tt)*) => {
        let _ = writeln!($text, $($arguments)*);
    };
}

fn object(text: &mut String, shape: &str, material: &str) {
    line!(text, "\n[[objects]]\n{shape}\nmaterial = \"{material}\"");
}

fn sphere(center: [f64; 3], radius: f64) -> String {
    let [x, y, z] = center;
    format!("sphere = {{ center = [{x:.3}, {y:.3}, {z:.3}], radius = {radius} }}")
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// Materials of the small spheres: name and line.
fn palette(random: &mut Random) -> Vec<(String, String)> {
    let mut list = Vec::new();
    for i in 0..24 {
        let [r, g, b] = [0; 3].map(|_| random.unit() * random.unit());
        let name = format!("diffuse{i}");
        list.push((
            name.clone(),
            format!("{name} = {{ type = \"lambert\", color = [{r:.3}, {g:.3}, {b:.3}] }}"),
        ));
    }
    for i in 0..10 {
        let [r, g, b] = [0; 3].map(|_| random.between(0.5, 1.0));
        let fuzz = if i < 4 { 0.0 } else { random.between(0.05, 0.5) };
        let name = format!("metal{i}");
        let line =
            format!("{name} = {{ type = \"metal\", color = [{r:.3}, {g:.3}, {b:.3}], fuzz = {fuzz:.2} }}");
        list.push((name, line));
    }
    list
}

/// Random spheres on a checkerboard around three large ones: water, Lambertian, metal.
pub fn random_spheres() -> String {
    let mut random = Random::new(2024);
    let palette = palette(&mut random);
    let mut text = String::from(RANDOM_SPHERES);
    for (_, line) in &palette {
        line!(text, "{line}");
    }
    text.push_str(LARGE_SPHERES);
    let large = [[-4.0, 1.0, 0.0], [0.0, 1.0, 0.0], [4.0, 1.0, 0.0]];
    for a in -11..11 {
        for b in -11..11 {
            let center = [f64::from(a) + 0.9 * random.unit(), 0.2, f64::from(b) + 0.9 * random.unit()];
            let choice = random.unit();
            let pick = random.unit();
            if large.iter().any(|&c| distance(center, [c[0], 0.2, c[2]]) < 1.1) {
                continue;
            }
            let material = match choice {
                c if c < 0.7 => &palette[(pick * 24.0) as usize].0,
                c if c < 0.9 => &palette[24 + (pick * 10.0) as usize].0,
                _ => "water",
            };
            object(&mut text, &sphere(center, 0.2), material);
        }
    }
    text
}

/// Three hundred small lights over a plain of boxes.
pub fn many_lights() -> String {
    let mut random = Random::new(99);
    let mut text = String::from(MANY_LIGHTS);
    for i in 0..8 {
        let [r, g, b] = hue(f64::from(i) / 8.0).map(|c| 4.0 + 26.0 * c);
        line!(text, "lamp{i} = {{ type = \"emissive\", radiance = [{r:.2}, {g:.2}, {b:.2}] }}");
    }
    text.push_str(PLAIN);
    for (a, b) in (-8..8).flat_map(|a| (-8..8).map(move |b| (a, b))) {
        let x = f64::from(a) * 1.5 + random.between(0.1, 0.4);
        let z = f64::from(b) * 1.5 + random.between(0.1, 0.4);
        let height = 0.15 + 1.1 * random.unit() * random.unit();
        let [x1, z1] = [x + 1.0, z + 1.0];
        let shape = format!("box = {{ min = [{x:.3}, 0, {z:.3}], max = [{x1:.3}, {height:.3}, {z1:.3}] }}");
        object(&mut text, &shape, "white");
    }
    for i in 0..300 {
        let center = [random.between(-12.0, 12.0), random.between(1.5, 2.2), random.between(-12.0, 12.0)];
        object(&mut text, &sphere(center, 0.09), &format!("lamp{}", i % 8));
    }
    text
}

/// A saturated colour of a hue in 0..1.
fn hue(h: f64) -> [f64; 3] {
    [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|shift| {
        let away = (h - shift).rem_euclid(1.0);
        let away = away.min(1.0 - away);
        (1.0 - 3.0 * away).clamp(0.0, 1.0).powi(2)
    })
}

/// The final scene with all features: the hand-written part with a ground of boxes and a cluster of spheres.
pub fn everything() -> String {
    let mut random = Random::new(5);
    let mut text = String::from(EVERYTHING);
    for (a, b) in (0..18).flat_map(|a| (0..16).map(move |b| (a, b))) {
        let (x, z) = (f64::from(a) - 9.0, f64::from(b) - 9.0);
        let top = random.between(-0.35, 0.0);
        let shape =
            format!("box = {{ min = [{x}, -1, {z}], max = [{:.1}, {top:.3}, {:.1}] }}", x + 1.0, z + 1.0);
        object(&mut text, &shape, if (a + b) % 2 == 0 { "moss" } else { "grass" });
    }
    let mut placed: Vec<[f64; 3]> = Vec::new();
    while placed.len() < 600 {
        let p = [0; 3].map(|_| random.between(-0.9, 0.9));
        if placed.iter().all(|&q| distance(p, q) > 0.12) {
            object(&mut text, &sphere(p, 0.09), "white");
            line!(text, "transform = [{{ euler = [0, 20, 10] }}, {{ translate = [-0.7, 3.6, -3] }}]");
            placed.push(p);
        }
    }
    text
}

const RANDOM_SPHERES: &str = include_str!("scenes/random-spheres-head.toml");
const LARGE_SPHERES: &str = include_str!("scenes/random-spheres-large.toml");
const MANY_LIGHTS: &str = include_str!("scenes/many-lights-head.toml");
const PLAIN: &str = include_str!("scenes/many-lights-plain.toml");
const EVERYTHING: &str = include_str!("scenes/everything.toml");

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The committed scenes are up to date.
    #[test]
    fn committed_scenes_are_up_to_date() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        for (name, text) in [
            ("thesis/random-spheres.toml", random_spheres()),
            ("thesis/final-scene.toml", everything()),
            ("many-lights.toml", many_lights()),
        ] {
            let committed = std::fs::read_to_string(root.join(name)).unwrap_or_default();
            assert!(committed == text, "{name} is out of date: run `oscura-assets scenes`");
        }
    }
}
