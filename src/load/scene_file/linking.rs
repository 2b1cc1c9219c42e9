//! `light_link = { include = ["Figure"] }` has a light shine on these objects only, `{ exclude = ["Floor"] }` on all but these;
//! `shadow_link` says in the same way which objects cast shadows in its light. With both lists, those of the first that
//! are not in the second. Lights have them, and objects that shine. Names are those of objects of the file or of nodes of a model, and
//! mean all below these; with a slash before it, that of a node without a parent.
//!
//! What receives light is the surface where a path was scattered last: mirrors show a lamp that they are not linked to as
//! black, cameras see it. Fog and other media are in no list. Lamps with a `shadow_link` light rough surfaces by light samples only.

use super::build::Build;
use super::fields::{Fields, nearest};
use super::linked_sets::Names;
use super::node_paths::NamesOnPaths;
use crate::scene::{LightLinks, Link, ObjectSet, ObjectSets, Scene};
use std::collections::{HashMap, HashSet};

/// What a light or an object that shines is linked to; `None` where nothing is said.
pub(super) fn read(build: &mut Build, fields: &Fields) -> Option<LightLinks> {
    let given = ["light_link", "shadow_link"].map(|key| fields.has(key));
    let receivers = link(build, fields, "light_link");
    let blockers = link(build, fields, "shadow_link");
    given.contains(&true).then_some(LightLinks { receivers, blockers })
}

fn link(build: &mut Build, fields: &Fields, key: &'static str) -> Link {
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

/// Finds the objects of the names, once all are there.
pub(super) fn resolve(build: &mut Build) {
    let sets = build.linking.take();
    if sets.is_empty() {
        return;
    }
    let all = || sets.iter().flat_map(|set| set.include.iter().chain(&set.exclude));
    let known = NamesOnPaths::of(all().map(|(name, _)| name.as_str()));
    let found: HashSet<&str> = names_of(&build.loaded.scene).flat_map(|path| known.on_path(path)).collect();
    for (name, span) in all().filter(|(name, _)| !found.contains(name.as_str())) {
        let help = match nearest(name, names_of(&build.loaded.scene).flat_map(|path| path.split('/'))) {
            Some(near) => format!("did you mean '{near}'?"),
            None => "links name objects of the model or of the file".into(),
        };
        build.problems.push_help(span.clone(), format!("there is no object '{name}' to link to"), help);
    }
    // Each name with the sets that include it and those that exclude it, a bit for each.
    let mut of_names: HashMap<&str, [u64; 2]> = HashMap::new();
    for (number, set) in sets.iter().enumerate().take(ObjectSet::COUNT) {
        for (which, names) in [&set.include, &set.exclude].into_iter().enumerate() {
            names.iter().for_each(|(name, _)| of_names.entry(name).or_default()[which] |= 1 << number);
        }
    }
    let of_object = |path: &str| {
        let [included, excluded] = known.on_path(path).fold([0; 2], |[a, b], name| {
            let [included, excluded] = of_names[name];
            [a | included, b | excluded]
        });
        let held = (0..ObjectSet::COUNT).filter(|number| (included & !excluded) >> number & 1 != 0);
        held.filter_map(ObjectSet::new).fold(ObjectSets::NONE, ObjectSets::with)
    };
    build.loaded.scene.object_traits_mut().for_each(|(name, traits)| traits.sets = of_object(name));
}

/// The names of all that may be linked to; lamps may be, and nothing is lit of those without a surface.
fn names_of(scene: &Scene) -> impl Iterator<Item = &str> {
    scene.object_names().chain(scene.lights.iter().map(|light| light.name.as_str()))
}
