//! KHR_materials_variants: the material of a primitive in the variant that is shown.

use super::document::Document;
use super::options::GltfOptions;
use super::report::Report;
use crate::error::Problem;
use gltf::json::mesh::Primitive;
use serde_json::Value;

const VARIANTS: &str = "/extensions/KHR_materials_variants/variants";

/// Checks that the variant that the user wants exists.
pub(super) fn check(doc: &Document, report: &mut Report) {
    let Some(wanted) = &doc.options.variant else { return };
    if let Err(help) = GltfOptions::find(&names(doc), wanted) {
        let message = format!("there is no variant '{wanted}' of the materials");
        report.add(Problem::new("/extensions", message).with_help(help));
    }
}

/// The names of a file's variants.
pub(super) fn names(doc: &Document) -> Vec<String> {
    let list = doc.json.pointer(VARIANTS).and_then(Value::as_array);
    let name = |v: &Value| v.get("name").and_then(Value::as_str).unwrap_or_default().to_string();
    list.into_iter().flatten().map(name).collect()
}

/// The material of a primitive: that of the chosen variant, or its own.
pub(super) fn material(
    doc: &Document,
    primitive: &Primitive,
    at: &str,
    report: &mut Report,
) -> Option<usize> {
    let own = primitive.material.map(|m| m.value());
    let Some(chosen) = doc.options.variant.as_ref().and_then(|v| GltfOptions::find(&names(doc), v).ok())
    else {
        return own;
    };
    let extension = doc.json.pointer(&format!("{at}/extensions/KHR_materials_variants/mappings"));
    let mappings = extension.and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    if mappings.is_empty() && extension.is_some() {
        report.warn(at, "has variants, but no list of them; its own material is shown");
    }
    let is_chosen = |mapping: &&Value| {
        let variants = mapping.get("variants").and_then(Value::as_array);
        variants.is_some_and(|list| list.iter().any(|v| v.as_u64() == Some(chosen as u64)))
    };
    let Some(mapping) = mappings.iter().find(is_chosen) else { return own };
    let material = mapping.get("material").and_then(Value::as_u64).and_then(|m| usize::try_from(m).ok());
    if material.is_none() {
        report.warn(at, "has a variant without a material; its own material is shown");
    }
    material.or(own)
}
