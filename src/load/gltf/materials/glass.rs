//! Glass whose kind depends on the meshes that it is on: bodies, sheets and panes.

use super::Materials;
use crate::error::Choice;
use crate::load::gltf::report::Report;
use crate::load::options::Glass;
use crate::math::{DMat3, DVec3};
use crate::scene::{Instance, MaterialId, Mesh, Model, PbrMaterial, Scene, encloses};
use std::collections::HashMap;

/// Share of a pane's area in its two planes, and the cosine within which a triangle counts to them.
const FLAT_SHARE: f64 = 0.8;
const FLAT_COSINE: f64 = 0.999;

impl Materials {
    /// Decides on glass that is solid where its meshes enclose a body, and says so; makes sheets of panes where the user
    /// wants that.
    pub fn resolve_glass(&mut self, scene: &mut Scene, glass: Glass, report: &mut Report) {
        if !self.needs.iter().any(|needs| needs.body || needs.glass) {
            return;
        }
        let Scene { meshes, instances, .. } = scene;
        let users = Users::of(meshes, instances);
        for index in 0..self.needs.len() {
            let id = MaterialId(index as u32);
            if std::mem::take(&mut self.needs[index].body) {
                self.settle_body(id, (meshes, &users), report);
            }
            if glass == Glass::Panes && self.needs[index].glass {
                self.settle_panes(id, (meshes, &users), instances, report);
            }
        }
    }

    fn settle_body(&mut self, id: MaterialId, (meshes, users): (&[Mesh], &Users), report: &mut Report) {
        let material = &mut self.list[id.index()];
        let is_solid = users.meshes(id).iter().any(|&mesh| encloses(&meshes[mesh]));
        if !is_solid && let Model::Pbr(model) = &mut material.model {
            (model.has_volume, model.tints_once) = (false, false);
        }
        let how = match is_solid {
            true => format!("solid ({})", Choice::Glass),
            false => format!(
                "a thin sheet, since its meshes enclose nothing ('solid' of {} bends light there, as Cycles does, and as \
                 the surface of water would)",
                Choice::Glass
            ),
        };
        let message = format!(
            "material '{}' is transparent without a volume, as Blender exports glass; taken as {how}",
            material.name
        );
        report.lasting(|report| report.note("", ("glass-panes", message)));
    }

    /// Makes single sheets of the panes of a material that is on nothing else.
    fn settle_panes(
        &mut self,
        id: MaterialId,
        (meshes, users): (&mut [Mesh], &Users),
        instances: &[Instance],
        report: &mut Report,
    ) {
        let Model::Pbr(model) = &self.list[id.index()].model else { return };
        // A picture that each crossing takes would have to be squared.
        if model.base_color.texture.is_some() && !model.tints_once {
            return;
        }
        let is_known = self.panes.contains(&id);
        let panes: Option<Vec<(usize, Pane)>> = panes(id, (meshes, users), instances);
        let thickest =
            panes.as_ref().map(|list| list.iter().fold(0.0, |most, (_, pane)| pane.thickness.max(most)));
        let (Some(thickness), true) = (thickest.or(is_known.then_some(0.0)), is_known || model.has_volume)
        else {
            return;
        };
        if !is_known {
            let sheet = sheet_of(model, thickness);
            let material = &mut self.list[id.index()];
            material.model = Model::Pbr(Box::new(sheet));
            material.double_sided = true;
            self.panes.push(id);
            let message = format!(
                "the panes of material '{}', {:.3} m thick, are single sheets: they let light samples pass, and neither bend \
                 light nor show edges ({})",
                material.name,
                thickness,
                Choice::Glass
            );
            report.lasting(|report| report.note("", ("glass-panes", message)));
        }
        // Meshes of other moments have lost their second face already.
        for (index, pane) in panes.into_iter().flatten() {
            pane.leave_one_face(&mut meshes[index]);
        }
    }
}

/// The meshes with a material and the panes that they are; `None` if one is none.
fn panes(
    id: MaterialId,
    (meshes, users): (&[Mesh], &Users),
    instances: &[Instance],
) -> Option<Vec<(usize, Pane)>> {
    let its = users.meshes(id).iter().map(|&index| (index, &meshes[index]));
    its.map(|(index, mesh)| {
        let placed = users.of_meshes[index].iter().map(|&i| &instances[i]);
        let mut panes = placed.map(|i| Pane::of(mesh, id, i.world_from_object.matrix3));
        let first = panes.next().unwrap_or_else(|| Pane::of(mesh, id, DMat3::IDENTITY))?;
        let all = panes.try_fold(first, |first, pane| pane.and_then(|pane| first.and(&pane)));
        all.map(|pane| (index, pane))
    })
    .collect()
}

/// The meshes of each material and the instances of each mesh, by index.
struct Users {
    of_materials: HashMap<MaterialId, Vec<usize>>,
    of_meshes: Vec<Vec<usize>>,
}

impl Users {
    fn of(meshes: &[Mesh], instances: &[Instance]) -> Users {
        let mut of_materials: HashMap<MaterialId, Vec<usize>> = HashMap::new();
        for (index, mesh) in meshes.iter().enumerate() {
            for part in &mesh.parts {
                let list = of_materials.entry(part.material).or_default();
                if list.last() != Some(&index) {
                    list.push(index);
                }
            }
        }
        let mut of_meshes = vec![Vec::new(); meshes.len()];
        for (index, instance) in instances.iter().enumerate() {
            of_meshes[instance.mesh.index()].push(index);
        }
        Users { of_materials, of_meshes }
    }

    /// The meshes with a material, in order.
    fn meshes(&self, id: MaterialId) -> &[usize] {
        self.of_materials.get(&id).map_or(&[], Vec::as_slice)
    }
}

/// A flat closed mesh under its instance's transform.
struct Pane {
    /// Normal of its faces in the mesh's own space, of unit length.
    axis: DVec3,
    /// Metres.
    thickness: f64,
}

impl Pane {
    /// A mesh as a pane where `world_from_object` places it; `None` if it isn't one of a single material.
    fn of(mesh: &Mesh, id: MaterialId, world_from_object: DMat3) -> Option<Pane> {
        if mesh.parts.iter().any(|part| part.material != id) {
            return None;
        }
        let determinant = world_from_object.determinant();
        // Areas go by the cofactors.
        let cofactors = world_from_object.inverse().transpose() * determinant;
        let vectors: Vec<DVec3> = mesh.triangles.iter().map(|&t| vector_area(mesh, t)).collect();
        let placed: Vec<DVec3> = vectors.iter().map(|&v| cofactors * v).collect();
        let (largest, _) =
            placed.iter().enumerate().max_by(|(_, a), (_, b)| a.length().total_cmp(&b.length()))?;
        let axis = placed[largest].try_normalize()?;
        let area: f64 = placed.iter().map(|v| v.length()).sum();
        let is_of_face = |v: &&DVec3| v.dot(axis).abs() >= FLAT_COSINE * v.length();
        let flat: f64 = placed.iter().filter(is_of_face).map(|v| v.length()).sum();
        // The volume, by tetrahedra from the origin, over one of the two faces.
        let thrice: f64 =
            mesh.triangles.iter().zip(&vectors).map(|(&t, v)| corners(mesh, t)[0].dot(*v)).sum();
        let thickness = (thrice / 3.0 * determinant / (flat / 2.0)).abs();
        let axis = vectors[largest].try_normalize()?;
        let is_flat = flat >= FLAT_SHARE * area && thickness.is_finite();
        // Most glass is not: whether it is closed takes longer to find.
        (is_flat && encloses(mesh)).then_some(Pane { axis, thickness })
    }

    /// Both, the thicker, if they have the same faces.
    fn and(self, other: &Pane) -> Option<Pane> {
        let thickness = self.thickness.max(other.thickness);
        (self.axis.dot(other.axis).abs() >= FLAT_COSINE).then_some(Pane { thickness, ..self })
    }

    /// Removes all triangles but those of one face.
    fn leave_one_face(&self, mesh: &mut Mesh) {
        let mut shared = Vec::new();
        let mut parts = mesh.parts.clone();
        for part in &mut parts {
            let first = part.first_triangle as usize;
            let of_part = &mesh.triangles[first..first + part.triangle_count as usize];
            part.first_triangle = shared.len() as u32;
            let is_front = |t: &&[u32; 3]| {
                let v = vector_area(mesh, **t);
                v.dot(self.axis) >= FLAT_COSINE * v.length()
            };
            shared.extend(of_part.iter().filter(is_front).copied());
            part.triangle_count = shared.len() as u32 - part.first_triangle;
        }
        (mesh.triangles, mesh.parts) = (shared, parts);
    }
}

fn corners(mesh: &Mesh, triangle: [u32; 3]) -> [DVec3; 3] {
    let corner = |i: u32| mesh.positions.get(i as usize).copied().unwrap_or_default().map(f64::from);
    triangle.map(|i| DVec3::from_array(corner(i)))
}

/// Half the cross product of two edges.
fn vector_area(mesh: &Mesh, triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners(mesh, triangle);
    (b - a).cross(c - a) / 2.0
}

/// A thin sheet that lets as much light pass, straight on, as a pane of glass of a thickness.
fn sheet_of(glass: &PbrMaterial, thickness: f64) -> PbrMaterial {
    let ways = if glass.tints_once { 1 } else { 2 };
    let share = (thickness / f64::from(glass.attenuation_distance)) as f32;
    let mut sheet = PbrMaterial { has_volume: false, tints_once: false, dispersion: 0.0, ..glass.clone() };
    for (color, attenuation) in sheet.base_color.factor.iter_mut().zip(glass.attenuation_color) {
        *color = color.powi(ways) * attenuation.powf(share);
    }
    (sheet.attenuation_color, sheet.attenuation_distance) = ([1.0; 3], f32::INFINITY);
    sheet
}
