//! Renders pass by pass, prints progress, saves intermediate pictures, and stops after some time: `cargo run --release --example
//! progressive -- picture.png`

use oscura::Renderer;
use oscura::render::{CancelHandle, Event, PassOutcome};
use std::time::Duration;

fn main() -> oscura::Result<()> {
    let path = std::env::args().nth(1).unwrap_or("progressive.png".to_string());

    // Any thread may stop it: a signal handler, a button, or a clock as here.
    let cancel = CancelHandle::new();
    let clock = cancel.clone();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(20));
        clock.cancel();
    });

    let mut rendering = Renderer::new(oscura::load("assets/cornell-box.gltf")?)
        .size(128, 128)
        .samples(40)
        .cancel_by(&cancel)
        .on_event(|event| {
            if let Event::Progress { samples_done, samples_total, .. } = event {
                eprint!("\r{:3.0} %", 100.0 * samples_done as f64 / samples_total as f64);
            }
        })
        .start()?;
    loop {
        let outcome = rendering.next_pass();
        rendering.save(&path)?;
        println!("\r{path} has {:.0} samples a pixel", rendering.statistics().samples_per_pixel);
        if outcome != PassOutcome::Progressed {
            return Ok(());
        }
    }
}
