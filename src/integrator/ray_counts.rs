//! Rays, counted by what they are for.

/// How many rays there were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// All together.
    pub all: u64,
    /// Those of them that connected shared paths, each tested alone.
    pub single: u64,
    /// The same, tested together with the others to the same suffix.
    pub in_fans: u64,
    /// Those of them that belong to several paths of one sample.
    pub in_branches: u64,
}

impl RayCounts {
    /// Both together.
    pub fn plus(self, other: RayCounts) -> RayCounts {
        RayCounts {
            all: self.all + other.all,
            single: self.single + other.single,
            in_fans: self.in_fans + other.in_fans,
            in_branches: self.in_branches + other.in_branches,
        }
    }

    /// What came since an earlier count.
    pub fn since(self, before: RayCounts) -> RayCounts {
        RayCounts {
            all: self.all - before.all,
            single: self.single - before.single,
            in_fans: self.in_fans - before.in_fans,
            in_branches: self.in_branches - before.in_branches,
        }
    }
}
