//! Ray visibility of objects and lights: `visible_to`, a list of ray types among `camera`, `diffuse`, `glossy`,
//! `transmission`, `volume` and `shadow`; by default all. Other rays pass through objects, and lights are
//! invisible to them. `visible_to_camera = false` removes `camera`. Without `shadow` an object casts no shadow. With
//! `holdout = true` the picture is transparent where the camera sees the object; with `shadow_catcher = true` it shows there only
//! the shadows and light of other objects.
//!
//! `color = [r, g, b]` or `[r, g, b, alpha]` (white), `index` (0) and `random` (0 to 1; a hash of the name) are the outputs of nodes of
//! type `object_info`.
//!
//! # linking
//!
//! `light_link = { include = ["Figure"] }` restricts a light to these objects, `{ exclude = ["Floor"] }` to all others;
//! `shadow_link` likewise selects the objects that cast shadows in its light. With both lists, objects of `include` that
//! are not in `exclude`. Lights and emissive objects may have links. Names are those of objects of the file or of nodes of a model,
//! including their descendants; a leading slash restricts a name to root nodes.
//!
//! The receiver is the surface of the last scattering event: mirrors show a light that they are not linked to as
//! black, cameras see it. Fog and other media are in no list: they attenuate all lights but those without shadow casters
//! (`shadow_link = { include = [] }`). Lights with a `shadow_link` light rough surfaces by light sampling only.

use super::builder::{Names, NamesOnPaths, SceneFileBuilder};
use super::fields::{Fields, numbers, suggestion};
use super::transform::{EvaluatedMotion, MovingPlacement};
use crate::scene::{
    EmitterTraits, LightLinks, Link, ObjectInfo, ObjectSet, ObjectSets, ObjectTraits, RayKinds, Scene,
    is_group_name,
};
use std::collections::{HashMap, HashSet};

/// The ray types of `visible_to` and `visible_to_camera`; `default` if the table has neither.
pub(super) fn visible_to(fields: &Fields, default: RayKinds) -> RayKinds {
    let listed = fields.list("visible_to").map(|list| {
        list.iter().fold(RayKinds::NONE, |sum, value| {
            match value.get_ref().as_str().and_then(RayKinds::from_name) {
                Some(kind) => sum.with(kind),
                None => {
                    let help = format!("one of: {}", RayKinds::NAMED.map(|(name, _)| name).join(", "));
                    fields.problems.push_help(value.span(), "'visible_to' must be a list of ray types", help);
                    sum
                }
            }
        })
    });
    let kinds = listed.unwrap_or(default);
    let is_visible = fields.flag("visible_to_camera", kinds.contains(RayKinds::CAMERA));
    kinds.set(RayKinds::CAMERA, is_visible)
}

/// Visibility and light links of a table.
pub(super) struct TraitOverrides {
    /// Ray visibility, holdout and shadow catcher.
    pub traits: Option<ObjectTraits>,
    /// Links of the light that it emits.
    pub links: Option<LightLinks>,
}

impl TraitOverrides {
    /// Reads the keys of a table.
    pub fn read(build: &mut SceneFileBuilder, fields: &Fields) -> TraitOverrides {
        TraitOverrides { traits: traits(fields), links: read_links(build, fields) }
    }

    /// Overrides the traits for which the table has keys.
    pub fn apply(&self, traits: &mut ObjectTraits) {
        if let Some(overrides) = self.traits {
            *traits = ObjectTraits { links: traits.links, ..overrides };
        }
        traits.links = self.links.unwrap_or(traits.links);
    }
}

/// Ray visibility, holdout and shadow catcher of a table; `None` without any of the keys.
pub(super) fn traits(fields: &Fields) -> Option<ObjectTraits> {
    // Marks all keys as known.
    let given = ["visible_to", "visible_to_camera", "holdout", "shadow_catcher"].map(|key| fields.has(key));
    let visible_to = visible_to(fields, RayKinds::ALL);
    let is_holdout = fields.flag("holdout", false);
    let is_shadow_catcher = fields.flag("shadow_catcher", false);
    let traits = ObjectTraits { visible_to, is_holdout, is_shadow_catcher, ..ObjectTraits::default() };
    given.contains(&true).then_some(traits)
}

/// Outputs of `object_info` nodes; `None` without any of the keys.
pub(super) fn info(fields: &Fields) -> Option<ObjectInfo> {
    let given = ["color", "index", "random"].map(|key| fields.has(key));
    let mut info = ObjectInfo::default();
    if let Some(value) = fields.raw("color") {
        let rgb = numbers::<3>(value.get_ref()).map(|[r, g, b]| [r, g, b, 1.0]);
        match rgb.or_else(|| numbers::<4>(value.get_ref())) {
            Some(color) => info.color = color.map(|x| x as f32),
            None => fields.problems.push(value.span(), "'color' must be three or four numbers"),
        }
    }
    info.index = fields.number_in("index", -1e9..1e9, 0.0) as f32;
    info.random =
        fields.has("random").then(|| fields.number_in("random", 0.0..1.0 + f64::EPSILON, 0.0) as f32);
    given.contains(&true).then_some(info)
}

/// Links of a light or an emissive object; `None` without any of the keys.
pub(super) fn read_links(build: &mut SceneFileBuilder, fields: &Fields) -> Option<LightLinks> {
    let given = ["light_link", "shadow_link"].map(|key| fields.has(key));
    let receivers = link(build, fields, "light_link");
    let blockers = link(build, fields, "shadow_link");
    given.contains(&true).then_some(LightLinks { receivers, blockers })
}

fn link(build: &mut SceneFileBuilder, fields: &Fields, key: &'static str) -> Link {
    let Some(table) = fields.table(key) else { return Link::All };
    let (include, exclude) = (names(&table, "include"), names(&table, "exclude"));
    table.finish();
    match (include, exclude) {
        (None, None) => {
            fields.problems.push(table.span(), format!("'{key}' needs 'include' or 'exclude'"));
            Link::All
        }
        (None, Some(exclude)) => {
            build.linking.add(exclude, Vec::new(), &table).map_or(Link::All, Link::AllBut)
        }
        (Some(include), exclude) => {
            build.linking.add(include, exclude.unwrap_or_default(), &table).map_or(Link::All, Link::Only)
        }
    }
}

/// A list of names.
fn names(fields: &Fields, key: &'static str) -> Option<Names> {
    let list = fields.list(key)?;
    let name = |value: &toml::Spanned<toml::de::DeValue>| {
        let name = value.get_ref().as_str();
        if name.is_none() {
            fields.problems.push(value.span(), format!("'{key}' must hold names of objects"));
        }
        Some((name?.to_string(), value.span()))
    };
    Some(list.iter().filter_map(name).collect())
}

/// Resolves the names of linked objects, after all objects were read.
pub(super) fn resolve_links(build: &mut SceneFileBuilder) {
    let sets = build.linking.take();
    if sets.is_empty() {
        return;
    }
    let all = || sets.iter().flat_map(|set| set.include.iter().chain(&set.exclude));
    let known = NamesOnPaths::of(all().map(|(name, _)| name.as_str()));
    let found: HashSet<&str> =
        object_and_light_names(&build.loaded.scene).flat_map(|path| known.on_path(path)).collect();
    for (name, span) in all().filter(|(name, _)| !found.contains(name.as_str())) {
        let names = object_and_light_names(&build.loaded.scene).flat_map(|path| path.split('/'));
        let help = suggestion(name, names, "links name objects of the model or of the file".into());
        let message = ("unknown-object", format!("there is no object '{name}' to link to"));
        build.problems.push_help(span.clone(), message, help);
    }
    // Bit masks of the sets that include and that exclude each name.
    let mut masks_by_name: HashMap<&str, [u64; 2]> = HashMap::new();
    for (number, set) in sets.iter().enumerate().take(ObjectSet::COUNT) {
        for (which, names) in [&set.include, &set.exclude].into_iter().enumerate() {
            names.iter().for_each(|(name, _)| masks_by_name.entry(name).or_default()[which] |= 1 << number);
        }
    }
    let sets_of = |path: &str| {
        let [included, excluded] = known.on_path(path).fold([0; 2], |[a, b], name| {
            let [included, excluded] = masks_by_name[name];
            [a | included, b | excluded]
        });
        let members = (0..ObjectSet::COUNT).filter(|number| (included & !excluded) >> number & 1 != 0);
        members.filter_map(ObjectSet::new).fold(ObjectSets::NONE, ObjectSets::with)
    };
    build.loaded.scene.object_traits_mut().for_each(|(name, traits)| traits.sets = sets_of(name));
}

/// The names of all objects and lights: lights with a surface are receivers, too.
fn object_and_light_names(scene: &Scene) -> impl Iterator<Item = &str> {
    scene.object_names().chain(scene.lights.iter().map(|light| light.name.as_str()))
}

/// Keys common to all shapes of lights.
pub(super) struct LightTraits {
    pub name: String,
    pub color: [f32; 3],
    pub emitter: EmitterTraits,
    pub group: String,
    pub links: LightLinks,
    /// The placement by `transform`: `None` without the key, `Some(None)` if it is singular.
    pub placement: Option<Option<MovingPlacement>>,
    /// The motion of a light without `transform`.
    pub motion: Option<EvaluatedMotion>,
}

/// The name of a light group; empty without the key.
pub(super) fn group(fields: &Fields, key: &'static str) -> String {
    let Some(name) = fields.string(key) else { return String::new() };
    if !is_group_name(name.value) {
        let message = format!("'{}' is not a valid name of a light group", name.value);
        fields.problems.push_help(name.span, message, "use 1 to 64 letters, digits, _ and -");
    }
    name.value.to_string()
}

/// The strength of a light: `power` times `per_watt`, or the key `quantity`.
pub(super) fn strength(fields: &Fields, quantity: &'static str, per_watt: f64) -> Option<f64> {
    match (non_negative(fields, "power"), non_negative(fields, quantity)) {
        (Some(power), None) => Some(power * per_watt),
        (None, Some(value)) => Some(value),
        _ => {
            fields.report(format!("the light needs either 'power' or '{quantity}'"));
            None
        }
    }
}

/// A non-negative number.
pub(super) fn non_negative(fields: &Fields, key: &'static str) -> Option<f64> {
    fields.has(key).then(|| fields.number_in(key, 0.0..f64::from(f32::MAX), 0.0))
}
