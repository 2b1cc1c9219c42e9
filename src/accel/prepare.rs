//! A ray in the form that the box and triangle tests use.

use crate::math::{Ray, Vec3};

/// A ray whose direction is scaled by a power of two so that its largest component lies in [1, 2). All parameters are
/// in units of this direction; the scaling is exact, so directions of any length behave alike.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    /// Origin.
    pub origin: [f32; 3],
    /// Scaled direction.
    pub direction: [f32; 3],
    /// One over each component of the scaled direction; infinite where that is zero or tiny.
    pub inverse: [f32; 3],
    /// For each axis 1 where the direction is negative: the near plane is then the box's upper one.
    pub negative: [u8; 3],
    /// The axes of the sheared space, z the longest of the direction (Woop, Benthin, Wald 2013, section 3.1).
    pub axes: [u8; 3],
    /// Shear (ibid., `Sx`, `Sy`).
    pub shear: [f32; 2],
    /// Lower bound of the parameter.
    pub t_min: f32,
    /// Parameters in the caller's units are ours times this power of two.
    pub unscale: f32,
}

impl PreparedRay {
    /// Never hits anything; fills unused slots.
    pub const NONE: PreparedRay = PreparedRay {
        origin: [0.0; 3],
        direction: [0.0, 0.0, 1.0],
        inverse: [f32::INFINITY, f32::INFINITY, 1.0],
        negative: [0; 3],
        axes: [0, 1, 2],
        shear: [0.0; 2],
        t_min: 0.0,
        unscale: 1.0,
    };

    /// Prepares a ray and returns it with its upper bound of the parameter; `None` where it can hit nothing: an empty
    /// range, a zero direction, or a component that is infinite or NaN.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Option<(PreparedRay, f32)> {
        let (o, d) = (ray.origin, ray.direction);
        let largest = d.x.abs().max(d.y.abs()).max(d.z.abs());
        let finite = o.is_finite() && d.is_finite();
        let t_min = if ray.t_min > 0.0 { ray.t_min } else { 0.0 };
        if !(finite && largest > 0.0 && t_min < ray.t_max) {
            return None;
        }
        let (scale, unscale) = power_of_two_scale(largest);
        let d = d * unscale;
        let prepared = PreparedRay::from_scaled(o, d, t_min * scale, unscale);
        Some((prepared, ray.t_max * scale))
    }

    /// From a direction whose largest component lies in [1, 2).
    #[inline(always)]
    fn from_scaled(o: Vec3, d: Vec3, t_min: f32, unscale: f32) -> PreparedRay {
        let (ax, ay, az) = (d.x.abs(), d.y.abs(), d.z.abs());
        let z = if az >= ax && az >= ay {
            2
        } else if ay >= ax {
            1
        } else {
            0
        };
        const NEXT: [u8; 3] = [1, 2, 0];
        let x = NEXT[z];
        let y = NEXT[x as usize];
        let d = d.to_array();
        let sz = 1.0 / d[z];
        PreparedRay {
            origin: o.to_array(),
            direction: d,
            inverse: [1.0 / d[0], 1.0 / d[1], 1.0 / d[2]],
            negative: d.map(|d| u8::from(d.is_sign_negative())),
            axes: [x, y, z as u8],
            shear: [d[x as usize] * sz, d[y as usize] * sz],
            t_min,
            unscale,
        }
    }
}

/// `(2^e, 2^-e)` for a positive `x` in [2^e, 2^(e+1)), with e kept where both are normal numbers.
#[inline(always)]
fn power_of_two_scale(x: f32) -> (f32, f32) {
    let e = ((x.to_bits() >> 23) as i32 - 127).clamp(-126, 126);
    (f32::from_bits(((127 + e) as u32) << 23), f32::from_bits(((127 - e) as u32) << 23))
}
