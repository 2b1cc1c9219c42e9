//! Fireflies: pixels that a rare path made far brighter than all around them.

use super::planes::Planes;
use crate::color::luminance;

/// Radius of the neighbourhood that pixels are compared with.
const RADIUS: isize = 2;
/// As many neighbours that are as bright make a pixel part of what it shows.
const RANK: usize = 3;
/// How many times as bright as the neighbour of that rank, and as the same pixel of the other half, a pixel may be.
const LIMIT: f32 = 10.0;

/// Factors in 0..1 that take the fireflies out of red, green and blue planes. `other` has the other half of the samples,
/// which shows what is really there.
pub(super) fn factors(color: &Planes, other: Option<&Planes>) -> Vec<f32> {
    let brightness = brightness(color);
    let mut factors = Vec::with_capacity(color.width * color.height);
    for y in 0..color.height as isize {
        for x in 0..color.width as isize {
            let own = brightness.data()[brightness.place(0, x, y)];
            let mut largest = [0.0f32; RANK];
            for (dx, dy) in (-RADIUS..=RADIUS).flat_map(|dy| (-RADIUS..=RADIUS).map(move |dx| (dx, dy))) {
                let mut value = brightness.data()[brightness.place(0, x + dx, y + dy)];
                if (dx, dy) != (0, 0) {
                    for kept in &mut largest {
                        (*kept, value) = (kept.max(value), kept.min(value));
                    }
                }
            }
            let also = other.map_or(0.0, |other| brightness_at(other, x, y));
            let limit = LIMIT * largest[RANK - 1].max(also);
            factors.push(if own > limit { limit / own } else { 1.0 });
        }
    }
    factors
}

/// Multiplies all planes by factors.
pub(super) fn apply(planes: &mut Planes, factors: &[f32]) {
    let width = planes.width;
    for plane in 0..planes.count {
        for (y, factors) in factors.chunks_exact(width).enumerate() {
            planes.row_mut(plane, y).iter_mut().zip(factors).for_each(|(v, f)| *v *= f);
        }
    }
    planes.mirror();
}

fn brightness(color: &Planes) -> Planes {
    let mut brightness = Planes::new(color.width, color.height, 1);
    for y in 0..color.height {
        let row = brightness.row_mut(0, y);
        row.iter_mut().enumerate().for_each(|(x, v)| *v = brightness_at(color, x as isize, y as isize));
    }
    brightness.mirror();
    brightness
}

fn brightness_at(color: &Planes, x: isize, y: isize) -> f32 {
    luminance(std::array::from_fn(|c| color.data()[color.place(c, x, y)]))
}
