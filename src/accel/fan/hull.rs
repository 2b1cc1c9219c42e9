//! All segments from a point to a box, against boxes.

use super::planes::ROUNDING;

/// Directions below this count as this much.
const SMALLEST: f32 = 1.0 / (1u64 << 60) as f32;

/// Roundings of a plane's parameter.
const SLACK: f32 = 1.0 + 32.0 * ROUNDING;

/// The hull of a fan, against boxes: the parameter at which each plane of a box is passed at the latest or at the soonest.
pub struct Hull {
    /// For each plane of a box: one over the component of the extreme direction, and the offset.
    inverse: [f32; 6],
    near_offset: [f32; 6],
    far_offset: [f32; 6],
}

impl Hull {
    /// All segments from a point to a box; `margin` is how far they may be off.
    #[inline(always)]
    pub fn new(from: [f32; 3], min: [f32; 3], max: [f32; 3], margin: f32) -> Hull {
        let mut hull = Hull { inverse: [0.0; 6], near_offset: [0.0; 6], far_offset: [0.0; 6] };
        for axis in 0..3 {
            // Against the lower plane of a box counts how far the segments go up, and the other way round.
            let ways = [max[axis] - from[axis] + margin, min[axis] - from[axis] - margin];
            for (upper, &way) in ways.iter().enumerate() {
                let plane = 2 * axis + upper;
                let is_tiny = way.abs() < SMALLEST;
                let inverse = 1.0 / if is_tiny { SMALLEST.copysign(way) } else { way };
                let side = if upper == 0 { -margin } else { margin };
                let offset = -(from[axis] - side) * inverse;
                // Segments that go towards the box from this plane begin behind it; others end there.
                let begins = (way > 0.0) == (upper == 0);
                hull.inverse[plane] = inverse;
                hull.near_offset[plane] = if begins { offset } else { f32::NEG_INFINITY };
                hull.far_offset[plane] = if begins { f32::INFINITY } else { offset };
            }
        }
        hull
    }

    /// The boxes that it may meet.
    #[inline(always)]
    pub fn boxes(&self, planes: &[[f32; 8]; 6]) -> u32 {
        let (mut near, mut far) = ([0.0f32; 8], [1.0f32; 8]);
        for (plane, boxes) in planes.iter().enumerate() {
            let (inverse, begin, end) =
                (self.inverse[plane], self.near_offset[plane], self.far_offset[plane]);
            for k in 0..8 {
                let t = boxes[k] * inverse;
                let (entry, exit) = (t + begin, t + end);
                near[k] = if entry > near[k] { entry } else { near[k] };
                far[k] = if exit < far[k] { exit } else { far[k] };
            }
        }
        let mut mask = 0;
        for k in 0..8 {
            mask |= u32::from(near[k] <= far[k] * SLACK) << k;
        }
        mask
    }
}
