//! The XML of a model part: 3D Manufacturing Format, core specification 1.3, materials and properties extension 1.2, production
//! extension 1.1. Namespace prefixes are ignored.

use crate::color::srgb_table;
use crate::error::Problem;
use crate::math::{DAffine3, DMat3, DVec3};
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::collections::{BTreeSet, HashMap};

/// The index of a missing property.
pub(super) const NONE: u32 = u32::MAX;

/// A model part.
#[derive(Default)]
pub(super) struct Model {
    /// Length unit, metres.
    pub metres: f64,
    pub objects: HashMap<u32, Object>,
    pub groups: HashMap<u32, Group>,
    pub textures: HashMap<u32, TextureFile>,
    /// Build items.
    pub items: Vec<Reference>,
    /// Names of unsupported elements.
    pub unsupported: BTreeSet<&'static str>,
    /// Number of colours that aren't opaque.
    pub transparent: usize,
}

/// An object: a mesh, or components, which are other objects.
#[derive(Default)]
pub(super) struct Object {
    pub name: String,
    /// A support structure for printing.
    pub is_support: bool,
    /// Default property of triangles.
    pub property: Property,
    pub vertices: Vec<[f32; 3]>,
    pub triangles: Vec<Triangle>,
    pub components: Vec<Reference>,
    /// Number of triangles with an invalid index.
    pub invalid_triangles: usize,
}

#[derive(Clone, Copy)]
pub(super) struct Triangle {
    pub corners: [u32; 3],
    /// Property group; [`NONE`] for the object's default.
    pub group: u32,
    /// Index in the group for each corner; [`NONE`] for the object's default.
    pub indices: [u32; 3],
}

/// A group and an index in it.
#[derive(Clone, Copy)]
pub(super) struct Property {
    pub group: u32,
    pub index: u32,
}

impl Default for Property {
    fn default() -> Property {
        Property { group: NONE, index: 0 }
    }
}

/// A reference to an object, with a transform.
pub(super) struct Reference {
    pub object: u32,
    /// Path of the part with the object; `None`: the same part.
    pub part: Option<String>,
    /// In length units of the file.
    pub transform: DAffine3,
}

/// A property group.
pub(super) enum Group {
    /// Base materials, one per triangle: linear RGBA.
    Materials(Vec<[f32; 4]>),
    /// Corner colours: linear RGBA.
    Colors(Vec<[f32; 4]>),
    /// Texture coordinates with origin at the lower left.
    TextureCoordinates { texture: u32, list: Vec<[f32; 2]> },
}

/// An image in the package.
pub(super) struct TextureFile {
    pub path: String,
    /// Tile styles along u and v.
    pub tiles: [String; 2],
    pub is_nearest: bool,
}

/// Unsupported elements that affect the picture, and their descriptions.
const UNSUPPORTED: [(&str, &str); 6] = [
    ("beam", "beams of lattices"),
    ("compositematerials", "composite materials"),
    ("multiproperties", "layered properties"),
    ("pbmetallicdisplayproperties", "metallic display properties"),
    ("slicestack", "slices"),
    ("displacementtriangle", "displaced triangles"),
];

/// Parses the XML of a part.
///
/// # Errors
/// A problem with its line.
pub(super) fn parse(text: &str) -> Result<Model, Problem> {
    let mut reader = Reader::from_str(text);
    let mut parser = Parser::default();
    loop {
        let event = reader.read_event();
        let at = || format!("line {}", 1 + text[..reader.buffer_position() as usize].matches('\n').count());
        let problem = |what: String| Problem::new(at(), what);
        match event.map_err(|e| problem(format!("the XML is damaged: {e}")))? {
            Event::Start(element) => parser.begin(&element).map_err(problem)?,
            Event::Empty(element) => {
                parser.begin(&element).map_err(problem)?;
                parser.end(element.local_name().as_ref());
            }
            Event::End(element) => parser.end(element.local_name().as_ref()),
            Event::Eof => break,
            _ => {}
        }
    }
    match parser.is_model {
        true => Ok(parser.model),
        false => Err(Problem::new("", "has no element 'model'")),
    }
}

#[derive(Default)]
struct Parser {
    model: Model,
    is_model: bool,
    /// The open object, with its id.
    object: Option<(u32, Object)>,
    /// The open property group, with its id.
    group: Option<(u32, Group)>,
}

impl Parser {
    fn begin(&mut self, element: &BytesStart) -> Result<(), String> {
        match element.local_name().as_ref() {
            "vertex" => self.vertex(element)?,
            "triangle" => self.triangle(element)?,
            "model" => {
                self.is_model = true;
                self.model.metres = unit(element)?;
            }
            "object" => self.object = Some(object(element)?),
            "component" => {
                let mut component = Some(reference(element)?);
                self.object.iter_mut().for_each(|(_, object)| object.components.extend(component.take()));
            }
            "item" => self.model.items.push(reference(element)?),
            "basematerials" => self.group = Some((id(element)?, Group::Materials(Vec::new()))),
            "colorgroup" => self.group = Some((id(element)?, Group::Colors(Vec::new()))),
            "texture2dgroup" => {
                let texture = index(&require(element, "texid")?)?;
                self.group = Some((id(element)?, Group::TextureCoordinates { texture, list: Vec::new() }));
            }
            "base" => self.color(element, "displaycolor")?,
            "color" => self.color(element, "color")?,
            "tex2coord" => {
                let [u, v] = [number(&require(element, "u")?)?, number(&require(element, "v")?)?];
                if let Some((_, Group::TextureCoordinates { list, .. })) = &mut self.group {
                    list.push([u, v].map(|x| x as f32));
                }
            }
            "texture2d" => {
                let tiles = ["tilestyleu", "tilestylev"].map(|key| attribute(element, key));
                let [u, v] = tiles;
                let file = TextureFile {
                    path: require(element, "path")?,
                    tiles: [u?, v?].map(Option::unwrap_or_default),
                    is_nearest: attribute(element, "filter")?.as_deref() == Some("nearest"),
                };
                self.model.textures.insert(id(element)?, file);
            }
            other => {
                let unsupported = UNSUPPORTED.iter().find(|(name, _)| *name == other);
                self.model.unsupported.extend(unsupported.map(|(_, words)| *words));
            }
        }
        Ok(())
    }

    fn end(&mut self, name: &str) {
        match name {
            "object" => self.model.objects.extend(self.object.take()),
            "basematerials" | "colorgroup" | "texture2dgroup" => self.model.groups.extend(self.group.take()),
            _ => {}
        }
    }

    fn vertex(&mut self, element: &BytesStart) -> Result<(), String> {
        let Some((_, object)) = &mut self.object else { return Ok(()) };
        let mut position = [None; 3];
        for_each(element, |key, value| {
            let axis = match key {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => return Ok(()),
            };
            position[axis] = Some(number(value)? as f32);
            Ok(())
        })?;
        let [Some(x), Some(y), Some(z)] = position else { return Err("a vertex lacks x, y or z".into()) };
        object.vertices.push([x, y, z]);
        Ok(())
    }

    fn triangle(&mut self, element: &BytesStart) -> Result<(), String> {
        let Some((_, object)) = &mut self.object else { return Ok(()) };
        let (mut corners, mut indices, mut group) = ([NONE; 3], [NONE; 3], NONE);
        for_each(element, |key, value| {
            let target = match key {
                "v1" => &mut corners[0],
                "v2" => &mut corners[1],
                "v3" => &mut corners[2],
                "p1" => &mut indices[0],
                "p2" => &mut indices[1],
                "p3" => &mut indices[2],
                "pid" => &mut group,
                _ => return Ok(()),
            };
            *target = value.trim().parse().unwrap_or(NONE);
            Ok(())
        })?;
        // All vertices of a mesh precede its triangles.
        if corners.iter().any(|&corner| corner as usize >= object.vertices.len()) {
            object.invalid_triangles += 1;
            return Ok(());
        }
        let [first, ..] = indices;
        let indices = indices.map(|index| if index == NONE { first } else { index });
        object.triangles.push(Triangle { corners, group, indices });
        Ok(())
    }

    fn color(&mut self, element: &BytesStart, key: &str) -> Result<(), String> {
        let Some((_, Group::Materials(colors) | Group::Colors(colors))) = &mut self.group else {
            return Ok(());
        };
        let text = attribute(element, key)?;
        let color =
            text.as_deref().map(|text| color_of(text).ok_or_else(|| format!("'{text}' is not a colour")));
        let color = color.transpose()?.unwrap_or([0.8, 0.8, 0.8, 1.0]);
        self.model.transparent += usize::from(color[3] < 1.0);
        colors.push(color);
        Ok(())
    }
}

fn object(element: &BytesStart) -> Result<(u32, Object), String> {
    let number = |key| attribute(element, key)?.map(|text| index(&text)).transpose();
    let object = Object {
        name: attribute(element, "name")?.unwrap_or_default(),
        is_support: attribute(element, "type")?.as_deref() == Some("support"),
        property: Property { group: number("pid")?.unwrap_or(NONE), index: number("pindex")?.unwrap_or(0) },
        ..Object::default()
    };
    Ok((id(element)?, object))
}

fn reference(element: &BytesStart) -> Result<Reference, String> {
    let transform = attribute(element, "transform")?;
    Ok(Reference {
        object: index(&require(element, "objectid")?)?,
        part: attribute(element, "path")?,
        transform: transform.map_or(Ok(DAffine3::IDENTITY), |text| affine(&text))?,
    })
}

/// Twelve numbers: a row-major matrix for row vectors, hence its rows are columns here.
fn affine(text: &str) -> Result<DAffine3, String> {
    let numbers: Vec<f64> = text.split_whitespace().map(number).collect::<Result<_, _>>()?;
    let rows = numbers.as_chunks::<3>().0;
    let &[x, y, z, translation] = rows else {
        return Err(format!("'{text}' is not a transform of 12 numbers"));
    };
    let transform = DAffine3 {
        matrix3: DMat3::from_cols(x.into(), y.into(), z.into()),
        translation: DVec3::from(translation),
    };
    if transform.is_finite() { Ok(transform) } else { Err(format!("'{text}' is not a finite transform")) }
}

fn unit(element: &BytesStart) -> Result<f64, String> {
    Ok(match attribute(element, "unit")?.as_deref() {
        None | Some("millimeter") => 1e-3,
        Some("micron") => 1e-6,
        Some("centimeter") => 1e-2,
        Some("inch") => 0.0254,
        Some("foot") => 0.3048,
        Some("meter") => 1.0,
        Some(other) => return Err(format!("'{other}' is not a unit of 3MF")),
    })
}

/// Linear RGBA from sRGB-encoded `#RRGGBB` or `#RRGGBBAA`.
fn color_of(text: &str) -> Option<[f32; 4]> {
    let digits = text.trim().strip_prefix('#').filter(|d| d.is_ascii() && matches!(d.len(), 6 | 8))?;
    let byte = |k: usize| match digits.get(2 * k..2 * k + 2) {
        Some(pair) => u8::from_str_radix(pair, 16).ok(),
        None => Some(255),
    };
    let linear = |k| Some(srgb_table()[usize::from(byte(k)?)]);
    Some([linear(0)?, linear(1)?, linear(2)?, f32::from(byte(3)?) / 255.0])
}

fn id(element: &BytesStart) -> Result<u32, String> {
    index(&require(element, "id")?)
}

fn index(text: &str) -> Result<u32, String> {
    let number = text.trim().parse().ok().filter(|number| *number != NONE);
    number.ok_or_else(|| format!("'{text}' is not a resource id"))
}

fn number(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| format!("'{text}' is not a number"))
}

fn require(element: &BytesStart, key: &str) -> Result<String, String> {
    let missing = || format!("'{}' lacks '{key}'", element.local_name().as_ref());
    attribute(element, key)?.ok_or_else(missing)
}

/// An attribute by its local name.
fn attribute(element: &BytesStart, key: &str) -> Result<Option<String>, String> {
    let mut found = None;
    for_each(element, |name, value| {
        if name == key {
            found = Some(value.to_string());
        }
        Ok(())
    })?;
    Ok(found)
}

/// Calls `each` with the local names and values of all attributes.
fn for_each(
    element: &BytesStart,
    mut each: impl FnMut(&str, &str) -> Result<(), String>,
) -> Result<(), String> {
    for attribute in element.attributes().with_checks(false) {
        let message = |e: String| format!("an attribute is invalid: {e}");
        let attribute = attribute.map_err(|e| message(e.to_string()))?;
        let value =
            attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| message(e.to_string()))?;
        each(attribute.key.local_name().as_ref(), &value)?;
    }
    Ok(())
}

/// The target of the first relationship whose type ends in `end`.
pub(super) fn target(relations: &str, end: &str) -> Option<String> {
    let mut reader = Reader::from_str(relations);
    loop {
        match reader.read_event().ok()? {
            Event::Start(element) | Event::Empty(element)
                if attribute(&element, "Type").ok()?.is_some_and(|kind| kind.ends_with(end)) =>
            {
                return attribute(&element, "Target").ok()?;
            }
            Event::Eof => return None,
            _ => {}
        }
    }
}
