//! The node hierarchy: which nodes are seen, and where they stand. Transforms are taken from the JSON in full precision
//! and composed in f64.

use super::document::{Document, Report, index_of, name_of, numbers_of, pointer};
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::Value;

/// A node that is seen.
pub(super) struct Node {
    /// Its index in the file.
    pub index: usize,
    /// The entry of its parent in [`Hierarchy::nodes`].
    parent: Option<usize>,
    /// Placement.
    pub world_from_node: DAffine3,
    /// Its mesh.
    pub mesh: Option<usize>,
    /// Its camera.
    pub camera: Option<usize>,
    /// Its light (KHR_lights_punctual).
    pub light: Option<usize>,
    /// Does a skin move its mesh?
    pub skinned: bool,
}

impl Node {
    /// The node's JSON pointer.
    pub fn pointer(&self) -> String {
        pointer("nodes", self.index)
    }
}

/// The nodes that are seen, parents before their children, in the file's order.
pub(super) struct Hierarchy {
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The index of the scene that was chosen.
    pub scene: Option<usize>,
}

/// Most names of ancestors in the name of an instance.
const PATH_NAMES: usize = 8;

impl Hierarchy {
    /// The names of a node and of its ancestors, joined by slashes; of deep hierarchies only the last few.
    pub fn path(&self, doc: &Document, entry: usize) -> String {
        let mut names = Vec::new();
        let mut next = Some(entry);
        while let Some(node) = next.and_then(|at| self.nodes.get(at)) {
            if names.len() == PATH_NAMES {
                names.push("...".to_string());
                break;
            }
            let raw = doc.json.pointer(&node.pointer()).unwrap_or(&Value::Null);
            names.push(name_of(raw, "node", node.index));
            next = node.parent;
        }
        names.reverse();
        names.join("/")
    }
}

/// Walks the scene that is shown. A node that is reached twice (a cycle, or a child of two parents) is a problem.
pub(super) fn walk(doc: &Document, report: &mut Report) -> Hierarchy {
    let (scene, roots) = roots(doc, report);
    let mut hierarchy = Hierarchy { nodes: Vec::new(), scene };
    let mut reached = vec![false; doc.count("nodes")];
    let mut stack: Vec<Step> = roots.into_iter().rev().collect();
    let mut hidden = 0usize;
    while let Some(step) = stack.pop() {
        if reached.get(step.node).copied() == Some(true) {
            let message = "is reached twice: nodes form a cycle, or one is the child of two";
            report.problem(pointer("nodes", step.node), message);
            continue;
        }
        let Some(raw) = doc.raw("nodes", step.node, &step.from, report) else { continue };
        reached[step.node] = true;
        let at = pointer("nodes", step.node);
        if raw.pointer("/extensions/KHR_node_visibility/visible") == Some(&Value::Bool(false)) {
            hidden += 1;
            continue;
        }
        let parent = step.parent.map_or(DAffine3::IDENTITY, |p| hierarchy.nodes[p].world_from_node);
        let Some(local) = local_transform(raw, &at, report) else { continue };
        let world_from_node = parent * local;
        if !world_from_node.is_finite() {
            report.problem(at, "stands beyond the range of numbers");
            continue;
        }
        let entry = hierarchy.nodes.len();
        for (i, child) in list_of_indices(raw, "children", &at, report).into_iter().enumerate().rev() {
            stack.push(Step { node: child, parent: Some(entry), from: format!("{at}/children/{i}") });
        }
        let light = raw.pointer("/extensions/KHR_lights_punctual");
        let light_at = format!("{at}/extensions/KHR_lights_punctual");
        hierarchy.nodes.push(Node {
            index: step.node,
            parent: step.parent,
            world_from_node,
            mesh: index_of(raw, "mesh", &at, report),
            camera: index_of(raw, "camera", &at, report),
            light: light.and_then(|l| index_of(l, "light", &light_at, report)),
            skinned: raw.get("skin").is_some(),
        });
    }
    if hidden > 0 {
        report.warn("", format!("{hidden} nodes with their children are invisible (KHR_node_visibility)"));
    }
    hierarchy
}

/// A node to be visited.
struct Step {
    node: usize,
    parent: Option<usize>,
    from: String,
}

/// The roots of the default scene; of the first, where none is the default; without scenes, all nodes that are no
/// one's child.
fn roots(doc: &Document, report: &mut Report) -> (Option<usize>, Vec<Step>) {
    let step = |node, from| Step { node, parent: None, from };
    let chosen = index_of(&doc.json, "scene", "", report);
    let scenes = doc.count("scenes");
    if chosen.is_none() && scenes > 1 {
        report.warn(
            "/scenes",
            format!("there are {scenes} scenes and none is the default: the first is shown"),
        );
    }
    if chosen.is_some() || scenes > 0 {
        let index = chosen.unwrap_or(0);
        let at = pointer("scenes", index);
        let Some(scene) = doc.raw("scenes", index, "/scene", report) else { return (None, Vec::new()) };
        let roots = list_of_indices(scene, "nodes", &at, report).into_iter().enumerate();
        return (Some(index), roots.map(|(i, node)| step(node, format!("{at}/nodes/{i}"))).collect());
    }
    let count = doc.count("nodes");
    let mut is_child = vec![false; count];
    for index in 0..count {
        let Some(raw) = doc.raw("nodes", index, "/nodes", report) else { continue };
        for child in list_of_indices(raw, "children", &pointer("nodes", index), report) {
            if let Some(is_child) = is_child.get_mut(child) {
                *is_child = true;
            }
        }
    }
    (None, (0..count).filter(|&i| !is_child[i]).map(|i| step(i, String::new())).collect())
}

/// A list of indices held by an object; entries that are none are problems.
fn list_of_indices(object: &Value, key: &str, at: &str, report: &mut Report) -> Vec<usize> {
    let Some(value) = object.get(key) else { return Vec::new() };
    let Some(list) = value.as_array() else {
        report.problem(format!("{at}/{key}"), "is not a list of indices");
        return Vec::new();
    };
    let mut indices = Vec::with_capacity(list.len());
    for (i, value) in list.iter().enumerate() {
        match value.as_u64().and_then(|v| usize::try_from(v).ok()) {
            Some(index) => indices.push(index),
            None => report.problem(format!("{at}/{key}/{i}"), "is not an index"),
        }
    }
    indices
}

/// A node's own transform: its matrix, or translation * rotation * scale.
fn local_transform(node: &Value, at: &str, report: &mut Report) -> Option<DAffine3> {
    let transform = if node.get("matrix").is_some() {
        if ["translation", "rotation", "scale"].iter().any(|key| node.get(key).is_some()) {
            report.problem(at, "has a matrix and also a translation, rotation or scale");
            return None;
        }
        let m: [f64; 16] = numbers_of(node, "matrix", at, report)?;
        if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
            report.warn(format!("{at}/matrix"), "is a projection; its last row is taken as 0 0 0 1");
        }
        let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
        DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(4), column(8)), column(12))
    } else {
        let vector = |key: &str, default: [f64; 3], report: &mut Report| match node.get(key) {
            Some(_) => numbers_of(node, key, at, report),
            None => Some(default),
        };
        let translation = vector("translation", [0.0; 3], report)?;
        let scale = vector("scale", [1.0; 3], report)?;
        let rotation = rotation(node, at, report)?;
        DAffine3::from_scale_rotation_translation(scale.into(), rotation, translation.into())
    };
    if !transform.is_finite() {
        report.problem(at, "has a transform beyond the range of numbers");
        return None;
    }
    Some(transform)
}

fn rotation(node: &Value, at: &str, report: &mut Report) -> Option<DQuat> {
    if node.get("rotation").is_none() {
        return Some(DQuat::IDENTITY);
    }
    let rotation = DQuat::from_array(numbers_of(node, "rotation", at, report)?);
    let length = rotation.length();
    if !(length > 1e-6 && length.is_finite()) {
        report.problem(format!("{at}/rotation"), "is no rotation: a unit quaternion is needed");
        return None;
    }
    if (length - 1.0).abs() > 1e-3 {
        report.warn(format!("{at}/rotation"), format!("has the length {length:.4}; it was normalised"));
    }
    Some(rotation.normalize())
}
