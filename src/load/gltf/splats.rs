//! Gaussian splats of points: `KHR_gaussian_splatting`, and its compression as SPZ (`KHR_gaussian_splatting_compression_spz_2`; an
//! older draft, `KHR_spz_gaussian_splats_compression`, stands in the primitive itself).
//!
//! The numbers of SPZ are taken as they are, as those of accessors: the draft of the extension speaks of another orientation than that
//! of SPZ files, but CesiumJS, for which it was made, shows its files without turning them.

use super::document::{Document, pointer};
use super::report::{Report, Valid};
use super::vertices::{AttributeFormat, AttributeReader};
use crate::load::files;
use crate::load::splats::{FileSplat, SplatList, exp, spz};
use crate::math::DVec3;
use crate::scene::{MaterialId, Mesh, Splats};
use gltf::json::accessor::Type;
use serde_json::Value;

/// The extension.
pub(super) const NAME: &str = "KHR_gaussian_splatting";
/// The extension of it whose splats are an SPZ file in a view of a buffer.
const SPZ: &str = "KHR_gaussian_splatting_compression_spz";
/// The extension of primitives in an older draft.
const SPZ_OF_PRIMITIVES: &str = "KHR_spz_gaussian_splats_compression";

/// Bytes that a splat takes in the scene, about.
const BYTES_PER_SPLAT: u64 = 160;

/// Are a primitive's points splats?
pub(super) fn are_splats(doc: &Document, mesh: usize, primitive: usize, report: &mut Report) -> bool {
    raw(doc, mesh, primitive, report).is_some_and(|raw| extension(raw).is_some())
}

fn raw<'d>(doc: &'d Document, mesh: usize, primitive: usize, report: &mut Report) -> Option<&'d Value> {
    let at = pointer("meshes", mesh);
    doc.raw("meshes", mesh, &at, report).ok()?.get("primitives")?.get(primitive)
}

fn extension(raw: &Value) -> Option<&Value> {
    let extensions = raw.get("extensions")?;
    extensions.get(NAME).or_else(|| extensions.get(SPZ_OF_PRIMITIVES))
}

/// The view of a buffer that holds a primitive's splats as SPZ.
fn spz_view(raw: &Value, extension: &Value) -> Option<usize> {
    let own = raw.get("extensions").and_then(|all| all.get(SPZ_OF_PRIMITIVES));
    let inner = extension.get("extensions").and_then(Value::as_object);
    // The number at its end is the version of SPZ, which SPZ data state, too.
    let inner = inner.and_then(|all| all.iter().find(|(name, _)| name.starts_with(SPZ)));
    let spz = inner.map(|(_, spz)| spz).or(own)?;
    spz.get("bufferView")?.as_u64().map(|view| view as usize)
}

/// The splats of a primitive as a mesh of their own, with a material.
pub(super) fn read(
    doc: &Document,
    (mesh, primitive): (usize, usize),
    material: impl FnOnce() -> MaterialId,
    at: &str,
    report: &mut Report,
) -> Valid<Option<Mesh>> {
    let Some(raw) = raw(doc, mesh, primitive, report) else { return Ok(None) };
    let Some(extension) = extension(raw) else { return Ok(None) };
    let inner = extension.get("extensions").and_then(Value::as_object);
    let mut list = match (spz_view(raw, extension), inner) {
        (Some(view), _) => compressed(doc, view, at, report)?,
        (None, Some(inner)) => {
            let names: Vec<&str> = inner.keys().map(String::as_str).collect();
            let message = format!("is compressed by {}, which is not read", names.join(", "));
            return Err(report.warn(at, message));
        }
        (None, None) => plain(doc, raw, at, report)?,
    };
    warn_of_kinds(extension, at, report);
    list.set_linear(extension.get("colorSpace").and_then(Value::as_str) == Some("lin_rec709_display"));
    let (messages, faint) = list.messages();
    for what in messages {
        report.warn(at, what);
    }
    if let Some(what) = faint {
        report.warn(at, what);
    }
    match list.is_empty() {
        true => Err(report.warn(at, ("splats-invisible", "holds no splats that can be seen"))),
        false => Ok(Some(list.into_mesh("splats", material()))),
    }
}

/// Warns of kernels and colours of later extensions.
fn warn_of_kinds(extension: &Value, at: &str, report: &mut Report) {
    let known =
        [("kernel", &["ellipse"][..]), ("colorSpace", &["srgb_rec709_display", "lin_rec709_display"])];
    for (key, values) in known {
        if let Some(other) = extension.get(key).and_then(Value::as_str).filter(|v| !values.contains(v)) {
            report.warn(
                at,
                ("splats-kernel", format!("has the {key} '{other}', which is taken as '{}'", values[0])),
            );
        }
    }
}

/// The splats of an SPZ file in a view of a buffer.
fn compressed(doc: &Document, view: usize, at: &str, report: &mut Report) -> Valid<SplatList> {
    let bytes = files::inflated(doc.view(view, at, report)?.bytes).map_err(|why| report.problem(at, why))?;
    let (list, messages) = spz::read(&bytes).map_err(|problem| report.problem(at, problem.message))?;
    if let Some(what) = messages {
        report.warn(at, what);
    }
    Ok(list)
}

/// The splats of accessors.
fn plain(doc: &Document, raw: &Value, at: &str, report: &mut Report) -> Valid<SplatList> {
    let index = |name: &str| raw.get("attributes")?.get(name)?.as_u64().map(|index| index as usize);
    let own = |name: &str| index(&format!("{NAME}:{name}"));
    let coefficient = |(l, n): (u8, u8)| own(&format!("SH_DEGREE_{l}_COEF_{n}"));
    let of_degree = |l: u8| (0..2 * l + 1).map(move |n| (l, n));
    let needed = [("ROTATION", own("ROTATION")), ("SCALE", own("SCALE")), ("OPACITY", own("OPACITY"))];
    let needed = needed.into_iter().chain([("SH_DEGREE_0_COEF_0", coefficient((0, 0)))]);
    let missing: Vec<&str> = needed.filter(|(_, index)| index.is_none()).map(|(name, _)| name).collect();
    if index("POSITION").is_none() || !missing.is_empty() {
        return Err(report
            .warn(at, ("splats-incomplete", format!("lacks attributes of splats: {}", missing.join(", ")))));
    }
    let degree =
        (1..=Splats::MAX_DEGREE).take_while(|&l| of_degree(l).all(|c| coefficient(c).is_some())).count();
    let mut opener = AttributeReader::new(doc, at, "/attributes", None, report);
    let mut open = |index, name: &str, kind: Type| opener.open(index, name, &[kind], AttributeFormat::Any);
    let positions = open(index("POSITION"), "POSITION", Type::Vec3);
    let rotations = open(own("ROTATION"), "ROTATION", Type::Vec4);
    let scales = open(own("SCALE"), "SCALE", Type::Vec3);
    let opacities = open(own("OPACITY"), "OPACITY", Type::Scalar);
    let all = (0..=degree as u8).flat_map(of_degree);
    let harmonics: Vec<_> = all.map(|c| open(coefficient(c), "SH_DEGREE", Type::Vec3)).collect();
    let count = opener.finish(0, BYTES_PER_SPLAT)?;
    let mut lists =
        (vec![[0.0; 3]; count], vec![[0.0; 4]; count], vec![[0.0; 3]; count], vec![[0.0; 1]; count]);
    positions.iter().for_each(|accessor| accessor.read_floats(&mut lists.0));
    rotations.iter().for_each(|accessor| accessor.read_floats(&mut lists.1));
    scales.iter().for_each(|accessor| accessor.read_floats(&mut lists.2));
    opacities.iter().for_each(|accessor| accessor.read_floats(&mut lists.3));
    // By coefficient, then by splat.
    let mut colors = vec![[0.0f32; 3]; count * harmonics.len()];
    for (accessor, list) in harmonics.iter().flatten().zip(colors.chunks_exact_mut(count.max(1))) {
        accessor.read_floats(list);
    }
    let are_logarithms = lists.2.iter().flatten().any(|scale| *scale < 0.0);
    if are_logarithms {
        report.warn(at, "has scales below 0: they are taken as logarithms, as in drafts of the extension");
    }
    let mut list = SplatList::new(count, degree as u8, DVec3::ZERO)
        .map_err(|problem| report.problem(at, problem.message))?;
    let mut own = Vec::new();
    for i in 0..count {
        own.clear();
        own.extend((0..harmonics.len()).map(|k| colors[k * count + i]));
        let scales = if are_logarithms { lists.2[i].map(exp) } else { lists.2[i] };
        list.push(&FileSplat {
            center: DVec3::from(lists.0[i].map(f64::from)),
            scales,
            rotation: lists.1[i],
            opacity: lists.3[i][0],
            coefficients: &own,
        });
    }
    Ok(list)
}
