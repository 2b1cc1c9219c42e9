//! Benchmark of EXR output: renders a picture of 1920 x 1080 pixels with 20 channels, encodes it as an EXR several times, and
//! writes the last one.
//!
//! `writing FILE.exr [--threads N] [--repeat N] [--scene SCENE]`
//!
//! Prints a JSON object: the seconds of each run, and the size of the file. `tools/bench/writing.py` compares with the OpenEXR
//! library.

use oscura::Renderer;
use oscura::error::{Error, Result};
use oscura::film::{Aov, AovSet};
use oscura::output::{Format, encode, write_atomically};
use oscura::render::in_pool;
use std::path::PathBuf;
use std::time::Instant;

struct Arguments {
    file: PathBuf,
    scene: PathBuf,
    threads: Option<usize>,
    repeat: u32,
}

fn parse(mut list: impl Iterator<Item = String>) -> Result<Arguments> {
    let usage = || Error::usage("usage: writing FILE.exr [--threads N] [--repeat N] [--scene SCENE]");
    let mut arguments = Arguments {
        file: PathBuf::new(),
        scene: PathBuf::from("assets/cornell-box.gltf"),
        threads: None,
        repeat: 5,
    };
    while let Some(name) = list.next() {
        let mut value = || list.next().ok_or_else(usage);
        match name.as_str() {
            "--threads" => arguments.threads = Some(value()?.parse().map_err(|_| usage())?),
            "--repeat" => arguments.repeat = value()?.parse().map_err(|_| usage())?,
            "--scene" => arguments.scene = PathBuf::from(value()?),
            file if !file.starts_with('-') => arguments.file = PathBuf::from(file),
            _ => return Err(usage()),
        }
    }
    if arguments.file.as_os_str().is_empty() || arguments.repeat == 0 { Err(usage()) } else { Ok(arguments) }
}

fn run(arguments: &Arguments) -> Result<()> {
    let aovs = AovSet::from([
        Aov::Depth,
        Aov::Normal,
        Aov::Albedo,
        Aov::DiffuseDirect,
        Aov::DiffuseIndirect,
        Aov::GlossyDirect,
    ]);
    let scene = oscura::load(&arguments.scene)?;
    let picture = Renderer::new(scene).size(1920, 1080).samples(4).aovs(aovs).render()?;
    let channels = picture.film().planes().count();
    let mut seconds = Vec::new();
    let mut bytes = Vec::new();
    for _ in 0..arguments.repeat {
        let start = Instant::now();
        bytes = encode(picture.film(), Format::Exr, picture.output_options(), &arguments.file)?.bytes;
        seconds.push(start.elapsed().as_secs_f64());
    }
    write_atomically(&arguments.file, &bytes)?;
    println!("{{\"channels\": {channels}, \"bytes\": {}, \"seconds\": {seconds:?}}}", bytes.len());
    Ok(())
}

fn main() -> Result<()> {
    let arguments = parse(std::env::args().skip(1))?;
    in_pool(arguments.threads, || run(&arguments))?
}
