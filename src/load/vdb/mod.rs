//! OpenVDB files (`.vdb`), in the versions 222 to 224 that OpenVDB writes since 2013: one grid of floats, uncompressed or
//! compressed by zlib or Blosc, as f64, f32 or f16. It becomes a dense grid over the box of its active voxels, with a margin of a voxel on each
//! side: values fall to 0 over the distance of two voxels.

mod values;

use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::Grid;
use std::collections::HashSet;
use std::sync::Arc;
use values::{Bytes, Mask, Number, Values};

const MAGIC: i64 = 0x5644_4220;
const VERSIONS: std::ops::RangeInclusive<u32> = 222..=224;
/// Maximum number of voxels of the box: two GiB.
const MAX_VOXELS: u64 = 1 << 29;
/// Rotation from z up to y up.
const Z_UP: DAffine3 = DAffine3 {
    matrix3: DMat3 { x_axis: DVec3::X, y_axis: DVec3::NEG_Z, z_axis: DVec3::Y },
    translation: DVec3::ZERO,
};
/// Characters of a file's unique name.
const UUID: usize = 36;

/// A grid in a file.
struct Entry {
    name: String,
    /// The type of the tree, such as `Tree_float_5_4_3`.
    kind: String,
    /// Name of the grid whose tree it shares; empty for none.
    instance_of: String,
    at: i64,
}

/// Reads the grid of a name, or `density`, or the only one, from a world with y or z up; the error is a message.
///
/// Without a margin the box ends where its active voxels do.
pub(super) fn parse(
    bytes: &[u8],
    file: &str,
    wanted: Option<&str>,
    (is_z_up, has_margin): (bool, bool),
) -> Result<Grid, String> {
    let mut from = Bytes::new(bytes);
    let entries = entries(&mut from)?;
    let entry = chosen(&entries, wanted)?;
    let (map, cubes) = grid(&mut from, entry)?;
    let up = if is_z_up { Z_UP } else { DAffine3::IDENTITY };
    dense(&(up * map), &cubes, format!("{file} ({})", entry.name), has_margin)
}

/// The grids of the file.
fn entries(from: &mut Bytes) -> Result<Vec<Entry>, String> {
    if from.i64().unwrap_or(0) != MAGIC {
        return Err("is not an OpenVDB file: it does not begin with its magic number".into());
    }
    let version = from.u32()?;
    if !VERSIONS.contains(&version) {
        let (first, last) = (VERSIONS.start(), VERSIONS.end());
        return Err(format!("is of version {version}, but only {first} to {last} are read"));
    }
    from.take(8)?;
    if from.u8()? == 0 {
        return Err("has no offsets of its grids (it was streamed): write it to a file by OpenVDB".into());
    }
    from.take(UUID)?;
    metadata(from)?;
    let count = from.u32()?;
    let mut entries = Vec::new();
    for _ in 0..count {
        let name = from.text()?;
        let (kind, instance_of) = (from.text()?, from.text()?);
        let (at, _, end) = (from.i64()?, from.i64()?, from.i64()?);
        // Grids of the same name have a number after a separator.
        let name = name.split('\u{1e}').next().unwrap_or_default().to_string();
        entries.push(Entry { name, kind, instance_of, at });
        // Entries must be in order, or a small file could refer to billions of them.
        from.skip_to(end)?;
    }
    Ok(entries)
}

/// Names, types and bytes of a map of metadata; those of text.
fn metadata(from: &mut Bytes) -> Result<Vec<(String, String)>, String> {
    let count = from.u32()?;
    let mut texts = Vec::new();
    for _ in 0..count {
        let (name, kind, length) = (from.text()?, from.text()?, from.u32()?);
        let value = from.take(length as usize)?;
        if kind == "string" {
            texts.push((name, String::from_utf8_lossy(value).into_owned()));
        }
    }
    Ok(texts)
}

fn chosen<'a>(entries: &'a [Entry], wanted: Option<&str>) -> Result<&'a Entry, String> {
    let named = |name: &str| entries.iter().find(|entry| entry.name == name);
    let names = || {
        let names: Vec<String> = entries.iter().map(|entry| format!("'{}'", entry.name)).collect();
        if names.is_empty() { "none".to_string() } else { names.join(", ") }
    };
    match (wanted, entries) {
        (Some(wanted), _) => named(wanted).ok_or_else(|| format!("has no grid '{wanted}', but {}", names())),
        (None, [only]) => Ok(only),
        (None, _) => named("density")
            .ok_or_else(|| format!("has no grid 'density': 'grid_name' must be one of {}", names())),
    }
}

/// Reads the tree of a grid at the position of its entry.
fn grid(from: &mut Bytes, entry: &Entry) -> Result<(DAffine3, Vec<Cube>), String> {
    let number = match entry.kind.as_str() {
        "Tree_float_5_4_3" => Number::Float,
        "Tree_float_5_4_3_HalfFloat" => Number::Half,
        "Tree_double_5_4_3" => Number::Double,
        kind => {
            return Err(format!("has the grid '{}' of the kind {kind}: only floats are read", entry.name));
        }
    };
    if !entry.instance_of.is_empty() {
        let message = format!("has the grid '{}' as an instance of '{}'", entry.name, entry.instance_of);
        return Err(message + ", which is not read: name that one");
    }
    from.seek(entry.at)?;
    let compression = from.u32()?;
    let about = metadata(from)?;
    if about.iter().any(|(key, value)| key == "class" && value == "level set") {
        return Err(format!("has a level set in '{}', which holds distances, not densities", entry.name));
    }
    let map = read_map(from)?;
    let mut values = Values { number, compression, background: 0.0 };
    Ok((map, read_tree(from, &mut values)?))
}

/// The box around cubes and a margin: its least corner, and voxels along each axis; one voxel where there are no cubes.
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

/// Copies cubes into one dense box; the map transforms voxel centers to world space.
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
    // Filters leave some negative values around dense voxels.
    if negative > positive {
        return Err(format!(
            "{name} holds more negative values than positive ones, as distances do, not densities"
        ));
    }
    let corner = DVec3::from_array(low.map(|c| c as f64 - 0.5));
    let world_from_voxels = *map * DAffine3::from_translation(corner);
    Ok(Grid { name, size: size.map(|n| n as u32), values: Arc::new(values), world_from_voxels })
}

// The maps of OpenVDB (transforms from index space to world space).

/// Reads the transform of a grid: from voxels, whose centres are at integers, to the file's world.
fn read_map(from: &mut Bytes) -> Result<DAffine3, String> {
    let kind = from.text()?;
    let scaled = |scale, origin| DAffine3::from_mat3_translation(DMat3::from_diagonal(scale), origin);
    let map = match kind.as_str() {
        "UniformScaleMap" | "ScaleMap" => {
            let scale = from.vector()?;
            skip_vectors(from, 4)?;
            scaled(scale, DVec3::ZERO)
        }
        "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
            let (origin, scale) = (from.vector()?, from.vector()?);
            skip_vectors(from, 4)?;
            scaled(scale, origin)
        }
        "TranslationMap" => DAffine3::from_translation(from.vector()?),
        "AffineMap" | "UnitaryMap" => affine(from)?,
        _ => return Err(format!("has a transform of the kind '{kind}', which is not read")),
    };
    let volume = map.matrix3.determinant();
    match map.is_finite() && volume != 0.0 && volume.is_finite() {
        true => Ok(map),
        false => Err("has a transform that is singular or not finite".into()),
    }
}

/// Skips vectors: the rest of a scale's header is redundant.
fn skip_vectors(from: &mut Bytes, count: usize) -> Result<(), String> {
    (0..count).try_for_each(|_| from.vector().map(|_| ()))
}

/// A matrix whose rows are the images of the axes and of the origin.
fn affine(from: &mut Bytes) -> Result<DAffine3, String> {
    let mut rows = [[0.0; 4]; 4];
    for value in rows.as_flattened_mut() {
        *value = from.f64()?;
    }
    let [x, y, z, origin] = rows.map(|[x, y, z, _]| DVec3::new(x, y, z));
    Ok(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin))
}

// The tree of a grid: a root with nodes of 32^3, each with nodes of 16^3, each with leaves of 8^3 voxels (the layout 5_4_3). A file
// has the nodes first and then, in the same order, the voxels of all leaves.

/// Bits of a coordinate within the nodes of a level and all below it; and the level's own.
const UPPER: (u32, u32) = (12, 5);
const LOWER: (u32, u32) = (7, 4);
const LEAF: u32 = 3;
const LEAF_VOXELS: usize = 1 << (3 * LEAF);

/// Cubes of voxels along a coordinate that have one value, or the values of a leaf.
struct Cube {
    /// Coordinates of its first voxel.
    pub origin: [i32; 3],
    /// Voxels along an edge.
    pub edge: u32,
    pub voxels: Voxels,
}

/// The values of a cube.
enum Voxels {
    /// One value throughout.
    Same(f32),
    /// Each voxel's, that along z fastest; 512.
    Each(Vec<f32>),
}

/// Reads all cubes of a tree in which values are active.
fn read_tree(from: &mut Bytes, values: &mut Values) -> Result<Vec<Cube>, String> {
    if from.i32()? != 1 {
        return Err("has a tree of several buffers, which is not read".into());
    }
    values.background = values.single(from)?;
    let (tiles, children) = (from.u32()?, from.u32()?);
    let mut cubes = Vec::new();
    let mut taken = HashSet::new();
    for _ in 0..tiles {
        let (origin, value) = (from.coordinates()?, values.single(from)? as f32);
        check_origin(origin, &mut taken)?;
        if from.u8()? != 0 {
            cubes.push(Cube { origin, edge: 1 << UPPER.0, voxels: Voxels::Same(value) });
        }
    }
    let mut leaves = Vec::new();
    for _ in 0..children {
        let origin = from.coordinates()?;
        check_origin(origin, &mut taken)?;
        for upper in node(from, values, (origin, UPPER), &mut cubes)? {
            for leaf in node(from, values, (upper, LOWER), &mut cubes)? {
                Mask::read(from, LEAF_VOXELS)?;
                leaves.push(leaf);
            }
        }
    }
    for origin in leaves {
        let active = Mask::read(from, LEAF_VOXELS)?;
        let mut each = values.read(from, &active)?;
        for (index, value) in each.iter_mut().enumerate() {
            // Inactive voxels are empty, whatever their stored value.
            if !active.is_on(index) {
                *value = 0.0;
            }
        }
        cubes.push(Cube { origin, edge: 1 << LEAF, voxels: Voxels::Each(each) });
    }
    Ok(cubes)
}

/// Children of the root must be aligned and distinct, so that no voxel occurs twice.
fn check_origin(origin: [i32; 3], taken: &mut HashSet<[i32; 3]>) -> Result<(), String> {
    let is_aligned = origin.iter().all(|c| c.trailing_zeros() >= UPPER.0);
    match is_aligned && taken.insert(origin) {
        true => Ok(()),
        false => Err(format!("has a tree whose nodes overlap, at the voxel {origin:?}")),
    }
}

/// Reads a node with its tiles; the origins of its children, which follow it.
///
/// A file has the children of a child before its next sibling, so the upper level can't be read at once.
fn node(
    from: &mut Bytes,
    values: &Values,
    (origin, (bits, own)): ([i32; 3], (u32, u32)),
    cubes: &mut Vec<Cube>,
) -> Result<Vec<[i32; 3]>, String> {
    let count = 1 << (3 * own);
    let children = Mask::read(from, count)?;
    let active = Mask::read(from, count)?;
    let tiles = values.read(from, &active)?;
    let below = bits - own;
    let place = |index: usize| {
        let index = index as i32;
        let within = [index >> (2 * own), index >> own, index].map(|i| i & ((1 << own) - 1));
        [0, 1, 2].map(|k| origin[k].wrapping_add(within[k] << below))
    };
    for index in active.on().filter(|&index| !children.is_on(index)) {
        cubes.push(Cube { origin: place(index), edge: 1 << below, voxels: Voxels::Same(tiles[index]) });
    }
    Ok(children.on().map(place).collect())
}

/// Files that OpenVDB 12 wrote, and ones written here by its description, whole and damaged.
#[cfg(test)]
mod tests {
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
            let [a, b] = [(&grid, at), (&wide, beside)].map(|(grid, at)| {
                grid.world_from_voxels.transform_point3(DVec3::from_array(at.map(f64::from)))
            });
            assert!((a - b).length() < 1e-12, "{a} {b}");
        }
    }

    /// Transforms as OpenVDB writes them: rows are the images of the axes.
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
        assert!(map("AffineMap", &flat).expect_err("flat").contains("singular"));
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
        /// Factor on values.
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
    fn what_is_not_read_is_reported() {
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
            let message = parse(&bytes, "made.vdb", wanted).expect_err(words);
            assert!(message.contains(words), "{message}: {words}");
        }
    }

    /// Every beginning of a file, and files with bytes changed at random: an error or a grid, and nothing else.
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
                    // Nodes' masks, which any bits may be in, take most of the file: half of the changes are at its ends.
                    let place = next();
                    let at =
                        if next() % 2 == 0 { place % 700 } else { whole.len() - 1 - place % whole.len() };
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
