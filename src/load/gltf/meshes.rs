//! Meshes: one part per primitive. A mesh whose primitives have different attributes (normals, tangents) is split.

use super::buffers::Accessor;
use super::document::{Document, name_of, pointer};
use super::draco;
use super::materials::Materials;
use super::points_lines;
use super::report::{Report, Valid};
use super::vertices::{Attributes, Deformation, add_vertices, attributes};
use crate::error::Problem;
use crate::load::mesh_tools::{
    bound_colors, normalize_normals, remove_non_finite_triangles, zero_non_finite,
};
use crate::load::options::GltfOptions;
use crate::math::all_finite;
use crate::scene::{MaterialId, Mesh, MeshPart};
use crate::simd::prefer_huge_pages;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::Checked;
use serde_json::Value;
use std::collections::HashMap;

/// Extensions for the restart index, which begins another strip or fan. Drafts of `EXT_mesh_primitive_restart` instead
/// listed primitives to be drawn as one, which needs no support.
const RESTARTS: [&str; 2] = ["KHR_mesh_primitive_restart", "EXT_mesh_primitive_restart"];

/// A mesh under construction, of primitives with the same attributes.
struct Group {
    has_normals: bool,
    has_tangents: bool,
    mesh: Mesh,
    /// First vertex and number of vertices of each set of accessors.
    vertices: HashMap<Attributes, (u32, usize)>,
}

/// The state of reading a mesh.
pub(super) struct MeshReader<'b, 'a> {
    pub doc: &'b Document<'a>,
    /// The materials, built on first use.
    pub materials: &'b mut Materials,
    /// Problems and warnings.
    pub report: &'b mut Report,
    /// Skin and morph targets of the mesh.
    pub deformation: Deformation<'b>,
}

impl MeshReader<'_, '_> {
    /// Reads the mesh at an index; `from` is the JSON pointer of the reference to it.
    pub fn read(mut self, index: usize, from: &str) -> Vec<Mesh> {
        let doc = self.doc;
        let Ok(json) = doc.entry::<gltf::json::Mesh>("meshes", index, from, self.report) else {
            return Vec::new();
        };
        let (mut groups, mut clouds) = (Vec::<Group>::new(), Vec::new());
        for (i, primitive) in json.primitives.iter().enumerate() {
            let at = format!("{}/primitives/{i}", pointer("meshes", index));
            if primitive.mode == Checked::Valid(Mode::Points) {
                let material = || self.materials.of_splats();
                // Primitives with errors are skipped; the report has the problem.
                let read = points_lines::read_splats(doc, (index, i), material, &at, self.report);
                clouds.extend(read.ok().flatten());
            }
            self.add_primitive(primitive, &at, &mut groups);
        }
        let raw = doc.raw("meshes", index, from, self.report);
        let name = raw.map(|raw| name_of(raw, "mesh", index)).unwrap_or_default();
        let finish = |group: Group| {
            let mut mesh = Mesh { name: name.clone(), ..group.mesh };
            pad(&mut mesh);
            repair(&mut mesh, &pointer("meshes", index), self.report);
            mesh
        };
        let meshes = groups.into_iter().map(finish).filter(|mesh| !mesh.triangles.is_empty());
        meshes.chain(clouds).collect()
    }

    fn add_primitive(&mut self, primitive: &Primitive, at: &str, groups: &mut Vec<Group>) {
        match primitive.mode {
            Checked::Invalid => {
                self.report.problem(format!("{at}/mode"), "is not a mode of glTF 2.0 (0 to 6)");
            }
            // Points and lines are read by `points_lines`.
            Checked::Valid(Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) => {}
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => {
                // Primitives with errors are skipped; the report has the problem.
                let _: Valid<()> = self.add_triangles(primitive, mode, at, groups);
            }
        }
    }

    fn add_triangles(
        &mut self,
        primitive: &Primitive,
        mode: Mode,
        at: &str,
        groups: &mut Vec<Group>,
    ) -> Valid<()> {
        let doc = self.doc;
        let is_compressed = self.report.lasting(|report| draco::unpack(doc, primitive, at, report))?;
        // Draco decodes to a triangle list.
        let mode = if is_compressed { Mode::Triangles } else { mode };
        let material = variant_material(doc, primitive, at, self.report);
        let material = self.materials.get(doc, material, &format!("{at}/material"), self.report)?;
        let needs = self.materials.needs(material);
        let attributes = attributes(primitive, needs, &self.deformation, at, self.report)?;
        for (needed, held) in needs.uv_slots.sets.iter().zip(&attributes.uv_slots) {
            if let (Some(set), None) = (needed, held) {
                let message = format!("has no TEXCOORD_{set}, which its material's textures use; taken as 0");
                self.report.warn(format!("{at}/attributes"), message);
            }
        }
        let group = group_of(&attributes, groups);
        let skin = self.deformation.skin;
        let (base, count) = match group.vertices.get(&attributes) {
            Some(&place) => place,
            None => {
                let place = add_vertices(doc, &attributes, skin, at, &mut group.mesh, self.report)?;
                group.vertices.insert(attributes.clone(), place);
                place
            }
        };
        if attributes.colors.is_some() {
            self.materials.use_vertex_colors(material);
        }
        let from = format!("{at}/indices");
        let indices = match primitive.indices {
            Some(index) => Some(Accessor::open(doc, index.value(), &from, self.report)?),
            None => None,
        };
        let corners = indices.as_ref().map_or(count, |a| a.count) as u64;
        if !doc.may_decode(corners * if mode == Mode::Triangles { 4 } else { 12 }) {
            return Err(self.report.problem(at, "has more triangles than the size of the file justifies"));
        }
        let mesh = &mut group.mesh;
        let first = mesh.triangles.len();
        let may_restart = RESTARTS.iter().any(|name| doc.extension_used(name));
        let corners = PrimitiveIndices { mode, indices: indices.as_ref(), vertices: count, may_restart };
        append_triangles(corners, base, at, &mut mesh.triangles, self.report)?;
        add_part(mesh, first, material, at, self.report)
    }
}

/// The group for primitives with these attributes.
fn group_of<'g>(attributes: &Attributes, groups: &'g mut Vec<Group>) -> &'g mut Group {
    let (has_normals, has_tangents) = (attributes.normals.is_some(), attributes.tangents.is_some());
    let found = groups.iter().position(|g| (g.has_normals, g.has_tangents) == (has_normals, has_tangents));
    let group = found.unwrap_or_else(|| {
        groups.push(Group { has_normals, has_tangents, mesh: Mesh::default(), vertices: HashMap::new() });
        groups.len() - 1
    });
    &mut groups[group]
}

/// Adds a part with the triangles from `first` on.
fn add_part(mesh: &mut Mesh, first: usize, material: MaterialId, at: &str, report: &mut Report) -> Valid<()> {
    let (Ok(first_triangle), Ok(end)) = (u32::try_from(first), u32::try_from(mesh.triangles.len())) else {
        mesh.triangles.truncate(first);
        return Err(report.problem(at, "exceeds 4,294,967,295 triangles in its mesh"));
    };
    mesh.parts.push(MeshPart { first_triangle, triangle_count: end - first_triangle, material });
    Ok(())
}

/// Fills missing attributes of primitives: texture coordinates with 0, colours with white.
fn pad(mesh: &mut Mesh) {
    let count = mesh.positions.len();
    if !mesh.colors.is_empty() {
        mesh.colors.resize(count, [1.0; 4]);
    }
    for set in mesh.uv_sets.iter_mut().filter(|set| !set.is_empty()) {
        set.resize(count, [0.0; 2]);
    }
}

// The triangles of a primitive: lists, strips and fans, with or without indices.

/// The index list of a primitive.
pub(super) struct PrimitiveIndices<'c, 'd> {
    /// Topology.
    pub mode: Mode,
    /// The indices; `None` for all vertices in order.
    pub indices: Option<&'c Accessor<'d>>,
    /// Number of vertices.
    pub vertices: usize,
    /// Whether the largest index of the type is a restart index (KHR_mesh_primitive_restart).
    pub may_restart: bool,
}

/// Appends a primitive's triangles to `triangles`, with `base` added to each index. Triangles with indices beyond the
/// vertices are dropped.
pub(super) fn append_triangles(
    PrimitiveIndices { mode, indices, vertices, may_restart }: PrimitiveIndices,
    base: u32,
    at: &str,
    triangles: &mut Vec<[u32; 3]>,
    report: &mut Report,
) -> Valid<()> {
    let count = indices.map_or(vertices, |a| a.count);
    indices.map_or(Ok(()), |accessor| check_indices(accessor, report))?;
    let is_complete = match mode {
        Mode::Triangles => count.is_multiple_of(3),
        _ => count == 0 || count >= 3,
    };
    if !is_complete {
        report.warn(
            at,
            format!("{count} indices are not a whole number of triangles; the remainder is ignored"),
        );
    }
    let first = triangles.len();
    if mode == Mode::Triangles {
        if first == 0 {
            // The system provides zeroed pages without writing them.
            *triangles = vec![[0; 3]; count / 3];
            prefer_huge_pages(triangles);
        } else {
            triangles.resize(first + count / 3, [0; 3]);
        }
        read(indices, bytemuck::cast_slice_mut(&mut triangles[first..]));
    } else {
        let mut corners = vec![0; count];
        read(indices, &mut corners);
        let restart = indices.filter(|_| may_restart).map(restart_index);
        let pieces = corners.split(|&corner| Some(corner) == restart);
        match mode {
            Mode::TriangleStrip => triangles.extend(pieces.flat_map(strip)),
            Mode::TriangleFan => triangles.extend(pieces.flat_map(fan)),
            _ => {}
        }
    }
    let added: &[u32] = bytemuck::cast_slice(&triangles[first..]);
    let largest = added.iter().copied().max();
    if let Some(largest) = largest.filter(|&i| i as usize >= vertices) {
        let at = indices.map_or(at, |a| &a.pointer).to_string();
        let is_restart = mode != Mode::Triangles && indices.is_some_and(|a| restart_index(a) == largest);
        let message = format!("holds the index {largest}, but there are {vertices} vertices");
        drop_beyond(triangles, first, vertices, Problem::new(at, message), is_restart, report)?;
    }
    if base > 0 {
        let added: &mut [u32] = bytemuck::cast_slice_mut(&mut triangles[first..]);
        added.iter_mut().for_each(|i| *i += base);
    }
    Ok(())
}

/// Drops triangles from `first` on with indices beyond the vertices, with a warning. A problem if no triangle remains or
/// the index may be an undeclared restart index.
fn drop_beyond(
    triangles: &mut Vec<[u32; 3]>,
    first: usize,
    vertices: usize,
    wrong: Problem,
    is_restart: bool,
    report: &mut Report,
) -> Valid<()> {
    let is_valid = |t: &[u32; 3]| t.iter().all(|&i| (i as usize) < vertices);
    let (count, kept) = (triangles.len() - first, triangles[first..].iter().filter(|t| is_valid(t)).count());
    if is_restart || kept == 0 {
        triangles.truncate(first);
        let help = "if it is a primitive restart index, the file must list KHR_mesh_primitive_restart in \
                    extensionsUsed and extensionsRequired";
        return Err(report.add(if is_restart { wrong.with_help(help) } else { wrong }));
    }
    let mut number = 0;
    triangles.retain(|t| {
        number += 1;
        number <= first || is_valid(t)
    });
    report.warn(wrong.place, format!("{}: {} triangles are dropped", wrong.message, count - kept));
    Ok(())
}

/// The restart index: the largest of its type.
fn restart_index(accessor: &Accessor) -> u32 {
    match accessor.component {
        ComponentType::U8 => u32::from(u8::MAX),
        ComponentType::U16 => u32::from(u16::MAX),
        _ => u32::MAX,
    }
}

fn check_indices(accessor: &Accessor, report: &mut Report) -> Valid<()> {
    let unsigned = matches!(accessor.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
    let fits = unsigned && accessor.kind == Type::Scalar && !accessor.normalized;
    if !fits {
        let message = format!("holds {}; indices are unsigned scalars, not normalised", accessor.contents());
        return Err(report.problem(accessor.pointer.clone(), message));
    }
    Ok(())
}

fn read(indices: Option<&Accessor>, out: &mut [u32]) {
    match indices {
        Some(accessor) => accessor.read_indices(out),
        None => out.iter_mut().zip(0..).for_each(|(out, i)| *out = i),
    }
}

/// The triangles of a strip (glTF 2.0, section 3.7.2.1), without degenerate ones that only join strips.
fn strip(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let with_winding =
        |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
    corners.windows(3).enumerate().map(with_winding).filter(|[a, b, c]| a != b && b != c && c != a)
}

/// The triangles of a fan around the first corner (glTF 2.0, section 3.7.2.1).
fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let center = corners.first().copied().unwrap_or_default();
    corners.get(1..).unwrap_or_default().windows(2).map(move |w| [w[0], w[1], center])
}

// Repair of invalid vertex data, with warnings.

/// Maximum deviation of a normal's squared length from 1 without normalisation.
const UNIT_TOLERANCE: f32 = 1e-4;

/// Drops triangles with non-finite positions, and repairs normals, tangents, colours and texture coordinates.
fn repair(mesh: &mut Mesh, at: &str, report: &mut Report) {
    if !all_finite(mesh.positions.as_flattened()) {
        let dropped = remove_non_finite_triangles(mesh);
        report.warn(at, format!("{dropped} triangles with corners that are not finite numbers were dropped"));
    }
    // Branchless, for vectorisation; false for NaN.
    let is_unit = |[x, y, z]: [f32; 3]| (x * x + y * y + z * z - 1.0).abs() <= UNIT_TOLERANCE;
    if !mesh.normals.iter().fold(true, |all, &n| all & is_unit(n)) {
        normalize_normals(mesh);
        report.warn(at, "has normals that are not of unit length; they were normalised");
    }
    let zeroed = zero_non_finite(mesh);
    if zeroed > 0 {
        report.warn(at, format!("{zeroed} texture coordinates or colours that are not finite became 0"));
    }
    if let Some(what) = bound_colors(&mut mesh.colors, false) {
        report.warn(at, what);
    }
    if !all_finite(mesh.tangents.as_flattened()) {
        mesh.tangents.clear();
        report.warn(at, "has tangents that are not finite; they are derived from its texture coordinates");
    }
    for tangent in &mut mesh.tangents {
        tangent[3] = 1f32.copysign(tangent[3]);
    }
}

// KHR_materials_variants: the material of a primitive in the selected variant.

const VARIANTS: &str = "/extensions/KHR_materials_variants/variants";

/// Checks that the user's variant exists.
pub(super) fn check_variant(doc: &Document, report: &mut Report) {
    let Some(wanted) = &doc.options.variant else { return };
    if let Err(help) = GltfOptions::find(&variant_names(doc), wanted) {
        let message = format!("there is no material variant '{wanted}'");
        report.add(Problem::new("/extensions", message).with_help(help));
    }
}

/// The names of a file's variants.
pub(super) fn variant_names(doc: &Document) -> Vec<String> {
    let list = doc.json.pointer(VARIANTS).and_then(Value::as_array);
    let name = |v: &Value| v.get("name").and_then(Value::as_str).unwrap_or_default().to_string();
    list.into_iter().flatten().map(name).collect()
}

/// The material of a primitive: that of the chosen variant, or its own.
fn variant_material(doc: &Document, primitive: &Primitive, at: &str, report: &mut Report) -> Option<usize> {
    let default = primitive.material.map(|m| m.value());
    let Some(chosen) =
        doc.options.variant.as_ref().and_then(|v| GltfOptions::find(&variant_names(doc), v).ok())
    else {
        return default;
    };
    let extension = doc.json.pointer(&format!("{at}/extensions/KHR_materials_variants/mappings"));
    let mappings = extension.and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    if mappings.is_empty() && extension.is_some() {
        report.warn(at, "has invalid variant mappings; its own material is used");
    }
    let is_chosen = |mapping: &&Value| {
        let variants = mapping.get("variants").and_then(Value::as_array);
        variants.is_some_and(|list| list.iter().any(|v| v.as_u64() == Some(chosen as u64)))
    };
    let Some(mapping) = mappings.iter().find(is_chosen) else { return default };
    let material = mapping.get("material").and_then(Value::as_u64).and_then(|m| usize::try_from(m).ok());
    if material.is_none() {
        report.warn(at, "has a variant without a material; its own material is used");
    }
    material.or(default)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_keep_their_winding() {
        let triangles: Vec<_> = strip(&[0, 1, 2, 3, 3, 4]).collect();
        assert_eq!(triangles, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(strip(&[0, 1]).count(), 0);
    }

    #[test]
    fn fans_share_their_first_corner() {
        let triangles: Vec<_> = fan(&[5, 6, 7, 8]).collect();
        assert_eq!(triangles, [[6, 7, 5], [7, 8, 5]]);
        assert_eq!(fan(&[]).count(), 0);
    }
}
