//! The cases. Each takes the fraction of its full number of tries and returns rows of the table.

mod contacts;
mod grazing;
mod leaks;
mod levels;
mod meshes;
mod picture;
mod spheres;
mod transforms;

/// A line of the table.
#[derive(Debug)]
pub struct Row {
    /// What was tested.
    pub what: String,
    /// Number of tries.
    pub tried: u64,
    /// Number of failures; must be 0.
    pub wrong: u64,
    /// The largest error, as text.
    pub worst: String,
}

/// A case: from the fraction of the full number of tries to rows.
pub type Case = fn(f64) -> Vec<Row>;

/// All cases in the order of the table.
pub const CASES: [Case; 7] =
    [leaks::run, contacts::run, spheres::run, grazing::run, transforms::run, picture::run, levels::run];
