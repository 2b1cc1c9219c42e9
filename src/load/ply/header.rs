//! Header validation, and sequential reading of the elements.
//!
//! `ply-rs` panics on numbers beyond 64 bits, trusts counts and reports wrong lines, so the header is checked here before
//! parsing, its counts are compared with the file's size, and lines are counted here.

use super::rows::{self, Face, Lines, Record, Slot, Vertex, split_line, truncated};
use crate::error::Problem;
use crate::load::Up;
use crate::load::words::is_utf_16;
use crate::work_counter::WorkCounter;
use ply_rs::parser::Parser;
use ply_rs::ply::{ElementDef, Encoding, Header, PropertyType, ScalarType};

type Result<T> = std::result::Result<T, Problem>;

/// Maximum length of a header, bytes.
const MAX_HEADER: usize = 1 << 20;

/// Rows between two updates of the progress counter.
const ROWS_PER_UPDATE: usize = 1 << 16;

/// A file whose header has been read; element lists are read in file order.
pub(super) struct Source<'a> {
    header: Header,
    /// The rest of a binary payload.
    rest: &'a [u8],
    /// The rest of an ascii payload.
    lines: Lines<'a>,
    /// Descriptions of unknown header lines.
    unknown_lines: Vec<String>,
    /// The named attributes of vertices.
    attributes: Vec<NamedAttribute>,
    /// Progress: number of rows read.
    counter: &'a WorkCounter,
}

struct HeaderText {
    /// Normalized: LF line ends, ASCII only, without blank and unknown lines.
    text: String,
    /// Length in the file, bytes.
    length: usize,
    /// Number of lines in the file.
    lines: usize,
    /// Descriptions of unknown header lines.
    unknown_lines: Vec<String>,
    /// The named attributes of vertices.
    attributes: Vec<NamedAttribute>,
}

/// A header line `comment oscura attribute INDEX COUNT NAME`: the vertex properties `aINDEX_0`, `aINDEX_1`, ... form the
/// attribute NAME.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NamedAttribute {
    pub index: u8,
    /// Number of components, 1 to 4.
    pub count: u8,
    pub name: String,
}

impl NamedAttribute {
    /// Parses a header line; `None` if it doesn't declare an attribute. The name may have any characters.
    fn of(line: &[u8]) -> Option<std::result::Result<NamedAttribute, &'static str>> {
        let line = String::from_utf8_lossy(line);
        let rest = line.trim_end_matches(['\r', '\n']).strip_prefix("comment oscura attribute ")?;
        let mut parts = rest.splitn(3, ' ');
        let (index, count) = (parts.next().map(str::parse), parts.next().map(str::parse));
        Some(match (index, count, parts.next()) {
            (Some(Ok(index)), Some(Ok(count @ 1..=4)), Some(name)) if !name.is_empty() => {
                Ok(NamedAttribute { index, count, name: name.to_string() })
            }
            _ => Err(
                "must be 'comment oscura attribute INDEX COUNT NAME' with an INDEX of 0 to 255 and a COUNT of 1 to 4",
            ),
        })
    }
}

/// First words of header lines.
const KEYWORDS: [&str; 7] = ["ply", "format", "comment", "obj_info", "element", "property", "end_header"];

/// Attributes whose properties are all present in the vertex element.
pub(super) struct VertexLayout {
    pub position: bool,
    pub normal: bool,
    pub uv: bool,
    pub color: bool,
    /// Faces have colours and vertices have none.
    pub face_color: bool,
    /// Attributes with missing properties; they are skipped.
    pub incomplete: Vec<&'static str>,
}

impl VertexLayout {
    /// # Errors
    /// Vertices without positions.
    pub fn check(&self) -> Result<()> {
        match self.position {
            true => Ok(()),
            false => Err(Problem::new("header", "has no element 'vertex' with properties x, y and z")),
        }
    }
}

/// Parts of a file that are not read, for warnings.
pub(super) struct UnreadData {
    /// Data with an effect on the picture: warnings.
    pub visible: Vec<String>,
    /// Data without an effect on the picture: notes.
    pub irrelevant: Vec<String>,
    /// Texture files named by comments.
    pub texture_files: Vec<String>,
    /// The up axis customary for the program that wrote the file, with its name for messages.
    pub writer_up: Option<(Up, &'static str)>,
    /// Positions may be more precise than f32.
    pub has_exact_positions: bool,
}

/// Property names of texture coordinates and of colours.
const UVS: [[&str; 2]; 4] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];
const COLORS: [[&str; 3]; 3] =
    [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];

impl<'a> Source<'a> {
    /// Validates and parses the header, and starts the progress counter.
    pub fn open(bytes: &'a [u8], counter: &'a WorkCounter) -> Result<Source<'a>> {
        let HeaderText { text, length, lines, unknown_lines, attributes } = header_text(bytes)?;
        let header = Parser::<super::SkippedElement>::new()
            .read_header(&mut text.as_bytes())
            .map_err(|e| Problem::new("header", first_line(&e.to_string())))?;
        let rest = &bytes[length..];
        let source =
            Source { header, rest, lines: Lines::new(rest, lines), unknown_lines, attributes, counter };
        source.check_attributes()?;
        source.check_counts()?;
        source.check_types()?;
        counter.begin(source.header.elements.iter().map(|(_, e)| e.count as u64).sum());
        Ok(source)
    }

    /// The elements in file order.
    pub fn elements(&self) -> Vec<(String, ElementDef)> {
        self.header.elements.iter().map(|(name, e)| (name.clone(), e.clone())).collect()
    }

    /// The attributes of the vertices.
    pub fn vertex_layout(&self) -> VertexLayout {
        let of = |element: &str, name: &str| {
            self.header.elements.get(element).is_some_and(|e| e.properties.contains_key(name))
        };
        let has = |name: &str| of("vertex", name);
        let all = |names: &[&str]| names.iter().all(|name| has(name));
        let any = |names: &[&str]| names.iter().any(|name| has(name));
        let normals = ["nx", "ny", "nz"];
        let (position, normal) = (all(&["x", "y", "z"]), all(&normals));
        let (uv, color) = (UVS.iter().any(|names| all(names)), COLORS.iter().any(|names| all(names)));
        let parts = [
            (normal, any(&normals), "normals"),
            (uv, any(UVS.as_flattened()), "texture coordinates"),
            (color, any(COLORS.as_flattened()), "colours"),
        ];
        let incomplete = parts.into_iter().filter(|(all, any, _)| *any && !all).map(|p| p.2).collect();
        let on_faces = |names: &[&str; 3]| names.iter().all(|name| of("face", name));
        let face_color = !color && COLORS.iter().any(on_faces);
        VertexLayout { position, normal, uv, color, face_color, incomplete }
    }

    /// Whether an element has a property.
    pub fn has(&self, element: &str, property: &str) -> bool {
        self.header.elements.get(element).is_some_and(|e| e.properties.contains_key(property))
    }

    /// Number of rows of an element.
    pub fn count(&self, element: &str) -> usize {
        self.header.elements.get(element).map_or(0, |e| e.count)
    }

    /// Whether the vertices are Gaussian splats.
    pub fn holds_splats(&self) -> bool {
        let has = |name: &str| self.has("vertex", name);
        has("f_dc_0") && (has("opacity") || has("scale_0")) || has("packed_position")
    }

    /// The named attributes of the vertices.
    pub fn attributes(&self) -> &[NamedAttribute] {
        &self.attributes
    }

    fn check_attributes(&self) -> Result<()> {
        let vertex = self.header.elements.get("vertex");
        for attribute in &self.attributes {
            for component in 0..attribute.count {
                let property = format!("a{}_{component}", attribute.index);
                if !vertex.is_some_and(|v| v.properties.contains_key(&property)) {
                    let message = format!(
                        "the attribute '{}' needs the property '{property}' of 'vertex'",
                        attribute.name
                    );
                    return Err(Problem::new("header", message));
                }
            }
        }
        Ok(())
    }

    /// Whether faces have material indices.
    pub fn has_materials(&self) -> bool {
        let face = self.header.elements.get("face").and_then(|face| face.properties.get("material_index"));
        face.is_some_and(|p| matches!(p.data_type, PropertyType::Scalar(_)))
    }

    /// Whether faces have per-corner texture coordinates.
    pub fn has_wedges(&self) -> bool {
        let face = self.header.elements.get("face").and_then(|face| face.properties.get("texcoord"));
        face.is_some_and(|p| matches!(p.data_type, PropertyType::List(..)))
    }

    /// Texture files named by comments, as MeshLab writes them.
    fn texture_files(&self) -> Vec<String> {
        let named = self.header.comments.iter().filter_map(|c| c.trim().strip_prefix("TextureFile"));
        named.map(|file| file.trim().to_string()).collect()
    }

    /// The up axis customary for the program named in a comment.
    fn writer_up(&self) -> Option<(Up, &'static str)> {
        let mentions = |name: &str| {
            self.header
                .comments
                .iter()
                .any(|c| c.to_ascii_lowercase().contains(name) && !c.contains("TextureFile"))
        };
        let writers =
            [("blender", "Blender, which wrote it"), ("cloudcompare", "CloudCompare, which wrote it")];
        writers.iter().find(|(name, _)| mentions(name)).map(|&(_, why)| (Up::Z, why))
    }

    /// Whether positions may be more precise than f32; text may have any number of digits.
    fn has_exact_positions(&self) -> bool {
        let is_double = |p: &PropertyType| matches!(p, PropertyType::Scalar(ScalarType::Double));
        let vertex = self.header.elements.get("vertex");
        matches!(self.header.encoding, Encoding::Ascii)
            || vertex.is_some_and(|v| v.properties.get("x").is_some_and(|p| is_double(&p.data_type)))
    }

    /// Unread properties with their elements, and unknown header lines.
    pub fn unsupported(&self, layout: &VertexLayout) -> UnreadData {
        let incomplete = layout.incomplete.iter();
        let visible = incomplete.map(|what| format!("{what} with a missing property")).collect();
        let texture_files = self.texture_files();
        let (writer_up, has_exact_positions) = (self.writer_up(), self.has_exact_positions());
        let mut unsupported =
            UnreadData { visible, irrelevant: Vec::new(), texture_files, writer_up, has_exact_positions };
        let has_wedges = self.has_wedges();
        let is_named = |index: u8| self.attributes.iter().any(|attribute| attribute.index == index);
        let known = |element: &str, name: &str, data: &PropertyType| match (element, data) {
            ("vertex", PropertyType::Scalar(_)) => match Vertex::slot(name) {
                Some(Slot::Attribute(index, _)) => is_named(index),
                slot => slot.is_some(),
            },
            ("face", PropertyType::List(..)) => Face::new().list(name).is_some(),
            ("face", PropertyType::Scalar(_)) => match Face::slot(name) {
                Some(Slot::Texture) => has_wedges,
                Some(Slot::Color(_) | Slot::Alpha) => layout.face_color,
                slot => slot.is_some(),
            },
            ("tristrips", PropertyType::List(..)) => is_index(name),
            ("vertex" | "tristrips", _) => false,
            // Other elements are reported as a whole.
            _ => true,
        };
        for (element, definition) in self.header.elements.iter().filter(|(_, e)| e.count > 0) {
            let properties = definition.properties.iter();
            for (name, _) in properties.filter(|(name, p)| !known(element, name, &p.data_type)) {
                let what = format!("property '{name}' of '{element}'");
                let is_shown = name.contains("texcoord") || element == "face" && Vertex::slot(name).is_some();
                if is_shown { unsupported.visible.push(what) } else { unsupported.irrelevant.push(what) }
            }
        }
        unsupported.visible.extend(self.unknown_lines.iter().cloned());
        unsupported
    }

    /// Reads the rows of an element and calls `each` with row number and record. Elements must be read in file order.
    pub fn read<E: Record>(
        &mut self,
        definition: &ElementDef,
        mut each: impl FnMut(usize, &E),
    ) -> Result<()> {
        if definition.properties.is_empty() {
            return Ok(());
        }
        let counter = self.counter;
        let each = |row: usize, record: &E| {
            if (row + 1).is_multiple_of(ROWS_PER_UPDATE) {
                counter.add(ROWS_PER_UPDATE as u64);
            }
            each(row, record);
        };
        let big = match self.header.encoding {
            Encoding::Ascii => return rows::read_ascii(&mut self.lines, definition, each),
            Encoding::BinaryBigEndian => true,
            Encoding::BinaryLittleEndian => false,
        };
        rows::read_binary(&mut self.rest, definition, big, each).map_err(|i| truncated(definition, i))
    }

    fn check_counts(&self) -> Result<()> {
        let mut needed: u128 = 0;
        for (_, e) in &self.header.elements {
            let smallest: usize = match self.header.encoding {
                // A digit and a separator for each property.
                Encoding::Ascii => e.properties.len() * 2,
                _ => e.properties.iter().map(|(_, p)| smallest_size(&p.data_type)).sum(),
            };
            needed += e.count as u128 * smallest as u128;
        }
        // The last ascii line may lack its line break.
        let held = self.rest.len() as u128 + 1;
        if needed > held {
            let message = format!(
                "the header declares at least {needed} bytes of data, but the file holds {}: it is truncated or its counts are wrong",
                self.rest.len()
            );
            return Err(Problem::new("", message).with_help("export or download the file again"));
        }
        Ok(())
    }

    fn check_types(&self) -> Result<()> {
        for (name, e) in &self.header.elements {
            for (property, p) in &e.properties {
                let is_index = is_index(property);
                let ok = match (name.as_str(), &p.data_type) {
                    ("face" | "tristrips", PropertyType::List(_, item)) if is_index => {
                        !matches!(item, ScalarType::Float | ScalarType::Double)
                    }
                    ("face" | "tristrips", PropertyType::Scalar(_)) => !is_index,
                    _ => true,
                };
                if let PropertyType::List(ScalarType::Float | ScalarType::Double, _) = p.data_type {
                    let message = format!(
                        "the list length of property '{property}' of '{name}' must be an integer type"
                    );
                    return Err(Problem::new("header", message));
                }
                if !ok {
                    let message = format!("property '{property}' of '{name}' must be a list of integers");
                    return Err(Problem::new("header", message));
                }
            }
        }
        Ok(())
    }
}

/// Whether a list property holds vertex indices.
fn is_index(name: &str) -> bool {
    name == "vertex_index" || name == "vertex_indices"
}

fn first_line(text: &str) -> String {
    text.replace("\n\t", "; ").lines().next().unwrap_or_default().trim().to_string()
}

fn header_text(bytes: &[u8]) -> Result<HeaderText> {
    if !bytes.starts_with(b"ply") {
        if is_utf_16(bytes) {
            return Err(Problem::new("", ("utf-16", "is UTF-16 text")).with_help("save the file as UTF-8"));
        }
        return Err(Problem::new("", "is not a PLY file: it doesn't start with 'ply'"));
    }
    let (mut text, mut at, mut lines, mut unknown_lines) = (String::new(), 0, 0, Vec::new());
    let mut attributes = Vec::new();
    let limit = bytes.len().min(MAX_HEADER);
    while at < limit {
        let (content, next) = split_line(&bytes[at..]);
        at += next;
        lines += 1;
        let line: String =
            content.iter().map(|&b| if b.is_ascii() && b != 0 { char::from(b) } else { '?' }).collect();
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        let mut words = line.split_ascii_whitespace();
        let first = words.next().unwrap_or_default();
        if !KEYWORDS.contains(&first) {
            let shown: String = line.chars().take(40).collect();
            unknown_lines.push(format!("line {lines} of the header, '{shown}', is unknown"));
            continue;
        }
        if let Some(attribute) = NamedAttribute::of(content) {
            let place = || format!("line {lines}");
            attributes.push(attribute.map_err(|message| Problem::new(place(), message))?);
        }
        if !matches!(first, "comment" | "obj_info")
            // The parser also accepts digits before letters.
            && words.any(|w| w.split(|c: char| !c.is_ascii_digit()).any(|n| n.len() > 18))
        {
            return Err(Problem::new(format!("line {lines}"), "holds a number that is too large"));
        }
        text.push_str(line);
        text.push('\n');
        if line == "end_header" {
            return Ok(HeaderText { text, length: at, lines, unknown_lines, attributes });
        }
    }
    Err(Problem::new("header", "does not end: 'end_header' is missing"))
}

fn smallest_size(data: &PropertyType) -> usize {
    match data {
        PropertyType::Scalar(s) => rows::size(s),
        PropertyType::List(count, _) => rows::size(count),
    }
}
