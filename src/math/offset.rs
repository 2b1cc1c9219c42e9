//! Rounding error bounds and ray origins that respect them (Pharr, Jakob, Humphreys 2023, section 6.8).

use super::Vec3;

/// Half the distance from 1 to the next f32: the largest relative error of one rounding.
pub const MACHINE_EPSILON: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of `n` roundings in a row (Higham 2002, lemma 3.1).
#[inline(always)]
pub const fn gamma(n: u32) -> f32 {
    (n as f32 * MACHINE_EPSILON) / (1.0 - n as f32 * MACHINE_EPSILON)
}

/// The next larger f32; zero of either sign goes to the smallest positive number.
#[inline(always)]
pub fn next_up(x: f32) -> f32 {
    x.next_up()
}

/// The next smaller f32.
#[inline(always)]
pub fn next_down(x: f32) -> f32 {
    x.next_down()
}

/// Moves a point off its surface along the geometric normal `n`, to the side that `w` points to, just beyond the box
/// `p +- p_error` in which the true point lies (ibid., section 6.8.6).
#[inline(always)]
pub fn offset_ray_origin(p: Vec3, p_error: Vec3, n: Vec3, w: Vec3) -> Vec3 {
    let side = if w.dot(n) < 0.0 { -1.0 } else { 1.0 };
    offset_along(p, n * side, n.abs().dot(p_error))
}

/// Moves a point by a distance along the unit vector `n`, rounded outward.
#[inline(always)]
pub fn offset_along(p: Vec3, n: Vec3, distance: f32) -> Vec3 {
    let offset = n * distance;
    let moved = p + offset;
    Vec3::new(
        push_outward(moved.x, offset.x),
        push_outward(moved.y, offset.y),
        push_outward(moved.z, offset.z),
    )
}

/// Rounds a coordinate one ulp further in the direction of its offset. Branch-free, so that loops over it vectorise.
#[inline(always)]
fn push_outward(coordinate: f32, offset: f32) -> f32 {
    let bits = coordinate.to_bits() as i32;
    // Larger in magnitude when the offset points away from zero, smaller otherwise.
    let away = (bits ^ offset.to_bits() as i32) >= 0;
    let stepped = f32::from_bits((if away { bits + 1 } else { bits - 1 }) as u32);
    if offset == 0.0 || coordinate == 0.0 { coordinate } else { stepped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_leaves_the_surface_on_the_right_side() {
        for (n, w) in [(Vec3::Y, Vec3::Y), (Vec3::Y, -Vec3::Y), (Vec3::new(0.6, 0.8, 0.0), -Vec3::X)] {
            for p in [Vec3::ZERO, Vec3::splat(1e3), Vec3::new(-5.0, 1e-3, 7e5)] {
                let o = offset_ray_origin(p, p.abs() * gamma(7) + Vec3::splat(1e-30), n, w);
                assert!((o - p).dot(n) * w.dot(n) >= 0.0, "{n} {w} {p} {o}");
            }
        }
    }

    #[test]
    fn push_matches_the_library_steps() {
        for x in [1.0f32, -1.0, 3.5e-30, -7e20] {
            assert_eq!(push_outward(x, 1e-9), x.next_up());
            assert_eq!(push_outward(x, -1e-9), x.next_down());
        }
    }
}
