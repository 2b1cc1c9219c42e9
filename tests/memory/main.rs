//! Memory at the peak of a build. The only test of its program, since the system counts for the whole process.

#![cfg(target_os = "linux")]

use oscura::accel::{Accel, AccelInput, Geometry, TreeQuality};

/// A line of `/proc/self/status`, in bytes.
fn status(key: &str) -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = text.lines().find_map(|line| line.strip_prefix(key)).expect("a line");
    line.trim().trim_end_matches(" kB").parse::<f64>().expect("a number") * 1024.0
}

/// A sheet of `2 n n` triangles, without memory to spare.
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

/// All that is resident on top of the mesh's own arrays when it is the most: primitives, what threads work on, and the tree.
#[test]
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
