//! Animations at one moment: what they make of the nodes' transforms and of the weights of morph targets. All animations
//! of the file play together; where two move the same thing, the first counts.

use super::document::{Document, index_of, pointer};
use super::report::{Report, Sound};
use super::samplers::{Element, Samplers};
use crate::math::{DQuat, DVec3};
use serde_json::Value;
use std::collections::HashMap;

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
    pub weights: Option<Vec<f32>>,
}

impl NodePose {
    /// Is the node's transform animated?
    pub fn moves(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }
}

/// The nodes that animations move, by index.
#[derive(Default)]
pub(super) struct Pose {
    nodes: HashMap<usize, NodePose>,
    /// How many animations were read.
    pub animations: usize,
}

impl Pose {
    /// What moves a node, if anything does.
    pub fn node(&self, index: usize) -> Option<&NodePose> {
        self.nodes.get(&index)
    }
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
        let mut path = target.get("path").and_then(Value::as_str).unwrap_or_default();
        let node = if path == "pointer" {
            // Other pointers change the document before it is read.
            let Some((node, of_node)) = of_pose(target) else { return Ok(()) };
            path = of_node;
            Some(node)
        } else {
            index_of(target, "node", &format!("{at}/target"), report)?
        };
        let Some(node) = node else {
            // The channel is an extension's.
            self.targetless += 1;
            return Ok(());
        };
        self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?;
        let element = match path {
            "translation" | "scale" => Element::Numbers(3),
            "rotation" => Element::Rotation,
            "weights" => Element::Weights,
            other => {
                return Err(report.warn(
                    format!("{at}/target/path"),
                    format!("'{other}' is not known; the channel stands still"),
                ));
            }
        };
        let known = self.pose.nodes.get(&node);
        let is_doubled = known.is_some_and(|p| match path {
            "translation" => p.translation.is_some(),
            "rotation" => p.rotation.is_some(),
            "scale" => p.scale.is_some(),
            _ => p.weights.is_some(),
        });
        if is_doubled {
            self.doubled += 1;
            return Ok(());
        }
        let value = self.samplers.value(animation, channel, element, at, report)?;
        let pose = self.pose.nodes.entry(node).or_default();
        let vector = || DVec3::from_slice(&value);
        match path {
            "translation" => pose.translation = Some(vector()),
            "scale" => pose.scale = Some(vector()),
            "rotation" => pose.rotation = Some(unit(DQuat::from_slice(&value), at, report)?),
            _ => pose.weights = Some(value.iter().map(|&w| w as f32).collect()),
        }
        Ok(())
    }
}

/// The node and what of its pose the pointer of a channel's target (KHR_animation_pointer) leads to, if it does.
pub(super) fn of_pose(target: &Value) -> Option<(usize, &str)> {
    let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer")?.as_str()?;
    let (node, path) = pointer.strip_prefix("/nodes/")?.split_once('/')?;
    let is_pose = ["translation", "rotation", "scale", "weights"].contains(&path);
    if is_pose { Some((node.parse().ok()?, path)) } else { None }
}

fn unit(q: DQuat, at: &str, report: &mut Report) -> Sound<DQuat> {
    if q.length() > 1e-6 {
        return Ok(q.normalize());
    }
    Err(report.warn(at, "has a rotation of length 0; the channel stands still"))
}
