//! `[materials.NAME]`, each with a `type`; read when something refers to it. Colours are constants or names of textures.
//!
//! | `type` | Keys |
//! |---|---|
//! | `"lambert"` | `color` (0.8) |
//! | `"oren-nayar"` | `color` (0.8), `roughness` 0 to 1 (1) |
//! | `"phong"` | `diffuse` (0.5), `specular` (0.5), `exponent` from 0 (30) |
//! | `"metal"` | `color` (0.8) or `name` (see [`super::metals`]), `fuzz` or `roughness`, both 0 to 1 (0) |
//! | `"dielectric"` | `ior` (1.5; 1 is air, for bubbles in glass; below 1: of the inside over what is around), `fresnel` = `exact` or `schlick`, `tint` (1), `roughness` 0 to 1 (0), `thin` (false), `medium` within (see `media`) |
//! | `"medium"` | no surface, only what is within: `density`, `color`, `anisotropy`, `emission`, `grid`, `grid_name`, `emission_grid`, `temperature_grid`, `temperature`, `temperature_law`, `up`, `min`, `max`, `transform`, see `media` |
//! | `"hair"` | see `hair`, for `[[curves]]` |
//! | `"emissive"` | `radiance` (required), `two_sided` (false) |
//! | `"pbr"` | the keys of the table below |
//!
//! Those that may shine, `"emissive"` and `"pbr"`, may have a `light_group`, whose light `--light-groups` keeps apart.
//!
//! Those with an inside, `"dielectric"`, `"medium"` and `"pbr"`, may have a `priority`, a whole number (0). Where solids overlap, the
//! one of the highest priority counts: glass of priority 1 around a liquid that reaches into its wall ends where the glass says. Among
//! equals the one that light entered last counts, so that ice in water and air in glass need none.
//!
//! ## Fuzz
//! The thesis adds `fuzz * u` to the mirror direction, u uniform on the unit sphere. At normal incidence the mean cosine
//! between the result and the mirror direction is `1 - f^2 / 3` (integrate `(1 + f m) / sqrt(1 + f^2 + 2 f m)` over m in
//! -1..1). GGX with `a = alpha^2` draws normals with `tan^2 = s` of density `a / (a + s)^2`, so that the mean of
//! `cos(2 theta) = 2 / (1 + s) - 1` is `2 (1 / (1 - a) + a ln a / (1 - a)^2) - 1`. The alpha whose mean is that of the
//! fuzz is taken (fuzz 0.3 gives alpha 0.056, fuzz 1 gives 0.31), and roughness is its square root.

use super::build::Build;
use super::fields::{Fields, named, nearest};
use super::light_traits::group;
use super::pbr::Slots;
use super::textures::Textures;
use super::{adjusted, displaced, hair, media, metals, pbr};
use crate::error::Warning;
use crate::scene::{
    ColorSlot, Emission, FloatSlot, FresnelModel, Material, MaterialId, Model, Parameter, ParameterMut,
    Parameters,
};
use std::collections::HashMap;
use std::ops::Range;

/// The named materials and which of them have been read.
pub(super) struct Materials<'a> {
    fields: Option<Fields<'a>>,
    done: HashMap<String, Option<MaterialId>>,
}

impl<'a> Materials<'a> {
    pub fn new(fields: Option<Fields<'a>>) -> Materials<'a> {
        Materials { fields, done: HashMap::new() }
    }

    /// Is there a material of that name?
    pub fn contains(&self, name: &str) -> bool {
        self.fields.as_ref().is_some_and(|fields| fields.entry(name).is_some())
    }

    /// The material of a name, read now if it hasn't been.
    pub fn get(
        &mut self,
        build: &mut Build,
        textures: &mut Textures<'a>,
        name: &str,
        span: Range<usize>,
    ) -> Option<MaterialId> {
        if let Some(done) = self.done.get(name) {
            return *done;
        }
        // Beside a model its own materials are known, too.
        if build.is_beside_model && !self.contains(name) {
            let own = build.loaded.scene.materials.iter().position(|m| m.name == name);
            if let Some(index) = own {
                return Some(MaterialId(index as u32));
            }
            let own_tables = self.fields.iter().flat_map(|f| f.entries()).map(|(n, _)| n);
            if nearest(name, own_tables).is_none() && adjusted::push_unknown(build, name, span.clone()) {
                return None;
            }
        }
        let value = named(self.fields.as_ref(), "material", name, span, build.problems)?;
        let id = match (value.get_ref().as_table(), &self.fields) {
            (Some(table), Some(all)) => {
                let fields = Fields::new(format!("material '{name}'"), table, value.span(), all.problems);
                read(build, textures, &fields, name).map(|material| {
                    build.loaded.scene.materials.push(material);
                    MaterialId(build.loaded.scene.materials.len() as u32 - 1)
                })
            }
            _ => {
                build.problems.push(value.span(), format!("material '{name}' must be a table"));
                None
            }
        };
        self.done.insert(name.to_string(), id);
        id
    }

    /// Changes the materials of a model that tables are named as: all of a material where there is a `type`, else what the
    /// keys say.
    pub fn override_model(&mut self, build: &mut Build, textures: &mut Textures<'a>) {
        let Some(all) = &self.fields else { return };
        for (name, value) in all.entries() {
            let own = 0..build.loaded.scene.materials.len();
            let own: Vec<usize> = own.filter(|&i| build.loaded.scene.materials[i].name == name).collect();
            let (Some(&first), Some(table)) = (own.first(), value.get_ref().as_table()) else { continue };
            for &index in &own {
                let fields = Fields::new(format!("material '{name}'"), table, value.span(), all.problems);
                let changed = match fields.has("type") {
                    true => read(build, textures, &fields, name),
                    false => adjusted::adjusted(build, textures, &fields, index),
                };
                if let Some(changed) = changed {
                    build.loaded.scene.materials[index] = changed;
                }
            }
            self.done.insert(name.to_string(), Some(MaterialId(first as u32)));
        }
    }

    /// Notes materials that nothing refers to. Their keys are checked, but their images not opened.
    pub fn check_unused(&self, build: &mut Build, textures: &mut Textures<'a>) {
        textures.only_check();
        let Some(all) = &self.fields else { return };
        for (name, value) in all.entries().filter(|(n, _)| !self.done.contains_key(*n)) {
            match value.get_ref().as_table() {
                Some(table) => {
                    let fields = Fields::new(format!("material '{name}'"), table, value.span(), all.problems);
                    // It means to change one of the model's.
                    let is_change = build.is_beside_model && !fields.has("type");
                    if is_change && adjusted::push_unknown(build, name, value.span()) {
                        continue;
                    }
                    read(build, textures, &fields, name);
                }
                None => build.problems.push(value.span(), format!("material '{name}' must be a table")),
            }
            match build.is_beside_model {
                true => adjusted::warn_of_unknown(build, name),
                false => build.loaded.left_out.push(format!("material '{name}': nothing refers to it")),
            }
        }
    }
}

/// Models with a reader of their own; others are read parameter by parameter.
#[derive(Clone, Copy)]
enum Kind {
    Metal,
    Dielectric,
    Medium,
    Emissive,
    Hair,
    Pbr,
    Plain(fn() -> Model),
}

fn kinds() -> Vec<(&'static str, Kind)> {
    let plain = Model::PLAIN.iter().map(|&(key, default)| (key, Kind::Plain(default)));
    let others = [
        ("metal", Kind::Metal),
        ("dielectric", Kind::Dielectric),
        ("medium", Kind::Medium),
        ("emissive", Kind::Emissive),
        ("hair", Kind::Hair),
        ("pbr", Kind::Pbr),
    ];
    plain.chain(others).collect()
}

/// Largest constant that a parameter may be.
const MOST_CONSTANT: f64 = 1e6;

/// Reads the parameters of a model, each by its own key.
fn plain(fields: &Fields, mut model: Model, mut slot: impl FnMut(&'static str, f32) -> ColorSlot) -> Model {
    model.visit_mut("", &mut |key, parameter| match parameter {
        ParameterMut::Color(color) => *color = slot(key, color.factor[0]),
        ParameterMut::Number(number) => {
            let value = fields.number_in(key, 0.0..1.0, number.factor.into());
            *number = FloatSlot::constant(value as f32);
        }
        ParameterMut::Constant(value) => {
            *value = fields.number_in(key, 0.0..MOST_CONSTANT, (*value).into()) as f32;
        }
        ParameterMut::Texture(_) => {}
    });
    model
}

fn read<'a>(
    build: &mut Build,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    name: &str,
) -> Option<Material> {
    fields.require("type", fields.string("type"));
    let kind = fields.choice("type", &kinds())?;
    let mut slot =
        |key, default: f32| textures.slot(build, fields, key).unwrap_or(ColorSlot::constant([default; 3]));
    let light_group = match kind {
        Kind::Emissive | Kind::Pbr => group(fields, "light_group"),
        _ => String::new(),
    };
    let mut material = match kind {
        Kind::Plain(default) => Material::new(name, plain(fields, default(), slot)),
        Kind::Metal => metal(fields, name, slot("color", 0.8)),
        Kind::Dielectric => {
            let model = dielectric(fields, slot("tint", 1.0));
            Material { medium: media::table(build, fields, "medium"), ..Material::new(name, model) }
        }
        Kind::Medium => Material {
            medium: Some(media::filling(build, fields)),
            ..Material::new(name, Model::Boundary {})
        },
        Kind::Emissive => {
            fields.require("radiance", fields.raw("radiance"));
            let radiance = slot("radiance", 0.0);
            let two_sided = fields.flag("two_sided", false);
            let emission = Some(Emission { radiance, two_sided });
            Material { emission, ..Material::new(name, Model::Black) }
        }
        Kind::Hair => Material::new(name, hair::read(fields, slot)),
        Kind::Pbr => {
            let medium = media::table(build, fields, "medium");
            pbr::material(name, medium, &mut Slots { build, textures, fields, of_model: false })
        }
    };
    material.light_group = light_group;
    material.displacement = displaced::read(build, fields, textures.is_check());
    material.normal_map = displaced::normals(build, fields, textures.is_check());
    if let Kind::Dielectric | Kind::Medium | Kind::Pbr = kind {
        material.priority = media::priority(fields).unwrap_or(0);
    }
    fields.finish();
    warn_of_brightness(build, &material);
    Some(material)
}

/// Colours beyond 1, which were likely meant as 0 to 255, make more light than arrives.
fn warn_of_brightness(build: &mut Build, material: &Material) {
    let mut bright = None;
    material.parameters(&mut |name, parameter| {
        if let Parameter::Color(slot) = parameter
            && matches!(name, "color" | "base_color" | "albedo" | "diffuse" | "tint")
            && slot.factor.iter().any(|&c| c > 1.0)
        {
            bright.get_or_insert(slot.factor);
        }
    });
    if let Some([r, g, b]) = bright {
        let message = format!(
            "material '{}' reflects more light than arrives by its colour [{r}, {g}, {b}]: colours are linear, from 0 to 1",
            material.name
        );
        build.loaded.warnings.push(Warning::new(build.file, "", message));
    }
}

fn metal(fields: &Fields, name: &str, color: ColorSlot) -> Material {
    let measured = metals::named(fields);
    let fuzz = fields.has("fuzz").then(|| fields.number_in("fuzz", 0.0..1.0, 0.0));
    if fuzz.is_some() && fields.has("roughness") {
        fields.problems.push(fields.span(), "'fuzz' and 'roughness' say the same: leave one out");
    }
    let roughness = match fuzz {
        Some(f) => roughness_of_fuzz(f) as f32,
        None => fields.number_in("roughness", 0.0..1.0, 0.0) as f32,
    };
    let roughness = FloatSlot::constant(roughness);
    let model = match measured {
        Some(m) => Model::Conductor { eta: m.eta, k: m.k, metal: m.metal, roughness },
        None => Model::SchlickMetal { color, roughness },
    };
    Material::new(name, model)
}

fn dielectric(fields: &Fields, tint: ColorSlot) -> Model {
    let models = [("exact", FresnelModel::Exact), ("schlick", FresnelModel::Schlick)];
    let ior = fields.number_in("ior", 0.1..10.0, 1.5) as f32;
    let fresnel = fields.choice("fresnel", &models).unwrap_or_default();
    let roughness = fields.number_in("roughness", 0.0..1.0, 0.0) as f32;
    let is_thin = fields.flag("thin", false);
    if roughness == 0.0 && !is_thin {
        return Model::Dielectric { ior, tint, fresnel };
    }
    if is_thin && fields.has("medium") {
        fields.problems.push(fields.span(), "thin glass has no inside for a 'medium'");
    }
    if ior < 1.0 {
        fields.problems.push(fields.span(), "the 'ior' of rough or thin glass must be at least 1");
    }
    if fresnel != FresnelModel::Exact {
        fields.problems.push(fields.span(), "rough or thin glass has exact reflectance: leave 'fresnel' out");
    }
    Model::Glass { ior, tint, roughness: FloatSlot::constant(roughness), is_thin }
}

/// The roughness (square root of the GGX alpha) whose lobe at normal incidence has the mean cosine of the thesis's fuzz.
fn roughness_of_fuzz(fuzz: f64) -> f64 {
    if fuzz <= 0.0 {
        return 0.0;
    }
    let wanted = fuzz * fuzz / 3.0;
    // 1 - mean cosine grows with a; 64 halvings exhaust the precision of f64.
    let (mut low, mut high) = (0.0, 0.5);
    for _ in 0..64 {
        let a: f64 = 0.5 * (low + high);
        let deviation = 2.0 - 2.0 / (1.0 - a) - 2.0 * a * a.ln() / (1.0 - a).powi(2);
        if deviation < wanted { low = a } else { high = a }
    }
    (0.5f64 * (low + high)).sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One minus the mean cosine of the GGX lobe at normal incidence, by inversion of its distribution of normals; the
    /// quantile is 1 - e^-x, which resolves the long tail.
    fn ggx_deviation(alpha: f64) -> f64 {
        let n = 200_000;
        let width = 50.0 / f64::from(n);
        let term = |i: i32| {
            let x = (f64::from(i) + 0.5) * width;
            let s = alpha * alpha * x.exp_m1();
            2.0 * s / (1.0 + s) * (-x).exp() * width
        };
        (0..n).map(term).sum()
    }

    #[test]
    fn fuzz_and_ggx_have_the_same_mean_cosine() {
        for fuzz in [0.02, 0.1, 0.3, 0.7, 1.0] {
            let n = 20_000;
            let cosine = |i: i32| {
                let m = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
                (1.0 + fuzz * m) / (1.0 + fuzz * fuzz + 2.0 * fuzz * m).sqrt()
            };
            let mean = (0..n).map(cosine).sum::<f64>() / f64::from(n);
            let alpha = roughness_of_fuzz(fuzz).powi(2);
            let deviation = 1.0 - mean;
            assert!((ggx_deviation(alpha) - deviation).abs() < 2e-3 * deviation, "fuzz {fuzz}");
        }
        assert_eq!(roughness_of_fuzz(0.0), 0.0);
    }
}
