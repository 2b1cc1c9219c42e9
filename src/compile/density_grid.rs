//! Density grids for delta tracking and ratio tracking, with a majorant per block of voxels.
//!
//! Delta tracking (Woodcock et al. 1965; with a grid of majorants Szirmay-Kalos et al. 2011, "Free path sampling in high
//! resolution inhomogeneous participating media"): tentative collisions are sampled with the majorant, and a collision is real
//! with the probability density / majorant. Ratio tracking (Novak et al. 2014, "Residual ratio tracking for estimating
//! attenuation in participating media", section 3.1): the transmittance is the product of the probabilities of null collisions.

use crate::color::spectral::{Curve, SECOND_RADIATION_CONSTANT, Spectrum, Wavelengths, rgb_of};
use crate::color::{Rgb, luminance};
use crate::math::{DVec3, Mat3, Vec3, poly};
use crate::sampling::hash::{hash32, unit};
use crate::scene;
use crate::scene::{Grid, GridId};
use std::ops::{Add, Mul};
use std::sync::Arc;

/// Edge length of a block, voxels.
const BLOCK: u32 = 8;

/// A compiled grid of densities.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityGrid {
    size: [u32; 3],
    values: Arc<Vec<f32>>,
    /// Voxel coordinates are `voxels_from_world * (p - corner)`.
    corner: Vec3,
    voxels_from_world: Mat3,
    /// Majorant of each block: an upper bound of interpolated values.
    majorants: Vec<f32>,
    blocks: [u32; 3],
}

/// A ray in voxel coordinates, with the parameter of the world-space ray.
#[derive(Clone, Copy, Debug)]
pub struct GridRay {
    origin: Vec3,
    direction: Vec3,
    /// Extinction per unit of density and of the ray parameter.
    scale: f32,
}

impl GridRay {
    /// A point of the ray, voxel coordinates.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

impl DensityGrid {
    /// Compiles a grid; world space is relative to `anchor`.
    pub(super) fn new(grid: &Grid, anchor: DVec3) -> DensityGrid {
        let size = grid.size;
        let blocks = size.map(|n| n.div_ceil(BLOCK));
        let mut prepared = DensityGrid {
            size,
            values: grid.values.clone(),
            corner: (grid.world_from_voxels.translation - anchor).as_vec3(),
            voxels_from_world: grid.world_from_voxels.matrix3.inverse().as_mat3(),
            majorants: Vec::new(),
            blocks,
        };
        for z in 0..blocks[2] {
            for y in 0..blocks[1] {
                for x in 0..blocks[0] {
                    let majorant = prepared.largest_in_block([x, y, z]);
                    prepared.majorants.push(majorant);
                }
            }
        }
        prepared
    }

    /// The maximum value of a block and the adjacent voxels.
    fn largest_in_block(&self, block: [u32; 3]) -> f32 {
        let range = |axis: usize| {
            let first = (block[axis] * BLOCK).saturating_sub(1);
            first..((block[axis] + 1) * BLOCK + 1).min(self.size[axis])
        };
        let mut largest = 0.0f32;
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    largest = largest.max(self.voxel(x, y, z));
                }
            }
        }
        // Interpolation may round up.
        largest * 1.000_001
    }

    fn voxel(&self, x: u32, y: u32, z: u32) -> f32 {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        self.values[(z as usize * ny + y as usize) * nx + x as usize]
    }

    /// A ray in voxel coordinates; `extinction` (1/m) is that of density 1.
    #[inline]
    pub fn ray(&self, origin: Vec3, direction: Vec3, extinction: f32) -> GridRay {
        GridRay {
            origin: self.voxels_from_world * (origin - self.corner),
            direction: self.voxels_from_world * direction,
            scale: extinction * direction.length(),
        }
    }

    /// The trilinearly interpolated density at a point in voxel coordinates; values are at voxel centres.
    #[inline]
    pub fn density(&self, p: Vec3) -> f32 {
        let (mut lower, mut upper, mut weights) = ([0; 3], [0; 3], [0.0; 3]);
        for axis in 0..3 {
            let last = self.size[axis] - 1;
            let at = (p[axis] - 0.5).clamp(0.0, last as f32);
            lower[axis] = (at as u32).min(last);
            upper[axis] = (lower[axis] + 1).min(last);
            weights[axis] = at - lower[axis] as f32;
        }
        let mix = |a: f32, b: f32, w: f32| a + (b - a) * w;
        let [wx, wy, wz] = weights;
        let row = |y: u32, z: u32| mix(self.voxel(lower[0], y, z), self.voxel(upper[0], y, z), wx);
        let slice = |z: u32| mix(row(lower[1], z), row(upper[1], z), wy);
        mix(slice(lower[2]), slice(upper[2]), wz)
    }

    /// Samples a collision by delta tracking within a range of ray parameters; infinity if there is none. `first` is the first
    /// random number in 0..1, `seed` that of the others. A real collision counts if `ends` returns true for its ray parameter and
    /// a random number in 0..1.
    #[inline]
    pub fn collision(
        &self,
        ray: &GridRay,
        range: [f32; 2],
        first: f32,
        seed: u32,
        mut ends: impl FnMut(f32, f32) -> bool,
    ) -> f32 {
        let mut found = f32::INFINITY;
        let mut numbers = RandomSequence(seed);
        self.tentative_collisions(ray, range, first, &mut numbers, |t, share, numbers| {
            let number = numbers.next();
            let collides = number < share && ends(t, number / share);
            if collides {
                found = t;
            }
            !collides
        });
        found
    }

    /// An unbiased estimate of the transmittance between two points of a ray, by ratio tracking.
    #[inline]
    pub fn transmittance(&self, ray: &GridRay, from: f32, to: f32, seed: u32) -> f32 {
        self.ratio_tracking(
            ray,
            [from, to],
            seed,
            1.0,
            |transmittance, _, share| transmittance * (1.0 - share),
            |transmittance| transmittance,
        )
    }

    /// Transmittance per channel by ratio tracking; `relative` is the extinction of each channel at a ray parameter, relative to
    /// that of the ray, at most 1.
    pub fn transmittance_by_channel(
        &self,
        ray: &GridRay,
        [from, to]: [f32; 2],
        seed: u32,
        relative: impl Fn(f32) -> Rgb,
    ) -> Rgb {
        let collide =
            |transmittance: Rgb, t: f32, share: f32| transmittance * (Rgb::ONE - relative(t) * share);
        self.ratio_tracking(ray, [from, to], seed, Rgb::ONE, collide, |transmittance| {
            transmittance.max_element()
        })
    }

    /// Ratio tracking of a transmittance that starts with `one`; `collide` applies a tentative collision at a ray parameter with
    /// its probability of being real, and `largest` returns the maximum channel for Russian roulette.
    #[inline]
    fn ratio_tracking<T: Copy + Mul<f32, Output = T>>(
        &self,
        ray: &GridRay,
        range: [f32; 2],
        seed: u32,
        one: T,
        collide: impl Fn(T, f32, f32) -> T,
        largest: impl Fn(T) -> f32,
    ) -> T {
        /// Transmittance below which Russian roulette applies, with a survival probability of 1/4.
        const ROULETTE: f32 = 0.1;
        let mut transmittance = one;
        let mut numbers = RandomSequence(seed);
        let first = numbers.next();
        self.tentative_collisions(ray, range, first, &mut numbers, |t, share, numbers| {
            transmittance = collide(transmittance, t, share);
            if largest(transmittance) < ROULETTE {
                transmittance = transmittance * if numbers.next() < 0.25 { 4.0 } else { 0.0 };
            }
            largest(transmittance) > 0.0
        });
        transmittance
    }

    /// An estimate of the optical depth between two ray parameters, by stratified sampling (ray marching) with random numbers
    /// seeded by `seed`. (With extinction 1 the integral of the density over metres.)
    pub fn integral(&self, ray: &GridRay, from: f32, to: f32, seed: u32) -> f32 {
        self.integral_of(ray, [from, to], seed, 0.0, |density, _| density)
    }

    /// As [`DensityGrid::integral`], of a function of the density and the ray parameter; `zero` is its value for density 0.
    #[inline]
    pub(super) fn integral_of<T: Add<Output = T> + Mul<f32, Output = T>>(
        &self,
        ray: &GridRay,
        [from, to]: [f32; 2],
        seed: u32,
        zero: T,
        of: impl Fn(f32, f32) -> T,
    ) -> T {
        /// Length of a step, voxels.
        const STRIDE: f32 = 4.0;
        const MAX_STEPS: f32 = 32.0;
        let Some([begin, end]) = self.entry(ray, from, to) else { return zero };
        let (start, length) = (ray.origin + ray.direction * begin, end - begin);
        let steps = (ray.direction.length() * length / STRIDE).ceil().clamp(1.0, MAX_STEPS);
        let mut numbers = RandomSequence(seed);
        let mut sum = zero;
        for step in 0..steps as u32 {
            let t = (step as f32 + numbers.next()) / steps * length;
            sum = sum + of(self.density(start + ray.direction * t), begin + t);
        }
        sum * (ray.scale * length / steps)
    }

    /// The part of a range of ray parameters inside the grid; `None` if the ray misses it.
    fn entry(&self, ray: &GridRay, from: f32, to: f32) -> Option<[f32; 2]> {
        let (mut begin, mut end) = (from, to);
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            if d == 0.0 {
                if !(o >= 0.0 && o <= self.size[axis] as f32) {
                    return None;
                }
                continue;
            }
            let (a, b) = ((0.0 - o) / d, (self.size[axis] as f32 - o) / d);
            // NaN for grids beyond the range of single precision.
            if a.is_nan() || b.is_nan() {
                return None;
            }
            begin = begin.max(a.min(b));
            end = end.min(a.max(b));
        }
        (begin < end).then_some([begin, end])
    }

    /// Samples tentative collisions and calls `visit` with the ray parameter of each and its probability of being real, until it
    /// returns false.
    #[inline]
    fn tentative_collisions(
        &self,
        ray: &GridRay,
        [from, to]: [f32; 2],
        first: f32,
        numbers: &mut RandomSequence,
        mut visit: impl FnMut(f32, f32, &mut RandomSequence) -> bool,
    ) {
        let Some(begin) = self.entry(ray, from, to) else { return };
        // Relative to the entry into the grid: far from the ray's origin parameters are coarser than voxels.
        let ray = &GridRay { origin: ray.origin + ray.direction * begin[0], ..*ray };
        let mut walk = BlockTraversal::new(self, ray, begin[1] - begin[0]);
        // Optical depth to the next tentative collision.
        let mut depth = -poly::ln(1.0 - first);
        loop {
            let majorant = self.majorants[walk.index(self)] * ray.scale;
            loop {
                // Infinite or NaN for a majorant of 0.
                let t = walk.t + depth / majorant;
                if t.is_nan() || t >= walk.next() {
                    break;
                }
                // Progress is guaranteed for any density.
                walk.t = t.max(walk.t.next_up());
                let density = self.density(ray.origin + ray.direction * walk.t) * ray.scale;
                if !visit((begin[0] + walk.t).min(begin[1]), density / majorant, numbers) {
                    return;
                }
                depth = -poly::ln(1.0 - numbers.next());
            }
            depth -= (walk.next() - walk.t) * majorant;
            depth = depth.max(0.0);
            if !walk.step(self) {
                return;
            }
        }
    }
}

/// A sequence of pseudorandom numbers in 0..1 from a seed.
struct RandomSequence(u32);

impl RandomSequence {
    #[inline]
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        unit(hash32(self.0))
    }
}

/// Traversal of blocks along a ray (Amanatides and Woo 1987, "A Fast Voxel Traversal Algorithm for Ray Tracing").
struct BlockTraversal {
    t: f32,
    end: f32,
    block: [i32; 3],
    step: [i32; 3],
    /// Ray parameter at which the ray leaves the block along each axis.
    exits: [f32; 3],
    /// Difference of the ray parameter between block boundaries of each axis.
    delta: [f32; 3],
}

impl BlockTraversal {
    /// A traversal from the ray's origin, on the boundary of the grid, to the ray parameter `end`.
    fn new(grid: &DensityGrid, ray: &GridRay, end: f32) -> BlockTraversal {
        let mut walk = BlockTraversal {
            t: 0.0,
            end,
            block: [0; 3],
            step: [0; 3],
            exits: [f32::INFINITY; 3],
            delta: [0.0; 3],
        };
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            let at = (o / BLOCK as f32).floor() as i32;
            walk.block[axis] = at.clamp(0, grid.blocks[axis] as i32 - 1);
            if d != 0.0 {
                walk.step[axis] = if d > 0.0 { 1 } else { -1 };
                let edge = (walk.block[axis] + i32::from(d > 0.0)) as f32 * BLOCK as f32;
                walk.exits[axis] = (edge - o) / d;
                walk.delta[axis] = BLOCK as f32 / d.abs();
            }
        }
        walk
    }

    fn index(&self, grid: &DensityGrid) -> usize {
        let [x, y, z] = self.block.map(|b| b as usize);
        let [nx, ny, _] = grid.blocks.map(|n| n as usize);
        (z * ny + y) * nx + x
    }

    /// Ray parameter at which the ray leaves the block.
    fn next(&self) -> f32 {
        self.exits[0].min(self.exits[1]).min(self.exits[2]).min(self.end).max(self.t)
    }

    /// Advances to the next block; false after the last.
    fn step(&mut self, grid: &DensityGrid) -> bool {
        let next = self.next();
        if next >= self.end {
            return false;
        }
        self.t = next;
        let [x, y, z] = self.exits;
        let axis = if x <= y && x <= z {
            0
        } else if y <= z {
            1
        } else {
            2
        };
        self.block[axis] += self.step[axis];
        self.exits[axis] += self.delta[axis];
        (0..grid.blocks[axis] as i32).contains(&self.block[axis])
    }
}

// Emission grids: factors on a medium's emission, or blackbody temperatures.

/// Number of tabulated temperatures; colours between are interpolated linearly.
const COLORS: usize = 1024;
/// Maximum number of cells of a grid for light sampling.
const MAX_CELLS: usize = 1 << 18;

/// A grid of factors on the emission of a medium.
#[derive(Clone, Debug, PartialEq)]
pub struct CompiledEmissionGrid {
    /// Factors on all channels, factors on the first channel, or temperatures.
    grid: Arc<DensityGrid>,
    kind: EmissionKind,
}

/// Meaning of the values of an emission grid.
#[derive(Clone, Debug, PartialEq)]
enum EmissionKind {
    /// Factors on all channels.
    Factors,
    /// Factors per channel: the grids of the second and third channel, with the voxels of the first.
    Channels([Arc<DensityGrid>; 2]),
    /// Blackbody temperatures.
    BlackBody(BlackBodyEmission),
}

/// Blackbody emission of a temperature grid.
#[derive(Clone, Debug, PartialEq)]
struct BlackBodyEmission {
    /// Temperature for the grid value 1, kelvins.
    kelvin: f32,
    bodies: BlackBodies,
    /// Factors for a luminance proportional to the fourth power of the temperature, at the temperatures of `colors`; empty for
    /// Planck's law.
    powers: Vec<f32>,
    /// Tabulated emission from temperature 0 to the maximum.
    colors: Vec<Rgb>,
    /// Table entries per unit of the grid value.
    per_value: f32,
}

impl CompiledEmissionGrid {
    /// Emission proportional to the density.
    pub(super) fn of_density(grid: &Arc<DensityGrid>) -> CompiledEmissionGrid {
        CompiledEmissionGrid { grid: grid.clone(), kind: EmissionKind::Factors }
    }

    /// Compiles an emission grid of the scene.
    pub(super) fn new(
        emission: scene::EmissionGrid,
        grids: &[Grid],
        prepared: &[Arc<DensityGrid>],
    ) -> CompiledEmissionGrid {
        use scene::EmissionGrid::{Channels, Factors, Temperatures};
        let ready = |id: GridId| prepared[id.index()].clone();
        match emission {
            Factors(grid) => CompiledEmissionGrid { grid: ready(grid), kind: EmissionKind::Factors },
            Channels([r, g, b]) => {
                CompiledEmissionGrid { grid: ready(r), kind: EmissionKind::Channels([ready(g), ready(b)]) }
            }
            Temperatures { grid, kelvin, scales_with_power } => {
                let max_value = grids[grid.index()].values.iter().fold(0.0f32, |max, x| max.max(*x));
                let black_body = BlackBodyEmission::new(kelvin, max_value, scales_with_power);
                CompiledEmissionGrid { grid: ready(grid), kind: EmissionKind::BlackBody(black_body) }
            }
        }
    }

    /// The bounding parallelepiped of the grid: a corner and the edges (columns), metres.
    pub(super) fn parallelepiped(&self) -> (Vec3, Mat3) {
        let DensityGrid { corner, voxels_from_world, size, .. } = &*self.grid;
        let edges = Vec3::from_array(size.map(|n| n as f32));
        (*corner, voxels_from_world.inverse() * Mat3::from_diagonal(edges))
    }

    /// Number of cells along each axis, at most [`MAX_CELLS`] in total, and the mean of a function of the emission factor over
    /// each cell, x fastest.
    pub(super) fn cells(&self, of: impl Fn(Rgb) -> f32) -> ([usize; 3], Vec<f32>) {
        let voxels = self.grid.size.map(|n| n as usize);
        let cells = |edge: usize| voxels.map(|n| n.div_ceil(edge));
        let mut edge = 1;
        while cells(edge).iter().product::<usize>() > MAX_CELLS {
            edge += 1;
        }
        let size = cells(edge);
        let cell = |axis: usize, voxel: usize| (2 * voxel + 1) * size[axis] / (2 * voxels[axis]);
        let mut sums = vec![(0.0, 0.0f32); size.iter().product()];
        for (i, &value) in self.grid.values.iter().enumerate() {
            let [x, y, z] = [i % voxels[0], i / voxels[0] % voxels[1], i / (voxels[0] * voxels[1])];
            let (sum, count) = &mut sums[(cell(2, z) * size[1] + cell(1, y)) * size[0] + cell(0, x)];
            let center = Vec3::new(x as f32, y as f32, z as f32) + 0.5;
            (*sum, *count) = (*sum + of(self.factor(value, center, None)), *count + 1.0);
        }
        let mut means: Vec<f32> = sums.iter().map(|(sum, count)| sum / count.max(1.0)).collect();
        // Interpolation spreads 1/8 of each value to both neighbouring voxels.
        for (axis, stride) in [1, size[0], size[0] * size[1]].into_iter().enumerate() {
            blur(&mut means, (size[axis], stride), 0.125 / edge as f32);
        }
        (size, means)
    }

    /// The emission factor at a point in world space; 0 outside the grid.
    pub fn at(&self, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let voxel = self.grid.voxels_from_world * (p - self.grid.corner);
        let is_inside = (0..3).all(|axis| (0.0..=self.grid.size[axis] as f32).contains(&voxel[axis]));
        if !is_inside {
            return Rgb::ZERO;
        }
        self.factor(self.grid.density(voxel), voxel, waves)
    }

    /// An estimate of the integral of the emission factor between two ray parameters, over metres; see
    /// [`DensityGrid::integral`]. `ray` is origin and direction.
    pub fn integral(&self, ray: (Vec3, Vec3), span: [f32; 2], seed: u32, waves: Option<&Wavelengths>) -> Rgb {
        match &self.kind {
            EmissionKind::Factors => {
                let grid_ray = self.grid.ray(ray.0, ray.1, 1.0);
                Rgb::splat(self.grid.integral(&grid_ray, span[0], span[1], seed))
            }
            _ => self.integral_times(ray, span, seed, waves, |_| Rgb::ONE),
        }
    }

    /// As [`CompiledEmissionGrid::integral`], with a factor that depends on the ray parameter.
    pub fn integral_times(
        &self,
        (origin, direction): (Vec3, Vec3),
        span: [f32; 2],
        seed: u32,
        waves: Option<&Wavelengths>,
        factor: impl Fn(f32) -> Rgb,
    ) -> Rgb {
        let ray: GridRay = self.grid.ray(origin, direction, 1.0);
        let at = |value: f32, t: f32| factor(t) * self.factor(value, ray.at(t), waves);
        self.grid.integral_of(&ray, span, seed, Rgb::ZERO, at)
    }

    /// The emission factor for a grid value; `p` in voxel coordinates.
    #[inline]
    fn factor(&self, value: f32, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        match &self.kind {
            EmissionKind::Factors => Rgb::splat(value),
            EmissionKind::Channels([green, blue]) => {
                let emission = Rgb::new(value, green.density(p), blue.density(p));
                waves.map_or(emission, |waves| Spectrum::of_light(emission).at(waves))
            }
            EmissionKind::BlackBody(black_body) => black_body.at(value, waves),
        }
    }
}

/// Blurs an array along an axis of `count` values at a distance of `stride`: each value passes the fraction `share` to both
/// neighbours, or keeps it at the border.
fn blur(values: &mut [f32], (count, stride): (usize, usize), share: f32) {
    let before = values.to_vec();
    for (i, value) in values.iter_mut().enumerate() {
        let at = i / stride % count;
        let below = if at > 0 { before[i - stride] } else { before[i] };
        let above = if at + 1 < count { before[i + stride] } else { before[i] };
        *value = before[i] * (1.0 - 2.0 * share) + (below + above) * share;
    }
}

impl BlackBodyEmission {
    /// Tabulates emission for grid values up to `max_value`; the value 1 means `kelvin`.
    fn new(kelvin: f32, max_value: f32, scales_with_power: bool) -> BlackBodyEmission {
        let bodies = BlackBodies::relative_to(scene::EmissionGrid::REFERENCE_KELVIN);
        let last = (COLORS - 1) as f32;
        let kelvin_of = |i: usize| kelvin * max_value * (i as f32 / last);
        let steps = 0..if scales_with_power { COLORS } else { 0 };
        let powers: Vec<f32> = steps.map(|i| bodies.power_over_luminance(kelvin_of(i))).collect();
        let color = |i: usize| match powers.get(i) {
            Some(power) => Rgb::from_array(bodies.rgb(kelvin_of(i).max(BlackBodies::MIN_KELVIN))) * *power,
            None => Rgb::from_array(bodies.rgb(kelvin_of(i))),
        };
        let colors = (0..COLORS).map(color).collect();
        let per_value = if max_value > 0.0 { last / max_value } else { 0.0 };
        BlackBodyEmission { kelvin, colors, powers, per_value, bodies }
    }

    #[inline]
    fn at(&self, value: f32, waves: Option<&Wavelengths>) -> Rgb {
        let at = (value * self.per_value).clamp(0.0, (COLORS - 1) as f32);
        let i = (at as usize).min(COLORS - 2);
        let share = at - i as f32;
        let Some(waves) = waves else {
            return self.colors[i] + (self.colors[i + 1] - self.colors[i]) * share;
        };
        let kelvin = value * self.kelvin;
        match self.powers.get(i..i + 2) {
            None => waves.map(|nm| self.bodies.at(nm, kelvin)),
            Some(powers) => {
                let power = powers[0] + (powers[1] - powers[0]) * share;
                waves.map(|nm| self.bodies.at(nm, kelvin.max(BlackBodies::MIN_KELVIN))) * power
            }
        }
    }
}

const C2: f32 = SECOND_RADIATION_CONSTANT as f32;

/// Blackbody radiation by Planck's law, relative to D65 and to the luminance at a reference temperature.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBodies {
    reference: Curve,
    kelvin: f32,
}

/// 1 / (exp(x) - 1), the occupation number in Planck's law.
fn occupation(x: f32) -> f32 {
    // exp(-x) would be below the smallest normal number.
    if x > 87.0 { 0.0 } else { poly::exp(-x) / (1.0 - poly::exp(-x)).max(f32::MIN_POSITIVE) }
}

impl BlackBodies {
    /// Temperature, kelvins, below which the colour is constant; the luminance there is negligible.
    pub const MIN_KELVIN: f32 = 800.0;

    /// Scales emission to a luminance of 1 at a temperature in kelvins.
    pub fn relative_to(kelvin: f32) -> BlackBodies {
        BlackBodies { reference: Curve::black_body(kelvin.into(), 1.0), kelvin }
    }

    /// Emission at a wavelength in nanometres and a temperature in kelvins; 0 for temperature 0.
    #[inline]
    pub fn at(&self, nm: f32, kelvin: f32) -> f32 {
        if kelvin <= 0.0 {
            return 0.0;
        }
        self.reference.at(nm) * (occupation(C2 / (nm * kelvin)) / occupation(C2 / (nm * self.kelvin)))
    }

    /// Factor on [`BlackBodies::at`] (for at least `MIN_KELVIN`) for a luminance proportional to the fourth power of the
    /// temperature, 1 at the reference.
    pub fn power_over_luminance(&self, kelvin: f32) -> f32 {
        let clamped = kelvin.max(BlackBodies::MIN_KELVIN);
        let luminance = luminance(rgb_of(|nm| f64::from(self.at(nm as f32, clamped))).map(|v| v as f32));
        (kelvin / self.kelvin).powi(4) / luminance
    }

    /// Linear Rec. 709 at a temperature in kelvins; negative channels (out of gamut) are 0.
    pub fn rgb(&self, kelvin: f32) -> [f32; 3] {
        rgb_of(|nm| f64::from(self.at(nm as f32, kelvin))).map(|v| v.max(0.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of 20 x 9 x 3 voxels over a box of 2 x 3 x 1 metres whose density rises along x and y.
    fn grid() -> DensityGrid {
        let size = [20, 9, 3];
        let value = |i: usize| ((i % 20) as f32) * 0.1 + ((i / 20 % 9) as f32) * 0.3;
        let values = Arc::new((0..20 * 9 * 3).map(value).collect());
        let (name, min, max) = (String::new(), DVec3::new(-1.0, 0.0, 0.0), DVec3::new(1.0, 3.0, 1.0));
        DensityGrid::new(&Grid::in_box(name, size, values, min, max), DVec3::ZERO)
    }

    /// Optical depth of a ray, by quadrature.
    fn thickness(grid: &DensityGrid, ray: &GridRay, to: f32) -> f64 {
        let n = 40_000;
        let inside = |p: Vec3| (0..3).all(|a| p[a] >= 0.0 && p[a] <= grid.size[a] as f32);
        let at = |i: i32| {
            let p = ray.origin + ray.direction * (to * (i as f32 + 0.5) / n as f32);
            if inside(p) { f64::from(grid.density(p) * ray.scale) } else { 0.0 }
        };
        (0..n).map(at).sum::<f64>() * f64::from(to) / f64::from(n)
    }

    #[test]
    fn grids_beyond_single_precision_are_empty() {
        let mut far = Grid::in_box(String::new(), [2; 3], Arc::new(vec![1.0; 8]), DVec3::ZERO, DVec3::ONE);
        far.world_from_voxels.translation = DVec3::new(1e154, -1e154, 0.0);
        let grid = DensityGrid::new(&far, DVec3::ZERO);
        for direction in [Vec3::X, Vec3::new(0.6, -0.8, 0.0), Vec3::new(0.6, 0.0, 0.8)] {
            let ray = grid.ray(Vec3::splat(0.5), direction, 1.0);
            assert_eq!(grid.transmittance(&ray, 0.0, 1e30, 7), 1.0);
            assert_eq!(grid.integral(&ray, 0.0, 1e30, 7), 0.0);
        }
    }

    #[test]
    fn collisions_and_transmittance_match_quadrature() {
        let grid = grid();
        for (origin, direction) in [
            (Vec3::new(-2.0, 0.5, 0.5), Vec3::new(0.8, 0.6, 0.0)),
            (Vec3::new(0.3, 1.0, 0.2), Vec3::new(-0.3, 0.9, 0.1)),
            (Vec3::new(0.9, 2.9, 0.9), Vec3::new(-0.6, -0.7, -0.2)),
        ] {
            let ray = grid.ray(origin, direction, 0.7);
            for to in [0.8f32, 50.0] {
                let truth = (-thickness(&grid, &ray, to.min(6.0))).exp();
                let n = 40_000;
                let (mut transmittance, mut passed) = (0.0, 0.0);
                for i in 0..n {
                    let seed = hash32(i);
                    transmittance += f64::from(grid.transmittance(&ray, 0.0, to, seed));
                    let first = unit(hash32(i ^ 0x5bd1_e995));
                    let t = grid.collision(&ray, [0.0, to], first, seed, |_, _| true);
                    passed += f64::from(u8::from(t == f32::INFINITY));
                    assert!(t == f32::INFINITY || (0.0..=to).contains(&t));
                }
                let n = f64::from(n);
                let error = (truth * (1.0 - truth) / n).sqrt().max(1e-4);
                assert!(
                    (transmittance / n - truth).abs() < 4.5 * error,
                    "transmittance {} {truth}",
                    transmittance / n
                );
                assert!((passed / n - truth).abs() < 4.5 * error, "passed {} {truth}", passed / n);
            }
        }
    }

    #[test]
    fn estimates_of_the_optical_depth_are_unbiased() {
        let grid = grid();
        for (origin, direction) in [
            (Vec3::new(-2.0, 0.5, 0.5), Vec3::new(0.8, 0.6, 0.0)),
            (Vec3::new(0.9, 2.9, 0.9), Vec3::new(-0.6, -0.7, -0.2)),
        ] {
            let ray = grid.ray(origin, direction, 1.0);
            for to in [1.6f32, 6.0] {
                let truth = thickness(&grid, &ray, to);
                let n = 4_000;
                let sum: f64 = (0..n).map(|i| f64::from(grid.integral(&ray, 0.0, to, hash32(i)))).sum();
                assert!((sum / f64::from(n) - truth).abs() < 4e-3 * truth, "{} {truth}", sum / f64::from(n));
            }
        }
    }

    /// Dense smoke of 1 mm at a distance where ray parameters are coarser than the mean free path.
    #[test]
    fn dense_grids_far_from_the_ray_origin() {
        let values = Arc::new(vec![0.0, 1.0]);
        let (name, min, max) = (String::new(), DVec3::ZERO, DVec3::splat(1e-3));
        let grid = DensityGrid::new(&Grid::in_box(name, [2, 1, 1], values, min, max), DVec3::ZERO);
        for (x, is_clear) in [(1e-4, true), (2e-4, true), (9e-4, false)] {
            let ray = grid.ray(Vec3::new(x, 5e-4, 30.0), Vec3::NEG_Z, 5e7);
            for i in 0..20 {
                let t = grid.collision(&ray, [0.0, f32::INFINITY], unit(hash32(!i)), hash32(i), |_, _| true);
                assert_eq!(t == f32::INFINITY, is_clear, "{x}: {t}");
                assert!(is_clear || (t - 30.0).abs() < 2e-3, "{t}");
                assert_eq!(grid.transmittance(&ray, 0.0, 40.0, hash32(i)), f32::from(u8::from(is_clear)));
            }
        }
    }

    #[test]
    fn one_voxel_and_rays_that_miss_the_grid() {
        let values = Arc::new(vec![2.0]);
        let (name, min, max) = (String::new(), DVec3::ZERO, DVec3::ONE);
        let grid = DensityGrid::new(&Grid::in_box(name, [1; 3], values, min, max), DVec3::ZERO);
        let ray = grid.ray(Vec3::new(0.5, 0.5, -1.0), Vec3::Z, 1.0);
        let n = 20_000;
        let mean = (0..n).map(|i| f64::from(grid.transmittance(&ray, 0.0, 9.0, hash32(i)))).sum::<f64>()
            / f64::from(n);
        assert!((mean - (-2.0f64).exp()).abs() < 0.01, "{mean}");
        for origin in [Vec3::new(1.5, 0.5, -1.0), Vec3::new(0.5, 0.5, 2.0)] {
            let ray = grid.ray(origin, Vec3::Z, 1.0);
            assert_eq!(grid.transmittance(&ray, 0.0, 9.0, 1), 1.0);
            assert_eq!(grid.collision(&ray, [0.0, 9.0], 0.99, 1, |_, _| true), f32::INFINITY);
        }
    }
}

#[cfg(test)]
mod black_body_tests {
    use super::*;

    #[test]
    fn emission_matches_curves_and_planck_s_law() {
        let bodies = BlackBodies::relative_to(1500.0);
        for kelvin in [900.0, 1500.0, 2500.0, 6500.0] {
            let curve = Curve::black_body(kelvin, 1.0);
            let relative_luminance =
                luminance(rgb_of(|nm| f64::from(bodies.at(nm as f32, kelvin as f32))).map(|v| v as f32));
            for nm in [420.0, 507.0, 561.0, 650.0] {
                let ratio = bodies.at(nm, kelvin as f32) / relative_luminance / curve.at(nm);
                assert!((ratio - 1.0).abs() < 1e-3, "{kelvin} K, {nm} nm: {ratio}");
            }
        }
        // Ratio of radiances at one wavelength by Planck's law.
        let c2 = SECOND_RADIATION_CONSTANT;
        let expected = (c2 / (600.0 * 1500.0)).exp_m1() / (c2 / (600.0 * 2000.0)).exp_m1();
        let found = bodies.at(600.0, 2000.0) / bodies.at(600.0, 1500.0);
        assert!((f64::from(found) / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        assert_eq!(bodies.at(600.0, 0.0), 0.0);
        for (kelvin, seen, expected) in [(1500.0, 1500.0, 1.0), (3000.0, 3000.0, 16.0), (150.0, 800.0, 1e-4)]
        {
            let relative_luminance =
                luminance(rgb_of(|nm| f64::from(bodies.at(nm as f32, seen))).map(|v| v as f32));
            let power = bodies.power_over_luminance(kelvin) * relative_luminance;
            assert!((power / expected - 1.0).abs() < 1e-3, "{kelvin} K: {power}");
        }
        assert!(bodies.at(780.0, 1e6).is_finite() && bodies.at(380.0, 1.0) == 0.0);
    }
}
