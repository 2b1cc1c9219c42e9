//! Colour nodes: models, blend modes, adjustments, tables of colours.

use crate::math::poly;
use crate::scene::nodes::{BlendMode, ColorModel};

type Color = [f32; 3];

/// Hue 0..1, saturation, value.
pub fn to_hsv([r, g, b]: Color) -> Color {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let range = most - least;
    if most == 0.0 || range == 0.0 {
        return [0.0, 0.0, most];
    }
    let [cr, cg, cb] = [r, g, b].map(|c| (most - c) / range);
    let sextant = if r == most {
        cb - cg
    } else if g == most {
        2.0 + cr - cb
    } else {
        4.0 + cg - cr
    };
    let hue = sextant / 6.0;
    [if hue < 0.0 { hue + 1.0 } else { hue }, range / most, most]
}

/// From hue, saturation, value.
pub fn from_hsv([h, s, v]: Color) -> Color {
    if s == 0.0 {
        return [v; 3];
    }
    let h = if h == 1.0 { 0.0 } else { h } * 6.0;
    let sextant = h.floor();
    let f = h - sextant;
    let (p, q, t) = (v * (1.0 - s), v * (1.0 - s * f), v * (1.0 - s * (1.0 - f)));
    match sextant as i32 {
        0 => [v, t, p],
        1 => [q, v, p],
        2 => [p, v, t],
        3 => [p, q, v],
        4 => [t, p, v],
        _ => [v, p, q],
    }
}

/// Hue, saturation, lightness.
pub fn to_hsl([r, g, b]: Color) -> Color {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let lightness = ((most + least) / 2.0).min(1.0);
    if most == least {
        return [0.0, 0.0, lightness];
    }
    let range = most - least;
    let saturation = if lightness > 0.5 { range / (2.0 - most - least) } else { range / (most + least) };
    let sextant = if most == r {
        (g - b) / range + if g < b { 6.0 } else { 0.0 }
    } else if most == g {
        (b - r) / range + 2.0
    } else {
        (r - g) / range + 4.0
    };
    [sextant / 6.0, saturation, lightness]
}

/// From hue, saturation, lightness.
pub fn from_hsl([h, s, l]: Color) -> Color {
    let [r, g, b] = [(h * 6.0 - 3.0).abs() - 1.0, 2.0 - (h * 6.0 - 2.0).abs(), 2.0 - (h * 6.0 - 4.0).abs()]
        .map(|c| c.clamp(0.0, 1.0));
    let chroma = (1.0 - (2.0 * l - 1.0).abs()) * s;
    [r, g, b].map(|c| (c - 0.5) * chroma + l)
}

/// Components of a model from red, green, blue.
pub fn separate(model: ColorModel, color: Color) -> Color {
    match model {
        ColorModel::Rgb => color,
        ColorModel::Hsv => to_hsv(color),
        ColorModel::Hsl => to_hsl(color),
    }
}

/// Red, green, blue from components of a model.
pub fn combine(model: ColorModel, components: Color) -> Color {
    match model {
        ColorModel::Rgb => components,
        ColorModel::Hsv => from_hsv(components),
        ColorModel::Hsl => from_hsl(components),
    }
}

/// Blends the second colour over the first.
pub fn blend(mode: BlendMode, t: f32, a: Color, b: Color) -> Color {
    let rest = 1.0 - t;
    let mix = |x: f32, y: f32| rest * x + t * y;
    let each = |f: &dyn Fn(f32, f32) -> f32| -> Color { std::array::from_fn(|i| f(a[i], b[i])) };
    match mode {
        BlendMode::Mix => each(&mix),
        BlendMode::Darken => each(&|x, y| mix(x, x.min(y))),
        BlendMode::Lighten => each(&|x, y| mix(x, x.max(y))),
        BlendMode::Multiply => each(&|x, y| mix(x, x * y)),
        BlendMode::Add => each(&|x, y| mix(x, x + y)),
        BlendMode::Subtract => each(&|x, y| mix(x, x - y)),
        BlendMode::Difference => each(&|x, y| mix(x, (x - y).abs())),
        BlendMode::Exclusion => each(&|x, y| mix(x, x + y - 2.0 * x * y).max(0.0)),
        BlendMode::Divide => each(&|x, y| if y != 0.0 { rest * x + t * x / y } else { x }),
        BlendMode::Screen => each(&|x, y| 1.0 - (rest + t * (1.0 - y)) * (1.0 - x)),
        BlendMode::Overlay => each(&|x, y| {
            if x < 0.5 { x * (rest + 2.0 * t * y) } else { 1.0 - (rest + 2.0 * t * (1.0 - y)) * (1.0 - x) }
        }),
        BlendMode::SoftLight => each(&|x, y| {
            let screen = 1.0 - (1.0 - y) * (1.0 - x);
            rest * x + t * ((1.0 - x) * y * x + x * screen)
        }),
        BlendMode::LinearLight => each(&|x, y| x + t * (2.0 * (y - 0.5))),
        BlendMode::Burn => each(&|x, y| {
            let divisor = rest + t * y;
            if divisor <= 0.0 { 0.0 } else { (1.0 - (1.0 - x) / divisor).clamp(0.0, 1.0) }
        }),
        BlendMode::Dodge => each(&|x, y| {
            let divisor = 1.0 - t * y;
            if x == 0.0 {
                x
            } else if divisor <= 0.0 {
                1.0
            } else {
                (x / divisor).min(1.0)
            }
        }),
        BlendMode::Hue | BlendMode::Saturation | BlendMode::Color | BlendMode::Value => {
            blend_hsv(mode, t, a, b)
        }
    }
}

fn blend_hsv(mode: BlendMode, t: f32, a: Color, b: Color) -> Color {
    let ([ha, sa, va], [hb, sb, vb]) = (to_hsv(a), to_hsv(b));
    let mixed = |x: f32, y: f32| (1.0 - t) * x + t * y;
    let towards = |c: Color| std::array::from_fn(|i| mixed(a[i], c[i]));
    match mode {
        BlendMode::Hue if sb != 0.0 => towards(from_hsv([hb, sa, va])),
        BlendMode::Saturation if sa != 0.0 => from_hsv([ha, mixed(sa, sb), va]),
        BlendMode::Color if sb != 0.0 => towards(from_hsv([hb, sb, va])),
        BlendMode::Value => from_hsv([ha, sa, mixed(va, vb)]),
        _ => a,
    }
}

/// Shifts the hue (0.5 leaves it) and scales saturation and value.
pub fn adjust([hue, saturation, value]: [f32; 3], factor: f32, color: Color) -> Color {
    let [h, s, v] = to_hsv(color);
    let h = h + hue + 0.5;
    let adjusted = from_hsv([h - h.floor(), (s * saturation).clamp(0.0, 1.0), v * value]);
    std::array::from_fn(|i| (factor * adjusted[i] + (1.0 - factor) * color[i]).max(0.0))
}

/// A power of a component.
pub fn gamma(c: f32, exponent: f32) -> f32 {
    if c > 0.0 { poly::exp(exponent * poly::ln(c)) } else { c }
}

/// Values of one or more functions, evenly spaced.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<const N: usize> {
    /// At least one.
    pub values: Vec<[f32; N]>,
}

impl<const N: usize> Table<N> {
    /// Component `i` at 0..1 of the table's range, linear between values.
    pub fn at(&self, x: f32, i: usize) -> f32 {
        let place = x.clamp(0.0, 1.0) * (self.values.len() - 1) as f32;
        let below = place.floor();
        let t = place - below;
        let a = self.values[below as usize][i];
        match self.values.get(below as usize + 1) {
            Some(next) if t > 0.0 => (1.0 - t) * a + t * next[i],
            _ => a,
        }
    }

    /// The value at or below a place.
    pub fn below(&self, x: f32, i: usize) -> f32 {
        self.values[(x.clamp(0.0, 1.0) * (self.values.len() - 1) as f32).floor() as usize][i]
    }

    /// The same, beyond the ends along the first and the last segment if `extrapolate`.
    pub fn curve(&self, x: f32, i: usize, extrapolate: bool) -> f32 {
        let last = self.values.len() - 1;
        if last == 0 || !extrapolate || (0.0..=1.0).contains(&x) {
            return self.at(x, i);
        }
        let (end, inner, distance) = if x < 0.0 {
            (self.values[0][i], self.values[1][i], -x)
        } else {
            (self.values[last][i], self.values[last - 1][i], x - 1.0)
        };
        end + (end - inner) * distance * last as f32
    }
}
