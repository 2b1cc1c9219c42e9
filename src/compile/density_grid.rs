//! Density grids for delta tracking and ratio tracking, with a majorant for each block of voxels.
//!
//! Rays meet tentative collisions in proportion to the bounds, block by block, and each is real with the probability of the density
//! there over the bound (Woodcock et al. 1965; with a grid of bounds Szirmay-Kalos et al. 2011, "Free path sampling in high
//! resolution inhomogeneous participating media"). What is left of light is the product over tentative
//! collisions of the probabilities that they are none (Novak et al. 2014, "Residual ratio tracking for estimating attenuation in
//! participating media", section 3.1).

use crate::color::spectral::{Curve, SECOND_RADIATION_CONSTANT, Spectrum, Wavelengths, rgb_of};
use crate::color::{Rgb, luminance};
use crate::math::{DVec3, Mat3, Vec3, poly};
use crate::sampling::hash::{hash32, unit};
use crate::scene;
use crate::scene::{Grid, GridId};
use std::ops::{Add, Mul};
use std::sync::Arc;

/// Voxels along an edge of a block.
const BLOCK: u32 = 8;

/// A grid of densities, ready for rendering.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityGrid {
    size: [u32; 3],
    values: Arc<Vec<f32>>,
    /// Voxel coordinates are `voxels_from_world * (p - corner)`.
    corner: Vec3,
    voxels_from_world: Mat3,
    /// The majorant of each block: an upper bound of interpolated values.
    bounds: Vec<f32>,
    blocks: [u32; 3],
}

/// A ray in voxel coordinates, with the parameter of the world-space ray.
#[derive(Clone, Copy, Debug)]
pub struct GridRay {
    origin: Vec3,
    direction: Vec3,
    /// Extinction per unit of density and of the parameter.
    scale: f32,
}

impl GridRay {
    /// A point in voxels.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

impl DensityGrid {
    /// Prepares a grid; the world's origin moves to `anchor`.
    pub(super) fn new(grid: &Grid, anchor: DVec3) -> DensityGrid {
        let size = grid.size;
        let blocks = size.map(|n| n.div_ceil(BLOCK));
        let mut prepared = DensityGrid {
            size,
            values: grid.values.clone(),
            corner: (grid.world_from_voxels.translation - anchor).as_vec3(),
            voxels_from_world: grid.world_from_voxels.matrix3.inverse().as_mat3(),
            bounds: Vec::new(),
            blocks,
        };
        for z in 0..blocks[2] {
            for y in 0..blocks[1] {
                for x in 0..blocks[0] {
                    let bound = prepared.largest_near([x, y, z]);
                    prepared.bounds.push(bound);
                }
            }
        }
        prepared
    }

    /// The largest value of a block and the adjacent voxels.
    fn largest_near(&self, block: [u32; 3]) -> f32 {
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
        // Interpolation may round upwards.
        largest * 1.000_001
    }

    fn voxel(&self, x: u32, y: u32, z: u32) -> f32 {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        self.values[(z as usize * ny + y as usize) * nx + x as usize]
    }

    /// A ray in voxels, of an extinction per metre where the density is 1.
    #[inline]
    pub fn ray(&self, origin: Vec3, direction: Vec3, extinction: f32) -> GridRay {
        GridRay {
            origin: self.voxels_from_world * (origin - self.corner),
            direction: self.voxels_from_world * direction,
            scale: extinction * direction.length(),
        }
    }

    /// The density at a point in voxels; values lie in the middles of voxels.
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
        let sheet = |z: u32| mix(row(lower[1], z), row(upper[1], z), wy);
        mix(sheet(lower[2]), sheet(upper[2]), wz)
    }

    /// Where a ray collides between two of its points, by numbers that follow `salt` and a first one in 0..1, at the first collision
    /// that `ends` it, given its ray parameter and another number in 0..1; infinite if nowhere.
    #[inline]
    pub fn collision(
        &self,
        ray: &GridRay,
        way: [f32; 2],
        first: f32,
        salt: u32,
        mut ends: impl FnMut(f32, f32) -> bool,
    ) -> f32 {
        let mut found = f32::INFINITY;
        let mut numbers = RandomSequence(salt);
        self.tentative(ray, way, first, &mut numbers, |t, share, numbers| {
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
    pub fn transmittance(&self, ray: &GridRay, from: f32, to: f32, salt: u32) -> f32 {
        self.ratio_tracking(ray, [from, to], salt, 1.0, |left, _, share| left * (1.0 - share), |left| left)
    }

    /// Transmittance by channel; `relative` is the extinction of each channel at a ray parameter over that of the ray there, at most 1.
    pub fn transmittance_by_channel(
        &self,
        ray: &GridRay,
        [from, to]: [f32; 2],
        salt: u32,
        relative: impl Fn(f32) -> Rgb,
    ) -> Rgb {
        let take = |left: Rgb, t: f32, share: f32| left * (Rgb::ONE - relative(t) * share);
        self.ratio_tracking(ray, [from, to], salt, Rgb::ONE, take, |left| left.max_element())
    }

    /// Ratio tracking of a value that starts as `all`; `take` applies a tentative collision at a ray parameter, of some probability, and `largest` measures
    /// the rest for Russian roulette.
    #[inline]
    fn ratio_tracking<T: Copy + Mul<f32, Output = T>>(
        &self,
        ray: &GridRay,
        way: [f32; 2],
        salt: u32,
        all: T,
        take: impl Fn(T, f32, f32) -> T,
        largest: impl Fn(T) -> f32,
    ) -> T {
        /// Below this, Russian roulette with a survival probability of 1/4.
        const LITTLE: f32 = 0.1;
        let mut left = all;
        let mut numbers = RandomSequence(salt);
        let first = numbers.next();
        self.tentative(ray, way, first, &mut numbers, |t, share, numbers| {
            left = take(left, t, share);
            if largest(left) < LITTLE {
                left = left * if numbers.next() < 0.25 { 4.0 } else { 0.0 };
            }
            largest(left) > 0.0
        });
        left
    }

    /// An estimate of the integral of the ray's extinction between two of its points: by one point of each of a few steps, which follow
    /// `salt`. (Extinction 1 gives the integral of the density over metres.)
    pub fn integral(&self, ray: &GridRay, from: f32, to: f32, salt: u32) -> f32 {
        self.integral_of(ray, [from, to], salt, 0.0, |density, _| density)
    }

    /// The integral of a function of the density and the ray parameter; `zero` is its value where the density is 0.
    #[inline]
    pub(super) fn integral_of<T: Add<Output = T> + Mul<f32, Output = T>>(
        &self,
        ray: &GridRay,
        [from, to]: [f32; 2],
        salt: u32,
        zero: T,
        of: impl Fn(f32, f32) -> T,
    ) -> T {
        /// Voxels that a step crosses, and most steps.
        const STRIDE: f32 = 4.0;
        const MAX: f32 = 32.0;
        let Some([begin, end]) = self.entry(ray, from, to) else { return zero };
        let (start, way) = (ray.origin + ray.direction * begin, end - begin);
        let steps = (ray.direction.length() * way / STRIDE).ceil().clamp(1.0, MAX);
        let mut numbers = RandomSequence(salt);
        let mut sum = zero;
        for step in 0..steps as u32 {
            let t = (step as f32 + numbers.next()) / steps * way;
            sum = sum + of(self.density(start + ray.direction * t), begin + t);
        }
        sum * (ray.scale * way / steps)
    }

    /// The ray parameters within a range at which a ray enters and leaves the grid; `None` if it misses the grid.
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
            // A grid beyond what single precision holds.
            if a.is_nan() || b.is_nan() {
                return None;
            }
            begin = begin.max(a.min(b));
            end = end.min(a.max(b));
        }
        (begin < end).then_some([begin, end])
    }

    /// Calls `visit` with the ray parameter of each tentative collision and its probability of being real, until it returns false.
    #[inline]
    fn tentative(
        &self,
        ray: &GridRay,
        [from, to]: [f32; 2],
        first: f32,
        numbers: &mut RandomSequence,
        mut visit: impl FnMut(f32, f32, &mut RandomSequence) -> bool,
    ) {
        let Some(begin) = self.entry(ray, from, to) else { return };
        // From where the grid begins on: far away from it parameters are coarser than its voxels.
        let ray = &GridRay { origin: ray.origin + ray.direction * begin[0], ..*ray };
        let mut walk = BlockTraversal::new(self, ray, begin[1] - begin[0]);
        // Mean free paths to the next collision.
        let mut depth = -poly::ln(1.0 - first);
        loop {
            let bound = self.bounds[walk.index(self)] * ray.scale;
            loop {
                // Infinite, or not a number, where nothing is.
                let t = walk.t + depth / bound;
                if t.is_nan() || t >= walk.next() {
                    break;
                }
                // However dense it is, a ray gets on.
                walk.t = t.max(walk.t.next_up());
                let density = self.density(ray.origin + ray.direction * walk.t) * ray.scale;
                if !visit((begin[0] + walk.t).min(begin[1]), density / bound, numbers) {
                    return;
                }
                depth = -poly::ln(1.0 - numbers.next());
            }
            depth -= (walk.next() - walk.t) * bound;
            depth = depth.max(0.0);
            if !walk.step(self) {
                return;
            }
        }
    }
}

/// Pseudorandom numbers in 0..1, seeded by a salt.
struct RandomSequence(u32);

impl RandomSequence {
    #[inline]
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        unit(hash32(self.0))
    }
}

/// Traversal of a ray from block to block (Amanatides, Woo 1987, "A Fast Voxel Traversal Algorithm for Ray Tracing").
struct BlockTraversal {
    t: f32,
    end: f32,
    block: [i32; 3],
    step: [i32; 3],
    /// Where the ray leaves the block along each axis, and how far it is from one to the next.
    leaves: [f32; 3],
    between: [f32; 3],
}

impl BlockTraversal {
    /// Traverses a ray that starts where it enters the grid and leaves it at `end`.
    fn new(grid: &DensityGrid, ray: &GridRay, end: f32) -> BlockTraversal {
        let mut walk = BlockTraversal {
            t: 0.0,
            end,
            block: [0; 3],
            step: [0; 3],
            leaves: [f32::INFINITY; 3],
            between: [0.0; 3],
        };
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            let at = (o / BLOCK as f32).floor() as i32;
            walk.block[axis] = at.clamp(0, grid.blocks[axis] as i32 - 1);
            if d != 0.0 {
                walk.step[axis] = if d > 0.0 { 1 } else { -1 };
                let edge = (walk.block[axis] + i32::from(d > 0.0)) as f32 * BLOCK as f32;
                walk.leaves[axis] = (edge - o) / d;
                walk.between[axis] = BLOCK as f32 / d.abs();
            }
        }
        walk
    }

    fn index(&self, grid: &DensityGrid) -> usize {
        let [x, y, z] = self.block.map(|b| b as usize);
        let [nx, ny, _] = grid.blocks.map(|n| n as usize);
        (z * ny + y) * nx + x
    }

    /// Where the ray leaves the block.
    fn next(&self) -> f32 {
        self.leaves[0].min(self.leaves[1]).min(self.leaves[2]).min(self.end).max(self.t)
    }

    /// To the next block; false behind the last.
    fn step(&mut self, grid: &DensityGrid) -> bool {
        let next = self.next();
        if next >= self.end {
            return false;
        }
        self.t = next;
        let [x, y, z] = self.leaves;
        let axis = if x <= y && x <= z {
            0
        } else if y <= z {
            1
        } else {
            2
        };
        self.block[axis] += self.step[axis];
        self.leaves[axis] += self.between[axis];
        (0..grid.blocks[axis] as i32).contains(&self.block[axis])
    }
}

// Emission grids: factors on a medium's emission, or temperatures of black bodies.

/// Tabulated temperatures; colours are linear between them.
const COLORS: usize = 1024;
/// Cells of a grid that is a light, at most.
const MAX_CELLS: usize = 1 << 18;

/// Factor on the emission of a medium.
#[derive(Clone, Debug, PartialEq)]
pub struct CompiledEmissionGrid {
    /// A grid of factors on all channels, on the first one, or of temperatures.
    grid: Arc<DensityGrid>,
    kind: EmissionKind,
}

/// Meaning of the values of an emission grid.
#[derive(Clone, Debug, PartialEq)]
enum EmissionKind {
    /// Factors on all channels.
    Factors,
    /// Factors by channel: the grids of the second and third one, on the same voxels as the first.
    Channels([Arc<DensityGrid>; 2]),
    /// Temperatures.
    Heat(BlackBodyEmission),
}

/// Black-body emission.
#[derive(Clone, Debug, PartialEq)]
struct BlackBodyEmission {
    /// Kelvins where the grid is 1.
    kelvin: f32,
    bodies: BlackBodies,
    /// Factors that scale luminance with the fourth power of the temperature, at the same steps as `colors`; empty if it is Planck's.
    powers: Vec<f32>,
    /// Their colours from 0 to the hottest, and how many of them lie between values that are 1 apart.
    colors: Vec<Rgb>,
    per_value: f32,
}

impl CompiledEmissionGrid {
    /// Emission in proportion to the density.
    pub(super) fn of_density(grid: &Arc<DensityGrid>) -> CompiledEmissionGrid {
        CompiledEmissionGrid { grid: grid.clone(), kind: EmissionKind::Factors }
    }

    /// The emission of a medium, by the scene's grids.
    pub(super) fn new(
        glow: scene::EmissionGrid,
        grids: &[Grid],
        prepared: &[Arc<DensityGrid>],
    ) -> CompiledEmissionGrid {
        use scene::EmissionGrid::{Channels, Factors, Temperatures};
        let ready = |id: GridId| prepared[id.index()].clone();
        match glow {
            Factors(grid) => CompiledEmissionGrid { grid: ready(grid), kind: EmissionKind::Factors },
            Channels([r, g, b]) => {
                CompiledEmissionGrid { grid: ready(r), kind: EmissionKind::Channels([ready(g), ready(b)]) }
            }
            Temperatures { grid, kelvin, scales_with_power } => {
                let hottest = grids[grid.index()].values.iter().fold(0.0f32, |most, x| most.max(*x));
                let heat = BlackBodyEmission::new(kelvin, hottest, scales_with_power);
                CompiledEmissionGrid { grid: ready(grid), kind: EmissionKind::Heat(heat) }
            }
        }
    }

    /// The box of the grid: a corner and the edges from there, metres.
    pub(super) fn parallelepiped(&self) -> (Vec3, Mat3) {
        let DensityGrid { corner, voxels_from_world, size, .. } = &*self.grid;
        let edges = Vec3::from_array(size.map(|n| n as f32));
        (*corner, voxels_from_world.inverse() * Mat3::from_diagonal(edges))
    }

    /// The mean of a function of the emission factor over each of at most [`MAX_CELLS`] cells of the grid, x fastest, and the number of
    /// cells along each axis.
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
        // Interpolation brings an eighth of the values of neighbouring voxels.
        for (axis, stride) in [1, size[0], size[0] * size[1]].into_iter().enumerate() {
            blur(&mut means, (size[axis], stride), 0.125 / edge as f32);
        }
        (size, means)
    }

    /// The emission factor at a point of the world; 0 outside of the grid.
    pub fn at(&self, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        let voxel = self.grid.voxels_from_world * (p - self.grid.corner);
        let is_inside = (0..3).all(|axis| (0.0..=self.grid.size[axis] as f32).contains(&voxel[axis]));
        if !is_inside {
            return Rgb::ZERO;
        }
        self.factor(self.grid.density(voxel), voxel, waves)
    }

    /// An estimate of the integral of the emission factor between two points of a ray, over metres; see
    /// [`DensityGrid::integral`].
    pub fn integral(&self, way: (Vec3, Vec3), span: [f32; 2], salt: u32, waves: Option<&Wavelengths>) -> Rgb {
        match &self.kind {
            EmissionKind::Factors => {
                let ray = self.grid.ray(way.0, way.1, 1.0);
                Rgb::splat(self.grid.integral(&ray, span[0], span[1], salt))
            }
            _ => self.integral_times(way, span, salt, waves, |_| Rgb::ONE),
        }
    }

    /// The integral with a factor on the emission that depends on the ray parameter.
    pub fn integral_times(
        &self,
        (origin, direction): (Vec3, Vec3),
        way: [f32; 2],
        salt: u32,
        waves: Option<&Wavelengths>,
        factor: impl Fn(f32) -> Rgb,
    ) -> Rgb {
        let ray: GridRay = self.grid.ray(origin, direction, 1.0);
        let at = |value: f32, t: f32| factor(t) * self.factor(value, ray.at(t), waves);
        self.grid.integral_of(&ray, way, salt, Rgb::ZERO, at)
    }

    /// The emission factor at a point in voxels where the grid has a value.
    #[inline]
    fn factor(&self, value: f32, p: Vec3, waves: Option<&Wavelengths>) -> Rgb {
        match &self.kind {
            EmissionKind::Factors => Rgb::splat(value),
            EmissionKind::Channels([green, blue]) => {
                let emission = Rgb::new(value, green.density(p), blue.density(p));
                waves.map_or(emission, |waves| Spectrum::of_light(emission).at(waves))
            }
            EmissionKind::Heat(heat) => heat.at(value, waves),
        }
    }
}

/// Gives a share of each value to both neighbours along an axis, with so many values at a distance of `stride`; the outermost keep theirs.
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
    /// A table of values up to `hottest` that are 1 at `kelvin`.
    fn new(kelvin: f32, hottest: f32, scales_with_power: bool) -> BlackBodyEmission {
        let bodies = BlackBodies::relative_to(scene::EmissionGrid::REFERENCE_KELVIN);
        let last = (COLORS - 1) as f32;
        let heat = |i: usize| kelvin * hottest * (i as f32 / last);
        let steps = 0..if scales_with_power { COLORS } else { 0 };
        let powers: Vec<f32> = steps.map(|i| bodies.power_over_luminance(heat(i))).collect();
        let color = |i: usize| match powers.get(i) {
            Some(power) => Rgb::from_array(bodies.rgb(heat(i).max(BlackBodies::COOLEST))) * *power,
            None => Rgb::from_array(bodies.rgb(heat(i))),
        };
        let colors = (0..COLORS).map(color).collect();
        let per_value = if hottest > 0.0 { last / hottest } else { 0.0 };
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
                waves.map(|nm| self.bodies.at(nm, kelvin.max(BlackBodies::COOLEST))) * power
            }
        }
    }
}

const C2: f32 = SECOND_RADIATION_CONSTANT as f32;

/// The light of black bodies by Planck's law, relative to D65 and to the luminance of one of a reference temperature.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBodies {
    reference: Curve,
    kelvin: f32,
}

/// 1 / (exp(x) - 1).
fn occupation(x: f32) -> f32 {
    // The polynomial ends at the least normal number.
    if x > 87.0 { 0.0 } else { poly::exp(-x) / (1.0 - poly::exp(-x)).max(f32::MIN_POSITIVE) }
}

impl BlackBodies {
    /// Cooler ones, of which next to nothing is seen, have the colour of this, in kelvins.
    pub const COOLEST: f32 = 800.0;

    /// Black bodies scaled to a luminance of 1 at a temperature in kelvins.
    pub fn relative_to(kelvin: f32) -> BlackBodies {
        BlackBodies { reference: Curve::black_body(kelvin.into(), 1.0), kelvin }
    }

    /// At a wavelength in nanometres and a temperature in kelvins; nothing at 0.
    #[inline]
    pub fn at(&self, nm: f32, kelvin: f32) -> f32 {
        if kelvin <= 0.0 {
            return 0.0;
        }
        self.reference.at(nm) * (occupation(C2 / (nm * kelvin)) / occupation(C2 / (nm * self.kelvin)))
    }

    /// What takes one of a temperature to a luminance that goes by the fourth power of the temperature, 1 at the reference; beside
    /// [`BlackBodies::at`] of the same temperature, or of `COOLEST` below that.
    pub fn power_over_luminance(&self, kelvin: f32) -> f32 {
        let seen = kelvin.max(BlackBodies::COOLEST);
        let luminance = luminance(rgb_of(|nm| f64::from(self.at(nm as f32, seen))).map(|v| v as f32));
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

    /// Mean free paths on a ray, by quadrature.
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
    fn no_ray_finds_a_grid_beyond_single_precision() {
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
    fn collisions_and_what_is_left_follow_the_density() {
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
                let (mut left, mut passed) = (0.0, 0.0);
                for i in 0..n {
                    let salt = hash32(i);
                    left += f64::from(grid.transmittance(&ray, 0.0, to, salt));
                    let first = unit(hash32(i ^ 0x5bd1_e995));
                    let t = grid.collision(&ray, [0.0, to], first, salt, |_, _| true);
                    passed += f64::from(u8::from(t == f32::INFINITY));
                    assert!(t == f32::INFINITY || (0.0..=to).contains(&t));
                }
                let n = f64::from(n);
                let error = (truth * (1.0 - truth) / n).sqrt().max(1e-4);
                assert!((left / n - truth).abs() < 4.5 * error, "left {} {truth}", left / n);
                assert!((passed / n - truth).abs() < 4.5 * error, "passed {} {truth}", passed / n);
            }
        }
    }

    /// Means of the estimate are the integral, whole and in part.
    #[test]
    fn integrals_of_the_density() {
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

    /// A millimetre of dense smoke beside nothing, seen from so far away that the way's numbers are coarser than its mean
    /// free paths.
    #[test]
    fn dense_grids_far_away() {
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
    fn one_voxel_and_rays_beside_the_grid() {
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
    fn light_is_that_of_curves_and_grows_by_planck() {
        let bodies = BlackBodies::relative_to(1500.0);
        for kelvin in [900.0, 1500.0, 2500.0, 6500.0] {
            let curve = Curve::black_body(kelvin, 1.0);
            let own =
                luminance(rgb_of(|nm| f64::from(bodies.at(nm as f32, kelvin as f32))).map(|v| v as f32));
            for nm in [420.0, 507.0, 561.0, 650.0] {
                let ratio = bodies.at(nm, kelvin as f32) / own / curve.at(nm);
                assert!((ratio - 1.0).abs() < 1e-3, "{kelvin} K, {nm} nm: {ratio}");
            }
        }
        // Radiances at one wavelength: exp(C2 / (l T)) decides.
        let c2 = SECOND_RADIATION_CONSTANT;
        let wanted = (c2 / (600.0 * 1500.0)).exp_m1() / (c2 / (600.0 * 2000.0)).exp_m1();
        let found = bodies.at(600.0, 2000.0) / bodies.at(600.0, 1500.0);
        assert!((f64::from(found) / wanted - 1.0).abs() < 1e-5, "{found} {wanted}");
        assert_eq!(bodies.at(600.0, 0.0), 0.0);
        for (kelvin, seen, wanted) in [(1500.0, 1500.0, 1.0), (3000.0, 3000.0, 16.0), (150.0, 800.0, 1e-4)] {
            let own = luminance(rgb_of(|nm| f64::from(bodies.at(nm as f32, seen))).map(|v| v as f32));
            let power = bodies.power_over_luminance(kelvin) * own;
            assert!((power / wanted - 1.0).abs() < 1e-3, "{kelvin} K: {power}");
        }
        assert!(bodies.at(780.0, 1e6).is_finite() && bodies.at(380.0, 1.0) == 0.0);
    }
}
