//! Material extensions: diffuse roughness, clearcoat, sheen, anisotropy, iridescence, dispersion, diffuse transmission,
//! volume scattering, and the specular-glossiness model. Layers with a factor of 0 are omitted with their textures.
//!
//! Also decides, by the meshes of a material, whether glass is a solid, a thin sheet or a pane.

use super::{Base, MaterialBuilder, Materials};
use crate::error::Choice;
use crate::load::gltf::report::Report;
use crate::load::mesh_tools::retain_triangles;
use crate::load::options::Glass;
use crate::math::{DMat3, DVec3};
use crate::scene::{
    Anisotropy, Clearcoat, ColorSlot, DiffuseTransmission, FloatSlot, Instance, Iridescence, MaterialId,
    Medium, Mesh, Model, PbrMaterial, Scene, Sheen, coefficients, encloses,
};
use serde_json::Value;
use std::collections::HashMap;

const UNIT: [f32; 2] = [0.0, 1.0];

impl MaterialBuilder<'_, '_> {
    pub fn add_layers(&mut self, model: &mut PbrMaterial) {
        self.diffuse_roughness(model);
        model.clearcoat = self.clearcoat();
        model.sheen = self.sheen();
        model.anisotropy = self.anisotropy();
        model.iridescence = self.iridescence();
        model.diffuse_transmission = self.diffuse_transmission();
        if let Some((extension, place)) = self.extension("KHR_materials_dispersion") {
            model.dispersion = self.number((extension, &place), "dispersion", 0.0, [0.0, f32::MAX]);
        }
    }

    /// Oren-Nayar roughness, times the red channel of its texture. The extension is a draft.
    fn diffuse_roughness(&mut self, model: &mut PbrMaterial) {
        let Some((extension, place)) = self.extension("KHR_materials_diffuse_roughness") else { return };
        let from = (extension, place.as_str());
        let at = format!("{}{place}", self.at);
        self.report.warn(
            at,
            ("extension-draft", "KHR_materials_diffuse_roughness is a draft: its support may change"),
        );
        let factor = self.number(from, "diffuseRoughnessFactor", 0.0, UNIT);
        if factor == 0.0 {
            return;
        }
        let texture = self.info(from, "diffuseRoughnessTexture");
        let at = format!("{place}/diffuseRoughnessTexture");
        model.diffuse_roughness = self.float(factor, texture.as_ref(), 0, &at);
    }

    fn clearcoat(&mut self) -> Option<Clearcoat> {
        let (extension, place) = self.extension("KHR_materials_clearcoat")?;
        let from = (extension, place.as_str());
        let factor = self.number(from, "clearcoatFactor", 0.0, UNIT);
        if factor == 0.0 {
            return None;
        }
        let roughness = self.number(from, "clearcoatRoughnessFactor", 0.0, UNIT);
        let texture = self.info(from, "clearcoatTexture");
        let factor = self.float(factor, texture.as_ref(), 0, &format!("{place}/clearcoatTexture"));
        let texture = self.info(from, "clearcoatRoughnessTexture").filter(|_| roughness > 0.0);
        let at = format!("{place}/clearcoatRoughnessTexture");
        let roughness = self.float(roughness, texture.as_ref(), 1, &at);
        let normal_map = self.normal_map_at(&format!("{place}/clearcoatNormalTexture"));
        Some(Clearcoat { factor, roughness, normal_map })
    }

    fn sheen(&mut self) -> Option<Sheen> {
        let (extension, place) = self.extension("KHR_materials_sheen")?;
        let from = (extension, place.as_str());
        let color = self.numbers(from, "sheenColorFactor", [0.0; 3]);
        if color == [0.0; 3] {
            return None;
        }
        let roughness = self.number(from, "sheenRoughnessFactor", 0.0, UNIT);
        let texture = self.info(from, "sheenColorTexture");
        let color = self.color(color, texture.as_ref(), &format!("{place}/sheenColorTexture"));
        let texture = self.info(from, "sheenRoughnessTexture").filter(|_| roughness > 0.0);
        let roughness = self.float(roughness, texture.as_ref(), 3, &format!("{place}/sheenRoughnessTexture"));
        Some(Sheen { color, roughness })
    }

    fn anisotropy(&mut self) -> Option<Anisotropy> {
        let (extension, place) = self.extension("KHR_materials_anisotropy")?;
        let from = (extension, place.as_str());
        let strength = self.number(from, "anisotropyStrength", 0.0, UNIT);
        if strength == 0.0 {
            return None;
        }
        let rotation_rad = self.number(from, "anisotropyRotation", 0.0, [f32::MIN, f32::MAX]);
        let texture = self.data_texture(from, "anisotropyTexture");
        // Directions are relative to the tangents, which are derived from UV set 0.
        self.needs.uv_slots.take(0);
        Some(Anisotropy { strength, rotation_rad, texture })
    }

    fn iridescence(&mut self) -> Option<Iridescence> {
        let (extension, place) = self.extension("KHR_materials_iridescence")?;
        let from = (extension, place.as_str());
        let factor = self.number(from, "iridescenceFactor", 0.0, UNIT);
        if factor == 0.0 {
            return None;
        }
        let ior = self.number(from, "iridescenceIor", 1.3, [1.0, f32::MAX]);
        let thickness_min_nm = self.number(from, "iridescenceThicknessMinimum", 100.0, [0.0, f32::MAX]);
        let thickness_max_nm = self.number(from, "iridescenceThicknessMaximum", 400.0, [0.0, f32::MAX]);
        let texture = self.info(from, "iridescenceTexture");
        let factor = self.float(factor, texture.as_ref(), 0, &format!("{place}/iridescenceTexture"));
        let thickness_texture = self.data_texture(from, "iridescenceThicknessTexture").map(|id| (id, 1));
        Some(Iridescence { factor, ior, thickness_min_nm, thickness_max_nm, thickness_texture })
    }

    fn diffuse_transmission(&mut self) -> Option<DiffuseTransmission> {
        let (extension, place) = self.extension("KHR_materials_diffuse_transmission")?;
        let from = (extension, place.as_str());
        let factor = self.number(from, "diffuseTransmissionFactor", 0.0, UNIT);
        if factor == 0.0 {
            return None;
        }
        let color = self.numbers(from, "diffuseTransmissionColorFactor", [1.0; 3]);
        let texture = self.info(from, "diffuseTransmissionTexture");
        let at = format!("{place}/diffuseTransmissionTexture");
        let factor = self.float(factor, texture.as_ref(), 3, &at);
        let texture = self.info(from, "diffuseTransmissionColorTexture");
        let color = self.color(color, texture.as_ref(), &format!("{place}/diffuseTransmissionColorTexture"));
        Some(DiffuseTransmission { factor, color, subsurface: None })
    }
}

// Draft extensions for volume scattering: `KHR_materials_volume_scatter` in solids, and its successor
// `KHR_materials_scatter` in solids and thin sheets.

const SCATTER: &str = "KHR_materials_scatter";
const VOLUME_SCATTER: &str = "KHR_materials_volume_scatter";
/// Maximum of |g|, the mean cosine of the phase function.
const MAX_ANISOTROPY: f32 = 0.999;

/// Parameters of `KHR_materials_scatter`.
struct Scatter {
    /// JSON pointer of the extension.
    at: String,
    strength: f32,
    color: ColorSlot,
    anisotropy: f32,
}

impl MaterialBuilder<'_, '_> {
    /// The scattering medium of a solid. Scattering in thin sheets becomes diffuse transmission of the model.
    pub fn scattering(&mut self, model: &mut PbrMaterial) -> Option<Medium> {
        let is_solid = self.raw.pointer("/extensions/KHR_materials_volume/thicknessFactor");
        let is_solid = is_solid.and_then(Value::as_f64).is_some_and(|thickness| thickness > 0.0);
        let Some(scatter) = self.scatter(is_solid) else { return self.volume_scatter(model) };
        if scatter.strength == 0.0 {
            return None;
        }
        if is_solid {
            let color = scatter.color.factor.map(|c| c.min(1.0) * scatter.strength);
            return self.solid(model, color, scatter.anisotropy, &scatter.at);
        }
        if model.transmission.factor == 0.0 {
            let message = "scatters nothing: it needs KHR_materials_transmission with a factor above 0";
            self.report.warn(&*scatter.at, message);
            return None;
        }
        self.sheet(model, &scatter);
        None
    }

    fn draft(&mut self, name: &str, at: &str) {
        self.report.warn(at, ("extension-draft", format!("{name} is a draft: its support may change")));
    }

    fn scatter(&mut self, is_solid: bool) -> Option<Scatter> {
        let (extension, place) = self.extension(SCATTER)?;
        let from = (extension, place.as_str());
        let at = format!("{}{place}", self.at);
        self.draft(SCATTER, &at);
        let strength = self.number(from, "scatterStrengthFactor", 0.0, [0.0, 1.0]);
        let color = self.numbers(from, "multiscatterColorFactor", [1.0; 3]);
        let anisotropy = self.number(from, "scatterAnisotropy", 0.0, [-1.0, 1.0]);
        if extension.get("scatterStrengthTexture").is_some() {
            let message = "scatterStrengthTexture is not supported: only its factor is used";
            self.report.warn(&*at, message);
        }
        let texture = match extension.get("multiscatterColorTexture") {
            Some(_) if is_solid => {
                let message = "multiscatterColorTexture is not supported: solids are homogeneous";
                self.report.warn(&*at, message);
                None
            }
            _ => self.info(from, "multiscatterColorTexture").filter(|_| strength > 0.0),
        };
        let color = self.color(color, texture.as_ref(), &format!("{place}/multiscatterColorTexture"));
        Some(Scatter { at, strength, color, anisotropy })
    }

    /// `KHR_materials_volume_scatter`: its drafts have three names for the colour.
    fn volume_scatter(&mut self, model: &mut PbrMaterial) -> Option<Medium> {
        let (extension, place) = self.extension(VOLUME_SCATTER)?;
        let from = (extension, place.as_str());
        let names = ["multiscatterColorFactor", "multiscatterColor", "scatterAlbedo"];
        let name = names.into_iter().find(|name| extension.get(name).is_some()).unwrap_or(names[0]);
        let color = self.numbers(from, name, [0.0; 3]);
        let anisotropy = self.number(from, "scatterAnisotropy", 0.0, [-MAX_ANISOTROPY, MAX_ANISOTROPY]);
        let at = format!("{}{place}", self.at);
        self.draft(VOLUME_SCATTER, &at);
        self.solid(model, color.map(|c| c.min(1.0)), anisotropy, &at)
    }

    /// The medium of a solid: the attenuation defines the extinction, the colour the albedo as in [`Medium::subsurface`].
    fn solid(
        &mut self,
        model: &mut PbrMaterial,
        color: [f32; 3],
        anisotropy: f32,
        at: &str,
    ) -> Option<Medium> {
        let (attenuation, distance) = (model.attenuation_color, model.attenuation_distance);
        let extinction = coefficients(attenuation, distance).filter(|_| model.has_volume);
        let Some(extinction) = extinction else {
            let message =
                "scatters nothing: it needs KHR_materials_volume with a thickness and an attenuation";
            self.report.warn(at, message);
            return None;
        };
        if color == [0.0; 3] {
            return None;
        }
        model.attenuation_distance = f32::INFINITY;
        let anisotropy = anisotropy.clamp(-MAX_ANISOTROPY, MAX_ANISOTROPY);
        Some(Medium { extinction, ..Medium::subsurface(color, [1.0; 3], anisotropy) })
    }

    /// A thin sheet: a fraction 1 - `strength` of the transmitted light is not scattered, the rest is scattered diffusely, (1 + g) / 2
    /// of it forwards. [`PbrMaterial`] has a single colour for diffuse reflection: those of the base and of backscattering are mixed.
    fn sheet(&mut self, model: &mut PbrMaterial, scatter: &Scatter) {
        let (transmission, unscattered) =
            (model.transmission.factor, model.transmission.factor * (1.0 - scatter.strength));
        let scattered = transmission * scatter.strength;
        let forward = scattered * (1.0 + scatter.anisotropy) / 2.0;
        let backward = scattered - forward;
        let share = forward / (1.0 - unscattered);
        let reflected = 1.0 - transmission + backward;
        let is_constant = [&model.base_color, &scatter.color].iter().all(|slot| slot.texture.is_none());
        let is_uniform = model.transmission.texture.is_none();
        let has_one_color = model.base_color == scatter.color;
        if !has_one_color && reflected > 0.0 {
            let of_base = (1.0 - transmission) / reflected;
            let mixed = |(a, b): (f32, f32)| a * of_base + b * (1.0 - of_base);
            let (base, inside) = (model.base_color.factor, scatter.color.factor);
            model.base_color = match of_base {
                0.0 => scatter.color,
                _ if is_constant => ColorSlot::constant(std::array::from_fn(|i| mixed((base[i], inside[i])))),
                share if share < 0.5 => scatter.color,
                _ => model.base_color,
            };
            if unscattered > 0.0 || !is_uniform || !(is_constant || of_base == 0.0) {
                let message = "has a different colour from the base, and is textured or only partly scattering: the colours are mixed";
                self.report.warn(&*scatter.at, message);
            }
        }
        let texture = model.transmission.texture;
        model.transmission =
            FloatSlot { factor: unscattered, texture: texture.filter(|_| unscattered > 0.0) };
        model.diffuse_transmission = (share > 0.0).then_some(DiffuseTransmission {
            factor: FloatSlot { factor: share, texture },
            color: scatter.color,
            subsurface: None,
        });
        // The sheet is thin regardless of the option for glass.
        (model.has_volume, model.tints_once, self.needs.solid_if_closed) = (false, false, false);
        self.needs.is_glass &= unscattered > 0.0;
    }
}

// KHR_materials_pbrSpecularGlossiness in terms of the metallic-roughness model: a dielectric with the roughness
// 1 - glossiness, its specular reflection tinted, over the diffuse colour.

/// Fresnel reflectance at normal incidence for an index of refraction of 1.5. The specular colour of
/// KHR_materials_specular is relative to it.
const NORMAL_REFLECTANCE: f32 = 0.04;

/// Parameters of the specular-glossiness model.
pub(super) struct SpecularGlossiness {
    /// Diffuse colour and opacity.
    pub diffuse: Base,
    specular_color: ColorSlot,
    roughness: FloatSlot,
}

impl SpecularGlossiness {
    /// Conversion to the metallic-roughness model.
    pub fn model(&self) -> PbrMaterial {
        PbrMaterial {
            base_color: self.diffuse.color,
            metallic: FloatSlot::constant(0.0),
            roughness: self.roughness,
            specular_color: self.specular_color,
            ..PbrMaterial::default()
        }
    }
}

impl MaterialBuilder<'_, '_> {
    /// The specular-glossiness model, if the material has it.
    pub fn specular_glossiness(&mut self) -> Option<SpecularGlossiness> {
        let (extension, place) = self.extension("KHR_materials_pbrSpecularGlossiness")?;
        let from = (extension, place.as_str());
        let [r, g, b, alpha] = self.numbers(from, "diffuseFactor", [1.0; 4]);
        let specular = self.numbers(from, "specularFactor", [1.0; 3]);
        let glossiness = self.number(from, "glossinessFactor", 1.0, [0.0, 1.0]);
        let texture = self.info(from, "diffuseTexture");
        let color = self.color([r, g, b], texture.as_ref(), &format!("{place}/diffuseTexture"));
        let texture = self.info(from, "specularGlossinessTexture");
        let at = format!("{place}/specularGlossinessTexture");
        let roughness = match texture.as_ref().filter(|_| glossiness > 0.0) {
            Some(info) => self.roughness_of_gloss(glossiness, info, &at),
            None => FloatSlot::constant(1.0 - glossiness),
        };
        let specular = specular.map(|s| s / NORMAL_REFLECTANCE);
        let specular_color = self.color(specular, texture.as_ref(), &at);
        Some(SpecularGlossiness { diffuse: Base { color, alpha }, specular_color, roughness })
    }
}

/// Minimum fraction of a pane's area in its two faces.
const FLAT_SHARE: f64 = 0.8;
/// Minimum cosine between the normal of a triangle and the axis of the pane for triangles of its faces.
const FLAT_COSINE: f64 = 0.999;

impl Materials {
    /// Makes glass solid if its meshes are closed, with a note; makes panes single sheets if the user wants that.
    pub fn resolve_glass(&mut self, scene: &mut Scene, glass: Glass, report: &mut Report) {
        if !self.needs.iter().any(|needs| needs.solid_if_closed || needs.is_glass) {
            return;
        }
        let Scene { meshes, instances, .. } = scene;
        let users = Users::of(meshes, instances);
        for index in 0..self.needs.len() {
            let id = MaterialId(index as u32);
            if std::mem::take(&mut self.needs[index].solid_if_closed) {
                self.resolve_solid(id, (meshes, &users), report);
            }
            if glass == Glass::Panes && self.needs[index].is_glass {
                self.resolve_panes(id, (meshes, &users), instances, report);
            }
        }
    }

    fn resolve_solid(&mut self, id: MaterialId, (meshes, users): (&[Mesh], &Users), report: &mut Report) {
        let material = &mut self.list[id.index()];
        let is_solid = users.meshes(id).iter().any(|&mesh| encloses(&meshes[mesh]));
        if !is_solid && let Model::Pbr(model) = &mut material.model {
            (model.has_volume, model.tints_once) = (false, false);
        }
        let interpretation = match is_solid {
            true => format!("solid ({})", Choice::Glass),
            false => format!(
                "a thin sheet, since its meshes enclose no volume ('solid' of {} refracts light there, like Cycles and like \
                 a water surface)",
                Choice::Glass
            ),
        };
        let message = format!(
            "material '{}' is transmissive without a volume, as Blender exports glass; taken as {interpretation}",
            material.name
        );
        report.lasting(|report| report.note("", ("glass-panes", message)));
    }

    /// Converts the panes of a material to single sheets, if all its meshes are panes.
    fn resolve_panes(
        &mut self,
        id: MaterialId,
        (meshes, users): (&mut [Mesh], &Users),
        instances: &[Instance],
        report: &mut Report,
    ) {
        let Model::Pbr(model) = &self.list[id.index()].model else { return };
        // A texture that tints both faces would have to be squared.
        if model.base_color.texture.is_some() && !model.tints_once {
            return;
        }
        let is_known = self.panes.contains(&id);
        let panes: Option<Vec<(usize, Pane)>> = panes(id, (meshes, users), instances);
        let thickest =
            panes.as_ref().map(|list| list.iter().fold(0.0, |max, (_, pane)| pane.thickness.max(max)));
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
                "the panes of material '{}', {:.3} m thick, become single sheets without refraction and edges: shadow rays \
                pass them ({})",
                material.name,
                thickness,
                Choice::Glass
            );
            report.lasting(|report| report.note("", ("glass-panes", message)));
        }
        // Meshes of earlier time samples are already sheets.
        for (index, pane) in panes.into_iter().flatten() {
            pane.keep_one_face(&mut meshes[index]);
        }
    }
}

/// Indices of the meshes with a material, as panes; `None` if any mesh isn't a pane.
fn panes(
    id: MaterialId,
    (meshes, users): (&[Mesh], &Users),
    instances: &[Instance],
) -> Option<Vec<(usize, Pane)>> {
    let meshes_of_material = users.meshes(id).iter().map(|&index| (index, &meshes[index]));
    meshes_of_material
        .map(|(index, mesh)| {
            let placed = users.of_meshes[index].iter().map(|&i| &instances[i]);
            let mut panes = placed.map(|i| Pane::of(mesh, id, i.world_from_object.matrix3));
            let first = panes.next().unwrap_or_else(|| Pane::of(mesh, id, DMat3::IDENTITY))?;
            let all = panes.try_fold(first, |first, pane| pane.and_then(|pane| first.merge(&pane)));
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

/// A flat closed mesh.
struct Pane {
    /// Unit normal of its faces, object space.
    axis: DVec3,
    /// Thickness in world space, metres.
    thickness: f64,
}

impl Pane {
    /// A mesh as a pane under a transform; `None` if it isn't a pane or has other materials.
    fn of(mesh: &Mesh, id: MaterialId, world_from_object: DMat3) -> Option<Pane> {
        if mesh.parts.iter().any(|part| part.material != id) {
            return None;
        }
        let determinant = world_from_object.determinant();
        // Vector areas transform by the cofactor matrix.
        let cofactors = world_from_object.inverse().transpose() * determinant;
        let vectors: Vec<DVec3> = mesh.triangles.iter().map(|&t| vector_area(mesh, t)).collect();
        let placed: Vec<DVec3> = vectors.iter().map(|&v| cofactors * v).collect();
        let (largest, _) =
            placed.iter().enumerate().max_by(|(_, a), (_, b)| a.length().total_cmp(&b.length()))?;
        let axis = placed[largest].try_normalize()?;
        let area: f64 = placed.iter().map(|v| v.length()).sum();
        let is_of_face = |v: &&DVec3| v.dot(axis).abs() >= FLAT_COSINE * v.length();
        let flat: f64 = placed.iter().filter(is_of_face).map(|v| v.length()).sum();
        // Volume (sum of tetrahedra to the origin) over the area of one face.
        let thrice: f64 =
            mesh.triangles.iter().zip(&vectors).map(|(&t, v)| corners(mesh, t)[0].dot(*v)).sum();
        let thickness = (thrice / 3.0 * determinant / (flat / 2.0)).abs();
        let axis = vectors[largest].try_normalize()?;
        let is_flat = flat >= FLAT_SHARE * area && thickness.is_finite();
        // The closedness test is slower, so it comes last.
        (is_flat && encloses(mesh)).then_some(Pane { axis, thickness })
    }

    /// The pane with the larger thickness, if both have the same axis.
    fn merge(self, other: &Pane) -> Option<Pane> {
        let thickness = self.thickness.max(other.thickness);
        (self.axis.dot(other.axis).abs() >= FLAT_COSINE).then_some(Pane { thickness, ..self })
    }

    /// Keeps only the triangles of one face.
    fn keep_one_face(&self, mesh: &mut Mesh) {
        retain_triangles(mesh, |mesh, t| {
            let area = vector_area(mesh, mesh.triangles[t]);
            area.dot(self.axis) >= FLAT_COSINE * area.length()
        });
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

/// A thin sheet with the transmittance at normal incidence of a pane of glass; `thickness` in metres.
fn sheet_of(glass: &PbrMaterial, thickness: f64) -> PbrMaterial {
    let crossings = if glass.tints_once { 1 } else { 2 };
    let share = (thickness / f64::from(glass.attenuation_distance)) as f32;
    let mut sheet = PbrMaterial { has_volume: false, tints_once: false, dispersion: 0.0, ..glass.clone() };
    for (color, attenuation) in sheet.base_color.factor.iter_mut().zip(glass.attenuation_color) {
        *color = color.powi(crossings) * attenuation.powf(share);
    }
    (sheet.attenuation_color, sheet.attenuation_distance) = ([1.0; 3], f32::INFINITY);
    sheet
}
