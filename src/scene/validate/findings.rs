//! Collection of validation problems; many problems of one kind are only counted.

use crate::error::Problem;
use crate::math::{all_finite, count_not_finite};
use rayon::prelude::*;
use std::fmt::{Debug, Display, Formatter, Result};

/// Maximum number of listed problems of a kind.
const MAX_LISTED: usize = 8;
/// Numbers per task of parallel checks.
pub(super) const BLOCK: usize = 1 << 16;

/// Requirement on images that are not textures.
pub(super) const DECODED: &str = "decoded";

/// An entry of one of the scene's lists.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    /// Field of the scene.
    pub list: &'static str,
    /// Index in the list.
    pub index: usize,
    /// Name of the entry, may be empty.
    pub name: &'a str,
}

impl Display for Entry<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{}[{}]", self.list, self.index)?;
        if self.name.is_empty() { Ok(()) } else { write!(f, " '{}'", self.name) }
    }
}

/// Count of a kind of problem.
struct RepeatedProblem {
    field: &'static str,
    allowed: &'static str,
    count: usize,
}

/// Problems found so far.
#[derive(Default)]
pub(super) struct Findings {
    list: Vec<Problem>,
    kinds: Vec<RepeatedProblem>,
}

impl Findings {
    /// Adds a problem of a field; `allowed` continues "must be".
    pub fn reject(
        &mut self,
        place: impl Display,
        field: &'static str,
        found: impl Debug,
        allowed: &'static str,
    ) {
        if self.count(field, allowed) {
            // Vectors as plain tuples.
            let found = format!("{found:?}").replace("DVec3", "").replace("DQuat", "");
            let message = format!("is {found}, but must be {allowed}");
            self.list.push(Problem::new(format!("{place}, {field}"), message));
        }
    }

    /// Adds a problem unless a condition holds.
    pub fn require(
        &mut self,
        is_valid: bool,
        place: impl Display,
        field: &'static str,
        found: impl Debug,
        allowed: &'static str,
    ) {
        if !is_valid {
            self.reject(place, field, found, allowed);
        }
    }

    /// Checks a colour or intensity.
    pub fn require_color(&mut self, rgb: &[f32; 3], place: impl Display, field: &'static str) {
        let is_valid = rgb.iter().all(|c| c.is_finite() && *c >= 0.0);
        self.require(is_valid, place, field, rgb, "finite numbers from 0 up");
    }

    /// Checks a length or ratio.
    pub fn require_length(
        &mut self,
        length: f64,
        place: impl Display,
        field: &'static str,
        found: impl Debug,
    ) {
        let is_valid = length > 0.0 && length.is_finite();
        self.require(is_valid, place, field, found, "a finite number above 0");
    }

    /// Checks a list of numbers for NaN and infinity.
    pub fn require_finite(&mut self, numbers: &[f32], place: impl Display, field: &'static str) {
        const ALLOWED: &str = "finite numbers";
        if !numbers.par_chunks(BLOCK).all(all_finite) && self.count(field, ALLOWED) {
            let (bad, all) = (count_not_finite(numbers), numbers.len());
            let message = format!("{bad} of {all} numbers are NaN or infinite, but must be {ALLOWED}");
            self.list.push(Problem::new(format!("{place}, {field}"), message));
        }
    }

    /// All problems, with a line for the unlisted ones of each kind.
    pub fn into_problems(self) -> Vec<Problem> {
        let Findings { mut list, kinds } = self;
        for RepeatedProblem { field, allowed, count } in kinds.into_iter().filter(|k| k.count > MAX_LISTED) {
            let more = count - MAX_LISTED;
            list.push(Problem::new("", format!("{more} more of this kind: {field} must be {allowed}")));
        }
        list
    }

    /// Counts a problem of a kind; true for the first [`MAX_LISTED`].
    fn count(&mut self, field: &'static str, allowed: &'static str) -> bool {
        let found = self.kinds.iter().position(|k| k.field == field && k.allowed == allowed);
        let kind = found.unwrap_or_else(|| {
            self.kinds.push(RepeatedProblem { field, allowed, count: 0 });
            self.kinds.len() - 1
        });
        self.kinds[kind].count += 1;
        self.kinds[kind].count <= MAX_LISTED
    }
}
