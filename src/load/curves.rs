//! Hair and other curves: oscura's text format `.curves`, and the binary `.hair` of Cem Yuksel's HAIR models.
//!
//! `.curves`: the first line is `curves 1` (the version), optionally followed by `basis NAME`. Then come the points, one
//! a line, in one of three forms throughout the file: `x y z`, `x y z radius` or `x y z radius r g b`. A blank line ends
//! a strand; `#` begins a comment.
//!
//! `.hair`, little-endian. Header of 128 bytes: `HAIR`; number of strands, number of points (u32); bits of the arrays
//! present (u32: 1 segments, 2 points, 4 thickness, 8 transparency, 16 colours); defaults for absent arrays: segments per
//! strand, thickness, transparency, colour (u32, f32, f32, 3 f32); 88 bytes of text. Arrays: segments per strand (u16),
//! all others per point (f32). A strand of n segments has n + 1 points. Thickness is the diameter.

use super::files;
use crate::math::{DAffine3, DVec3};
use crate::scene::CurveBasis;
use std::path::Path;

/// Size of a `.hair` header, bytes.
const HEADER: usize = 128;
/// Maximum file size, bytes.
const MAX_BYTES: u64 = 1 << 33;
/// Maximum coordinate, metres.
const MAX_COORDINATE: f64 = 1e18;

/// Contents of a curve file.
#[derive(Debug, Default, PartialEq)]
pub(super) struct CurveFile {
    /// Curve basis, if the file specifies one.
    pub basis: Option<CurveBasis>,
    /// Number of points per strand.
    pub strands: Vec<u32>,
    pub points: Vec<[f32; 3]>,
    /// Per point; empty if absent.
    pub radii: Vec<f32>,
    /// Per point; empty if absent.
    pub colors: Vec<[f32; 3]>,
    /// Name of ignored data, for a warning.
    pub ignored: Option<&'static str>,
}

/// Reads a file.
///
/// # Errors
/// A message with the file's path.
pub(super) fn read(path: &Path) -> Result<CurveFile, String> {
    let name = path.display();
    let bytes = files::read(path, MAX_BYTES).map_err(|e| format!("{name}: {e}"))?;
    parse(&bytes).map_err(|e| format!("{name}: {e}"))
}

/// Parses a file in either format.
pub(super) fn parse(bytes: &[u8]) -> Result<CurveFile, String> {
    if bytes.starts_with(b"HAIR") {
        return parse_hair(bytes);
    }
    let is_text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).starts_with(b"curves");
    match std::str::from_utf8(bytes) {
        Ok(text) if is_text => parse_text(text.trim_start_matches('\u{feff}')),
        _ if is_text => Err("is not UTF-8 text".into()),
        _ => Err("holds no curves: it begins neither with 'curves' (text) nor with 'HAIR' (binary)".into()),
    }
}

fn parse_text(text: &str) -> Result<CurveFile, String> {
    let mut lines =
        text.lines().enumerate().map(|(i, line)| (i + 1, line.split('#').next().unwrap_or("").trim()));
    let first = lines.next().map_or("", |(_, line)| line);
    match first.strip_prefix("curves").map(str::trim) {
        Some("1") => {}
        Some(other) => return Err(format!("line 1: has version '{other}', but only version 1 is supported")),
        None => return Err("line 1: must be 'curves 1'".into()),
    }
    let (mut file, mut width, mut strand_length) = (CurveFile::default(), None, 0u32);
    for (number, line) in lines {
        if line.is_empty() {
            file.end_strand(&mut strand_length);
        } else if let Some(name) = line.strip_prefix("basis ") {
            let basis = CurveBasis::from_name(name.trim());
            file.basis =
                Some(basis.ok_or_else(|| format!("line {number}: there is no basis '{}'", name.trim()))?);
        } else {
            let values =
                numbers(line).map_err(|word| format!("line {number}: '{word}' is not a finite number"))?;
            if !matches!(values.len(), 3 | 4 | 7) || *width.get_or_insert(values.len()) != values.len() {
                let expected =
                    width.filter(|w| matches!(w, 3 | 4 | 7)).map_or("3, 4 or 7".into(), |w| w.to_string());
                return Err(format!("line {number}: has {} numbers, but must have {expected}", values.len()));
            }
            file.push_point(&values);
            strand_length += 1;
        }
    }
    file.end_strand(&mut strand_length);
    Ok(file)
}

fn numbers(line: &str) -> Result<Vec<f32>, &str> {
    let number = |word| str::parse(word).ok().filter(|x: &f32| x.is_finite()).ok_or(word);
    line.split_whitespace().map(number).collect()
}

impl CurveFile {
    fn end_strand(&mut self, points: &mut u32) {
        if *points > 0 {
            self.strands.push(std::mem::take(points));
        }
    }

    /// Drops strands with points or radii above [`MAX_COORDINATE`] in world space; returns their number. All points must
    /// have a radius.
    pub fn remove_distant_strands(&mut self, world_from_object: DAffine3) -> usize {
        let scale = world_from_object.matrix3.to_cols_array().iter().fold(0.0f64, |max, x| max.max(x.abs()));
        let is_near = |i: usize| {
            let point = world_from_object.transform_point3(DVec3::from(self.points[i].map(f64::from)));
            point.abs().max_element() <= MAX_COORDINATE && f64::from(self.radii[i]) * scale <= MAX_COORDINATE
        };
        let mut first = 0;
        let is_kept: Vec<bool> = self
            .strands
            .iter()
            .map(|&count| {
                let points = first..first + count as usize;
                first = points.end;
                points.into_iter().all(is_near)
            })
            .collect();
        let dropped = is_kept.iter().filter(|is_near| !**is_near).count();
        if dropped == 0 {
            return 0;
        }
        let by_point = is_kept.iter().zip(&self.strands);
        let kept: Vec<bool> =
            by_point.flat_map(|(&kept, &n)| std::iter::repeat_n(kept, n as usize)).collect();
        retain(&mut self.strands, &is_kept);
        retain(&mut self.points, &kept);
        retain(&mut self.radii, &kept);
        retain(&mut self.colors, &kept);
        dropped
    }

    fn push_point(&mut self, values: &[f32]) {
        self.points.push([values[0], values[1], values[2]]);
        self.radii.extend(values.get(3));
        if let Some(&[r, g, b]) = values.get(4..7) {
            self.colors.push([r, g, b]);
        }
    }
}

/// Keeps the values with a true flag.
fn retain<T>(values: &mut Vec<T>, is_kept: &[bool]) {
    let mut kept = is_kept.iter();
    values.retain(|_| kept.next() == Some(&true));
}

/// A cursor over little-endian data.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    /// Takes the next `count` values of `size` bytes; `what` is their name in error messages.
    fn take(&mut self, count: usize, size: usize, what: &str) -> Result<&'a [u8], String> {
        let wanted = count.checked_mul(size).filter(|&bytes| bytes <= self.0.len());
        let Some(bytes) = wanted else {
            return Err(format!(
                "ends within its {what}: {count} are declared, but only {} bytes are left",
                self.0.len()
            ));
        };
        let (taken, rest) = self.0.split_at(bytes);
        self.0 = rest;
        Ok(taken)
    }

    fn floats(&mut self, count: usize, what: &str) -> Result<Vec<f32>, String> {
        let bytes = self.take(count, 4, what)?;
        let values: Vec<f32> =
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        match values.iter().all(|x| x.is_finite()) {
            true => Ok(values),
            false => Err(format!("has {what} that are NaN or infinite")),
        }
    }

    fn triples(&mut self, count: usize, what: &str) -> Result<Vec<[f32; 3]>, String> {
        let numbers = count.checked_mul(3).ok_or_else(|| format!("declares {count} {what}"))?;
        Ok(self.floats(numbers, what)?.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
    }
}

fn parse_hair(bytes: &[u8]) -> Result<CurveFile, String> {
    let Some((header, data)) = bytes.split_at_checked(HEADER) else {
        return Err(format!("has {} bytes, but the header of a .hair file has {HEADER}", bytes.len()));
    };
    let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    let float = |at: usize| f32::from_bits(word(at));
    let (strands, points, arrays) = (word(4) as usize, word(8) as usize, word(12));
    let has = |bit: u32| arrays & bit != 0;
    if !has(2) {
        return Err("has no points".into());
    }
    let mut cursor = Cursor(data);
    let strands: Vec<u32> = match has(1) {
        true => {
            let segments = cursor.take(strands, 2, "numbers of segments")?.chunks_exact(2);
            segments.map(|b| u32::from(u16::from_le_bytes([b[0], b[1]])) + 1).collect()
        }
        false => {
            let each = word(16).checked_add(1).filter(|&each| each as usize * strands == points && each > 1);
            let wrong =
                || format!("declares {strands} strands of {} segments, but {points} points", word(16));
            vec![each.ok_or_else(wrong)?; strands]
        }
    };
    let sum: u64 = strands.iter().map(|n| u64::from(*n)).sum();
    if sum != points as u64 {
        return Err(format!("has strands with {sum} points in total, but declares {points} points"));
    }
    let points_list = cursor.triples(points, "points")?;
    let mut radii = match has(4) {
        true => cursor.floats(points, "thicknesses")?,
        false => vec![float(20); if float(20) > 0.0 { points } else { 0 }],
    };
    radii.iter_mut().for_each(|thickness| *thickness *= 0.5);
    let is_transparent = match has(8) {
        true => cursor.floats(points, "transparencies")?.iter().any(|t| *t != 0.0),
        false => float(24) != 0.0,
    };
    let colors = match has(16) {
        true => cursor.triples(points, "colours")?,
        false => Vec::new(),
    };
    if !cursor.0.is_empty() {
        return Err(format!("has {} bytes more than its header declares", cursor.0.len()));
    }
    let ignored = is_transparent.then_some("transparency");
    Ok(CurveFile { basis: None, strands, points: points_list, radii, colors, ignored })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hair(arrays: u32, strands: u32, points: u32) -> Vec<u8> {
        let mut bytes = b"HAIR".to_vec();
        bytes.extend([strands, points, arrays, 1].into_iter().flat_map(u32::to_le_bytes));
        bytes.extend([0.5f32, 0.0, 0.1, 0.2, 0.3].into_iter().flat_map(f32::to_le_bytes));
        bytes.resize(HEADER, b' ');
        bytes
    }

    fn floats(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    /// Two strands of three and two points, with all arrays.
    fn whole() -> Vec<u8> {
        let mut bytes = hair(31, 2, 5);
        bytes.extend([2u16, 1].into_iter().flat_map(u16::to_le_bytes));
        let points: Vec<f32> = (0..15).map(|i| i as f32).collect();
        bytes.extend(floats(&points));
        bytes.extend(floats(&[0.2, 0.2, 0.1, 0.4, 0.4]));
        bytes.extend(floats(&[0.0; 5]));
        bytes.extend(floats(&[0.5; 15]));
        bytes
    }

    #[test]
    fn text_curves_are_parsed() {
        let text = "curves 1\nbasis bspline # smooth\n\n0 0 0 .1 1 0 0\n1 0 0 .1 1 0 0\n\n\n# another\n0 1 0 .2 0 1 0\n1 1 1 0 0 1 0\n";
        let file = parse(text.as_bytes()).expect("curves");
        assert_eq!((file.basis, &file.strands[..]), (Some(CurveBasis::BSpline), &[2, 2][..]));
        assert_eq!(file.points[3], [1.0; 3]);
        assert_eq!((file.radii, file.colors[2]), (vec![0.1, 0.1, 0.2, 0.0], [0.0, 1.0, 0.0]));
        let plain = parse(b"\xef\xbb\xbfcurves 1\r\n0 0 0\r\n1 0 0\r\n").expect("curves");
        assert_eq!((&plain.strands[..], plain.radii.len(), plain.basis), (&[2][..], 0, None));
        assert_eq!(parse(b"curves 1").expect("nothing"), CurveFile::default());
    }

    #[test]
    fn hair_files_are_parsed() {
        let file = parse(&whole()).expect("hair");
        assert_eq!(file.strands, [3, 2]);
        assert_eq!((file.points[4], file.radii[4], file.colors[0]), ([12.0, 13.0, 14.0], 0.2, [0.5; 3]));
        let mut plain = hair(2, 2, 4);
        plain.extend(floats(&[1.0; 12]));
        let file = parse(&plain).expect("hair");
        assert_eq!((file.strands, file.radii, file.colors.len()), (vec![2, 2], vec![0.25; 4], 0));
    }

    #[test]
    fn damaged_files_are_reported() {
        let with = |at: usize, byte: u8| {
            let mut bytes = whole();
            bytes[at] = byte;
            bytes
        };
        let cut = |n: usize| whole()[..n].to_vec();
        let mut nan = whole();
        nan[HEADER + 4..HEADER + 8].copy_from_slice(&f32::NAN.to_le_bytes());
        for (bytes, words) in [
            (Vec::new(), "holds no curves"),
            (b"solid".to_vec(), "holds no curves"),
            (b"curves 2\n".to_vec(), "version '2'"),
            (b"curves 1\n0 0 0\n1 1\n".to_vec(), "line 3: has 2 numbers, but must have 3"),
            (b"curves 1\n0 0\n".to_vec(), "line 2: has 2 numbers, but must have 3, 4 or 7"),
            (b"curves 1\n0 0 nan\n".to_vec(), "line 2: 'nan' is not a finite number"),
            (b"curves 1\n0 x 0\n".to_vec(), "line 2: 'x' is not a finite number"),
            (b"curves 1\nbasis wavy\n".to_vec(), "no basis 'wavy'"),
            (b"curves 1\n\xff".to_vec(), "not UTF-8"),
            (cut(20), "has 20 bytes"),
            (cut(HEADER + 2), "within its numbers of segments"),
            (cut(HEADER + 4), "within its points"),
            (cut(HEADER + 70), "within its thicknesses"),
            (cut(whole().len() - 1), "within its colours"),
            ([&whole()[..], &[0]].concat(), "1 bytes more"),
            (with(4, 1), "strands with 3 points in total"),
            (with(7, 0xff), "within its numbers of segments"),
            (with(11, 0xff), "points"),
            (with(12, 29), "has no points"),
            (nan, "points that are NaN"),
            (hair(2, u32::MAX, u32::MAX), "declares 4294967295 strands"),
            (hair(2, 0, 0), ""),
        ] {
            match parse(&bytes) {
                Err(message) => assert!(message.contains(words), "{message}: {words}"),
                Ok(file) => assert!(words.is_empty() && file.strands.is_empty(), "{words}"),
            }
        }
    }

    /// Damaged files neither panic nor cause allocations beyond their size.
    #[test]
    fn random_damage_never_panics() {
        let mut state = 1u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 8
        };
        for _ in 0..20_000 {
            let mut bytes = whole();
            for _ in 0..1 + random() % 4 {
                let at = random() as usize % bytes.len();
                bytes[at] = random() as u8;
            }
            bytes.truncate(random() as usize % (2 * bytes.len()));
            if let Ok(file) = parse(&bytes) {
                assert_eq!(file.strands.iter().sum::<u32>() as usize, file.points.len());
            }
        }
    }
}
