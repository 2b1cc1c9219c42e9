//! Sets of objects by their names, which lights are linked to.

use super::fields::Fields;
use crate::scene::ObjectSet;
use std::ops::Range;

/// Names of objects, and where they are written.
pub(super) type Names = Vec<(String, Range<usize>)>;

/// The sets of objects that lights of a file are linked to.
#[derive(Default)]
pub(super) struct Linking {
    sets: Vec<NamedSet>,
}

/// The objects of the first list that are not in the second.
pub(super) struct NamedSet {
    pub include: Names,
    pub exclude: Names,
}

impl Linking {
    /// The sets, by number; none are left.
    pub fn take(&mut self) -> Vec<NamedSet> {
        std::mem::take(&mut self.sets)
    }

    /// The set of objects of such names; the same lists give the same one.
    pub fn add(&mut self, include: Names, exclude: Names, fields: &Fields) -> Option<ObjectSet> {
        let is_same = |a: &Names, b: &Names| a.iter().map(|n| &n.0).eq(b.iter().map(|n| &n.0));
        let known =
            self.sets.iter().position(|s| is_same(&s.include, &include) && is_same(&s.exclude, &exclude));
        let number = known.unwrap_or(self.sets.len());
        let Some(set) = ObjectSet::new(number) else {
            let most = ObjectSet::COUNT;
            let message = format!("the lights of the file are linked to more than {most} sets of objects");
            fields.problems.push_help(fields.span(), message, "give lights the same lists of names");
            return None;
        };
        if known.is_none() {
            self.sets.push(NamedSet { include, exclude });
        }
        Some(set)
    }
}
