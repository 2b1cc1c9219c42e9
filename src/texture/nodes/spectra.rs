//! Colours of black bodies and of single wavelengths, as Cycles has them.

use crate::color::spectral::rgb_of_wavelength;

/// Temperatures, kelvin, at which the next of the fits begins.
const BEGINS: [f32; 6] = [965.0, 1167.0, 1449.0, 1902.0, 3315.0, 6365.0];

/// Red: a + b t + c with a over the temperature t (Cycles, Apache License 2.0, as are the next tables).
const RED: [[f32; 3]; 7] = [
    [1.619_191_1e3, -2.050_109_2e-3, 5.029_957_6],
    [2.488_454_7e3, -1.113_309_1e-3, 3.226_215_4],
    [3.341_431_9e3, -4.865_512e-4, 1.764_867_7],
    [4.094_617_4e3, -1.274_465_8e-4, 7.257_316_4e-1],
    [4.670_280_4e3, 2.912_582e-5, 1.267_034_4e-1],
    [4.595_091_9e3, 2.874_956_5e-5, 1.503_450_2e-1],
    [3.787_174_5e3, 9.359_078e-6, 3.990_758_7e-1],
];

/// Green, likewise.
const GREEN: [[f32; 3]; 7] = [
    [-4.889_997_5e2, 6.043_307_5e-4, -7.558_075_3e-2],
    [-7.559_942_8e2, 3.167_301e-4, 4.783_061_4e-1],
    [-1.023_639_8e3, 1.202_234_7e-4, 9.366_623e-1],
    [-1.265_713_2e3, 4.873_409e-6, 1.270_545],
    [-1.425_293_3e3, -4.011_504e-5, 1.439_727_8],
    [-1.175_548_2e3, -2.163_780_5e-5, 1.304_080_2],
    [-5.007_995_7e2, -4.598_320_3e-6, 1.090_987_6],
];

/// Blue: a polynomial, highest power first.
const BLUE: [[f32; 4]; 7] = [
    [5.969_453e-11, -4.857_429e-8, -9.706_222_5e-5, -4.079_361_5e-3],
    [2.404_303_7e-11, 5.550_211e-8, -1.985_037_1e-4, 2.893_128_6e-2],
    [-1.409_497_3e-11, 1.898_789_7e-7, -3.566_328_2e-4, 9.107_678e-2],
    [-3.614_608_7e-11, 2.848_22e-7, -4.932_113_2e-4, 1.567_234_4e-1],
    [-1.970_757_4e-11, 1.753_593_5e-7, -2.505_428_3e-4, -2.227_832_7e-2],
    [-1.619_979_6e-13, -1.642_160_1e-8, 3.862_162_7e-4, -7.380_774_2e-1],
    [6.726_502_8e-13, -2.730_788_1e-8, 4.240_982_6e-4, -7.523_357e-1],
];

/// The colour of a black body, of even luminance.
pub fn black_body(kelvin: f32) -> [f32; 3] {
    if kelvin >= 12_000.0 {
        return [0.826_295_5, 0.994_508_05, 1.566_307_7];
    }
    if kelvin.is_nan() || kelvin < 800.0 {
        return [5.413_294_5, 0.0, 0.0];
    }
    let fit = BEGINS.iter().filter(|begin| kelvin >= **begin).count();
    let of = |[a, b, c]: [f32; 3]| a / kelvin + b * kelvin + c;
    let blue = BLUE[fit].iter().fold(0.0, |sum, factor| sum * kelvin + factor);
    [of(RED[fit]), of(GREEN[fit]), blue].map(|c| c.max(0.0))
}

/// What the brightest wavelengths are divided by.
const BRIGHTEST: f32 = 2.52;

/// The colour of a wavelength.
pub fn wavelength(nanometres: f32) -> [f32; 3] {
    rgb_of_wavelength(nanometres).map(|c| (c / BRIGHTEST).max(0.0))
}
