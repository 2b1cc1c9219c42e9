//! Filter for the statements of OBJ files (Wavefront, "Advanced Visualizer Manual", appendix B1).
//!
//! Vertices usually precede the faces that use them, and one pass over the file suffices. If they don't, or the file has
//! problems, there are two: first the vertices, then the faces. `tobj` stops at the first problem without its line, panics
//! on some, takes `v x y z w` as a division, replaces missing references of corners by others, and supports neither smoothing
//! groups nor materials of several libraries. Therefore it gets valid, uniform statements.

use super::lines::{LineFilter, Words, decoded, double, float};
use crate::error::Problem;
use crate::load::words::{decimal_commas, integer, is_nan_word};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::Write;

/// Index of a material's name in [`Statements::materials`]; `None` before the first `usemtl`.
pub(super) type MaterialName = Option<u32>;

/// Maximum number of problems listed in an error.
const MAX_LISTED: usize = 10;

/// Maximum number of faces of a piece, of which `tobj` buffers about 100 bytes each.
const MAX_PIECE: usize = 1 << 15;

/// The pass over the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Passes {
    /// The only pass.
    #[default]
    One,
    /// The first of two, for vertices.
    Vertices,
    /// The second of two, for all other statements.
    Faces,
}

/// Validates statements and records those that `tobj` drops.
#[derive(Default)]
pub(super) struct Statements {
    /// The models that `tobj` returns, in order.
    pub pieces: Vec<Piece>,
    /// Names of objects and groups.
    pub objects: Vec<String>,
    /// Changes of the material: index of the first face, and the material.
    pub runs: Vec<(usize, MaterialName)>,
    /// Position indices (from 0) of consecutive corners, for pieces with a smoothing group; for all pieces if there are colours,
    /// positions far from the origin, or subdivision.
    pub corners: Vec<u32>,
    /// Colours of the first positions as in the file, white by default.
    pub colors: Vec<[f32; 3]>,
    /// Number of colours in `#MRGB` comments.
    polypaint: usize,
    /// The first positions in double precision; NaN for positions near the origin.
    pub precise: Vec<[f64; 3]>,
    /// Names in `usemtl` statements, with the first line.
    pub materials: Vec<(String, usize)>,
    /// Arguments of `mtllib` statements, with their lines.
    pub libraries: Vec<(String, usize)>,
    /// Position indices (from 0) of points (`p`).
    pub points: Vec<u32>,
    /// Polygons are kept for subdivision, and groups don't split objects.
    pub keeps_polygons: bool,
    /// The file needs two passes.
    pub needs_two_passes: bool,
    passes: Passes,
    /// Numbers of positions, texture coordinates and normals in the file.
    totals: [usize; 3],
    /// Numbers of positions, texture coordinates and normals before the current line.
    counts: [usize; 3],
    /// Lines of malformed vertices.
    broken: HashSet<usize>,
    faces: usize,
    face: Vec<Corner>,
    material: MaterialName,
    /// Smoothing group; `None` for flat faces.
    group: Option<u32>,
    group_numbers: HashMap<Vec<u8>, u32>,
    object: String,
    group_name: String,
    material_numbers: HashMap<Vec<u8>, u32>,
    /// The first problems by line.
    problems: BTreeMap<usize, String>,
    problem_count: usize,
    /// Ignored statements: first line and count.
    ignored: BTreeMap<String, (usize, usize)>,
}

impl LineFilter for Statements {
    fn line(&mut self, line: usize, text: &[u8], out: &mut Vec<u8>) {
        let mut words = Words(text);
        let Some(keyword) = words.next() else { return self.comment(text) };
        let vertex = match keyword {
            b"v" => Some(0),
            b"vt" => Some(1),
            b"vn" => Some(2),
            _ => None,
        };
        match vertex {
            Some(kind) if self.passes != Passes::Faces => self.vertex(line, kind, words, out),
            Some(kind) => self.counts[kind] += usize::from(!self.broken.contains(&line)),
            None if self.passes != Passes::Vertices => self.statement(line, keyword, words, out),
            None => {}
        }
    }

    fn is_finished(&self) -> bool {
        self.needs_two_passes
    }

    fn needs_next_pass(&mut self) -> bool {
        let is_first = self.passes == Passes::Vertices;
        if is_first {
            self.passes = Passes::Faces;
        }
        is_first
    }
}

impl Statements {
    /// A filter for one or two passes.
    pub fn new(has_two_passes: bool, keeps_polygons: bool) -> Statements {
        let passes = if has_two_passes { Passes::Vertices } else { Passes::One };
        Statements { passes, keeps_polygons, ..Statements::default() }
    }

    /// Whether the position indices of a piece's corners are recorded.
    pub fn records_corners(&self, group: Option<u32>) -> bool {
        group.is_some() || !self.colors.is_empty() || !self.precise.is_empty() || self.keeps_polygons
    }

    /// `#MRGB mmrrggbb...`: vertex colours by ZBrush, in the order of the vertices.
    fn comment(&mut self, text: &[u8]) {
        let Some(digits) = text.trim_ascii_start().strip_prefix(b"#MRGB ") else { return };
        if self.passes == Passes::Faces || self.colors.len() > self.polypaint {
            return;
        }
        self.needs_corners(self.colors.is_empty());
        let hexadecimal = |pair: &[u8; 2]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
        for entry in digits.trim_ascii().as_chunks::<8>().0 {
            let [_, rgb @ ..] = entry.as_chunks::<2>().0 else { continue };
            let mut levels = rgb.iter().map(|pair| hexadecimal(pair).map_or(255.0, f32::from));
            self.colors.push([0; 3].map(|_| levels.next().unwrap_or(255.0)));
        }
        self.polypaint = self.colors.len();
    }

    /// `v x y z`, `v x y z w`, `v x y z r g b`, `vt u`, `vt u v`, `vt u v w` and `vn x y z`.
    fn vertex(&mut self, line: usize, kind: usize, words: Words, out: &mut Vec<u8>) {
        let (name, min, max) = [("v", 3, 3), ("vt", 1, 2), ("vn", 3, 3)][kind];
        let start = out.len();
        out.extend(name.as_bytes());
        let (mut valid, mut color, mut may_be_far) = (0, [0.0; 3], false);
        let plain = plain_numbers(words.0).filter(|plain| plain.count == max);
        if let Some(plain) = plain {
            out.extend(words.0);
            (valid, may_be_far) = (max, kind == 0 && plain.has_large);
        }
        let others = if kind == 0 { 6 } else { max };
        for (i, word) in words.clone().take(if plain.is_none() { others } else { 0 }).enumerate() {
            if i < max && is_number(word) {
                out.push(b' ');
                out.extend(word);
                may_be_far |= kind == 0 && is_large(word);
            } else if i < max && is_nan_word(word) {
                out.extend(b" nan");
            } else if let Some(value) = float(word).filter(|_| i >= max) {
                color[i - max] = value;
            } else {
                break;
            }
            valid += 1;
        }
        let is_broken = valid < min || valid < max && words.clone().take(max).count() > valid;
        if is_broken || self.totals[0] >= u32::MAX as usize - 1 {
            out.truncate(start);
            self.broken.insert(line);
            let message = format!("'{name}' needs {}", ["three numbers", "numbers", "three numbers"][kind]);
            return self.problem(line, message + decimal_commas(words.0));
        }
        if kind == 1 && valid == 1 {
            out.extend(b" 0");
        }
        out.push(b'\n');
        self.totals[kind] += 1;
        if self.passes == Passes::One {
            self.counts[kind] += 1;
        }
        if may_be_far {
            self.needs_corners(self.precise.is_empty());
            self.precise.resize(self.totals[0] - 1, [f64::NAN; 3]);
            let mut numbers = words.clone().map(|word| double(word).unwrap_or(f64::NAN));
            self.precise.push([0; 3].map(|_| numbers.next().unwrap_or(f64::NAN)));
        }
        // A fourth number is the weight of rational curves.
        if kind == 0 && valid < 6 && plain.is_none() && words.count() > 4 {
            self.ignore(line, "colours of vertices that are not three numbers");
        }
        if kind == 0 && valid == 6 {
            self.needs_corners(self.colors.is_empty());
            self.colors.resize(self.totals[0] - 1, [1.0; 3]);
            self.colors.push(color);
        }
    }

    /// Called for a vertex whose colour or precise position requires recorded corners. If faces precede the first such vertex, a
    /// second pass is needed.
    fn needs_corners(&mut self, is_first: bool) {
        self.needs_two_passes |= is_first && self.passes == Passes::One && self.faces > 0;
    }

    /// `p v1 v2 ...`.
    fn points(&mut self, line: usize, words: Words) {
        for word in words {
            let (before, total) = (self.counts[0] as i64, self.totals[0] as i64);
            let index = word.split(|&b| b == b'/').next().and_then(integer);
            match index.map(|index| if index < 0 { before + index + 1 } else { index }) {
                Some(place) if (1..=total).contains(&place) => self.points.push((place - 1) as u32),
                _ => self.ignore(line, &format!("points that refer to vertices beyond the {total}")),
            }
        }
    }

    fn statement(&mut self, line: usize, keyword: &[u8], words: Words, out: &mut Vec<u8>) {
        match keyword {
            b"f" | b"fo" => self.face(line, words, out),
            b"usemtl" => self.use_material(line, words.rest()),
            b"s" => self.smoothing(words.rest()),
            b"o" => {
                self.object = decoded(words.rest());
                self.begin();
            }
            b"g" if self.keeps_polygons && !self.object.is_empty() => {}
            b"g" => {
                self.group_name = decoded(words.rest());
                self.begin();
            }
            b"mtllib" => self.libraries.push((decoded(words.rest()), line)),
            b"p" => self.points(line, words),
            b"l" => self.ignore(line, "lines, which have no surface"),
            b"cstype" | b"deg" | b"bmat" | b"step" | b"curv" | b"curv2" | b"surf" | b"parm" | b"trim"
            | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"vp" => {
                self.ignore(line, "statements of free-form curves and surfaces");
            }
            // Display attributes of other programs.
            b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj"
            | b"ctech" | b"stech" => {}
            _ => {
                let shown: String = decoded(keyword).chars().take(20).collect();
                let is_listed = self.ignored.len() < MAX_LISTED;
                let name =
                    if is_listed { format!("statements '{shown}'") } else { "other statements".into() };
                self.ignore(line, &name);
            }
        }
    }

    fn face(&mut self, line: usize, mut words: Words, out: &mut Vec<u8>) {
        let (mut text, mut is_plain) = (words.0, true);
        if !self.plain_face(text) {
            self.face.clear();
            for word in words.by_ref() {
                match self.corner(line, word, &mut is_plain) {
                    Ok(corner) if corner[0] == 0 => {
                        let what = format!("faces that refer to vertices beyond the {}", self.totals[0]);
                        return self.ignore(line, &what);
                    }
                    Ok(corner) => self.face.push(corner),
                    Err(message) => return self.problem(line, message),
                }
            }
            text = &text[..text.len() - words.0.len()];
        }
        let corners = self.face.len();
        // Some exporters repeat consecutive corners.
        self.face.dedup();
        if self.face.len() > 1 && self.face.first() == self.face.last() {
            self.face.pop();
        }
        if self.face.len() < 3 {
            return self.ignore(line, "faces of fewer than three corners");
        }
        is_plain &= self.face.len() == corners;
        let [has_uvs, has_normals] = [1, 2].map(|kind| {
            let count = self.face.iter().filter(|c| c[kind] > 0).count();
            if count > 0 && count < self.face.len() {
                is_plain = false;
                let what = ["texture coordinates", "normals"][kind - 1];
                self.ignore(line, &format!("{what} of faces that lack them at other corners"));
                self.face.iter_mut().for_each(|c| c[kind] = 0);
            }
            count == self.face.len()
        });
        self.continue_piece(has_uvs, has_normals, out);
        out.push(b'f');
        if is_plain {
            out.extend(text);
        } else {
            self.face.iter().for_each(|c| write_corner(*c, out));
        }
        out.push(b'\n');
    }

    /// Fast path: accepts the corners of a face if all have positive, valid indices.
    fn plain_face(&mut self, mut text: &[u8]) -> bool {
        self.face.clear();
        while let [first, rest @ ..] = text {
            if matches!(first, b' ' | b'\t') {
                text = rest;
                continue;
            }
            let Some((corner, rest)) = plain_corner(text) else { return false };
            if (0..3).any(|kind| corner[kind] as usize > self.totals[kind]) {
                return false;
            }
            self.face.push(corner);
            text = rest;
        }
        true
    }

    /// Adds the current face to the last piece, or begins a new piece.
    fn continue_piece(&mut self, has_uvs: bool, has_normals: bool, out: &mut Vec<u8>) {
        if self.objects.is_empty() {
            self.begin();
        }
        let object = self.objects.len() - 1;
        let group = if has_normals { None } else { self.group };
        let new = Piece { object, has_uvs, has_normals, group, faces: 1 };
        match self.pieces.last_mut() {
            Some(last) if last.faces < MAX_PIECE && last.may_continue(&new) => last.faces += 1,
            _ => {
                self.pieces.push(new);
                out.extend(b"o\n");
            }
        }
        if self.records_corners(group) {
            self.corners.extend(self.face.iter().map(|c| c[0] - 1));
        }
        if self.runs.last().is_none_or(|r| r.1 != self.material) {
            self.runs.push((self.faces, self.material));
        }
        self.faces += 1;
    }

    /// `v`, `v/t`, `v//n` or `v/t/n`; negative indices count back from the last vertex, and 0 is invalid. Clears `is_plain` if
    /// the corner differs from its text.
    #[inline]
    fn corner(&mut self, line: usize, word: &[u8], is_plain: &mut bool) -> Result<Corner, String> {
        if let Some((corner, [])) = plain_corner(word)
            && (0..3).all(|kind| corner[kind] as usize <= self.totals[kind])
        {
            return Ok(corner);
        }
        let broken = || format!("'{}' is not a corner of a face", decoded(&word[..word.len().min(40)]));
        let mut corner = [0; 3];
        for (kind, digits) in word.split(|&b| b == b'/').enumerate() {
            if kind == 3 || digits.is_empty() && kind == 0 {
                return Err(broken());
            }
            if digits.is_empty() {
                continue;
            }
            let index = integer(digits).ok_or_else(broken)?;
            *is_plain &= index > 0;
            let (before, total) = (self.counts[kind] as i64, self.totals[kind] as i64);
            let place = if index < 0 { before + index + 1 } else { index };
            // The vertex may follow later in the file.
            self.needs_two_passes |= self.passes == Passes::One && place > total;
            if (1..=total).contains(&place) {
                corner[kind] = place as u32;
            } else if kind > 0 {
                *is_plain = false;
                let what = ["texture coordinates", "normals"][kind - 1];
                self.ignore(line, &format!("references to {what} that don't exist"));
            }
        }
        Ok(corner)
    }

    fn use_material(&mut self, line: usize, name: &[u8]) {
        let next = self.materials.len() as u32;
        let number = *self.material_numbers.entry(name.to_vec()).or_insert(next);
        if number == next {
            self.materials.push((decoded(name), line));
        }
        self.material = Some(number);
    }

    fn smoothing(&mut self, name: &[u8]) {
        let next = self.group_numbers.len() as u32;
        let name = if name == b"on" { b"1" } else { name };
        self.group = match name {
            b"off" | b"0" | b"" => None,
            _ => Some(*self.group_numbers.entry(name.to_vec()).or_insert(next)),
        };
    }

    /// Begins another object.
    fn begin(&mut self) {
        let parts = [&self.object, &self.group_name];
        let names: Vec<&str> = parts.into_iter().filter(|n| !n.is_empty()).map(String::as_str).collect();
        self.objects.push(names.join("/"));
    }

    #[cold]
    fn problem(&mut self, line: usize, message: impl Into<String>) {
        // Two passes, since messages include the totals of the file.
        self.needs_two_passes |= self.passes == Passes::One;
        self.problem_count += 1;
        self.problems.insert(line, message.into());
        if self.problems.len() > MAX_LISTED {
            self.problems.pop_last();
        }
    }

    #[cold]
    fn ignore(&mut self, line: usize, what: &str) {
        self.ignored.entry(what.to_string()).or_insert((line, 0)).1 += 1;
    }

    /// All problems, up to [`MAX_LISTED`] with their lines; empty if the file can be rendered.
    pub fn problems(&self) -> Vec<Problem> {
        let listed = self.problems.iter();
        let mut problems: Vec<Problem> =
            listed.map(|(line, message)| Problem::new(format!("line {line}"), message)).collect();
        if self.problem_count > MAX_LISTED {
            let message = format!("{} more statements are invalid", self.problem_count - MAX_LISTED);
            problems.push(Problem::new("", message));
        }
        if self.pieces.is_empty() && self.points.is_empty() && !self.is_cloud() && problems.is_empty() {
            let mut problem =
                Problem::new("", ("no-surface", "has no faces")).with_help("only surfaces can be rendered");
            if let Some((what, (line, count))) = self.ignored.iter().next() {
                problem.message = format!("has no faces, but {count} {what}, the first in line {line}");
            }
            problems.push(problem);
        }
        problems
    }

    /// Whether the file has only vertices.
    fn is_cloud(&self) -> bool {
        let has_only_vertices = self.ignored.keys().all(|what| what.starts_with("colours"));
        self.pieces.is_empty() && self.points.is_empty() && self.totals[0] > 0 && has_only_vertices
    }

    /// Position indices (from 0) of points: those of `p`, or all in a file with only vertices.
    pub fn cloud(&mut self) -> Vec<u32> {
        match self.is_cloud() {
            true => (0..self.totals[0] as u32).collect(),
            false => std::mem::take(&mut self.points),
        }
    }

    /// Ignored statements: line and message.
    pub fn left_out(&self) -> Vec<(usize, String)> {
        let ignored = self.ignored.iter();
        ignored.map(|(what, (line, count))| (*line, format!("{count} {what}: left out"))).collect()
    }
}

// Fast paths for numbers and face corners in plain decimal notation, without conversion.

/// Indices (from 1) of a corner's position, texture coordinates and normal; 0 if absent.
pub(super) type Corner = [u32; 3];

/// Whether a word is a number. Plain decimals are recognised without conversion.
pub(super) fn is_number(word: &[u8]) -> bool {
    let digits = word.strip_prefix(b"-").unwrap_or(word);
    let dots = digits.iter().filter(|&&b| b == b'.').count();
    let is_decimal = digits.iter().all(|b| b.is_ascii_digit() || *b == b'.');
    is_decimal && dots < 2 && dots < digits.len() || float(word).is_some()
}

/// Whether a number has three digits before its decimal point, or an exponent.
pub(super) fn is_large(number: &[u8]) -> bool {
    let digits = number.iter().take_while(|b| **b != b'.').filter(|b| b.is_ascii_digit()).count();
    digits > 2 || number.last().is_some_and(|b| !b.is_ascii_digit() && *b != b'.') || has_exponent(number)
}

fn has_exponent(number: &[u8]) -> bool {
    number.iter().any(|b| b | 0x20 == b'e')
}

/// Summary of numbers in plain decimal notation.
#[derive(Clone, Copy)]
pub(super) struct PlainNumbers {
    pub count: usize,
    /// Whether any number has three digits before its decimal point.
    pub has_large: bool,
}

/// Scans the numbers of a text; `None` unless all are plain decimals.
pub(super) fn plain_numbers(mut text: &[u8]) -> Option<PlainNumbers> {
    let mut numbers = PlainNumbers { count: 0, has_large: false };
    while let [first, rest @ ..] = text {
        if matches!(first, b' ' | b'\t') {
            text = rest;
            continue;
        }
        let digits = if *first == b'-' { rest } else { text };
        let integer_digits = digits.iter().take_while(|b| b.is_ascii_digit()).count();
        let (mut length, mut decimals) = (integer_digits, 0);
        if digits.get(integer_digits) == Some(&b'.') {
            decimals = digits[integer_digits + 1..].iter().take_while(|b| b.is_ascii_digit()).count();
            length += 1 + decimals;
        }
        text = &digits[length..];
        if integer_digits + decimals == 0 || !matches!(text.first(), None | Some(b' ' | b'\t')) {
            return None;
        }
        numbers.count += 1;
        numbers.has_large |= integer_digits > 2;
    }
    Some(numbers)
}

/// The indices of a corner without signs and leading zeros, up to a blank; and the remaining text.
#[inline]
pub(super) fn plain_corner(text: &[u8]) -> Option<(Corner, &[u8])> {
    let (mut corner, mut kind) = ([0u32; 3], 0);
    for (at, &b) in text.iter().enumerate() {
        match b {
            b'/' if kind < 2 && corner[0] > 0 => kind += 1,
            b'1'..=b'9' => corner[kind] = corner[kind].checked_mul(10)?.checked_add(u32::from(b - b'0'))?,
            b'0' if corner[kind] > 0 => corner[kind] = corner[kind].checked_mul(10)?,
            b' ' | b'\t' if corner[0] > 0 => return Some((corner, &text[at..])),
            _ => return None,
        }
    }
    (corner[0] > 0).then_some((corner, &[]))
}

/// Writes ` v`, ` v/t`, ` v//n` or ` v/t/n`.
pub(super) fn write_corner([position, uv, normal]: Corner, out: &mut Vec<u8>) {
    // Writing to memory doesn't fail.
    let _ = match (uv, normal) {
        (0, 0) => write!(out, " {position}"),
        (_, 0) => write!(out, " {position}/{uv}"),
        (0, _) => write!(out, " {position}//{normal}"),
        _ => write!(out, " {position}/{uv}/{normal}"),
    };
}

/// Consecutive faces with the same object, attributes and smoothing group, which `tobj` returns as one model.
pub(super) struct Piece {
    /// Index in [`Statements::objects`].
    pub object: usize,
    pub has_uvs: bool,
    pub has_normals: bool,
    /// Smoothing group for missing normals; `None` if the file has normals, or for flat faces.
    pub group: Option<u32>,
    /// Number of faces.
    pub faces: usize,
}

impl Piece {
    /// Whether the faces are shaded flat.
    pub fn is_flat(&self) -> bool {
        !self.has_normals && self.group.is_none()
    }

    /// Whether it can be merged with another piece.
    pub fn may_continue(&self, other: &Piece) -> bool {
        let key = |p: &Piece| (p.object, p.has_uvs, p.has_normals, p.group);
        key(self) == key(other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The filtered lines of a text in one pass.
    fn once(text: &str) -> (Statements, String) {
        let (mut statements, mut out) = (Statements::new(false, false), Vec::new());
        for (number, line) in text.lines().enumerate() {
            statements.line(number + 1, line.as_bytes(), &mut out);
        }
        assert!(!statements.needs_next_pass());
        (statements, String::from_utf8(out).expect("text"))
    }

    #[test]
    fn files_in_order_need_one_pass() {
        let near =
            "v 0 0 0\nv 1.5 0 0\nv 0 -.5 1\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nv 7 7 7\nf 1 2 -1\n";
        let (statements, out) = once(near);
        assert!(!statements.needs_two_passes && statements.precise.is_empty());
        let expected = near.replacen("f 1", "o\nf 1", 1).replace("f 1 2 -1", "o\nf 1 2 4");
        assert_eq!(out, expected);
        let far = "v 500000.25 0 1e3\nv 500001.25 0 0\nv 500000.25 1 0\nf 1 2 3\n";
        let (statements, _) = once(far);
        assert!(!statements.needs_two_passes);
        assert_eq!(statements.precise[0], [500_000.25, 0.0, 1000.0]);
        assert_eq!(statements.corners, [0, 1, 2]);
    }

    #[test]
    fn late_vertices_and_problems_need_two_passes() {
        let start = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for rest in [
            // Late vertices and texture coordinates; a colour and a distant position after faces; a problem.
            "f 1 2 4\nv 1 1 0\n",
            "f 1/1 2/1 3/1\nvt 0 0\n",
            "f 1 2 3\nv 1 1 0 0.5 0.5 0.5\n",
            "f 1 2 3\nv 1000 1 0\n",
            "f 1 2 x\n",
        ] {
            assert!(once(&format!("{start}{rest}")).0.needs_two_passes, "{rest}");
        }
    }

    #[test]
    fn plain_numbers_are_recognized() {
        for (text, expected) in [
            (" 1 -2.5\t.5 3.", Some((4, false))),
            (" 123 4", Some((2, true))),
            ("", Some((0, false))),
            (" 1e3", None),
            (" 1 # 2", None),
            (" -", None),
            (" .", None),
            (" 1.2.3", None),
            (" +1", None),
        ] {
            let found = plain_numbers(text.as_bytes()).map(|found| (found.count, found.has_large));
            assert_eq!(found, expected, "{text}");
        }
    }
}
