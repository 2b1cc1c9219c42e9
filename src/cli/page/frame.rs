//! A picture on its way, as pages show it.

use oscura::film::{Aov, Film, Values};
use oscura::output::{OutputOptions, PngOptions, ViewTransform, rgba8};
use oscura::render::Rendering;
use serde_json::{Map, Value, json};

/// How pictures are shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Look {
    pub png: PngOptions,
    /// The pass to show in place of colour.
    pub aov: Option<Aov>,
    /// A view besides those with names, to go back to.
    pub own_view: Option<ViewTransform>,
}

impl Look {
    /// Colour as said.
    pub fn new(png: PngOptions) -> Look {
        let own_view = Some(png.view.clone()).filter(|view| matches!(view, ViewTransform::Table(_)));
        Look { png, aov: None, own_view }
    }

    /// The names of all views.
    pub fn views(&self) -> Vec<String> {
        let named = ViewTransform::NAMED.iter().map(|named| named.1.to_string());
        named.chain(self.own_view.iter().map(|view| view.name().into_owned())).collect()
    }

    /// The view of a name.
    pub fn view(&self, name: &str) -> Option<ViewTransform> {
        let own = self.own_view.as_ref().filter(|view| view.name() == name);
        own.cloned().or_else(|| ViewTransform::from_name(name))
    }
}

/// A picture so far.
pub(crate) struct Frame {
    /// Colour, depth, and at most one AOV.
    pub film: Film,
    pub output: OutputOptions,
    pub samples: f64,
    pub seconds: f64,
    /// Estimated relative error of the whole picture, once there is an estimate.
    pub error: Option<f64>,
    /// Size of the finished picture over that of this one.
    pub scale: u32,
    pub is_finished: bool,
    /// The number of the wish that it fulfils.
    pub order: u64,
}

impl Frame {
    /// The picture so far, in full size, for the wish of a number.
    pub fn of(rendering: &Rendering, is_finished: bool, order: u64) -> Frame {
        let statistics = rendering.statistics();
        Frame {
            film: rendering.shown().into_owned(),
            output: rendering.output_options(),
            samples: statistics.samples_per_pixel,
            seconds: statistics.render_s,
            error: statistics.error,
            scale: 1,
            is_finished,
            order,
        }
    }

    /// RGBA, 8 bits, row by row from the top.
    pub fn pixels(&self, look: &Look) -> Vec<u8> {
        match look.aov.and_then(|aov| Some((aov, self.film.aov(aov)?))) {
            None => rgba8(&self.film, &look.png),
            Some((aov, planes)) => show(aov, planes, &look.png),
        }
    }

    /// Everything about the pixel at a place, as shares of width and height from the upper left corner.
    pub fn probe(&self, x: f64, y: f64) -> Option<Value> {
        let (x, y) = self.pixel(x, y)?;
        let mut values = Map::new();
        for plane in self.film.pixel(x, y).ok()?.planes() {
            let value = match &plane.values {
                Values::Float(values) => values.first().map(|v| json!(v)),
                Values::Uint(values) => values.first().map(|v| json!(v)),
                _ => None,
            };
            values.insert(plane.name.to_string(), value.unwrap_or(Value::Null));
        }
        let scale = self.scale;
        Some(json!({ "x": x * scale, "y": y * scale, "samples": self.film.samples(x, y), "values": values }))
    }

    /// Depth at a place, metres; `None` where nothing was hit.
    pub fn depth(&self, x: f64, y: f64) -> Option<f64> {
        let (x, y) = self.pixel(x, y)?;
        let depth = *self.film.pixel(x, y).ok()?.plane("Z")?.into_floats().first()?;
        (depth > 0.0 && depth < 0.5 * oscura::film::BACKGROUND_DEPTH).then_some(f64::from(depth))
    }

    fn pixel(&self, x: f64, y: f64) -> Option<(u32, u32)> {
        let place = |share: f64, size: u32| {
            ((0.0..=1.0).contains(&share)).then_some(((share * f64::from(size)) as u32).min(size - 1))
        };
        Some((place(x, self.film.width())?, place(y, self.film.height())?))
    }
}

/// A pass as colours: colours by the look, directions as normal maps have them, ids by hue, other numbers from black for the
/// least to white for the largest (depths the other way round, in logarithms).
fn show(aov: Aov, planes: Vec<Values>, png: &PngOptions) -> Vec<u8> {
    let names = aov.info().names;
    let planes: Vec<Vec<f32>> = planes.into_iter().map(Values::into_floats).collect();
    let is = |ending: &str| names.first().is_some_and(|name| name.ends_with(ending));
    let gain = png.exposure.exp2();
    let rgb: Box<dyn Fn(usize) -> [f32; 3]> = if aov.info().option.ends_with("_id") {
        Box::new(|i| hue(planes[0][i]))
    } else if is("00.R") {
        Box::new(|i| hue(planes[0][i]).map(|c| c * planes[1][i]))
    } else if is(".R") {
        Box::new(|i| png.view.encode([0, 1, 2].map(|c| gain * planes[c][i])))
    } else if names[0].starts_with('N') && is(".X") {
        Box::new(|i| [0, 1, 2].map(|c| 0.5 + 0.5 * planes[c][i]))
    } else {
        let is_depth = is("Z");
        let scaled: Vec<Vec<f32>> = planes.iter().map(|plane| spread(plane, is_depth)).collect();
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

/// Values brought to 0..1.
fn spread(plane: &[f32], is_depth: bool) -> Vec<f32> {
    let value = |v: f32| if is_depth { -v.max(1e-6).ln() } else { v };
    let is_there = |v: f32| v.is_finite() && v < 0.5 * oscura::film::BACKGROUND_DEPTH;
    let there = plane.iter().copied().filter(|&v| is_there(v)).map(value);
    let (low, high) = there.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let range = (high - low).max(1e-20);
    let share = |&v: &f32| if is_there(v) { (value(v) - low) / range } else { 0.0 };
    plane.iter().map(share).collect()
}

/// A colour for an id, whatever it is a number of; black for none.
fn hue(id: f32) -> [f32; 3] {
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
    fn numbers_spread_from_black_to_white() {
        assert_eq!(spread(&[1.0, 3.0, 2.0, f32::NAN], false), [0.0, 1.0, 0.5, 0.0]);
        let depths = spread(&[1.0, 100.0, 10.0, oscura::film::BACKGROUND_DEPTH], true);
        assert_eq!((depths[0], depths[1], depths[3]), (1.0, 0.0, 0.0));
        assert!((depths[2] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn ids_have_colours_of_their_own() {
        assert_eq!(hue(0.0), [0.0; 3]);
        assert_ne!(hue(1.0), hue(2.0));
    }
}
