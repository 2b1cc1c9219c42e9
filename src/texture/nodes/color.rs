//! Functions of colour nodes as in Cycles: colour models, blend modes, adjustments, curves, black bodies, wavelengths.

use crate::color::spectral::rgb_of_wavelength;
use crate::math::poly;
use crate::scene::nodes::{BlendMode, ColorModel};

type Color = [f32; 3];

/// RGB to hue (0..1), saturation, value.
pub fn to_hsv([r, g, b]: Color) -> Color {
    let (maximum, minimum) = (r.max(g).max(b), r.min(g).min(b));
    let range = maximum - minimum;
    if maximum == 0.0 || range == 0.0 {
        return [0.0, 0.0, maximum];
    }
    let [cr, cg, cb] = [r, g, b].map(|c| (maximum - c) / range);
    let sextant = if r == maximum {
        cb - cg
    } else if g == maximum {
        2.0 + cr - cb
    } else {
        4.0 + cg - cr
    };
    let hue = sextant / 6.0;
    [if hue < 0.0 { hue + 1.0 } else { hue }, range / maximum, maximum]
}

/// Hue (0..1), saturation, value to RGB.
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

/// RGB to hue (0..1), saturation, lightness.
pub fn to_hsl([r, g, b]: Color) -> Color {
    let (maximum, minimum) = (r.max(g).max(b), r.min(g).min(b));
    let lightness = ((maximum + minimum) / 2.0).min(1.0);
    if maximum == minimum {
        return [0.0, 0.0, lightness];
    }
    let range = maximum - minimum;
    let saturation =
        if lightness > 0.5 { range / (2.0 - maximum - minimum) } else { range / (maximum + minimum) };
    let sextant = if maximum == r {
        (g - b) / range + if g < b { 6.0 } else { 0.0 }
    } else if maximum == g {
        (b - r) / range + 2.0
    } else {
        (r - g) / range + 4.0
    };
    [sextant / 6.0, saturation, lightness]
}

/// Hue (0..1), saturation, lightness to RGB.
pub fn from_hsl([h, s, l]: Color) -> Color {
    let [r, g, b] = [(h * 6.0 - 3.0).abs() - 1.0, 2.0 - (h * 6.0 - 2.0).abs(), 2.0 - (h * 6.0 - 4.0).abs()]
        .map(|c| c.clamp(0.0, 1.0));
    let chroma = (1.0 - (2.0 * l - 1.0).abs()) * s;
    [r, g, b].map(|c| (c - 0.5) * chroma + l)
}

/// RGB to the components of a colour model.
pub fn separate(model: ColorModel, color: Color) -> Color {
    match model {
        ColorModel::Rgb => color,
        ColorModel::Hsv => to_hsv(color),
        ColorModel::Hsl => to_hsl(color),
    }
}

/// Components of a colour model to RGB.
pub fn combine(model: ColorModel, components: Color) -> Color {
    match model {
        ColorModel::Rgb => components,
        ColorModel::Hsv => from_hsv(components),
        ColorModel::Hsl => from_hsl(components),
    }
}

/// Blends colour `b` over `a` with factor `t`.
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
    let mix = |x: f32, y: f32| (1.0 - t) * x + t * y;
    let towards = |c: Color| std::array::from_fn(|i| mix(a[i], c[i]));
    match mode {
        BlendMode::Hue if sb != 0.0 => towards(from_hsv([hb, sa, va])),
        BlendMode::Saturation if sa != 0.0 => from_hsv([ha, mix(sa, sb), va]),
        BlendMode::Color if sb != 0.0 => towards(from_hsv([hb, sb, va])),
        BlendMode::Value => from_hsv([ha, sa, mix(va, vb)]),
        _ => a,
    }
}

/// The hue/saturation/value node: shifts the hue by `hue` - 0.5, and scales saturation and value.
pub fn adjust([hue, saturation, value]: [f32; 3], factor: f32, color: Color) -> Color {
    let [h, s, v] = to_hsv(color);
    let h = h + hue + 0.5;
    let adjusted = from_hsv([h - h.floor(), (s * saturation).clamp(0.0, 1.0), v * value]);
    std::array::from_fn(|i| (factor * adjusted[i] + (1.0 - factor) * color[i]).max(0.0))
}

/// The gamma node for one component.
pub fn gamma(c: f32, exponent: f32) -> f32 {
    if c > 0.0 { poly::exp(exponent * poly::ln(c)) } else { c }
}

/// Evenly spaced samples of `N` functions.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<const N: usize> {
    /// Samples, at least one.
    pub values: Vec<[f32; N]>,
}

impl<const N: usize> Table<N> {
    /// Component `i` at `x`, clamped to 0..1 of the table's range, interpolated linearly.
    pub fn at(&self, x: f32, i: usize) -> f32 {
        let position = x.clamp(0.0, 1.0) * (self.values.len() - 1) as f32;
        let below = position.floor();
        let t = position - below;
        let a = self.values[below as usize][i];
        match self.values.get(below as usize + 1) {
            Some(next) if t > 0.0 => (1.0 - t) * a + t * next[i],
            _ => a,
        }
    }

    /// Component `i` of the last sample at or below `x`.
    pub fn below(&self, x: f32, i: usize) -> f32 {
        self.values[(x.clamp(0.0, 1.0) * (self.values.len() - 1) as f32).floor() as usize][i]
    }

    /// As [`Table::at`], but extrapolated linearly outside 0..1 if `extrapolate`.
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

/// Temperatures at which the second and later fits start, kelvin.
const FIT_STARTS: [f32; 6] = [965.0, 1167.0, 1449.0, 1902.0, 3315.0, 6365.0];

/// Red by fit: coefficients of a / t + b t + c at temperature t (this and the next tables: Cycles, Apache License 2.0).
const RED: [[f32; 3]; 7] = [
    [1.619_191_1e3, -2.050_109_2e-3, 5.029_957_6],
    [2.488_454_7e3, -1.113_309_1e-3, 3.226_215_4],
    [3.341_431_9e3, -4.865_512e-4, 1.764_867_7],
    [4.094_617_4e3, -1.274_465_8e-4, 7.257_316_4e-1],
    [4.670_280_4e3, 2.912_582e-5, 1.267_034_4e-1],
    [4.595_091_9e3, 2.874_956_5e-5, 1.503_450_2e-1],
    [3.787_174_5e3, 9.359_078e-6, 3.990_758_7e-1],
];

/// Green by fit, as red.
const GREEN: [[f32; 3]; 7] = [
    [-4.889_997_5e2, 6.043_307_5e-4, -7.558_075_3e-2],
    [-7.559_942_8e2, 3.167_301e-4, 4.783_061_4e-1],
    [-1.023_639_8e3, 1.202_234_7e-4, 9.366_623e-1],
    [-1.265_713_2e3, 4.873_409e-6, 1.270_545],
    [-1.425_293_3e3, -4.011_504e-5, 1.439_727_8],
    [-1.175_548_2e3, -2.163_780_5e-5, 1.304_080_2],
    [-5.007_995_7e2, -4.598_320_3e-6, 1.090_987_6],
];

/// Blue by fit: coefficients of a cubic polynomial, highest power first.
const BLUE: [[f32; 4]; 7] = [
    [5.969_453e-11, -4.857_429e-8, -9.706_222_5e-5, -4.079_361_5e-3],
    [2.404_303_7e-11, 5.550_211e-8, -1.985_037_1e-4, 2.893_128_6e-2],
    [-1.409_497_3e-11, 1.898_789_7e-7, -3.566_328_2e-4, 9.107_678e-2],
    [-3.614_608_7e-11, 2.848_22e-7, -4.932_113_2e-4, 1.567_234_4e-1],
    [-1.970_757_4e-11, 1.753_593_5e-7, -2.505_428_3e-4, -2.227_832_7e-2],
    [-1.619_979_6e-13, -1.642_160_1e-8, 3.862_162_7e-4, -7.380_774_2e-1],
    [6.726_502_8e-13, -2.730_788_1e-8, 4.240_982_6e-4, -7.523_357e-1],
];

/// Linear RGB of a black body, normalized to luminance 1.
pub fn black_body(kelvin: f32) -> [f32; 3] {
    if kelvin >= 12_000.0 {
        return [0.826_295_5, 0.994_508_05, 1.566_307_7];
    }
    if kelvin.is_nan() || kelvin < 800.0 {
        return [5.413_294_5, 0.0, 0.0];
    }
    let fit = FIT_STARTS.iter().filter(|start| kelvin >= **start).count();
    let of = |[a, b, c]: [f32; 3]| a / kelvin + b * kelvin + c;
    let blue = BLUE[fit].iter().fold(0.0, |sum, factor| sum * kelvin + factor);
    [of(RED[fit]), of(GREEN[fit]), blue].map(|c| c.max(0.0))
}

/// Divisor that normalizes the brightest wavelengths.
const BRIGHTEST: f32 = 2.52;

/// Linear RGB of a wavelength, clipped to the gamut.
pub fn wavelength(nanometres: f32) -> [f32; 3] {
    rgb_of_wavelength(nanometres).map(|c| (c / BRIGHTEST).max(0.0))
}
