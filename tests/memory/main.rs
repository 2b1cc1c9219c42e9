//! Peak memory of BVH builds and of textures. A program of its own, since the allocator counts for the whole process.

#![cfg(target_os = "linux")]

use oscura::accel::{Accel, AccelInput, Geometry, TreeQuality};
use oscura::compile::{CompileOptions, ExpectedPicture, compile};
use oscura::load::{LoadOptions, load};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Counts allocated bytes, and their peak.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

#[global_allocator]
static ALLOCATOR: Counting = Counting;

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = NOW.fetch_add(layout.size(), Relaxed) + layout.size();
        PEAK.fetch_max(now, Relaxed);
        // SAFETY: the caller upholds the contract of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// A line of `/proc/self/status`, in bytes.
fn status(key: &str) -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = text.lines().find_map(|line| line.strip_prefix(key)).expect("a line");
    line.trim().trim_end_matches(" kB").parse::<f64>().expect("a number") * 1024.0
}

/// A mesh of `2 n n` triangles with exact capacities.
fn sheet(n: u32) -> Geometry {
    let mut sheet = Geometry::default();
    sheet.positions.reserve_exact(((n + 1) * (n + 1)) as usize);
    sheet.triangles.reserve_exact((2 * n * n) as usize);
    for (x, y) in (0..=n).flat_map(|y| (0..=n).map(move |x| (x as f32 / n as f32, y as f32 / n as f32))) {
        sheet.positions.push([x, y, 0.2 * (9.0 * x).sin() * (7.0 * y).cos()]);
    }
    for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
        let a = y * (n + 1) + x;
        sheet.triangles.extend([[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
    }
    sheet
}

#[test]
fn peaks() {
    building_takes_at_most_150_bytes_a_triangle();
    float_textures_are_never_fully_resident();
}

/// Peak resident memory besides the mesh's own arrays: primitives, buffers of threads, and the BVH.
fn building_takes_at_most_150_bytes_a_triangle() {
    let mesh = sheet(1000);
    let triangles = mesh.triangles.len() as f64;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    for quality in [TreeQuality::Full, TreeQuality::Fast] {
        let before = status("VmRSS:");
        let accel = pool.install(|| {
            let geometries = &[&mesh][..];
            Accel::try_build(&AccelInput {
                geometries,
                instances: &[],
                first_moving: 0,
                first_changing: 1,
                moving: &[],
                quality,
                counter: None,
            })
            .expect("it can be addressed")
        });
        let peak = (status("VmHWM:") - before) / triangles;
        let tree = accel.stats().bytes as f64 / triangles;
        assert!(
            peak > tree && peak < 150.0,
            "{quality:?}: {peak} bytes per triangle at the peak, {tree} at the end"
        );
    }
}

/// Two images of 192 MiB each, of which a small picture needs the coarse mip levels.
fn float_textures_are_never_fully_resident() {
    const SIDE: usize = 4096;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut scene = "camera = { look_from = [0, 0, 9], look_at = [0, 0, 0] }\n".to_string();
    let mut objects = String::new();
    for name in ["a", "b"] {
        let pixel = |x: usize, y: usize| (x as f32 / 64.0, (y % 128) as f32, (x * y % 97) as f32);
        let file = folder.path().join(format!("{name}.exr"));
        exr::prelude::write_rgb_file(file, SIDE, SIDE, pixel).expect("written");
        scene += &format!("textures.{name} = {{ type = \"image\", file = \"{name}.exr\" }}\n");
        scene += &format!("materials.{name} = {{ type = \"lambert\", color = \"{name}\" }}\n");
        let quad = "quad = { corner = [-1, -1, 0], u = [2, 0, 0], v = [0, 2, 0] }";
        objects += &format!("[[objects]]\n{quad}\nmaterial = \"{name}\"\n");
    }
    scene += &objects;
    let path = folder.path().join("s.toml");
    std::fs::write(&path, scene).expect("written");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    let before = NOW.load(Relaxed);
    PEAK.store(before, Relaxed);
    let report = pool.install(|| {
        let loaded = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let camera = loaded.scene.cameras[0].clone();
        let picture = Some(ExpectedPicture { camera, width: 64, height: 36 });
        let options = CompileOptions { picture, ..CompileOptions::default() };
        compile(&loaded.scene, &options).unwrap_or_else(|e| panic!("{e}")).1
    });
    let (peak, image) = (PEAK.load(Relaxed) - before, SIDE * SIDE * 3 * 4);
    assert_eq!((report.textures.decoded, report.textures.reduced), (2, 2));
    assert!(report.textures.bytes < 1 << 20, "{:?}", report.textures);
    assert!(peak < image / 2, "{peak} bytes at the peak, where an image has {image}");
}
