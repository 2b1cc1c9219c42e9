//! OpenVDB files (`.vdb`), in the versions 222 to 224 that OpenVDB writes since 2013: one grid of floats, with its values stored plainly, or
//! packed by zlib or Blosc, as f64, f32 or f16. It becomes a dense grid over the box of its active voxels, one wider on each
//! side: nothing is outside, and values fall to it over the distance of two voxels.

mod blosc;
mod values;

use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::Grid;
use std::collections::HashSet;
use std::sync::Arc;
use values::{Bytes, Mask};
use values::{Number, Values};

const MAGIC: i64 = 0x5644_4220;
const VERSIONS: std::ops::RangeInclusive<u32> = 222..=224;
/// Most voxels of the box: two GiB.
const MOST_VOXELS: u64 = 1 << 29;
/// Makes z y, and y -z.
const Z_UP: DAffine3 = DAffine3 {
    matrix3: DMat3 { x_axis: DVec3::X, y_axis: DVec3::NEG_Z, z_axis: DVec3::Y },
    translation: DVec3::ZERO,
};
/// Characters of a file's unique name.
const UUID: usize = 36;

/// A grid in a file.
struct Entry {
    name: String,
    /// Such as `Tree_float_5_4_3`.
    kind: String,
    /// It shares the tree of another.
    instance_of: String,
    at: i64,
}

/// Reads the grid of a name, or `density`, or the only one, of a world whose y or z points up; an error is a sentence.
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
        return Err("is no OpenVDB file: it does not begin with its magic number".into());
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
        // Grids of the same name have a number behind a separator.
        let name = name.split('\u{1e}').next().unwrap_or_default().to_string();
        entries.push(Entry { name, kind, instance_of, at });
        // Entries follow each other, or a small file could name billions of them.
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

/// Reads what a grid's entry says is there.
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
        return Err(format!("has a level set in '{}', which are distances and no densities", entry.name));
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
        // Before smoke rises there is none.
        return Ok(([0; 3], [1; 3]));
    }
    let low = low.map(|c| c - margin);
    let size = [0, 1, 2].map(|k| (high[k] + margin - low[k]) as u64);
    let voxels = size.iter().try_fold(1u64, |product, &n| product.checked_mul(n));
    let [x, y, z] = size;
    if voxels.is_none_or(|voxels| voxels > MOST_VOXELS) {
        let message = format!("spans {x} x {y} x {z} voxels, more than {MOST_VOXELS}");
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
                return Err(format!("{name} holds values that are no numbers"));
            }
            values[((z + k) * along_y + y + j) * along_x + x + i] = value.max(0.0);
            negative += u64::from(value < 0.0);
            positive += u64::from(value > 0.0);
        }
    }
    // Filters leave a few below 0 around what is dense.
    if negative > positive {
        return Err(format!(
            "{name} holds more negative values than positive ones, as distances do, not densities"
        ));
    }
    let corner = DVec3::from_array(low.map(|c| c as f64 - 0.5));
    let world_from_voxels = *map * DAffine3::from_translation(corner);
    Ok(Grid { name, size: size.map(|n| n as u32), values: Arc::new(values), world_from_voxels })
}

#[cfg(test)]
mod tests;

// The maps of OpenVDB (transforms from index space to world space).

/// Reads the transform of a grid: from voxels, whose middles are at whole numbers, to the file's world.
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
        false => Err("has a transform that flattens it or is no number".into()),
    }
}

/// What follows from the scale.
fn skip_vectors(from: &mut Bytes, count: usize) -> Result<(), String> {
    (0..count).try_for_each(|_| from.vector().map(|_| ()))
}

/// A matrix whose rows are what the axes become, and the origin.
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
