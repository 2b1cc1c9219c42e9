//! Grid files: OpenVDB (see `vdb`), and Mitsuba's `.vol` format, version 3.
//!
//! `.vol`, little-endian: `VOL` and the version (u8, 3); encoding (u32; 1 is f32); voxels along x, y and z (3 u32); channels
//! (u32; 1 is supported); minimum and maximum corner of the box (6 f32); values (f32), x fastest, then y, then z.

use super::{files, vdb};
use crate::math::DVec3;
use crate::scene::Grid;
use std::path::Path;
use std::sync::Arc;

/// Size of a `.vol` header, bytes.
const HEADER: usize = 48;

/// Selection of a grid in an OpenVDB file; other formats have a single grid with y up.
#[derive(Clone, Copy, Default)]
pub(super) struct GridChoice<'a> {
    /// Name of the grid; by default `density`, or the only grid.
    pub name: Option<&'a str>,
    /// z points up in the file and is converted to y.
    pub is_z_up: bool,
    /// Add a margin of one voxel, over which values fall off to 0.
    pub has_margin: bool,
}

/// Reads a grid file.
///
/// # Errors
/// A message with the file's path.
pub(super) fn read(path: &Path, choice: GridChoice) -> Result<Grid, String> {
    let name = path.display().to_string();
    let extension = path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_lowercase());
    let bytes = files::read(path, files::MAX_DATA).map_err(|e| format!("{name}: {e}"))?;
    let grid = match extension.as_str() {
        "vdb" => vdb::parse(&bytes, &name, choice.name, (choice.is_z_up, choice.has_margin)),
        "nvdb" => {
            Err("is a NanoVDB file, which is not supported: convert it by nanovdb_convert to .vdb".into())
        }
        _ if choice.name.is_some() || choice.is_z_up => {
            Err("is not a .vdb file: 'grid_name' and 'up' apply to those only".into())
        }
        _ => parse(&bytes, &name),
    };
    grid.map_err(|e| format!("{name}: {e}"))
}

fn parse(bytes: &[u8], name: &str) -> Result<Grid, String> {
    let Some((header, data)) = bytes.split_at_checked(HEADER) else {
        return Err(format!("has {} bytes, but the header of a .vol file has {HEADER}", bytes.len()));
    };
    if &header[..3] != b"VOL" {
        return Err("is not a .vol file: it does not begin with 'VOL'".into());
    }
    if header[3] != 3 {
        return Err(format!("has version {}, but only version 3 is supported", header[3]));
    }
    let word = |i: usize| {
        let at = 4 + 4 * i;
        u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]])
    };
    if word(0) != 1 {
        return Err(format!("has the encoding {}, but only 1 (32-bit floats) is supported", word(0)));
    }
    if word(4) != 1 {
        return Err(format!("has {} channels, but only one (a density) is supported", word(4)));
    }
    let size = [word(1), word(2), word(3)];
    let voxels = size.iter().try_fold(1u64, |product, &n| product.checked_mul(u64::from(n)));
    let byte_count = voxels.and_then(|n| n.checked_mul(4)).filter(|&n| n == data.len() as u64 && n > 0);
    if byte_count.is_none() {
        let [x, y, z] = size;
        return Err(format!("declares {x} x {y} x {z} voxels, but has {} bytes of values", data.len()));
    }
    let corner =
        |first: usize| DVec3::from_array([0, 1, 2].map(|i| f64::from(f32::from_bits(word(first + i)))));
    let values = data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Ok(Grid::in_box(name.to_string(), size, Arc::new(values), corner(5), corner(8)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(size: [u32; 3], values: &[f32]) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        bytes.extend([1, size[0], size[1], size[2], 1].into_iter().flat_map(u32::to_le_bytes));
        bytes.extend([-1.0, 0.0, -2.0, 1.0, 3.0, 2.0].into_iter().flat_map(f32::to_le_bytes));
        bytes.extend(values.iter().flat_map(|x| x.to_le_bytes()));
        bytes
    }

    #[test]
    fn vol_grids_are_parsed() {
        let grid = parse(&file([3, 2, 1], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), "smoke").expect("a grid");
        assert_eq!((grid.size, grid.values[4]), ([3, 2, 1], 4.0));
        assert_eq!(grid.bounds(), (DVec3::new(-1.0, 0.0, -2.0), DVec3::new(1.0, 3.0, 2.0)));
    }

    #[test]
    fn damaged_files_are_reported() {
        let good = file([2, 1, 1], &[1.0, 2.0]);
        let with = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            bytes
        };
        for (bytes, words) in [
            (Vec::new(), "has 0 bytes"),
            (good[..20].to_vec(), "has 20 bytes"),
            (good[..50].to_vec(), "has 2 bytes of values"),
            ([&good[..], &[0]].concat(), "has 9 bytes of values"),
            (with(0, b'X'), "does not begin"),
            (with(3, 2), "version 2"),
            (with(4, 3), "encoding 3"),
            (with(20, 3), "3 channels"),
            (with(8, 0), "declares 0 x 1 x 1"),
            (with(11, 0xff), "voxels"),
            (file([u32::MAX; 3], &[1.0]), "voxels"),
        ] {
            let message = parse(&bytes, "smoke").expect_err(words);
            assert!(message.contains(words), "{message}: {words}");
        }
    }
}
