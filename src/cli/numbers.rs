//! Numbers among the arguments.

/// A number for which `is_valid` holds.
pub(super) fn number(text: &str, is_valid: impl Fn(f64) -> bool, what: &str) -> Result<f64, String> {
    text.parse().ok().filter(|&v| is_valid(v)).ok_or_else(|| format!("must be {what}"))
}

/// Stops of exposure; the range is that of scene files.
pub(super) fn stops(text: &str) -> Result<f32, String> {
    number(text, |v| (-100.0..=100.0).contains(&v), "a number from -100 to 100").map(|v| v as f32)
}
