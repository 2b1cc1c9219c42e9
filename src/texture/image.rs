//! Image lookup: wrap modes, nearest and bilinear.

use crate::image::Image;
use crate::math::Vec2;
use crate::scene::{Interpolation, Wrap};

/// An image with the way in which it is read. Texel centres lie at `(i + 0.5) / width`; v points down.
#[derive(Clone, Debug)]
pub struct ImageLookup {
    image: Image,
    wrap: [Wrap; 2],
    interpolation: Interpolation,
}

impl ImageLookup {
    /// Reads `image` this way; its pixels are shared, not copied.
    pub fn new(image: Image, wrap_u: Wrap, wrap_v: Wrap, interpolation: Interpolation) -> ImageLookup {
        ImageLookup { image, wrap: [wrap_u, wrap_v], interpolation }
    }

    /// Linear RGBA at texture coordinates; values are decoded before they are blended. Coordinates that are no numbers
    /// count as 0.
    #[inline]
    pub fn eval(&self, uv: Vec2) -> [f32; 4] {
        let size = [self.image.width, self.image.height];
        let x = fold(uv.x, self.wrap[0]) * size[0] as f32;
        let y = fold(uv.y, self.wrap[1]) * size[1] as f32;
        match self.interpolation {
            Interpolation::Nearest => {
                self.image.rgba((x as u32).min(size[0] - 1), (y as u32).min(size[1] - 1))
            }
            Interpolation::Bilinear => {
                let (x0, x1, s) = neighbours(x, size[0], self.wrap[0]);
                let (y0, y1, t) = neighbours(y, size[1], self.wrap[1]);
                let [a, b] = [self.image.rgba(x0, y0), self.image.rgba(x1, y0)];
                let [c, d] = [self.image.rgba(x0, y1), self.image.rgba(x1, y1)];
                std::array::from_fn(|i| {
                    let top = a[i] + s * (b[i] - a[i]);
                    let bottom = c[i] + s * (d[i] - c[i]);
                    top + t * (bottom - top)
                })
            }
        }
    }
}

/// A coordinate brought into 0..1.
#[inline(always)]
fn fold(x: f32, wrap: Wrap) -> f32 {
    let x = if x.is_finite() { x } else { 0.0 };
    match wrap {
        Wrap::Repeat => x - x.floor(),
        Wrap::Mirror => {
            // A triangle wave of period 2.
            let half = x * 0.5;
            let saw = (half - half.floor()) * 2.0;
            if saw > 1.0 { 2.0 - saw } else { saw }
        }
        Wrap::Clamp => x.clamp(0.0, 1.0),
    }
}

/// The texels around a position (in texels from the border) and the second one's share. A mirrored or clamped border
/// continues with its own texel.
#[inline(always)]
fn neighbours(x: f32, size: u32, wrap: Wrap) -> (u32, u32, f32) {
    let last = size - 1;
    let shifted = x - 0.5;
    let floor = shifted.floor();
    let share = shifted - floor;
    let low = floor as i64;
    let texel = |i: i64| match wrap {
        Wrap::Repeat if i < 0 => last,
        Wrap::Repeat if i > i64::from(last) => 0,
        _ => i.clamp(0, i64::from(last)) as u32,
    };
    (texel(low), texel(low + 1), share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Pixels};
    use std::sync::Arc;

    /// Red counts the columns 0..3, green the rows.
    fn ramp() -> Image {
        let rgb = (0..12).flat_map(|i| [(i % 4) as f32, (i / 4) as f32, 0.0]).collect();
        Image::from_linear_rgb("ramp", 4, 3, rgb)
    }

    fn red(wrap: Wrap, interpolation: Interpolation, u: f32) -> f32 {
        ImageLookup::new(ramp(), wrap, wrap, interpolation).eval(Vec2::new(u, 0.5))[0]
    }

    #[test]
    fn bilinear_follows_a_ramp_and_wraps_at_the_border() {
        for (wrap, border) in [(Wrap::Repeat, 1.5), (Wrap::Mirror, 3.0), (Wrap::Clamp, 3.0)] {
            for u in [0.125f32, 0.3, 0.5, 0.874] {
                assert!((red(wrap, Interpolation::Bilinear, u) - (u * 4.0 - 0.5)).abs() < 1e-5);
            }
            assert!((red(wrap, Interpolation::Bilinear, 0.999_999) - border).abs() < 1e-4, "{wrap:?}");
        }
    }

    #[test]
    fn wrap_modes_outside() {
        let nearest = |wrap, u| red(wrap, Interpolation::Nearest, u);
        assert_eq!([nearest(Wrap::Repeat, 1.3), nearest(Wrap::Repeat, -0.1)], [1.0, 3.0]);
        assert_eq!([nearest(Wrap::Mirror, 1.3), nearest(Wrap::Mirror, -0.1)], [2.0, 0.0]);
        assert_eq!([nearest(Wrap::Clamp, 1.3), nearest(Wrap::Clamp, -0.1)], [3.0, 0.0]);
        for u in [f32::NAN, f32::INFINITY, -1e30, 3e38, -1e-30] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                for interpolation in [Interpolation::Nearest, Interpolation::Bilinear] {
                    assert!((0.0..=3.0).contains(&red(wrap, interpolation, u)), "{u} {wrap:?}");
                }
            }
        }
    }

    #[test]
    fn eight_bit_srgb_is_decoded_before_blending() {
        let image = Image {
            name: "two".into(),
            width: 2,
            height: 1,
            channels: 1,
            encoding: Encoding::Srgb,
            pixels: Arc::new(Pixels::U8(vec![0, 255])),
        };
        let lookup = ImageLookup::new(image, Wrap::Clamp, Wrap::Clamp, Interpolation::Bilinear);
        assert!((lookup.eval(Vec2::new(0.5, 0.5))[1] - 0.5).abs() < 1e-6);
    }
}
