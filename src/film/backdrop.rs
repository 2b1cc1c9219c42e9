//! What lies behind a picture where it is transparent.

use super::Film;
use crate::image::Image;
use crate::scene::Backdrop;

impl Film {
    /// Lays a scene's backdrop behind the pixels that are transparent.
    pub fn lay_behind(&mut self, backdrop: &Backdrop) {
        match backdrop {
            Backdrop::Color(color) => self.put_behind(|_, _| *color),
            Backdrop::Picture(image) => {
                let (width, height) = (self.width(), self.height());
                let scale = (f64::from(image.width) / f64::from(width))
                    .min(f64::from(image.height) / f64::from(height));
                self.put_behind(|x, y| {
                    let place = |p: u32, own: u32, of: u32| {
                        let from_middle = f64::from(p) + 0.5 - f64::from(own) / 2.0;
                        f64::from(of) / 2.0 + scale * from_middle
                    };
                    bilinear(image, place(x, width, image.width), place(y, height, image.height))
                });
            }
        }
    }
}

/// The colour of an image at a place in pixels from its corner, blended from the four around it.
fn bilinear(image: &Image, x: f64, y: f64) -> [f32; 3] {
    let low = |v: f64, size: u32| (v - 0.5).clamp(0.0, f64::from(size - 1));
    let (x, y) = (low(x, image.width), low(y, image.height));
    let (x0, y0) = (x as u32, y as u32);
    let (x1, y1) = ((x0 + 1).min(image.width - 1), (y0 + 1).min(image.height - 1));
    let (u, v) = (x.fract() as f32, y.fract() as f32);
    let [a, b, c, d] = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| image.rgba(x, y));
    std::array::from_fn(|k| (a[k] * (1.0 - u) + b[k] * u) * (1.0 - v) + (c[k] * (1.0 - u) + d[k] * u) * v)
}
