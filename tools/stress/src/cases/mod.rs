//! The cases. Each takes the share of its full number of tries and gives rows of the table.

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
    /// What was tried.
    pub what: String,
    /// How often.
    pub tried: u64,
    /// How often it went wrong; 0 is the only good number.
    pub wrong: u64,
    /// The largest error, in words.
    pub worst: String,
}

/// A case: from the share of the full number of tries to rows.
pub type Case = fn(f64) -> Vec<Row>;

/// All cases in the order of the table.
pub const CASES: [Case; 7] =
    [leaks::run, contacts::run, spheres::run, grazing::run, transforms::run, picture::run, levels::run];
