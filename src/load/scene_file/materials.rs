//! `[materials.NAME]`, each with a `type`; unused ones are not loaded. Colours are constants or names of textures.
//!
//! | `type` | Keys |
//! |---|---|
//! | `"lambert"` | `color` (0.8) |
//! | `"oren-nayar"` | `color` (0.8), `roughness` 0 to 1 (1) |
//! | `"phong"` | `diffuse` (0.5), `specular` (0.5), `exponent` from 0 (30) |
//! | `"beckmann"` | `color` (0.8), `roughness` 0 to 1 (0.2): Beckmann microfacets without Fresnel, as in older files of Blender |
//! | `"velvet"` | `color` (0.8), `deviation` 0.01 to 1 (0.5): Ashikhmin velvet, as in older files of Blender; prefer `sheen_color` of `"pbr"` |
//! | `"toon"`, `"toon-highlight"` | `color` (0.8), `size` (0.5), `smooth` (0): a constant lobe of half angle `size` times 90 degrees around the normal, or around the mirror direction, that fades out over another `smooth` times 90 degrees |
//! | `"metal"` | `color` (0.8) or the `name` of a metal, `fuzz` or `roughness`, both 0 to 1 (0) |
//! | `"dielectric"` | `ior` (1.5; 1 is air, for bubbles in glass; below 1: index of the inside relative to the outside), `fresnel` = `exact` or `schlick`, `tint` (1), `roughness` 0 to 1 (0), `thin` (false), interior `medium` (see `media`) |
//! | `"medium"` | a medium without a surface: `density`, `color`, `anisotropy`, `emission`, `nodes`, `resolution`, `grid`, `grid_name`, `emission_grid`, `temperature_grid`, `temperature`, `temperature_law`, `up`, `min`, `max`, `transform`, see `media` |
//! | `"hair"` | see `hair`, for `[[curves]]` |
//! | `"emissive"` | `radiance` (required), `two_sided` (false) |
//! | `"pbr"` | the keys of the table below |
//! | `"mix"` | `components`, a list of `{ material = "NAME", weight = 0.5 }`: other materials of the file, without emission and alpha, and their weights: numbers, colours or names of textures |
//! | `"nodes"` | `nodes`, a table of Blender's shader nodes by name, and `surface`, the name of the output shader; `volume` (false): the surface bounds a solid, which a `medium` may fill; `bumps`, the output with the bump-mapped normal of a displacement; `up` = `"z"` for world vectors in Blender's axes. The guide has a section on materials of nodes |
//!
//! Emissive types, `"emissive"`, `"pbr"`, `"mix"` and `"nodes"`, may have a `light_group`, rendered separately by `--light-groups`.
//!
//! Types that can bound a solid, `"dielectric"`, `"medium"`, `"pbr"` and `"nodes"`, may have a `priority`, a whole number (0), for nested dielectrics: where solids overlap,
//! the one with the highest priority counts, so that a glass of priority 1 keeps its inner surface where the liquid overlaps its wall. Among
//! equal priorities the solid entered last counts, so that ice in water and air in glass need none.
//!
//! `type = "metal"` with `name = "gold"` instead of a colour has measured indices of refraction of aluminium, beryllium, chromium, copper,
//! gold, iridium, molybdenum, niobium, rhodium, silver, tantalum, titanium-nitride or tungsten.
//!
//! `type = "hair"` (Chiang et al. 2016) is a pigmented dielectric fibre, for `[[curves]]`. On other shapes fibres run along texture
//! coordinate u.
//!
//! | Key | Value |
//! |---|---|
//! | `color` | multiple-scattering albedo of dense hair (0.8), or instead one of the next two |
//! | `melanin` | pigment concentration, 0 (white) to 1 (black); `melanin_redness`, 0 (brown) to 1 (red), is 0.5 by default |
//! | `absorption` | absorption coefficient per fibre radius: three non-negative numbers, or one |
//! | `roughness` | longitudinal roughness, 0 to 1 (0.3) |
//! | `radial_roughness` | azimuthal roughness, 0 to 1 (0.3) |
//! | `ior` | index of refraction, 1 to 3 (1.55) |
//! | `tilt` | tilt of the cuticle scales towards the root, degrees, -45 to 45 (2) |
//! | `coat` | 0 to 1 (0): reduces the roughness of the primary reflection, as for wet or groomed hair |
//!
//! Materials of nodes may have `displacement = { vector = "NODE.OUTPUT" }`, which moves the vertices of meshes by a vector in world space.
//! Any material may have `displacement = { image = "heights.png", scale = 0.1 }`: meshes, boxes and quads with it are subdivided at
//! load time, and displaced along their normals.
//!
//! | Displacement | Default | Meaning |
//! |---|---|---|
//! | `image` | required | height map, by texture coordinates; the red channel as stored, 0 to 1 |
//! | `scale` | required | height difference between black and white, in object units (metres, unless the object is scaled) |
//! | `midlevel` | 0.5 | value of zero displacement |
//! | `edge` | 1/256 of the mesh's bounds | maximum edge of triangles, in object units; about the size of a texel resolves the whole image. The limit for all displaced meshes together is 16 million triangles |
//! | `wrap` | `repeat` | or `mirror`, `clamp` |
//! | `repeat` | [1, 1] | repetitions of the image along u and v |
//!
//! Parts of a mesh with different `edge` or `scale`, or next to a part without displacement, crack at their border: use
//! the same values, and heights of `midlevel` there.
//!
//! `index` (0) is the `material_index` output of nodes of type `object_info`.
//! `normal = "NAME"` takes the shading normal from a texture of type `nodes` with a world-space vector as result (nodes `bump`, `normal_map`).
//! Any material may have `normal = { image = "normals.png" }` or `bump = { image = "heights.png" }`, which change the shading
//! normal, but not the shape. They need texture coordinates, which meshes may lack; quads, spheres and disks have their own.
//!
//! | Normals | Default | Meaning |
//! |---|---|---|
//! | `image` | required | `normal`: normals as in glTF, (n + 1) / 2 with y up; `bump`: heights in the red channel |
//! | `scale` | 1 | factor on the slopes; for `bump` 1 is a height of 1/100 of the image's width from black to white, as with `-bm 1` of MTL files |
//! | `wrap` | `repeat` | or `clamp`; for `normal` also `mirror` |
//! | `repeat` | [1, 1] | repetitions of the image along u and v |

use super::builder::SceneFileBuilder;
use super::fields::{Fields, named, nearest};
use super::pbr::Slots;
use super::textures::{Textures, WRAPS, read_image, read_pixels};
use super::traits::{group, visible_to};
use super::{media, pbr, shaders};
use crate::color::spectral::Metal;
use crate::error::Warning;
use crate::load::displace::{BUMP_HEIGHT, holds_normals, normals_of_heights};
use crate::load::image::Use;
use crate::math::Vec2;
use crate::scene::{
    AlphaMode, ColorSlot, Displacement, DisplacementKind, Emission, EmitterTraits, FloatSlot, FresnelModel,
    ImageId, Interpolation, Mapping, Material, MaterialId, MixComponent, Model, NormalMap, Parameter,
    ParameterMut, Parameters, Texture, TextureId, TextureTransform, Wrap, hair_color,
};
use std::collections::HashMap;
use std::ops::Range;

/// The named materials; each is read on first use.
pub(super) struct Materials<'a> {
    fields: Option<Fields<'a>>,
    /// Materials read so far; `None` after a problem.
    ids: HashMap<String, Option<MaterialId>>,
}

impl<'a> Materials<'a> {
    pub fn new(fields: Option<Fields<'a>>) -> Materials<'a> {
        Materials { fields, ids: HashMap::new() }
    }

    /// Whether the file has a material of a name.
    pub fn contains(&self, name: &str) -> bool {
        self.fields.as_ref().is_some_and(|fields| fields.entry(name).is_some())
    }

    /// The material of a name, read on first use.
    pub fn get(
        &mut self,
        build: &mut SceneFileBuilder,
        textures: &mut Textures<'a>,
        name: &str,
        span: Range<usize>,
    ) -> Option<MaterialId> {
        if let Some(id) = self.ids.get(name) {
            return *id;
        }
        // Sidecars may refer to the model's materials.
        if build.is_sidecar && !self.contains(name) {
            if let Some(index) = build.loaded.scene.materials.iter().position(|m| m.name == name) {
                return Some(MaterialId(index as u32));
            }
            let tables = self.fields.iter().flat_map(|f| f.entries()).map(|(n, _)| n);
            if nearest(name, tables).is_none() && report_misspelling(build, name, span.clone()) {
                return None;
            }
        }
        let value = named(self.fields.as_ref(), "material", name, span, build.problems)?;
        let all = self.fields.as_ref()?;
        let material = Fields::of_value(format!("material '{name}'"), value, all.problems)
            .and_then(|fields| read(build, textures, &fields, all, name));
        let id = material.map(|material| build.loaded.scene.add_material(material));
        self.ids.insert(name.to_string(), id);
        id
    }

    /// Changes model materials that have a table of the same name: tables with a `type` replace the material, others change
    /// single parameters.
    pub fn override_model(&mut self, build: &mut SceneFileBuilder, textures: &mut Textures<'a>) {
        let Some(all) = &self.fields else { return };
        for (name, value) in all.entries() {
            let scene = &build.loaded.scene;
            let indices: Vec<usize> =
                (0..scene.materials.len()).filter(|&i| scene.materials[i].name == name).collect();
            let (Some(&first), Some(table)) = (indices.first(), value.get_ref().as_table()) else { continue };
            for &index in &indices {
                let fields = Fields::new(format!("material '{name}'"), table, value.span(), all.problems);
                let changed = match fields.has("type") {
                    true => read(build, textures, &fields, all, name),
                    false => adjust_material(build, textures, &fields, index),
                };
                if let Some(changed) = changed {
                    build.loaded.scene.materials[index] = changed;
                }
            }
            self.ids.insert(name.to_string(), Some(MaterialId(first as u32)));
        }
    }

    /// Checks the keys of unused materials without opening their images, and reports the materials as unused.
    pub fn check_unused(&self, build: &mut SceneFileBuilder, textures: &mut Textures<'a>) {
        textures.only_check();
        let Some(all) = &self.fields else { return };
        for (name, value) in all.entries().filter(|(n, _)| !self.ids.contains_key(*n)) {
            if build.components.contains(name) {
                continue;
            }
            if let Some(fields) = Fields::of_value(format!("material '{name}'"), value, all.problems) {
                // A table without a type changes a material of the model.
                let adjusts_model = build.is_sidecar && !fields.has("type");
                if adjusts_model && report_misspelling(build, name, value.span()) {
                    continue;
                }
                read(build, textures, &fields, all, name);
            }
            match build.is_sidecar {
                true => warn_of_unused_table(build, name),
                false => build.loaded.left_out.push(format!("material '{name}': nothing refers to it")),
            }
        }
    }
}

/// Material types; the parameters of `Plain` types are read generically, each by its own key.
#[derive(Clone, Copy)]
enum MaterialType {
    Metal,
    Dielectric,
    Medium,
    Emissive,
    Hair,
    Pbr,
    Mix,
    Nodes,
    Plain(fn() -> Model),
}

/// All types by name.
fn material_types() -> Vec<(&'static str, MaterialType)> {
    let plain = Model::PLAIN.iter().map(|&(key, default)| (key, MaterialType::Plain(default)));
    let others = [
        ("metal", MaterialType::Metal),
        ("dielectric", MaterialType::Dielectric),
        ("medium", MaterialType::Medium),
        ("emissive", MaterialType::Emissive),
        ("hair", MaterialType::Hair),
        ("pbr", MaterialType::Pbr),
        ("mix", MaterialType::Mix),
        ("nodes", MaterialType::Nodes),
    ];
    plain.chain(others).collect()
}

/// Maximum value of constant parameters.
const MAX_CONSTANT: f64 = 1e6;

/// Reads the parameters of a model, each by its own key.
fn read_plain(
    fields: &Fields,
    mut model: Model,
    mut slot: impl FnMut(&'static str, f32) -> ColorSlot,
) -> Model {
    model.visit_mut("", &mut |key, parameter| match parameter {
        ParameterMut::Color(color) => *color = slot(key, color.factor[0]),
        ParameterMut::Number(number) => {
            let value = fields.number_in(key, 0.0..1.0, number.factor.into());
            *number = FloatSlot::constant(value as f32);
        }
        ParameterMut::Constant(value) => {
            *value = fields.number_in(key, 0.0..MAX_CONSTANT, (*value).into()) as f32;
        }
        ParameterMut::Texture(_) => {}
    });
    model
}

fn read<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    all: &Fields<'a>,
    name: &str,
) -> Option<Material> {
    fields.require("type", fields.string("type"));
    let kind = fields.choice("type", &material_types())?;
    let mut slot =
        |key, default: f32| textures.slot(build, fields, key).unwrap_or(ColorSlot::constant([default; 3]));
    let light_group = match kind {
        MaterialType::Emissive | MaterialType::Pbr | MaterialType::Mix | MaterialType::Nodes => {
            group(fields, "light_group")
        }
        _ => String::new(),
    };
    let mut material = match kind {
        MaterialType::Plain(default) => Material::new(name, read_plain(fields, default(), slot)),
        MaterialType::Metal => metal(fields, name, slot("color", 0.8)),
        MaterialType::Dielectric => {
            let model = dielectric(fields, slot("tint", 1.0));
            Material { medium: media::read(build, textures, fields, "medium"), ..Material::new(name, model) }
        }
        MaterialType::Medium => Material {
            medium: Some(media::solid_medium(build, textures, fields)),
            ..Material::new(name, Model::Boundary {})
        },
        MaterialType::Emissive => {
            fields.require("radiance", fields.raw("radiance"));
            let radiance = slot("radiance", 0.0);
            let two_sided = fields.flag("two_sided", false);
            let emission = Some(Emission { radiance, two_sided });
            Material { emission, ..Material::new(name, Model::Black) }
        }
        MaterialType::Hair => Material::new(name, read_hair(fields, slot)),
        MaterialType::Pbr => {
            let medium = media::read(build, textures, fields, "medium");
            pbr::material(name, medium, &mut Slots { build, textures, fields, adjusts_model: false })
        }
        MaterialType::Mix => mark_keys_after_problem(fields, mix(build, textures, fields, all, name))?,
        MaterialType::Nodes => mark_keys_after_problem(fields, shaders::read(build, textures, fields, name))?,
    };
    material.light_group = light_group;
    material.index = fields.unsigned("index", 0, u32::MAX).unwrap_or(0);
    if !shaders::has_displacement(fields) {
        material.displacement = read_displacement(build, fields, textures.checks_only());
    }
    material.normal_map = read_normal_map(build, fields, textures.checks_only());
    // Shader graphs may have set their own normal.
    material.normal = material.normal.or(read_normal(build, fields, textures));
    if let MaterialType::Dielectric | MaterialType::Medium | MaterialType::Pbr | MaterialType::Nodes = kind {
        material.priority = media::priority(fields).unwrap_or(0);
    }
    fields.finish();
    warn_of_colors_above_one(build, &material);
    Some(material)
}

/// Returns the material; after a problem, marks the remaining keys as known.
fn mark_keys_after_problem(fields: &Fields, material: Option<Material>) -> Option<Material> {
    if material.is_none() {
        fields.mark_known(&["displacement", "normal", "bump", "priority"]);
        fields.finish();
    }
    material
}

/// Reads `components`: materials by name, with weights.
fn mix<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    all: &Fields<'a>,
    name: &str,
) -> Option<Material> {
    fields.require("components", fields.raw("components"));
    let mut components = Vec::new();
    for component in fields.tables("components") {
        let weight = textures.slot(build, &component, "weight").unwrap_or(ColorSlot::constant([1.0; 3]));
        let component_name = component.require("material", component.string("material"))?;
        component.finish();
        let value =
            named(Some(all), "material", component_name.value, component_name.span.clone(), build.problems)?;
        let fields = Fields::of_value(format!("material '{}'", component_name.value), value, all.problems)?;
        if fields.string("type").is_some_and(|kind| kind.value == "mix") {
            build
                .problems
                .push(component_name.span, ("nested-mix", "a component of a mix can't be a mix itself"));
            return None;
        }
        let material = read(build, textures, &fields, all, component_name.value)?;
        build.components.insert(component_name.value.to_string());
        components.push(MixComponent { weight, material });
    }
    Some(Material::new(name, Model::Mix { components }))
}

/// Warns of colours above 1, which add energy; they are probably meant as 0 to 255.
fn warn_of_colors_above_one(build: &mut SceneFileBuilder, material: &Material) {
    let mut above_one = None;
    material.parameters(&mut |name, parameter| {
        if let Parameter::Color(slot) = parameter
            && matches!(name, "color" | "base_color" | "albedo" | "diffuse" | "tint")
            && slot.factor.iter().any(|&c| c > 1.0)
        {
            above_one.get_or_insert(slot.factor);
        }
    });
    if let Some([r, g, b]) = above_one {
        let message = format!(
            "material '{}' reflects more light than it receives, as its colour is [{r}, {g}, {b}]: colours are linear, from 0 to 1",
            material.name
        );
        build.warn(("color-above-one", message));
    }
}

fn metal(fields: &Fields, name: &str, color: ColorSlot) -> Material {
    let measured = measured_metal(fields);
    let fuzz = fields.has("fuzz").then(|| fields.number_in("fuzz", 0.0..1.0, 0.0));
    fields.exclusive(["fuzz", "roughness"]);
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
    let ior = fields.number_in("ior", 0.1..10.0, 1.5) as f32;
    let fresnel = fields.choice("fresnel", &FresnelModel::NAMED).unwrap_or_default();
    let roughness = fields.number_in("roughness", 0.0..1.0, 0.0) as f32;
    let is_thin = fields.flag("thin", false);
    if roughness == 0.0 && !is_thin {
        return Model::Dielectric { ior, tint, fresnel };
    }
    if is_thin && fields.has("medium") {
        fields.report("thin glass has no inside for a 'medium'");
    }
    if ior < 1.0 {
        fields.report("the 'ior' of rough or thin glass must be at least 1");
    }
    if fresnel != FresnelModel::Exact {
        fields.report("rough or thin glass has exact reflectance: leave 'fresnel' out");
    }
    Model::Glass { ior, tint, roughness: FloatSlot::constant(roughness), is_thin }
}

/// The roughness (square root of the GGX alpha) whose lobe at normal incidence has the same mean cosine as the fuzz of
/// Shirley, "Ray Tracing in One Weekend": the mirror direction plus `fuzz * u`, u uniform on the unit sphere.
///
/// At normal incidence that mean is `1 - f^2 / 3` (integrate `(1 + f m) / sqrt(1 + f^2 + 2 f m)` over m in -1..1). GGX
/// with `a = alpha^2` samples normals with `tan^2 = s` of density `a / (a + s)^2`, so that the mean of
/// `cos(2 theta) = 2 / (1 + s) - 1` is `2 (1 / (1 - a) + a ln a / (1 - a)^2) - 1`. Fuzz 0.3 gives alpha 0.056, fuzz 1
/// gives 0.31.
fn roughness_of_fuzz(fuzz: f64) -> f64 {
    if fuzz <= 0.0 {
        return 0.0;
    }
    let target = fuzz * fuzz / 3.0;
    // 1 - mean cosine grows with a; 64 halvings exhaust the precision of f64.
    let (mut low, mut high) = (0.0, 0.5);
    for _ in 0..64 {
        let a: f64 = 0.5 * (low + high);
        let deviation = 2.0 - 2.0 / (1.0 - a) - 2.0 * a * a.ln() / (1.0 - a).powi(2);
        if deviation < target { low = a } else { high = a }
    }
    (0.5f64 * (low + high)).sqrt().sqrt()
}

/// Complex index of refraction eta + i k per channel of linear Rec. 709.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredMetal {
    pub eta: [f32; 3],
    pub k: [f32; 3],
    /// The metal, for spectral rendering.
    pub metal: Option<Metal>,
}

const fn rgb_metal(eta: [f32; 3], k: [f32; 3]) -> MeasuredMetal {
    MeasuredMetal { eta, k, metal: None }
}

/// Measured spectra (Palik 1998, "Handbook of Optical Constants of Solids"), weighted with the CIE 1931 matching functions
/// and converted to linear Rec.709.
const METALS: [(&str, MeasuredMetal); 13] = [
    ("aluminium", rgb_metal([1.6575, 0.880_405, 0.521_244], [9.223_81, 6.2695, 4.837])),
    ("beryllium", rgb_metal([4.185_01, 3.185_03, 2.784_06], [3.835_47, 3.010_12, 2.868_99])),
    ("chromium", rgb_metal([4.369_67, 2.916_51, 1.6549], [5.206_55, 4.231_31, 3.7547])),
    ("copper", rgb_metal([0.201_005, 0.923_75, 1.102_22], [3.913_26, 2.453_05, 2.142_09])),
    ("gold", rgb_metal([0.143_036, 0.375_307, 1.442_05], [3.983, 2.385_56, 1.603_36])),
    ("iridium", rgb_metal([3.0863, 2.082_19, 1.617_91], [5.592_15, 4.067_09, 3.267_31])),
    ("molybdenum", rgb_metal([4.483_97, 3.525_13, 2.776_31], [4.111_44, 3.420_83, 3.150_61])),
    ("niobium", rgb_metal([3.420_07, 2.790_09, 2.395_63], [3.441_39, 2.737_67, 2.579_75])),
    ("rhodium", rgb_metal([2.585_79, 1.860_22, 1.554_26], [6.782_26, 4.702_99, 3.976_07])),
    ("silver", rgb_metal([0.155_276, 0.116_728, 0.138_388], [4.828_35, 3.122_22, 2.1469])),
    ("tantalum", rgb_metal([2.062_72, 2.392_94, 2.627_93], [2.408_36, 1.741_49, 1.947_03])),
    ("titanium-nitride", rgb_metal([1.648_45, 1.150_52, 1.379_82], [3.368_33, 1.9435, 1.102_07])),
    ("tungsten", rgb_metal([4.370_82, 3.300_25, 2.998_41], [3.500_64, 2.604_87, 2.273_23])),
];

/// The metal of the key `name`.
pub(super) fn measured_metal(fields: &Fields) -> Option<MeasuredMetal> {
    let found = fields.choice("name", &METALS);
    let name = fields.string("name").map_or("", |name| name.value);
    let found = found.map(|found| MeasuredMetal { metal: Metal::named(name), ..found });
    if found.is_some() && fields.has("color") {
        fields.report("'name' gives the metal its colour: leave 'color' out");
    }
    found
}

fn read_hair(fields: &Fields, mut slot: impl FnMut(&'static str, f32) -> ColorSlot) -> Model {
    let fraction = |key, default| fields.number_in(key, 0.0..1.0, default) as f32;
    let radial = fraction("radial_roughness", 0.3);
    fields.exclusive(["color", "melanin", "absorption"]);
    if fields.has("melanin_redness") && !fields.has("melanin") {
        fields.report("'melanin_redness' needs 'melanin'");
    }
    let color = if fields.has("melanin") {
        let absorption = absorption_of_melanin(fraction("melanin", 0.5), fraction("melanin_redness", 0.5));
        ColorSlot::constant(hair_color(absorption, radial))
    } else if let Some(absorption) = fields.color("absorption") {
        ColorSlot::constant(hair_color(absorption.value, radial))
    } else {
        slot("color", 0.8)
    };
    Model::Hair {
        color,
        roughness: FloatSlot::constant(fraction("roughness", 0.3)),
        radial_roughness: FloatSlot::constant(radial),
        ior: fields.number_in("ior", 1.0..3.0, 1.55) as f32,
        tilt_rad: fields.number_in("tilt", -45.0..45.0, 2.0).to_radians() as f32,
        coat: FloatSlot::constant(fraction("coat", 0.0)),
    }
}

/// Absorption coefficient per fibre radius of eumelanin (brown) and pheomelanin (red), with Cycles' mapping of `melanin` and
/// `redness`, 0 to 1, to concentrations.
fn absorption_of_melanin(melanin: f32, redness: f32) -> [f32; 3] {
    let amount = -(1.0 - melanin).max(1e-4).ln();
    let (brown, red) = (amount * (1.0 - redness), amount * redness);
    let of = |brown_unit: f32, red_unit: f32| brown * brown_unit + red * red_unit;
    [of(0.506, 0.343), of(0.841, 0.733), of(1.653, 1.924)]
}

/// The displacement of a material; adds its texture to the scene. `checks_only`: open no image.
fn read_displacement(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    checks_only: bool,
) -> Option<Displacement> {
    let table = fields.table("displacement")?;
    let image = table.require("image", table.string("image"));
    let scale = table.require("scale", table.number("scale"));
    let midlevel = table.number("midlevel").map_or(0.5, |m| m.value as f32);
    let edge = table.number_in("edge", 1e-9..f64::from(f32::MAX), 0.0) as f32;
    let mapping = uv_mapping(&table, &WRAPS);
    table.finish();
    let (image, scale) = (image?, scale?);
    if checks_only {
        return None;
    }
    let image = read_pixels(build, image.value, image.span, Use::Data)?;
    let texture = (mapping.texture(build, image), 0);
    let kind = DisplacementKind::Heights { scale: scale.value as f32, midlevel, edge };
    Some(Displacement { texture, kind })
}

/// Wrap mode and repetitions of an image.
struct UvMapping {
    wrap: Wrap,
    /// Repetitions along u and v.
    repeat: [f64; 2],
}

fn uv_mapping(table: &Fields, wraps: &[(&'static str, Wrap)]) -> UvMapping {
    let wrap = table.choice("wrap", wraps).unwrap_or(Wrap::Repeat);
    UvMapping { wrap, repeat: table.numbers::<2>("repeat").map_or([1.0; 2], |r| r.value) }
}

impl UvMapping {
    /// Adds the image as a texture to the scene.
    fn texture(&self, build: &mut SceneFileBuilder, image: ImageId) -> TextureId {
        let scale = Vec2::new(self.repeat[0] as f32, self.repeat[1] as f32);
        let transform = TextureTransform { scale, ..Default::default() };
        build.loaded.scene.add_texture(Texture::Image {
            image,
            wrap_u: self.wrap,
            wrap_v: self.wrap,
            interpolation: Interpolation::Bilinear,
            mapping: Mapping::Uv { set: 0, transform },
        })
    }
}

/// The node texture that `normal` names, for shading normals.
fn read_normal<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    textures: &mut Textures<'a>,
) -> Option<TextureId> {
    let value = fields.raw("normal")?;
    let id = textures.get(build, value.get_ref().as_str()?, value.span())?;
    let texture = build.loaded.scene.textures.get(id.index());
    if !textures.checks_only() && !matches!(texture, Some(Texture::Nodes(_))) {
        let help = "'normal' is the name of a texture of type \"nodes\", or { image = \"normals.png\" }";
        fields.problems.push_help(value.span(), "this texture has no normals", help);
    }
    Some(id)
}

/// The normal map of a material, from the image of `normal` or `bump`. `checks_only`: open no image.
pub(super) fn read_normal_map(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    checks_only: bool,
) -> Option<NormalMap> {
    fields.exclusive(["normal", "bump"]);
    if fields.raw("normal").is_some_and(|value| value.get_ref().is_str()) {
        return None;
    }
    let (key, is_height) = if fields.has("bump") { ("bump", true) } else { ("normal", false) };
    let table = fields.table(key)?;
    let image = table.require("image", table.string("image"));
    let scale = table.number_in("scale", -1000.0..1000.0, 1.0) as f32;
    // The normals of mirrored heights would need mirrored slopes, which the normal map can't represent.
    let mapping = uv_mapping(&table, if is_height { &[WRAPS[0], WRAPS[2]] } else { &WRAPS });
    table.finish();
    let (name, span) = image.map(|image| (image.value, image.span))?;
    if checks_only {
        return None;
    }
    if !is_height {
        let image = read_image(build, name, span, Use::Data)?;
        return Some(NormalMap { texture: mapping.texture(build, image), scale });
    }
    let mut image = read_pixels(build, name, span, Use::Data)?;
    let heights = &build.loaded.scene.images[image.index()];
    if holds_normals(heights) {
        let message = format!("'{name}' of 'bump' looks like a normal map: use 'normal' instead of 'bump'");
        build.loaded.warnings.push(Warning::new(build.file, "", message));
    }
    let normals = normals_of_heights(heights, scale * BUMP_HEIGHT);
    image = build.loaded.scene.add_image(normals);
    Some(NormalMap { texture: mapping.texture(build, image), scale: 1.0 })
}

/// A material of the model with changed parameters; `None` if it is unlit, which is reported.
pub(super) fn adjust_material<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    index: usize,
) -> Option<Material> {
    let mut material = build.loaded.scene.materials[index].clone();
    let Model::Pbr(mut model) = material.model.clone() else {
        let message = format!("material '{}' of the model is unlit and has no parameters", material.name);
        fields.report_help(message, "give it a 'type'");
        return None;
    };
    let medium = media::read(build, textures, fields, "medium");
    let slots = &mut Slots { build, textures, fields, adjusts_model: true };
    pbr::adjust((&mut material, &mut model), medium, slots);
    let modes = [
        ("opaque", AlphaMode::Opaque),
        ("mask", AlphaMode::Mask { cutoff: 0.5 }),
        ("blend", AlphaMode::Blend),
    ];
    if let Some(mode) = fields.choice("alpha", &modes) {
        if material.alpha_mode == AlphaMode::Opaque {
            material.alpha = pbr::alpha_of(&material, &model);
        }
        material.alpha_mode = mode;
    }
    if fields.has("visible_to") || fields.has("visible_to_camera") {
        let emitter_traits = material.emitter_traits.unwrap_or_default();
        material.emitter_traits = Some(EmitterTraits {
            visible_to: visible_to(fields, emitter_traits.visible_to),
            ..emitter_traits
        });
    }
    material.displacement = read_displacement(build, fields, false).or(material.displacement);
    material.normal_map = read_normal_map(build, fields, false).or(material.normal_map);
    material.normal = read_normal(build, fields, textures).or(material.normal);
    material.priority = media::priority(fields).unwrap_or(material.priority);
    fields.finish();
    Some(Material { model: Model::Pbr(model), ..material })
}

/// Reports an unknown material if the name is a misspelling of one of the model's; returns whether it did.
fn report_misspelling(build: &SceneFileBuilder, name: &str, span: Range<usize>) -> bool {
    let near = nearest(name, build.loaded.scene.materials.iter().map(|m| m.name.as_str()));
    if let Some(near) = near {
        let message = format!("there is no material '{name}'");
        build.problems.push_help(span, message, format!("did you mean '{near}' of the model?"));
    }
    near.is_some()
}

/// Warns of a material table that matches no material of the model and is used by no object.
fn warn_of_unused_table(build: &mut SceneFileBuilder, name: &str) {
    let names = build.loaded.scene.materials.iter().map(|m| m.name.as_str());
    let help = nearest(name, names).map_or_else(String::new, |near| format!(" (did you mean '{near}'?)"));
    build.warn(format!("the model has no material '{name}' and no object uses it{help}"));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One minus the mean cosine of the GGX lobe at normal incidence, by inverting its CDF of normals at quantiles
    /// 1 - e^-x, which resolve the long tail.
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
