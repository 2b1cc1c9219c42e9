//! The node hierarchy: visible nodes and their world transforms.

use super::animation::{NodePose, Pose};
use super::buffers::Accessor;
use super::document;
use super::document::{
    Document, index_of, list_of_indices, name_of, names_of, numbers_of, pointer, required,
};
use super::report::{Report, Valid};
use crate::error::Problem;
use crate::load::options::GltfOptions;
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json::accessor::{ComponentType, Type};
use serde_json::Value;

/// A visible node.
pub(super) struct Node {
    /// Index in the file.
    pub index: usize,
    /// Index of the parent in [`Hierarchy::nodes`].
    parent: Option<usize>,
    pub world_from_node: DAffine3,
    /// Whether the node or one of its ancestors is animated.
    pub moves: bool,
    pub mesh: Option<usize>,
    pub camera: Option<usize>,
    /// Light of KHR_lights_punctual.
    pub light: Option<usize>,
    /// Skin of the mesh.
    pub skin: Option<usize>,
    /// Transforms of instances of the mesh, relative to the node (EXT_mesh_gpu_instancing).
    pub instances: Option<Vec<DAffine3>>,
}

impl Node {
    /// Whether the node has a mesh, a camera or a light.
    pub fn has_content(&self, doc: &Document) -> bool {
        let has_own = self.mesh.is_some() || self.camera.is_some() || self.light.is_some();
        has_own || self.profiled_light(doc).is_some() || self.area_light(doc).is_some()
    }

    /// JSON of its EXT_lights_area.
    pub fn area_light<'d>(&self, doc: &'d Document) -> Option<&'d Value> {
        doc.json.pointer(&format!("{}/extensions/EXT_lights_area", self.pointer()))
    }

    /// JSON of its EXT_lights_ies.
    pub fn profiled_light<'d>(&self, doc: &'d Document) -> Option<&'d Value> {
        doc.json.pointer(&format!("{}/extensions/EXT_lights_ies", self.pointer()))
    }

    /// The node's JSON pointer.
    pub fn pointer(&self) -> String {
        pointer("nodes", self.index)
    }
}

/// The visible nodes.
pub(super) struct Hierarchy {
    /// Parents before their children, in the order of the file.
    pub nodes: Vec<Node>,
    /// Index of the selected scene.
    pub scene: Option<usize>,
}

/// Maximum number of node names in the path of an instance.
const PATH_NAMES: usize = 8;

impl Hierarchy {
    /// Named nodes without mesh, camera or light: indices, names and world transforms.
    pub fn empties(&self, doc: &Document) -> Vec<(usize, String, DAffine3)> {
        let empty = |n: &&Node| !n.has_content(doc);
        let named = |n: &Node| {
            let raw = doc.json.pointer(&n.pointer())?;
            Some((n.index, raw.get("name")?.as_str()?.to_string(), n.world_from_node))
        };
        self.nodes.iter().filter(empty).filter_map(named).collect()
    }

    /// The names of a node and its ancestors, separated by slashes; the last [`PATH_NAMES`] in deep hierarchies.
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

/// Traverses the selected scene or node. Nodes reached twice (cycles, or children of two parents) are problems.
pub(super) fn walk(doc: &Document, pose: &Pose, parents: &NodeParents, report: &mut Report) -> Hierarchy {
    let (scene, roots) = match &doc.options.node {
        Some(wanted) => (None, root(doc, wanted, report)),
        None => roots(doc, report),
    };
    let above = match roots.as_slice() {
        [Step { node, .. }] if doc.options.node.is_some() => {
            parents.parent(*node).and_then(|parent| parents.world_from_node(parent, report).ok())
        }
        _ => None,
    };
    let mut hierarchy = Hierarchy { nodes: Vec::new(), scene };
    let mut reached = vec![false; doc.count("nodes")];
    let mut stack: Vec<Step> = roots.into_iter().rev().collect();
    let mut hidden = 0usize;
    while let Some(step) = stack.pop() {
        if reached.get(step.node).copied() == Some(true) {
            let message = ("node-cycle", "is reached twice: nodes form a cycle, or it has two parents");
            report.problem(pointer("nodes", step.node), message);
            continue;
        }
        let Ok(raw) = doc.raw("nodes", step.node, &step.from, report) else { continue };
        reached[step.node] = true;
        let at = pointer("nodes", step.node);
        document::check_shape(raw, &at, report);
        if is_hidden(raw, &at, report) {
            hidden += 1;
            continue;
        }
        let parent = step.parent.map(|p| hierarchy.nodes[p].world_from_node).or(above).unwrap_or_default();
        let Ok(local) = local(raw, pose.node(step.node), &at, report) else { continue };
        let world_from_node = parent * local;
        if !world_from_node.is_finite() {
            report.problem(at, "has a transform that is not finite");
            continue;
        }
        let parent_moves = step.parent.is_some_and(|p| hierarchy.nodes[p].moves);
        let entry = hierarchy.nodes.len();
        for (i, child) in list_of_indices(raw, "children", &at, report).into_iter().enumerate().rev() {
            stack.push(Step { node: child, parent: Some(entry), from: format!("{at}/children/{i}") });
        }
        // Invalid indices are reported as problems and end the loading.
        let mut index = |key: &str| index_of(raw, key, &at, report).unwrap_or(None);
        let (mesh, camera, skin) = (index("mesh"), index("camera"), index("skin"));
        hierarchy.nodes.push(Node {
            index: step.node,
            parent: step.parent,
            world_from_node,
            moves: parent_moves || pose.node(step.node).is_some_and(NodePose::moves),
            mesh,
            camera,
            light: light(raw, &at, report).unwrap_or(None),
            skin,
            instances: instance_transforms(doc, raw, &at, report).unwrap_or(None),
        });
    }
    if hidden > 0 {
        report.warn("", format!("{hidden} nodes with their children are invisible (KHR_node_visibility)"));
    }
    hierarchy
}

/// Whether KHR_node_visibility hides the node with its descendants.
fn is_hidden(node: &Value, at: &str, report: &mut Report) -> bool {
    let key = "/extensions/KHR_node_visibility/visible";
    let visible = node.pointer(key);
    if visible.is_some_and(|v| !v.is_boolean()) {
        report.problem(format!("{at}{key}"), "is neither true nor false");
    }
    visible == Some(&Value::Bool(false))
}

/// Index of a node's light of KHR_lights_punctual.
fn light(node: &Value, at: &str, report: &mut Report) -> Valid<Option<usize>> {
    let Some(extension) = node.pointer("/extensions/KHR_lights_punctual") else { return Ok(None) };
    let at = format!("{at}/extensions/KHR_lights_punctual");
    required(index_of(extension, "light", &at, report), "light", &at, report).map(Some)
}

/// A node on the traversal stack.
struct Step {
    node: usize,
    parent: Option<usize>,
    from: String,
}

/// The root of a traversal from a single node.
fn root(doc: &Document, wanted: &str, report: &mut Report) -> Vec<Step> {
    match GltfOptions::find(&names_of(doc, "nodes"), wanted) {
        Ok(node) => vec![Step { node, parent: None, from: String::new() }],
        Err(help) => {
            let message = format!("there is no node '{wanted}'");
            report.add(Problem::new("/nodes", message).with_help(help));
            Vec::new()
        }
    }
}

/// The roots of the scene that the user selects, else of the default scene, else of the first; without scenes all nodes
/// without parents.
fn roots(doc: &Document, report: &mut Report) -> (Option<usize>, Vec<Step>) {
    let step = |node, from| Step { node, parent: None, from };
    let scenes = doc.count("scenes");
    let chosen =
        match doc.options.scene.as_deref().map(|s| (s, GltfOptions::find(&names_of(doc, "scenes"), s))) {
            None => index_of(&doc.json, "scene", "", report).unwrap_or(None),
            Some((_, Ok(index))) => Some(index),
            Some((wanted, Err(help))) => {
                let message = format!("there is no scene '{wanted}'");
                report.add(Problem::new("/scenes", message).with_help(help));
                return (None, Vec::new());
            }
        };
    if chosen.is_none() && scenes > 1 {
        report.warn(
            "/scenes",
            format!("there are {scenes} scenes and none is the default: the first is shown"),
        );
    }
    if chosen.is_some() || scenes > 0 {
        let index = chosen.unwrap_or(0);
        let at = pointer("scenes", index);
        let Ok(scene) = doc.raw("scenes", index, "/scene", report) else { return (None, Vec::new()) };
        let roots = list_of_indices(scene, "nodes", &at, report).into_iter().enumerate();
        return (Some(index), roots.map(|(i, node)| step(node, format!("{at}/nodes/{i}"))).collect());
    }
    let count = doc.count("nodes");
    let mut is_child = vec![false; count];
    for index in 0..count {
        let Ok(raw) = doc.raw("nodes", index, "/nodes", report) else { continue };
        for child in list_of_indices(raw, "children", &pointer("nodes", index), report) {
            if let Some(is_child) = is_child.get_mut(child) {
                *is_child = true;
            }
        }
    }
    (None, (0..count).filter(|&i| !is_child[i]).map(|i| step(i, String::new())).collect())
}

// Node transforms, in f64.

/// A node's local transform in a pose: its matrix, or translation * rotation * scale.
pub(super) fn local(node: &Value, pose: Option<&NodePose>, at: &str, report: &mut Report) -> Valid<DAffine3> {
    let moves = pose.is_some_and(|p| p.translation.is_some() || p.rotation.is_some() || p.scale.is_some());
    let transform = if node.get("matrix").is_some() {
        if ["translation", "rotation", "scale"].iter().any(|key| node.get(key).is_some()) {
            report.warn(
                at,
                (
                    "matrix-overrides",
                    "has a matrix and also a translation, rotation or scale; the matrix is used",
                ),
            );
        }
        if moves {
            report.warn(
                format!("{at}/matrix"),
                ("matrix-overrides", "an animated node must not have a matrix; the matrix is used"),
            );
        }
        matrix(node, at, report)?
    } else {
        let translation = vector(node, "translation", 0.0, at, report)?;
        let scale = vector(node, "scale", 1.0, at, report)?;
        let rotation = rotation(node, at, report)?;
        DAffine3::from_scale_rotation_translation(
            pose.and_then(|p| p.scale).unwrap_or(scale),
            pose.and_then(|p| p.rotation).unwrap_or(rotation),
            pose.and_then(|p| p.translation).unwrap_or(translation),
        )
    };
    if !transform.is_finite() {
        return Err(report.problem(at, "has a transform that is not finite"));
    }
    Ok(transform)
}

fn matrix(node: &Value, at: &str, report: &mut Report) -> Valid<DAffine3> {
    let m: [f64; 16] = required(numbers_of(node, "matrix", at, report), "matrix", at, report)?;
    if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
        report.warn(format!("{at}/matrix"), "is a projective matrix; its last row is taken as 0 0 0 1");
    }
    Ok(affine(&m))
}

/// The affine part of a column-major matrix.
pub(super) fn affine(m: &[f64; 16]) -> DAffine3 {
    let column = |i: usize| DVec3::new(m[i], m[i + 1], m[i + 2]);
    DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(4), column(8)), column(12))
}

fn vector(node: &Value, key: &str, default: f64, at: &str, report: &mut Report) -> Valid<DVec3> {
    Ok(numbers_of(node, key, at, report)?.map_or(DVec3::splat(default), DVec3::from_array))
}

fn rotation(node: &Value, at: &str, report: &mut Report) -> Valid<DQuat> {
    let Some(rotation) = numbers_of(node, "rotation", at, report)? else { return Ok(DQuat::IDENTITY) };
    let rotation = DQuat::from_array(rotation);
    let length = rotation.length();
    if !(length > 1e-6 && length.is_finite()) {
        report
            .warn(format!("{at}/rotation"), ("rotation-invalid", "is not a unit quaternion; it is left out"));
        return Ok(DQuat::IDENTITY);
    }
    if (length - 1.0).abs() > 1e-3 {
        report.warn(format!("{at}/rotation"), format!("has the length {length:.4}; it was normalised"));
    }
    Ok(rotation.normalize())
}

/// The parents of all nodes, for world transforms of nodes outside the traversed scene: joints of skins, and ancestors of
/// a single selected node.
pub(super) struct NodeParents<'d, 'a> {
    doc: &'d Document<'a>,
    pose: &'d Pose,
    parents: Vec<Option<usize>>,
}

impl<'d, 'a> NodeParents<'d, 'a> {
    /// Reads the lists of children. Invalid entries are reported by the traversal.
    pub fn new(doc: &'d Document<'a>, pose: &'d Pose) -> NodeParents<'d, 'a> {
        let count = doc.count("nodes");
        let mut parents = vec![None; count];
        let nodes = doc.json.get("nodes").and_then(Value::as_array);
        for (parent, node) in nodes.into_iter().flatten().enumerate() {
            let children = node.get("children").and_then(Value::as_array);
            for child in children.into_iter().flatten().filter_map(Value::as_u64) {
                if let Some(slot) = usize::try_from(child).ok().and_then(|c| parents.get_mut(c)) {
                    *slot = Some(parent);
                }
            }
        }
        NodeParents { doc, pose, parents }
    }

    /// The parent of a node.
    pub fn parent(&self, index: usize) -> Option<usize> {
        self.parents.get(index).copied().flatten()
    }

    /// The world transform of a node.
    pub fn world_from_node(&self, index: usize, report: &mut Report) -> Valid<DAffine3> {
        let mut world = DAffine3::IDENTITY;
        let mut next = Some(index);
        let mut remaining = self.parents.len();
        while let Some(node) = next {
            if remaining == 0 {
                return Err(
                    report.problem(pointer("nodes", index), "is its own ancestor: nodes form a cycle")
                );
            }
            remaining -= 1;
            let at = pointer("nodes", node);
            let raw = self.doc.raw("nodes", node, &at, report)?;
            world = local(raw, self.pose.node(node), &at, report)? * world;
            next = self.parent(node);
        }
        if !world.is_finite() {
            return Err(report.problem(pointer("nodes", index), "has a transform that is not finite"));
        }
        Ok(world)
    }
}

// EXT_mesh_gpu_instancing: many instances of a node's mesh.

/// Approximate size of an instance in the scene with its name, bytes.
const BYTES_PER_INSTANCE: u64 = 256;

/// Transforms of the instances of a node, relative to it; `None` without the extension.
pub(super) fn instance_transforms(
    doc: &Document,
    node: &Value,
    at: &str,
    report: &mut Report,
) -> Valid<Option<Vec<DAffine3>>> {
    let Some(extension) = node.pointer("/extensions/EXT_mesh_gpu_instancing") else { return Ok(None) };
    let at = format!("{at}/extensions/EXT_mesh_gpu_instancing/attributes");
    let Some(attributes) = extension.get("attributes").filter(|a| a.is_object()) else {
        return Err(report.problem(at, "is missing or not an object"));
    };
    let mut count = None;
    let mut open = |name: &str, kind: Type, report: &mut Report| -> Valid<Option<Accessor<'_>>> {
        let Some(index) = index_of(attributes, name, &at, report)? else { return Ok(None) };
        let accessor = Accessor::open(doc, index, &format!("{at}/{name}"), report)?;
        let small = accessor.normalized && accessor.component != ComponentType::U32;
        if accessor.kind != kind || !(accessor.component == ComponentType::F32 || small) {
            let expected = format!("{kind:?}").to_uppercase();
            let message = format!("holds {}; this attribute needs {expected} of F32", accessor.contents());
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        let expected = *count.get_or_insert(accessor.count);
        if accessor.count != expected {
            let message = format!("has {} elements for {expected} instances", accessor.count);
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        Ok(Some(accessor))
    };
    let translations = open("TRANSLATION", Type::Vec3, report);
    let rotations = open("ROTATION", Type::Vec4, report);
    let scales = open("SCALE", Type::Vec3, report);
    let (translations, rotations, scales) = (translations?, rotations?, scales?);
    // Instances without transforms (only custom attributes) coincide: one suffices.
    let count = count.unwrap_or(1);
    if !doc.may_decode(BYTES_PER_INSTANCE.saturating_mul(count as u64)) {
        return Err(
            report.problem(at, format!("{count} instances are more than the size of the file justifies"))
        );
    }
    let translations = read(translations.as_ref(), count, [0.0; 3]);
    let rotations = read(rotations.as_ref(), count, [0.0, 0.0, 0.0, 1.0]);
    let scales = read(scales.as_ref(), count, [1.0; 3]);
    let mut invalid = 0usize;
    let mut list = Vec::with_capacity(count);
    for ((t, r), s) in translations.into_iter().zip(rotations).zip(scales) {
        let rotation = DQuat::from_array(r.map(f64::from)).normalize();
        let [translation, scale] = [t, s].map(|v| DVec3::from_array(v.map(f64::from)));
        let transform = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
        if transform.is_finite() {
            list.push(transform);
        } else {
            invalid += 1;
        }
    }
    if invalid > 0 {
        report.warn(at, format!("{invalid} instances with transforms that are not finite are left out"));
    }
    Ok(Some(list))
}

fn read<const N: usize>(accessor: Option<&Accessor>, count: usize, default: [f32; N]) -> Vec<[f32; N]> {
    let mut values = vec![default; count];
    if let Some(accessor) = accessor {
        values.fill([0.0; N]);
        accessor.read_floats(&mut values);
    }
    values
}
