//! Object traits: ray visibility, light and shadow linking, holdouts and shadow catchers.

/// A set of ray kinds. The kind of a ray is that of the scattering event it starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RayKinds(u8);

impl RayKinds {
    /// No kind.
    pub const NONE: RayKinds = RayKinds(0);
    /// Rays from the camera.
    pub const CAMERA: RayKinds = RayKinds(1);
    /// Rays after diffuse reflection.
    pub const DIFFUSE: RayKinds = RayKinds(1 << 1);
    /// Rays after specular or microfacet reflection.
    pub const GLOSSY: RayKinds = RayKinds(1 << 2);
    /// Rays after refraction or diffuse transmission. Rays through transparent surfaces (alpha), or straight through smooth thin
    /// sheets like shadow rays, keep their kind.
    pub const TRANSMISSION: RayKinds = RayKinds(1 << 3);
    /// Rays after scattering in a medium.
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

    /// The kind with a name in files.
    pub fn from_name(name: &str) -> Option<RayKinds> {
        RayKinds::NAMED.into_iter().find(|(other, _)| *other == name).map(|(_, kind)| kind)
    }

    /// Whether another set is a subset of this one.
    #[inline(always)]
    pub const fn contains(self, other: RayKinds) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether it contains either shadow rays or all scattered rays, but not both.
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

    /// The difference from another set.
    #[inline(always)]
    pub const fn without(self, other: RayKinds) -> RayKinds {
        RayKinds(self.0 & !other.0)
    }

    /// The intersection with another set.
    #[inline(always)]
    pub const fn and(self, other: RayKinds) -> RayKinds {
        RayKinds(self.0 & other.0)
    }

    /// The set with a kind added or removed.
    pub const fn set(self, kind: RayKinds, is_included: bool) -> RayKinds {
        if is_included { self.with(kind) } else { self.without(kind) }
    }

    /// As a bit mask; see [`RayKinds::from_bits`].
    #[inline(always)]
    pub const fn bits(self) -> u32 {
        self.0 as u32
    }

    /// The set of a bit mask from [`RayKinds::bits`].
    #[inline(always)]
    pub const fn from_bits(bits: u32) -> RayKinds {
        RayKinds((bits as u8) & RayKinds::ALL.0)
    }
}

impl Default for RayKinds {
    /// All kinds.
    fn default() -> RayKinds {
        RayKinds::ALL
    }
}

/// Traits of an object other than materials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ObjectTraits {
    /// Ray kinds that the object is visible to; others pass through it.
    pub visible_to: RayKinds,
    /// Black and transparent to the camera; an ordinary object to all other rays.
    pub is_holdout: bool,
    /// To the camera, transparent except for shadows and light of other objects on it, for compositing over a photograph of the
    /// real surface; an ordinary object to all other rays. Ignored for holdouts.
    pub is_shadow_catcher: bool,
    /// Linking sets that contain the object.
    pub sets: ObjectSets,
    /// Light and shadow linking of its emission.
    pub links: LightLinks,
}

/// The linking sets that contain an object, as a bit mask.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ObjectSets(u64);

/// Index of a linking set of objects, 0 to 63.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ObjectSet(u8);

impl ObjectSet {
    /// Maximum number of distinct sets.
    pub const COUNT: usize = 64;

    /// The set of an index; `None` from [`ObjectSet::COUNT`] on.
    pub fn new(number: usize) -> Option<ObjectSet> {
        (number < ObjectSet::COUNT).then_some(ObjectSet(number as u8))
    }
}

impl ObjectSets {
    /// No set.
    pub const NONE: ObjectSets = ObjectSets(0);

    /// With another set added.
    pub const fn with(self, set: ObjectSet) -> ObjectSets {
        ObjectSets(self.0 | 1 << set.0)
    }

    /// Whether a set is included.
    #[inline(always)]
    pub const fn contains(self, set: ObjectSet) -> bool {
        self.0 >> set.0 & 1 != 0
    }
}

/// The objects that a light is linked to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Link {
    /// All.
    #[default]
    All,
    /// The objects in a set.
    Only(ObjectSet),
    /// The objects outside a set.
    AllBut(ObjectSet),
}

impl Link {
    /// Whether an object with these sets is linked.
    #[inline(always)]
    pub const fn includes(self, object: ObjectSets) -> bool {
        match self {
            Link::All => true,
            Link::Only(set) => object.contains(set),
            Link::AllBut(set) => !object.contains(set),
        }
    }

    /// Whether all objects are linked.
    #[inline(always)]
    pub const fn is_all(self) -> bool {
        matches!(self, Link::All)
    }
}

/// Light and shadow linking of a light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LightLinks {
    /// The objects that it illuminates directly, by light sampling and by rays that hit it. Camera rays are not affected, nor is
    /// indirect light.
    pub receivers: Link,
    /// The objects that cast shadows in its light. In mirrors, an area light is occluded by all objects in front of it.
    pub blockers: Link,
}

impl LightLinks {
    /// Links to all objects.
    pub const ALL: LightLinks = LightLinks { receivers: Link::All, blockers: Link::All };
}

// Object properties for node graphs.

/// Outputs of the `object_info` node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectInfo {
    /// Object colour, linear RGBA.
    pub color: [f32; 4],
    /// Object index.
    pub index: f32,
    /// Random number 0..1 of the object; `None` for a hash of the name.
    pub random: Option<f32>,
}

impl Default for ObjectInfo {
    fn default() -> ObjectInfo {
        ObjectInfo { color: [1.0; 4], index: 0.0, random: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn set_operations_of_ray_kinds() {
        let all = RayKinds::NAMED.iter().fold(RayKinds::NONE, |sum, &(_, kind)| sum.with(kind));
        assert_eq!(all, RayKinds::ALL);
        for (name, kind) in RayKinds::NAMED {
            let others = RayKinds::ALL.without(kind);
            assert!(!others.contains(kind) && others.with(kind) == RayKinds::ALL, "{name}");
            assert_eq!(RayKinds::from_bits(kind.bits()), kind, "{name}");
            assert_eq!(RayKinds::ALL.and(kind), kind, "{name}");
        }
    }

    #[test]
    fn links_contain_members_or_all_others() {
        let (a, b) = (ObjectSet::new(3).expect("below 64"), ObjectSet::new(63).expect("below 64"));
        let object = ObjectSets::NONE.with(b);
        assert!(object.contains(b) && !object.contains(a));
        assert!(
            Link::All.includes(object) && Link::Only(b).includes(object) && Link::AllBut(a).includes(object)
        );
        assert!(!Link::Only(a).includes(object) && !Link::AllBut(b).includes(object));
        assert!(Link::AllBut(b).includes(ObjectSets::NONE) && !Link::Only(b).includes(ObjectSets::NONE));
        assert_eq!(ObjectSet::new(ObjectSet::COUNT), None);
    }
}
