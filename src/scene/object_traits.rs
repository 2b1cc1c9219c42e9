//! Traits of an object: the kinds of rays it is visible to, light linking and shadow linking, holdouts and shadow catchers.

/// A set of ray kinds. A ray's kind is that of the scattering event before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RayKinds(u8);

impl RayKinds {
    /// No kind.
    pub const NONE: RayKinds = RayKinds(0);
    /// Rays from the camera.
    pub const CAMERA: RayKinds = RayKinds(1);
    /// Rays that a surface reflected diffusely.
    pub const DIFFUSE: RayKinds = RayKinds(1 << 1);
    /// Rays reflected specularly or by microfacets.
    pub const GLOSSY: RayKinds = RayKinds(1 << 2);
    /// Rays that a surface let through to its other side, refracted or diffusely. Those that pass where a surface is absent, or
    /// straight through a smooth thin sheet as light samples do, stay what they were.
    pub const TRANSMISSION: RayKinds = RayKinds(1 << 3);
    /// Rays that a medium scattered.
    pub const VOLUME: RayKinds = RayKinds(1 << 4);
    /// Shadow rays.
    pub const SHADOW: RayKinds = RayKinds(1 << 5);
    /// All kinds.
    pub const ALL: RayKinds = RayKinds((1 << 6) - 1);

    /// Each kind with its name in files.
    pub const NAMED: [(&'static str, RayKinds); 6] = [
        ("camera", RayKinds::CAMERA),
        ("diffuse", RayKinds::DIFFUSE),
        ("glossy", RayKinds::GLOSSY),
        ("transmission", RayKinds::TRANSMISSION),
        ("volume", RayKinds::VOLUME),
        ("shadow", RayKinds::SHADOW),
    ];

    /// Are all kinds of another set among these?
    #[inline(always)]
    pub const fn contains(self, other: RayKinds) -> bool {
        self.0 & other.0 == other.0
    }

    /// Are shadow rays among them and scattered rays not, or the other way round?
    pub fn has_own_shadows(self) -> bool {
        let scattered =
            RayKinds::DIFFUSE.with(RayKinds::GLOSSY).with(RayKinds::TRANSMISSION).with(RayKinds::VOLUME);
        self.contains(RayKinds::SHADOW) != self.contains(scattered)
    }

    /// The union with another set.
    #[inline(always)]
    pub const fn with(self, other: RayKinds) -> RayKinds {
        RayKinds(self.0 | other.0)
    }

    /// The kinds that are not in another set.
    #[inline(always)]
    pub const fn without(self, other: RayKinds) -> RayKinds {
        RayKinds(self.0 & !other.0)
    }

    /// The intersection with another set.
    #[inline(always)]
    pub const fn and(self, other: RayKinds) -> RayKinds {
        RayKinds(self.0 & other.0)
    }

    /// With or without a kind.
    pub const fn set(self, kind: RayKinds, is_there: bool) -> RayKinds {
        if is_there { self.with(kind) } else { self.without(kind) }
    }

    /// As a number; see [`RayKinds::from_bits`].
    #[inline(always)]
    pub const fn bits(self) -> u32 {
        self.0 as u32
    }

    /// The set of a number from [`RayKinds::bits`].
    #[inline(always)]
    pub const fn from_bits(bits: u32) -> RayKinds {
        RayKinds((bits as u8) & RayKinds::ALL.0)
    }
}

impl Default for RayKinds {
    /// All of them.
    fn default() -> RayKinds {
        RayKinds::ALL
    }
}

/// Traits of an object apart from its materials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ObjectTraits {
    /// Rays of other kinds pass it.
    pub visible_to: RayKinds,
    /// Where the camera sees it, the picture is transparent and black. For all other rays it is an object like others.
    pub is_holdout: bool,
    /// The camera sees only how other objects change its light, by shadows and reflected light: the picture is
    /// transparent there, to be composited over a photograph of the real surface. For all other rays it is an
    /// object like others. Ignored for holdouts.
    pub is_shadow_catcher: bool,
    /// The sets that it is in, to which lights are linked.
    pub sets: ObjectSets,
    /// Light linking and shadow linking of its emission.
    pub links: LightLinks,
}

/// Sets of objects, by a bit each: those that an object is in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ObjectSets(u64);

/// The number of a set of objects, 0 to 63.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectSet(u8);

impl ObjectSet {
    /// Maximum number of distinct sets.
    pub const COUNT: usize = 64;

    /// The set of a number; `None` from [`ObjectSet::COUNT`] on.
    pub fn new(number: usize) -> Option<ObjectSet> {
        (number < ObjectSet::COUNT).then_some(ObjectSet(number as u8))
    }
}

impl ObjectSets {
    /// No set.
    pub const NONE: ObjectSets = ObjectSets(0);

    /// This set with another one.
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
    /// The objects in a set.
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

/// Light linking of a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LightLinks {
    /// The objects that it lights, by light samples and by rays that find it. Cameras see it in any case, and what it lights lights
    /// all others.
    pub receivers: Link,
    /// The objects that cast shadows in its light. In mirrors, a light with a surface is seen behind the objects in its way.
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
    fn kinds_are_sets_of_the_named_ones() {
        let all = RayKinds::NAMED.iter().fold(RayKinds::NONE, |sum, &(_, kind)| sum.with(kind));
        assert_eq!(all, RayKinds::ALL);
        for (name, kind) in RayKinds::NAMED {
            let others = RayKinds::ALL.without(kind);
            assert!(!others.contains(kind) && others.with(kind) == RayKinds::ALL, "{name}");
            assert_eq!(RayKinds::from_bits(kind.bits()), kind, "{name}");
            assert_eq!(RayKinds::ALL.and(kind), kind, "{name}");
        }
    }
}

#[cfg(test)]
mod links_tests {
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

// Properties of an object for node graphs.

/// Values of an object that graphs of nodes read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectInfo {
    /// Linear RGBA.
    pub color: [f32; 4],
    /// Any number.
    pub index: f32,
    /// A number 0..1 by which objects differ; `None` for one that follows from the name.
    pub random: Option<f32>,
}

impl Default for ObjectInfo {
    fn default() -> ObjectInfo {
        ObjectInfo { color: [1.0; 4], index: 0.0, random: None }
    }
}
