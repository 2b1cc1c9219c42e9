//! Problems while they are found: each with its place, many of one kind counted.

use crate::error::Problem;
use crate::math::{all_finite, count_not_finite};
use rayon::prelude::*;
use std::fmt::{Debug, Display, Formatter, Result};

/// Problems of one kind beyond this many are only counted.
const MAX_ALIKE: usize = 8;
/// Numbers that one thread looks at in a row.
pub(super) const BLOCK: usize = 1 << 16;

/// Required of images that are not textures.
pub(super) const DECODED: &str = "decoded";

/// An entry of one of the scene's lists.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    /// The list's field in the scene.
    pub list: &'static str,
    /// Which entry.
    pub index: usize,
    /// Its name, empty if it has none.
    pub name: &'a str,
}

impl Display for Entry<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{}[{}]", self.list, self.index)?;
        if self.name.is_empty() { Ok(()) } else { write!(f, " '{}'", self.name) }
    }
}

/// How often one kind of problem was found.
struct RepeatedProblem {
    field: &'static str,
    what: &'static str,
    count: usize,
}

/// The findings so far.
#[derive(Default)]
pub(super) struct Findings {
    list: Vec<Problem>,
    kinds: Vec<RepeatedProblem>,
}

impl Findings {
    /// A field holds something that it must not: `allowed` follows "must be".
    pub fn reject(
        &mut self,
        place: impl Display,
        field: &'static str,
        found: impl Debug,
        allowed: &'static str,
    ) {
        if self.is_listed(field, allowed) {
            // Vectors as lists of their numbers.
            let found = format!("{found:?}").replace("DVec3", "").replace("DQuat", "");
            let message = format!("is {found}, but must be {allowed}");
            self.list.push(Problem::new(format!("{place}, {field}"), message));
        }
    }

    /// Rejects a field unless a condition holds.
    pub fn require(
        &mut self,
        is_met: bool,
        place: impl Display,
        field: &'static str,
        found: impl Debug,
        allowed: &'static str,
    ) {
        if !is_met {
            self.reject(place, field, found, allowed);
        }
    }

    /// Colours and intensities.
    pub fn require_color(&mut self, rgb: &[f32; 3], place: impl Display, field: &'static str) {
        let is_met = rgb.iter().all(|c| c.is_finite() && *c >= 0.0);
        self.require(is_met, place, field, rgb, "finite numbers from 0 up");
    }

    /// Lengths and ratios.
    pub fn require_length(
        &mut self,
        length: f64,
        place: impl Display,
        field: &'static str,
        found: impl Debug,
    ) {
        let is_met = length > 0.0 && length.is_finite();
        self.require(is_met, place, field, found, "a finite number above 0");
    }

    /// Many numbers, of which those that are NaN or infinite are counted.
    pub fn require_finite(&mut self, numbers: &[f32], place: impl Display, field: &'static str) {
        const WHAT: &str = "finite numbers";
        if !numbers.par_chunks(BLOCK).all(all_finite) && self.is_listed(field, WHAT) {
            let (bad, all) = (count_not_finite(numbers), numbers.len());
            let message = format!("{bad} of {all} numbers are NaN or infinite, but must be {WHAT}");
            self.list.push(Problem::new(format!("{place}, {field}"), message));
        }
    }

    /// All problems, with a line for each kind that has more than are listed.
    pub fn into_problems(self) -> Vec<Problem> {
        let Findings { mut list, kinds } = self;
        for RepeatedProblem { field, what, count } in kinds.into_iter().filter(|k| k.count > MAX_ALIKE) {
            let more = count - MAX_ALIKE;
            list.push(Problem::new("", format!("{more} more of this kind: {field} must be {what}")));
        }
        list
    }

    /// Counts a problem of a kind; true for the first few.
    fn is_listed(&mut self, field: &'static str, what: &'static str) -> bool {
        let known = self.kinds.iter().position(|k| k.field == field && k.what == what);
        let at = known.unwrap_or_else(|| {
            self.kinds.push(RepeatedProblem { field, what, count: 0 });
            self.kinds.len() - 1
        });
        self.kinds[at].count += 1;
        self.kinds[at].count <= MAX_ALIKE
    }
}
