//! 8-bit pictures of a frame for the page: colour, noisy or denoised, or a pass; outlines of objects.

use super::state::{Denoised, Frame, PageDisplay};
use oscura::film::{Aov, Film, Values};
use oscura::output::{PngOptions, rgba8};

/// RGBA, 8 bits, row by row from the top.
pub(super) struct Pixels {
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<u8>,
}

impl Pixels {
    /// The picture of a frame for the page.
    pub fn of(frame: &Frame, denoised: Option<&Denoised>, display: &PageDisplay) -> Pixels {
        let pass = display.aov.and_then(|aov| Some((aov, frame.film.aov(aov)?)));
        let with_size = |film: &Film, rgba| Pixels { width: film.width(), height: film.height(), rgba };
        match (pass, denoised) {
            (Some((aov, planes)), _) => with_size(&frame.film, show(aov, planes, &display.png)),
            (None, None) => with_size(&frame.film, rgba8(&frame.film, &display.png)),
            (None, Some(Denoised { film, .. })) => {
                let after = with_size(film, rgba8(film, &display.png));
                if display.split <= 0.0 {
                    return after;
                }
                after.right_of(display.split, with_size(&frame.film, rgba8(&frame.film, &display.png)))
            }
        }
    }

    /// Composes `left` with this picture to the right of `split`, a fraction of the width; the size is that of `left`.
    fn right_of(&self, split: f64, mut left: Pixels) -> Pixels {
        let (width, height) = (left.width as usize, left.height as usize);
        let first = ((split * width as f64) as usize).min(width);
        for y in 0..height {
            for x in first..width {
                let at = (y * self.height as usize / height) * self.width as usize
                    + x * self.width as usize / width;
                left.rgba[4 * (y * width + x)..][..4].copy_from_slice(&self.rgba[4 * at..][..4]);
            }
        }
        left
    }

    /// Downsamples by an integer factor to a width of at most `max_width`, with a box filter.
    pub fn reduced(&self, max_width: u32) -> Pixels {
        let step = self.width.div_ceil(max_width).max(1) as usize;
        let (width, height) = (self.width as usize / step, (self.height as usize / step).max(1));
        let mean = |x: usize, y: usize, c: usize| {
            let rows = (y * step)..(y * step + step).min(self.height as usize);
            let (mut sum, mut count) = (0, 0);
            for row in rows {
                for column in x * step..x * step + step {
                    sum += u32::from(self.rgba[4 * (row * self.width as usize + column) + c]);
                    count += 1;
                }
            }
            (sum / count) as u8
        };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let rgba = pixels.flat_map(|(x, y)| [0, 1, 2, 3].map(|c| mean(x, y, c))).collect();
        Pixels { width: width as u32, height: height as u32, rgba }
    }
}

/// Visualizes a pass: colours through the view transform, normals as in normal maps, ids as random colours, other values from
/// black for the minimum to white for the maximum (depths inverted and logarithmic).
fn show(aov: Aov, planes: Vec<Values>, png: &PngOptions) -> Vec<u8> {
    let names = aov.info().names;
    let planes: Vec<Vec<f32>> = planes.into_iter().map(Values::into_floats).collect();
    let is = |ending: &str| names.first().is_some_and(|name| name.ends_with(ending));
    let gain = png.exposure.exp2();
    let rgb: Box<dyn Fn(usize) -> [f32; 3]> = if aov.info().option.ends_with("_id") {
        Box::new(|i| id_color(planes[0][i]))
    } else if is("00.R") {
        Box::new(|i| id_color(planes[0][i]).map(|c| c * planes[1][i]))
    } else if is(".R") {
        Box::new(|i| png.view.encode([0, 1, 2].map(|c| gain * planes[c][i])))
    } else if names[0].starts_with('N') && is(".X") {
        Box::new(|i| [0, 1, 2].map(|c| 0.5 + 0.5 * planes[c][i]))
    } else {
        let is_depth = is("Z");
        let scaled: Vec<Vec<f32>> = planes.iter().map(|plane| normalized(plane, is_depth)).collect();
        Box::new(move |i| {
            [0, 1, 2]
                .map(|c| scaled.get(c).or(scaled.last().filter(|_| scaled.len() == 1)).map_or(0.0, |p| p[i]))
        })
    };
    let byte = |v: f32| (v * 255.0 + 0.5) as u8;
    (0..planes[0].len())
        .flat_map(|i| {
            let [r, g, b] = rgb(i).map(byte);
            [r, g, b, 255]
        })
        .collect()
}

/// Values scaled to 0..1; invalid values and background depths become 0.
fn normalized(plane: &[f32], is_depth: bool) -> Vec<f32> {
    let value = |v: f32| if is_depth { -v.max(1e-6).ln() } else { v };
    let is_valid = |v: f32| v.is_finite() && v < 0.5 * oscura::film::BACKGROUND_DEPTH;
    let valid = plane.iter().copied().filter(|&v| is_valid(v)).map(value);
    let (low, high) = valid.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let range = (high - low).max(1e-20);
    let scaled = |&v: &f32| if is_valid(v) { (value(v) - low) / range } else { 0.0 };
    plane.iter().map(scaled).collect()
}

/// A random colour for an id; black for 0.
fn id_color(id: f32) -> [f32; 3] {
    if id == 0.0 {
        return [0.0; 3];
    }
    let mixed = id.to_bits().wrapping_mul(0x9e37_79b1) ^ (id.to_bits() >> 15);
    let part = |shift: u32| 0.25 + 0.75 * ((mixed.wrapping_mul(0x85eb_ca6b) >> shift & 255) as f32 / 255.0);
    [part(24), part(16), part(8)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_scaled_from_black_to_white() {
        assert_eq!(normalized(&[1.0, 3.0, 2.0, f32::NAN], false), [0.0, 1.0, 0.5, 0.0]);
        let depths = normalized(&[1.0, 100.0, 10.0, oscura::film::BACKGROUND_DEPTH], true);
        assert_eq!((depths[0], depths[1], depths[3]), (1.0, 0.0, 0.0));
        assert!((depths[2] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn ids_have_different_colors() {
        assert_eq!(id_color(0.0), [0.0; 3]);
        assert_ne!(id_color(1.0), id_color(2.0));
    }

    #[test]
    fn the_noisy_picture_is_left_of_the_split() {
        let filled =
            |width, height, v: u8| Pixels { width, height, rgba: vec![v; 4 * (width * height) as usize] };
        let both = filled(2, 1, 200).right_of(0.5, filled(4, 2, 10));
        assert_eq!((both.width, both.height), (4, 2));
        let reds: Vec<u8> = both.rgba.chunks(4).map(|pixel| pixel[0]).collect();
        assert_eq!(reds, [10, 10, 200, 200, 10, 10, 200, 200]);
    }

    #[test]
    fn reduced_pictures_are_means_of_blocks() {
        let rgba = [0, 100, 50, 50, 100, 200, 50, 50, 9, 9].iter().flat_map(|&v| [v; 4]).collect();
        let small = Pixels { width: 5, height: 2, rgba }.reduced(2);
        // Blocks of three columns: the last two columns are dropped.
        assert_eq!((small.width, small.height, small.rgba.len()), (1, 1, 4));
        let same = Pixels { width: 2, height: 1, rgba: vec![7; 8] }.reduced(160);
        assert_eq!((same.width, same.height, same.rgba), (2, 1, vec![7; 8]));
    }
}

/// The outline of an object in a frame.
#[derive(Debug, PartialEq, serde::Serialize)]
pub(super) struct Outline {
    /// Object id, from 1.
    pub object: u32,
    pub name: String,
    /// Size of the frame, pixels.
    pub width: u32,
    pub height: u32,
    /// SVG path, in pixels.
    pub path: String,
}

impl Outline {
    /// The object at fractions of the picture's width and height; `None` for the background or without object ids.
    pub fn at(frame: &Frame, (x, y): (f64, f64), names: &[String]) -> Option<Outline> {
        let (x, y) = frame.pixel(x, y)?;
        let Values::Uint(ids) = frame.film.aov(Aov::ObjectId)?.into_iter().next()? else { return None };
        let (width, height) = (frame.film.width(), frame.film.height());
        let object = *ids.get((y * width + x) as usize).filter(|id| **id > 0)?;
        let name = names.get(object as usize - 1).filter(|name| !name.is_empty());
        let name = name.cloned().unwrap_or_else(|| format!("object {object}"));
        let is_inside = |x: usize, y: usize| {
            x < width as usize && y < height as usize && ids[y * width as usize + x] == object
        };
        Some(Outline { object, name, width, height, path: path(width as usize, height as usize, is_inside) })
    }
}

/// The pixel edges between inside and outside, as an SVG path of horizontal and vertical lines.
fn path(width: usize, height: usize, is_inside: impl Fn(usize, usize) -> bool) -> String {
    let mut path = String::new();
    // Beyond the upper and left edge, the wrapped index is outside as well.
    let across = |x: usize, y: usize| is_inside(x, y) != is_inside(x, y.wrapping_sub(1));
    let down = |y: usize, x: usize| is_inside(x, y) != is_inside(x.wrapping_sub(1), y);
    for y in 0..=height {
        runs(width, |x| across(x, y)).into_iter().for_each(|(from, to)| path += &format!("M{from} {y}H{to}"));
    }
    for x in 0..=width {
        runs(height, |y| down(y, x)).into_iter().for_each(|(from, to)| path += &format!("M{x} {from}V{to}"));
    }
    path
}

/// The maximal runs of indices for which `is_edge` holds, as ranges.
fn runs(count: usize, is_edge: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for at in (0..count).filter(|&at| is_edge(at)) {
        match runs.last_mut() {
            Some((_, end)) if *end == at => *end = at + 1,
            _ => runs.push((at, at + 1)),
        }
    }
    runs
}

#[cfg(test)]
mod outline_tests {
    use super::path;

    #[test]
    fn outlines_enclose_the_pixels_of_an_object() {
        let one = path(4, 3, |x, y| (x, y) == (1, 1));
        assert_eq!(one, "M1 1H2M1 2H2M1 1V2M2 1V2");
        let all = path(4, 3, |x, y| x < 4 && y < 3);
        assert_eq!(all, "M0 0H4M0 3H4M0 0V3M4 0V3", "the picture's edge closes it");
        assert_eq!(path(4, 3, |_, _| false), "");
    }
}
