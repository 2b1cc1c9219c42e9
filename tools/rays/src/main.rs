//! `oscura-rays`: a ray tracing benchmark that reads files of rays and a mesh and prints one line of JSON; also generates such
//! files. See README.md.

mod files;
mod make;
mod table;
mod world;

use cpu_time::ProcessTime;
use files::Result;
use oscura::accel::{Accel, TreeQuality};
use oscura::math::{Hit, Ray};
use oscura::simd::{Level, best_level};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};
use world::World;

const USAGE: &str =
    "usage: oscura-rays --tri F.tri --rays F.rays --mode closest|any [--threads N] [--reps N] \
[--level avx512|avx2|neon|scalar] [--batch N] [--hits out.hits]
       oscura-rays --make cornell|rocks|terrain|FILE.obj --out DIR
       oscura-rays --table cornell,rocks,terrain,field [--reps N] [--level ...] [--batch N]
       --tree fast|full with either";

/// Command-line arguments.
#[derive(Clone)]
struct Options {
    tri: Option<PathBuf>,
    rays: Option<PathBuf>,
    hits: Option<PathBuf>,
    make: Option<String>,
    table: Option<String>,
    out: PathBuf,
    any: bool,
    threads: usize,
    reps: usize,
    batch: usize,
    level: Level,
    tree: TreeQuality,
}

fn parse(mut args: impl Iterator<Item = String>) -> Result<Options> {
    let mut options = Options {
        tri: None,
        rays: None,
        hits: None,
        make: None,
        table: None,
        out: PathBuf::from("."),
        any: false,
        threads: 1,
        reps: 5,
        batch: 4096,
        level: best_level(),
        tree: TreeQuality::Full,
    };
    while let Some(key) = args.next() {
        let value = args.next().ok_or_else(|| format!("{key}: a value is missing\n{USAGE}"))?;
        let number = || match value.parse() {
            Ok(n) if n > 0 => Ok(n),
            _ => Err(format!("{key}: {value:?} is not a number above 0")),
        };
        match key.as_str() {
            "--tri" => options.tri = Some(value.into()),
            "--rays" => options.rays = Some(value.into()),
            "--hits" => options.hits = Some(value.into()),
            "--make" => options.make = Some(value),
            "--table" => options.table = Some(value),
            "--out" => options.out = value.into(),
            "--mode" => options.any = mode(&value)?,
            "--threads" => options.threads = number()?,
            "--reps" => options.reps = number()?,
            "--batch" => options.batch = number()?,
            "--level" => options.level = level(&value)?,
            "--tree" => options.tree = tree(&value)?,
            _ => return Err(format!("{key}: unknown\n{USAGE}")),
        }
    }
    Ok(options)
}

fn mode(name: &str) -> Result<bool> {
    match name {
        "closest" => Ok(false),
        "any" => Ok(true),
        _ => Err(format!("--mode: {name:?} is neither closest nor any")),
    }
}

fn tree(name: &str) -> Result<TreeQuality> {
    match name {
        "fast" => Ok(TreeQuality::Fast),
        "full" => Ok(TreeQuality::Full),
        _ => Err(format!("--tree: {name:?} is neither fast nor full")),
    }
}

fn level(name: &str) -> Result<Level> {
    let level = Level::ALL.into_iter().find(|level| level.name() == name);
    let names = Level::ALL.map(Level::name).join(", ");
    let level = level.ok_or_else(|| format!("--level: {name:?} is none of {names}"))?;
    if level.is_available() { Ok(level) } else { Err(format!("--level: this CPU has no {name}")) }
}

fn main() -> ExitCode {
    let result = parse(std::env::args().skip(1)).and_then(|options| match (&options.make, &options.table) {
        (Some(name), _) => make_files(name, &options.out),
        (None, Some(names)) => table::print(names, &options),
        (None, None) => measure(&options),
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("oscura-rays: {message}");
            ExitCode::from(2)
        }
    }
}

/// Writes a scene and its ray sets.
fn make_files(name: &str, out: &Path) -> Result<()> {
    let (stem, world) = match make::scene(name) {
        Some(world) => (name.to_string(), world),
        None if name.ends_with(".obj") => {
            let path = Path::new(name);
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            (stem, World::flat(files::read_obj(path)?))
        }
        None => return Err(format!("--make: {name:?} is no .obj file and none of {:?}", make::SCENES)),
    };
    let mesh = match (&world.geometries[..], &world.instances[..]) {
        ([mesh], []) => mesh,
        _ => return Err(format!("--make: a .tri file can't hold the placements of {name:?}: see --table")),
    };
    std::fs::create_dir_all(out).map_err(|e| format!("{}: {e}", out.display()))?;
    files::write_mesh(&out.join(format!("{stem}.tri")), mesh)?;
    let accel = Accel::build(&world.geometries, &[]);
    for (set, rays) in world.ray_sets(&accel) {
        files::write_rays(&out.join(format!("{stem}.{set}.rays")), &rays)?;
    }
    println!("{stem}: {} triangles", mesh.triangles.len());
    Ok(())
}

/// Traces the rays a few times and prints the speeds.
fn measure(options: &Options) -> Result<()> {
    let missing = |what: &str| format!("{what} is missing\n{USAGE}");
    let mesh = files::read_mesh(options.tri.as_deref().ok_or_else(|| missing("--tri"))?)?;
    let rays = files::read_rays(options.rays.as_deref().ok_or_else(|| missing("--rays"))?)?;
    let triangles = mesh.triangles.len();
    let world = World::flat(mesh);
    let accel = world.build(options.tree);
    drop(world);
    let (speeds, hits) = speeds(&accel, options, &rays)?;
    let found = hits.iter().filter(|hit| hit.is_hit()).count();
    let sum_t: f64 = hits.iter().filter(|hit| hit.is_hit()).map(|hit| f64::from(hit.t)).sum();
    println!(
        "{{\"program\":\"oscura\",\"mode\":\"{}\",\"level\":\"{}\",\"threads\":{},\"rays\":{},\"triangles\":{triangles},\
         \"mrays_median\":{:.3},\"mrays_min\":{:.3},\"mrays_max\":{:.3},\"build_s\":{:.3},\
         \"bytes_per_triangle\":{:.1},\"hits\":{found},\"sum_t\":{sum_t:.9e}}}",
        if options.any { "any" } else { "closest" },
        options.level.name(),
        options.threads,
        rays.len(),
        speeds[speeds.len() / 2],
        speeds[0],
        speeds[speeds.len() - 1],
        accel.stats().build_s,
        accel.stats().bytes as f64 / triangles.max(1) as f64,
    );
    match &options.hits {
        Some(path) => files::write_hits(path, &hits),
        None => Ok(()),
    }
}

/// Traces the rays several times, after a warm-up: millions of rays per second, sorted, and the hits.
fn speeds(accel: &Accel, options: &Options, rays: &[Ray]) -> Result<(Vec<f64>, Vec<Hit>)> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(options.threads).build();
    let pool = pool.map_err(|e| format!("--threads: {e}"))?;
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut speeds = Vec::new();
    for repetition in 0..=options.reps {
        let begin = Clock::start(options.threads);
        pool.install(|| trace(accel, options, rays, &mut hits));
        let seconds = begin.elapsed().as_secs_f64();
        if repetition > 0 {
            speeds.push(rays.len() as f64 / seconds / 1e6);
        }
    }
    speeds.sort_by(f64::total_cmp);
    Ok((speeds, hits))
}

/// CPU time for a single thread, so that other load does not count; wall-clock time otherwise.
enum Clock {
    Processor(ProcessTime),
    Wall(Instant),
}

impl Clock {
    fn start(threads: usize) -> Clock {
        if threads == 1 { Clock::Processor(ProcessTime::now()) } else { Clock::Wall(Instant::now()) }
    }

    fn elapsed(&self) -> Duration {
        match self {
            Clock::Processor(begin) => begin.elapsed(),
            Clock::Wall(begin) => begin.elapsed(),
        }
    }
}

/// One pass over all rays. An occluded ray counts as a hit at 0.
fn trace(accel: &Accel, options: &Options, rays: &[Ray], hits: &mut [Hit]) {
    let batches = rays.par_chunks(options.batch).zip(hits.par_chunks_mut(options.batch));
    batches.for_each(|(rays, hits)| {
        if !options.any {
            return accel.closest_at(options.level, rays, hits);
        }
        let mut occluded = vec![false; rays.len()];
        accel.occluded_at(options.level, rays, &mut occluded);
        for (hit, occluded) in hits.iter_mut().zip(occluded) {
            *hit = if occluded { Hit { t: 0.0, prim: 0, ..Hit::MISS } } else { Hit::MISS };
        }
    });
}
