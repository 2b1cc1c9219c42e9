//! A tileable brick texture, for projection onto meshes.

use crate::random::Random;

/// Edge of the square image, pixels.
pub const SIZE: u32 = 256;
/// Courses in the image; an even number, so that it tiles.
const ROWS: u32 = 8;
/// Bricks in a course.
const COLUMNS: u32 = 4;
/// Half the width of a joint, pixels.
const JOINT: f64 = 1.6;

/// `SIZE` x `SIZE` pixels of 8-bit sRGB.
pub fn pixels() -> Vec<u8> {
    let mut random = Random::new(7);
    let tints: Vec<f64> = (0..ROWS * COLUMNS).map(|_| random.between(0.78, 1.12)).collect();
    let (width, height) = (f64::from(SIZE / COLUMNS), f64::from(SIZE / ROWS));
    let mut bytes = Vec::with_capacity((SIZE * SIZE * 3) as usize);
    for (y, x) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (y, x))) {
        let row = y / (SIZE / ROWS);
        let shift = if row.is_multiple_of(2) { 0 } else { SIZE / COLUMNS / 2 };
        let along = (x + shift) % SIZE;
        let column = along / (SIZE / COLUMNS);
        let to_edge = |at: f64, size: f64| at.min(size - at);
        let inside_x = f64::from(along % (SIZE / COLUMNS)) + 0.5;
        let inside_y = f64::from(y % (SIZE / ROWS)) + 0.5;
        let distance = to_edge(inside_x, width).min(to_edge(inside_y, height));
        // One pixel of blend between joint and brick.
        let brick = (distance - JOINT + 0.5).clamp(0.0, 1.0);
        let grain = random.between(-0.05, 0.05);
        let tint = tints[(row * COLUMNS + column) as usize];
        let (face, joint) = ([0.66, 0.30, 0.22].map(|c| c * tint), [0.72, 0.70, 0.66]);
        let color: [f64; 3] = std::array::from_fn(|c| joint[c] + (face[c] - joint[c]) * brick + grain);
        bytes.extend(color.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_tiles() {
        let pixels = pixels();
        assert_eq!(pixels.len(), (SIZE * SIZE * 3) as usize);
        // Joints are at both the top and the bottom: the image tiles.
        let row = |y: u32| &pixels[(y * SIZE * 3) as usize..((y + 1) * SIZE * 3) as usize];
        let mean = |r: &[u8]| r.iter().map(|&v| f64::from(v)).sum::<f64>() / r.len() as f64;
        assert!((mean(row(0)) - mean(row(SIZE - 1))).abs() < 2.0);
        assert!(mean(row(0)) > mean(row(SIZE / ROWS / 2)) + 20.0);
    }
}
