//! Numbers that images must not have.

use super::source::{Source, Use};
use crate::error::Warning;

/// Sets NaN, infinite and, in environments, negative numbers to 0, and counts them.
pub(super) struct Repair {
    is_environment: bool,
    not_finite: usize,
    negative: usize,
    total: usize,
}

impl Repair {
    pub fn new(purpose: Use) -> Repair {
        Repair { is_environment: purpose == Use::Environment, not_finite: 0, negative: 0, total: 0 }
    }

    pub fn apply(&mut self, numbers: &mut [f32]) {
        self.total += numbers.len();
        for v in numbers {
            if !v.is_finite() {
                self.not_finite += 1;
                *v = 0.0;
            } else if *v < 0.0 && self.is_environment {
                self.negative += 1;
                *v = 0.0;
            }
        }
    }

    pub fn warn(self, source: &Source, warnings: &mut Vec<Warning>) {
        let total = self.total;
        for (count, what) in [(self.not_finite, "NaN or infinite"), (self.negative, "negative")] {
            if count > 0 {
                warnings.push(source.warning(format!("{count} of {total} numbers are {what} and became 0")));
            }
        }
    }
}
