//! OpenVDB files (`.vdb`) of versions 222 to 224, written by OpenVDB since 2013: a grid of f64, f32 or f16, uncompressed or
//! compressed by zlib or Blosc, becomes a dense grid over the bounding box of its active voxels. A margin of one voxel on each side
//! is optional: interpolated values then fall to 0 there.

mod values;

use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::Grid;
use std::collections::HashSet;
use std::sync::Arc;
use values::{Bytes, Mask, Number, Values};

const MAGIC: i64 = 0x5644_4220;
const VERSIONS: std::ops::RangeInclusive<u32> = 222..=224;
/// Maximum number of voxels of the dense grid: two GiB.
const MAX_VOXELS: u64 = 1 << 29;
/// Rotation from z up to y up.
const Z_UP: DAffine3 = DAffine3 {
    matrix3: DMat3 { x_axis: DVec3::X, y_axis: DVec3::NEG_Z, z_axis: DVec3::Y },
    translation: DVec3::ZERO,
};
/// Length of the file's UUID, bytes.
const UUID: usize = 36;

/// A grid in a file.
struct Entry {
    name: String,
    /// Type of the tree, such as `Tree_float_5_4_3`.
    kind: String,
    /// Name of the grid with the shared tree; empty if the tree is its own.
    instance_of: String,
    /// Offset in the file, bytes.
    at: i64,
}

/// Reads the grid with a name, or `density`, or the only one, from a file with y or z up; with or without a margin of one
/// voxel. Errors are messages.
pub(super) fn parse(
    bytes: &[u8],
    file: &str,
    grid_name: Option<&str>,
    (is_z_up, has_margin): (bool, bool),
) -> Result<Grid, String> {
    let mut reader = Bytes::new(bytes);
    let entries = entries(&mut reader)?;
    let entry = chosen(&entries, grid_name)?;
    let (map, cubes) = grid(&mut reader, entry)?;
    let world_from_file = if is_z_up { Z_UP } else { DAffine3::IDENTITY };
    dense(&(world_from_file * map), &cubes, format!("{file} ({})", entry.name), has_margin)
}

/// The grids of the file.
fn entries(reader: &mut Bytes) -> Result<Vec<Entry>, String> {
    if reader.i64().unwrap_or(0) != MAGIC {
        return Err("is not an OpenVDB file: it does not begin with its magic number".into());
    }
    let version = reader.u32()?;
    if !VERSIONS.contains(&version) {
        let (first, last) = (VERSIONS.start(), VERSIONS.end());
        return Err(format!("has version {version}, but only {first} to {last} are supported"));
    }
    reader.take(8)?;
    if reader.u8()? == 0 {
        return Err(
            "has no grid offsets (it was streamed): save it with OpenVDB as a file with offsets".into()
        );
    }
    reader.take(UUID)?;
    metadata(reader)?;
    let count = reader.u32()?;
    let mut entries = Vec::new();
    for _ in 0..count {
        let name = reader.text()?;
        let (kind, instance_of) = (reader.text()?, reader.text()?);
        let (at, _, end) = (reader.i64()?, reader.i64()?, reader.i64()?);
        // Grids with the same name have a suffix with a number after a separator.
        let name = name.split('\u{1e}').next().unwrap_or_default().to_string();
        entries.push(Entry { name, kind, instance_of, at });
        // Entries must be in order, or a small file could refer to billions of them.
        reader.skip_to(end)?;
    }
    Ok(entries)
}

/// Reads a metadata map; returns names and values of strings.
fn metadata(reader: &mut Bytes) -> Result<Vec<(String, String)>, String> {
    let count = reader.u32()?;
    let mut texts = Vec::new();
    for _ in 0..count {
        let (name, kind, length) = (reader.text()?, reader.text()?, reader.u32()?);
        let value = reader.take(length as usize)?;
        if kind == "string" {
            texts.push((name, String::from_utf8_lossy(value).into_owned()));
        }
    }
    Ok(texts)
}

fn chosen<'a>(entries: &'a [Entry], grid_name: Option<&str>) -> Result<&'a Entry, String> {
    let named = |name: &str| entries.iter().find(|entry| entry.name == name);
    let names = || {
        let names: Vec<String> = entries.iter().map(|entry| format!("'{}'", entry.name)).collect();
        if names.is_empty() { "none".to_string() } else { names.join(", ") }
    };
    match (grid_name, entries) {
        (Some(grid_name), _) => {
            named(grid_name).ok_or_else(|| format!("has no grid '{grid_name}', but {}", names()))
        }
        (None, [only]) => Ok(only),
        (None, _) => named("density")
            .ok_or_else(|| format!("has no grid 'density': 'grid_name' must be one of {}", names())),
    }
}

/// Reads the tree of a grid at the position of its entry.
fn grid(reader: &mut Bytes, entry: &Entry) -> Result<(DAffine3, Vec<Cube>), String> {
    let number = match entry.kind.as_str() {
        "Tree_float_5_4_3" => Number::Float,
        "Tree_float_5_4_3_HalfFloat" => Number::Half,
        "Tree_double_5_4_3" => Number::Double,
        kind => {
            return Err(format!("has the grid '{}' of type {kind}: only floats are supported", entry.name));
        }
    };
    if !entry.instance_of.is_empty() {
        let message = format!("has the grid '{}' as an instance of '{}'", entry.name, entry.instance_of);
        return Err(message + ", which is not supported: use that one");
    }
    reader.seek(entry.at)?;
    let compression = reader.u32()?;
    let metadata = metadata(reader)?;
    if metadata.iter().any(|(key, value)| key == "class" && value == "level set") {
        return Err(format!("has a level set in '{}', which holds distances, not densities", entry.name));
    }
    let map = read_map(reader)?;
    let mut values = Values { number, compression, background: 0.0 };
    Ok((map, read_tree(reader, &mut values)?))
}

/// The bounding box of the cubes with a margin: minimum corner and size in voxels; one voxel if there are no cubes.
fn box_of(cubes: &[Cube], margin: i64) -> Result<([i64; 3], [u64; 3]), String> {
    let (mut low, mut high) = ([i64::MAX; 3], [i64::MIN; 3]);
    for cube in cubes {
        for k in 0..3 {
            low[k] = low[k].min(cube.origin[k].into());
            high[k] = high[k].max(i64::from(cube.origin[k]) + i64::from(cube.edge));
        }
    }
    if cubes.is_empty() {
        // Empty grids occur in the first frames of a simulation.
        return Ok(([0; 3], [1; 3]));
    }
    let low = low.map(|c| c - margin);
    let size = [0, 1, 2].map(|k| (high[k] + margin - low[k]) as u64);
    let voxels = size.iter().try_fold(1u64, |product, &n| product.checked_mul(n));
    let [x, y, z] = size;
    if voxels.is_none_or(|voxels| voxels > MAX_VOXELS) {
        let message = format!("spans {x} x {y} x {z} voxels, more than {MAX_VOXELS}");
        return Err(message + ": resample it to a lower resolution");
    }
    Ok((low, size))
}

/// Copies cubes into a dense grid; `map` is the transform from index space to world space.
fn dense(map: &DAffine3, cubes: &[Cube], name: String, has_margin: bool) -> Result<Grid, String> {
    let (low, size) = box_of(cubes, i64::from(has_margin))?;
    let [along_x, along_y, _] = size.map(|n| n as usize);
    let mut values = vec![0.0f32; size.iter().product::<u64>() as usize];
    let (mut negative, mut positive) = (0u64, 0u64);
    for cube in cubes {
        let [x, y, z] = [0, 1, 2].map(|k| (i64::from(cube.origin[k]) - low[k]) as usize);
        let edge = cube.edge as usize;
        for (i, j, k) in (0..edge * edge * edge).map(|n| (n / (edge * edge), n / edge % edge, n % edge)) {
            let value = match &cube.voxels {
                Voxels::Same(value) => *value,
                Voxels::Each(all) => all[(i * edge + j) * edge + k],
            };
            if !value.is_finite() {
                return Err(format!("{name} holds values that are not finite"));
            }
            values[((z + k) * along_y + y + j) * along_x + x + i] = value.max(0.0);
            negative += u64::from(value < 0.0);
            positive += u64::from(value > 0.0);
        }
    }
    // Filtering may leave a few negative values.
    if negative > positive {
        return Err(format!(
            "{name} has more negative values than positive ones: it seems to hold distances, not densities"
        ));
    }
    let corner = DVec3::from_array(low.map(|c| c as f64 - 0.5));
    let world_from_voxels = *map * DAffine3::from_translation(corner);
    Ok(Grid { name, size: size.map(|n| n as u32), values: Arc::new(values), world_from_voxels })
}

/// Reads the map of a grid: the transform from index space, with voxel centres at integers, to the file's world space.
fn read_map(reader: &mut Bytes) -> Result<DAffine3, String> {
    let kind = reader.text()?;
    let scaled = |scale, origin| DAffine3::from_mat3_translation(DMat3::from_diagonal(scale), origin);
    let map = match kind.as_str() {
        "UniformScaleMap" | "ScaleMap" => {
            let scale = reader.vector()?;
            skip_vectors(reader, 4)?;
            scaled(scale, DVec3::ZERO)
        }
        "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
            let (origin, scale) = (reader.vector()?, reader.vector()?);
            skip_vectors(reader, 4)?;
            scaled(scale, origin)
        }
        "TranslationMap" => DAffine3::from_translation(reader.vector()?),
        "AffineMap" | "UnitaryMap" => affine(reader)?,
        _ => return Err(format!("has a transform of the unsupported type '{kind}'")),
    };
    let volume = map.matrix3.determinant();
    match map.is_finite() && volume != 0.0 && volume.is_finite() {
        true => Ok(map),
        false => Err("has a transform that is singular or not finite".into()),
    }
}

/// Skips vectors: the remaining ones of a scale map are redundant.
fn skip_vectors(reader: &mut Bytes, count: usize) -> Result<(), String> {
    (0..count).try_for_each(|_| reader.vector().map(|_| ()))
}

/// Reads a row-major matrix for row vectors: rows are the images of the axes and of the origin.
fn affine(reader: &mut Bytes) -> Result<DAffine3, String> {
    let mut rows = [[0.0; 4]; 4];
    for value in rows.as_flattened_mut() {
        *value = reader.f64()?;
    }
    let [x, y, z, origin] = rows.map(|[x, y, z, _]| DVec3::new(x, y, z));
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin))
}

// The tree of a grid (layout 5_4_3): the root has upper nodes of 32^3 children, these have lower nodes of 16^3 children, these
// have leaves of 8^3 voxels. A file has all nodes first and then, in the same order, the voxels of all leaves.

/// Upper nodes: bits of a coordinate within the node, and bits of the child index.
const UPPER: (u32, u32) = (12, 5);
/// Lower nodes, likewise.
const LOWER: (u32, u32) = (7, 4);
/// Bits of a coordinate within a leaf.
const LEAF: u32 = 3;
const LEAF_VOXELS: usize = 1 << (3 * LEAF);

/// An active tile, or a leaf.
struct Cube {
    /// Coordinates of the first voxel.
    pub origin: [i32; 3],
    /// Edge length, voxels.
    pub edge: u32,
    pub voxels: Voxels,
}

/// The values of a cube.
enum Voxels {
    /// A constant tile.
    Same(f32),
    /// The 512 voxels of a leaf, z fastest.
    Each(Vec<f32>),
}

/// Reads the active tiles and leaves of a tree.
fn read_tree(reader: &mut Bytes, values: &mut Values) -> Result<Vec<Cube>, String> {
    if reader.i32()? != 1 {
        return Err("has a tree of several buffers, which is not supported".into());
    }
    values.background = values.single(reader)?;
    let (tiles, children) = (reader.u32()?, reader.u32()?);
    let mut cubes = Vec::new();
    let mut origins = HashSet::new();
    for _ in 0..tiles {
        let (origin, value) = (reader.coordinates()?, values.single(reader)? as f32);
        check_origin(origin, &mut origins)?;
        if reader.u8()? != 0 {
            cubes.push(Cube { origin, edge: 1 << UPPER.0, voxels: Voxels::Same(value) });
        }
    }
    let mut leaves = Vec::new();
    for _ in 0..children {
        let origin = reader.coordinates()?;
        check_origin(origin, &mut origins)?;
        for upper in node(reader, values, (origin, UPPER), &mut cubes)? {
            for leaf in node(reader, values, (upper, LOWER), &mut cubes)? {
                Mask::read(reader, LEAF_VOXELS)?;
                leaves.push(leaf);
            }
        }
    }
    for origin in leaves {
        let active = Mask::read(reader, LEAF_VOXELS)?;
        let mut each = values.read(reader, &active)?;
        for (index, value) in each.iter_mut().enumerate() {
            // Inactive voxels are empty, regardless of their stored value.
            if !active.is_on(index) {
                *value = 0.0;
            }
        }
        cubes.push(Cube { origin, edge: 1 << LEAF, voxels: Voxels::Each(each) });
    }
    Ok(cubes)
}

/// Children of the root must be aligned and distinct, so that no voxel occurs twice.
fn check_origin(origin: [i32; 3], origins: &mut HashSet<[i32; 3]>) -> Result<(), String> {
    let is_aligned = origin.iter().all(|c| c.trailing_zeros() >= UPPER.0);
    match is_aligned && origins.insert(origin) {
        true => Ok(()),
        false => Err(format!("has a tree whose nodes overlap, at the voxel {origin:?}")),
    }
}

/// Reads a node, adds its active tiles to `cubes`, and returns the origins of its children, which follow in depth-first order.
fn node(
    reader: &mut Bytes,
    values: &Values,
    (origin, (bits, own)): ([i32; 3], (u32, u32)),
    cubes: &mut Vec<Cube>,
) -> Result<Vec<[i32; 3]>, String> {
    let count = 1 << (3 * own);
    let children = Mask::read(reader, count)?;
    let active = Mask::read(reader, count)?;
    let tiles = values.read(reader, &active)?;
    let below = bits - own;
    let child_origin = |index: usize| {
        let index = index as i32;
        let within = [index >> (2 * own), index >> own, index].map(|i| i & ((1 << own) - 1));
        [0, 1, 2].map(|k| origin[k].wrapping_add(within[k] << below))
    };
    for index in active.on().filter(|&index| !children.is_on(index)) {
        cubes.push(Cube {
            origin: child_origin(index),
            edge: 1 << below,
            voxels: Voxels::Same(tiles[index]),
        });
    }
    Ok(children.on().map(child_origin).collect())
}

/// Files written by OpenVDB 12 and by the tests, intact and damaged.
#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use std::io::Write;

    /// Reads a y-up grid without a margin.
    fn parse(bytes: &[u8], file: &str, grid_name: Option<&str>) -> Result<Grid, String> {
        super::parse(bytes, file, grid_name, (false, false))
    }

    /// Two grids, compressed by Blosc; the second, `density`, is (1 + i + 10 j + 100 k) / 64 at the voxel (i - 2, j + 4, k + 1).
    const BLOSC: &[u8] = include_bytes!("tests/blosc.vdb");
    /// A density as half floats, and a boolean grid.
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
        assert_is_the_density(&parse(BLOSC, "smoke.vdb", None).expect("the default grid"));
        assert_is_the_density(&parse(BLOSC, "smoke.vdb", Some("density")).expect("by its name"));
        assert_is_the_density(&parse(HALF, "smoke.vdb", None).expect("half floats"));
        let other = parse(BLOSC, "smoke.vdb", Some("temperature")).expect("the other grid");
        assert_eq!((other.values.iter().sum::<f32>(), value(&other, [3, 3, 3])), (448.0, 7.0));
    }

    #[test]
    fn z_up_grids_are_rotated_to_y_up() {
        let grid = parse(BLOSC, "smoke.vdb", None).expect("a grid");
        let up = super::parse(BLOSC, "smoke.vdb", None, (true, false)).expect("a rotated grid");
        assert_eq!((up.size, &up.values), (grid.size, &grid.values));
        for at in [[6.0, 4.0, 1.0], [9.0, 7.0, 3.0], [15.0, 9.0, 5.0]] {
            let [z_up, y_up] =
                [&grid, &up].map(|grid| grid.world_from_voxels.transform_point3(DVec3::from_array(at)));
            assert!((y_up - DVec3::new(z_up.x, z_up.z, -z_up.y)).length() < 1e-12, "{y_up} {z_up}");
        }
    }

    #[test]
    fn margins_are_empty_and_keep_positions() {
        let grid = parse(BLOSC, "smoke.vdb", None).expect("a grid");
        let wide = super::parse(BLOSC, "smoke.vdb", None, (false, true)).expect("a wider one");
        assert_eq!(wide.size, grid.size.map(|n| n + 2));
        assert_eq!(wide.values.iter().sum::<f32>(), grid.values.iter().sum::<f32>());
        for at in [[6, 4, 1], [9, 7, 3]] {
            let shifted = at.map(|k| k + 1);
            assert_eq!(value(&wide, shifted), value(&grid, at));
            let [a, b] = [(&grid, at), (&wide, shifted)].map(|(grid, at)| {
                grid.world_from_voxels.transform_point3(DVec3::from_array(at.map(f64::from)))
            });
            assert!((a - b).length() < 1e-12, "{a} {b}");
        }
    }

    #[test]
    fn maps_of_all_types_are_read() {
        let map = |kind: &str, numbers: &[f64]| {
            let mut w = Writer(Vec::new());
            w.text(kind);
            w.0.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
            read_map(&mut Bytes::new(&w.0))
        };
        let matrix = [0.0, 2.0, 0.0, 0.0, -1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 3.0, 0.0, 7.0, 8.0, 9.0, 1.0];
        let affine = map("AffineMap", &matrix).expect("a map");
        assert_eq!(affine.transform_point3(DVec3::new(1.0, 10.0, 100.0)), DVec3::new(-3.0, 10.0, 314.0));
        let moved = map("TranslationMap", &[1.0, 2.0, 3.0]).expect("a map");
        assert_eq!(moved.transform_point3(DVec3::ONE), DVec3::new(2.0, 3.0, 4.0));
        let scaled = [&[1.0, 2.0, 3.0, 0.5, -0.25, 2.0][..], &[0.0; 12]].concat();
        let scaled = map("ScaleTranslateMap", &scaled).expect("a map");
        assert_eq!(scaled.transform_point3(DVec3::splat(4.0)), DVec3::new(3.0, 1.0, 11.0));
        let flat = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        assert!(map("AffineMap", &flat).expect_err("flat").contains("singular"));
        assert!(map("FrustumMap", &[]).expect_err("a frustum").contains("FrustumMap"));
    }

    #[test]
    fn grids_without_voxels_are_empty() {
        let grid = dense(&DAffine3::IDENTITY, &[], "no smoke yet".into(), true).expect("a grid");
        assert_eq!((grid.size, grid.values.as_slice()), ([1; 3], &[0.0][..]));
    }

    /// Options of written test files.
    #[derive(Clone, Copy)]
    struct Form {
        compression: u32,
        kind: &'static str,
        class: &'static str,
        /// Factor on values.
        sign: f32,
    }

    const PLAIN: Form = Form { compression: 0, kind: "Tree_float_5_4_3", class: "fog volume", sign: 1.0 };

    /// Offset of the first grid's entry in a written file, bytes.
    const ENTRY: usize = 65;
    /// Offset of the origin of the root's child, bytes.
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

        /// Writes the values of a node; with the flag 2, only active ones.
        fn values(&mut self, form: Form, all: &[f32], active: &[bool]) {
            // Inactive values are the background.
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

    /// A grid with a leaf at (0, 0, 0), with i + 1 at even voxels i and inactive odd voxels, next to a tile of 8^3 voxels of 5.
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
    fn all_compression_flags_are_read() {
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
    fn unsupported_and_invalid_files_are_reported() {
        let with = |at: usize, byte: u8| {
            let mut bytes = written(PLAIN);
            bytes[at] = byte;
            bytes
        };
        // Four billion grid entries, each referring to itself.
        let mut endless = written(PLAIN);
        endless[ENTRY - 4..ENTRY].fill(255);
        endless[ENTRY + 51..ENTRY + 59].copy_from_slice(&(ENTRY as i64).to_le_bytes());
        for (bytes, grid_name, words) in [
            (b"nonsense".to_vec(), None, "is not an OpenVDB file"),
            (endless, None, "a position before itself"),
            (with(ORIGIN, 8), None, "nodes overlap"),
            (written(Form { sign: -1.0, ..PLAIN }), None, "more negative values"),
            (Vec::new(), None, "is not an OpenVDB file"),
            (with(8, 221), None, "version 221"),
            (with(20, 0), None, "streamed"),
            (written(PLAIN), Some("heat"), "no grid 'heat', but 'density'"),
            (BLOSC.to_vec(), Some("heat"), "'temperature', 'density'"),
            (HALF.to_vec(), Some("mask"), "only floats"),
            (written(Form { class: "level set", ..PLAIN }), None, "level set"),
            (written(Form { kind: "Tree_vec3s_5_4_3", ..PLAIN }), None, "Tree_vec3s"),
        ] {
            let message = parse(&bytes, "made.vdb", grid_name).expect_err(words);
            assert!(message.contains(words), "{message}: {words}");
        }
    }

    /// Truncated files, and files with random changes, cause errors or valid grids.
    #[test]
    fn damaged_files_are_errors_or_grids() {
        let files =
            [BLOSC.to_vec(), HALF.to_vec(), written(PLAIN), written(Form { compression: 3, ..PLAIN })];
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
                    // Half of the changes are in the first 700 bytes, as most of the rest are masks, where any bits are valid.
                    let random = next();
                    let at =
                        if next() % 2 == 0 { random % 700 } else { whole.len() - 1 - random % whole.len() };
                    damaged[at] = next() as u8;
                }
                if let Ok(grid) = parse(&damaged, "damaged.vdb", Some("density")) {
                    let voxels: u64 = grid.size.iter().map(|&n| u64::from(n)).product();
                    assert!(voxels == grid.values.len() as u64 && grid.values.iter().all(|v| *v >= 0.0));
                }
            }
        }
    }
}
