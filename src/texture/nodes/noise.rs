//! Gradient noise of one to four dimensions (Perlin 2002, "Improving Noise") and its fractal sums (Musgrave in Ebert et al. 2003,
//! "Texturing and Modeling", chapter 16), with the lattice hash and scales of Cycles; and Gabor noise (Lagae et al. 2009, "Procedural
//! Noise using Sparse Gabor Convolution"), with the same number of impulses in each cell and with phases (Tricard et al. 2019,
//! "Procedural Phasor Noise"), as in Cycles.

use super::math::normalize;
use crate::math::{Vec3, poly};
use crate::scene::nodes::NoiseType;
use crate::simd;
use std::f32::consts::{PI, SQRT_2};

// Hashes of lattice cells and floats: the final steps of Jenkins' lookup3 (2006, public domain), and the permuted congruential
// generators pcg2d, pcg3d and pcg4d of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".

/// Maps 32 bits to 0..1.
#[inline(always)]
fn unit(bits: u32) -> f32 {
    bits as f32 * (1.0 / u32::MAX as f32)
}

/// The final mix of lookup3.
#[inline(always)]
fn final_mix(mut a: u32, mut b: u32, mut c: u32) -> u32 {
    c = (c ^ b).wrapping_sub(b.rotate_left(14));
    a = (a ^ c).wrapping_sub(c.rotate_left(11));
    b = (b ^ a).wrapping_sub(a.rotate_left(25));
    c = (c ^ b).wrapping_sub(b.rotate_left(16));
    a = (a ^ c).wrapping_sub(c.rotate_left(4));
    b = (b ^ a).wrapping_sub(a.rotate_left(14));
    (c ^ b).wrapping_sub(b.rotate_left(24))
}

/// Hash of one to four words.
#[inline(always)]
pub fn hash_words<const N: usize>(words: [u32; N]) -> u32 {
    let start = 0xdead_beefu32.wrapping_add((N as u32) << 2).wrapping_add(13);
    let word = |i: usize| if i < N { words[i] } else { 0 };
    let (mut a, mut b, mut c) =
        (start.wrapping_add(word(0)), start.wrapping_add(word(1)), start.wrapping_add(word(2)));
    if N > 3 {
        a = a.wrapping_sub(c) ^ c.rotate_left(4);
        c = c.wrapping_add(b);
        b = b.wrapping_sub(a) ^ a.rotate_left(6);
        a = a.wrapping_add(c);
        c = c.wrapping_sub(b) ^ b.rotate_left(8);
        b = b.wrapping_add(a);
        a = a.wrapping_sub(c) ^ c.rotate_left(16);
        c = c.wrapping_add(b);
        b = b.wrapping_sub(a) ^ a.rotate_left(19);
        a = a.wrapping_add(c);
        c = c.wrapping_sub(b) ^ b.rotate_left(4);
        b = b.wrapping_add(a);
        a = a.wrapping_add(word(3));
    }
    final_mix(a, b, c)
}

/// A random number in 0..1 from the bits of one to four floats.
#[inline(always)]
pub fn hash_floats<const N: usize>(k: [f32; N]) -> f32 {
    unit(hash_words(k.map(f32::to_bits)))
}

/// Three random numbers in 0..1 from one to four floats.
#[inline(always)]
pub fn hash_to_vector(k: &[f32]) -> [f32; 3] {
    match *k {
        [x] => [hash_floats([x]), hash_floats([x, 1.0]), hash_floats([x, 2.0])],
        [x, y] => [hash_floats([x, y]), hash_floats([x, y, 1.0]), hash_floats([x, y, 2.0])],
        [x, y, z] => [hash_floats([x, y, z]), hash_floats([x, y, z, 1.0]), hash_floats([x, y, z, 2.0])],
        [x, y, z, w] => [hash_floats([x, y, z, w]), hash_floats([z, x, w, y]), hash_floats([w, z, y, x])],
        _ => [0.0; 3],
    }
}

/// A cell's random numbers in 0..1: `pcg2d`, `pcg3d` or `pcg4d` on signed integers, with arithmetic shifts. Free of branches and calls,
/// so that loops over cells vectorise.
#[inline(always)]
pub fn hash_cell<const N: usize>(cell: [i32; N]) -> [f32; N] {
    let mut v = cell;
    for c in &mut v {
        *c = c.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    }
    add_products(&mut v);
    for c in &mut v {
        *c ^= *c >> 16;
    }
    add_products(&mut v);
    let mut unit = [0.0; N];
    for i in 0..N {
        unit[i] = (v[i] & 0x7fff_ffff) as f32 * (1.0 / 0x7fff_ffff as f32);
    }
    unit
}

/// The mixing step of the pcg hashes: adds products of components to others, in turn.
#[inline(always)]
fn add_products<const N: usize>(v: &mut [i32; N]) {
    match N {
        2 => {
            v[0] = v[0].wrapping_add(v[1 % N].wrapping_mul(1_664_525));
            v[1 % N] = v[1 % N].wrapping_add(v[0].wrapping_mul(1_664_525));
        }
        3 => {
            v[0] = v[0].wrapping_add(v[1 % N].wrapping_mul(v[2 % N]));
            v[1 % N] = v[1 % N].wrapping_add(v[2 % N].wrapping_mul(v[0]));
            v[2 % N] = v[2 % N].wrapping_add(v[0].wrapping_mul(v[1 % N]));
        }
        _ => {
            v[0] = v[0].wrapping_add(v[1 % N].wrapping_mul(v[3 % N]));
            v[1 % N] = v[1 % N].wrapping_add(v[2 % N].wrapping_mul(v[0]));
            v[2 % N] = v[2 % N].wrapping_add(v[0].wrapping_mul(v[1 % N]));
            v[3 % N] = v[3 % N].wrapping_add(v[1 % N].wrapping_mul(v[2 % N]));
        }
    }
}

/// A cell's random colour.
#[inline(always)]
pub fn cell_color<const N: usize>(cell: [i32; N]) -> [f32; 3] {
    match N {
        1 => hash_to_vector(&[cell[0] as f32]),
        2 => hash_cell([cell[0], cell[1], 0]),
        3 => hash_cell([cell[0], cell[1], cell[2 % N]]),
        _ => {
            let [x, y, z, _] = hash_cell([cell[0], cell[1 % N], cell[2 % N], cell[3 % N]]);
            [x, y, z]
        }
    }
}

/// A cell's random point in the unit cube.
#[inline(always)]
pub fn cell_point<const N: usize>(cell: [i32; N]) -> [f32; N] {
    if N == 1 { [hash_floats([cell[0] as f32]); N] } else { hash_cell(cell) }
}

// Gradient noise.

/// Coordinates wrap around at this period, which keeps fractional bits in single precision.
const WRAP_PERIOD: f32 = 100_000.0;

#[inline(always)]
fn negate_if(x: f32, condition: bool) -> f32 {
    if condition { -x } else { x }
}

/// Dot product of the offset from a lattice point with the gradient there.
#[inline(always)]
fn lattice_gradient<const N: usize>(hash: u32, d: [f32; N]) -> f32 {
    let at = |i: usize| d[i % N];
    let (x, y, z, w) = (at(0), at(1), at(2), at(3));
    match N {
        1 => {
            let slope = (1 + (hash & 7)) as f32;
            negate_if(slope, hash & 8 != 0) * x
        }
        2 => {
            let first = hash & 4 == 0;
            let (u, v) = if first { (x, y) } else { (y, x) };
            negate_if(u, hash & 1 != 0) + negate_if(2.0 * v, hash & 2 != 0)
        }
        3 => {
            let h = hash & 15;
            let u = if h < 8 { x } else { y };
            let v = if h < 4 {
                y
            } else if h == 12 || h == 14 {
                x
            } else {
                z
            };
            negate_if(u, h & 1 != 0) + negate_if(v, h & 2 != 0)
        }
        _ => {
            let h = hash & 31;
            let u = if h < 24 { x } else { y };
            let v = if h < 16 { y } else { z };
            let s = if h < 8 { z } else { w };
            negate_if(u, h & 1 != 0) + negate_if(v, h & 2 != 0) + negate_if(s, h & 4 != 0)
        }
    }
}

/// Maximum number of corners of a cell.
const CORNERS: usize = 16;

/// Maximum number of octaves of a fractal sum.
const MAX_OCTAVES: usize = 16;

/// SIMD lanes of a batch of points.
const BATCH: usize = 16;

/// Gradient noise, about -1..1, at points given by coordinate. SIMD lanes are points, or the corners of a cell for few points.
struct GradientNoise<'a, const N: usize> {
    points: [&'a [f32]; N],
    values: &'a mut [f32],
}

impl<const N: usize> simd::Kernel for GradientNoise<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (count, mut first) = (self.values.len(), 0);
        while first < count {
            let rest = count - first;
            if 4 * rest < 3 << N {
                let mut p = [0.0; N];
                for (x, coordinates) in p.iter_mut().zip(&self.points) {
                    *x = coordinates[first];
                }
                self.values[first] = at_point(p);
                first += 1;
            } else if rest <= BATCH / 2 {
                at_points::<N, { BATCH / 2 }>(&self.points, first, &mut self.values[first..]);
                first = count;
            } else {
                let end = if rest < BATCH { count } else { first + BATCH };
                at_points::<N, BATCH>(&self.points, first, &mut self.values[first..end]);
                first = end;
            }
        }
    }
}

/// Points at which noise is evaluated together, by coordinate, and the noise there.
#[derive(Debug, Default)]
pub struct NoisePoints {
    coordinates: [Vec<f32>; 4],
    noises: Vec<f32>,
}

impl NoisePoints {
    fn clear(&mut self) {
        for list in &mut self.coordinates {
            list.clear();
        }
    }

    fn push<const N: usize>(&mut self, p: [f32; N]) {
        for (list, x) in self.coordinates.iter_mut().zip(p) {
            list.push(x);
        }
    }

    /// The noise at all points, in the order of their addition.
    fn evaluate<const N: usize>(&mut self) -> &[f32] {
        let count = self.coordinates[0].len();
        if self.noises.len() < count {
            self.noises.resize(count, 0.0);
        }
        let points = std::array::from_fn(|i| &self.coordinates[i][..]);
        simd::dispatch(GradientNoise::<N> { points, values: &mut self.noises[..count] });
        &self.noises[..count]
    }
}

/// A coordinate wrapped into the period.
#[inline(always)]
fn wrapped(x: f32) -> f32 {
    if x.abs() < MAX_WRAPPED {
        return wrapped_below_max(x);
    }
    // Coordinates this large lie on lattice points, where the noise is 0: shift them by half a cell.
    x % WRAP_PERIOD + 0.5
}

/// Magnitude below which remainders are computed by a division.
const MAX_WRAPPED: f32 = 1e12;

/// [`wrapped`] for coordinates below [`MAX_WRAPPED`], free of branches and calls.
#[inline(always)]
fn wrapped_below_max(x: f32) -> f32 {
    // The same remainder as by `%`, exact in double precision, without a call.
    let wide = f64::from(x);
    let periods = (wide / f64::from(WRAP_PERIOD)).trunc();
    let rest = (wide - periods * f64::from(WRAP_PERIOD)) as f32;
    let rest = rest + if x.abs() >= 1_000_000.0 { 0.5 } else { 0.0 };
    if x.abs() < WRAP_PERIOD { x } else { rest }
}

/// Wraps coordinates into the period; those of most points are within it.
#[inline(always)]
fn wrap_all<const LANES: usize>(coordinates: &mut [f32; LANES]) {
    let (mut are_within, mut are_below_max) = (true, true);
    for x in coordinates.iter() {
        are_within &= x.abs() < WRAP_PERIOD;
        are_below_max &= x.abs() < MAX_WRAPPED;
    }
    if are_within {
        return;
    }
    if are_below_max {
        for x in coordinates.iter_mut() {
            *x = wrapped_below_max(*x);
        }
    } else {
        for x in coordinates.iter_mut() {
            *x = wrapped(*x);
        }
    }
}

/// A whole number of magnitude below 2^22 as an integer. A saturating conversion does not vectorise.
#[inline(always)]
fn to_integer(whole: f32) -> u32 {
    // Adding 1.5 * 2^23 moves the number to the lowest bits of the mantissa.
    const SHIFT: f32 = 12_582_912.0;
    (whole + SHIFT).to_bits().wrapping_sub(SHIFT.to_bits())
}

/// Quintic interpolation weight between corners.
#[inline(always)]
fn fade(x: f32) -> f32 {
    x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
}

/// Scales noise in N dimensions to about -1..1, and replaces NaN and infinity by 0.
#[inline(always)]
fn scaled<const N: usize>(value: f32) -> f32 {
    let value = value * [0.25, 0.6616, 0.982, 0.8344][N - 1];
    if value.is_finite() { value } else { 0.0 }
}

/// Gradient noise at a point. Loops over the corners of the cell have no branches, so that they vectorise.
#[inline(always)]
fn at_point<const N: usize>(p: [f32; N]) -> f32 {
    let (mut cell, mut inside) = ([0u32; N], [0.0f32; N]);
    for i in 0..N {
        let x = wrapped(p[i]);
        let floor = x.floor();
        cell[i] = to_integer(floor);
        inside[i] = x - floor;
    }
    let mut corners = [0.0f32; CORNERS];
    for corner in 0..1 << N {
        let (mut words, mut offset) = ([0u32; N], [0.0; N]);
        for i in 0..N {
            let bit = (corner >> i & 1) as u32;
            words[i] = cell[i].wrapping_add(bit);
            offset[i] = inside[i] - bit as f32;
        }
        corners[corner as usize] = lattice_gradient(hash_words(words), offset);
    }
    for (i, &x) in inside.iter().enumerate() {
        let t = fade(x);
        for k in 0..1 << (N - 1 - i) {
            corners[k] = (1.0 - t) * corners[2 * k] + t * corners[2 * k + 1];
        }
    }
    scaled::<N>(corners[0])
}

/// Gradient noise at up to `LANES` points from `first` on. Loops over the points have no branches, so that they vectorise.
#[inline(always)]
fn at_points<const N: usize, const LANES: usize>(points: &[&[f32]; N], first: usize, values: &mut [f32]) {
    let count = values.len();
    let (mut cell, mut inside) = ([[0u32; LANES]; N], [[0.0f32; LANES]; N]);
    for i in 0..N {
        inside[i][..count].copy_from_slice(&points[i][first..first + count]);
        wrap_all(&mut inside[i]);
        for lane in 0..LANES {
            let floor = inside[i][lane].floor();
            cell[i][lane] = to_integer(floor);
            inside[i][lane] -= floor;
        }
    }
    let mut corners = [[0.0f32; LANES]; CORNERS];
    for (corner, values) in corners.iter_mut().enumerate().take(1 << N) {
        for lane in 0..LANES {
            let (mut words, mut offset) = ([0u32; N], [0.0; N]);
            for i in 0..N {
                let bit = (corner >> i & 1) as u32;
                words[i] = cell[i][lane].wrapping_add(bit);
                offset[i] = inside[i][lane] - bit as f32;
            }
            values[lane] = lattice_gradient(hash_words(words), offset);
        }
    }
    for (i, inside) in inside.iter().enumerate() {
        for k in 0..1 << (N - 1 - i) {
            for lane in 0..LANES {
                let t = fade(inside[lane]);
                corners[k][lane] = (1.0 - t) * corners[2 * k][lane] + t * corners[2 * k + 1][lane];
            }
        }
    }
    let mut scaled_values = [0.0; LANES];
    for lane in 0..LANES {
        scaled_values[lane] = scaled::<N>(corners[0][lane]);
    }
    values.copy_from_slice(&scaled_values[..count]);
}

/// Parameters of a fractal sum.
#[derive(Clone, Copy, Debug)]
pub struct Fractal {
    pub noise_type: NoiseType,
    pub normalize: bool,
    /// Number of octaves after the first; a fraction is the weight of the last one.
    pub detail: f32,
    pub roughness: f32,
    pub lacunarity: f32,
    pub offset: f32,
    pub gain: f32,
}

impl Fractal {
    /// The sum at a point.
    pub fn evaluate<const N: usize>(&self, p: [f32; N], points: &mut NoisePoints) -> f32 {
        points.clear();
        self.push_octaves(p, points);
        self.sum(points.evaluate::<N>())
    }

    /// The sum, given the noise of each octave.
    fn sum(&self, noises: &[f32]) -> f32 {
        match self.noise_type {
            NoiseType::Fbm => self.fbm(noises),
            NoiseType::Multifractal => self.multifractal(noises),
            NoiseType::Ridged => self.ridged(noises),
            NoiseType::Hybrid => self.hybrid(noises),
            NoiseType::HeteroTerrain => self.hetero_terrain(noises),
        }
    }

    /// Number of whole octaves after the first, and the weight of one more.
    fn octaves(&self) -> (usize, f32) {
        let detail = self.detail.min((MAX_OCTAVES - 1) as f32);
        let whole = detail.floor();
        (whole as usize, detail - whole)
    }

    /// Number of octaves, including the last, fractional one.
    fn octave_count(&self) -> usize {
        let (octaves, rest) = self.octaves();
        1 + octaves + usize::from(rest != 0.0)
    }

    /// Adds the points at which the octaves of a sum evaluate noise.
    fn push_octaves<const N: usize>(&self, mut p: [f32; N], points: &mut NoisePoints) {
        let mut scale = 1.0;
        for _ in 0..self.octave_count() {
            // Rounded as in Cycles, where this differs between types of sums.
            if self.noise_type == NoiseType::Fbm {
                points.push(p.map(|x| x * scale));
                scale *= self.lacunarity;
            } else {
                points.push(p);
                p = p.map(|x| x * self.lacunarity);
            }
        }
    }

    fn fbm(&self, noises: &[f32]) -> f32 {
        let (octaves, rest) = self.octaves();
        let (mut amplitude, mut total, mut sum) = (1.0, 0.0, 0.0);
        for noise in &noises[..=octaves] {
            sum += noise * amplitude;
            total += amplitude;
            amplitude *= self.roughness;
        }
        let normalized = |sum: f32, total: f32| if self.normalize { 0.5 * sum / total + 0.5 } else { sum };
        if rest == 0.0 {
            return normalized(sum, total);
        }
        let more = sum + noises[octaves + 1] * amplitude;
        let (low, high) = (normalized(sum, total), normalized(more, total + amplitude));
        (1.0 - rest) * low + rest * high
    }

    fn multifractal(&self, noises: &[f32]) -> f32 {
        let (octaves, rest) = self.octaves();
        let (mut value, mut power) = (1.0, 1.0);
        for noise in &noises[..=octaves] {
            value *= power * noise + 1.0;
            power *= self.roughness;
        }
        if rest != 0.0 { value * (rest * power * noises[octaves + 1] + 1.0) } else { value }
    }

    fn hetero_terrain(&self, noises: &[f32]) -> f32 {
        let (octaves, rest) = self.octaves();
        let mut power = self.roughness;
        let mut value = self.offset + noises[0];
        for noise in &noises[1..=octaves] {
            value += (noise + self.offset) * power * value;
            power *= self.roughness;
        }
        if rest != 0.0 { value + rest * (noises[octaves + 1] + self.offset) * power * value } else { value }
    }

    fn hybrid(&self, noises: &[f32]) -> f32 {
        const MIN_WEIGHT: f32 = 0.001;
        let (octaves, rest) = self.octaves();
        let (mut power, mut value, mut weight) = (1.0, 0.0, 1.0f32);
        for noise in &noises[..=octaves] {
            if weight <= MIN_WEIGHT {
                break;
            }
            weight = weight.min(1.0);
            let signal = (noise + self.offset) * power;
            power *= self.roughness;
            value += weight * signal;
            weight *= self.gain * signal;
        }
        if rest != 0.0 && weight > MIN_WEIGHT {
            value += rest * weight.min(1.0) * (noises[octaves + 1] + self.offset) * power;
        }
        value
    }

    fn ridged(&self, noises: &[f32]) -> f32 {
        let (octaves, _) = self.octaves();
        let ridge = |noise: f32| {
            let signal = self.offset - noise.abs();
            signal * signal
        };
        let mut signal = ridge(noises[0]);
        let (mut value, mut power) = (signal, self.roughness);
        for &noise in &noises[1..=octaves] {
            let weight = (signal * self.gain).clamp(0.0, 1.0);
            signal = ridge(noise) * weight;
            value += signal * power;
            power *= self.roughness;
        }
        value
    }
}

/// A random offset by which noise is decorrelated.
#[inline(always)]
fn offset<const N: usize>(seed: f32) -> [f32; N] {
    let mut offset = [0.0; N];
    for (i, x) in offset.iter_mut().enumerate() {
        *x = 100.0 + 100.0 * if N == 1 { hash_floats([seed]) } else { hash_floats([seed, i as f32]) };
    }
    offset
}

fn add<const N: usize>(a: [f32; N], b: [f32; N]) -> [f32; N] {
    std::array::from_fn(|i| a[i] + b[i])
}

/// The noise texture at a scaled point.
#[derive(Clone, Copy, Debug)]
pub struct NoiseTexture<const N: usize> {
    /// Scaled texture coordinates.
    pub p: [f32; N],
    /// Factor on the noise that is added to the coordinates.
    pub distortion: f32,
    pub fractal: Fractal,
}

/// Value and colour of noise textures at several points; the colour equals the value unless `has_color`. The noise of all points and octaves
/// is evaluated together.
pub fn noise_textures<const N: usize>(
    textures: &mut [NoiseTexture<N>],
    has_color: bool,
    points: &mut NoisePoints,
    results: &mut [[f32; 4]],
) {
    distort(textures, points);
    points.clear();
    let channels = if has_color { 3 } else { 1 };
    for texture in textures.iter() {
        texture.fractal.push_octaves(texture.p, points);
        for channel in 1..channels {
            texture.fractal.push_octaves(add(texture.p, offset((N + channel - 1) as f32)), points);
        }
    }
    let mut noises = points.evaluate::<N>();
    for (texture, result) in textures.iter().zip(results) {
        let count = texture.fractal.octave_count();
        let sums = std::array::from_fn::<f32, 3, _>(|channel| match channel < channels {
            true => texture.fractal.sum(&noises[channel * count..]),
            false => 0.0,
        });
        noises = &noises[channels * count..];
        *result = if has_color { [sums[0], sums[0], sums[1], sums[2]] } else { [sums[0]; 4] };
    }
}

/// Adds noise to the coordinates of textures with distortion.
fn distort<const N: usize>(textures: &mut [NoiseTexture<N>], points: &mut NoisePoints) {
    points.clear();
    let distorted = || |texture: &&mut NoiseTexture<N>| texture.distortion != 0.0;
    for texture in textures.iter_mut().filter(distorted()) {
        for i in 0..N {
            points.push(add(texture.p, offset(i as f32)));
        }
    }
    let noises = points.evaluate::<N>();
    for (texture, noises) in textures.iter_mut().filter(distorted()).zip(noises.chunks_exact(N)) {
        texture.p = add(texture.p, std::array::from_fn(|i| noises[i] * texture.distortion));
    }
}

// Gabor noise.

/// Number of impulses in each cell.
const IMPULSES: u32 = 8;

/// The noise is divided by this number of its standard deviations.
const MAX_DEVIATIONS: f32 = 6.0;

/// Gabor noise in two dimensions: value and phase, 0..1, and intensity. `frequency` is in cycles per cell; waves run along `angle_rad`, in
/// random directions if `isotropy` is 1.
pub fn gabor_2d(p: [f32; 2], frequency: f32, isotropy: f32, angle_rad: f32) -> [f32; 3] {
    let cell = p.map(f32::floor);
    let mut sum = [0.0; 2];
    for (i, j) in (0..9).map(|k| (k % 3 - 1, k / 3 - 1)) {
        let [x, y] = [cell[0] + i as f32, cell[1] + j as f32];
        for impulse in (0..IMPULSES).map(|n| 3.0 * n as f32) {
            let rotation_rad = (hash_floats([x, y, impulse]) - 0.5) * PI * isotropy;
            let seed = impulse + 1.0;
            let offset_from_impulse =
                [p[0] - x - hash_floats([x, y, seed]), p[1] - y - hash_floats([seed, x, y])];
            let squared = offset_from_impulse[0] * offset_from_impulse[0]
                + offset_from_impulse[1] * offset_from_impulse[1];
            if squared < 1.0 {
                let (sine, cosine) = poly::sin_cos(angle_rad + rotation_rad);
                let cycles = frequency * (offset_from_impulse[0] * cosine + offset_from_impulse[1] * sine);
                add_impulse(&mut sum, squared, cycles, hash_floats([x, y, impulse + 2.0]));
            }
        }
    }
    outputs(sum, 0.25)
}

/// Gabor noise in three dimensions, of waves along a direction.
pub fn gabor_3d(p: [f32; 3], frequency: f32, isotropy: f32, direction: [f32; 3]) -> [f32; 3] {
    let cell = p.map(f32::floor);
    let direction = Vec3::from_array(normalize(direction));
    let mut sum = [0.0; 2];
    for k in 0..27 {
        let [x, y, z] =
            [cell[0] + (k % 3 - 1) as f32, cell[1] + (k / 3 % 3 - 1) as f32, cell[2] + (k / 9 - 1) as f32];
        for impulse in (0..IMPULSES).map(|n| 3.0 * n as f32) {
            let offset_from_impulse = Vec3::from_array(p)
                - Vec3::new(x, y, z)
                - Vec3::from_array(hash_to_vector(&[x, y, z, impulse + 1.0]));
            let squared = offset_from_impulse.length_squared();
            if squared < 1.0 {
                let along = rotated_direction(direction, isotropy, [x, y, z, impulse]);
                add_impulse(
                    &mut sum,
                    squared,
                    frequency * offset_from_impulse.dot(along),
                    hash_floats([x, y, z, impulse + 2.0]),
                );
            }
        }
    }
    outputs(sum, 0.25 / SQRT_2)
}

/// Adds an impulse of random sign at a squared distance, with a phase in cycles.
fn add_impulse(sum: &mut [f32; 2], squared: f32, cycles: f32, random: f32) {
    let window = 0.5 + 0.5 * poly::sin_cos(PI * squared).1;
    let weight = poly::exp(-PI * squared) * window * if random < 0.5 { -1.0 } else { 1.0 };
    let (sine, cosine) = poly::sin_cos_turns(cycles);
    sum[0] += weight * cosine;
    sum[1] += weight * sine;
}

/// A direction rotated at random, by angles proportional to `isotropy`.
fn rotated_direction(direction: Vec3, isotropy: f32, seed: [f32; 4]) -> Vec3 {
    if isotropy == 0.0 {
        return direction;
    }
    let level = (direction.x * direction.x + direction.y * direction.y).sqrt();
    let side = if direction.y < 0.0 { -1.0 } else { 1.0 };
    let azimuth = if level > 0.0 { side * poly::acos((direction.x / level).clamp(-1.0, 1.0)) } else { 0.0 };
    let [first, second, _] = hash_to_vector(&seed);
    let (sine, cosine) = poly::sin_cos(poly::acos(direction.z.clamp(-1.0, 1.0)) + first * PI * isotropy);
    let (y, x) = poly::sin_cos(azimuth + second * PI * isotropy);
    Vec3::new(sine * x, sine * y, cosine)
}

/// Value, phase and intensity; `integral` is the integral of the squared kernel.
fn outputs([x, y]: [f32; 2], integral: f32) -> [f32; 3] {
    let scale = 1.0 / (MAX_DEVIATIONS * (IMPULSES as f32 * 0.5 * integral).sqrt());
    [0.5 * y * scale + 0.5, (poly::atan2(y, x) + PI) / (2.0 * PI), (x * x + y * y).sqrt() * scale]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;

    #[test]
    fn wrapped_coordinates_equal_those_by_the_remainder_operator() {
        let mut random = Random::new(31);
        for _ in 0..100_000 {
            let x = (random.next() - 0.5) * 10f32.powf(30.0 * random.next());
            let whole = if x.abs() < WRAP_PERIOD { x } else { x % WRAP_PERIOD };
            let half = if x.abs() >= 1_000_000.0 { 0.5 } else { 0.0 };
            assert_eq!(wrapped(x), whole + half, "{x}");
        }
        for x in [1e5, -1e5, 3e5, 123_400_000.0, -9.99e11, 1.0e12] {
            assert_eq!(wrapped(x), x % WRAP_PERIOD + if x.abs() >= 1e6 { 0.5 } else { 0.0 });
        }
        assert!(wrapped(f32::INFINITY).is_nan());
        for whole in [0.0, -1.0, 7.0, WRAP_PERIOD, -WRAP_PERIOD - 1.0, 4_194_303.0, -4_194_304.0] {
            assert_eq!(to_integer(whole) as i32, whole as i32);
        }
    }

    /// Noise at several points is bit-identical to noise at each.
    fn batches_agree<const N: usize>() {
        let mut random = Random::new(7);
        let mut points = NoisePoints::default();
        for count in 1..=3 * BATCH {
            points.clear();
            let list: Vec<[f32; N]> = (0..count)
                .map(|k| [(); N].map(|()| (random.next() - 0.5) * 4f32.powi(k as i32 % 24)))
                .collect();
            list.iter().for_each(|&p| points.push(p));
            for (&p, value) in list.iter().zip(points.evaluate::<N>()) {
                assert_eq!(at_point(p).to_bits(), value.to_bits(), "{p:?}");
            }
        }
    }

    #[test]
    fn batches_equal_single_points() {
        batches_agree::<1>();
        batches_agree::<2>();
        batches_agree::<3>();
        batches_agree::<4>();
    }
}
