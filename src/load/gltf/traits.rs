//! What the `extras` of a node say about rays, as exporters write custom properties: `visible_to`, kinds of rays in a list or
//! separated by commas or spaces, or one true or false for each kind, `visible_camera`, `visible_diffuse`, `visible_glossy`,
//! `visible_transmission`, `visible_volume` (or `visible_volume_scatter`) and `visible_shadow`; and `holdout` and
//! `shadow_catcher`, also with `is_` before them.

use super::report::Report;
use crate::scene::{ObjectTraits, RayKinds};
use serde_json::Value;

/// The traits of a node, from its JSON.
pub(super) fn of_node(raw: &Value, at: &str, report: &mut Report) -> ObjectTraits {
    let Some(extras) = raw.get("extras").filter(|extras| extras.is_object()) else {
        return ObjectTraits::default();
    };
    let at = format!("{at}/extras");
    let mut visible_to = listed(extras, &at, report);
    for (name, kind) in RayKinds::NAMED {
        let keys = [format!("visible_{name}"), format!("visible_{name}_scatter")];
        for key in keys.iter().take(if kind == RayKinds::VOLUME { 2 } else { 1 }) {
            if let Some(is_seen) = flag(extras, key, &at, report) {
                visible_to = visible_to.set(kind, is_seen);
            }
        }
    }
    let mut is = |keys: [&str; 2]| keys.iter().any(|key| flag(extras, key, &at, report) == Some(true));
    let is_holdout = is(["holdout", "is_holdout"]);
    let is_shadow_catcher = is(["shadow_catcher", "is_shadow_catcher"]);
    ObjectTraits { visible_to, is_holdout, is_shadow_catcher, ..ObjectTraits::default() }
}

/// The kinds that are listed; all where none are.
fn listed(extras: &Value, at: &str, report: &mut Report) -> RayKinds {
    let Some(value) = extras.get("visible_to") else { return RayKinds::ALL };
    let names: Option<Vec<&str>> = match value {
        Value::String(text) => Some(text.split([',', ' ']).filter(|name| !name.is_empty()).collect()),
        Value::Array(list) => list.iter().map(Value::as_str).collect(),
        _ => None,
    };
    let kind = |name: &&str| RayKinds::NAMED.iter().find(|(other, _)| other == name).map(|(_, kind)| *kind);
    let kinds: Option<Vec<RayKinds>> = names.and_then(|names| names.iter().map(kind).collect());
    match kinds {
        Some(kinds) => kinds.into_iter().fold(RayKinds::NONE, RayKinds::with),
        None => {
            let known = RayKinds::NAMED.map(|(name, _)| name).join(", ");
            report.warn(format!("{at}/visible_to"), format!("holds more than {known}; ignored"));
            RayKinds::ALL
        }
    }
}

/// True or false, which custom properties may also say by 1 and 0.
fn flag(extras: &Value, key: &str, at: &str, report: &mut Report) -> Option<bool> {
    let value = extras.get(key)?;
    let found = match value.as_f64() {
        Some(1.0) => Some(true),
        Some(0.0) => Some(false),
        _ => value.as_bool(),
    };
    if found.is_none() {
        report.warn(format!("{at}/{key}"), "is neither true nor false; ignored");
    }
    found
}
