//! Layers of the picture: the parts of the radiance that compositing takes apart, by the way of its light from the camera
//! (light passes) and by the light that it came from (groups of lights). All light passes together are the picture, and so
//! are all groups.
//!
//! A pass is told by the first scattering of a path: what of it is diffuse, by channel, as values of the BSDF's parts for its
//! two directions say (so does Cycles); the rest is reflected by facets, or lets light pass. Light is direct where the path
//! found it with one scattering.

use super::lanes::{Lanes, RgbLanes, get_rgb, per_path, set_rgb};
use crate::color::Rgb;
use crate::film::{Aov, AovSet, CATCHER_PARTS, Source};

per_path! {
    /// The first scattering of each path.
    pub struct FirstBounces {
        /// The share of it that is diffuse.
        pub diffuse: RgbLanes,
        /// 1 where it led to the other side of the surface, else 0.
        pub crosses: Lanes,
    }
}

/// The first scattering of a path.
#[derive(Clone, Copy, Debug)]
pub struct FirstBounce {
    /// The share of it that is diffuse.
    pub diffuse: Rgb,
    /// Did it lead to the other side of the surface?
    pub crosses: bool,
}

impl FirstBounce {
    /// Of ideally diffuse reflection.
    pub const DIFFUSE: FirstBounce = FirstBounce { diffuse: Rgb::ONE, crosses: false };
}

impl FirstBounces {
    /// That of a path.
    #[inline]
    pub fn get(&self, i: usize) -> FirstBounce {
        FirstBounce { diffuse: get_rgb(&self.diffuse, i), crosses: self.crosses[i] > 0.0 }
    }

    /// Sets that of a path.
    #[inline]
    pub fn set(&mut self, i: usize, first: FirstBounce) {
        set_rgb(&mut self.diffuse, i, first.diffuse);
        self.crosses[i] = f32::from(u8::from(first.crosses));
    }
}

/// The way of light to the camera.
#[derive(Clone, Copy, Debug)]
pub enum Way {
    /// From an emitting surface that the camera sees.
    Emission,
    /// From the environment that it sees.
    Environment,
    /// By one scattering.
    Direct(FirstBounce),
    /// By several.
    Indirect(FirstBounce),
}

/// Where light came from.
#[derive(Clone, Copy, Debug)]
pub struct Origin {
    /// Its way to the camera.
    pub way: Way,
    /// Group of its light.
    pub group: u16,
}

/// Which layers are kept, and where: passes first, then groups.
#[derive(Clone, Copy, Debug, Default)]
pub struct Layers {
    passes: AovSet,
    groups: usize,
    count: usize,
    /// Behind the groups are those of shadow catchers.
    catchers: bool,
    /// How many passes there are, and the places of each: of emission, of the environment, and of diffuse, glossy and transmitted
    /// light, direct and indirect.
    pass_count: usize,
    places: [Option<u8>; 2 + 2 * 3],
}

/// The passes in the order of their places.
const PASSES: [Aov; 8] = [
    Aov::Emission,
    Aov::Environment,
    Aov::DiffuseDirect,
    Aov::GlossyDirect,
    Aov::TransmissionDirect,
    Aov::DiffuseIndirect,
    Aov::GlossyIndirect,
    Aov::TransmissionIndirect,
];

impl Layers {
    /// The light passes among AOVs, the first groups of lights, and what catchers catch.
    pub fn new(aovs: AovSet, groups: usize, catchers: bool) -> Layers {
        let passes = aovs.of(Source::PartOfColor);
        let of_catchers = if catchers { CATCHER_PARTS } else { 0 };
        let place = |aov| passes.iter().position(|other| other == aov).map(|place| place as u8);
        let pass_count = passes.iter().count();
        Layers {
            passes,
            groups,
            count: pass_count + groups + of_catchers,
            catchers,
            pass_count,
            places: PASSES.map(place),
        }
    }

    /// How many there are.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Are there light passes?
    pub fn has_passes(&self) -> bool {
        self.passes.any()
    }

    /// How many groups of lights there are.
    pub fn groups(&self) -> usize {
        self.groups
    }

    /// The place of a group.
    pub fn of_group(&self, group: usize) -> Option<usize> {
        (group < self.groups).then_some(self.pass_count + group)
    }

    /// The first place of what catchers catch.
    pub fn of_catchers(&self) -> Option<usize> {
        self.catchers.then(|| self.count - CATCHER_PARTS)
    }

    /// The places of the passes that light of a way belongs to, and its shares there.
    pub fn shares(&self, way: Way) -> [(Option<usize>, Rgb); 2] {
        let place = |pass: usize| self.places[pass].map(usize::from);
        let (first, diffuse) = match way {
            Way::Emission => return [(place(0), Rgb::ONE), (None, Rgb::ZERO)],
            Way::Environment => return [(place(1), Rgb::ONE), (None, Rgb::ZERO)],
            Way::Direct(first) => (first, 2),
            Way::Indirect(first) => (first, 5),
        };
        let rest = diffuse + if first.crosses { 2 } else { 1 };
        [(place(diffuse), first.diffuse), (place(rest), Rgb::ONE - first.diffuse)]
    }
}

/// The way of light that a path found at its end, after so many scatterings.
pub fn way_of_path(bounce: u32, seen: Way, first_bounces: &FirstBounces, i: usize) -> Way {
    match bounce {
        0 => seen,
        1 => Way::Direct(first_bounces.get(i)),
        _ => Way::Indirect(first_bounces.get(i)),
    }
}
