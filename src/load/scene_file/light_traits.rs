//! What lights of scene files have in common.

use super::fields::Fields;
use super::motion::Moved;
use crate::scene::{Lamp, LightLinks, is_group_name};

/// What all shapes of lights have.
pub(super) struct LightTraits {
    pub name: String,
    pub color: [f32; 3],
    pub lamp: Lamp,
    pub group: String,
    pub links: LightLinks,
    /// Where it moves.
    pub moved: Option<Moved>,
}

/// The name of a group of lights; empty where none is given.
pub(super) fn group(fields: &Fields, key: &'static str) -> String {
    let Some(name) = fields.string(key) else { return String::new() };
    if !is_group_name(name.value) {
        let message = format!("'{}' can't be the name of a group of lights", name.value);
        fields.problems.push_help(name.span, message, "use 1 to 64 letters, digits, _ and -");
    }
    name.value.to_string()
}

/// `power` times a factor, or the quantity itself.
pub(super) fn strength(fields: &Fields, quantity: &'static str, per_watt: f64) -> Option<f64> {
    match (positive(fields, "power"), positive(fields, quantity)) {
        (Some(power), None) => Some(power * per_watt),
        (None, Some(own)) => Some(own),
        _ => {
            let message = format!("the light needs either 'power' or '{quantity}'");
            fields.problems.push(fields.span(), message);
            None
        }
    }
}

/// A number from 0 up.
pub(super) fn positive(fields: &Fields, key: &'static str) -> Option<f64> {
    fields.has(key).then(|| fields.number_in(key, 0.0..f64::from(f32::MAX), 0.0))
}
