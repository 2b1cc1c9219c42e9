//! Renders the gallery.
//!
//! `oscura-gallery FOLDER [PICTURE...] [--quick | --draft] [--threads N] [--publish]`
//!
//! Every scene of the gallery (or those named) becomes `NAME.exr` and `NAME.png` in FOLDER, which must exist, with `contact-
//! sheet.png` and `.jpg`, `hero.jpg`, and `times.md`. `--quick` renders at a third of the size with an eighth of the samples: a
//! preview in a minute or two; `--draft` at full size with a quarter of the samples, enough for the contact sheet.
//!
//! `physics` selects media, motion, spectral rendering and skies; pictures of these alone become `contact-sheet-physics.png` and
//! `.jpg`, without a table.
//!
//! `--publish` also copies the hero and the contact sheet to `assets/` and the table into the guide's page on speed.
//!
//! It can be run from anywhere: the scenes are those of the source tree it was built from.

mod entries;
mod publish;
mod render;
mod sheet;
mod table;

use entries::{ENTRIES, Entry, HERO, PHYSICS, THREADS};
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use oscura::error::{Error, Result};
use oscura::output::{Format, encode_rgb8, write_atomically};
use render::{Quality, Shot, srgb_byte};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use table::{Row, Threads};

const JPEG_QUALITY: u8 = 82;

/// File names of the contact sheets: of the whole gallery, and of `physics`.
const SHEETS: [&str; 2] = ["contact-sheet", "contact-sheet-physics"];

struct Arguments {
    folder: PathBuf,
    entries: Vec<&'static Entry>,
    quality: Quality,
    publish: bool,
}

fn main() -> ExitCode {
    match parse(std::env::args().skip(1)).and_then(|arguments| run(&arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn parse(mut words: impl Iterator<Item = String>) -> Result<Arguments> {
    let usage = || {
        Error::usage(
            "usage: oscura-gallery FOLDER [PICTURE...] [--quick | --draft] [--threads N] [--publish]",
        )
    };
    let mut quality = Quality { shrink: 1, fewer: 1, threads: None };
    let (mut folder, mut chosen, mut publish) = (None, Vec::new(), false);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--quick" => (quality.shrink, quality.fewer) = (3, 8),
            "--draft" => (quality.shrink, quality.fewer) = (1, 4),
            "--publish" => publish = true,
            "--threads" => {
                let number = words.next().and_then(|n| n.parse().ok()).filter(|n| (1..=1024).contains(n));
                quality.threads = Some(number.ok_or_else(usage)?);
            }
            option if option.starts_with('-') => return Err(usage()),
            _ if folder.is_none() => folder = Some(PathBuf::from(word)),
            "physics" => chosen.extend(PHYSICS),
            name => chosen.push(all().find(|e| e.name() == name).ok_or_else(|| unknown(name))?),
        }
    }
    let entries = if chosen.is_empty() { ENTRIES.iter().collect() } else { chosen };
    Ok(Arguments { folder: folder.ok_or_else(usage)?, entries, quality, publish })
}

/// Entries of both sheets.
fn all() -> impl Iterator<Item = &'static Entry> {
    ENTRIES.iter().chain(PHYSICS)
}

fn unknown(name: &str) -> Error {
    let names: Vec<&str> = all().map(Entry::name).collect();
    Error::usage(format!("there is no picture '{name}'; there are: {}", names.join(", ")))
}

/// The folder of the scenes.
fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes")
}

fn run(arguments: &Arguments) -> Result<()> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder).map_err(|e| Error::output(folder, format!("can't be created: {e}")))?;
    let quality = arguments.quality;
    let (mut rows, mut tiles) = (Vec::new(), Vec::new());
    for entry in &arguments.entries {
        let shot = Shot::render(&scenes().join(entry.scene), quality)?;
        eprintln!("{}: {:.1} s", entry.name(), shot.render_s);
        shot.write(folder, entry.name())?;
        if entry.name() == HERO {
            let size = (shot.picture.film().width(), shot.picture.film().height());
            let hero = RgbImage::from_fn(size.0, size.1, |x, y| image::Rgb(shot.linear(x, y).map(srgb_byte)));
            write_jpeg(&folder.join("hero.jpg"), &hero)?;
        }
        rows.push(Row::new(entry, &shot, quality.shrink == 1 && quality.fewer == 1));
        tiles.push(sheet::Tile::new(&shot, entry.label));
    }
    let is_physics = arguments.entries.iter().all(|e| PHYSICS.iter().any(|p| p.scene == e.scene));
    let name = if is_physics { SHEETS[1] } else { SHEETS[0] };
    let sheet = sheet::contact_sheet(&tiles);
    write_jpeg(&folder.join(format!("{name}.jpg")), &sheet)?;
    let path = folder.join(format!("{name}.png"));
    let png = encode_rgb8(&sheet, sheet.width(), sheet.height(), Format::Png)
        .map_err(|e| Error::output(&path, e))?;
    write_atomically(&path, &png)?;
    if is_physics {
        return if arguments.publish { publish::publish(folder, None) } else { Ok(()) };
    }
    let threads = compare_threads(quality)?;
    let text = table::markdown(&rows, Some(&threads));
    write_atomically(folder.join("times.md"), text.as_bytes())?;
    print!("{text}");
    if arguments.publish {
        publish::publish(folder, Some(&text))?;
    }
    if !threads.is_equal {
        return Err(Error::usage("the number of threads changes the picture"));
    }
    Ok(())
}

/// The same scene with one thread and with all.
fn compare_threads(quality: Quality) -> Result<Threads> {
    let many = quality.threads.or(std::thread::available_parallelism().ok().map(usize::from)).unwrap_or(1);
    let shoot =
        |threads| Shot::render(&scenes().join(THREADS), Quality { threads: Some(threads), ..quality });
    let (one, all) = (shoot(1)?, shoot(many)?);
    let bits = |shot: &Shot, x, y| shot.picture.film().mean_rgba(x, y).map(f32::to_bits);
    let (w, h) = (one.picture.film().width(), one.picture.film().height());
    let is_equal =
        (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).all(|(x, y)| bits(&one, x, y) == bits(&all, x, y));
    Ok(Threads { scene: THREADS, threads: many, seconds: [one.render_s, all.render_s], is_equal })
}

fn write_jpeg(path: &Path, picture: &RgbImage) -> Result<()> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .encode_image(picture)
        .map_err(|e| Error::output(path, e.to_string()))?;
    write_atomically(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Result<Arguments> {
        parse(line.split_whitespace().map(str::to_string))
    }

    #[test]
    fn arguments_are_parsed_or_refused() {
        let all = words("out --quick --threads 3").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((all.entries.len(), all.quality.fewer, all.quality.threads), (ENTRIES.len(), 8, Some(3)));
        let some = words("out metals pyramid").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(some.entries.iter().map(|e| e.name()).collect::<Vec<_>>(), ["metals", "pyramid"]);
        for wrong in ["", "--quick", "out --threads", "out --threads 0", "out --slow", "out metal"] {
            assert!(words(wrong).is_err(), "{wrong}");
        }
    }

    /// Every scene of the gallery loads without a warning, and every thesis scene is in it.
    #[test]
    fn scenes_and_entries_match() {
        for entry in ENTRIES {
            let loaded = oscura::load::load(scenes().join(entry.scene), &Default::default());
            let loaded = loaded.unwrap_or_else(|e| panic!("{e}"));
            assert!(loaded.warnings.is_empty(), "{}: {}", entry.scene, loaded.warnings[0]);
            assert!(entry.label.len() * 8 <= 256, "{}", entry.label);
        }
        for file in std::fs::read_dir(scenes().join("thesis")).expect("the thesis's scenes") {
            let name = file.expect("an entry").file_name().to_string_lossy().into_owned();
            let scene = format!("thesis/{name}");
            assert!(ENTRIES.iter().any(|e| e.scene == scene), "{scene} is not in the gallery");
        }
    }
}
