//! Animations at one moment: what they make of the nodes' transforms and of the weights of morph targets. All animations
//! of the file play together; where two move the same thing, the first counts.

use super::accessor::Accessor;
use super::document::{Document, index_of, pointer, required};
use super::report::{Report, Sound};
use crate::math::{DQuat, DVec3};
use gltf::json::accessor::{ComponentType, Type};
use serde_json::Value;
use std::collections::HashMap;
use std::rc::Rc;

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
        time_s,
        times: HashMap::new(),
        pose: Pose::default(),
        pointers: 0,
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
    if reader.pointers > 0 {
        let message = format!("{} channels use KHR_animation_pointer and stand still", reader.pointers);
        report.warn("/animations", message);
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
        report.warn("", "the file has no animations: every moment looks the same");
    }
    Pose { animations: count, ..reader.pose }
}

struct Reader<'d, 'a> {
    doc: &'d Document<'a>,
    time_s: f64,
    /// Key times by accessor; channels share them.
    times: HashMap<usize, Sound<Rc<Vec<f32>>>>,
    pose: Pose,
    pointers: usize,
    targetless: usize,
    doubled: usize,
}

impl Reader<'_, '_> {
    fn channel(&mut self, animation: &Value, channel: &Value, at: &str, report: &mut Report) -> Sound<()> {
        let Some(target) = channel.get("target") else {
            return Err(report.problem(format!("{at}/target"), "is missing"));
        };
        let path = target.get("path").and_then(Value::as_str).unwrap_or_default();
        if path == "pointer" {
            self.pointers += 1;
            return Ok(());
        }
        let Some(node) = index_of(target, "node", &format!("{at}/target"), report)? else {
            // The channel is an extension's.
            self.targetless += 1;
            return Ok(());
        };
        self.doc.raw("nodes", node, &format!("{at}/target/node"), report)?;
        let width = match path {
            "translation" | "scale" => 3,
            "rotation" => 4,
            "weights" => 1,
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
        let value = self.sample(animation, channel, width, at, report)?;
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

    /// The value of a channel at the moment; `width` is the number of components of an output element.
    fn sample(
        &mut self,
        animation: &Value,
        channel: &Value,
        width: usize,
        at: &str,
        report: &mut Report,
    ) -> Sound<Vec<f64>> {
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
                return Err(report.problem(
                    at,
                    "has a sampler whose interpolation is none of LINEAR, STEP and CUBICSPLINE",
                ));
            }
        };
        let from = format!("{}/samplers/{index}", at.split("/channels").next().unwrap_or_default());
        let input = required(index_of(sampler, "input", &from, report), "input", &from, report);
        let output = required(index_of(sampler, "output", &from, report), "output", &from, report);
        let times = self.key_times(input?, at, report)?;
        let values = self.values(output?, width, at, report)?;
        let parts = if interpolation == Interpolation::Cubic { 3 } else { 1 };
        let per_key = values.len().checked_div(times.len() * parts).unwrap_or(0);
        let fits = per_key * times.len() * parts == values.len() && per_key > 0;
        if !fits || width != 1 && per_key != width {
            let message = format!("has {} keys, but {} numbers for them", times.len(), values.len());
            return Err(report.problem(at, message));
        }
        let track = Track { times: &times, values: &values, width: per_key, interpolation };
        let value = track.at(self.time_s, width == 4);
        if value.iter().any(|v| !v.is_finite()) {
            return Err(report.warn(at, "has values that are not finite numbers; the channel stands still"));
        }
        Ok(value)
    }

    fn key_times(&mut self, index: usize, at: &str, report: &mut Report) -> Sound<Rc<Vec<f32>>> {
        if let Some(known) = self.times.get(&index) {
            return known.clone();
        }
        let times = self.read_times(index, at, report).map(Rc::new);
        self.times.insert(index, times.clone());
        times
    }

    fn read_times(&self, index: usize, at: &str, report: &mut Report) -> Sound<Vec<f32>> {
        let accessor = Accessor::open(self.doc, index, at, report)?;
        if accessor.kind != Type::Scalar || accessor.component != ComponentType::F32 {
            let message = format!("holds {}; the times of keys are SCALAR of F32", accessor.contents());
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        let mut times = vec![[0.0]; self.affordable(&accessor, report)?];
        accessor.read_floats(&mut times);
        let times = times.into_flattened();
        let increase = times.windows(2).all(|w| w[0] <= w[1]) && times.iter().all(|t| t.is_finite());
        if !increase || times.is_empty() {
            return Err(report.warn(
                accessor.pointer.clone(),
                "holds key times that do not increase; what they drive stands still",
            ));
        }
        Ok(times)
    }

    fn values(&self, index: usize, width: usize, at: &str, report: &mut Report) -> Sound<Vec<f32>> {
        let accessor = Accessor::open(self.doc, index, at, report)?;
        let kind = match width {
            1 => Type::Scalar,
            3 => Type::Vec3,
            _ => Type::Vec4,
        };
        let small = accessor.normalized && accessor.component != ComponentType::U32;
        if accessor.kind != kind || !(accessor.component == ComponentType::F32 || small) {
            let wanted = format!("{kind:?}").to_uppercase();
            let message = format!("holds {}; this channel needs {wanted} of F32", accessor.contents());
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        let count = self.affordable(&accessor, report)?;
        Ok(match width {
            1 => read::<1>(&accessor, count),
            3 => read::<3>(&accessor, count),
            _ => read::<4>(&accessor, count),
        })
    }

    fn affordable(&self, accessor: &Accessor, report: &mut Report) -> Sound<usize> {
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

fn unit(q: DQuat, at: &str, report: &mut Report) -> Sound<DQuat> {
    if q.length() > 1e-6 {
        return Ok(q.normalize());
    }
    Err(report.warn(at, "has a rotation of length 0; the channel stands still"))
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    Cubic,
}

/// Keys of one channel. `values` holds `width` numbers a key; with cubic splines the in-tangent, the value and the
/// out-tangent of each.
struct Track<'t> {
    times: &'t [f32],
    values: &'t [f32],
    width: usize,
    interpolation: Interpolation,
}

impl Track<'_> {
    /// The value at a moment (glTF 2.0, appendix C).
    fn at(&self, time_s: f64, is_rotation: bool) -> Vec<f64> {
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
            // The shorter way round, at constant speed.
            let [a, b] = [from, to].map(|v| DQuat::from_slice(&v));
            return a.normalize().slerp(b.normalize(), t).to_array().to_vec();
        }
        (0..self.width).map(|i| from[i] + (to[i] - from[i]) * t).collect()
    }

    fn value(&self, key: usize) -> Vec<f64> {
        self.part(key, 1)
    }

    /// Of a cubic spline's key: 0 the in-tangent, 1 the value, 2 the out-tangent.
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
    fn steps_and_lines_hold_outside_their_keys() {
        let (times, values) = ([1.0, 2.0, 4.0], [10.0, 20.0, 40.0]);
        let linear = track(&times, &values, 1, Interpolation::Linear);
        let step = track(&times, &values, 1, Interpolation::Step);
        for (t, on_line, on_step) in
            [(0.0, 10.0, 10.0), (1.5, 15.0, 10.0), (2.0, 20.0, 20.0), (3.0, 30.0, 20.0), (9.0, 40.0, 40.0)]
        {
            assert_eq!((linear.at(t, false), step.at(t, false)), (vec![on_line], vec![on_step]), "{t}");
        }
    }

    /// The Hermite spline through x^3 from 0 to 2 is x^3 itself; tangents are a unit of time's.
    #[test]
    fn splines_follow_a_cubic() {
        let (times, values) = ([0.0, 2.0], [0.0, 0.0, 0.0, 12.0, 8.0, 12.0]);
        let spline = track(&times, &values, 1, Interpolation::Cubic);
        for t in [0.0, 0.3, 1.0, 1.7, 2.0] {
            assert!((spline.at(t, false)[0] - t.powi(3)).abs() < 1e-12);
        }
    }

    /// From the identity to a quarter turn, written with the other sign: halfway is an eighth turn, not the long way.
    #[test]
    fn rotations_go_the_short_way() {
        let end = -DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let values: Vec<f32> =
            [0.0, 0.0, 0.0, 1.0].into_iter().chain(end.to_array().map(|v| v as f32)).collect();
        let q = track(&[0.0, 1.0], &values, 4, Interpolation::Linear).at(0.5, true);
        let expected = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
        assert!(DQuat::from_slice(&q).dot(expected).abs() > 1.0 - 1e-9);
    }
}
