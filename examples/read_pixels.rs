//! Renders, and reads pixels and AOVs instead of writing a file: `cargo run --release --example read_pixels`

use oscura::Renderer;
use oscura::film::Aov;

fn main() -> oscura::Result<()> {
    let scene = oscura::load("assets/cornell-box.gltf")?;
    let picture = Renderer::new(scene).size(64, 64).samples(16).aovs([Aov::Depth]).render()?;
    let film = picture.film();

    // Colours are linear, premultiplied by alpha, in rows from the top.
    let rgba = film.rgba();
    let luminance = |[r, g, b, _]: [f32; 4]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let mean = rgba.iter().copied().map(luminance).sum::<f32>() / rgba.len() as f32;
    println!("mean luminance {mean:.3}");

    // Colour and AOVs are channels, named as in files.
    for plane in film.planes() {
        println!("plane {}", plane.name);
    }
    let depth = film.plane("Z").expect("depth was asked for").into_floats();
    let nearest = depth.iter().copied().fold(f32::INFINITY, f32::min);
    let brightest = rgba.iter().copied().map(luminance).fold(0.0, f32::max);
    println!("nearest point {nearest:.2} m, brightest pixel {brightest:.1}");
    Ok(())
}
