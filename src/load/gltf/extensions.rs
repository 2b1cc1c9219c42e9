//! Versions and extensions: what the file demands, and what it uses that is not understood.

use super::document::{Document, pointer};
use super::report::Report;
use crate::error::{Choice, Problem};
use crate::load::decoders::Decoder;
use serde_json::Value;
use std::collections::BTreeMap;

/// Extensions that are read, some of them by a decoder that a build may lack.
const READ: &[&str] = &[
    "EXT_lights_area",
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    "EXT_mesh_primitive_restart",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_roughness",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_scatter",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_primitive_restart",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// Extensions that may be demanded though they are not read: without them the picture is one that the file means, too.
const HARMLESS: &[(&str, &str)] = &[("KHR_xmp_json_ld", "metadata are not read")];

/// Extensions that change no picture: they are left out without a word.
const OF_INTERACTION: &[&str] = &["KHR_interactivity", "KHR_node_hoverability", "KHR_node_selectability"];

/// Extensions that are not read, and what that means.
const UNREAD: &[(&str, &str)] =
    &[("KHR_gaussian_splatting", "splats are not surfaces and can't be rendered; export a mesh of them")];

impl Document<'_> {
    /// Does the file declare the use of an extension?
    pub fn extension_used(&self, name: &str) -> bool {
        self.lists("extensionsUsed", name)
    }

    /// Does the file demand an extension?
    #[cfg(not(feature = "draco"))]
    pub fn extension_required(&self, name: &str) -> bool {
        self.lists("extensionsRequired", name)
    }

    fn lists(&self, key: &str, name: &str) -> bool {
        let list = self.json.get(key).and_then(Value::as_array);
        list.is_some_and(|list| list.iter().any(|v| v.as_str() == Some(name)))
    }
}

/// Is an extension read by this build?
pub(super) fn is_read(name: &str) -> bool {
    READ.contains(&name) && lacking_decoder(name).is_none()
}

/// The decoder for want of which an extension is not read.
fn lacking_decoder(name: &str) -> Option<Decoder> {
    let decoder = match name {
        "EXT_texture_webp" => Decoder::WebP,
        "KHR_draco_mesh_compression" => Decoder::Draco,
        "KHR_texture_basisu" => Decoder::Ktx2,
        _ => return None,
    };
    (!decoder.is_built_in()).then_some(decoder)
}

/// Checks the version and the extensions that the file demands.
pub(super) fn check(doc: &Document, report: &mut Report) {
    let asset = doc.json.get("asset").unwrap_or(&Value::Null);
    let major = |key: &str| asset.get(key).and_then(Value::as_str).map(|v| v.split('.').next() == Some("2"));
    match (major("version"), asset.get("minVersion").and_then(Value::as_str)) {
        (Some(true), None | Some("2.0")) => {}
        (None, _) => {
            report.problem("/asset/version", "is missing: this is no glTF 2.0 file");
        }
        _ => {
            let problem = Problem::new("/asset/version", "is not 2.0");
            report.add(problem.with_help("only glTF 2.0 is read; convert the file"));
        }
    }
    let Some(required) = doc.json.get("extensionsRequired") else { return };
    let Some(required) = required.as_array() else {
        report.problem("/extensionsRequired", "is not a list of names");
        return;
    };
    for (i, name) in required.iter().enumerate() {
        let at = pointer("extensionsRequired", i);
        match name.as_str() {
            None => {
                report.problem(at, "is not a name");
            }
            Some(name) if is_read(name) || HARMLESS.iter().any(|(h, _)| *h == name) => {}
            Some(name) if OF_INTERACTION.contains(&name) => {}
            Some(name) => {
                let (reason, remedy) = match lacking_decoder(name) {
                    Some(decoder) => (format!(": {}", decoder.lack()), decoder.remedy()),
                    None => {
                        let known = UNREAD.iter().find(|(unread, _)| *unread == name);
                        let why = known.map_or(String::new(), |(_, effect)| format!(": {effect}"));
                        (format!(", which is not supported{why}"), "export it without this extension".into())
                    }
                };
                let message = format!("the file demands {name}{reason}");
                if doc.options.force {
                    report.warn(at, format!("{message}; {} goes on", Choice::Force));
                } else {
                    let help = format!("{remedy}, or go on without it by {}", Choice::Force);
                    report.add(Problem::new(at, message).with_help(help));
                }
            }
        }
    }
}

/// Notes a problem where the extensions of an object, or one that is read, are none: what they say would be lost.
pub(super) fn check_shape(object: &Value, at: &str, report: &mut Report) {
    let Some(extensions) = object.get("extensions") else { return };
    let Some(all) = extensions.as_object() else {
        report.problem(format!("{at}/extensions"), "is not an object");
        return;
    };
    for (name, _) in all.iter().filter(|(name, e)| READ.contains(&name.as_str()) && !e.is_object()) {
        report.problem(format!("{at}/extensions/{name}"), "is not an object");
    }
}

/// Warns of each extension that is in use and not read, with the number of places.
pub(super) fn warn_unread(doc: &Document, report: &mut Report) {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    count(&doc.json, &mut counts);
    for (name, places) in counts.into_iter().filter(|(name, _)| is_missed(name)) {
        let harmless =
            HARMLESS.iter().chain(UNREAD).find(|(h, _)| *h == name).map(|(_, effect)| effect.to_string());
        let lack =
            || lacking_decoder(name).map(|decoder| format!("{}; {}", decoder.lack(), decoder.remedy()));
        let effect = harmless.or_else(lack).map_or(String::new(), |effect| format!(": {effect}"));
        let times = if places == 1 { "one place".to_string() } else { format!("{places} places") };
        report.warn("", format!("{name} is not read, in {times}{effect}"));
    }
}

/// Is an extension one whose absence is to be told?
fn is_missed(name: &str) -> bool {
    !is_read(name) && !OF_INTERACTION.contains(&name)
}

/// Counts the extensions that stand in objects; the parser bounds the depth.
fn count<'v>(value: &'v Value, counts: &mut BTreeMap<&'v str, usize>) {
    match value {
        Value::Object(object) => {
            for (key, child) in object {
                match child.as_object().filter(|_| key == "extensions") {
                    Some(extensions) => {
                        for (name, extension) in extensions {
                            *counts.entry(name).or_default() += 1;
                            count(extension, counts);
                        }
                    }
                    None if key == "extras" => {}
                    None => count(child, counts),
                }
            }
        }
        Value::Array(list) => list.iter().for_each(|child| count(child, counts)),
        _ => {}
    }
}
