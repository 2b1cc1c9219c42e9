//! Samplers of animations: the keys in accessors, and the value at a moment.

use super::accessor::Accessor;
use super::document::{Document, index_of, required};
use super::report::{Report, Sound};
use super::track::{Interpolation, Track};
use gltf::json::accessor::{ComponentType, Type};
use serde_json::Value;
use std::collections::HashMap;
use std::rc::Rc;

/// What a channel drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    /// So many numbers, 1 to 4.
    Numbers(usize),
    /// A unit quaternion.
    Rotation,
    /// Weights of morph targets, however many.
    Weights,
    /// Something that is on or off.
    Flag,
}

impl Element {
    /// Components of an element of the output.
    fn width(self) -> usize {
        match self {
            Element::Numbers(count) => count,
            Element::Rotation => 4,
            Element::Weights | Element::Flag => 1,
        }
    }
}

/// Reads samplers at one moment.
pub(super) struct Samplers<'d, 'a> {
    doc: &'d Document<'a>,
    time_s: f64,
    /// Key times by accessor; channels share them.
    times: HashMap<usize, Sound<Rc<Vec<f32>>>>,
}

impl<'d, 'a> Samplers<'d, 'a> {
    /// Those of a file at a moment, seconds.
    pub fn new(doc: &'d Document<'a>, time_s: f64) -> Samplers<'d, 'a> {
        Samplers { doc, time_s, times: HashMap::new() }
    }

    /// The value of a channel at the moment.
    pub fn value(
        &mut self,
        animation: &Value,
        channel: &Value,
        element: Element,
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
        let values = self.values(output?, element, at, report)?;
        if element == Element::Flag && interpolation != Interpolation::Step {
            return Err(
                report.problem(at, "switches something on and off, which needs the interpolation STEP")
            );
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

    fn values(&self, index: usize, element: Element, at: &str, report: &mut Report) -> Sound<Vec<f32>> {
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
            let wanted = format!("{kind:?}").to_uppercase();
            let message =
                format!("holds {}; this channel needs {wanted} of {component}", accessor.contents());
            return Err(report.problem(accessor.pointer.clone(), message));
        }
        let count = self.affordable(&accessor, report)?;
        Ok(match width {
            1 => read::<1>(&accessor, count),
            2 => read::<2>(&accessor, count),
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
