//! Evaluates animations at one time: node transforms and morph target weights. All animations of the file play together;
//! if two drive the same property, the first in the file wins.

use super::buffers::Accessor;
use super::document::{Document, index_of, pointer, required};
use super::report::{Report, Valid};
use crate::math::{DQuat, DVec3};
use gltf::json::accessor::{ComponentType, Type};
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

/// Upper bound (exclusive) of morph target indices in animation pointers.
const MAX_WEIGHTS: usize = 1 << 16;

/// Animated properties of one node; `None` keeps the node's static value.
#[derive(Default)]
pub(super) struct NodePose {
    pub translation: Option<DVec3>,
    /// Rotation, a unit quaternion.
    pub rotation: Option<DQuat>,
    pub scale: Option<DVec3>,
    /// Morph target weights.
    pub weights: WeightsPose,
}

impl NodePose {
    /// Whether the node's transform is animated.
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

    fn set(&mut self, property: Property, value: &[f64], at: &str, report: &mut Report) -> Valid<()> {
        match property {
            Property::Translation => self.translation = Some(DVec3::from_slice(value)),
            Property::Rotation => self.rotation = Some(unit(DQuat::from_slice(value), at, report)?),
            Property::Scale => self.scale = Some(DVec3::from_slice(value)),
            Property::Weights(single) => self.weights.set(single, value),
        }
        Ok(())
    }
}

/// Animated weights of morph targets.
#[derive(Clone, Default)]
pub(super) struct WeightsPose {
    /// The weights of all targets.
    all: Option<Vec<f32>>,
    /// Individually animated weights, by target index.
    single: BTreeMap<usize, f32>,
}

impl WeightsPose {
    /// Whether any weight is animated.
    pub fn moves(&self) -> bool {
        self.all.is_some() || !self.single.is_empty()
    }

    /// Number of weights, if all are animated together.
    pub fn count(&self) -> Option<usize> {
        self.all.as_ref().map(Vec::len)
    }

    /// The static weights, overridden by the animated ones.
    pub fn over(&self, static_weights: Vec<f32>) -> Vec<f32> {
        let mut weights = self.all.clone().unwrap_or(static_weights);
        for (&index, &weight) in &self.single {
            weights.resize(weights.len().max(index + 1), 0.0);
            weights[index] = weight;
        }
        weights
    }

    /// Whether any weight is animated, or the single one.
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

/// Animated properties of nodes and meshes, by index.
#[derive(Default)]
pub(super) struct Pose {
    nodes: HashMap<usize, NodePose>,
    /// Weights of meshes, for nodes without their own.
    meshes: HashMap<usize, WeightsPose>,
    /// Number of animations in the file.
    pub animations: usize,
}

impl Pose {
    /// The animation of a node, if any.
    pub fn node(&self, index: usize) -> Option<&NodePose> {
        self.nodes.get(&index)
    }

    /// The animation of a node's weights, if any.
    pub fn node_weights(&self, index: usize) -> Option<&WeightsPose> {
        self.node(index).map(|pose| &pose.weights).filter(|weights| weights.moves())
    }

    /// The animation of a mesh's weights, if any.
    pub fn mesh_weights(&self, index: usize) -> Option<&WeightsPose> {
        self.meshes.get(&index)
    }
}

/// The animated property of a channel.
#[derive(Clone, Copy)]
pub(super) enum PoseTarget {
    /// Property of a node (by index).
    Node(usize, Property),
    /// Morph target weights of a mesh (by index): all, or the one at an index.
    MeshWeights(usize, Option<usize>),
}

/// Animated property of a node.
#[derive(Clone, Copy)]
pub(super) enum Property {
    Translation,
    Rotation,
    Scale,
    /// Morph target weights: all, or the one at an index.
    Weights(Option<usize>),
}

/// Evaluates the pose at a time, seconds; channels are constant before their first and after their last key (glTF 2.0,
/// section 3.11).
pub(super) fn pose(doc: &Document, time_s: f64, report: &mut Report) -> Pose {
    let mut reader = Reader {
        doc,
        samplers: Samplers::new(doc, time_s),
        pose: Pose::default(),
        without_node: 0,
        duplicates: 0,
    };
    let count = doc.count("animations");
    for index in 0..count {
        let Ok(animation) = doc.raw("animations", index, "/animations", report) else { continue };
        let at = format!("{}/channels", pointer("animations", index));
        let Some(channels) = animation.get("channels").and_then(Value::as_array) else {
            report.problem(at, "is missing or not a list");
            continue;
        };
        for (c, channel) in channels.iter().enumerate() {
            // Channels with errors are skipped; the report has the problem.
            let _: Valid<()> = reader.channel(animation, channel, &format!("{at}/{c}"), report);
        }
    }
    if reader.without_node > 0 {
        let message = format!("{} channels have no target node and are ignored", reader.without_node);
        report.warn("/animations", ("channels-without-node", message));
    }
    if reader.duplicates > 0 {
        let message = format!(
            "{} channels animate properties of earlier channels and are ignored: the first in the file is used",
            reader.duplicates
        );
        report.warn("/animations", ("channels-without-node", message));
    }
    if count == 0 {
        report.warn("", "the file has no animations: all frames are the same picture");
    }
    Pose { animations: count, ..reader.pose }
}

struct Reader<'d, 'a> {
    doc: &'d Document<'a>,
    samplers: Samplers<'d, 'a>,
    pose: Pose,
    without_node: usize,
    duplicates: usize,
}

impl Reader<'_, '_> {
    fn channel(&mut self, animation: &Value, channel: &Value, at: &str, report: &mut Report) -> Valid<()> {
        let Some(target) = channel.get("target") else {
            return Err(report.problem(format!("{at}/target"), "is missing"));
        };
        let path = target.get("path").and_then(Value::as_str).unwrap_or_default();
        let target_property = if path == "pointer" {
            // Other pointers are applied to the JSON document beforehand.
            let Some(target_property) = pose_target(target) else { return Ok(()) };
            match target_property {
                PoseTarget::Node(node, _) => {
                    self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?
                }
                PoseTarget::MeshWeights(mesh, _) => {
                    self.doc.raw("meshes", mesh, &format!("{at}/target"), report)?
                }
            };
            target_property
        } else {
            let Some(node) = index_of(target, "node", &format!("{at}/target"), report)? else {
                // Channels of extensions have no target node.
                self.without_node += 1;
                return Ok(());
            };
            self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?;
            let property = property(path).ok_or_else(|| {
                let message = format!("'{path}' is not known; the channel is ignored");
                report.warn(format!("{at}/target/path"), message)
            })?;
            PoseTarget::Node(node, property)
        };
        let (nodes, meshes) = (&mut self.pose.nodes, &mut self.pose.meshes);
        let is_duplicate = match target_property {
            PoseTarget::Node(node, property) => nodes.get(&node).is_some_and(|pose| pose.has(property)),
            PoseTarget::MeshWeights(mesh, single) => meshes.get(&mesh).is_some_and(|pose| pose.has(single)),
        };
        if is_duplicate {
            self.duplicates += 1;
            return Ok(());
        }
        let value = self.samplers.value(animation, channel, target_property.element(), at, report)?;
        match target_property {
            PoseTarget::Node(node, property) => {
                nodes.entry(node).or_default().set(property, &value, at, report)?
            }
            PoseTarget::MeshWeights(mesh, single) => meshes.entry(mesh).or_default().set(single, &value),
        }
        Ok(())
    }
}

impl PoseTarget {
    /// Type of the keyframe values.
    fn element(self) -> Element {
        match self {
            PoseTarget::Node(_, Property::Translation | Property::Scale) => Element::Numbers(3),
            PoseTarget::Node(_, Property::Rotation) => Element::Rotation,
            PoseTarget::Node(_, Property::Weights(single)) | PoseTarget::MeshWeights(_, single) => {
                match single {
                    Some(_) => Element::Numbers(1),
                    None => Element::Weights,
                }
            }
        }
    }
}

/// The animated property that a channel's `path` names.
fn property(path: &str) -> Option<Property> {
    match path {
        "translation" => Some(Property::Translation),
        "rotation" => Some(Property::Rotation),
        "scale" => Some(Property::Scale),
        "weights" => Some(Property::Weights(None)),
        _ => None,
    }
}

/// The pose property that a KHR_animation_pointer of a channel's target refers to; `None` for other properties.
pub(super) fn pose_target(target: &Value) -> Option<PoseTarget> {
    let pointer = target.pointer("/extensions/KHR_animation_pointer/pointer")?.as_str()?;
    let steps: Vec<&str> = pointer.split('/').collect();
    let ["", list, index, property_of @ ..] = &steps[..] else { return None };
    let index: usize = index.parse().ok()?;
    let single = match property_of {
        ["weights", single] => Some(single.parse().ok().filter(|weight| *weight < MAX_WEIGHTS)?),
        [_] => None,
        _ => return None,
    };
    match (*list, property_of[0]) {
        ("nodes", "weights") => Some(PoseTarget::Node(index, Property::Weights(single))),
        ("nodes", path) => Some(PoseTarget::Node(index, property(path)?)),
        ("meshes", "weights") => Some(PoseTarget::MeshWeights(index, single)),
        _ => None,
    }
}

fn unit(q: DQuat, at: &str, report: &mut Report) -> Valid<DQuat> {
    if q.length() > 1e-6 {
        return Ok(q.normalize());
    }
    Err(report.warn(at, "has a rotation of length 0; the channel is ignored"))
}

// Animation samplers: keyframes in accessors, and their values at a time.

/// Type of a channel's keyframe values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    /// Vectors of 1 to 4 numbers.
    Numbers(usize),
    /// A unit quaternion.
    Rotation,
    /// Any number of morph target weights.
    Weights,
    /// A boolean.
    Flag,
}

impl Element {
    /// Components of an output element.
    fn width(self) -> usize {
        match self {
            Element::Numbers(count) => count,
            Element::Rotation => 4,
            Element::Weights | Element::Flag => 1,
        }
    }
}

/// Evaluates samplers at one time.
pub(super) struct Samplers<'d, 'a> {
    doc: &'d Document<'a>,
    time_s: f64,
    /// Key times by accessor; channels share them.
    times: HashMap<usize, Valid<Rc<Vec<f32>>>>,
}

impl<'d, 'a> Samplers<'d, 'a> {
    /// The samplers of a file, to be evaluated at a time, seconds.
    pub fn new(doc: &'d Document<'a>, time_s: f64) -> Samplers<'d, 'a> {
        Samplers { doc, time_s, times: HashMap::new() }
    }

    /// Evaluates a channel.
    pub fn value(
        &mut self,
        animation: &Value,
        channel: &Value,
        element: Element,
        at: &str,
        report: &mut Report,
    ) -> Valid<Vec<f64>> {
        let index = required(index_of(channel, "sampler", at, report), "sampler", at, report)?;
        let Some(sampler) = animation.get("samplers").and_then(|s| s.get(index)) else {
            return Err(report.problem(
                format!("{at}/sampler"),
                format!("refers to sampler {index}, which does not exist"),
            ));
        };
        let interpolation = match sampler.get("interpolation").map(|i| i.as_str()) {
            None | Some(Some("LINEAR")) => Interpolation::Linear,
            Some(Some("STEP")) => Interpolation::Step,
            Some(Some("CUBICSPLINE")) => Interpolation::Cubic,
            Some(_) => {
                return Err(report
                    .problem(at, "has a sampler whose interpolation is not LINEAR, STEP or CUBICSPLINE"));
            }
        };
        let from = format!("{}/samplers/{index}", at.split("/channels").next().unwrap_or_default());
        let input = required(index_of(sampler, "input", &from, report), "input", &from, report);
        let output = required(index_of(sampler, "output", &from, report), "output", &from, report);
        let times = self.key_times(input?, at, report)?;
        let values = self.values(output?, element, at, report)?;
        if element == Element::Flag && interpolation != Interpolation::Step {
            return Err(report.problem(at, "animates a boolean, which needs the interpolation STEP"));
        }
        let parts = if interpolation == Interpolation::Cubic { 3 } else { 1 };
        let per_key = values.len().checked_div(times.len() * parts).unwrap_or(0);
        let fits = per_key * times.len() * parts == values.len() && per_key > 0;
        if !fits || element != Element::Weights && per_key != element.width() {
            let message = format!("has {} keys, but {} numbers for them", times.len(), values.len());
            return Err(report.problem(at, message));
        }
        let track = Track { times: &times, values: &values, width: per_key, interpolation };
        let value = track.at(self.time_s, element == Element::Rotation);
        if value.iter().any(|v| !v.is_finite()) {
            return Err(report.warn(at, "has values that are not finite numbers; the channel is ignored"));
        }
        Ok(value)
    }

    fn key_times(&mut self, index: usize, at: &str, report: &mut Report) -> Valid<Rc<Vec<f32>>> {
        if let Some(known) = self.times.get(&index) {
            return known.clone();
        }
        let times = self.read_times(index, at, report).map(Rc::new);
        self.times.insert(index, times.clone());
        times
    }

    fn read_times(&self, index: usize, at: &str, report: &mut Report) -> Valid<Vec<f32>> {
        let accessor = Accessor::open(self.doc, index, at, report)?;
        if accessor.kind != Type::Scalar || accessor.component != ComponentType::F32 {
            let message = format!("holds {}; the times of keys are SCALAR of F32", accessor.contents());
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        let mut times = vec![[0.0]; self.checked_count(&accessor, report)?];
        accessor.read_floats(&mut times);
        let times = times.into_flattened();
        let increase = times.windows(2).all(|w| w[0] <= w[1]) && times.iter().all(|t| t.is_finite());
        if !increase || times.is_empty() {
            return Err(report.warn(
                accessor.pointer.clone(),
                "holds key times that do not increase; their channels are ignored",
            ));
        }
        Ok(times)
    }

    fn values(&self, index: usize, element: Element, at: &str, report: &mut Report) -> Valid<Vec<f32>> {
        let accessor = Accessor::open(self.doc, index, at, report)?;
        let width = element.width();
        let kind = match width {
            1 => Type::Scalar,
            2 => Type::Vec2,
            3 => Type::Vec3,
            _ => Type::Vec4,
        };
        let small = accessor.normalized && accessor.component != ComponentType::U32;
        let (is_fit, component) = match element {
            Element::Flag => (accessor.component == ComponentType::U8 && !accessor.normalized, "U8"),
            _ => (accessor.component == ComponentType::F32 || small, "F32"),
        };
        if accessor.kind != kind || !is_fit {
            let expected = format!("{kind:?}").to_uppercase();
            let message =
                format!("holds {}; this channel needs {expected} of {component}", accessor.contents());
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        let count = self.checked_count(&accessor, report)?;
        Ok(match width {
            1 => read::<1>(&accessor, count),
            2 => read::<2>(&accessor, count),
            3 => read::<3>(&accessor, count),
            _ => read::<4>(&accessor, count),
        })
    }

    /// The number of elements, if within the decoding budget.
    fn checked_count(&self, accessor: &Accessor, report: &mut Report) -> Valid<usize> {
        let bytes = (accessor.count as u64).saturating_mul(16);
        if !self.doc.may_decode(bytes) {
            return Err(report
                .problem(accessor.pointer.clone(), "holds more keys than the size of the file justifies"));
        }
        Ok(accessor.count)
    }
}

fn read<const N: usize>(accessor: &Accessor, count: usize) -> Vec<f32> {
    let mut values = vec![[0.0; N]; count];
    accessor.read_floats(&mut values);
    values.into_flattened()
}

// Keys of one animation channel, and their interpolation.

/// Interpolation between two keys.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Interpolation {
    /// The value of the earlier key.
    Step,
    /// Linear; for rotations slerp along the shorter arc.
    Linear,
    /// Cubic Hermite spline.
    Cubic,
}

/// Keys of one channel.
pub(super) struct Track<'t> {
    /// Key times, seconds, not decreasing.
    pub times: &'t [f32],
    /// `width` numbers per key; for cubic splines three times as many: in-tangent, value and out-tangent.
    pub values: &'t [f32],
    /// Numbers per value.
    pub width: usize,
    /// Interpolation between the keys.
    pub interpolation: Interpolation,
}

impl Track<'_> {
    /// The value at a time (glTF 2.0, appendix C).
    pub fn at(&self, time_s: f64, is_rotation: bool) -> Vec<f64> {
        let after = self.times.partition_point(|&t| f64::from(t) <= time_s);
        let last = self.times.len() - 1;
        if after == 0 || after > last || self.interpolation == Interpolation::Step {
            return self.value(after.saturating_sub(1).min(last));
        }
        let (k, next) = (after - 1, after);
        let length = f64::from(self.times[next]) - f64::from(self.times[k]);
        let t = (time_s - f64::from(self.times[k])) / length;
        let (from, to) = (self.value(k), self.value(next));
        if self.interpolation == Interpolation::Cubic {
            let (out, into) = (self.part(k, 2), self.part(next, 0));
            let (t2, t3) = (t * t, t * t * t);
            let blend = |i: usize| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * from[i]
                    + length * (t3 - 2.0 * t2 + t) * out[i]
                    + (3.0 * t2 - 2.0 * t3) * to[i]
                    + length * (t3 - t2) * into[i]
            };
            return (0..self.width).map(blend).collect();
        }
        if is_rotation {
            let [a, b] = [from, to].map(|v| DQuat::from_slice(&v));
            return a.normalize().slerp(b.normalize(), t).to_array().to_vec();
        }
        (0..self.width).map(|i| from[i] + (to[i] - from[i]) * t).collect()
    }

    fn value(&self, key: usize) -> Vec<f64> {
        self.part(key, 1)
    }

    /// A part of a cubic spline's key: 0 the in-tangent, 1 the value, 2 the out-tangent.
    fn part(&self, key: usize, part: usize) -> Vec<f64> {
        let entry = if self.interpolation == Interpolation::Cubic { key * 3 + part } else { key };
        self.values[entry * self.width..][..self.width].iter().map(|&v| f64::from(v)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track<'t>(
        times: &'t [f32],
        values: &'t [f32],
        width: usize,
        interpolation: Interpolation,
    ) -> Track<'t> {
        Track { times, values, width, interpolation }
    }

    #[test]
    fn step_and_linear_are_constant_outside_their_keys() {
        let (times, values) = ([1.0, 2.0, 4.0], [10.0, 20.0, 40.0]);
        let linear = track(&times, &values, 1, Interpolation::Linear);
        let step = track(&times, &values, 1, Interpolation::Step);
        for (t, on_line, on_step) in
            [(0.0, 10.0, 10.0), (1.5, 15.0, 10.0), (2.0, 20.0, 20.0), (3.0, 30.0, 20.0), (9.0, 40.0, 40.0)]
        {
            assert_eq!((linear.at(t, false), step.at(t, false)), (vec![on_line], vec![on_step]), "{t}");
        }
    }

    /// The Hermite spline of x^3 from 0 to 2 is x^3 itself; tangents are per unit of time.
    #[test]
    fn splines_reproduce_a_cubic() {
        let (times, values) = ([0.0, 2.0], [0.0, 0.0, 0.0, 12.0, 8.0, 12.0]);
        let spline = track(&times, &values, 1, Interpolation::Cubic);
        for t in [0.0, 0.3, 1.0, 1.7, 2.0] {
            assert!((spline.at(t, false)[0] - t.powi(3)).abs() < 1e-12);
        }
    }

    /// From the identity to a quarter turn as the negated quaternion: halfway is an eighth turn.
    #[test]
    fn rotations_take_the_shorter_arc() {
        let end = -DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let values: Vec<f32> =
            [0.0, 0.0, 0.0, 1.0].into_iter().chain(end.to_array().map(|v| v as f32)).collect();
        let q = track(&[0.0, 1.0], &values, 4, Interpolation::Linear).at(0.5, true);
        let expected = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
        assert!(DQuat::from_slice(&q).dot(expected).abs() > 1.0 - 1e-9);
    }
}
