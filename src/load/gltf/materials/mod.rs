//! Materials: the metallic-roughness model with its extensions, and the older specular-glossiness model in its terms.
//! Each is built when the first primitive that is seen asks for it.

mod base;
mod builder;
mod layers;
mod needs;
mod panes;
mod scattering;
mod signs;
mod specular_glossiness;

pub(super) use needs::Needs;
pub(super) use signs::Signs;

use super::cameras;
use super::document::{Document, name_of, pointer};
use super::report::{Report, Sound};
use super::textures::Textures;
use crate::scene::{AlphaMode, Emission, FloatSlot, Material, MaterialId, Model};
use builder::Builder;
use serde_json::Value;
use std::collections::HashMap;

/// The materials found so far.
#[derive(Default)]
pub(super) struct Materials {
    /// The scene's materials.
    pub list: Vec<Material>,
    /// Their textures.
    pub textures: Textures,
    /// The caller replaces all materials: none is read, and the default stands for each.
    pub geometry_only: bool,
    /// What tells that they lost something, in the order of the list.
    pub signs: Vec<Signs>,
    needs: Vec<Needs>,
    /// Those that are on panes, which became sheets.
    panes: Vec<MaterialId>,
    known: HashMap<Option<usize>, Sound<MaterialId>>,
}

impl Materials {
    /// The material of an index, or glTF's default; `from` points to what refers to it. Problems are noted.
    pub fn get(
        &mut self,
        doc: &Document,
        index: Option<usize>,
        from: &str,
        report: &mut Report,
    ) -> Sound<MaterialId> {
        let index = index.filter(|_| !self.geometry_only);
        if let Some(known) = self.known.get(&index) {
            return *known;
        }
        let built = match index {
            Some(index) => report.lasting(|report| build(doc, index, from, &mut self.textures, report)),
            None => Ok((default_material(), Needs::default(), Signs::default())),
        };
        let id = built.map(|(material, needs, signs)| {
            self.list.push(material);
            self.signs.push(signs);
            self.needs.push(needs);
            MaterialId(self.list.len() as u32 - 1)
        });
        self.known.insert(index, id);
        id
    }

    /// Forgets all but the images that were needed.
    pub fn forget(&mut self) {
        let mut textures = std::mem::take(&mut self.textures);
        textures.forget();
        *self = Materials { textures, geometry_only: self.geometry_only, ..Materials::default() };
    }

    /// What a material needs from the meshes that it is on.
    pub fn needs(&self, material: MaterialId) -> Needs {
        self.needs[material.index()]
    }

    /// The primitive at a pointer with this material has vertex colours.
    pub fn use_vertex_colors(&mut self, material: MaterialId, at: &str, report: &mut Report) {
        let material = &mut self.list[material.index()];
        material.use_vertex_colors = true;
        if material.model == Model::Black {
            report.warn(at, "has vertex colours, which its unlit material doesn't show");
        }
    }

    /// How many materials of the file are in use.
    pub fn used(&self) -> usize {
        self.known.keys().flatten().count()
    }
}

/// The whole number `priority` of a material's `extras`, as Blender writes custom properties: which of several solids counts where
/// they overlap.
fn priority(raw: &Value, at: &str, report: &mut Report) -> i32 {
    let Some(value) = raw.get("extras").and_then(|extras| extras.get("priority")) else { return 0 };
    let whole = value.as_f64().filter(|v| v.fract() == 0.0 && v.abs() <= 1000.0);
    if whole.is_none() {
        report.warn(format!("{at}/extras/priority"), "is no whole number from -1000 to 1000; ignored");
    }
    whole.unwrap_or(0.0) as i32
}

/// What glTF gives to primitives without a material.
fn default_material() -> Material {
    let model = Model::Pbr(Box::default());
    Material { double_sided: false, ..Material::new("default", model) }
}

/// Which of a scene's materials is that.
pub(super) fn stand_ins(materials: &[Material]) -> Vec<MaterialId> {
    let own = default_material();
    let is_own = |m: &Material| m.name == own.name && m.model == own.model && m.emission.is_none();
    (0u32..).zip(materials).filter(|(_, m)| is_own(m)).map(|(i, _)| MaterialId(i)).collect()
}

fn build(
    doc: &Document,
    index: usize,
    from: &str,
    textures: &mut Textures,
    report: &mut Report,
) -> Sound<(Material, Needs, Signs)> {
    let json: gltf::json::Material = doc.entry("materials", index, from, report)?;
    let raw = doc.raw("materials", index, from, report)?;
    let name = name_of(raw, "material", index);
    let at = pointer("materials", index);
    let mut builder = Builder { doc, raw, at, textures, report, needs: Needs::default() };
    let extensions = json.extensions.clone().unwrap_or_default();
    let old = builder.specular_glossiness();
    let base = match &old {
        Some(old) => old.diffuse,
        None => builder.base_color(&json),
    };
    let mut material = Material {
        double_sided: json.double_sided,
        alpha: FloatSlot { factor: base.alpha, texture: base.color.texture.map(|texture| (texture, 3)) },
        ..Material::new(name, Model::Black)
    };
    material.light_group = cameras::light_group(raw, &builder.at, builder.report).unwrap_or_default();
    material.priority = priority(raw, &builder.at, builder.report);
    material.alpha_mode = builder.alpha_mode(&json);
    if material.alpha_mode == AlphaMode::Opaque {
        material.alpha = FloatSlot::constant(1.0);
    }
    if extensions.unlit.is_some() {
        builder.report.warn(&*builder.at, "is unlit: it shines with its base colour, whatever lights it");
        material.emission = Some(Emission { radiance: base.color, two_sided: json.double_sided });
    } else {
        material.emission = builder.emission(&json, &extensions);
        let mut model = match &old {
            Some(old) => old.model(),
            None => builder.model(&json, base.color, &extensions),
        };
        builder.add_layers(&mut model);
        material.medium = builder.scattering(&mut model);
        material.model = Model::Pbr(Box::new(model));
        material.normal_map = builder.normal_map(&json);
    }
    let tangents = match &material.model {
        Model::Pbr(p) => p.anisotropy.is_some() || p.clearcoat.is_some_and(|c| c.normal_map.is_some()),
        _ => false,
    };
    let needs = Needs { tangents: tangents || material.normal_map.is_some(), ..builder.needs };
    let signs = Signs::of(&builder, base.color, material.alpha_mode);
    Ok((material, needs, signs))
}
