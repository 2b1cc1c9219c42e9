//! The list of solids around a path (the "interior list" of Schmidt and Budge 2002).

use crate::compile::{CompiledScene, Medium, OVERLAP_LIMIT, ObjectId, View};
use crate::math::{Hit, Ray, Vec3};
use bytemuck::Zeroable;

/// Medium indices of the solids around a path; beyond [`Interior::MAX`], the outermost are dropped. 16 bits each, the solid entered last
/// in the lowest bits; 0 is empty. Two words, for an alignment of 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Zeroable)]
pub struct Interior([u64; 2]);

const BITS: u32 = u16::BITS;
const _: () = assert!(Interior::MAX * BITS == u128::BITS);

impl Interior {
    /// Maximum number of solids in the list.
    pub const MAX: u32 = OVERLAP_LIMIT as u32;

    /// Outside all solids.
    pub const AIR: Interior = Interior([0; 2]);

    #[inline(always)]
    fn bits(self) -> u128 {
        u128::from(self.0[1]) << u64::BITS | u128::from(self.0[0])
    }

    #[inline(always)]
    fn of(bits: u128) -> Interior {
        Interior([bits as u64, (bits >> u64::BITS) as u64])
    }

    /// The medium of the solid that absorbs and refracts; 0 is the medium around the scene.
    #[inline(always)]
    pub fn medium(self) -> u16 {
        self.0[0] as u16
    }

    /// The additive media that overlap [`Interior::medium`], each once: the next entries of the list but permeable solids, until the
    /// first that is neither or has a lower priority; after the last entry, the medium around the scene.
    pub fn overlapping(self, media: &[Medium]) -> impl Iterator<Item = u16> {
        let number = move |k: u32| (self.bits() >> (k * BITS)) as u16;
        let top = &media[usize::from(self.medium())];
        let adds_up = move |medium: &Medium| medium.is_additive && medium.priority >= top.priority;
        let is_passed = move |medium: u16| {
            adds_up(&media[usize::from(medium)]) || media[usize::from(medium)].keeps_overlapping_media
        };
        let count = (0..Interior::MAX).take_while(|&k| number(k) != 0).count() as u32;
        let deepest = if (top.is_additive || top.keeps_overlapping_media) && count > 0 { count } else { 0 };
        let is_first = move |k: u32| (0..k).all(|other| number(other) != number(k));
        // The medium around the scene follows the last entry.
        let entry = move |k: u32| if k < count { number(k) } else { 0 };
        (1..=deepest)
            .map_while(move |k| is_passed(entry(k)).then_some(k))
            .filter(move |&k| adds_up(&media[usize::from(entry(k))]) && (k == count || is_first(k)))
            .map(entry)
    }

    /// After entering a solid of a medium.
    #[inline(always)]
    pub fn enter(self, medium: u16) -> Interior {
        Interior::of(self.bits() << BITS | u128::from(medium))
    }

    /// After entering a solid of a medium; solids of higher rank stay before it in the list.
    #[inline]
    pub fn enter_by_priority(self, medium: u16, media: &[Medium]) -> Interior {
        let own = media[usize::from(medium)].rank();
        let is_below = |&shift: &u32| {
            let other = (self.bits() >> shift) as u16;
            other == 0 || media[usize::from(other)].rank() <= own
        };
        let Some(shift) = (0..u128::BITS).step_by(BITS as usize).find(is_below) else { return self };
        let inner = self.bits() & ((1 << shift) - 1);
        Interior::of((self.bits() >> shift << BITS | u128::from(medium)) << shift | inner)
    }

    /// After exiting the solid of that medium entered last, if there is one.
    #[inline]
    pub fn leave(self, medium: u16) -> Interior {
        // The common case.
        if self.medium() == medium {
            return Interior::of(self.bits() >> BITS);
        }
        let Some(shift) = self.position(medium) else { return self };
        let inner = self.bits() & ((1 << shift) - 1);
        let outer = self.bits() >> shift >> BITS << shift;
        Interior::of(outer | inner)
    }

    /// Does the list contain a solid of that medium?
    #[inline]
    pub fn contains(self, medium: u16) -> bool {
        self.medium() == medium || self.position(medium).is_some()
    }

    /// The bit offset of the most recent entry of a medium.
    #[inline]
    fn position(self, medium: u16) -> Option<u32> {
        let (mut rest, mut shift) = (self.bits(), 0);
        while rest != 0 {
            if rest as u16 == medium {
                return Some(shift);
            }
            (rest, shift) = (rest >> BITS, shift + BITS);
        }
        None
    }

    /// The solids around a point of the scene at a shutter time in 0..1, by the parity of surface crossings along a ray. A majority of
    /// three rays decides, since models may have holes.
    pub fn around(scene: &CompiledScene, p: Vec3, time: f32) -> Interior {
        let directions =
            [Vec3::new(0.31, 0.89, 0.34), Vec3::new(-0.83, -0.27, 0.49), Vec3::new(0.42, -0.37, -0.83)];
        let around = directions.map(|direction| solids_around(scene, p, direction.normalize(), time));
        let is_around = |m: &u16| around.iter().filter(|list| list.contains(m)).count() >= 2;
        let first = around.iter().find(|list| list.iter().any(is_around));
        let solids = first.into_iter().flatten().filter(|m| is_around(m));
        let enter = |interior: Interior, &m: &u16| match scene.features.priorities {
            true => interior.enter_by_priority(m, &scene.media),
            false => interior.enter(m),
        };
        solids.fold(Interior::AIR, enter)
    }
}

/// The solids around the origins of camera rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraInterior {
    /// Constant for all camera rays.
    Constant(Interior),
    /// Computed per ray: it varies over the plane of an orthographic camera or over time, or the camera has clip planes.
    PerRay,
}

impl CameraInterior {
    /// Tests a grid of points on the plane of an orthographic camera, and several times with motion.
    pub fn of(scene: &CompiledScene, view: &View) -> CameraInterior {
        /// Grid cells along each side of the picture and along time. Solids smaller than a cell may be missed; see
        /// `Integrator::assume_inside`.
        const CELLS: u32 = 8;
        if !scene.features.media {
            return CameraInterior::Constant(Interior::AIR);
        }
        if view.camera.is_clipped() {
            return CameraInterior::PerRay;
        }
        let is_moving = scene.is_moving() || view.moving.is_some();
        let times = if is_moving { 0..=CELLS } else { 0..=0 };
        let cells = if view.camera.is_perspective() { 0..=0 } else { 0..=CELLS };
        let around = |time: f32, i: u32, j: u32| {
            let camera = view.moving.as_ref().map_or(view.camera, |moving| moving.at(time));
            let at = |k: u32, size: u32| (k * size) as f32 / CELLS as f32;
            let of_ray = || camera.ray(at(i, view.width), at(j, view.height), [0.5; 2]).origin;
            let p = if camera.is_perspective() { camera.position() } else { of_ray() };
            Interior::around(scene, p, time)
        };
        let first = around(0.0, 0, 0);
        let differs = times.into_iter().any(|k| {
            let time = k as f32 / CELLS as f32;
            cells.clone().any(|j| cells.clone().any(|i| around(time, i, j) != first))
        });
        if differs { CameraInterior::PerRay } else { CameraInterior::Constant(first) }
    }
}

/// Media of the solids around a point, in the order of entering: the first one that the ray exits is last.
fn solids_around(scene: &CompiledScene, p: Vec3, direction: Vec3, time: f32) -> Vec<u16> {
    const MAX_SURFACES: u32 = 256;
    let ray = Ray::new(p, direction);
    let (mut entered, mut left): (Vec<(u16, Option<ObjectId>)>, Vec<u16>) = (Vec::new(), Vec::new());
    // Then several hits may have the same distance.
    let has_neighbours = scene.features.coincident_surfaces || scene.features.overlaps;
    let mut hit = Hit::MISS;
    for number in 0..MAX_SURFACES {
        hit = match number {
            0 => scene.accel.closest_one_in_time(&ray, time),
            _ if has_neighbours => scene.accel.closest_after(&ray, &hit, time),
            _ => scene.accel.closest_one_in_time(&Ray { t_min: hit.t, ..ray }, time),
        };
        if !hit.is_hit() {
            break;
        }
        let medium = scene.materials[scene.geometries.material(&hit) as usize].medium_index;
        let is_front = scene.geometries.surface(&ray, &hit, time).ng.dot(direction) < 0.0;
        if medium == 0 {
            continue;
        }
        let mesh = scene.geometries.placed_mesh(&hit);
        // A body may have different materials where the ray enters and exits: match by mesh.
        let is_same = |&(_, other): &(u16, Option<ObjectId>)| other == mesh;
        let same_medium = || entered.iter().rposition(|&(m, _)| m == medium);
        if is_front {
            entered.push((medium, mesh));
        } else if let Some(at) = same_medium().or_else(|| entered.iter().rposition(is_same)) {
            entered.remove(at);
        } else {
            left.push(medium);
        }
    }
    left.reverse();
    left
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_can_be_exited_in_any_order() {
        let three = Interior::AIR.enter(7).enter(9).enter(7);
        assert_eq!(three.medium(), 7);
        assert_eq!(three.leave(7), Interior::AIR.enter(7).enter(9));
        assert_eq!(three.leave(9), Interior::AIR.enter(7).enter(7));
        assert_eq!(three.leave(8), three);
        assert_eq!(three.leave(7).leave(9).leave(7), Interior::AIR);
    }

    #[test]
    fn solids_of_higher_priority_stay_first() {
        let media: Vec<Medium> =
            [0, 1, 5, 1, -2, 9].map(|priority| Medium { priority, ..Medium::AIR }).to_vec();
        let enter = |inside: Interior, medium| inside.enter_by_priority(medium, &media);
        let some = [1, 2, 3].into_iter().fold(Interior::AIR, enter);
        assert_eq!(some, Interior::AIR.enter(1).enter(3).enter(2));
        assert_eq!(enter(some, 4), Interior::AIR.enter(4).enter(1).enter(3).enter(2));
        assert_eq!(enter(enter(some, 4), 5), enter(some, 4).enter(5));
        assert_eq!(enter(enter(enter(some, 4), 3), 4).leave(2).medium(), 3);
        let full = (0..Interior::MAX).fold(Interior::AIR, |inside, _| enter(inside, 5));
        assert_eq!(enter(full, 4), full, "none is of a lower priority");
    }

    #[test]
    fn a_full_list_drops_the_outermost_solid() {
        let all = (1..=Interior::MAX as u16 + 1).fold(Interior::AIR, Interior::enter);
        let left = (2..=Interior::MAX as u16 + 1).fold(all, Interior::leave);
        assert_eq!(left, Interior::AIR);
    }

    /// Media 0 to 3 add up, 3 has a higher priority, and 4 and 5 displace others; then 2, 3 and 5 are permeable, 5 of a higher priority.
    #[test]
    fn overlapping_media_add_up_by_priority() {
        let of = |is_additive, priority| Medium { is_additive, priority, ..Medium::AIR };
        let media = [of(true, 0), of(true, 0), of(true, 0), of(true, 1), of(false, 0), of(false, 0)];
        let overlapping = |list: &[u16]| -> Vec<u16> {
            let inside = list.iter().fold(Interior::AIR, |inside, &m| inside.enter_by_priority(m, &media));
            inside.overlapping(&media).collect()
        };
        for (list, expected) in [
            (&[][..], &[][..]),
            (&[1], &[0]),
            (&[1, 2], &[1, 0]),
            (&[1, 2, 1, 1, 2], &[1, 0]),
            (&[4], &[]),
            (&[1, 4], &[]),
            (&[1, 4, 2], &[]),
            (&[1, 4, 2, 1], &[2]),
            (&[3], &[]),
            (&[1, 3, 2], &[]),
        ] {
            assert_eq!(overlapping(list), expected, "{list:?}");
        }
        let permeable = Medium { keeps_overlapping_media: true, ..Medium::AIR };
        let denser = Medium { priority: 1, ..permeable.clone() };
        let media = [of(true, 0), of(true, 0), permeable.clone(), permeable, of(false, 0), denser];
        let around = |list: &[u16]| {
            let inside = list.iter().fold(Interior::AIR, |inside, &m| inside.enter_by_priority(m, &media));
            (inside.medium(), inside.overlapping(&media).collect::<Vec<_>>())
        };
        for list in [&[1, 2][..], &[2, 1]] {
            assert_eq!(around(list), (2, vec![1, 0]), "{list:?}: the solid with a surface refracts");
        }
        assert_eq!(around(&[2, 1, 3]), (3, vec![1, 0]));
        assert_eq!(around(&[2]), (2, vec![0]));
        assert_eq!(around(&[4, 2, 1]), (2, vec![1]), "until a solid that replaces others");
        assert_eq!(around(&[1, 5]), (5, vec![]), "a higher priority replaces others");
        let airless = [Medium::AIR, of(true, 0), of(true, 0)];
        let inside = Interior::AIR.enter(1).enter(2);
        assert_eq!(inside.overlapping(&airless).collect::<Vec<_>>(), [1]);
        let full = (0..Interior::MAX).fold(Interior::AIR, |inside, k| inside.enter(1 + k as u16 % 2));
        assert_eq!(full.overlapping(&media).collect::<Vec<_>>(), [1, 0]);
    }
}
