//! 8-bit pictures of a frame for the page: colour, noisy or denoised, or a pass; outlines of objects.

use super::state::{Denoised, Frame, PageDisplay};
use crate::cli::convert::color_of;
use crate::cli::pixels::Pixels;
use oscura::film::{Aov, Film, Values};
use oscura::output::{PngOptions, rgba8};

/// The picture of a frame for the page.
pub(super) fn of_frame(frame: &Frame, denoised: Option<&Denoised>, display: &PageDisplay) -> Pixels {
    let pass = display.aov.and_then(|aov| Some((aov, frame.film.aov(aov)?)));
    let with_size = |film: &Film, rgba| Pixels { size: (film.width(), film.height()), rgba };
    match (pass, denoised) {
        (Some((aov, planes)), _) => with_size(&frame.film, show(aov, planes, &display.png)),
        (None, None) => with_size(&frame.film, rgba8(&frame.film, &display.png)),
        (None, Some(Denoised { film, .. })) => {
            let after = with_size(film, rgba8(film, &display.png));
            if display.split <= 0.0 {
                return after;
            }
            let before = with_size(&frame.film, rgba8(&frame.film, &display.png));
            composed(before, &after, display.split)
        }
    }
}

/// `left` with `right` to the right of `split`, a fraction of the width; the size is that of `left`.
fn composed(mut left: Pixels, right: &Pixels, split: f64) -> Pixels {
    let (width, height) = left.size;
    let first = ((split * f64::from(width)) as u32).min(width);
    for (x, y) in (0..height).flat_map(|y| (first..width).map(move |x| (x, y))) {
        let scaled = |at: u32, from: u32, to: u32| (u64::from(at) * u64::from(to) / u64::from(from)) as u32;
        let pixel = right.at(scaled(x, width, right.size.0), scaled(y, height, right.size.1));
        left.rgba[4 * (y as usize * width as usize + x as usize)..][..4].copy_from_slice(&pixel);
    }
    left
}

/// Visualizes a pass: colours through the view transform, normals as in normal maps, ids as random colours, other values from
/// black for the minimum to white for the maximum (depths inverted and logarithmic).
fn show(aov: Aov, planes: Vec<Values>, png: &PngOptions) -> Vec<u8> {
    let names = aov.info().names;
    let planes: Vec<Vec<f32>> = planes.into_iter().map(Values::into_floats).collect();
    let is = |ending: &str| names.first().is_some_and(|name| name.ends_with(ending));
    let gain = png.exposure.exp2();
    let rgb: Box<dyn Fn(usize) -> [f32; 3]> = if aov.info().option.ends_with("_id") {
        Box::new(|i| color_of(planes[0][i].to_bits()))
    } else if is("00.R") {
        Box::new(|i| color_of(planes[0][i].to_bits()).map(|c| c * planes[1][i]))
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
    fn the_noisy_picture_is_left_of_the_split() {
        let filled = |size: (u32, u32), v: u8| Pixels { size, rgba: vec![v; 4 * (size.0 * size.1) as usize] };
        let both = composed(filled((4, 2), 10), &filled((2, 1), 200), 0.5);
        assert_eq!(both.size, (4, 2));
        let reds: Vec<u8> = both.rgba.chunks(4).map(|pixel| pixel[0]).collect();
        assert_eq!(reds, [10, 10, 200, 200, 10, 10, 200, 200]);
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
