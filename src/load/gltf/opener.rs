//! The accessors of a primitive's attributes, checked one by one and together.

use super::accessor::Accessor;
use super::document::Document;
use super::report::{Noted, Report, Sound};
use gltf::json::accessor::{ComponentType, Type};

/// Which component types an attribute may have.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// Floats; signed or unsigned small integers with KHR_mesh_quantization.
    Signed,
    /// Floats and normalised unsigned integers.
    Unsigned,
    /// The same, and any small integers with KHR_mesh_quantization.
    Coordinate,
    /// Small unsigned integers as they are.
    Joints,
}

/// Opens the accessors of one primitive's attributes, all of them even if one has problems.
pub(super) struct Opener<'d, 'a, 'r> {
    doc: &'d Document<'a>,
    at: &'r str,
    /// Between the primitive's pointer and the attribute's name.
    inside: &'r str,
    report: &'r mut Report,
    quantized: bool,
    /// The number of vertices, known from the first attribute on.
    count: Option<usize>,
    /// Are all attributes so far sound?
    sound: Sound<()>,
}

impl<'d, 'a, 'r> Opener<'d, 'a, 'r> {
    /// For attributes that stand at `at` + `inside` in the file, and that have `count` elements each, if that is known.
    pub fn new(
        doc: &'d Document<'a>,
        at: &'r str,
        inside: &'r str,
        count: Option<usize>,
        report: &'r mut Report,
    ) -> Opener<'d, 'a, 'r> {
        let quantized = doc.extension_used("KHR_mesh_quantization");
        Opener { doc, at, inside, report, quantized, count, sound: Ok(()) }
    }

    /// The accessor of an attribute; `None` if there is no such attribute, or it has problems (which `finish` tells).
    pub fn open(
        &mut self,
        index: Option<usize>,
        name: &str,
        types: &[Type],
        kind: Kind,
    ) -> Option<Accessor<'d>> {
        let from = format!("{}{}/{name}", self.at, self.inside);
        let opened = Accessor::open(self.doc, index?, &from, self.report);
        let usable = opened.and_then(|accessor| self.check(accessor, types, kind));
        usable.map_err(|noted: Noted| self.sound = Err(noted)).ok()
    }

    fn check(&mut self, accessor: Accessor<'d>, types: &[Type], kind: Kind) -> Sound<Accessor<'d>> {
        let expected = *self.count.get_or_insert(accessor.count);
        check_type(&accessor, types, kind, self.quantized, self.report)?;
        if accessor.count != expected {
            let message = format!("has {} elements for {expected} vertices", accessor.count);
            return Err(self.report.problem(accessor.pointer.clone(), message));
        }
        Ok(accessor)
    }

    /// The number of vertices, if all is sound and the file justifies the memory they take after `base` others.
    pub fn finish(self, base: usize, bytes_per_vertex: u64) -> Sound<usize> {
        self.sound?;
        let Some(count) = self.count else { return Err(self.report.problem(self.at, "has no attributes")) };
        let fits = base.checked_add(count).is_some_and(|n| u32::try_from(n).is_ok());
        if fits && self.doc.may_decode(bytes_per_vertex.saturating_mul(count as u64)) {
            return Ok(count);
        }
        let message = format!("{count} vertices are more than the size of the file justifies");
        Err(self.report.problem(self.at, message))
    }
}

/// Has an accessor the type that its attribute needs (glTF 2.0, section 3.7.2.1, and KHR_mesh_quantization)?
fn check_type(
    accessor: &Accessor,
    types: &[Type],
    kind: Kind,
    quantized: bool,
    report: &mut Report,
) -> Sound<()> {
    let small = matches!(
        accessor.component,
        ComponentType::I8 | ComponentType::U8 | ComponentType::I16 | ComponentType::U16
    );
    let unsigned =
        matches!(accessor.component, ComponentType::U8 | ComponentType::U16) && accessor.normalized;
    let component = match kind {
        Kind::Signed => small && quantized,
        Kind::Unsigned => unsigned,
        Kind::Coordinate => unsigned || small && quantized,
        // Normalised indices are wrong, but what they mean is clear only if they are not.
        Kind::Joints => {
            matches!(accessor.component, ComponentType::U8 | ComponentType::U16) && !accessor.normalized
        }
    };
    let is_float = accessor.component == ComponentType::F32 && !matches!(kind, Kind::Joints);
    let fits = types.contains(&accessor.kind) && (component || is_float);
    if !fits {
        let named: Vec<String> = types.iter().map(|t| format!("{t:?}").to_uppercase()).collect();
        let component = if matches!(kind, Kind::Joints) { "U8 or U16" } else { "F32" };
        let (held, named) = (accessor.contents(), named.join(" or "));
        let message = format!("holds {held}; this attribute needs {named} of {component}");
        return Err(report.problem(accessor.pointer.clone(), message));
    }
    Ok(())
}
