//! Refusing what won't fit into memory before work starts.

use super::args::RenderArgs;
use super::process;
use oscura::error::{Error, Result};
use oscura::film::Source;
use oscura::load::Loaded;
use oscura::output::part::PartHeader;
use oscura::render::{Labels, Settled, film_bytes, guiding_bytes, splat_bytes};
use oscura::scene::{Model, Moving, Scene};
use std::path::PathBuf;

/// Memory that building the tree over a triangle takes at most, bytes.
const BYTES_A_TRIANGLE: u64 = 150;

/// Memory that each key of a triangle takes that changes its shape, bytes: in the tree, and twice with its vertices.
const BYTES_A_KEY: u64 = 100;

/// Is the file alone too large?
pub(super) fn before_loading(args: &RenderArgs) -> Result<()> {
    let size = process::size_of(&args.scene).unwrap_or(0);
    refuse(args.long.memory_limit, &[("the file", size)]).map_err(smaller)
}

/// Will the picture of these parts fit?
pub(super) fn before_merging(parts: &[(PathBuf, PartHeader)]) -> Result<()> {
    let bytes_of = |pixels: u64, header: &PartHeader| {
        let a_pixel = header.channels.layout().map_or(0, |layout| layout.bytes_per_pixel());
        pixels.saturating_mul(a_pixel)
    };
    let whole = |(_, h): &(PathBuf, PartHeader)| bytes_of(u64::from(h.width) * u64::from(h.height), h);
    let part = |(_, h): &(PathBuf, PartHeader)| {
        bytes_of(u64::from(h.region.width()) * u64::from(h.region.height()), h)
    };
    let [picture, largest] = [parts.iter().map(whole).max(), parts.iter().map(part).max()];
    refuse(None, &[("the picture", picture.unwrap_or(0)), ("the largest part", largest.unwrap_or(0))])
        .map_err(|error| error.with_help("merge it on a machine with more"))
}

/// Will the loaded scene, what is built of it, and the picture fit?
pub(super) fn before_building(args: &RenderArgs, loaded: &Loaded, settled: &Settled) -> Result<()> {
    let scene = &loaded.scene;
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let keys = |(&mesh, moving): (&usize, &Moving<_>)| {
        scene.meshes.get(mesh).map_or(0, |mesh| mesh.triangles.len() * moving.keys.len())
    };
    let of_keys: usize = scene.motion.meshes.iter().map(keys).sum();
    let labels = Labels::of(scene, &settled.options);
    refuse(
        args.long.memory_limit,
        &[
            ("the scene as loaded", process::memory_now().unwrap_or(0)),
            (
                "building the tree over its triangles",
                triangles as u64 * BYTES_A_TRIANGLE + of_keys as u64 * BYTES_A_KEY,
            ),
            ("the picture", film_bytes(&settled.options, &labels)),
            ("light from lamps", if may_send(scene) { splat_bytes(&settled.options, &labels) } else { 0 }),
            ("learning what guides paths", guiding_bytes(&settled.options)),
            (
                "taking the noise out",
                if args.picture.denoise { denoising_bytes(settled, &labels) } else { 0 },
            ),
        ],
    )
    .map_err(smaller)
}

/// May something in the scene send light on, so that it shows as caustics?
fn may_send(scene: &Scene) -> bool {
    scene.materials.iter().any(|material| !matches!(material.model, Model::Lambert { .. }))
}

fn smaller(error: Error) -> Error {
    error.with_help("make the picture smaller, render parts of it by --region, or leave out --aov")
}

/// What denoising takes besides the film, at most: planes of the picture, its guides and the parts of its light, before and
/// after.
fn denoising_bytes(settled: &Settled, labels: &Labels) -> u64 {
    let options = &settled.options;
    let planes =
        60 + 9 * (options.aovs.of(Source::PartOfColor).iter().count() + labels.light_groups.len()) as u64;
    u64::from(options.width) * u64::from(options.height) * 4 * planes
}

/// In GiB, or in MiB where that says more.
fn readable(bytes: u64) -> String {
    match bytes >> 30 {
        0 => format!("{:.0} MiB", bytes as f64 / f64::from(1u32 << 20)),
        _ => format!("{:.1} GiB", bytes as f64 / f64::from(1u32 << 30)),
    }
}

/// Refuses what takes more than there may be: what is allowed, or what the machine has.
fn refuse(allowed: Option<u64>, needed: &[(&str, u64)]) -> Result<()> {
    let Some(limit) = allowed.or_else(process::memory_of_machine) else { return Ok(()) };
    let all = needed.iter().fold(0u64, |sum, (_, bytes)| sum.saturating_add(*bytes));
    if all <= limit {
        return Ok(());
    }
    let items: Vec<String> = (needed.iter().filter(|(_, bytes)| *bytes > 0))
        .map(|(what, bytes)| format!("{what} {}", readable(*bytes)))
        .collect();
    let whose = if allowed.is_some() { "--memory-limit allows" } else { "the machine has" };
    let message = format!("this takes more memory than {whose}, {}: {}", readable(limit), items.join(", "));
    Err(Error::usage(message))
}
