//! A table of the selected generated scenes: speed of each ray set on one thread and on all, build time, memory.

use crate::files::Result;
use crate::make::{SCENES, scene};
use crate::{Options, speeds};

/// Builds each scene, traces its rays and prints a line per set.
pub fn print(names: &str, options: &Options) -> Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    println!(
        "| scene | triangles | build s | bytes per triangle | rays | 1 thread, Mray/s | {cores} threads |"
    );
    println!("|---|---|---|---|---|---|---|");
    for name in names.split(',') {
        let world =
            scene(name).ok_or_else(|| format!("--table: {name:?} is none of {}", SCENES.join(", ")))?;
        let accel = world.build(options.tree);
        let stats = accel.stats();
        let placed = |i: &oscura::accel::AccelInstance| world.geometries[i.geometry as usize].triangles.len();
        let triangles =
            world.geometries[0].triangles.len() + world.instances.iter().map(placed).sum::<usize>();
        let bytes = stats.bytes as f64
            / (stats.triangles + stats.quads + stats.analytic.iter().sum::<u64>()).max(1) as f64;
        for (set, rays) in world.ray_sets(&accel) {
            let median = |threads: usize| -> Result<f64> {
                let options = Options { threads, any: set == "shadow", ..options.clone() };
                let (speeds, _) = speeds(&accel, &options, &rays)?;
                Ok(speeds[speeds.len() / 2])
            };
            let (one, all) = (median(1)?, median(cores)?);
            println!(
                "| {name} | {triangles} | {:.2} | {bytes:.1} | {set} | {one:.2} | {all:.2} |",
                stats.build_s
            );
        }
    }
    Ok(())
}
