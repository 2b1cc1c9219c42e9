//! Arrays over the paths of a wave: one number, one vector or one colour a path, so that loops over paths vectorise.

use crate::color::Rgb;
use crate::math::Vec3;

/// Paths in flight. The arrays that a scene makes use of stay within a core's second-level cache, or nearly.
pub const WAVE: usize = 2048;

/// Length of an array: one cache line more than needed, because arrays a power of two apart would all fall into the same
/// cache set.
pub const LENGTH: usize = WAVE + 16;

/// One number a path.
pub type Lanes = [f32; LENGTH];
/// One integer a path.
pub type Words = [u32; LENGTH];
/// One vector a path, by component.
pub type Lanes3 = [Lanes; 3];
/// One colour a path, by channel.
pub type RgbLanes = [Lanes; 3];

/// Element `i` as a vector.
#[inline(always)]
pub fn get(v: &Lanes3, i: usize) -> Vec3 {
    Vec3::new(v[0][i], v[1][i], v[2][i])
}

/// Sets element `i`.
#[inline(always)]
pub fn set(v: &mut Lanes3, i: usize, value: Vec3) {
    v[0][i] = value.x;
    v[1][i] = value.y;
    v[2][i] = value.z;
}

/// Element `i` as a colour.
#[inline(always)]
pub fn get_rgb(v: &RgbLanes, i: usize) -> Rgb {
    Rgb::new(v[0][i], v[1][i], v[2][i])
}

/// Sets element `i`.
#[inline(always)]
pub fn set_rgb(v: &mut RgbLanes, i: usize, value: Rgb) {
    [v[0][i], v[1][i], v[2][i]] = value.to_array();
}

/// Something kept for each path.
pub trait PerPath {
    /// Copies element `i` to element `k` of `other`.
    fn copy_to(&self, i: usize, other: &mut Self, k: usize);

    /// Makes each of the first `count` elements several, one after the other.
    fn repeat(&mut self, count: usize, times: usize);
}

/// Makes each of the first `count` elements several, one after the other.
pub fn repeat<T: Copy>(elements: &mut [T], count: usize, times: usize) {
    // From the end, so that each is read before something else is in its place.
    for i in (0..count).rev() {
        let element = elements[i];
        elements[i * times..(i + 1) * times].fill(element);
    }
}

impl<T: Copy> PerPath for [T; LENGTH] {
    #[inline(always)]
    fn copy_to(&self, i: usize, other: &mut Self, k: usize) {
        other[k] = self[i];
    }

    fn repeat(&mut self, count: usize, times: usize) {
        repeat(self, count, times);
    }
}

impl PerPath for Lanes3 {
    #[inline(always)]
    fn copy_to(&self, i: usize, other: &mut Self, k: usize) {
        for c in 0..3 {
            other[c][k] = self[c][i];
        }
    }

    fn repeat(&mut self, count: usize, times: usize) {
        for component in self {
            component.repeat(count, times);
        }
    }
}

/// Declares a struct of things kept for each path together with the [`PerPath`] that copies all of them.
macro_rules! per_path {
    ($(#[$of_struct:meta])* $visible:vis struct $name:ident {
        $($(#[$of_field:meta])* $field_visible:vis $field:ident: $type:ty,)*
    }) => {
        $(#[$of_struct])*
        #[derive(bytemuck::Zeroable)]
        $visible struct $name {
            $($(#[$of_field])* $field_visible $field: $type,)*
        }

        impl $crate::integrator::lanes::PerPath for $name {
            #[inline(always)]
            fn copy_to(&self, i: usize, other: &mut Self, k: usize) {
                $($crate::integrator::lanes::PerPath::copy_to(&self.$field, i, &mut other.$field, k);)*
            }

            fn repeat(&mut self, count: usize, times: usize) {
                $($crate::integrator::lanes::PerPath::repeat(&mut self.$field, count, times);)*
            }
        }
    };
}
pub(super) use per_path;
