//! Light linking and shadow linking: which objects a light lights, and which cast shadows in its light.

/// Sets of objects, by a bit each: those that an object is in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ObjectSets(u64);

/// The number of a set of objects, 0 to 63.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectSet(u8);

impl ObjectSet {
    /// As many sets can be told apart.
    pub const COUNT: usize = 64;

    /// The set of a number; `None` from [`ObjectSet::COUNT`] on.
    pub fn new(number: usize) -> Option<ObjectSet> {
        (number < ObjectSet::COUNT).then_some(ObjectSet(number as u8))
    }
}

impl ObjectSets {
    /// No set.
    pub const NONE: ObjectSets = ObjectSets(0);

    /// These and another one.
    pub const fn with(self, set: ObjectSet) -> ObjectSets {
        ObjectSets(self.0 | 1 << set.0)
    }

    /// Is a set among these?
    #[inline(always)]
    pub const fn contains(self, set: ObjectSet) -> bool {
        self.0 >> set.0 & 1 != 0
    }
}

/// The objects that light is linked to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Link {
    /// All.
    #[default]
    All,
    /// Those in a set.
    Only(ObjectSet),
    /// All that are not in a set.
    AllBut(ObjectSet),
}

impl Link {
    /// Is an object that is in these sets among the linked ones?
    #[inline(always)]
    pub const fn holds(self, object: ObjectSets) -> bool {
        match self {
            Link::All => true,
            Link::Only(set) => object.contains(set),
            Link::AllBut(set) => !object.contains(set),
        }
    }

    /// Are all objects linked?
    #[inline(always)]
    pub const fn is_all(self) -> bool {
        matches!(self, Link::All)
    }
}

/// What a light is linked to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LightLinks {
    /// The objects that it lights, by light samples and by rays that find it. Cameras see it in any case, and what it lights lights
    /// all others.
    pub receivers: Link,
    /// The objects that cast shadows in its light. Mirrors show a light with a surface behind all that is in the way.
    pub blockers: Link,
}

impl LightLinks {
    /// Links to all objects.
    pub const ALL: LightLinks = LightLinks { receivers: Link::All, blockers: Link::All };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_hold_members_or_all_others() {
        let (a, b) = (ObjectSet::new(3).expect("below 64"), ObjectSet::new(63).expect("below 64"));
        let object = ObjectSets::NONE.with(b);
        assert!(object.contains(b) && !object.contains(a));
        assert!(Link::All.holds(object) && Link::Only(b).holds(object) && Link::AllBut(a).holds(object));
        assert!(!Link::Only(a).holds(object) && !Link::AllBut(b).holds(object));
        assert!(Link::AllBut(b).holds(ObjectSets::NONE) && !Link::Only(b).holds(ObjectSets::NONE));
        assert_eq!(ObjectSet::new(ObjectSet::COUNT), None);
    }
}
