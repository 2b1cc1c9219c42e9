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

    /// What moves the weights of a mesh, if anything does.
    pub fn mesh(&self, index: usize) -> Option<&WeightsPose> {
        self.meshes.get(&index).filter(|weights| weights.moves())
    }
}

/// What of the pose a channel drives.
#[derive(Clone, Copy)]
pub(super) enum Posed {
    Translation(usize),
    Rotation(usize),
    Scale(usize),
    /// All weights of a node's morph targets, or a single one.
    NodeWeights(usize, Option<usize>),
    /// The same of a mesh.
    MeshWeights(usize, Option<usize>),
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
            posed
        } else {
            let Some(node) = index_of(target, "node", &format!("{at}/target"), report)? else {
                // The channel is an extension's.
                self.targetless += 1;
                return Ok(());
            };
            self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?;
            of_node(node, path).ok_or_else(|| {
                let message = format!("'{path}' is not known; the channel stands still");
                report.warn(format!("{at}/target/path"), message)
            })?
        };
        match posed {
            Posed::MeshWeights(mesh, _) => self.doc.raw("meshes", mesh, &format!("{at}/target"), report)?,
            Posed::Translation(node)
            | Posed::Rotation(node)
            | Posed::Scale(node)
            | Posed::NodeWeights(node, _) => {
                self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?
            }
        };
        if self.is_known(posed) {
            self.doubled += 1;
            return Ok(());
        }
        let value = self.samplers.value(animation, channel, posed.element(), at, report)?;
        self.put(posed, &value, at, report)
    }

    /// Has an earlier channel driven the same?
    fn is_known(&self, posed: Posed) -> bool {
        let node = |index: usize| self.pose.nodes.get(&index);
        let has = |weights: &WeightsPose, single: Option<usize>| match single {
            Some(index) => weights.all.is_some() || weights.single.contains_key(&index),
            None => weights.moves(),
        };
        match posed {
            Posed::Translation(of) => node(of).is_some_and(|p| p.translation.is_some()),
            Posed::Rotation(of) => node(of).is_some_and(|p| p.rotation.is_some()),
            Posed::Scale(of) => node(of).is_some_and(|p| p.scale.is_some()),
            Posed::NodeWeights(of, single) => node(of).is_some_and(|p| has(&p.weights, single)),
            Posed::MeshWeights(of, single) => self.pose.meshes.get(&of).is_some_and(|w| has(w, single)),
        }
    }

    fn put(&mut self, posed: Posed, value: &[f64], at: &str, report: &mut Report) -> Sound<()> {
        let set = |weights: &mut WeightsPose, single: Option<usize>| match single {
            Some(index) => drop(weights.single.insert(index, value[0] as f32)),
            None => weights.all = Some(value.iter().map(|&w| w as f32).collect()),
        };
        let (nodes, meshes) = (&mut self.pose.nodes, &mut self.pose.meshes);
        match posed {
            Posed::Translation(of) => {
                nodes.entry(of).or_default().translation = Some(DVec3::from_slice(value));
            }
            Posed::Rotation(of) => {
                nodes.entry(of).or_default().rotation = Some(unit(DQuat::from_slice(value), at, report)?);
            }
            Posed::Scale(of) => nodes.entry(of).or_default().scale = Some(DVec3::from_slice(value)),
            Posed::NodeWeights(of, single) => set(&mut nodes.entry(of).or_default().weights, single),
            Posed::MeshWeights(of, single) => set(meshes.entry(of).or_default(), single),
        }
        Ok(())
    }
}

impl Posed {
    /// What a key holds.
    fn element(self) -> Element {
        match self {
            Posed::Translation(_) | Posed::Scale(_) => Element::Numbers(3),
            Posed::Rotation(_) => Element::Rotation,
            Posed::NodeWeights(_, None) | Posed::MeshWeights(_, None) => Element::Weights,
            Posed::NodeWeights(_, Some(_)) | Posed::MeshWeights(_, Some(_)) => Element::Numbers(1),
        }
    }
}

/// What of a node's pose a path names, if it does.
fn of_node(node: usize, path: &str) -> Option<Posed> {
    match path {
        "translation" => Some(Posed::Translation(node)),
        "rotation" => Some(Posed::Rotation(node)),
        "scale" => Some(Posed::Scale(node)),
        "weights" => Some(Posed::NodeWeights(node, None)),
        _ => None,
    }
}

/// What of the pose the pointer of a channel's target (KHR_animation_pointer) leads to, if it does.
pub(super) fn of_pose(target: &Value) -> Option<Posed> {
    let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer")?.as_str()?;
    let steps: Vec<&str> = pointer.split('/').collect();
    let index = |step: &str| step.parse::<usize>().ok();
    let weight = |step: &str| index(step).filter(|weight| *weight < MOST_WEIGHTS);
    match steps[..] {
        ["", "nodes", node, "weights", single] => {
            Some(Posed::NodeWeights(index(node)?, Some(weight(single)?)))
        }
        ["", "nodes", node, path] => of_node(index(node)?, path),
        ["", "meshes", mesh, "weights"] => Some(Posed::MeshWeights(index(mesh)?, None)),
        ["", "meshes", mesh, "weights", single] => {
            Some(Posed::MeshWeights(index(mesh)?, Some(weight(single)?)))
        }
        _ => None,
    }
}

fn unit(q: DQuat, at: &str, report: &mut Report) -> Sound<DQuat> {
    if q.length() > 1e-6 {
        return Ok(q.normalize());
    }
    Err(report.warn(at, "has a rotation of length 0; the channel stands still"))
}
