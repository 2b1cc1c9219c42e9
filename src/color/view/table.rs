//! View transforms as lookup tables (LUT): a curve per channel (shaper), then a 1D or 3D LUT. Read from cinespace files (`.csp`), as
//! written by OpenColorIO (`ociobakelut --format cinespace`), and from `.view` files of the Blender exporter.
//!
//! A `.view` file has, in little-endian order: the eight bytes of [`MAGIC`]; the number of knots (`u32`), the knots and their
//! values (`f32`), shared by all channels; the number of nodes along an edge (`u32`), and three `u16` per node, 65,535 for 1, red
//! fastest.

use std::path::{Path, PathBuf};
use std::str::FromStr;

/// First bytes of `.view` files.
const MAGIC: &[u8] = b"OSCVIEW1";

/// Maximum number of nodes along an edge of a 3D LUT.
const MAX_NODES: usize = 129;
/// Maximum number of knots of a curve and of nodes of a 1D LUT.
const MAX_KNOTS: usize = 65_536;

/// A view transform: curves map each linear channel to 0..1 (clamped), and a LUT with tetrahedral interpolation maps the result to
/// display values.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewTable {
    path: PathBuf,
    curves: [ToneCurve; 3],
    values: Values,
}

/// A piecewise linear function over ascending knots.
#[derive(Clone, Debug, PartialEq)]
struct ToneCurve {
    knots: Vec<f32>,
    values: Vec<f32>,
}

#[derive(Clone, Debug, PartialEq)]
enum Values {
    /// 1D LUT: each channel is looked up separately.
    Lut1d(Vec<[f32; 3]>),
    /// 3D LUT: number of nodes along red, green and blue; values, red fastest.
    Lut3d([usize; 3], Vec<[f32; 3]>),
}

impl ViewTable {
    /// Decodes a `.view` or cinespace file; `path` is stored only.
    ///
    /// # Errors
    /// A description of the error; for text with the line.
    pub fn read(bytes: &[u8], path: &Path) -> Result<ViewTable, String> {
        match bytes.strip_prefix(MAGIC) {
            Some(rest) => ViewTable::from_binary(rest, path),
            None => ViewTable::parse(
                std::str::from_utf8(bytes).map_err(|_| "is not UTF-8 text".to_string())?,
                path,
            ),
        }
    }

    fn from_binary(bytes: &[u8], path: &Path) -> Result<ViewTable, String> {
        let mut rest = Binary(bytes);
        let count = rest.count("knots of a curve", MAX_KNOTS)?;
        let (knots, values) = (rest.floats(count)?, rest.floats(count)?);
        if !knots.is_sorted_by(|a, b| a < b) {
            return Err("knots of a curve must ascend".to_string());
        }
        let edge = rest.count("nodes along an edge", MAX_NODES)?;
        let numbers = rest.take(6 * edge * edge * edge)?.as_chunks::<2>().0;
        let value = |pair: [u8; 2]| f32::from(u16::from_le_bytes(pair)) / 65_535.0;
        let nodes = numbers.as_chunks::<3>().0.iter().map(|node| node.map(value)).collect();
        if !rest.0.is_empty() {
            return Err(format!("has {} bytes after the end of the table", rest.0.len()));
        }
        let curve = ToneCurve { knots, values };
        let curves = [curve.clone(), curve.clone(), curve];
        Ok(ViewTable { path: path.to_path_buf(), curves, values: Values::Lut3d([edge; 3], nodes) })
    }

    /// Decodes a cinespace file.
    ///
    /// # Errors
    /// A description of the error, with the line.
    pub fn parse(text: &str, path: &Path) -> Result<ViewTable, String> {
        let mut words = Words::new(text);
        let (head, kind) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if head != "CSPLUTV100" || !matches!(kind, "1D" | "3D") {
            return Err("is not a cinespace table (.csp): expected CSPLUTV100, then 1D or 3D; 'ociobakelut' of OpenColorIO \
                        writes one"
                .to_string());
        }
        words.skip_metadata();
        let curves = [curve(&mut words)?, curve(&mut words)?, curve(&mut words)?];
        let values = match kind {
            "1D" => lut_1d(&mut words)?,
            _ => lut_3d(&mut words)?,
        };
        match words.peek() {
            Some(word) => Err(format!("line {}: '{word}' follows the end of the table", words.line())),
            None => Ok(ViewTable { path: path.to_path_buf(), curves, values }),
        }
    }

    /// Path of the LUT file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The display values in 0..1 of a linear colour.
    pub fn encode(&self, rgb: [f32; 3]) -> [f32; 3] {
        let at = [0, 1, 2].map(|c| self.curves[c].at(rgb[c]).clamp(0.0, 1.0));
        let shown = match &self.values {
            Values::Lut1d(line) => [0, 1, 2].map(|c| {
                let (low, part) = cell_of(at[c], line.len());
                line[low][c] + part * (line[low + 1][c] - line[low][c])
            }),
            Values::Lut3d(size, nodes) => tetrahedral(*size, nodes, at),
        };
        shown.map(|v| v.clamp(0.0, 1.0))
    }
}

impl ToneCurve {
    fn at(&self, x: f32) -> f32 {
        let x = if x.is_nan() { 0.0 } else { x };
        let above = self.knots.partition_point(|knot| *knot <= x).clamp(1, self.knots.len() - 1);
        let (x0, x1) = (self.knots[above - 1], self.knots[above]);
        let (y0, y1) = (self.values[above - 1], self.values[above]);
        y0 + (y1 - y0) * ((x - x0) / (x1 - x0)).clamp(0.0, 1.0)
    }
}

/// The node below a coordinate in 0..1, and the interpolation weight of the next node.
fn cell_of(at: f32, nodes: usize) -> (usize, f32) {
    let scaled = at * (nodes - 1) as f32;
    let low = (scaled as usize).min(nodes - 2);
    (low, scaled - low as f32)
}

/// Tetrahedral interpolation (Kasson et al. 1993): a cell is split into six tetrahedra by the order of the fractions; the vertices
/// lead from the cell's lowest node to its highest, one channel at a time, largest fraction first.
fn tetrahedral(size: [usize; 3], nodes: &[[f32; 3]], at: [f32; 3]) -> [f32; 3] {
    let cells = [0, 1, 2].map(|c| cell_of(at[c], size[c]));
    let strides = [1, size[0], size[0] * size[1]];
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| cells[b].1.total_cmp(&cells[a].1));
    let mut node = (0..3).map(|c| cells[c].0 * strides[c]).sum::<usize>();
    let mut sum = nodes[node].map(|v| v * (1.0 - cells[order[0]].1));
    for (step, &channel) in order.iter().enumerate() {
        node += strides[channel];
        let weight = cells[channel].1 - order.get(step + 1).map_or(0.0, |&next| cells[next].1);
        (0..3).for_each(|c| sum[c] += weight * nodes[node][c]);
    }
    sum
}

fn curve(words: &mut Words) -> Result<ToneCurve, String> {
    let count = words.count("knots of a curve", MAX_KNOTS)?;
    let line = words.line();
    let knots = words.numbers(count)?;
    let values = words.numbers(count)?;
    match knots.is_sorted_by(|a, b| a < b) {
        true => Ok(ToneCurve { knots, values }),
        false => Err(format!("line {line}: knots of a curve must ascend")),
    }
}

fn lut_1d(words: &mut Words) -> Result<Values, String> {
    let count = words.count("nodes", MAX_KNOTS)?;
    Ok(Values::Lut1d(colors(words, count)?))
}

fn lut_3d(words: &mut Words) -> Result<Values, String> {
    let mut size = [0; 3];
    for edge in &mut size {
        *edge = words.count("nodes along an edge", MAX_NODES)?;
    }
    Ok(Values::Lut3d(size, colors(words, size.iter().product())?))
}

fn colors(words: &mut Words, count: usize) -> Result<Vec<[f32; 3]>, String> {
    Ok(words.numbers(3 * count)?.as_chunks().0.to_vec())
}

/// The remaining bytes of a `.view` file.
struct Binary<'a>(&'a [u8]);

impl<'a> Binary<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("ends within the table")?;
        self.0 = rest;
        Ok(taken)
    }

    fn count(&mut self, what: &str, max: usize) -> Result<usize, String> {
        let count = u32::from_le_bytes(self.take(4)?.try_into().unwrap_or_default()) as usize;
        let is_valid = (2..=max).contains(&count);
        is_valid.then_some(count).ok_or_else(|| format!("has {count} {what}; the limits are 2 to {max}"))
    }

    fn floats(&mut self, count: usize) -> Result<Vec<f32>, String> {
        let list: Vec<f32> =
            self.take(4 * count)?.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
        match list.iter().all(|x| x.is_finite()) {
            true => Ok(list),
            false => Err("has a number that isn't finite".to_string()),
        }
    }
}

/// Whitespace-separated words of a text, with their line numbers from 1, counted on demand.
struct Words<'a> {
    text: &'a str,
    /// Byte offset of the next word, or of the end.
    at: usize,
    /// A byte offset and its line, where counting resumes.
    counted: (usize, usize),
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Words<'a> {
        let mut words = Words { text, at: 0, counted: (0, 1) };
        words.skip_blanks();
        words
    }

    fn skip_blanks(&mut self) {
        let rest = &self.text.as_bytes()[self.at..];
        self.at += rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
    }

    fn peek(&self) -> Option<&'a str> {
        let rest = &self.text[self.at..];
        let end = rest.bytes().position(|b| b.is_ascii_whitespace()).unwrap_or(rest.len());
        rest.get(..end).filter(|word| !word.is_empty())
    }

    fn next(&mut self) -> Option<&'a str> {
        let word = self.peek()?;
        self.at += word.len();
        self.skip_blanks();
        Some(word)
    }

    /// The line of the next word.
    fn line(&mut self) -> usize {
        let (from, line) = self.counted;
        let ends = self.text.as_bytes()[from..self.at].iter().filter(|&&b| b == b'\n').count();
        self.counted = (self.at, line + ends);
        self.counted.1
    }

    fn skip_metadata(&mut self) {
        if self.peek() == Some("BEGIN") {
            let mut last = "";
            while let Some(word) = self.next()
                && (last, word) != ("END", "METADATA")
            {
                last = word;
            }
        }
    }

    fn number<T: FromStr>(&mut self, what: &str) -> Result<T, String> {
        let word = self.peek().ok_or_else(|| format!("ends where {what} was expected"))?;
        let number =
            word.parse().map_err(|_| format!("line {}: expected {what}, not '{word}'", self.line()))?;
        self.next();
        Ok(number)
    }

    fn count(&mut self, what: &str, max: usize) -> Result<usize, String> {
        let line = self.line();
        let count = self.number(&format!("the number of {what}"))?;
        match (2..=max).contains(&count) {
            true => Ok(count),
            false => Err(format!("line {line}: {count} {what}; the limits are 2 to {max}")),
        }
    }

    fn numbers(&mut self, count: usize) -> Result<Vec<f32>, String> {
        let mut list = Vec::with_capacity(count);
        for _ in 0..count {
            let before = self.at;
            let number: f32 = self.number("a number")?;
            if !number.is_finite() {
                self.at = before;
                return Err(format!("line {}: a number isn't finite", self.line()));
            }
            list.push(number);
        }
        Ok(list)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Piecewise linear square roots up to 4, and a 3D LUT of 3 x 2 x 2 nodes.
    fn text() -> String {
        let curve = "3\n0 1 4\n0 0.5 1\n";
        let mut text = format!(
            "CSPLUTV100\n3D\n\nBEGIN METADATA\nby hand, END 3 2\nEND METADATA\n\n{0}{0}{0}\n3 2 2\n",
            curve
        );
        for (b, g, r) in (0..12).map(|i| (i / 6, i / 3 % 2, i % 3)) {
            text += &format!("{} {} {}\n", 0.5 * r as f32, 0.25 * (g + b) as f32, if r == 2 { b } else { 0 });
        }
        text
    }

    fn assert_near(found: [f32; 3], expected: [f32; 3]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} for {expected:?}");
    }

    #[test]
    fn tables_are_exact_at_nodes_and_linear_between() {
        let table = ViewTable::parse(&text(), Path::new("a.csp")).unwrap();
        assert_near(table.encode([0.0; 3]), [0.0; 3]);
        assert_near(table.encode([4.0; 3]), [1.0, 0.5, 1.0]);
        // Beyond the curves, and NaN.
        assert_near(table.encode([f32::INFINITY, 1e30, 9.0]), [1.0, 0.5, 1.0]);
        assert_near(table.encode([f32::NAN, -1.0, -0.0]), [0.0; 3]);
        // Between knots: 2.5 is midway between 1 and 4, so the curve is 0.75.
        assert_near(table.encode([2.5, 0.5, 0.0]), [0.75, 0.0625, 0.0]);
        // Between nodes: (0.75, 0, 0.5) is on the diagonal plane of a cell; blue is above 0 only at the last node along red.
        assert_near(table.encode([2.5, 0.0, 1.0]), [0.75, 0.125, 0.5]);
        assert_eq!(table.path(), Path::new("a.csp"));
    }

    #[test]
    fn one_dimensional_tables_are_read() {
        let line = "CSPLUTV100\n1D\n2\n0 1\n0 1\n2\n0 1\n0 1\n2\n0 2\n0 1\n3\n0 0 0\n0.2 0.5 0.9\n1 1 1\n";
        let table = ViewTable::parse(line, Path::new("a.csp")).unwrap();
        assert_near(table.encode([0.25, 0.5, 1.0]), [0.1, 0.5, 0.9]);
    }

    /// A piecewise linear square root up to 4, and a 3D LUT of 2 nodes along each edge.
    fn binary() -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(3u32.to_le_bytes());
        bytes.extend([0.0f32, 1.0, 4.0, 0.0, 0.5, 1.0].iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend(2u32.to_le_bytes());
        let node = |i: u32| [i & 1, i >> 1 & 1, i >> 2].map(|x| x as u16 * 65_535);
        bytes.extend((0..8).flat_map(node).flat_map(u16::to_le_bytes));
        bytes
    }

    #[test]
    fn binary_tables_are_read_and_damaged_ones_rejected() {
        let table = ViewTable::read(&binary(), Path::new("a.view")).unwrap();
        assert_near(table.encode([1.0, 2.5, 0.25]), [0.5, 0.75, 0.125]);
        for cut in MAGIC.len()..binary().len() {
            assert!(ViewTable::read(&binary()[..cut], Path::new("")).is_err(), "{cut} bytes");
        }
        let messages = |at: usize, byte: u8| {
            let mut bytes = binary();
            bytes[at] = byte;
            ViewTable::read(&bytes, Path::new("")).unwrap_err()
        };
        assert_eq!(messages(8, 1), "has 1 knots of a curve; the limits are 2 to 65536");
        // 0, 16, 4; and 0, infinity, 4.
        assert_eq!(messages(19, 0x41), "knots of a curve must ascend");
        assert_eq!(messages(19, 0x7f), "has a number that isn't finite");
        let more = [binary(), vec![0]].concat();
        assert_eq!(
            ViewTable::read(&more, Path::new("")).unwrap_err(),
            "has 1 bytes after the end of the table"
        );
        assert_eq!(
            ViewTable::read(text().as_bytes(), Path::new("")),
            ViewTable::parse(&text(), Path::new(""))
        );
    }

    #[test]
    fn errors_name_the_line() {
        let messages = |from: &str, to: &str| {
            ViewTable::parse(&text().replacen(from, to, 1), Path::new("")).unwrap_err()
        };
        assert!(messages("CSPLUTV100", "LUT_3D_SIZE").contains("expected CSPLUTV100"));
        assert_eq!(messages("0 1 4", "0 4 1"), "line 9: knots of a curve must ascend");
        assert_eq!(messages("0 1 4", "0 x 4"), "line 9: expected a number, not 'x'");
        assert_eq!(messages("0.5 1\n", "0.5 inf\n"), "line 10: a number isn't finite");
        assert_eq!(messages("\n3 2 2", "\n3 1 2"), "line 18: 1 nodes along an edge; the limits are 2 to 129");
        assert_eq!(messages("\n3 2 2", "\n2 2 2"), "line 27: '1' follows the end of the table");
        assert_eq!(messages("\n3 2 2", "\n3 2 3"), "ends where a number was expected");
        for cut in 0..text().len() - 2 {
            assert!(ViewTable::parse(&text()[..cut], Path::new("")).is_err(), "{cut} bytes");
        }
    }
}
