//! Where an object is in a frame: its outline as an SVG path.

use super::state::Frame;
use oscura::film::{Aov, Values};

/// An object at a place of the picture.
#[derive(Debug, PartialEq, serde::Serialize)]
pub(super) struct Outline {
    /// From 1.
    pub object: u32,
    pub name: String,
    /// Size of the frame, whose pixels are the path's units.
    pub width: u32,
    pub height: u32,
    pub path: String,
}

impl Outline {
    /// The object at shares of the picture's width and height; `None` where there is none or the frame doesn't know.
    pub fn at(frame: &Frame, (x, y): (f64, f64), names: &[String]) -> Option<Outline> {
        let (x, y) = frame.pixel(x, y)?;
        let Values::Uint(ids) = frame.film.aov(Aov::ObjectId)?.into_iter().next()? else { return None };
        let (width, height) = (frame.film.width(), frame.film.height());
        let object = *ids.get((y * width + x) as usize).filter(|id| **id > 0)?;
        let name = names.get(object as usize - 1).filter(|name| !name.is_empty());
        let name = name.cloned().unwrap_or_else(|| format!("object {object}"));
        let is_it = |x: usize, y: usize| {
            x < width as usize && y < height as usize && ids[y * width as usize + x] == object
        };
        Some(Outline { object, name, width, height, path: path(width as usize, height as usize, is_it) })
    }
}

/// The sides between pixels that belong to something and those that don't, as a path of horizontal and vertical lines.
fn path(width: usize, height: usize, is_it: impl Fn(usize, usize) -> bool) -> String {
    let mut path = String::new();
    // Beyond the upper and left edge, the wrapped index is outside as well.
    let across = |x: usize, y: usize| is_it(x, y) != is_it(x, y.wrapping_sub(1));
    let down = |y: usize, x: usize| is_it(x, y) != is_it(x.wrapping_sub(1), y);
    for y in 0..=height {
        runs(width, |x| across(x, y)).into_iter().for_each(|(from, to)| path += &format!("M{from} {y}H{to}"));
    }
    for x in 0..=width {
        runs(height, |y| down(y, x)).into_iter().for_each(|(from, to)| path += &format!("M{x} {from}V{to}"));
    }
    path
}

/// The longest runs of places that suit, as ranges.
fn runs(count: usize, suits: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for at in (0..count).filter(|&at| suits(at)) {
        match runs.last_mut() {
            Some((_, end)) if *end == at => *end = at + 1,
            _ => runs.push((at, at + 1)),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::path;

    #[test]
    fn outlines_go_around_what_belongs_to_an_object() {
        let one = path(4, 3, |x, y| (x, y) == (1, 1));
        assert_eq!(one, "M1 1H2M1 2H2M1 1V2M2 1V2");
        let all = path(4, 3, |x, y| x < 4 && y < 3);
        assert_eq!(all, "M0 0H4M0 3H4M0 0V3M4 0V3", "the picture's edge closes it");
        assert_eq!(path(4, 3, |_, _| false), "");
    }
}
