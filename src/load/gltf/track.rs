//! Keys of one channel of an animation, and what holds between them.

use crate::math::DQuat;

/// What holds between two keys.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Interpolation {
    /// The first.
    Step,
    /// A line; for rotations the shorter way round.
    Linear,
    /// A Hermite spline.
    Cubic,
}

/// Keys of one channel. `values` holds `width` numbers a key; with cubic splines the in-tangent, the value and the
/// out-tangent of each.
pub(super) struct Track<'t> {
    /// Seconds, not decreasing.
    pub times: &'t [f32],
    /// What holds at each key.
    pub values: &'t [f32],
    /// Numbers of a value.
    pub width: usize,
    /// What holds between the keys.
    pub interpolation: Interpolation,
}

impl Track<'_> {
    /// The value at a moment (glTF 2.0, appendix C).
    pub fn at(&self, time_s: f64, is_rotation: bool) -> Vec<f64> {
        let after = self.times.partition_point(|&t| f64::from(t) <= time_s);
        let last = self.times.len() - 1;
        if after == 0 || after > last || self.interpolation == Interpolation::Step {
            return self.value(after.saturating_sub(1).min(last));
        }
        let (k, next) = (after - 1, after);
        let length = f64::from(self.times[next]) - f64::from(self.times[k]);
        let t = (time_s - f64::from(self.times[k])) / length;
        let (from, to) = (self.value(k), self.value(next));
        if self.interpolation == Interpolation::Cubic {
            let (out, into) = (self.part(k, 2), self.part(next, 0));
            let (t2, t3) = (t * t, t * t * t);
            let blend = |i: usize| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * from[i]
                    + length * (t3 - 2.0 * t2 + t) * out[i]
                    + (3.0 * t2 - 2.0 * t3) * to[i]
                    + length * (t3 - t2) * into[i]
            };
            return (0..self.width).map(blend).collect();
        }
        if is_rotation {
            // The shorter way round, at constant speed.
            let [a, b] = [from, to].map(|v| DQuat::from_slice(&v));
            return a.normalize().slerp(b.normalize(), t).to_array().to_vec();
        }
        (0..self.width).map(|i| from[i] + (to[i] - from[i]) * t).collect()
    }

    fn value(&self, key: usize) -> Vec<f64> {
        self.part(key, 1)
    }

    /// Of a cubic spline's key: 0 the in-tangent, 1 the value, 2 the out-tangent.
    fn part(&self, key: usize, part: usize) -> Vec<f64> {
        let entry = if self.interpolation == Interpolation::Cubic { key * 3 + part } else { key };
        self.values[entry * self.width..][..self.width].iter().map(|&v| f64::from(v)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track<'t>(
        times: &'t [f32],
        values: &'t [f32],
        width: usize,
        interpolation: Interpolation,
    ) -> Track<'t> {
        Track { times, values, width, interpolation }
    }

    #[test]
    fn steps_and_lines_hold_outside_their_keys() {
        let (times, values) = ([1.0, 2.0, 4.0], [10.0, 20.0, 40.0]);
        let linear = track(&times, &values, 1, Interpolation::Linear);
        let step = track(&times, &values, 1, Interpolation::Step);
        for (t, on_line, on_step) in
            [(0.0, 10.0, 10.0), (1.5, 15.0, 10.0), (2.0, 20.0, 20.0), (3.0, 30.0, 20.0), (9.0, 40.0, 40.0)]
        {
            assert_eq!((linear.at(t, false), step.at(t, false)), (vec![on_line], vec![on_step]), "{t}");
        }
    }

    /// The Hermite spline through x^3 from 0 to 2 is x^3 itself; tangents are a unit of time's.
    #[test]
    fn splines_follow_a_cubic() {
        let (times, values) = ([0.0, 2.0], [0.0, 0.0, 0.0, 12.0, 8.0, 12.0]);
        let spline = track(&times, &values, 1, Interpolation::Cubic);
        for t in [0.0, 0.3, 1.0, 1.7, 2.0] {
            assert!((spline.at(t, false)[0] - t.powi(3)).abs() < 1e-12);
        }
    }

    /// From the identity to a quarter turn, written with the other sign: halfway is an eighth turn, not the long way.
    #[test]
    fn rotations_go_the_short_way() {
        let end = -DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let values: Vec<f32> =
            [0.0, 0.0, 0.0, 1.0].into_iter().chain(end.to_array().map(|v| v as f32)).collect();
        let q = track(&[0.0, 1.0], &values, 4, Interpolation::Linear).at(0.5, true);
        let expected = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
        assert!(DQuat::from_slice(&q).dot(expected).abs() > 1.0 - 1e-9);
    }
}
