//! Which kinds of rays meet an object, and what objects are to pictures that are composited.

use super::links::{LightLinks, ObjectSets};

/// Kinds of rays, each by how the path was scattered before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RayKinds(u8);

impl RayKinds {
    /// No kind.
    pub const NONE: RayKinds = RayKinds(0);
    /// Rays from the camera.
    pub const CAMERA: RayKinds = RayKinds(1);
    /// Rays that a surface reflected diffusely.
    pub const DIFFUSE: RayKinds = RayKinds(1 << 1);
    /// Rays that a surface reflected otherwise: mirrors, facets, coats.
    pub const GLOSSY: RayKinds = RayKinds(1 << 2);
    /// Rays that a surface let through to its other side, refracted or diffusely. Those that pass where a surface is absent, or
    /// straight through a smooth thin sheet as light samples do, stay what they were.
    pub const TRANSMISSION: RayKinds = RayKinds(1 << 3);
    /// Rays that a medium scattered.
    pub const VOLUME: RayKinds = RayKinds(1 << 4);
    /// Rays that ask whether something lies between a light and what it lights.
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

    /// These and others.
    #[inline(always)]
    pub const fn with(self, other: RayKinds) -> RayKinds {
        RayKinds(self.0 | other.0)
    }

    /// These but not others.
    #[inline(always)]
    pub const fn without(self, other: RayKinds) -> RayKinds {
        RayKinds(self.0 & !other.0)
    }

    /// Those that are among others, too.
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

    /// Of such a number.
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

/// What an object is to rays and pictures besides what its materials say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ObjectTraits {
    /// Rays of other kinds pass it.
    pub visible_to: RayKinds,
    /// Where the camera sees it, the picture is transparent and black. For all else it is an object like others.
    pub is_holdout: bool,
    /// The camera sees of it only what other objects change on it, their shadows and what they reflect onto it: the picture is
    /// transparent there, and laid over a photograph of what the object stands for it shows both. For all else it is an
    /// object like others. A holdout is none.
    pub is_shadow_catcher: bool,
    /// The sets that it is in, to which lights are linked.
    pub sets: ObjectSets,
    /// What is lit by what it emits, and what casts shadows in that light.
    pub links: LightLinks,
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
