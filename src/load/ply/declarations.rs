//! What a PLY header declares: encoding, elements and their properties.

use crate::error::Problem;

type Result<T> = std::result::Result<T, Problem>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    BinaryBigEndian,
    BinaryLittleEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScalarType {
    Char,
    UChar,
    Short,
    UShort,
    Int,
    UInt,
    Float,
    Double,
}

impl ScalarType {
    fn of(name: &str) -> Option<ScalarType> {
        Some(match name {
            "char" | "int8" => ScalarType::Char,
            "uchar" | "uint8" => ScalarType::UChar,
            "short" | "int16" => ScalarType::Short,
            "ushort" | "uint16" => ScalarType::UShort,
            "int" | "int32" => ScalarType::Int,
            "uint" | "uint32" => ScalarType::UInt,
            "float" | "float32" => ScalarType::Float,
            "double" | "float64" => ScalarType::Double,
            _ => return None,
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PropertyType {
    Scalar(ScalarType),
    /// Types of the length and of the items.
    List(ScalarType, ScalarType),
}

/// A scalar of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Property {
    Char(i8),
    UChar(u8),
    Short(i16),
    UShort(u16),
    Int(i32),
    UInt(u32),
    Float(f32),
    Double(f64),
}

/// An element: a table of `count` rows with these properties, in this order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ElementDef {
    pub name: String,
    pub count: usize,
    pub properties: Vec<(String, PropertyType)>,
}

impl ElementDef {
    /// The type of a property.
    pub fn property(&self, name: &str) -> Option<PropertyType> {
        self.properties.iter().find(|(own, _)| own == name).map(|&(_, data)| data)
    }
}

/// The declarations of a header.
#[derive(Debug, Default)]
pub(super) struct Declarations {
    encoding: Option<Encoding>,
    /// In file order.
    pub elements: Vec<ElementDef>,
    /// Texts of the comments.
    pub comments: Vec<String>,
}

impl Declarations {
    /// The encoding of the rows.
    ///
    /// # Errors
    /// The header doesn't declare it.
    pub fn encoding(&self) -> Result<Encoding> {
        self.encoding.ok_or_else(|| Problem::new("header", "has no line 'format'"))
    }

    pub fn element(&self, name: &str) -> Option<&ElementDef> {
        self.elements.iter().find(|element| element.name == name)
    }

    /// Reads a header line that is neither blank nor `end_header`; `number` is that of the line in the file, from 1.
    ///
    /// # Errors
    /// A line that isn't one of a PLY header, and one that contradicts an earlier one.
    pub fn read_line(&mut self, line: &str, number: usize) -> Result<()> {
        let fail = |message: String| Err(Problem::new(format!("line {number}"), message));
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["ply"] if number == 1 => {}
            ["comment", ..] => self.comments.push(line["comment".len()..].trim().to_string()),
            ["obj_info", ..] => {}
            ["format", name, _] => {
                let encoding = match name {
                    "ascii" => Encoding::Ascii,
                    "binary_big_endian" => Encoding::BinaryBigEndian,
                    "binary_little_endian" => Encoding::BinaryLittleEndian,
                    _ => return fail(format!("'{name}' is no format of PLY files")),
                };
                if self.encoding.replace(encoding).is_some_and(|earlier| earlier != encoding) {
                    return fail("contradicts an earlier line 'format'".to_string());
                }
            }
            ["element", name, count] => {
                if self.element(name).is_some() {
                    return fail(format!("declares the element '{name}' a second time"));
                }
                let is_number = count.bytes().all(|b| b.is_ascii_digit());
                let Ok(count) = count.parse() else {
                    return fail(match is_number {
                        true => format!("holds a number that is too large, {count}"),
                        false => format!("'{count}' is not a number of rows"),
                    });
                };
                self.elements.push(ElementDef { name: name.to_string(), count, properties: Vec::new() });
            }
            ["property", kind, name] => {
                self.add_property(name, ScalarType::of(kind).map(PropertyType::Scalar), number)?
            }
            ["property", "list", length, item, name] => {
                let types = ScalarType::of(length).zip(ScalarType::of(item));
                self.add_property(
                    name,
                    types.map(|(length, item)| PropertyType::List(length, item)),
                    number,
                )?;
            }
            _ => return fail(not_understood(line)),
        }
        Ok(())
    }

    /// Adds a property to the last element; `data` is `None` for unknown types.
    fn add_property(&mut self, name: &str, data: Option<PropertyType>, number: usize) -> Result<()> {
        let fail = |message: String| Problem::new(format!("line {number}"), message);
        let element = self.elements.last_mut();
        let element =
            element.ok_or_else(|| fail(format!("the property '{name}' comes before any element")))?;
        let data =
            data.ok_or_else(|| fail(format!("the property '{name}' has a type that PLY files don't have")))?;
        element.properties.push((name.to_string(), data));
        Ok(())
    }
}

fn not_understood(line: &str) -> String {
    let shown: String = line.chars().take(60).collect();
    format!("'{shown}' is not a line of a PLY header")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &[&str]) -> Result<Declarations> {
        let mut header = Declarations::default();
        lines.iter().enumerate().try_for_each(|(i, line)| header.read_line(line, i + 1))?;
        header.encoding().map(|_| header)
    }

    #[test]
    fn elements_have_their_properties_in_order() {
        let lines =
            ["ply", "format\tbinary_big_endian 1.0", "comment  by hand ", "obj_info", "element vertex 3"];
        let more = [
            "property float64 x",
            "property uint8 x",
            "element face 2",
            "property list uchar int vertex_indices",
        ];
        let header = read(&[&lines[..], &more].concat()).expect("valid");
        assert_eq!(
            (header.encoding().ok(), &header.comments[..]),
            (Some(Encoding::BinaryBigEndian), &["by hand".to_string()][..])
        );
        let vertex = header.element("vertex").expect("declared");
        let types = [PropertyType::Scalar(ScalarType::Double), PropertyType::Scalar(ScalarType::UChar)];
        assert_eq!(
            (vertex.count, &vertex.properties[..]),
            (3, &types.map(|data| ("x".to_string(), data))[..])
        );
        let list = PropertyType::List(ScalarType::UChar, ScalarType::Int);
        assert_eq!(header.elements[1].property("vertex_indices"), Some(list));
        assert_eq!(header.elements[1].property("x"), None);
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        let format = "format ascii 1.0";
        for (lines, place, words) in [
            (&["ply"][..], "header", "no line 'format'"),
            (&["ply", "format text 1.0"], "line 2", "'text' is no format"),
            (&["ply", format, "format binary_little_endian 1.0"], "line 3", "contradicts"),
            (&["ply", format, "ply"], "line 3", "'ply' is not a line"),
            (&["ply", format, "property float x"], "line 3", "before any element"),
            (&["ply", format, "element vertex"], "line 3", "is not a line"),
            (&["ply", format, "element vertex -1"], "line 3", "'-1' is not a number"),
            (&["ply", format, "element vertex 99999999999999999999"], "line 3", "too large"),
            (&["ply", format, "element a 1", "element a 1"], "line 4", "second time"),
            (&["ply", format, "element a 1", "property real x"], "line 4", "'x' has a type"),
            (&["ply", format, "element a 1", "property list uchar x"], "line 4", "is not a line"),
        ] {
            let problem = read(lines).err().unwrap_or_else(|| panic!("{lines:?}"));
            let text = format!("{problem:?}");
            assert!(text.contains(place) && text.contains(words), "{lines:?}: {text}");
        }
    }
}
