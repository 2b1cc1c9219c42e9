//! Scaling of time and memory with one parameter at a time: meshes, instances, materials, textures, lights and so on.
//!
//! Each scene is rendered by a process of its own, the program as users run it, whose CPU time and peak memory are recorded.
//! From one size to the next, cost grows with the exponent `ln(cost ratio) / ln(size ratio)`, both minus the smallest size: 1 is
//! linear, 2 is quadratic.

use crate::scenes::{Generated, many, models, rooms};
use oscura::error::{Error, Result};
use std::fmt::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Maximum exponent.
pub const MAX: f64 = 1.1;

/// Minimum CPU time, in seconds, for fitting an exponent.
const MIN_S: f64 = 0.15;
/// The same for memory, in bytes.
const MIN_BYTES: f64 = 8.0 * 1024.0 * 1024.0;

/// A scene file and the arguments of its rendering.
type Render = (PathBuf, Vec<String>);

/// The parameter that grows.
struct Axis {
    name: &'static str,
    /// Smallest and largest size, and the factor from one size to the next.
    sizes: (u64, u64, u64),
    /// Writes the scene of a size.
    scene: fn(&Generated, u64) -> Result<Render>,
}

/// Few pixels and samples: preprocessing is measured.
const SMALL: &[&str] = &["--width", "32", "--height", "32", "--spp", "1"];

fn words(list: &[&str]) -> Vec<String> {
    list.iter().map(|word| (*word).to_string()).collect()
}

fn toml(generated: &Generated, text: &str) -> Result<Render> {
    Ok((generated.write("growing.toml", text.as_bytes())?, words(SMALL)))
}

fn gltf(generated: &Generated, model: many::Model) -> Result<Render> {
    generated.write("growing.bin", &model.bin)?;
    Ok((generated.write("growing.gltf", model.gltf.as_bytes())?, words(SMALL)))
}

/// A room with this many pixels per side and samples per pixel, without automatically chosen techniques.
fn room(generated: &Generated, side: u64, samples: u64, more: &[&str]) -> Result<Render> {
    let scene = generated.write("growing.toml", rooms::slit().as_bytes())?;
    let (side, samples) = (side.to_string(), samples.to_string());
    let mut arguments = words(&["--width", &side, "--height", &side, "--spp", &samples]);
    let techniques = ["--path-reuse", "--splitting", "--guiding", "--caustics"];
    techniques.iter().for_each(|technique| arguments.extend(words(&[technique, "off"])));
    arguments.extend(words(more));
    Ok((scene, arguments))
}

/// AOVs in the order in which the axis of passes adds them.
const PASSES: &[&str] = &[
    "depth",
    "normal",
    "albedo",
    "position",
    "uv",
    "motion",
    "roughness",
    "diffuse_direct",
    "diffuse_indirect",
    "glossy_direct",
    "glossy_indirect",
    "emission",
    "environment",
    "shadow",
    "variance",
    "crypto_object",
];

const AXES: &[Axis] = &[
    Axis {
        name: "triangles of a mesh",
        sizes: (1_000, 10_000_000, 10),
        scene: |generated, n| {
            let sides = ((n / 4) as f64).sqrt().round().max(3.0) as u32;
            generated.write("model.ply", &models::torus((n / 2 / u64::from(sides)) as u32, sides))?;
            toml(generated, models::MODEL)
        },
    },
    Axis {
        name: "meshes, shared",
        sizes: (3, 30_000, 10),
        scene: |generated, n| gltf(generated, many::shared_meshes(n as usize)),
    },
    Axis {
        name: "meshes, small",
        sizes: (10, 100_000, 10),
        scene: |generated, n| gltf(generated, many::small_meshes(n as usize)),
    },
    Axis {
        name: "instances",
        sizes: (10, 1_000_000, 10),
        scene: |generated, n| gltf(generated, many::instances(n as usize)),
    },
    Axis {
        name: "instances, small",
        sizes: (10, 1_000_000, 10),
        scene: |generated, n| gltf(generated, many::small_instances(n as usize)),
    },
    Axis {
        name: "nodes in chains",
        sizes: (100, 1_000_000, 10),
        scene: |generated, n| gltf(generated, many::chains(n as usize)),
    },
    Axis {
        name: "materials",
        sizes: (10, 100_000, 10),
        scene: |generated, n| toml(generated, &many::materials(n as usize, 0)),
    },
    Axis {
        name: "objects with traits",
        sizes: (10, 100_000, 10),
        scene: |generated, n| toml(generated, &many::materials(n as usize, n.ilog2().min(10))),
    },
    Axis {
        name: "textures",
        sizes: (10, 10_000, 10),
        scene: |generated, n| {
            for i in 0..n {
                generated.write(&format!("t{i}.bmp"), &many::bmp(32, i as u32))?;
            }
            toml(generated, &many::textures(n as usize))
        },
    },
    Axis {
        name: "texels of a texture",
        sizes: (10_000, 100_000_000, 10),
        scene: |generated, n| {
            generated.write("t0.bmp", &many::bmp((n as f64).sqrt() as u32, 1))?;
            toml(generated, &many::textures(1))
        },
    },
    Axis {
        name: "lights",
        sizes: (10, 100_000, 10),
        scene: |generated, n| toml(generated, &rooms::hall(n as u32)),
    },
    Axis {
        name: "bodies of glass",
        sizes: (10, 100_000, 10),
        scene: |generated, n| gltf(generated, many::glass_bodies(n as usize, false)),
    },
    Axis {
        name: "bodies of glass, inverted",
        sizes: (10, 100_000, 10),
        scene: |generated, n| gltf(generated, many::glass_bodies(n as usize, true)),
    },
    Axis {
        name: "strands",
        sizes: (10, 100_000, 10),
        scene: |generated, n| {
            let (scene, strands) = many::strands(n as usize);
            generated.write("strands.curves", strands.as_bytes())?;
            toml(generated, &scene)
        },
    },
    Axis {
        name: "objects of an OBJ file",
        sizes: (10, 100_000, 10),
        scene: |generated, n| {
            let (obj, mtl) = many::obj(n as usize);
            generated.write("growing.mtl", mtl.as_bytes())?;
            Ok((generated.write("growing.obj", obj.as_bytes())?, words(SMALL)))
        },
    },
    Axis {
        name: "frames",
        sizes: (1, 100, 10),
        scene: |generated, n| {
            let (scene, mut arguments) = gltf(generated, many::turning())?;
            arguments.extend(words(&["--frames", &format!("1-{n}")]));
            Ok((scene, arguments))
        },
    },
    Axis {
        name: "passes",
        sizes: (1, 16, 4),
        scene: |generated, n| room(generated, 128, 8, &["--aov", &PASSES[..n as usize].join(",")]),
    },
    Axis { name: "pixels, a side", sizes: (64, 1024, 4), scene: |generated, n| room(generated, n, 4, &[]) },
    Axis { name: "samples", sizes: (4, 400, 10), scene: |generated, n| room(generated, 64, n, &[]) },
];

/// The cost of a render.
#[derive(Clone, Copy, Debug)]
struct Cost {
    /// CPU time of the process.
    cpu_s: f64,
    /// Peak resident memory.
    bytes: f64,
}

/// One measurement.
pub struct Row {
    what: &'static str,
    size: u64,
    cost: Cost,
    /// The exponents of time and memory since the previous size; none below the minimum.
    powers: [Option<f64>; 2],
}

impl Row {
    /// The parameter, and its size.
    pub fn name(&self) -> String {
        format!("{} ({})", self.what, self.size)
    }

    /// Is the growth steeper than linear?
    pub fn is_too_steep(&self) -> bool {
        self.powers.iter().flatten().any(|&power| power > MAX)
    }
}

/// All measurements, and the errors that ended an axis.
#[derive(Default)]
pub struct Growth {
    /// In order.
    pub rows: Vec<Row>,
    /// Names of axes with errors.
    pub failures: Vec<String>,
}

/// Limits of the measurement.
pub struct Limits {
    /// The program that renders.
    pub program: PathBuf,
    /// An axis ends where the next size would probably take longer, in CPU seconds.
    pub seconds: f64,
    /// Only axes whose names contain this.
    pub only: String,
}

impl Default for Limits {
    fn default() -> Limits {
        let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        Limits { program: project.join("target/release/oscura"), seconds: 60.0, only: String::new() }
    }
}

/// Measures all.
///
/// # Errors
/// If the system's temporary folder takes no files.
pub fn measure(limits: &Limits) -> Result<Growth> {
    let generated = Generated::new()?;
    let mut growth = Growth::default();
    for axis in AXES.iter().filter(|axis| axis.name.contains(&limits.only)) {
        // Measurements before a failure are kept.
        if let Err(error) = axis.follow(&generated, limits, &mut growth.rows) {
            growth.failures.push(format!("{}: {error}", axis.name));
        }
    }
    Ok(growth)
}

impl Axis {
    /// Renders larger and larger scenes.
    fn follow(&self, generated: &Generated, limits: &Limits, rows: &mut Vec<Row>) -> Result<()> {
        let (smallest, largest, factor) = self.sizes;
        let mut costs: Vec<(u64, Cost)> = Vec::new();
        let mut size = smallest;
        while size <= largest {
            let (scene, arguments) = (self.scene)(generated, size)?;
            let cost = render(&limits.program, &scene, &arguments)?;
            let powers = powers(&costs, size, cost, self.name.ends_with("a side"));
            costs.push((size, cost));
            let row = Row { what: self.name, size, cost, powers };
            eprintln!("{row}");
            rows.push(row);
            let is_near = |now: f64, limit: f64| now * factor as f64 > limit;
            if is_near(cost.cpu_s, limits.seconds) || is_near(cost.bytes, memory() / 2.0) {
                break;
            }
            size *= factor;
        }
        Ok(())
    }
}

/// The exponents of cost since the last size: both are counted beyond the smallest size, so that fixed cost is excluded.
fn powers(before: &[(u64, Cost)], size: u64, cost: Cost, is_side: bool) -> [Option<f64>; 2] {
    let ([(first_size, first), ..], [.., (last_size, last)]) = (before, before) else { return [None; 2] };
    let things = |size: u64| (size as f64).powi(if is_side { 2 } else { 1 });
    let beyond = |size: u64| things(size) - things(*first_size);
    let ratio = (beyond(size) / beyond(*last_size)).ln();
    let power = |first: f64, last: f64, now: f64, least: f64| {
        (last - first >= least).then(|| ((now - first) / (last - first)).max(1e-9).ln() / ratio)
    };
    [power(first.cpu_s, last.cpu_s, cost.cpu_s, MIN_S), power(first.bytes, last.bytes, cost.bytes, MIN_BYTES)]
}

/// Renders a scene in a process.
fn render(program: &Path, scene: &Path, arguments: &[String]) -> Result<Cost> {
    let output = scene.with_file_name("picture.exr");
    let before = child_seconds();
    let mut command = Command::new(program);
    command.arg("render").arg(scene).arg("-o").arg(&output).arg("--json").arg("--quiet").args(arguments);
    let run = command.stderr(Stdio::piped()).output();
    let run = run.map_err(|e| Error::usage(format!("{} can't be started: {e}", program.display())))?;
    if !run.status.success() {
        let text = String::from_utf8_lossy(&run.stderr);
        return Err(Error::usage(format!("{command:?} failed: {text}")));
    }
    let text = String::from_utf8_lossy(&run.stdout);
    let peak = text.lines().filter_map(|line| number(line, "\"peak_memory_bytes\": ")).fold(0.0, f64::max);
    Ok(Cost { cpu_s: child_seconds() - before, bytes: peak })
}

/// The number after a key.
fn number(line: &str, key: &str) -> Option<f64> {
    let rest = line.split_once(key)?.1;
    rest.split([',', '}']).next()?.trim().parse().ok()
}

/// CPU time of all finished child processes; hundredths of seconds.
fn child_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // After the name of the program, which is in brackets: from the third field on.
    let fields = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks = fields.split_whitespace().skip(13).take(2).filter_map(|field| field.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}

/// Memory of the machine, in bytes.
fn memory() -> f64 {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"));
    let kib = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kib.map_or(f64::INFINITY, |kib| kib * 1024.0)
}

impl fmt::Display for Row {
    /// A row of the table.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Row { what, size, cost: Cost { cpu_s, bytes }, powers } = self;
        let mib = bytes / f64::from(1 << 20);
        let [time, memory] = powers.map(optional);
        write!(f, "| {what} | {size} | {cpu_s:.2} | {mib:.0} | {time} | {memory} |")
    }
}

fn optional(power: Option<f64>) -> String {
    power.map_or_else(|| "-".to_string(), |power| format!("{power:.2}"))
}

/// One line per measurement.
pub fn csv(rows: &[Row]) -> String {
    let mut out = "what,size,cpu_s,peak_bytes,time_power,memory_power\n".to_string();
    for Row { what, size, cost, powers } in rows {
        let [time, bytes] = powers.map(optional);
        let _ = writeln!(out, "\"{what}\",{size},{:.2},{},{time},{bytes}", cost.cpu_s, cost.bytes);
    }
    out
}

/// The same for reading.
pub fn markdown(rows: &[Row]) -> String {
    let mut out = "| what | size | CPU s | peak MiB | power of time | power of memory |\n|---|---:|---:|---:|---:|---:|\n"
        .to_string();
    rows.iter().for_each(|row| out += &format!("{row}\n"));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::load::{LoadOptions, load};

    #[test]
    fn exponents_exclude_fixed_cost() {
        // One second and a hundred megabytes, and more for each thing beyond the first.
        let cost = |n: u64, power: f64| {
            let more = (n as f64 - 1.0).powf(power);
            Cost { cpu_s: 1.0 + more, bytes: 1e8 + 1e8 * (n as f64 - 1.0) }
        };
        let before = [(1, cost(1, 2.0)), (10, cost(10, 2.0))];
        let [time, memory] = powers(&before, 100, cost(100, 2.0), false).map(|power| power.expect("enough"));
        assert!((time - 2.0).abs() < 1e-9 && (memory - 1.0).abs() < 1e-9, "{time} {memory}");
        let of_side = |side: u64| Cost { cpu_s: (side * side) as f64, bytes: 0.0 };
        let [of_pixels, _] = powers(&[(4, of_side(4)), (16, of_side(16))], 64, of_side(64), true);
        assert!((of_pixels.expect("enough") - 1.0).abs() < 1e-9);
        let little = [(1, cost(1, 1.0)), (10, Cost { cpu_s: 1.01, bytes: 1e8 })];
        assert_eq!(powers(&little, 100, cost(100, 1.0), false), [None, None]);
        assert_eq!(powers(&[], 1, cost(1, 1.0), false), [None, None]);
    }

    /// Scenes of every axis load, and larger sizes contain more.
    #[test]
    fn larger_sizes_contain_more() {
        let generated = Generated::new().unwrap_or_else(|e| panic!("{e}"));
        for axis in AXES {
            let (smallest, _, factor) = axis.sizes;
            let sizes = [smallest, smallest * factor].map(|size| {
                let (path, arguments) = (axis.scene)(&generated, size).unwrap_or_else(|e| panic!("{e}"));
                let loaded =
                    load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{}: {e}", axis.name));
                let scene = loaded.scene;
                let triangles: usize = scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
                let texels: usize = scene.images.iter().map(|image| image.width as usize).sum();
                let strands: usize = scene.curves.iter().map(|curves| curves.points.len()).sum();
                let counts = [
                    triangles,
                    texels,
                    strands,
                    scene.instances.len(),
                    scene.shapes.len() + scene.quads.len(),
                ];
                (counts, arguments)
            });
            assert_ne!(sizes[0], sizes[1], "{}", axis.name);
        }
    }

    #[test]
    fn numbers_are_parsed_from_reports() {
        let line = r#"{"load_s": 0.25, "peak_memory_bytes": 17850368, "outputs": ["x.exr"]}"#;
        assert_eq!(number(line, "\"peak_memory_bytes\": "), Some(17_850_368.0));
        assert_eq!(number(line, "\"peak\": "), None);
    }
}
