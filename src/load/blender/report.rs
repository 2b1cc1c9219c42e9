//! What the exporter answers.

use serde::Deserialize;

/// Pairs of a place (a material, an object; empty for the whole file) and a message.
type Messages = Vec<(String, String)>;

/// The exporter's answer.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Report {
    /// Why there is no export.
    pub error: Option<String>,
    /// The moment of the picture in the model's animations, seconds, if it has any.
    pub moment: Option<f64>,
    /// Frames a second in them.
    pub fps: Option<f64>,
    /// What was lost.
    pub warnings: Messages,
    /// What was chosen.
    pub notes: Messages,
}

impl Report {
    /// Reads the answer; `None` if it is none.
    pub fn parse(bytes: &[u8]) -> Option<Report> {
        serde_json::from_slice(bytes).ok()
    }
}
