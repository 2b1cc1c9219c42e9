//! Renders a file with depth and normals for compositing:
//! `cargo run --release --example render -- scene.glb picture.exr`

use oscura::Renderer;
use oscura::film::Aov;

fn main() -> oscura::Result<()> {
    let mut args = std::env::args().skip(1);
    let scene = args.next().unwrap_or("assets/cornell-box.gltf".to_string());
    let path = args.next().unwrap_or("render.exr".to_string());

    let picture = Renderer::new(oscura::load(scene)?)
        .width(200)
        .samples(64)
        .aovs([Aov::Depth, Aov::Normal])
        .render()?;
    let warnings = picture.save(&path)?;

    // Everything dropped or repaired is reported.
    picture.warnings().iter().chain(&warnings).for_each(|warning| eprintln!("warning: {warning}"));
    println!("{path}: {:.1} s", picture.statistics().render_s);
    Ok(())
}
