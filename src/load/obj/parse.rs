//! The statements of OBJ files (Wavefront, "Advanced Visualizer Manual", appendix B1).

use super::build::{Attributes, Builder, MaterialName, Object};
use super::lines::{Lines, Words, decoded, float};
use super::vertices::{Corner, NONE, NormalSource};
use crate::error::Problem;
use crate::load::digits::integer;
use std::collections::{BTreeMap, HashMap};
use std::io::{Read, Seek};

/// How many problems are worth listing.
const LISTED: usize = 10;

/// What a file holds.
pub(super) struct Parsed {
    pub objects: Vec<Object>,
    /// The names that `usemtl` statements use, with the line of the first.
    pub materials: Vec<(String, usize)>,
    /// What stands behind `mtllib`, with its line.
    pub libraries: Vec<(String, usize)>,
    /// What was left out or repaired: line and message.
    pub warnings: Vec<(usize, String)>,
}

/// Reads a whole file. Where a face comes before what it refers to, which the format doesn't forbid, the file is read a
/// second time with all vertices known.
///
/// # Errors
/// All problems of the file, at least one.
pub(super) fn parse(mut file: impl Read + Seek) -> Result<Parsed, Vec<Problem>> {
    let broken = |e| vec![Problem::new("", format!("can't be read: {e}"))];
    let mut parser = Parser::default();
    parser.read(&mut file).map_err(broken)?;
    if parser.looks_ahead {
        file.rewind().map_err(broken)?;
        parser = Parser::knowing(parser.builder.attributes);
        parser.read(&mut file).map_err(broken)?;
    }
    parser.finish()
}

/// How many statements of vertices there were so far.
#[derive(Clone, Copy, Default)]
struct Counts {
    positions: usize,
    uvs: usize,
    normals: usize,
}

#[derive(Default)]
struct Parser {
    builder: Builder,
    /// What negative indices count back from.
    counts: Counts,
    /// The builder had all vertices before the first statement.
    knows_all: bool,
    /// A face refers to a vertex that comes later; faces are skipped from there on.
    looks_ahead: bool,
    /// The corners of the current face.
    face: Vec<Corner>,
    material: MaterialName,
    /// For faces without normals; `None` is flat.
    group: Option<u32>,
    group_numbers: HashMap<Vec<u8>, u32>,
    object: String,
    group_name: String,
    materials: Vec<(String, usize)>,
    material_numbers: HashMap<Vec<u8>, u32>,
    libraries: Vec<(String, usize)>,
    problems: Vec<Problem>,
    problem_count: usize,
    /// What was left out: the first line and how often.
    ignored: BTreeMap<String, (usize, usize)>,
}

impl Parser {
    /// A parser for a file whose vertices have been read.
    fn knowing(attributes: Attributes) -> Parser {
        let mut parser = Parser { knows_all: true, ..Parser::default() };
        parser.builder.attributes = attributes;
        parser
    }

    /// Reads all statements.
    fn read(&mut self, file: impl Read) -> std::io::Result<()> {
        let mut lines = Lines::new(file);
        while let Some((line, text)) = lines.next()? {
            self.statement(line, text);
        }
        Ok(())
    }

    fn statement(&mut self, line: usize, text: &[u8]) {
        let mut words = Words(text);
        let Some(keyword) = words.next() else { return };
        match keyword {
            b"v" => self.position(line, words),
            b"f" | b"fo" => self.face(line, words),
            b"vn" => self.normal(line, words),
            b"vt" => self.uv(line, words),
            b"usemtl" => self.use_material(line, words.rest()),
            b"s" => self.smoothing(words.rest()),
            b"o" => {
                self.object = decoded(words.rest());
                self.begin();
            }
            b"g" => {
                self.group_name = decoded(words.rest());
                self.begin();
            }
            b"mtllib" => self.libraries.push((decoded(words.rest()), line)),
            b"l" | b"p" => self.ignore(line, "lines and points, which have no surface"),
            b"cstype" | b"deg" | b"bmat" | b"step" | b"curv" | b"curv2" | b"surf" | b"parm" | b"trim"
            | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"vp" => {
                self.ignore(line, "statements of free-form curves and surfaces");
            }
            // They concern how other programs draw.
            b"mg" | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj"
            | b"ctech" | b"stech" => {}
            _ => {
                let shown: String = decoded(keyword).chars().take(20).collect();
                let known = self.ignored.len() < LISTED;
                let name = if known { format!("statements '{shown}'") } else { "other statements".into() };
                self.ignore(line, &name);
            }
        }
    }

    #[cold]
    fn problem(&mut self, line: usize, message: impl Into<String>) {
        self.problem_count += 1;
        if self.problem_count <= LISTED {
            self.problems.push(Problem::new(format!("line {line}"), message));
        }
    }

    #[cold]
    fn ignore(&mut self, line: usize, what: &str) {
        self.ignored.entry(what.to_string()).or_insert((line, 0)).1 += 1;
    }

    /// `v x y z`, `v x y z w` or `v x y z r g b`.
    fn position(&mut self, line: usize, words: Words) {
        let mut values = [0.0f32; 6];
        let mut count = 0;
        for (value, word) in values.iter_mut().zip(words) {
            match float(word) {
                Some(x) => *value = x,
                None => break,
            }
            count += 1;
        }
        let attributes = &mut self.builder.attributes;
        if count < 3 || attributes.positions.len() as u32 >= NONE - 1 {
            return self.problem(line, "'v' needs three numbers");
        }
        self.counts.positions += 1;
        if self.knows_all {
            return;
        }
        let [x, y, z, r, g, b] = values;
        attributes.positions.push([x, y, z]);
        if count == 6 {
            attributes.colors.resize(attributes.positions.len() - 1, [1.0; 3]);
            attributes.colors.push([r, g, b]);
        }
    }

    fn uv(&mut self, line: usize, mut words: Words) {
        let Some(u) = words.next().and_then(float) else {
            return self.problem(line, "'vt' needs a number");
        };
        let v = words.next().and_then(float).unwrap_or(0.0);
        self.counts.uvs += 1;
        if !self.knows_all {
            self.builder.attributes.uvs.push([u, v]);
        }
    }

    fn normal(&mut self, line: usize, words: Words) {
        let Some(normal) = numbers(words) else {
            return self.problem(line, "'vn' needs three numbers");
        };
        self.counts.normals += 1;
        if !self.knows_all {
            self.builder.attributes.normals.push(normal);
        }
    }

    fn face(&mut self, line: usize, words: Words) {
        self.face.clear();
        for word in words {
            if self.looks_ahead {
                return;
            }
            match self.corner(line, word) {
                Ok(corner) => self.face.push(corner),
                Err(_) if self.looks_ahead => return,
                Err(message) => return self.problem(line, message),
            }
        }
        // Some exporters repeat a corner at once.
        self.face.dedup();
        if self.face.len() > 1 && self.face.first() == self.face.last() {
            self.face.pop();
        }
        match self.face.len() {
            0..=2 => self.ignore(line, "faces of fewer than three corners"),
            _ => self.builder.face(&self.face, self.material),
        }
    }

    /// `v`, `v/t`, `v//n` or `v/t/n`; negative indices count back from the last statement.
    #[inline]
    fn corner(&mut self, line: usize, word: &[u8]) -> Result<Corner, String> {
        let mut parts = word.split(|&b| b == b'/');
        let broken = || format!("'{}' is no corner of a face", decoded(&word[..word.len().min(40)]));
        let mut index = || -> Result<Option<i64>, String> {
            match parts.next() {
                None | Some(b"") => Ok(None),
                Some(digits) => integer(digits).map(Some).ok_or_else(broken),
            }
        };
        let (position, uv, normal) = (index()?, index()?, index()?);
        let all = &self.builder.attributes;
        let (positions, uvs, normals) = (all.positions.len(), all.uvs.len(), all.normals.len());
        let wanted = position.ok_or_else(broken)?;
        let counts = self.counts;
        let position = self
            .resolve(wanted, counts.positions, positions)
            .ok_or_else(|| format!("refers to vertex {wanted}, but there are {positions}"))?;
        let mut optional = |index: Option<i64>, before: usize, all: usize, what: &str| match index {
            None => NONE,
            Some(i) => self.resolve(i, before, all).unwrap_or_else(|| {
                self.ignore(line, what);
                NONE
            }),
        };
        let uv = optional(uv, counts.uvs, uvs, "references to texture coordinates that don't exist");
        let normal = match optional(normal, counts.normals, normals, "references to normals that don't exist")
        {
            NONE => self.group.map_or(NormalSource::FLAT, NormalSource::smooth),
            i => NormalSource::given(i),
        };
        Ok(Corner { position, uv, normal })
    }

    /// The place of an index in a list of `all` entries of which `before` stand before this line; 1 is the first, -1
    /// the last before the line. Beyond the list there may be more to come.
    #[inline]
    fn resolve(&mut self, index: i64, before: usize, all: usize) -> Option<u32> {
        let place = if index < 0 { before as i64 + index } else { index - 1 };
        self.looks_ahead |= place >= all as i64 && !self.knows_all;
        (0..all as i64).contains(&place).then_some(place as u32)
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
        self.group = match name {
            b"off" | b"0" | b"" => None,
            b"on" => Some(*self.group_numbers.entry(b"1".to_vec()).or_insert(next)),
            _ => Some(*self.group_numbers.entry(name.to_vec()).or_insert(next)),
        };
    }

    fn begin(&mut self) {
        let parts = [&self.object, &self.group_name];
        let names: Vec<&str> = parts.into_iter().filter(|n| !n.is_empty()).map(String::as_str).collect();
        self.builder.begin(names.join("/"));
    }

    fn finish(mut self) -> Result<Parsed, Vec<Problem>> {
        if self.problem_count > LISTED {
            let message = format!("{} more statements are broken", self.problem_count - LISTED);
            self.problems.push(Problem::new("", message));
        }
        let objects = self.builder.finish();
        if objects.is_empty() && self.problems.is_empty() {
            let mut problem = Problem::new("", "has no faces").with_help("only surfaces can be rendered");
            if let Some((what, (line, count))) = self.ignored.iter().next() {
                problem.message = format!("has no faces, but {count} {what}, the first in line {line}");
            }
            self.problems.push(problem);
        }
        if !self.problems.is_empty() {
            return Err(self.problems);
        }
        let ignored = self.ignored.into_iter();
        let warnings = ignored.map(|(what, (line, count))| (line, format!("{count} {what}: left out")));
        Ok(Parsed {
            objects,
            materials: self.materials,
            libraries: self.libraries,
            warnings: warnings.collect(),
        })
    }
}

/// The first three numbers.
#[inline]
fn numbers(words: Words) -> Option<[f32; 3]> {
    let mut values = words.map(float);
    Some([values.next()??, values.next()??, values.next()??])
}
