//! Meshes: one mesh of the scene for each of the file, with a part for each primitive. Primitives without normals are
//! flat, so a mesh that has both kinds becomes two, and likewise for tangents.

use super::accessor::Accessor;
use super::document::{Document, Report, name_of, pointer};
use super::materials::{Materials, Needs};
use super::{repair, triangles};
use crate::error::Problem;
use crate::scene::{MaterialId, Mesh, MeshPart};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use std::collections::HashMap;

/// Compresses a primitive; plain copies of its data may be beside it.
const DRACO: &str = "KHR_draco_mesh_compression";

/// What the meshes of a file left out.
#[derive(Default)]
pub(super) struct Skipped {
    /// Primitives that are points.
    pub points: usize,
    /// Primitives that are lines.
    pub lines: usize,
    /// Primitives whose morph targets are at rest.
    pub morphs: usize,
}

/// A mesh being put together from primitives with the same kinds of attributes.
struct Group {
    has_normals: bool,
    has_tangents: bool,
    mesh: Mesh,
    /// The first vertex of each set of attributes that is in the mesh, and how many it has.
    vertices: HashMap<Attributes, (u32, usize)>,
}

/// The accessors of a primitive's vertices, by what they are read as; primitives with the same share vertices.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Attributes {
    positions: usize,
    normals: Option<usize>,
    tangents: Option<usize>,
    colors: Option<usize>,
    uv_sets: Vec<Option<usize>>,
}

/// Reads the mesh of an index; `from` points to what refers to it. Problems are noted.
pub(super) fn read(
    doc: &Document,
    index: usize,
    from: &str,
    materials: &mut Materials,
    skipped: &mut Skipped,
    report: &mut Report,
) -> Vec<Mesh> {
    let Some(json) = doc.entry::<gltf::json::Mesh>("meshes", index, from, report) else { return Vec::new() };
    let mut groups: Vec<Group> = Vec::new();
    for (i, primitive) in json.primitives.iter().enumerate() {
        let at = format!("{}/primitives/{i}", pointer("meshes", index));
        add_primitive(doc, primitive, &at, &mut groups, materials, skipped, report);
    }
    let name =
        doc.raw("meshes", index, from, report).map(|raw| name_of(raw, "mesh", index)).unwrap_or_default();
    let finish = |group: Group| {
        let mut mesh = Mesh { name: name.clone(), ..group.mesh };
        pad(&mut mesh);
        repair::repair(&mut mesh, &pointer("meshes", index), report);
        mesh
    };
    groups.into_iter().map(finish).filter(|mesh| !mesh.triangles.is_empty()).collect()
}

fn add_primitive(
    doc: &Document,
    primitive: &Primitive,
    at: &str,
    groups: &mut Vec<Group>,
    materials: &mut Materials,
    skipped: &mut Skipped,
    report: &mut Report,
) -> Option<()> {
    let mode = match primitive.mode {
        Checked::Valid(mode) => mode,
        Checked::Invalid => {
            report.problem(format!("{at}/mode"), "is no mode of glTF 2.0 (0 to 6)");
            return None;
        }
    };
    match mode {
        Mode::Points => skipped.points += 1,
        Mode::Lines | Mode::LineLoop | Mode::LineStrip => skipped.lines += 1,
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {
            add_triangles(doc, primitive, mode, at, groups, materials, report)?;
            skipped.morphs += usize::from(primitive.targets.as_ref().is_some_and(|t| !t.is_empty()));
        }
    }
    Some(())
}

fn add_triangles(
    doc: &Document,
    primitive: &Primitive,
    mode: Mode,
    at: &str,
    groups: &mut Vec<Group>,
    materials: &mut Materials,
    report: &mut Report,
) -> Option<()> {
    if is_only_compressed(doc, primitive) {
        let message = format!("has its vertices in {DRACO} alone, which is not supported");
        report.add(Problem::new(at, message).with_help("export the model without mesh compression"));
        return None;
    }
    let material =
        materials.get(doc, primitive.material.map(|m| m.value()), &format!("{at}/material"), report)?;
    let needs = materials.needs(material);
    let Some(attributes) = attributes(primitive, needs) else {
        report.warn(at, "has no positions and is skipped");
        return None;
    };
    for set in (0..needs.uv_sets.len()).filter(|&set| needs.uv_sets[set]) {
        if attributes.uv_sets.get(set).copied().flatten().is_none() && !materials.geometry_only {
            let message = format!("has no TEXCOORD_{set}, which its material's textures use; taken as 0");
            report.warn(format!("{at}/attributes"), message);
        }
    }
    let has = (attributes.normals.is_some(), attributes.tangents.is_some());
    let found = groups.iter().position(|g| (g.has_normals, g.has_tangents) == has);
    let group = found.unwrap_or_else(|| {
        let (has_normals, has_tangents) = has;
        groups.push(Group { has_normals, has_tangents, mesh: Mesh::default(), vertices: HashMap::new() });
        groups.len() - 1
    });
    let group = &mut groups[group];
    let (base, count) = match group.vertices.get(&attributes) {
        Some(&place) => place,
        None => {
            let place = add_vertices(doc, &attributes, at, &mut group.mesh, report)?;
            group.vertices.insert(attributes.clone(), place);
            place
        }
    };
    if attributes.colors.is_some() {
        materials.use_vertex_colors(material);
    }
    let from = format!("{at}/indices");
    let indices = match primitive.indices {
        Some(index) => Some(Accessor::open(doc, index.value(), &from, report)?),
        None => None,
    };
    let corners = indices.as_ref().map_or(count, |a| a.count) as u64;
    if !doc.may_decode(corners * if mode == Mode::Triangles { 4 } else { 12 }) {
        report.problem(at, "asks for more triangles than the size of the file justifies");
        return None;
    }
    let mesh = &mut group.mesh;
    let first = mesh.triangles.len();
    if triangles::append(mode, indices.as_ref(), count, base, at, &mut mesh.triangles, report) {
        add_part(mesh, first, material, at, report)
    } else {
        None
    }
}

/// Does the primitive compress its data and lack plain copies of some? Its accessors would read as zeros.
fn is_only_compressed(doc: &Document, primitive: &Primitive) -> bool {
    let compressed = primitive.extensions.as_ref().is_some_and(|e| e.others.contains_key(DRACO));
    let is_plain = |index: usize| {
        let accessor = doc.json.pointer(&pointer("accessors", index));
        accessor.is_none_or(|a| a.get("bufferView").is_some() || a.get("sparse").is_some())
    };
    compressed && !primitive.attributes.values().chain(&primitive.indices).all(|i| is_plain(i.value()))
}

/// Covers the triangles from `first` on by a part.
fn add_part(
    mesh: &mut Mesh,
    first: usize,
    material: MaterialId,
    at: &str,
    report: &mut Report,
) -> Option<()> {
    let (Ok(first_triangle), Ok(end)) = (u32::try_from(first), u32::try_from(mesh.triangles.len())) else {
        mesh.triangles.truncate(first);
        report.problem(at, "takes its mesh beyond 4,294,967,295 triangles");
        return None;
    };
    mesh.parts.push(MeshPart { first_triangle, triangle_count: end - first_triangle, material });
    Some(())
}

/// What a primitive's vertices are made of, as far as its material needs it; `None` without positions. Tangents mean
/// nothing without normals.
///
/// The first set of texture coordinates is always read: a scene file may replace the material.
fn attributes(primitive: &Primitive, needs: Needs) -> Option<Attributes> {
    let accessor =
        |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
    let normals = accessor(Semantic::Normals);
    Some(Attributes {
        positions: accessor(Semantic::Positions)?,
        normals,
        tangents: accessor(Semantic::Tangents).filter(|_| needs.tangents && normals.is_some()),
        colors: accessor(Semantic::Colors(0)),
        uv_sets: (0u32..)
            .zip(needs.uv_sets)
            .map(|(set, used)| accessor(Semantic::TexCoords(set)).filter(|_| used || set == 0))
            .collect(),
    })
}

/// Appends vertices to a mesh; gives the first and their number.
fn add_vertices(
    doc: &Document,
    attributes: &Attributes,
    at: &str,
    mesh: &mut Mesh,
    report: &mut Report,
) -> Option<(u32, usize)> {
    let base = mesh.positions.len();
    let mut opener = Opener::new(doc, at, report);
    let positions = opener.open(Some(attributes.positions), "POSITION", &[Type::Vec3], Kind::Signed);
    let normals = opener.open(attributes.normals, "NORMAL", &[Type::Vec3], Kind::Signed);
    let tangents = opener.open(attributes.tangents, "TANGENT", &[Type::Vec4], Kind::Signed);
    let colors = opener.open(attributes.colors, "COLOR_0", &[Type::Vec3, Type::Vec4], Kind::Unsigned);
    let mut uv = |(set, &index): (usize, &Option<usize>)| {
        opener.open(index, &format!("TEXCOORD_{set}"), &[Type::Vec2], Kind::Coordinate)
    };
    let uv_sets: Vec<_> = attributes.uv_sets.iter().enumerate().map(&mut uv).collect();
    let count = opener.finish(base, 12 + 12 + 16 + 16 + 8 * uv_sets.len() as u64)?;
    positions?.read_floats(tail(&mut mesh.positions, base, count, [0.0; 3]));
    if let Some(normals) = normals {
        normals.read_floats(tail(&mut mesh.normals, base, count, [0.0; 3]));
    }
    if let Some(tangents) = tangents {
        tangents.read_floats(tail(&mut mesh.tangents, base, count, [0.0; 4]));
    }
    if let Some(colors) = colors {
        read_colors(&colors, tail(&mut mesh.colors, base, count, [1.0; 4]));
    }
    for (set, uv) in uv_sets.into_iter().enumerate() {
        let Some(uv) = uv else { continue };
        if mesh.uv_sets.len() <= set {
            mesh.uv_sets.resize(set + 1, Vec::new());
        }
        uv.read_floats(tail(&mut mesh.uv_sets[set], base, count, [0.0; 2]));
    }
    Some((base as u32, count))
}

/// Opens the accessors of one primitive's attributes, all of them even if one has problems.
struct Opener<'d, 'a, 'r> {
    doc: &'d Document<'a>,
    at: &'r str,
    report: &'r mut Report,
    quantized: bool,
    /// The number of vertices, known from the first attribute on.
    count: Option<usize>,
    sound: bool,
}

impl<'d, 'a, 'r> Opener<'d, 'a, 'r> {
    fn new(doc: &'d Document<'a>, at: &'r str, report: &'r mut Report) -> Opener<'d, 'a, 'r> {
        let quantized = doc.extension_used("KHR_mesh_quantization");
        Opener { doc, at, report, quantized, count: None, sound: true }
    }

    /// The accessor of an attribute; `None` if there is no such attribute, or it has problems (then `sound` is false).
    fn open(&mut self, index: Option<usize>, name: &str, types: &[Type], kind: Kind) -> Option<Accessor<'d>> {
        let from = format!("{}/attributes/{name}", self.at);
        let opened = Accessor::open(self.doc, index?, &from, self.report);
        let usable = opened.filter(|accessor| {
            let expected = *self.count.get_or_insert(accessor.count);
            if accessor.count != expected {
                let message = format!("has {} elements for {expected} vertices", accessor.count);
                self.report.problem(accessor.pointer.clone(), message);
            }
            checked(accessor, types, kind, self.quantized, self.report) && accessor.count == expected
        });
        self.sound &= usable.is_some();
        usable
    }

    /// The number of vertices, if all is sound and the file justifies the memory they take after `base` others.
    fn finish(self, base: usize, bytes_per_vertex: u64) -> Option<usize> {
        let count = self.count.filter(|_| self.sound)?;
        let fits = base.checked_add(count).is_some_and(|n| u32::try_from(n).is_ok());
        if fits && self.doc.may_decode(bytes_per_vertex.saturating_mul(count as u64)) {
            return Some(count);
        }
        let message = format!("{count} vertices are more than the size of the file justifies");
        self.report.problem(self.at, message);
        None
    }
}

fn read_colors(accessor: &Accessor, out: &mut [[f32; 4]]) {
    if accessor.kind == Type::Vec4 {
        accessor.read_floats(out);
        return;
    }
    let mut rgb = vec![[0.0; 3]; accessor.count];
    accessor.read_floats(&mut rgb);
    for (out, [r, g, b]) in out.iter_mut().zip(rgb) {
        *out = [r, g, b, 1.0];
    }
}

/// Makes `list` end with `count` entries from `base` on and gives those.
fn tail<T: Copy>(list: &mut Vec<T>, base: usize, count: usize, default: T) -> &mut [T] {
    if base == 0 {
        // Fresh zeros come from the system without being written.
        *list = vec![default; count];
    } else {
        list.resize(base, default);
        list.resize(base + count, default);
    }
    &mut list[base..]
}

/// Fills up attributes that some primitives of a mesh lack: texture coordinates 0, white.
fn pad(mesh: &mut Mesh) {
    let count = mesh.positions.len();
    if !mesh.colors.is_empty() {
        mesh.colors.resize(count, [1.0; 4]);
    }
    for set in mesh.uv_sets.iter_mut().filter(|set| !set.is_empty()) {
        set.resize(count, [0.0; 2]);
    }
}

/// Which component types an attribute may have.
#[derive(Clone, Copy)]
enum Kind {
    /// Floats; signed or unsigned small integers with KHR_mesh_quantization.
    Signed,
    /// Floats and normalised unsigned integers.
    Unsigned,
    /// The same, and any small integers with KHR_mesh_quantization.
    Coordinate,
}

/// Has an accessor the type that its attribute needs (glTF 2.0, section 3.7.2.1, and KHR_mesh_quantization)?
fn checked(accessor: &Accessor, types: &[Type], kind: Kind, quantized: bool, report: &mut Report) -> bool {
    let small = matches!(
        accessor.component,
        ComponentType::I8 | ComponentType::U8 | ComponentType::I16 | ComponentType::U16
    );
    let unsigned =
        matches!(accessor.component, ComponentType::U8 | ComponentType::U16) && accessor.normalized;
    let component = match kind {
        Kind::Signed => small && quantized,
        Kind::Unsigned => unsigned,
        Kind::Coordinate => unsigned || small && quantized,
    };
    let fits = types.contains(&accessor.kind) && (component || accessor.component == ComponentType::F32);
    if !fits {
        let named: Vec<String> = types.iter().map(|t| format!("{t:?}").to_uppercase()).collect();
        let message =
            format!("holds {}; this attribute needs {} of F32", accessor.contents(), named.join(" or "));
        report.problem(accessor.pointer.clone(), message);
    }
    fits
}
