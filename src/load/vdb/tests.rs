//! Files that OpenVDB 12 wrote, and ones written here by its description, whole and damaged.

use super::*;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write;

/// A grid of a world whose y points up, without a margin.
fn parse(bytes: &[u8], file: &str, wanted: Option<&str>) -> Result<Grid, String> {
    super::parse(bytes, file, wanted, (false, false))
}

/// Two grids, packed by Blosc; the second, `density`, has 1 + i + 10 j + 100 k over 64 at the voxel (i - 2, j + 4, k + 1).
const BLOSC: &[u8] = include_bytes!("tests/blosc.vdb");
/// The same density as half floats, and a grid of truth values.
const HALF: &[u8] = include_bytes!("tests/half.vdb");

fn value(grid: &Grid, [x, y, z]: [u32; 3]) -> f32 {
    grid.values[((z * grid.size[1] + y) * grid.size[0] + x) as usize]
}

fn assert_is_the_density(grid: &Grid) {
    // Leaves from (-8, 0, 0) to (8, 16, 8).
    assert_eq!(grid.size, [16, 16, 8]);
    let (min, max) = (DVec3::new(-1.125, 1.875, 2.75), DVec3::new(2.875, 5.875, 6.75));
    let (low, high) = grid.bounds();
    assert!(low.distance(min) < 1e-12 && high.distance(max) < 1e-12, "{low} {high}");
    let mut sum = 0.0;
    for (i, j, k) in (0..300).map(|n| (n / 30, n / 5 % 6, n % 5)) {
        let expected = (1 + i + 10 * j + 100 * k) as f32 / 64.0;
        assert_eq!(value(grid, [i + 6, j + 4, k + 1]), expected, "{i} {j} {k}");
        sum += expected;
    }
    assert!((grid.values.iter().sum::<f32>() / sum - 1.0).abs() < 1e-6, "nothing is elsewhere");
}

#[test]
fn files_of_openvdb_are_read() {
    assert_is_the_density(&parse(BLOSC, "smoke.vdb", None).expect("density is what is read"));
    assert_is_the_density(&parse(BLOSC, "smoke.vdb", Some("density")).expect("by its name"));
    assert_is_the_density(&parse(HALF, "smoke.vdb", None).expect("half floats"));
    let other = parse(BLOSC, "smoke.vdb", Some("temperature")).expect("the other grid");
    assert_eq!((other.values.iter().sum::<f32>(), value(&other, [3, 3, 3])), (448.0, 7.0));
}

#[test]
fn z_becomes_y() {
    let grid = parse(BLOSC, "smoke.vdb", None).expect("a grid");
    let up = super::parse(BLOSC, "smoke.vdb", None, (true, false)).expect("a grid that stands");
    assert_eq!((up.size, &up.values), (grid.size, &grid.values));
    for at in [[6.0, 4.0, 1.0], [9.0, 7.0, 3.0], [15.0, 9.0, 5.0]] {
        let [flat, stands] =
            [&grid, &up].map(|grid| grid.world_from_voxels.transform_point3(DVec3::from_array(at)));
        assert!((stands - DVec3::new(flat.x, flat.z, -flat.y)).length() < 1e-12, "{stands} {flat}");
    }
}

#[test]
fn margins_are_empty_and_move_nothing() {
    let grid = parse(BLOSC, "smoke.vdb", None).expect("a grid");
    let wide = super::parse(BLOSC, "smoke.vdb", None, (false, true)).expect("a wider one");
    assert_eq!(wide.size, grid.size.map(|n| n + 2));
    assert_eq!(wide.values.iter().sum::<f32>(), grid.values.iter().sum::<f32>());
    for at in [[6, 4, 1], [9, 7, 3]] {
        let beside = at.map(|k| k + 1);
        assert_eq!(value(&wide, beside), value(&grid, at));
        let [a, b] = [(&grid, at), (&wide, beside)]
            .map(|(grid, at)| grid.world_from_voxels.transform_point3(DVec3::from_array(at.map(f64::from))));
        assert!((a - b).length() < 1e-12, "{a} {b}");
    }
}

/// Transforms as OpenVDB writes them: rows are what the axes become.
#[test]
fn grids_stand_as_their_maps_say() {
    let map = |kind: &str, numbers: &[f64]| {
        let mut w = Writer(Vec::new());
        w.text(kind);
        w.0.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        read_map(&mut Bytes::new(&w.0))
    };
    let turned = [0.0, 2.0, 0.0, 0.0, -1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 3.0, 0.0, 7.0, 8.0, 9.0, 1.0];
    let turned = map("AffineMap", &turned).expect("a map");
    assert_eq!(turned.transform_point3(DVec3::new(1.0, 10.0, 100.0)), DVec3::new(-3.0, 10.0, 314.0));
    let moved = map("TranslationMap", &[1.0, 2.0, 3.0]).expect("a map");
    assert_eq!(moved.transform_point3(DVec3::ONE), DVec3::new(2.0, 3.0, 4.0));
    let scaled = [&[1.0, 2.0, 3.0, 0.5, -0.25, 2.0][..], &[0.0; 12]].concat();
    let scaled = map("ScaleTranslateMap", &scaled).expect("a map");
    assert_eq!(scaled.transform_point3(DVec3::splat(4.0)), DVec3::new(3.0, 1.0, 11.0));
    let flat = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    assert!(map("AffineMap", &flat).expect_err("flat").contains("flattens"));
    assert!(map("FrustumMap", &[]).expect_err("a frustum").contains("FrustumMap"));
}

#[test]
fn grids_without_voxels_are_empty() {
    let grid = dense(&DAffine3::IDENTITY, &[], "no smoke yet".into(), true).expect("a grid");
    assert_eq!((grid.size, grid.values.as_slice()), ([1; 3], &[0.0][..]));
}

/// How a file is written here.
#[derive(Clone, Copy)]
struct Form {
    compression: u32,
    kind: &'static str,
    class: &'static str,
    /// What values are multiplied by.
    sign: f32,
}

const PLAIN: Form = Form { compression: 0, kind: "Tree_float_5_4_3", class: "fog volume", sign: 1.0 };

/// Where the first grid's entry begins in a file that is written here, and where the origin of the root's child is.
const ENTRY: usize = 65;
const ORIGIN: usize = 320;

struct Writer(Vec<u8>);

impl Writer {
    fn word(&mut self, word: u32) {
        self.0.extend(word.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.word(text.len() as u32);
        self.0.extend(text.as_bytes());
    }

    /// Values of a node of which those that `active` says are there.
    fn values(&mut self, form: Form, all: &[f32], active: &[bool]) {
        // Inactive ones are the background.
        self.0.push(0);
        let is_there = |i: usize| form.compression & 2 == 0 || active[i];
        let bytes: Vec<u8> =
            (0..all.len()).filter(|&i| is_there(i)).flat_map(|i| all[i].to_le_bytes()).collect();
        if form.compression & 1 == 0 {
            return self.0.extend(bytes);
        }
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::default());
        packed.write_all(&bytes).expect("packed");
        let packed = packed.finish().expect("packed");
        match packed.len() < bytes.len() {
            true => {
                self.0.extend((packed.len() as i64).to_le_bytes());
                self.0.extend(packed);
            }
            false => {
                self.0.extend((-(bytes.len() as i64)).to_le_bytes());
                self.0.extend(bytes);
            }
        }
    }

    fn mask(&mut self, on: &[bool]) {
        let byte = |bits: &[bool]| (0..8).fold(0u8, |byte, i| byte | u8::from(bits[i]) << i);
        self.0.extend(on.chunks(8).map(byte));
    }
}

/// A grid of one leaf at (0, 0, 0), whose voxel i is i + 1 where i is even and else inactive, beside a tile of 8^3 voxels of 5.
fn written(form: Form) -> Vec<u8> {
    let mut w = Writer(MAGIC.to_le_bytes().to_vec());
    [224, 12, 0].into_iter().for_each(|word| w.word(word));
    w.0.push(1);
    w.0.extend([b'x'; UUID]);
    w.word(0);
    w.word(1);
    w.text("density");
    w.text(form.kind);
    w.text("");
    let begin = w.0.len() + 24;
    [begin as i64, 0, 0].into_iter().for_each(|at| w.0.extend(at.to_le_bytes()));
    w.word(form.compression);
    w.word(1);
    w.text("class");
    w.text("string");
    w.text(form.class);
    w.text("UniformScaleMap");
    (0..15).for_each(|_| w.0.extend(1f64.to_le_bytes()));
    [1, 0, 0, 1].into_iter().for_each(|word| w.word(word));
    [0; 3].into_iter().for_each(|word| w.word(word));
    for (count, tile) in [(1 << 15, None), (1 << 12, Some(1))] {
        let first: Vec<bool> = (0..count).map(|i| i == 0).collect();
        let active: Vec<bool> = (0..count).map(|i| Some(i) == tile).collect();
        w.mask(&first);
        w.mask(&active);
        let tiles: Vec<f32> = active.iter().map(|&is| if is { 5.0 * form.sign } else { 0.0 }).collect();
        w.values(form, &tiles, &active);
    }
    let active: Vec<bool> = (0..512).map(|i| i % 2 == 0).collect();
    let voxels: Vec<f32> =
        (0..512).map(|i| if i % 2 == 0 { form.sign * (i as f32 + 1.0) } else { 0.0 }).collect();
    w.mask(&active);
    w.mask(&active);
    w.values(form, &voxels, &active);
    let end = (w.0.len() as i64).to_le_bytes();
    w.0[begin - 8..begin].copy_from_slice(&end);
    w.0
}

#[test]
fn all_ways_to_store_values_are_read() {
    for compression in 0..4 {
        let grid = parse(&written(Form { compression, ..PLAIN }), "made.vdb", None).expect("a grid");
        // The tile follows the leaf along z.
        assert_eq!(grid.size, [8, 8, 16], "{compression}");
        assert_eq!(value(&grid, [0, 0, 2]), 3.0);
        assert_eq!(value(&grid, [0, 0, 3]), 0.0, "inactive");
        assert_eq!(value(&grid, [1, 2, 4]), (64 + 16 + 4 + 1) as f32);
        assert_eq!(value(&grid, [7, 7, 15]), 5.0);
        let (low, high) = grid.bounds();
        assert_eq!((low.z, high.z), (-0.5, 15.5));
    }
}

#[test]
fn what_is_not_read_is_told() {
    let with = |at: usize, byte: u8| {
        let mut bytes = written(PLAIN);
        bytes[at] = byte;
        bytes
    };
    // Four billion grids, each of which leads back to itself.
    let mut endless = written(PLAIN);
    endless[ENTRY - 4..ENTRY].fill(255);
    endless[ENTRY + 51..ENTRY + 59].copy_from_slice(&(ENTRY as i64).to_le_bytes());
    for (bytes, wanted, words) in [
        (b"nonsense".to_vec(), None, "is no OpenVDB file"),
        (endless, None, "lies before its own"),
        (with(ORIGIN, 8), None, "nodes overlap"),
        (written(Form { sign: -1.0, ..PLAIN }), None, "more negative values"),
        (Vec::new(), None, "is no OpenVDB file"),
        (with(8, 221), None, "version 221"),
        (with(20, 0), None, "streamed"),
        (written(PLAIN), Some("heat"), "no grid 'heat', but 'density'"),
        (BLOSC.to_vec(), Some("heat"), "'temperature', 'density'"),
        (HALF.to_vec(), Some("mask"), "only floats"),
        (written(Form { class: "level set", ..PLAIN }), None, "level set"),
        (written(Form { kind: "Tree_vec3s_5_4_3", ..PLAIN }), None, "Tree_vec3s"),
    ] {
        let message = parse(&bytes, "made.vdb", wanted).expect_err(words);
        assert!(message.contains(words), "{message}: {words}");
    }
}

/// Every beginning of a file, and files with bytes changed at random: an error or a grid, and nothing else.
#[test]
fn damaged_files_are_errors_or_grids() {
    let files = [BLOSC.to_vec(), HALF.to_vec(), written(PLAIN), written(Form { compression: 3, ..PLAIN })];
    for whole in &files {
        for length in (0..whole.len()).step_by(7) {
            assert!(parse(&whole[..length], "cut.vdb", Some("density")).is_err(), "{length}");
        }
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize
        };
        for _ in 0..3000 {
            let mut damaged = whole.clone();
            for _ in 0..=next() % 3 {
                // Nodes' masks, which any bits may be in, take most of the file: half of the changes are at its ends.
                let place = next();
                let at = if next() % 2 == 0 { place % 700 } else { whole.len() - 1 - place % whole.len() };
                damaged[at] = next() as u8;
            }
            if let Ok(grid) = parse(&damaged, "damaged.vdb", Some("density")) {
                let voxels: u64 = grid.size.iter().map(|&n| u64::from(n)).product();
                assert!(voxels == grid.values.len() as u64 && grid.values.iter().all(|v| *v >= 0.0));
            }
        }
    }
}
