//! Meshes: one mesh of the scene for each of the file, with a part for each primitive. Primitives without normals are
//! flat, so a mesh that has both kinds becomes two, and likewise for tangents.

use super::accessor::Accessor;
use super::document::{Document, name_of, pointer};
use super::materials::Materials;
use super::report::{Report, Sound};
use super::triangles::Corners;
use super::vertices::{Attributes, Deformation, add_vertices, attributes};
use super::{draco, repair, triangles, variants};
use crate::scene::{MaterialId, Mesh, MeshPart};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::Checked;
use std::collections::HashMap;

/// The extensions by which the largest index begins another strip or fan. `EXT_mesh_primitive_restart` first had lists of primitives
/// that may be drawn as one: those are read one by one, which is the same.
const RESTARTS: [&str; 2] = ["KHR_mesh_primitive_restart", "EXT_mesh_primitive_restart"];

/// What the meshes of a file left out.
#[derive(Default)]
pub(super) struct Skipped {
    /// By mesh, the numbers of primitives that are points and lines.
    by_mesh: HashMap<usize, [usize; 2]>,
}

impl Skipped {
    /// Says so.
    pub fn warn(&self, report: &mut Report) {
        for (kind, what) in ["points", "lines"].into_iter().enumerate() {
            let count: usize = self.by_mesh.values().map(|counts| counts[kind]).sum();
            if count > 0 {
                let message =
                    format!("{count} primitives are {what}, which have no surface, and are skipped");
                report.warn("/meshes", message);
            }
        }
    }
}

/// A mesh being put together from primitives with the same kinds of attributes.
struct Group {
    has_normals: bool,
    has_tangents: bool,
    mesh: Mesh,
    /// The first vertex of each set of attributes that is in the mesh, and how many it has.
    vertices: HashMap<Attributes, (u32, usize)>,
}

/// What reading meshes needs and fills.
pub(super) struct MeshReader<'b, 'a> {
    /// The file.
    pub doc: &'b Document<'a>,
    /// The materials, built as they are met.
    pub materials: &'b mut Materials,
    /// What is left out.
    pub skipped: &'b mut Skipped,
    /// Problems and warnings.
    pub report: &'b mut Report,
    /// How the mesh is deformed.
    pub deformation: Deformation<'b>,
}

impl MeshReader<'_, '_> {
    /// Reads the mesh of an index; `from` points to what refers to it. Problems are noted.
    pub fn read(mut self, index: usize, from: &str) -> Vec<Mesh> {
        let doc = self.doc;
        let Ok(json) = doc.entry::<gltf::json::Mesh>("meshes", index, from, self.report) else {
            return Vec::new();
        };
        let (mut groups, mut skipped) = (Vec::<Group>::new(), [0; 2]);
        for (i, primitive) in json.primitives.iter().enumerate() {
            let at = format!("{}/primitives/{i}", pointer("meshes", index));
            self.add_primitive(primitive, &at, &mut groups, &mut skipped);
        }
        self.skipped.by_mesh.insert(index, skipped);
        let raw = doc.raw("meshes", index, from, self.report);
        let name = raw.map(|raw| name_of(raw, "mesh", index)).unwrap_or_default();
        let finish = |group: Group| {
            let mut mesh = Mesh { name: name.clone(), ..group.mesh };
            pad(&mut mesh);
            repair::repair(&mut mesh, &pointer("meshes", index), self.report);
            mesh
        };
        groups.into_iter().map(finish).filter(|mesh| !mesh.triangles.is_empty()).collect()
    }

    fn add_primitive(
        &mut self,
        primitive: &Primitive,
        at: &str,
        groups: &mut Vec<Group>,
        skipped: &mut [usize; 2],
    ) {
        match primitive.mode {
            Checked::Invalid => {
                self.report.problem(format!("{at}/mode"), "is no mode of glTF 2.0 (0 to 6)");
            }
            Checked::Valid(Mode::Points) => skipped[0] += 1,
            Checked::Valid(Mode::Lines | Mode::LineLoop | Mode::LineStrip) => skipped[1] += 1,
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => {
                // What is wrong with a primitive doesn't concern the others.
                let _: Sound<()> = self.add_triangles(primitive, mode, at, groups);
            }
        }
    }

    fn add_triangles(
        &mut self,
        primitive: &Primitive,
        mode: Mode,
        at: &str,
        groups: &mut Vec<Group>,
    ) -> Sound<()> {
        let doc = self.doc;
        let is_compressed = self.report.lasting(|report| draco::unpack(doc, primitive, at, report))?;
        // A compressed primitive is a list of triangles, whatever it was made from.
        let mode = if is_compressed { Mode::Triangles } else { mode };
        let material = variants::material(doc, primitive, at, self.report);
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
            self.materials.use_vertex_colors(material, at, self.report);
        }
        let from = format!("{at}/indices");
        let indices = match primitive.indices {
            Some(index) => Some(Accessor::open(doc, index.value(), &from, self.report)?),
            None => None,
        };
        let corners = indices.as_ref().map_or(count, |a| a.count) as u64;
        if !doc.may_decode(corners * if mode == Mode::Triangles { 4 } else { 12 }) {
            return Err(self
                .report
                .problem(at, "asks for more triangles than the size of the file justifies"));
        }
        let mesh = &mut group.mesh;
        let first = mesh.triangles.len();
        let may_restart = RESTARTS.iter().any(|name| doc.extension_used(name));
        let corners = Corners { mode, indices: indices.as_ref(), vertices: count, may_restart };
        triangles::append(corners, base, at, &mut mesh.triangles, self.report)?;
        add_part(mesh, first, material, at, self.report)
    }
}

/// The group for primitives with these kinds of attributes.
fn group_of<'g>(attributes: &Attributes, groups: &'g mut Vec<Group>) -> &'g mut Group {
    let (has_normals, has_tangents) = (attributes.normals.is_some(), attributes.tangents.is_some());
    let found = groups.iter().position(|g| (g.has_normals, g.has_tangents) == (has_normals, has_tangents));
    let group = found.unwrap_or_else(|| {
        groups.push(Group { has_normals, has_tangents, mesh: Mesh::default(), vertices: HashMap::new() });
        groups.len() - 1
    });
    &mut groups[group]
}

/// Covers the triangles from `first` on by a part.
fn add_part(mesh: &mut Mesh, first: usize, material: MaterialId, at: &str, report: &mut Report) -> Sound<()> {
    let (Ok(first_triangle), Ok(end)) = (u32::try_from(first), u32::try_from(mesh.triangles.len())) else {
        mesh.triangles.truncate(first);
        return Err(report.problem(at, "takes its mesh beyond 4,294,967,295 triangles"));
    };
    mesh.parts.push(MeshPart { first_triangle, triangle_count: end - first_triangle, material });
    Ok(())
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
