//! Animations at one moment: what they make of the nodes' transforms and of the weights of morph targets. All animations
//! of the file play together; where two move the same thing, the first counts.

use super::document::{Document, index_of, pointer};
use super::report::{Report, Sound};
use super::samplers::{Element, Samplers};
use crate::math::{DQuat, DVec3};
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};

/// Single weights that pointers name are below this: more morph targets than any mesh has.
const MOST_WEIGHTS: usize = 1 << 16;

/// What animations say about one node; `None` leaves the file's own value.
#[derive(Default)]
pub(super) struct NodePose {
    /// Translation.
    pub translation: Option<DVec3>,
    /// Rotation, a unit quaternion.
    pub rotation: Option<DQuat>,
    /// Scale.
    pub scale: Option<DVec3>,
    /// Weights of the morph targets of its mesh.
    pub weights: WeightsPose,
}

impl NodePose {
    /// Is the node's transform animated?
    pub fn moves(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }

    fn has(&self, property: Property) -> bool {
        match property {
            Property::Translation => self.translation.is_some(),
            Property::Rotation => self.rotation.is_some(),
            Property::Scale => self.scale.is_some(),
            Property::Weights(single) => self.weights.has(single),
        }
    }

    fn set(&mut self, property: Property, value: &[f64], at: &str, report: &mut Report) -> Sound<()> {
        match property {
            Property::Translation => self.translation = Some(DVec3::from_slice(value)),
            Property::Rotation => self.rotation = Some(unit(DQuat::from_slice(value), at, report)?),
            Property::Scale => self.scale = Some(DVec3::from_slice(value)),
            Property::Weights(single) => self.weights.set(single, value),
        }
        Ok(())
    }
}

/// What animations say about a list of weights of morph targets.
#[derive(Clone, Default)]
pub(super) struct WeightsPose {
    /// All of them.
    all: Option<Vec<f32>>,
    /// Single ones, by index.
    single: BTreeMap<usize, f32>,
}

impl WeightsPose {
    /// Is any animated?
    pub fn moves(&self) -> bool {
        self.all.is_some() || !self.single.is_empty()
    }

    /// How many there are, where all are animated together.
    pub fn count(&self) -> Option<usize> {
        self.all.as_ref().map(Vec::len)
    }

    /// The weights, where those of the file are such.
    pub fn over(&self, of_file: Vec<f32>) -> Vec<f32> {
        let mut weights = self.all.clone().unwrap_or(of_file);
        for (&index, &weight) in &self.single {
            weights.resize(weights.len().max(index + 1), 0.0);
            weights[index] = weight;
        }
        weights
    }

    /// Are all driven, or the single one?
    fn has(&self, single: Option<usize>) -> bool {
        match single {
            Some(index) => self.all.is_some() || self.single.contains_key(&index),
            None => self.moves(),
        }
    }

    fn set(&mut self, single: Option<usize>, value: &[f64]) {
        let mut weights = value.iter().map(|&w| w as f32);
        match single {
            Some(index) => self.single.extend(weights.next().map(|weight| (index, weight))),
            None => self.all = Some(weights.collect()),
        }
    }
}

/// What animations move, by index.
#[derive(Default)]
pub(super) struct Pose {
    nodes: HashMap<usize, NodePose>,
    /// Weights of meshes, which hold for the nodes that have none of their own.
    meshes: HashMap<usize, WeightsPose>,
    /// How many animations were read.
    pub animations: usize,
}

impl Pose {
    /// What moves a node, if anything does.
    pub fn node(&self, index: usize) -> Option<&NodePose> {
        self.nodes.get(&index)
    }

    /// What moves the weights of a node, if anything does.
    pub fn node_weights(&self, index: usize) -> Option<&WeightsPose> {
        self.node(index).map(|pose| &pose.weights).filter(|weights| weights.moves())
    }

    /// What moves the weights of a mesh, if anything does.
    pub fn mesh_weights(&self, index: usize) -> Option<&WeightsPose> {
        self.meshes.get(&index)
    }
}

/// What of the pose a channel drives.
#[derive(Clone, Copy)]
pub(super) enum Posed {
    /// A property of a node.
    Node(usize, Property),
    /// All weights of a mesh's morph targets, or a single one.
    MeshWeights(usize, Option<usize>),
}

/// What of a node a channel drives.
#[derive(Clone, Copy)]
pub(super) enum Property {
    Translation,
    Rotation,
    Scale,
    /// All weights of its morph targets, or a single one.
    Weights(Option<usize>),
}

/// The pose at a moment, seconds. Before a channel's first key its first value holds, after its last key the last
/// (glTF 2.0, section 3.11).
pub(super) fn pose(doc: &Document, time_s: f64, report: &mut Report) -> Pose {
    let mut reader = Reader {
        doc,
        samplers: Samplers::new(doc, time_s),
        pose: Pose::default(),
        targetless: 0,
        doubled: 0,
    };
    let count = doc.count("animations");
    for index in 0..count {
        let Ok(animation) = doc.raw("animations", index, "/animations", report) else { continue };
        let at = format!("{}/channels", pointer("animations", index));
        let Some(channels) = animation.get("channels").and_then(Value::as_array) else {
            report.problem(at, "is missing, or no list");
            continue;
        };
        for (c, channel) in channels.iter().enumerate() {
            // What is wrong with a channel doesn't concern the others.
            let _: Sound<()> = reader.channel(animation, channel, &format!("{at}/{c}"), report);
        }
    }
    if reader.targetless > 0 {
        let message = format!("{} channels move no node; they stand still", reader.targetless);
        report.warn("/animations", message);
    }
    if reader.doubled > 0 {
        let message = format!(
            "{} channels move what an earlier animation moves already; the first in the file counts",
            reader.doubled
        );
        report.warn("/animations", message);
    }
    if count == 0 {
        report.warn(
            "",
            "nothing moves: the file has no animations, and every frame or moment is the same picture",
        );
    }
    Pose { animations: count, ..reader.pose }
}

struct Reader<'d, 'a> {
    doc: &'d Document<'a>,
    samplers: Samplers<'d, 'a>,
    pose: Pose,
    targetless: usize,
    doubled: usize,
}

impl Reader<'_, '_> {
    fn channel(&mut self, animation: &Value, channel: &Value, at: &str, report: &mut Report) -> Sound<()> {
        let Some(target) = channel.get("target") else {
            return Err(report.problem(format!("{at}/target"), "is missing"));
        };
        let path = target.get("path").and_then(Value::as_str).unwrap_or_default();
        let posed = if path == "pointer" {
            // Other pointers change the document before it is read.
            let Some(posed) = of_pose(target) else { return Ok(()) };
            match posed {
                Posed::Node(node, _) => self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?,
                Posed::MeshWeights(mesh, _) => {
                    self.doc.raw("meshes", mesh, &format!("{at}/target"), report)?
                }
            };
            posed
        } else {
            let Some(node) = index_of(target, "node", &format!("{at}/target"), report)? else {
                // The channel is an extension's.
                self.targetless += 1;
                return Ok(());
            };
            self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?;
            let property = property(path).ok_or_else(|| {
                let message = format!("'{path}' is not known; the channel stands still");
                report.warn(format!("{at}/target/path"), message)
            })?;
            Posed::Node(node, property)
        };
        let (nodes, meshes) = (&mut self.pose.nodes, &mut self.pose.meshes);
        // Another channel may have driven the same before.
        let is_doubled = match posed {
            Posed::Node(node, property) => nodes.get(&node).is_some_and(|pose| pose.has(property)),
            Posed::MeshWeights(mesh, single) => meshes.get(&mesh).is_some_and(|pose| pose.has(single)),
        };
        if is_doubled {
            self.doubled += 1;
            return Ok(());
        }
        let value = self.samplers.value(animation, channel, posed.element(), at, report)?;
        match posed {
            Posed::Node(node, property) => {
                nodes.entry(node).or_default().set(property, &value, at, report)?
            }
            Posed::MeshWeights(mesh, single) => meshes.entry(mesh).or_default().set(single, &value),
        }
        Ok(())
    }
}

impl Posed {
    /// What a key holds.
    fn element(self) -> Element {
        match self {
            Posed::Node(_, Property::Translation | Property::Scale) => Element::Numbers(3),
            Posed::Node(_, Property::Rotation) => Element::Rotation,
            Posed::Node(_, Property::Weights(single)) | Posed::MeshWeights(_, single) => match single {
                Some(_) => Element::Numbers(1),
                None => Element::Weights,
            },
        }
    }
}

/// What of a node a path names, if it is of its pose.
fn property(path: &str) -> Option<Property> {
    match path {
        "translation" => Some(Property::Translation),
        "rotation" => Some(Property::Rotation),
        "scale" => Some(Property::Scale),
        "weights" => Some(Property::Weights(None)),
        _ => None,
    }
}

/// What of the pose the pointer of a channel's target (KHR_animation_pointer) leads to, if it does.
pub(super) fn of_pose(target: &Value) -> Option<Posed> {
    let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer")?.as_str()?;
    let steps: Vec<&str> = pointer.split('/').collect();
    let ["", list, index, property_of @ ..] = &steps[..] else { return None };
    let index: usize = index.parse().ok()?;
    let single = match property_of {
        ["weights", single] => Some(single.parse().ok().filter(|weight| *weight < MOST_WEIGHTS)?),
        [_] => None,
        _ => return None,
    };
    match (*list, property_of[0]) {
        ("nodes", "weights") => Some(Posed::Node(index, Property::Weights(single))),
        ("nodes", path) => Some(Posed::Node(index, property(path)?)),
        ("meshes", "weights") => Some(Posed::MeshWeights(index, single)),
        _ => None,
    }
}

fn unit(q: DQuat, at: &str, report: &mut Report) -> Sound<DQuat> {
    if q.length() > 1e-6 {
        return Ok(q.normalize());
    }
    Err(report.warn(at, "has a rotation of length 0; the channel stands still"))
}
