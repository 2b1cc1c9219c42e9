//! Catmull-Clark subdivision of meshes, by options, scene files and sidecars.

use crate::files::load_files_by;
use oscura::load::subdivide::Subdivision;
use oscura::load::{LoadOptions, Loaded, load};

/// A cube of quads from -1 to 1 without a top, in two material groups, with texture coordinates.
const BOX: &str = "o box\nv -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\n\
    f 5/1 6/2 8/3 7/4\nf 2/1 1/2 3/3 4/4\ng sides\nusemtl b\nf 1/1 5/2 7/3 3/4\nf 6/1 2/2 4/3 8/4\ns 1\nf 1/1 2/2 6/3 5/4\n";

fn levels(levels: u32) -> LoadOptions {
    let subdivision = Some(Subdivision { levels, has_round_corners: false });
    LoadOptions { subdivision, ..LoadOptions::default() }
}

fn triangles(loaded: &Loaded) -> Vec<usize> {
    let scene = &loaded.scene;
    scene.instances.iter().map(|i| scene.meshes[i.mesh.index()].triangles.len()).collect()
}

#[test]
fn obj_polygons_are_subdivided() {
    let plain = load_files_by(&[("a.obj", BOX)], &LoadOptions::default()).expect("it loads");
    assert_eq!(triangles(&plain), [4, 6], "groups are objects of their own");
    let fine = load_files_by(&[("a.obj", BOX)], &levels(2)).expect("it loads");
    // One object of five quads, each of which becomes 16: two triangles of each.
    assert_eq!(triangles(&fine), [5 * 16 * 2]);
    let mesh = &fine.scene.meshes[0];
    let counts: Vec<u32> = mesh.parts.iter().map(|part| part.triangle_count).collect();
    assert_eq!(counts, [64, 96], "materials keep their faces");
    assert_eq!((mesh.normals.len(), mesh.uv_sets[0].len()), (mesh.positions.len(), mesh.positions.len()));
    // Each face has its own texture coordinates: 25 vertices per face, less those that neighbours share by chance.
    assert!(mesh.positions.len() > 100 && mesh.positions.len() <= 125, "{}", mesh.positions.len());
    // The lowest point of the rounded bottom is nearly that of a closed cube.
    let lowest = mesh.positions.iter().map(|p| p[1]).fold(f32::INFINITY, f32::min);
    assert!((lowest + 0.84).abs() < 0.02, "{lowest}");
    // The open boundary is a closed cubic spline of a square: its corners end at 2/3 of them.
    let rim: Vec<&[f32; 3]> = mesh.positions.iter().filter(|p| p[1] > 0.999).collect();
    assert!(rim.iter().any(|p| (p[0] - 2.0 / 3.0).abs() < 1e-6 && (p[2] - 2.0 / 3.0).abs() < 1e-6));
}

#[test]
fn subdivision_levels_of_scene_file_objects() {
    let object = |more: &str| format!("[[objects]]\nmesh = \"a.obj\"\nmaterial = \"m\"\n{more}\n");
    let scene = |objects: &str| {
        let text = format!(
            "camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0] }}\nenvironment.background = 1\n\
             materials.m = {{ type = \"lambert\" }}\n{objects}"
        );
        load_files_by(
            &[("s.toml", text.as_str()), ("a.obj", BOX), ("t.ply", TETRAHEDRON)],
            &LoadOptions::default(),
        )
    };
    let keys = [
        "",
        "subdivide = 1",
        "subdivide = 1",
        "subdivide = { levels = 2, scheme = \"catmull-clark\" }",
        "subdivide = { levels = 2, corners = \"round\" }",
    ];
    let loaded = scene(&keys.map(object).concat()).unwrap_or_else(|e| panic!("{e}"));
    // With subdivision, named groups stay in their objects.
    assert_eq!(triangles(&loaded), [10, 40, 40, 160, 160]);
    let instances = &loaded.scene.instances;
    assert_eq!(instances[1].mesh, instances[2].mesh, "made once");
    // Triangles of other files, three quads each.
    let ply = "[[objects]]\nmesh = \"t.ply\"\nmaterial = \"m\"\nsubdivide = 1\n";
    assert_eq!(triangles(&scene(ply).expect("it loads")), [4 * 3 * 2]);
    for (wrong, part) in [
        ("subdivide = 11", "0 to 10"),
        ("subdivide = \"2\"", "'subdivide'"),
        ("subdivide = { scheme = \"loop\", levels = 1 }", "catmull-clark"),
        ("subdivide = {}", "'levels'"),
    ] {
        let error = scene(&object(wrong)).expect_err(wrong).to_string();
        assert!(error.contains(part) && error.contains("line "), "{error}");
    }
    let ball = "[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"m\"\nsubdivide = 1\n";
    assert!(scene(ball).expect_err("no mesh").to_string().contains("subdivide"));
}

const TETRAHEDRON: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 4\nproperty list uchar int vertex_indices\nend_header\n1 1 1\n1 -1 -1\n-1 1 -1\n-1 -1 1\n\
    3 0 1 2\n3 0 3 1\n3 0 2 3\n3 1 3 2\n";

#[test]
fn subdivision_by_sidecars_and_options() {
    let beside = "[objects.box]\nsubdivide = 2\n";
    let loaded = load_files_by(&[("a.obj", BOX), ("a.oscura.toml", beside)], &LoadOptions::default());
    assert_eq!(triangles(&loaded.expect("it loads")), [160]);
    assert_eq!(triangles(&load_files_by(&[("t.ply", TETRAHEDRON)], &levels(2)).expect("it loads")), [96]);
    assert_eq!(triangles(&load_files_by(&[("a.obj", BOX)], &levels(0)).expect("it loads")), [10]);
    // Nine quads become 2 * 9 * 4^10 triangles.
    let mut grid: String = (0..16).map(|i| format!("v {} {} 0\n", i % 4, i / 4)).collect();
    for a in (0..9).map(|i| i / 3 * 4 + i % 3 + 1) {
        grid += &format!("f {a} {} {} {}\n", a + 1, a + 5, a + 4);
    }
    let error = load_files_by(&[("a.obj", &grid)], &levels(10)).expect_err("too many").to_string();
    assert!(error.contains("18874368") && error.contains('9'), "{error}");
    let text = "camera = { look_from = [0, 0, 5], look_at = [0, 0, 0] }\nenvironment.background = 1\n\
                [[objects]]\nmesh = \"a.obj\"\nsubdivide = 10\n";
    let error = load_files_by(&[("s.toml", text), ("a.obj", &grid)], &LoadOptions::default());
    let error = error.expect_err("too many").to_string();
    assert!(error.contains("16000000") && error.contains("line 5"), "{error}");
    // Two objects of one surface are subdivided separately, with a warning.
    let parts =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\no left\nf 1 2 3 4\no right\nf 2 5 6 3\n";
    let loaded = load_files_by(&[("p.obj", parts)], &levels(1)).expect("it loads");
    assert!(
        loaded.warnings.iter().any(|w| w.message.contains("'left'") && w.message.contains("'right'")),
        "{:?}",
        loaded.warnings
    );
    let scene = "camera = { look_from = [0, 0, 5], look_at = [0, 0, 0] }\nenvironment.background = 1\n\
                 [materials.m]\ntype = \"lambert\"\n[[objects]]\nmesh = \"a.obj\"\nmaterial = \"m\"\n";
    let loaded = load_files_by(&[("s.toml", scene), ("a.obj", BOX)], &levels(1)).expect("it loads");
    assert!(loaded.warnings.iter().any(|w| w.code == "unused-option"), "{:?}", loaded.warnings);
}

#[test]
fn split_normals_are_no_creases() {
    // Face normals in the file are no creases, and distant coordinates keep their precision.
    let text = "v 500000 0 0\nv 500001 0 0\nv 500002 0 0\nv 500000 1 0\nv 500001 1 0\nv 500002 1 0\n\
                vn 0 0 1\nvn 0 1 1\nf 1//1 2//1 5//1 4//1\nf 2//2 3//2 6//2 5//2\n";
    let loaded = load_files_by(&[("a.obj", text)], &levels(1)).expect("it loads");
    let mesh = &loaded.scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (15, 16));
    assert!(mesh.normals.iter().all(|n| n[2] > 0.999));
}

/// OpenSubdiv's result for the same sheet in Blender 5.0.1 (`tools/compare/subdivide.py`): points on the limit surface after two
/// levels, with their texture coordinates on both sides of seams.
#[test]
fn subdivision_matches_opensubdiv() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references/subdivision");
    for (table, has_round_corners) in [("sharp.csv", false), ("round.csv", true)] {
        let subdivision = Some(Subdivision { levels: 2, has_round_corners });
        let up = oscura::load::Up::Y;
        let options = LoadOptions { subdivision, up, ..LoadOptions::default() };
        let loaded = load(folder.join("sheet.obj"), &options).expect("it loads");
        let mesh = &loaded.scene.meshes[0];
        let ours: Vec<[f32; 5]> = mesh
            .positions
            .iter()
            .zip(&mesh.uv_sets[0])
            .map(|(&[x, y, z], &[u, v])| [x, y, z, u, 1.0 - v])
            .collect();
        let text = std::fs::read_to_string(folder.join(table)).expect("the table");
        let rows: Vec<Vec<f32>> =
            text.lines().map(|l| l.split(',').map(|x| x.parse().expect("a number")).collect()).collect();
        let nearest = |row: &[f32], all: &mut dyn Iterator<Item = &[f32]>| {
            let far = |other: &[f32]| row.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            all.map(far).fold(f32::INFINITY, f32::min)
        };
        let theirs_to_ours = rows.iter().map(|r| nearest(r, &mut ours.iter().map(|o| &o[..])));
        let ours_to_theirs = ours.iter().map(|o| nearest(o, &mut rows.iter().map(|r| &r[..])));
        let worst = [theirs_to_ours.fold(0.0, f32::max), ours_to_theirs.fold(0.0, f32::max)];
        println!("{table}: {} vertices, {} rows, apart by {worst:?} at most", ours.len(), rows.len());
        assert!(ours.len() == rows.len() && worst.iter().all(|w| *w < 2e-5), "{table}: {worst:?}");
    }
}
