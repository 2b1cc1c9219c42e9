//! Settings of rendering.

use super::findings::Findings;
use crate::scene::Settings;

const PLACE: &str = "settings";

pub(super) fn check(settings: &Settings, findings: &mut Findings) {
    let counts = [("width", settings.width), ("height", settings.height), ("samples", settings.samples)];
    for (field, count) in counts {
        if let Some(count) = count {
            findings.require(count > 0, PLACE, field, count, "at least 1");
        }
    }
    for (field, value) in [("noise", settings.noise), ("white_balance", settings.white_balance)] {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
            findings.require(false, PLACE, field, value, "a number above 0");
        }
    }
    if let Some(exposure) = settings.exposure {
        findings.require(exposure.is_finite(), PLACE, "exposure", exposure, "a finite number");
    }
}
