//! Edits of materials, lights and environment on the page, and saving them to a scene file or a sidecar.

use crate::cli::toml_names::{key, quoted};
use oscura::scene::{
    ColorSlot, Emission, Environment, FloatSlot, Light, Material, Model, PbrMaterial, Scene,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Maximum emission, W/sr/m2.
const MAX_EMISSION: f32 = 1e4;

/// New values of a material; `None` keeps the value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct MaterialEdit {
    /// Linear Rec. 709, 0..1.
    pub base_color: Option<[f32; 3]>,
    /// 0..1.
    pub roughness: Option<f32>,
    /// 0..1.
    pub metallic: Option<f32>,
    /// Largest component of the radiance, W/sr/m2; the hue is the material's, else white.
    pub emission: Option<f32>,
}

impl MaterialEdit {
    /// Whether all numbers are in range.
    pub fn is_valid(&self) -> bool {
        let fractions = self.base_color.iter().flatten().chain(&self.roughness).chain(&self.metallic);
        fractions.into_iter().all(|v| (0.0..=1.0).contains(v))
            && self.emission.is_none_or(|v| (0.0..=MAX_EMISSION).contains(&v))
    }

    /// Merges with an earlier edit; this edit has precedence.
    fn after(self, earlier: MaterialEdit) -> MaterialEdit {
        MaterialEdit {
            base_color: self.base_color.or(earlier.base_color),
            roughness: self.roughness.or(earlier.roughness),
            metallic: self.metallic.or(earlier.metallic),
            emission: self.emission.or(earlier.emission),
        }
    }
}

/// A material on the page: its values, and the names of textured ones, whose texture an edit replaces.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct MaterialInfo {
    pub name: String,
    /// Linear; a texture multiplies it.
    pub base_color: [f32; 3],
    pub roughness: f32,
    pub metallic: f32,
    pub emission: f32,
    pub textures: Vec<&'static str>,
    pub is_editable: bool,
    /// Whether it is the surface of a light.
    pub is_light: bool,
}

impl MaterialInfo {
    pub fn of(material: &Material) -> MaterialInfo {
        let own = pbr(material);
        let is_editable = own.is_some() && !material.name.is_empty() && !material.is_light;
        let model = own.unwrap_or_default();
        let radiance = material.emission.as_ref().map(|emission| emission.radiance);
        let textured = [
            ("base_color", model.base_color.texture.is_some()),
            ("roughness", model.roughness.texture.is_some()),
            ("metallic", model.metallic.texture.is_some()),
            ("emission", radiance.is_some_and(|radiance| radiance.texture.is_some())),
        ];
        MaterialInfo {
            name: material.name.clone(),
            base_color: model.base_color.factor,
            roughness: model.roughness.factor,
            metallic: model.metallic.factor,
            emission: radiance.map_or(0.0, |radiance| largest(radiance.factor)),
            textures: textured.into_iter().filter(|(_, is)| *is).map(|(key, _)| key).collect(),
            is_editable,
            is_light: material.is_light,
        }
    }
}

/// The parameters of an editable material; diffuse and emissive ones are converted to equivalent glTF materials.
fn pbr(material: &Material) -> Option<PbrMaterial> {
    match &material.model {
        Model::Pbr(model) => Some((**model).clone()),
        Model::Lambert { albedo } => Some(PbrMaterial {
            base_color: *albedo,
            metallic: FloatSlot::constant(0.0),
            roughness: FloatSlot::constant(1.0),
            specular: FloatSlot::constant(0.0),
            ..PbrMaterial::default()
        }),
        Model::Black if material.emission.is_some() => Some(PbrMaterial {
            base_color: ColorSlot::constant([0.0; 3]),
            metallic: FloatSlot::constant(0.0),
            specular: FloatSlot::constant(0.0),
            ..PbrMaterial::default()
        }),
        _ => None,
    }
}

fn largest(rgb: [f32; 3]) -> f32 {
    rgb.into_iter().fold(0.0, f32::max)
}

/// The radiance with this largest component and the material's hue.
fn radiance(material: &Material, strength: f32) -> [f32; 3] {
    let own = material.emission.as_ref().map_or([1.0; 3], |emission| emission.radiance.factor);
    match largest(own) {
        0.0 => [strength; 3],
        max => own.map(|v| v / max * strength),
    }
}

/// New values of a light; `None` keeps the value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct LightEdit {
    /// In the light's unit; multiplied by `color`.
    pub strength: Option<f32>,
    /// Linear Rec. 709, 0..1.
    pub color: Option<[f32; 3]>,
}

impl LightEdit {
    /// Whether all numbers are in range.
    pub fn is_valid(&self) -> bool {
        self.color.iter().flatten().all(|v| (0.0..=1.0).contains(v))
            && self.strength.is_none_or(|v| (0.0..=1e12).contains(&v))
    }

    /// Merges with an earlier edit; this edit has precedence.
    fn after(self, earlier: LightEdit) -> LightEdit {
        LightEdit { strength: self.strength.or(earlier.strength), color: self.color.or(earlier.color) }
    }
}

/// A light on the page; for several lights with the same name, the values of the first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LightInfo {
    pub name: String,
    /// The largest component.
    pub strength: f32,
    /// Linear, its largest component 1.
    pub color: [f32; 3],
    pub unit: &'static str,
    /// Key of the strength in files.
    #[serde(skip)]
    key: &'static str,
}

impl LightInfo {
    fn new(name: &str, value: [f32; 3], (key, unit): (&'static str, &'static str)) -> LightInfo {
        let strength = largest(value);
        let color = if strength > 0.0 { value.map(|v| v / strength) } else { [1.0; 3] };
        LightInfo { name: name.to_string(), strength, color, unit, key }
    }

    /// All named lights, without the environment's sun.
    pub fn all(scene: &Scene) -> Vec<LightInfo> {
        let is_own = |(i, _): &(usize, &Light)| scene.environment_sun != Some(*i as u32);
        let punctual = scene.lights.iter().enumerate().filter(is_own).map(|(_, light)| {
            let quantity =
                if light.kind.position().is_some() { ("intensity", "W/sr") } else { ("irradiance", "W/m²") };
            LightInfo::new(&light.name, light.intensity, quantity)
        });
        let surfaces = scene.materials.iter().filter(|material| material.is_light).filter_map(|material| {
            let value = material.emission.as_ref()?.radiance.factor;
            Some(LightInfo::new(&material.name, value, ("radiance", "W/sr/m²")))
        });
        let mut all: Vec<LightInfo> = Vec::new();
        for light in punctual.chain(surfaces) {
            if !light.name.is_empty() && all.iter().all(|other| other.name != light.name) {
                all.push(light);
            }
        }
        all
    }

    /// The light after an edit.
    fn changed(&self, edit: LightEdit) -> LightInfo {
        let (strength, color) = (edit.strength.unwrap_or(self.strength), edit.color.unwrap_or(self.color));
        LightInfo { strength, color, ..self.clone() }
    }

    /// An edit as a table of a scene file.
    fn table(&self, edit: LightEdit) -> Table {
        let strength = edit.strength.map(|v| (self.key, number(v)));
        let lines = strength.into_iter().chain(edit.color.map(|rgb| ("color", color(rgb)))).collect();
        Table { header: "[[lights]]".to_string(), name: Some(quoted(&self.name)), lines }
    }
}

/// All edits, by the names of materials and lights.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Edits {
    materials: BTreeMap<String, MaterialEdit>,
    lights: BTreeMap<String, LightEdit>,
}

impl Edits {
    /// Whether a material was edited.
    pub fn has(&self, name: &str) -> bool {
        self.materials.contains_key(name)
    }

    pub fn change(&mut self, name: String, edit: MaterialEdit) {
        let own = self.materials.entry(name).or_default();
        *own = edit.after(*own);
    }

    pub fn change_light(&mut self, name: String, edit: LightEdit) {
        let own = self.lights.entry(name).or_default();
        *own = edit.after(*own);
    }

    /// The edited materials, including surfaces of lights.
    pub fn applied(&self, own: &[Material]) -> Vec<Material> {
        let changed = |material: &Material| match (material.is_light, self.materials.get(&material.name)) {
            (true, _) => self.changed_surface(material),
            (false, Some(edit)) => changed(material, *edit),
            (false, None) => material.clone(),
        };
        own.iter().map(changed).collect()
    }

    fn changed_surface(&self, own: &Material) -> Material {
        let mut material = own.clone();
        if let (Some(edit), Some(emission)) = (self.lights.get(&own.name), &mut material.emission) {
            emission.radiance.factor = changed_light(emission.radiance.factor, *edit);
        }
        material
    }

    /// Applies the edits to lights without a surface, except the environment's sun; `own` are the lights before all edits.
    pub fn change_lights(&self, scene: &mut Scene, own: &[Light]) {
        let sun = scene.environment_sun;
        for (i, (light, own)) in scene.lights.iter_mut().zip(own).enumerate() {
            if sun != Some(i as u32) {
                let edit = self.lights.get(&own.name).copied().unwrap_or_default();
                light.intensity = changed_light(own.intensity, edit);
            }
        }
    }

    /// The edited lights.
    pub fn light_infos(&self, own: &[LightInfo]) -> Vec<LightInfo> {
        let changed =
            |light: &LightInfo| light.changed(self.lights.get(&light.name).copied().unwrap_or_default());
        own.iter().map(changed).collect()
    }

    /// The edits as tables of a scene file; `own` and `lights` are the values before all edits.
    pub fn tables(&self, own: &[Material], lights: &[LightInfo]) -> Vec<Table> {
        let material_table = |(name, edit): (&String, &MaterialEdit)| {
            let material = own.iter().find(|material| material.name == *name && !material.is_light)?;
            let header = format!("[materials.{}]", key(name));
            Some(Table { header, name: None, lines: lines(material, *edit) })
        };
        let light_table = |(name, edit): (&String, &LightEdit)| {
            Some(lights.iter().find(|light| light.name == *name)?.table(*edit))
        };
        let materials = self.materials.iter().filter_map(material_table);
        materials.chain(self.lights.iter().filter_map(light_table)).collect()
    }
}

/// The intensity or radiance of a light after an edit.
fn changed_light(own: [f32; 3], edit: LightEdit) -> [f32; 3] {
    if edit == LightEdit::default() {
        return own;
    }
    let light = LightInfo::new("", own, ("", "")).changed(edit);
    light.color.map(|v| v * light.strength)
}

fn changed(material: &Material, edit: MaterialEdit) -> Material {
    let Some(mut model) = pbr(material) else { return material.clone() };
    model.base_color = edit.base_color.map_or(model.base_color, ColorSlot::constant);
    model.roughness = edit.roughness.map_or(model.roughness, FloatSlot::constant);
    model.metallic = edit.metallic.map_or(model.metallic, FloatSlot::constant);
    let mut material = material.clone();
    if let Some(strength) = edit.emission {
        let two_sided =
            material.emission.as_ref().map_or(material.double_sided, |emission| emission.two_sided);
        let radiance = ColorSlot::constant(radiance(&material, strength));
        material.emission = Some(Emission { radiance, two_sided });
    }
    // The model is kept if only the colour or the emission changes.
    let keeps_model = edit.roughness.is_none() && edit.metallic.is_none();
    material.model = match material.model {
        Model::Lambert { .. } if keeps_model => Model::Lambert { albedo: model.base_color },
        Model::Black if keeps_model && edit.base_color.is_none() => Model::Black,
        _ => Model::Pbr(Box::new(model)),
    };
    material
}

/// A TOML table: header, keys and values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table {
    header: String,
    /// Value of the key `name`, for entries of lists.
    name: Option<String>,
    lines: Vec<(&'static str, String)>,
}

impl Table {
    fn text(&self) -> String {
        let name = self.name.iter().map(|name| format!("name = {name}\n"));
        let lines = self.lines.iter().map(|(key, value)| format!("{key} = {value}\n"));
        format!("{}\n{}", self.header, name.chain(lines).collect::<String>())
    }

    /// The index of the table's header line in a file.
    fn position(&self, lines: &[String]) -> Option<usize> {
        let is_header = |line: &String| line.split('#').next().unwrap_or("").trim() == self.header;
        let mut headers = (0..lines.len()).filter(|&at| is_header(&lines[at]));
        let Some(name) = &self.name else { return headers.next() };
        // Only entries that change a light, not those that add it.
        headers.find(|&at| {
            let end = end_of(lines, at);
            let own = |key: &str| lines[at + 1..end].iter().find_map(|line| value_of(line, key));
            let is_added = ["area", "point", "spot", "sun"].iter().any(|shape| {
                let table = format!("[lights.{shape}]");
                own(shape).is_some() || lines.get(end).is_some_and(|line| line.trim() == table)
            });
            own("name").is_some_and(|own| own.split('#').next().unwrap_or("").trim() == name) && !is_added
        })
    }
}

/// The index of the line after the table with its header at line `at`.
fn end_of(lines: &[String], at: usize) -> usize {
    let next = lines[at + 1..].iter().position(|line| line.trim_start().starts_with('['));
    next.map_or(lines.len(), |n| at + 1 + n)
}

fn value_of<'l>(line: &'l str, key: &str) -> Option<&'l str> {
    line.split_once('=').filter(|(own, _)| own.trim() == key).map(|(_, value)| value)
}

pub(crate) fn text(tables: &[Table]) -> String {
    tables.iter().map(Table::text).collect::<Vec<_>>().join("\n")
}

fn number(v: f32) -> String {
    format!("{v:?}")
}

fn color(rgb: [f32; 3]) -> String {
    format!("[{:?}, {:?}, {:?}]", rgb[0], rgb[1], rgb[2])
}

/// The keys of an edited material: the changed ones, or all if it is not a glTF material.
fn lines(material: &Material, edit: MaterialEdit) -> Vec<(&'static str, String)> {
    let changed = changed(material, edit);
    let mut lines: Vec<(&'static str, String)> = Vec::new();
    let needs_all = !matches!(material.model, Model::Pbr(_));
    match &changed.model {
        Model::Pbr(model) if needs_all => {
            lines.push(("type", "\"pbr\"".to_string()));
            lines.push(("base_color", color(model.base_color.factor)));
            lines.push(("metallic", number(model.metallic.factor)));
            lines.push(("roughness", number(model.roughness.factor)));
            lines.push(("specular", number(model.specular.factor)));
        }
        Model::Lambert { albedo } => {
            lines.push(("type", "\"lambert\"".to_string()));
            lines.push(("color", color(albedo.factor)));
        }
        Model::Black => lines.push(("type", "\"emissive\"".to_string())),
        _ => {
            lines.extend(edit.base_color.map(|rgb| ("base_color", color(rgb))));
            lines.extend(edit.metallic.map(|v| ("metallic", number(v))));
            lines.extend(edit.roughness.map(|v| ("roughness", number(v))));
        }
    }
    if let Some(emission) = changed.emission.filter(|_| needs_all || edit.emission.is_some()) {
        let key = if matches!(changed.model, Model::Black) { "radiance" } else { "emission" };
        lines.push((key, color(emission.radiance.factor)));
    }
    lines
}

/// Merges tables into the text of a file: keys of existing tables are replaced or added, new tables are appended. The rest,
/// including comments, is unchanged.
pub(crate) fn merged(file: &str, tables: &[Table]) -> String {
    let mut lines: Vec<String> = file.lines().map(str::to_string).collect();
    for table in tables {
        match table.position(&lines) {
            Some(at) => set_keys(&mut lines, at, table),
            None => {
                if lines.last().is_some_and(|line| !line.trim().is_empty()) {
                    lines.push(String::new());
                }
                lines.extend(table.text().lines().map(str::to_string));
            }
        }
    }
    lines.join("\n") + "\n"
}

/// Replaces and adds keys of the table with its header at line `at`.
fn set_keys(lines: &mut Vec<String>, at: usize, table: &Table) {
    for (key, value) in &table.lines {
        let end = end_of(lines, at);
        let has_key = |line: &String| value_of(line, key).is_some();
        let own = lines[at + 1..end].iter().position(has_key).map(|n| at + 1 + n);
        let new = format!("{key} = {value}");
        match own {
            Some(own) => lines[own] = new,
            None => {
                let blank = lines[at + 1..end].iter().rev().take_while(|line| line.trim().is_empty()).count();
                lines.insert(end - blank, new);
            }
        }
    }
}

/// Scales the environment and its sun from the strength `before` to `strength`, as `--env-strength` does.
pub(crate) fn set_environment_strength(scene: &mut Scene, before: f64, strength: f64) {
    let ratio = (strength / before) as f32;
    let scaled = |rgb: [f32; 3]| rgb.map(|v| v * ratio);
    match &mut scene.environment {
        Environment::Image { strength, .. } => *strength *= ratio,
        Environment::Constant(color) => *color = scaled(*color),
        Environment::Gradient { nadir, zenith } => (*nadir, *zenith) = (scaled(*nadir), scaled(*zenith)),
        Environment::Black => {}
    }
    scene.scale_environment_sun(ratio);
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::math::DVec3;
    use oscura::scene::LightKind;

    fn edits(name: &str, edit: MaterialEdit) -> Edits {
        let mut edits = Edits::default();
        edits.change(name.to_string(), edit);
        edits
    }

    #[test]
    fn edits_of_a_material_are_merged() {
        let own = [Material::gltf("a", PbrMaterial::default()), Material::lambert("b", [0.5; 3])];
        let mut both = edits("a", MaterialEdit { roughness: Some(0.25), ..MaterialEdit::default() });
        both.change("a".to_string(), MaterialEdit { metallic: Some(1.0), ..MaterialEdit::default() });
        both.change(
            "b".to_string(),
            MaterialEdit { base_color: Some([1.0, 0.0, 0.0]), ..MaterialEdit::default() },
        );
        let after = both.applied(&own);
        let Model::Pbr(model) = &after[0].model else { panic!("it is a glTF material") };
        assert_eq!((model.roughness.factor, model.metallic.factor), (0.25, 1.0));
        assert_eq!(after[1].model, Model::Lambert { albedo: ColorSlot::constant([1.0, 0.0, 0.0]) });
        assert_eq!(Edits::default().applied(&own), own);
        let words = text(&both.tables(&own, &[]));
        assert_eq!(
            words,
            "[materials.a]\nmetallic = 1.0\nroughness = 0.25\n\n[materials.b]\ntype = \"lambert\"\ncolor = [1.0, 0.0, 0.0]\n"
        );
    }

    #[test]
    fn merging_keeps_the_rest_of_the_file() {
        let own = [Material::gltf("a b", PbrMaterial::default())];
        let edits = edits(
            "a b",
            MaterialEdit { roughness: Some(0.5), emission: Some(2.0), ..MaterialEdit::default() },
        );
        let tables = edits.tables(&own, &[]);
        let file =
            "# Mine.\n[materials.\"a b\"] # paint\nroughness = 0.1\nior = 1.6\n\n[render]\nsamples = 4\n";
        let text = merged(file, &tables);
        assert_eq!(
            text,
            "# Mine.\n[materials.\"a b\"] # paint\nroughness = 0.5\nior = 1.6\nemission = [2.0, 2.0, 2.0]\n\n[render]\nsamples = 4\n"
        );
        assert_eq!(merged(&text, &tables), text, "once more changes nothing");
        assert!(
            merged("[render]\nsamples = 4", &tables)
                .ends_with("\n\n[materials.\"a b\"]\nroughness = 0.5\nemission = [2.0, 2.0, 2.0]\n")
        );
        assert_eq!(merged("", &tables), super::text(&tables));
    }

    #[test]
    fn lights_are_edited_by_name_and_entries_that_add_them_are_kept() {
        let lamp = |name: &str, direction: Option<DVec3>, intensity| {
            let kind = match direction {
                Some(direction) => LightKind::Directional { direction },
                None => LightKind::Point { position: DVec3::ZERO },
            };
            Light { name: name.to_string(), ..Light::new(kind, intensity) }
        };
        let lights = vec![
            lamp("a", None, [4.0, 2.0, 1.0]),
            lamp("a", None, [1.0, 1.0, 1.0]),
            lamp("sky", Some(DVec3::NEG_Y), [3.0; 3]),
            lamp("sun", Some(DVec3::NEG_Y), [0.0; 3]),
        ];
        let surface = Material { is_light: true, ..Material::emitter("key", [2.0, 2.0, 1.0], false) };
        let own = [Material::emitter("key", [1.0; 3], false), surface];
        let scene = Scene {
            lights: lights.clone(),
            materials: own.to_vec(),
            environment_sun: Some(2),
            ..Scene::default()
        };
        let infos = LightInfo::all(&scene);
        let found: Vec<_> = infos.iter().map(|i| (i.name.as_str(), i.strength, i.color[1], i.key)).collect();
        assert_eq!(
            found,
            [("a", 4.0, 0.5, "intensity"), ("sun", 0.0, 1.0, "irradiance"), ("key", 2.0, 1.0, "radiance")]
        );

        let mut edits = Edits::default();
        edits.change_light("a".to_string(), LightEdit { strength: Some(8.0), color: None });
        edits.change_light("key".to_string(), LightEdit { strength: Some(1.0), color: None });
        edits.change_light("key".to_string(), LightEdit { strength: None, color: Some([1.0, 0.0, 0.5]) });
        edits.change_light("sky".to_string(), LightEdit { strength: Some(1.0), color: None });
        let mut after = scene.clone();
        edits.change_lights(&mut after, &lights);
        let intensities: Vec<_> = after.lights.iter().map(|light| light.intensity).collect();
        assert_eq!(
            intensities,
            [[8.0, 4.0, 2.0], [8.0, 8.0, 8.0], [3.0; 3], [0.0; 3]],
            "the environment's sun stays"
        );
        let materials = edits.applied(&own);
        assert_eq!(materials[0], own[0], "of the same name, but none of a light");
        assert_eq!(materials[1].emission.as_ref().unwrap().radiance.factor, [1.0, 0.0, 0.5]);

        let tables = edits.tables(&own, &infos);
        let a = "[[lights]]\nname = \"a\"\nintensity = 8.0\n";
        let key = "[[lights]]\nname = \"key\"\nradiance = 1.0\ncolor = [1.0, 0.0, 0.5]\n";
        assert_eq!(text(&tables), format!("{a}\n{key}"));
        let file = "[[lights]]\nname = \"key\"\narea = { node = \"Area\" }\n[[lights]]\nname = \"a\"\n[lights.point]\npower = 3\n";
        let saved = merged(file, &tables);
        assert_eq!(saved, format!("{file}\n{a}\n{key}"), "changes come after what they change");
        assert_eq!(merged(&saved, &tables), saved, "once more changes nothing");
        assert_eq!(merged(&saved.replace("8.0", "2"), &tables), saved);
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        let is_valid = |edit: MaterialEdit| edit.is_valid();
        assert!(is_valid(MaterialEdit {
            base_color: Some([0.0, 0.5, 1.0]),
            emission: Some(10.0),
            ..MaterialEdit::default()
        }));
        assert!(!is_valid(MaterialEdit { roughness: Some(1.5), ..MaterialEdit::default() }));
        assert!(!is_valid(MaterialEdit {
            base_color: Some([0.0, f32::NAN, 1.0]),
            ..MaterialEdit::default()
        }));
        assert!(!is_valid(MaterialEdit { emission: Some(-1.0), ..MaterialEdit::default() }));
    }
}
