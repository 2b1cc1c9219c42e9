//! The scene under construction while a scene file is read.

use super::fields::{Fields, Problems};
use crate::error::{Choice, Message, Warning};
use crate::load::{LoadOptions, Loaded, ShutterOptions, files};
use crate::scene::{ObjectSet, Scene};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The scene under construction, with the context for reading a file's tables.
pub(super) struct SceneFileBuilder<'a> {
    /// The scene file, for relative paths and messages.
    pub file: &'a Path,
    /// Options of loading.
    pub options: &'a LoadOptions,
    /// Problems of the file.
    pub problems: &'a Problems<'a>,
    /// The user's shutter options, else the file's.
    pub shutter: ShutterOptions,
    /// The file is a sidecar, which may change parts of its model.
    pub is_sidecar: bool,
    /// Object sets of light linking.
    pub linking: Linking,
    /// Nodes of the model by name.
    pub nodes: NodeIndex,
    /// Names of materials that mixes use, and that are therefore not reported as unused.
    pub components: HashSet<String>,
    /// The scene so far.
    pub loaded: Loaded,
}

impl<'a> SceneFileBuilder<'a> {
    /// A builder that adds the contents of `file` to `loaded`.
    pub fn new(
        file: &'a Path,
        options: &'a LoadOptions,
        problems: &'a Problems<'a>,
        shutter: ShutterOptions,
        is_sidecar: bool,
        loaded: Loaded,
    ) -> SceneFileBuilder<'a> {
        let (linking, nodes, components) = Default::default();
        SceneFileBuilder { file, options, problems, shutter, is_sidecar, linking, nodes, components, loaded }
    }

    /// A path relative to the scene file's folder.
    pub fn resolve_path(&self, name: &str) -> PathBuf {
        self.file.parent().unwrap_or(self.file).join(name)
    }

    /// The path of a file to read. Sidecars may come with a model from an untrusted source: paths outside their folder are
    /// reported as problems unless the user permits them.
    pub fn readable_path(&self, name: &str, span: Range<usize>) -> Option<PathBuf> {
        if self.is_sidecar && !self.options.allow_external && files::leads_outside(Path::new(name)) {
            let message = ("path-outside", format!("'{name}' is outside the folder of the model"));
            let help = format!("move the file there, or permit it by {}", Choice::AllowExternal);
            self.problems.push_help(span, message, help);
            return None;
        }
        Some(self.resolve_path(name))
    }

    /// Adds a warning about the file.
    pub fn warn(&mut self, message: impl Into<Message>) {
        self.loaded.warnings.push(Warning::new(self.file, "", message));
    }

    /// The time of the picture, in frames.
    pub fn frame(&self) -> f64 {
        self.options.gltf.time_s.map_or(0.0, |time_s| time_s * self.shutter.fps)
    }
}

/// Whether `name`, one or more node names joined by slashes, occurs in a node's path. With a leading slash the path must start
/// with it.
pub(super) fn is_on_path(name: &str, path: &str) -> bool {
    let starts_at = |at: usize, name: &str| {
        let rest = path[at..].strip_prefix(name);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    match name.strip_prefix('/') {
        Some(name) => starts_at(0, name),
        None => starts_at(0, name) || path.match_indices('/').any(|(slash, _)| starts_at(slash + 1, name)),
    }
}

/// A set of node names with a hashed lookup of those that occur in a path; equivalent to [`is_on_path`] for each name.
pub(super) struct NamesOnPaths<'n> {
    relative: HashSet<&'n str>,
    /// Names with a leading slash, by their text without it.
    absolute: HashMap<&'n str, &'n str>,
    /// Maximum number of slash-separated parts of a name.
    max_parts: usize,
}

impl<'n> NamesOnPaths<'n> {
    /// The set of these names.
    pub fn of(names: impl Iterator<Item = &'n str> + Clone) -> NamesOnPaths<'n> {
        NamesOnPaths {
            relative: names.clone().filter(|name| !name.starts_with('/')).collect(),
            absolute: names.clone().filter_map(|name| Some((name.strip_prefix('/')?, name))).collect(),
            max_parts: names.map(|name| name.split('/').count()).max().unwrap_or(0),
        }
    }

    /// The names that occur in a node's path.
    pub fn on_path<'p>(&'p self, path: &'p str) -> impl Iterator<Item = &'n str> + 'p {
        let starts = [0].into_iter().chain(path.match_indices('/').map(|(slash, _)| slash + 1));
        let ends = |start: usize| {
            let slashes = path[start..].match_indices('/').map(move |(slash, _)| start + slash);
            slashes.chain([path.len()]).take(self.max_parts)
        };
        let relative = starts.flat_map(move |start| ends(start).map(move |end| &path[start..end]));
        let relative = relative.filter_map(|name| self.relative.get(name));
        let absolute = ends(0).filter_map(|end| self.absolute.get(&path[..end]));
        relative.chain(absolute).copied()
    }
}

/// Instances and lights of a model by the names of their nodes, without hidden ones.
#[derive(Default)]
pub(super) struct NodeIndex {
    /// Instance indices by each name of their paths.
    instances: HashMap<String, Vec<usize>>,
    /// Light indices by name.
    lights: HashMap<String, Vec<usize>>,
    /// Numbers of indexed instances and lights.
    counts: [usize; 2],
    /// Indices of hidden instances and lights.
    hidden: [HashSet<usize>; 2],
}

impl NodeIndex {
    /// Indexes the instances and lights added to the scene since the last call.
    pub fn update(&mut self, scene: &Scene) {
        let [instances, lights] = self.counts;
        for (index, instance) in scene.instances.iter().enumerate().skip(instances) {
            instance.name.split('/').for_each(|part| insert(&mut self.instances, part, index));
        }
        for (index, light) in scene.lights.iter().enumerate().skip(lights) {
            insert(&mut self.lights, &light.name, index);
        }
        self.counts = [scene.instances.len(), scene.lights.len()];
    }

    /// Instances with `name` in their path, see [`is_on_path`].
    pub fn instances(&self, name: &str, scene: &Scene) -> Vec<usize> {
        let first = name.strip_prefix('/').unwrap_or(name).split('/').next().unwrap_or_default();
        let listed = self.instances.get(first).into_iter().flatten().copied();
        let is_match = |i: &usize| is_on_path(name, &scene.instances[*i].name) && !self.hidden[0].contains(i);
        listed.filter(is_match).collect()
    }

    /// Lights with a `name`.
    pub fn lights(&self, name: &str) -> Vec<usize> {
        let listed = self.lights.get(name).into_iter().flatten().copied();
        listed.filter(|i| !self.hidden[1].contains(i)).collect()
    }

    /// Marks instances and lights for removal.
    pub fn hide(&mut self, instances: &[usize], lights: &[usize]) {
        self.hidden[0].extend(instances);
        self.hidden[1].extend(lights);
    }

    /// Removes the hidden instances and lights from the scene, and clears the index.
    pub fn remove_hidden(&mut self, scene: &mut Scene) {
        let [instances, lights] = std::mem::take(self).hidden;
        let mut index = 0..;
        scene.instances.retain(|_| !index.next().is_some_and(|i| instances.contains(&i)));
        let mut index = 0..;
        scene.lights.retain(|_| !index.next().is_some_and(|i| lights.contains(&i)));
    }
}

fn insert(lists: &mut HashMap<String, Vec<usize>>, name: &str, index: usize) {
    match lists.get_mut(name) {
        Some(list) if list.last() == Some(&index) => {}
        Some(list) => list.push(index),
        None => drop(lists.insert(name.to_string(), vec![index])),
    }
}

/// Names of objects with their spans in the file.
pub(super) type Names = Vec<(String, Range<usize>)>;

/// The object sets of light and shadow links.
#[derive(Default)]
pub(super) struct Linking {
    sets: Vec<NamedSet>,
}

/// The objects of `include` that are not in `exclude`.
pub(super) struct NamedSet {
    pub include: Names,
    pub exclude: Names,
}

impl Linking {
    /// Takes all sets, in the order of their numbers.
    pub fn take(&mut self) -> Vec<NamedSet> {
        std::mem::take(&mut self.sets)
    }

    /// The set with these lists of names, added if it is new; `None` after reporting too many sets.
    pub fn add(&mut self, include: Names, exclude: Names, fields: &Fields) -> Option<ObjectSet> {
        let is_same = |a: &Names, b: &Names| a.iter().map(|n| &n.0).eq(b.iter().map(|n| &n.0));
        let known =
            self.sets.iter().position(|s| is_same(&s.include, &include) && is_same(&s.exclude, &exclude));
        let number = known.unwrap_or(self.sets.len());
        let Some(set) = ObjectSet::new(number) else {
            let max = ObjectSet::COUNT;
            let message = format!("the lights of the file are linked to more than {max} sets of objects");
            fields.report_help(message, "use the same lists of names for several lights");
            return None;
        };
        if known.is_none() {
            self.sets.push(NamedSet { include, exclude });
        }
        Some(set)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DAffine3;
    use crate::scene::{Instance, MeshId};

    #[test]
    fn hashed_lookups_agree_with_the_test_of_each_name() {
        let names =
            ["Fog", "Room", "/Room", "/Room/Fog", "/Fog", "a/a", "aa", "Room/Fog", "", "a/", "Fo", "a"];
        let paths =
            ["Fog", "Room/Fog", "Room/Fog/3", "ba/a/a", "aaa/aa", "aa/ba", "House/Room/Fog", "Foggy/x", "a/"];
        let (set, mut index, mut scene) =
            (NamesOnPaths::of(names.into_iter()), NodeIndex::default(), Scene::default());
        for path in paths {
            let found: HashSet<&str> = set.on_path(path).collect();
            let expected = names.into_iter().filter(|name| is_on_path(name, path)).collect();
            assert_eq!(found, expected, "{path}");
            let placed = Instance::new(MeshId(0), DAffine3::IDENTITY);
            scene.instances.push(Instance { name: path.to_string(), ..placed });
            index.update(&scene);
        }
        for name in names {
            let expected: Vec<usize> = (0..paths.len()).filter(|&i| is_on_path(name, paths[i])).collect();
            assert_eq!(index.instances(name, &scene), expected, "{name}");
        }
        index.hide(&[0, 2], &[]);
        assert_eq!(index.instances("Fog", &scene), [1, 6]);
        index.remove_hidden(&mut scene);
        assert_eq!(scene.instances.len(), paths.len() - 2);
        assert_eq!(scene.instances[0].name, "Room/Fog");
    }

    /// The index lists each instance under its own name only, so that lookups don't visit all instances.
    #[test]
    fn lookups_visit_few_instances() {
        let (mut index, mut scene) = (NodeIndex::default(), Scene::default());
        for k in 0..1000 {
            let placed = Instance::new(MeshId(0), DAffine3::IDENTITY);
            scene.instances.push(Instance { name: format!("Scene/object {k}/mesh"), ..placed });
        }
        index.update(&scene);
        let listed = (0..1000).map(|k| index.instances[&format!("object {k}")].len());
        assert_eq!(listed.sum::<usize>(), 1000);
    }

    #[test]
    fn names_match_whole_parts_of_paths() {
        assert!(
            is_on_path("Fog", "Fog") && is_on_path("Fog", "Room/Fog") && is_on_path("Room", "Room/Fog/3")
        );
        assert!(is_on_path("a/a", "ba/a/a") && is_on_path("aa", "aaa/aa") && !is_on_path("a", "aa/ba"));
        assert!(is_on_path("/Room", "Room/Fog") && is_on_path("/Room/Fog", "Room/Fog"));
        assert!(!is_on_path("/Fog", "Room/Fog") && !is_on_path("/Room", "House/Room"));
        assert!(
            is_on_path("Room/Fog", "House/Room/Fog")
                && !is_on_path("Fo", "Fog")
                && !is_on_path("Fog", "Foggy/x")
        );
    }
}
