//! Fuzzing regressions (`tools/fuzz`): files that once broke a loader or `compile`.

use oscura::compile::{CompileOptions, CompileReport, compile};
use oscura::error::Result;
use oscura::load::{LoadOptions, load};
use std::fmt::Write;
use std::path::Path;

/// Loads and compiles as the command line would.
fn check(path: &Path) -> Result<CompileReport> {
    let options = LoadOptions { point_radius: Some(0.01), ..LoadOptions::default() };
    let loaded = load(path, &options)?;
    assert_eq!(loaded.scene.validate(), [], "{}", path.display());
    compile(&loaded.scene, &CompileOptions::default()).map(|(_, report)| report)
}

/// Areas of boxes overflowed, and a leaf got more triangles than it can count.
#[test]
fn huge_triangles_are_dropped() {
    let mut obj = String::new();
    for i in 0..1000 {
        let far = if i % 10 == 0 { "1e36" } else { "1" };
        writeln!(obj, "v {i} 0 0\nv {i} {far} 0\nv {i} 0 {far}\nf -3 -2 -1").expect("written");
    }
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("a.obj"), obj).expect("written");
    // The camera is near the others: it is the origin of coordinates.
    let scene = "camera = { look_from = [0, 0, 9], look_at = [0, 0, 0] }\n[[objects]]\nmesh = \"a.obj\"\n";
    let path = folder.path().join("a.toml");
    std::fs::write(&path, scene).expect("written");
    let report = check(&path).unwrap_or_else(|e| panic!("{e}"));
    let messages = report.warnings.iter().any(|w| w.message.starts_with("100 "));
    assert!(messages, "{:?}", report.warnings);
}

/// The header parser panics on numbers beyond 64 bits, also if followed by letters.
#[test]
fn gigantic_counts_in_a_ply_header_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.ply");
    for count in ["6".repeat(80), format!("{}nt i4.rty", "6".repeat(80)), format!("x{}", "9".repeat(40))] {
        let text = format!("ply\nformat ascii 06.0\nelement vertex {count}\nproperty float x\nend_header\n");
        std::fs::write(&path, text).expect("written");
        let error = check(&path).expect_err("it is refused").to_string();
        assert!(error.contains("line 3: "), "{error}");
    }
}
