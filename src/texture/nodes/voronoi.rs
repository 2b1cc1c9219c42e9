//! Cellular textures (Worley 1996, "A Cellular Texture Basis Function") of one to four dimensions: distances to the nearest and second nearest
//! feature point (one at random in each cell), smooth distances, distances to cell borders (Quilez 2012, "Voronoi edges"), and fractal sums.

use super::noise::{cell_color, cell_point};
use crate::math::poly;
use crate::scene::nodes::{DistanceMetric, VoronoiFeature};
use crate::simd;

/// Settings of the Voronoi texture.
#[derive(Clone, Copy, Debug)]
pub struct Voronoi {
    pub feature: VoronoiFeature,
    pub metric: DistanceMetric,
    pub normalize: bool,
    pub detail: f32,
    pub roughness: f32,
    pub lacunarity: f32,
    /// 0..0.5.
    pub smoothness: f32,
    pub exponent: f32,
    /// 0..1.
    pub randomness: f32,
}

/// The texture's value at a point.
#[derive(Clone, Copy, Debug)]
pub struct Cell<const N: usize> {
    pub distance: f32,
    pub color: [f32; 3],
    pub position: [f32; N],
}

impl<const N: usize> Cell<N> {
    const ZERO: Cell<N> = Cell { distance: 0.0, color: [0.0; 3], position: [0.0; N] };

    fn map2(self, other: Cell<N>, f: impl Fn(f32, f32) -> f32) -> Cell<N> {
        Cell {
            distance: f(self.distance, other.distance),
            color: std::array::from_fn(|i| f(self.color[i], other.color[i])),
            position: std::array::from_fn(|i| f(self.position[i], other.position[i])),
        }
    }
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}

/// The cell of a point and the position within it, 0..1.
#[inline(always)]
fn split<const N: usize>(p: [f32; N]) -> ([f32; N], [f32; N]) {
    let (mut cell, mut inside) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        cell[i] = p[i].floor();
        inside[i] = p[i] - cell[i];
    }
    (cell, inside)
}

#[inline(always)]
fn dot<const N: usize>(a: [f32; N], b: [f32; N]) -> f32 {
    let mut sum = 0.0;
    for i in 0..N {
        sum += a[i] * b[i];
    }
    sum
}

#[inline(always)]
fn subtract<const N: usize>(a: [f32; N], b: [f32; N]) -> [f32; N] {
    std::array::from_fn(|i| a[i] - b[i])
}

#[inline(always)]
fn power(x: f32, y: f32) -> f32 {
    if x > 0.0 { poly::exp(y * poly::ln(x)) } else { 0.0 }
}

/// Offsets from a cell to those around it and itself, by dimension and cell, the first dimension fastest.
type Offsets<const CELLS: usize> = [[i32; CELLS]; 4];

/// Offsets of cells up to 1 away: 3^N in N dimensions.
const ADJACENT: Offsets<81> = offsets(3);
/// Offsets of cells up to 2 away, for smooth distances: 5^N in N dimensions.
const WITHIN_TWO: Offsets<625> = offsets(5);

const fn offsets<const CELLS: usize>(side: usize) -> Offsets<CELLS> {
    let (mut offsets, mut k) = ([[0; CELLS]; 4], 0);
    while k < CELLS {
        let (mut rest, mut i) = (k, 0);
        while i < 4 {
            offsets[i][k] = (rest % side) as i32 - side as i32 / 2;
            rest /= side;
            i += 1;
        }
        k += 1;
    }
    offsets
}

/// Offset to cell `k` of those up to 1 away.
#[inline(always)]
fn adjacent<const N: usize>(k: usize) -> [i32; N] {
    std::array::from_fn(|i| ADJACENT[i][k])
}

/// Computes the distances to the two nearest feature points, and the offsets to their cells.
struct Nearest<'a, const N: usize> {
    voronoi: &'a Voronoi,
    p: [f32; N],
}

impl<const N: usize> simd::Kernel for Nearest<'_, N> {
    type Output = [(f32, [i32; N]); 2];

    #[inline(always)]
    fn run(self) -> [(f32, [i32; N]); 2] {
        let (cell, local) = split(self.p);
        let count = 3usize.pow(N as u32);
        let distances = self.voronoi.distances(cell, local, &ADJACENT, count);
        let mut found = [(f32::MAX, 0); 2];
        for (k, &distance) in distances.iter().enumerate().take(count) {
            if distance < found[0].0 {
                found = [(distance, k), found[0]];
            } else if distance < found[1].0 {
                found[1] = (distance, k);
            }
        }
        found.map(|(distance, k)| (distance, adjacent(k)))
    }
}

/// Computes the nearest feature point, smoothly blended with others (Quilez 2014, "Smooth Voronoi").
struct Smooth<'a, const N: usize> {
    voronoi: &'a Voronoi,
    p: [f32; N],
}

impl<const N: usize> simd::Kernel for Smooth<'_, N> {
    type Output = Cell<N>;

    #[inline(always)]
    fn run(self) -> Cell<N> {
        let Voronoi { smoothness, .. } = *self.voronoi;
        let (cell, local) = split(self.p);
        let count = 5usize.pow(N as u32);
        let distances = self.voronoi.distances(cell, local, &WITHIN_TWO, count);
        let mut smooth = Cell::<N>::ZERO;
        for (k, &distance) in distances.iter().enumerate().take(count) {
            // Too far to be blended.
            if k > 0 && distance >= smooth.distance + smoothness {
                continue;
            }
            let t = (0.5 + 0.5 * (smooth.distance - distance) / smoothness).clamp(0.0, 1.0);
            let h = if k == 0 { 1.0 } else { t * t * (3.0 - 2.0 * t) };
            let correction = smoothness * h * (1.0 - h);
            let color_correction = correction / (1.0 + 3.0 * smoothness);
            let (point, other) = self.voronoi.point(cell, std::array::from_fn(|i| WITHIN_TWO[i][k]));
            let color = cell_color(other);
            smooth.distance = mix(smooth.distance, distance, h) - correction;
            smooth.color = std::array::from_fn(|i| mix(smooth.color[i], color[i], h) - color_correction);
            smooth.position =
                std::array::from_fn(|i| mix(smooth.position[i], point[i], h) - color_correction);
        }
        smooth.position = std::array::from_fn(|i| smooth.position[i] + cell[i]);
        smooth
    }
}

/// Computes the distance to the nearest cell border (Quilez 2012, "Voronoi edges"), in two and more dimensions.
struct Edge<'a, const N: usize> {
    voronoi: &'a Voronoi,
    p: [f32; N],
}

impl<const N: usize> simd::Kernel for Edge<'_, N> {
    type Output = f32;

    /// The loops have no branches, so that they vectorise.
    #[inline(always)]
    fn run(self) -> f32 {
        let (cell, local) = split(self.p);
        let count = 3usize.pow(N as u32);
        let vectors = self.voronoi.vectors(cell, local, &ADJACENT, count);
        let squared = lengths(&vectors, count, |d| dot(d, d));
        let mut nearest = 0;
        for (k, &distance) in squared.iter().enumerate().take(count) {
            if distance < squared[nearest] {
                nearest = k;
            }
        }
        let mut to_nearest = [0.0; N];
        for i in 0..N {
            to_nearest[i] = vectors[i][nearest];
        }
        let mut edges = [0.0f32; 81];
        for k in 0..count {
            let (mut across, mut middle) = ([0.0; N], [0.0; N]);
            for i in 0..N {
                across[i] = vectors[i][k] - to_nearest[i];
                middle[i] = (to_nearest[i] + vectors[i][k]) / 2.0;
            }
            let squared = dot(across, across);
            let edge = dot(middle, across) / squared.sqrt();
            edges[k] = if squared > 0.0001 { edge } else { f32::MAX };
        }
        edges.iter().take(count).fold(8.0, |minimum, &edge| minimum.min(edge))
    }
}

/// Applies `length` to the absolute components of `count` vectors, which are stored by component.
#[inline(always)]
fn lengths<const N: usize, const CELLS: usize>(
    vectors: &[[f32; CELLS]; N],
    count: usize,
    length: impl Fn([f32; N]) -> f32,
) -> [f32; CELLS] {
    let mut list = [0.0; CELLS];
    for k in 0..count {
        let mut d = [0.0; N];
        for i in 0..N {
            d[i] = vectors[i][k].abs();
        }
        list[k] = length(d);
    }
    list
}

impl Voronoi {
    /// The texture at a scaled point; only the distance is set for the features of edges and radii.
    pub fn evaluate<const N: usize>(&self, p: [f32; N]) -> Cell<N> {
        match self.feature {
            VoronoiFeature::SphereRadius => Cell { distance: self.sphere_radius(p), ..Cell::ZERO },
            VoronoiFeature::DistanceToEdge => Cell { distance: self.fractal_edge(p), ..Cell::ZERO },
            VoronoiFeature::F1 => self.fractal(p, 1.0, |p| self.nearest(p)[0]),
            VoronoiFeature::F2 => self.fractal(p, 2.0, |p| self.nearest(p)[1]),
            VoronoiFeature::SmoothF1 if self.smoothness == 0.0 => {
                self.fractal(p, 1.0, |p| self.nearest(p)[0])
            }
            VoronoiFeature::SmoothF1 => self.fractal(p, 1.0, |p| simd::dispatch(Smooth { voronoi: self, p })),
        }
    }

    #[inline(always)]
    fn distance<const N: usize>(&self, a: [f32; N], b: [f32; N]) -> f32 {
        self.length(subtract(a, b).map(f32::abs))
    }

    /// The length, by the metric, of a vector with absolute components `d`.
    #[inline(always)]
    fn length<const N: usize>(&self, d: [f32; N]) -> f32 {
        match self.metric {
            _ if N == 1 => d[0],
            DistanceMetric::Euclidean => dot(d, d).sqrt(),
            DistanceMetric::Manhattan => d.iter().sum(),
            DistanceMetric::Chebychev => {
                d.iter().fold(0.0, |maximum, &x| if x > maximum { x } else { maximum })
            }
            DistanceMetric::Minkowski => {
                power(d.iter().map(|&x| power(x, self.exponent)).sum(), 1.0 / self.exponent)
            }
        }
    }

    /// The feature point of the cell at an offset, relative to `cell`, and that cell.
    fn point<const N: usize>(&self, cell: [f32; N], offset: [i32; N]) -> ([f32; N], [i32; N]) {
        let other: [i32; N] = std::array::from_fn(|i| (cell[i] as i32).wrapping_add(offset[i]));
        let random = cell_point(other);
        (std::array::from_fn(|i| offset[i] as f32 + random[i] * self.randomness), other)
    }

    /// The nearest and the second nearest feature point.
    fn nearest<const N: usize>(&self, p: [f32; N]) -> [Cell<N>; 2] {
        simd::dispatch(Nearest { voronoi: self, p }).map(|(distance, offset)| {
            let cell = p.map(f32::floor);
            let (point, other) = self.point(cell, offset);
            Cell { distance, color: cell_color(other), position: std::array::from_fn(|i| point[i] + cell[i]) }
        })
    }

    /// Distances from a position in a cell to the feature points of `count` cells around.
    #[inline(always)]
    fn distances<const N: usize, const CELLS: usize>(
        &self,
        cell: [f32; N],
        local: [f32; N],
        offsets: &Offsets<CELLS>,
        count: usize,
    ) -> [f32; CELLS] {
        let vectors = self.vectors(cell, local, offsets, count);
        match self.metric {
            _ if N == 1 => lengths(&vectors, count, |d| d[0]),
            DistanceMetric::Euclidean => lengths(&vectors, count, |d| dot(d, d).sqrt()),
            DistanceMetric::Manhattan => lengths(&vectors, count, |d| d.iter().sum()),
            _ => lengths(&vectors, count, |d| self.length(d)),
        }
    }

    /// Vectors, by component, from a position in a cell to the feature points of `count` cells around. The loop has no branches,
    /// so that it vectorises.
    #[inline(always)]
    fn vectors<const N: usize, const CELLS: usize>(
        &self,
        cell: [f32; N],
        local: [f32; N],
        offsets: &Offsets<CELLS>,
        count: usize,
    ) -> [[f32; CELLS]; N] {
        let (mut vectors, mut own) = ([[0.0; CELLS]; N], [0; N]);
        for i in 0..N {
            own[i] = cell[i] as i32;
        }
        for k in 0..count {
            let mut other = [0; N];
            for i in 0..N {
                other[i] = own[i].wrapping_add(offsets[i][k]);
            }
            let random = cell_point(other);
            for i in 0..N {
                vectors[i][k] = offsets[i][k] as f32 + random[i] * self.randomness - local[i];
            }
        }
        vectors
    }

    /// Distance to the nearest cell border.
    fn edge<const N: usize>(&self, p: [f32; N]) -> f32 {
        if N > 1 {
            return simd::dispatch(Edge { voronoi: self, p });
        }
        let (cell, local) = split(p);
        let middle = self.point(cell, [0; N]).0[0];
        let (left, right) = (self.point(cell, [-1; N]).0[0], self.point(cell, [1; N]).0[0]);
        let to = |other: f32| ((middle + other) / 2.0 - local[0]).abs();
        to(left).min(to(right))
    }

    /// Half the distance between the nearest feature point and the feature point nearest to that one.
    fn sphere_radius<const N: usize>(&self, p: [f32; N]) -> f32 {
        let (cell, local) = split(p);
        let nearest_to = |from: [f32; N], cell: [f32; N], skip_own: bool| {
            let (mut minimum, mut found) = (8.0f32, ([0.0; N], [0; N]));
            for offset in (0..3usize.pow(N as u32)).map(adjacent::<N>) {
                if skip_own && offset == [0; N] {
                    continue;
                }
                let point = self.point(cell, offset).0;
                let d = subtract(point, from);
                let distance = dot(d, d).sqrt();
                if distance < minimum {
                    (minimum, found) = (distance, (point, offset));
                }
            }
            (minimum, found)
        };
        let (_, (_, offset)) = nearest_to(local, cell, false);
        let other: [f32; N] = std::array::from_fn(|i| cell[i] + offset[i] as f32);
        let own = self.point(other, [0; N]).0;
        nearest_to(own, other, true).0 / 2.0
    }

    /// Upper bound of the distance to the nearest feature point, for normalization.
    fn max_distance<const N: usize>(&self) -> f32 {
        self.distance([0.0; N], [0.5 + 0.5 * self.randomness; N])
    }

    fn is_single_octave(&self) -> bool {
        self.detail == 0.0 || self.roughness == 0.0 || self.lacunarity == 0.0
    }

    /// Weights of the octaves: 1, or a fraction for the last one.
    fn octaves(&self) -> impl Iterator<Item = f32> {
        let whole = self.detail.floor();
        let fraction = self.detail - whole;
        (0..=whole as u32).map(|_| 1.0).chain((fraction != 0.0).then_some(fraction))
    }

    fn fractal<const N: usize>(
        &self,
        p: [f32; N],
        distance_factor: f32,
        octave: impl Fn([f32; N]) -> Cell<N>,
    ) -> Cell<N> {
        let (mut scale, mut amplitude, mut maximum, mut sum) = (1.0, 1.0, 0.0, Cell::<N>::ZERO);
        if self.is_single_octave() {
            (sum, maximum) = (octave(p), 1.0);
        } else {
            for weight in self.octaves() {
                let found = octave(p.map(|x| x * scale));
                let mut next = sum.map2(found, |sum, x| sum + x * amplitude);
                next.position =
                    std::array::from_fn(|i| mix(sum.position[i], found.position[i] / scale, amplitude));
                maximum = mix(maximum, maximum + amplitude, weight);
                sum = sum.map2(next, |a, b| if weight == 1.0 { b } else { mix(a, b, weight) });
                scale *= self.lacunarity;
                amplitude *= self.roughness;
            }
        }
        if self.normalize {
            sum.distance /= maximum * distance_factor * self.max_distance::<N>();
            sum.color = sum.color.map(|c| c / maximum);
        }
        sum
    }

    fn fractal_edge<const N: usize>(&self, p: [f32; N]) -> f32 {
        let half = 0.5 + 0.5 * self.randomness;
        let (mut scale, mut amplitude, mut maximum, mut distance) = (1.0, 1.0, half, 8.0f32);
        if self.is_single_octave() {
            distance = self.edge(p);
        } else {
            for weight in self.octaves() {
                let found = self.edge(p.map(|x| x * scale)) / scale;
                maximum = mix(maximum, mix(maximum, half / scale, amplitude), weight);
                let nearer = mix(distance, distance.min(found), amplitude);
                distance = if weight == 1.0 { nearer } else { mix(distance, distance.min(nearer), weight) };
                scale *= self.lacunarity;
                amplitude *= self.roughness;
            }
        }
        if self.normalize { distance / maximum } else { distance }
    }
}
