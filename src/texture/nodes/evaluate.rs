//! Runs the steps of compiled node graphs, for several points at a time.

use super::color::{self, Table};
use super::math;
use super::noise::{self, Fractal, NoisePoints, NoiseTexture, noise_textures};
use super::noise::{hash_floats, hash_to_vector};
use super::patterns::{self, BrickPattern, Wave, WaveNoise};
use super::source::{Source, from_node_world, to_node_world};
use super::traced::{AmbientOcclusion, bevel};
use super::voronoi::Voronoi;
use crate::color::luminance;
use crate::scene::TextureId;
use crate::scene::nodes::{
    ClampType, Dimensions, EnvironmentProjection, FactorMode, ImageProjection, MixType, NodeKind, NoiseType,
    NormalSpace, RampInterpolation, TransformType,
};
use crate::texture::image::ImageSampling;
use crate::texture::{HitData, TexturePoint};

/// Linear RGBA of an image at texture coordinates, with a filter width in these.
pub(super) type ReadImage<'a> = dyn Fn(TextureId, &ImageSampling, [f32; 2], f32) -> [f32; 4] + 'a;

/// The input of one evaluation: points and access to their data.
pub struct Points<'a> {
    /// The points, at most as many as registers have lanes; `world` is in the original scene's world space.
    pub points: &'a [TexturePoint],
    /// Hit data by point; missing ones count as `None`.
    pub hits: &'a [Option<&'a HitData<'a>>],
    /// World-space vectors of the graph have z up, as in Blender.
    pub is_z_up: bool,
    /// Linear RGBA of a texture at the point with an index.
    pub textures: &'a dyn Fn(TextureId, usize) -> [f32; 4],
    /// Linear RGBA of an image.
    pub images: &'a ReadImage<'a>,
}

/// The operation of a step.
#[derive(Clone, Debug)]
pub enum Operation {
    /// Reads data of the point.
    Load(Source),
    /// Reads data at an offset along the surface, for derivatives: index of the step, and fraction of it.
    LoadOffset {
        source: Source,
        step: usize,
        fraction: f32,
    },
    NormalMap(NormalSpace),
    /// Normal of a bump map.
    Bump {
        invert: bool,
        filter_width: f32,
    },
    /// Transforms a vector by an affine transform given by three rows.
    Transform(TransformType),
    /// Multiplies a vector by the transposed linear part of such a transform.
    Transposed,
    /// Transforms a point by a constant affine transform.
    Affine([f32; 12]),
    /// Normalizes a vector.
    Normalize,
    /// Length of a vector.
    Length,
    /// Absolute cosine between two unit vectors.
    Cosine,
    /// Reads an image texture for a vector, a filter width, and an object-space normal for box projection.
    Image {
        texture: TextureId,
        sampling: ImageSampling,
        projection: ImageProjection,
        blend: f32,
    },
    /// Reads an environment texture in a direction.
    Environment {
        texture: TextureId,
        sampling: ImageSampling,
        projection: EnvironmentProjection,
    },
    /// Unoccluded fraction of rays within a distance around a normal.
    AmbientOcclusion(AmbientOcclusion),
    /// Normal of rounded edges, for a radius and a normal.
    Bevel {
        samples: u32,
    },
    /// 1 within half a line width, in metres or in pixels, of an edge of the triangle.
    Wireframe {
        in_pixels: bool,
    },
    /// The mean of three numbers.
    Mean,
    /// The luminance of a colour.
    Luminance,
    /// A function of the inputs, by node type.
    Node(NodeKind),
    /// A colour ramp.
    Ramp {
        table: Table<4>,
        interpolation: RampInterpolation,
    },
    /// Curves of three components.
    Curves {
        table: Table<3>,
        min: f32,
        max: f32,
        extrapolate: bool,
    },
    /// A curve of a scalar.
    Curve {
        table: Table<1>,
        min: f32,
        max: f32,
        extrapolate: bool,
    },
}

/// Samples of a colour ramp, as in Cycles.
const RAMP_SAMPLES: usize = 256;

impl Operation {
    /// Does its result depend on more than its inputs: data of points, or textures?
    pub fn reads_external_data(&self) -> bool {
        matches!(
            self,
            Operation::Load(_)
                | Operation::LoadOffset { .. }
                | Operation::Image { .. }
                | Operation::Environment { .. }
        ) || self.traces_rays()
    }

    /// Does it trace rays into the scene?
    pub fn traces_rays(&self) -> bool {
        matches!(self, Operation::AmbientOcclusion(_) | Operation::Bevel { .. })
    }

    pub fn of(kind: &NodeKind) -> Operation {
        match kind {
            NodeKind::ColorRamp { stops, interpolation } => {
                Operation::Ramp { table: ramp(&stops.0, *interpolation), interpolation: *interpolation }
            }
            NodeKind::RgbCurves { table, min, max, extrapolate }
            | NodeKind::VectorCurves { table, min, max, extrapolate } => {
                let values = table.0.iter().map(|row| [row[0], row[1], row[2]]).collect();
                Operation::Curves { table: Table { values }, min: *min, max: *max, extrapolate: *extrapolate }
            }
            NodeKind::FloatCurve { table, min, max, extrapolate } => {
                let values = table.0.iter().map(|row| [row[0]]).collect();
                Operation::Curve { table: Table { values }, min: *min, max: *max, extrapolate: *extrapolate }
            }
            _ => Operation::Node(kind.clone()),
        }
    }
}

/// Evenly spaced samples of a ramp with the given stops (position, RGBA).
fn ramp(stops: &[Vec<f32>], interpolation: RampInterpolation) -> Table<4> {
    let mut stops: Vec<[f32; 5]> = stops.iter().map(|s| [s[0], s[1], s[2], s[3], s[4]]).collect();
    stops.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let at = |x: f32| -> [f32; 4] {
        let color = |s: &[f32; 5]| [s[1], s[2], s[3], s[4]];
        let next = stops.iter().position(|s| s[0] > x);
        match next {
            Some(0) => color(&stops[0]),
            None => color(&stops[stops.len() - 1]),
            Some(i) => {
                let (a, b) = (stops[i - 1], stops[i]);
                let t = if interpolation == RampInterpolation::Constant {
                    0.0
                } else {
                    (x - a[0]) / (b[0] - a[0])
                };
                std::array::from_fn(|k| (1.0 - t) * a[k + 1] + t * b[k + 1])
            }
        }
    };
    Table { values: (0..RAMP_SAMPLES).map(|i| at(i as f32 / (RAMP_SAMPLES - 1) as f32)).collect() }
}

/// The register number of an unused output.
pub const UNUSED: u16 = u16::MAX;

/// A step of a program after register allocation.
#[derive(Clone, Debug)]
pub struct CompiledStep {
    pub operation: Operation,
    /// Input registers.
    pub inputs: Vec<u16>,
    /// Output registers, or [`UNUSED`].
    pub outputs: Vec<u16>,
}

/// The registers of a program, with a lane for each point.
#[derive(Debug, Default)]
pub struct Registers<const LANES: usize> {
    values: Vec<[f32; LANES]>,
    /// Number of lanes in use.
    lanes: usize,
    noise_points: NoisePoints,
}

impl<const LANES: usize> Registers<LANES> {
    /// Prepares `count` registers for a number of points, and sets the constants.
    pub fn prepare(&mut self, count: usize, constants: &[(u16, f32)], lanes: usize) {
        self.lanes = lanes.min(LANES);
        if self.values.len() < count {
            self.values.resize(count, [0.0; LANES]);
        }
        for &(register, value) in constants {
            self.values[register as usize] = [value; LANES];
        }
    }

    /// The value of a register at a point.
    pub fn at(&self, register: u16, lane: usize) -> f32 {
        self.values[register as usize][lane]
    }

    /// The inputs of a step at a point.
    fn inputs<const I: usize>(&self, step: &CompiledStep, lane: usize) -> [f32; I] {
        std::array::from_fn(|i| self.at(step.inputs[i], lane))
    }

    /// Sets the outputs of a step at a point.
    fn set(&mut self, step: &CompiledStep, lane: usize, values: &[f32]) {
        for (&register, &value) in step.outputs.iter().zip(values) {
            if register != UNUSED {
                self.values[register as usize][lane] = value;
            }
        }
    }

    /// Applies a function of `I` scalars with `O` results to all lanes.
    #[inline(always)]
    fn each<const I: usize, const O: usize>(
        &mut self,
        step: &CompiledStep,
        f: impl Fn([f32; I]) -> [f32; O],
    ) {
        let mut results = [[0.0f32; LANES]; O];
        let inputs: [&[f32; LANES]; I] = std::array::from_fn(|i| &self.values[step.inputs[i] as usize]);
        for lane in 0..self.lanes.min(LANES) {
            let values = f(std::array::from_fn(|i| inputs[i][lane]));
            for (result, value) in results.iter_mut().zip(values) {
                result[lane] = value;
            }
        }
        for (&register, result) in step.outputs.iter().zip(&results) {
            if register != UNUSED {
                self.values[register as usize] = *result;
            }
        }
    }
}

/// The outputs of an operation with constant inputs, which must not read external data.
pub fn fold(operation: &Operation, inputs: &[f32], outputs: u32) -> Vec<f32> {
    let constants: Vec<(u16, f32)> = inputs.iter().enumerate().map(|(i, &v)| (i as u16, v)).collect();
    let first = inputs.len() as u16;
    let mut registers = Registers::<1>::default();
    registers.prepare(inputs.len() + outputs as usize, &constants, 1);
    let outputs: Vec<u16> = (first..first + outputs as u16).collect();
    let step =
        CompiledStep { operation: operation.clone(), inputs: (0..first).collect(), outputs: outputs.clone() };
    run(
        &step,
        &Points {
            points: &[],
            hits: &[],
            is_z_up: false,
            textures: &|_, _| [0.0; 4],
            images: &|_, _, _, _| [0.0; 4],
        },
        &mut registers,
    );
    outputs.into_iter().map(|register| registers.at(register, 0)).collect()
}

/// Transforms the vector (x, y, z, w) by the rows of an affine transform.
fn affine(rows: &[f32], [x, y, z]: [f32; 3], w: f32) -> [f32; 3] {
    std::array::from_fn(|i| rows[4 * i] * x + rows[4 * i + 1] * y + rows[4 * i + 2] * z + rows[4 * i + 3] * w)
}

/// Runs a load step: reads data of each point.
fn load<const LANES: usize>(step: &CompiledStep, points: &Points<'_>, r: &mut Registers<LANES>) {
    for lane in 0..points.points.len() {
        let texture = |id| (points.textures)(id, lane);
        let (mut point, hit) = (points.points[lane], points.hits.get(lane).copied().flatten());
        let mut moved = None;
        let source = match step.operation {
            Operation::LoadOffset { source, step, fraction } => {
                if let Some(hit) = hit {
                    let along = hit.steps(&point)[step] * fraction;
                    let (offset_point, offset_hit) = hit.moved(&point, along);
                    point = offset_point;
                    moved = Some(offset_hit);
                }
                source
            }
            Operation::Load(source) => source,
            _ => return,
        };
        r.set(step, lane, &source.read(&point, moved.as_ref().or(hit), points.is_z_up, texture));
    }
}

/// Runs a step that traces rays from each point.
fn trace<const LANES: usize>(step: &CompiledStep, points: &Points<'_>, r: &mut Registers<LANES>) {
    for lane in 0..points.points.len() {
        let hit = points.hits.get(lane).copied().flatten();
        let [size, x, y, z] = r.inputs(step, lane);
        let normal = from_node_world([x, y, z], points.is_z_up);
        match &step.operation {
            Operation::AmbientOcclusion(node) => r.set(step, lane, &[node.at(hit, size, normal)]),
            Operation::Bevel { samples } => {
                let bevelled = bevel(hit, *samples, size, normal);
                r.set(step, lane, &to_node_world(bevelled, points.is_z_up).to_array());
            }
            _ => {}
        }
    }
}

pub fn run<const LANES: usize>(step: &CompiledStep, points: &Points<'_>, r: &mut Registers<LANES>) {
    match &step.operation {
        Operation::Load(_) | Operation::LoadOffset { .. } => load(step, points, r),
        Operation::NormalMap(space) => r.each(step, |v: [f32; 30]| math::normal_map(*space, &v)),
        Operation::Bump { invert, filter_width } => {
            r.each(step, |v: [f32; 14]| math::bump(*invert, *filter_width, &v));
        }
        Operation::Transform(TransformType::Point) => {
            r.each(step, |v: [f32; 15]| affine(&v[3..], [v[0], v[1], v[2]], 1.0))
        }
        Operation::Transform(_) => r.each(step, |v: [f32; 15]| affine(&v[3..], [v[0], v[1], v[2]], 0.0)),
        Operation::Transposed => r.each(step, |v: [f32; 15]| {
            std::array::from_fn::<f32, 3, _>(|i| v[3 + i] * v[0] + v[7 + i] * v[1] + v[11 + i] * v[2])
        }),
        Operation::Affine(rows) => r.each(step, |p: [f32; 3]| affine(rows, p, 1.0)),
        Operation::Normalize => r.each(step, |v: [f32; 3]| math::normalize(v)),
        Operation::Length => r.each(step, |[x, y, z]: [f32; 3]| [(x * x + y * y + z * z).sqrt()]),
        Operation::Cosine => r.each(step, |[a, b, c, x, y, z]: [f32; 6]| [(a * x + b * y + c * z).abs()]),
        Operation::Wireframe { in_pixels } => r.each(step, |[size, squared, pixel]: [f32; 3]| {
            let half = 0.5 * size * if *in_pixels { pixel } else { 1.0 };
            [if squared < half * half { 1.0 } else { 0.0 }]
        }),
        Operation::Image { texture, sampling, projection, blend } => r.each(step, |v: [f32; 7]| {
            let at = |uv, footprint| (points.images)(*texture, sampling, uv, footprint);
            math::image(*projection, *blend, v, at)
        }),
        Operation::Environment { texture, sampling, projection } => r.each(step, |direction: [f32; 3]| {
            let [r, g, b, _] =
                (points.images)(*texture, sampling, math::environment(*projection, direction), 0.0);
            [r, g, b]
        }),
        Operation::AmbientOcclusion(_) | Operation::Bevel { .. } => trace(step, points, r),
        Operation::Mean => r.each(step, |[x, y, z]: [f32; 3]| [(x + y + z) * (1.0 / 3.0)]),
        Operation::Luminance => r.each(step, |c: [f32; 3]| [luminance(c)]),
        Operation::Ramp { table, interpolation: RampInterpolation::Linear } => {
            r.each(step, |[x]: [f32; 1]| [0, 1, 2, 3].map(|i| table.at(x, i)));
        }
        Operation::Ramp { table, interpolation: RampInterpolation::Constant } => {
            r.each(step, |[x]: [f32; 1]| [0, 1, 2, 3].map(|i| table.below(x, i)));
        }
        Operation::Curves { table, min, max, extrapolate } => {
            r.each(step, |[factor, a, b, c]: [f32; 4]| {
                let new = |old: f32, i: usize| table.curve((old - min) / (max - min), i, *extrapolate);
                let mix = |old: f32, i: usize| (1.0 - factor) * old + factor * new(old, i);
                [mix(a, 0), mix(b, 1), mix(c, 2)]
            });
        }
        Operation::Curve { table, min, max, extrapolate } => r.each(step, |[factor, old]: [f32; 2]| {
            let new = table.curve((old - min) / (max - min), 0, *extrapolate);
            [(1.0 - factor) * old + factor * new]
        }),
        Operation::Node(kind) => run_math_node(kind, step, r),
    }
}

fn run_math_node<const LANES: usize>(kind: &NodeKind, step: &CompiledStep, r: &mut Registers<LANES>) {
    match *kind {
        NodeKind::Math { operation, use_clamp } => r.each(step, |[a, b, c]: [f32; 3]| {
            let value = math::scalar(operation, a, b, c);
            [if use_clamp { value.clamp(0.0, 1.0) } else { value }]
        }),
        NodeKind::VectorMath { operation } => r.each(step, |v: [f32; 10]| {
            let [a, b, c] = [0, 3, 6].map(|i| [v[i], v[i + 1], v[i + 2]]);
            let ([x, y, z], value) = math::vector(operation, a, b, c, v[9]);
            [x, y, z, value]
        }),
        NodeKind::Mix { data_type, factor_mode, blend_type, clamp_factor, clamp_result } => {
            r.each(step, |[f, fx, fy, fz, a, b, c, d, e, g]: [f32; 10]| {
                let (a, b) = ([a, b, c], [d, e, g]);
                let factors = if data_type == MixType::Vector && factor_mode == FactorMode::NonUniform {
                    [fx, fy, fz]
                } else {
                    [f; 3]
                };
                let factors = factors.map(|f| if clamp_factor { f.clamp(0.0, 1.0) } else { f });
                if data_type != MixType::Color {
                    return std::array::from_fn::<f32, 3, _>(|i| {
                        (1.0 - factors[i]) * a[i] + factors[i] * b[i]
                    });
                }
                let blended = color::blend(blend_type, factors[0], a, b);
                if clamp_result { blended.map(|c| c.clamp(0.0, 1.0)) } else { blended }
            });
        }
        NodeKind::MapRange { clamp, interpolation_type } => r.each(step, |v: [f32; 18]| {
            std::array::from_fn::<f32, 3, _>(|i| {
                math::map_range(
                    interpolation_type,
                    clamp,
                    v[i],
                    [v[3 + i], v[6 + i]],
                    [v[9 + i], v[12 + i]],
                    v[15 + i],
                )
            })
        }),
        NodeKind::Clamp { clamp_type } => r.each(step, |[x, a, b]: [f32; 3]| {
            let (min, max) = if clamp_type == ClampType::Range && a > b { (b, a) } else { (a, b) };
            [x.max(min).min(max)]
        }),
        NodeKind::Mapping { vector_type } => r.each(step, |v: [f32; 12]| {
            let [p, location, rotation, scale] = [0, 3, 6, 9].map(|i| [v[i], v[i + 1], v[i + 2]]);
            math::mapping(vector_type, p, location, rotation, scale)
        }),
        NodeKind::VectorRotate { rotation_type, invert } => r.each(step, |v: [f32; 13]| {
            let [p, center, axis] = [0, 3, 6].map(|i| [v[i], v[i + 1], v[i + 2]]);
            math::rotate(rotation_type, invert, p, center, axis, v[9], [v[10], v[11], v[12]])
        }),
        _ => run_color_node(kind, step, r),
    }
}

fn run_color_node<const LANES: usize>(kind: &NodeKind, step: &CompiledStep, r: &mut Registers<LANES>) {
    match *kind {
        NodeKind::CombineColor { mode } => r.each(step, |c: [f32; 3]| color::combine(mode, c)),
        NodeKind::SeparateColor { mode } => r.each(step, |c: [f32; 3]| color::separate(mode, c)),
        NodeKind::HueSaturation {} => {
            r.each(step, |[h, s, v, f, a, b, c]: [f32; 7]| color::adjust([h, s, v], f, [a, b, c]));
        }
        NodeKind::BrightnessContrast {} => r.each(step, |[x, y, z, brightness, contrast]: [f32; 5]| {
            [x, y, z].map(|c| ((1.0 + contrast) * c + (brightness - contrast * 0.5)).max(0.0))
        }),
        NodeKind::Gamma {} => r.each(step, |[x, y, z, g]: [f32; 4]| [x, y, z].map(|c| color::gamma(c, g))),
        NodeKind::Invert {} => {
            r.each(step, |[f, x, y, z]: [f32; 4]| [x, y, z].map(|c| (1.0 - f) * c + f * (1.0 - c)));
        }
        NodeKind::Blackbody {} => r.each(step, |[kelvin]: [f32; 1]| color::black_body(kelvin)),
        NodeKind::Wavelength {} => r.each(step, |[nm]: [f32; 1]| color::wavelength(nm)),
        NodeKind::RgbToBw {} => r.each(step, |c: [f32; 3]| [luminance(c)]),
        NodeKind::Fresnel {} => {
            r.each(step, |[ior, cosine, is_back]: [f32; 3]| {
                let eta = ior.max(1e-5);
                [math::fresnel(cosine, if is_back != 0.0 { 1.0 / eta } else { eta })]
            });
        }
        NodeKind::LayerWeight {} => r.each(step, |[blend, cosine, is_back]: [f32; 3]| {
            let eta = (1.0 - blend).max(1e-5);
            let fresnel = math::fresnel(cosine, if is_back != 0.0 { eta } else { 1.0 / eta });
            [fresnel, math::facing(cosine, blend)]
        }),
        _ => run_noise_node(kind, step, r),
    }
}

fn run_noise_node<const LANES: usize>(kind: &NodeKind, step: &CompiledStep, r: &mut Registers<LANES>) {
    match *kind {
        NodeKind::NoiseTexture { dimensions, noise_type, normalize } => {
            let node = NoiseNode { step, noise_type, normalize };
            match dimensions {
                Dimensions::One => node.run(r, |[_, _, _, w]| [w]),
                Dimensions::Two => node.run(r, |[x, y, _, _]| [x, y]),
                Dimensions::Three => node.run(r, |[x, y, z, _]| [x, y, z]),
                Dimensions::Four => node.run(r, |p| p),
            }
        }
        NodeKind::VoronoiTexture { dimensions, distance, feature, normalize } => {
            r.each(step, |[x, y, z, w, scale, detail, roughness, lacunarity, smoothness, exponent, randomness]: [f32; 11]| {
                let voronoi = Voronoi {
                    feature,
                    metric: distance,
                    normalize,
                    detail: detail.clamp(0.0, 15.0),
                    roughness: roughness.clamp(0.0, 1.0),
                    lacunarity,
                    smoothness: (smoothness / 2.0).clamp(0.0, 0.5),
                    exponent,
                    randomness: randomness.clamp(0.0, 1.0),
                };
                voronoi_outputs(&voronoi, dimensions, [x, y, z, w].map(|c| c * scale), scale)
            });
        }
        NodeKind::GaborTexture { dimensions } => r.each(step, |v: [f32; 10]| {
            let [x, y, z] = [v[0], v[1], v[2]].map(|c| c * v[3]);
            let (frequency, isotropy) = (v[4].max(0.001), 1.0 - v[5].clamp(0.0, 1.0));
            match dimensions {
                Dimensions::Two => noise::gabor_2d([x, y], frequency, isotropy, v[6]),
                _ => noise::gabor_3d([x, y, z], frequency, isotropy, [v[7], v[8], v[9]]),
            }
        }),
        NodeKind::WhiteNoise { dimensions } => r.each(step, |[x, y, z, w]: [f32; 4]| {
            let (value, [a, b, c]) = match dimensions {
                Dimensions::One => (hash_floats([w]), hash_to_vector(&[w])),
                Dimensions::Two => (hash_floats([x, y]), hash_to_vector(&[x, y])),
                Dimensions::Three => (hash_floats([x, y, z]), hash_to_vector(&[x, y, z])),
                Dimensions::Four => (hash_floats([x, y, z, w]), hash_to_vector(&[x, y, z, w])),
            };
            [value, a, b, c]
        }),
        _ => run_pattern_node(kind, step, r),
    }
}

/// A step of a noise texture node.
struct NoiseNode<'a> {
    step: &'a CompiledStep,
    noise_type: NoiseType,
    normalize: bool,
}

impl NoiseNode<'_> {
    /// Evaluates the noise at all points together; `coordinates` selects those of the node's dimensions.
    fn run<const N: usize, const LANES: usize>(
        &self,
        r: &mut Registers<LANES>,
        coordinates: impl Fn([f32; 4]) -> [f32; N],
    ) {
        let NoiseNode { step, noise_type, normalize } = *self;
        let mut textures: [NoiseTexture<N>; LANES] = std::array::from_fn(|lane| {
            let [x, y, z, w, scale, detail, roughness, lacunarity, offset, gain, distortion] =
                r.inputs(step, lane);
            let (detail, roughness) = (detail.clamp(0.0, 15.0), roughness.max(0.0));
            let fractal = Fractal { noise_type, normalize, detail, roughness, lacunarity, offset, gain };
            NoiseTexture { p: coordinates([x, y, z, w].map(|c| c * scale)), distortion, fractal }
        });
        let has_color = step.outputs[1..].iter().any(|&register| register != UNUSED);
        let mut results = [[0.0; 4]; LANES];
        let lanes = r.lanes;
        noise_textures(&mut textures[..lanes], has_color, &mut r.noise_points, &mut results);
        for (lane, values) in results.iter().enumerate().take(lanes) {
            r.set(step, lane, values);
        }
    }
}

fn run_pattern_node<const LANES: usize>(kind: &NodeKind, step: &CompiledStep, r: &mut Registers<LANES>) {
    match *kind {
        NodeKind::WaveTexture { wave_type, bands_direction, rings_direction, wave_profile } => {
            let wave =
                Wave { wave_type, bands: bands_direction, rings: rings_direction, profile: wave_profile };
            for lane in 0..r.lanes {
                let [x, y, z, scale, distortion, detail, detail_scale, roughness, phase] =
                    r.inputs(step, lane);
                let noise =
                    WaveNoise { distortion, detail: detail.clamp(0.0, 15.0), detail_scale, roughness };
                let p = [x, y, z].map(|c| c * scale);
                let value = wave.evaluate(p, &noise, phase, &mut r.noise_points);
                r.set(step, lane, &[value; 4]);
            }
        }
        NodeKind::MagicTexture { turbulence_depth } => {
            r.each(step, |[x, y, z, scale, distortion]: [f32; 5]| {
                let [a, b, c] = patterns::magic([x, y, z], scale, turbulence_depth, distortion);
                [a, b, c, (a + b + c) * (1.0 / 3.0)]
            })
        }
        NodeKind::GradientTexture { gradient_type } => {
            r.each(step, |p: [f32; 3]| [patterns::gradient(gradient_type, p); 4]);
        }
        NodeKind::CheckerTexture {} => r.each(step, |v: [f32; 10]| {
            let fac = patterns::checker([v[0], v[1], v[2]].map(|c| c * v[9]));
            let first = if fac == 1.0 { 3 } else { 6 };
            [v[first], v[first + 1], v[first + 2], fac]
        }),
        NodeKind::BrickTexture { offset, offset_frequency, squash, squash_frequency } => {
            r.each(step, |v: [f32; 18]| {
                let [scale, mortar_size, mortar_smooth, bias, brick_width, row_height] =
                    [12, 13, 14, 15, 16, 17].map(|i| v[i]);
                let bricks = BrickPattern {
                    offset,
                    offset_frequency,
                    squash,
                    squash_frequency,
                    mortar_size,
                    mortar_smooth,
                    bias,
                    brick_width,
                    row_height,
                };
                let (tint, mortar) = bricks.evaluate(v[0] * scale, v[1] * scale);
                let color = |i: usize| {
                    (1.0 - mortar) * ((1.0 - tint) * v[3 + i] + tint * v[6 + i]) + mortar * v[9 + i]
                };
                [color(0), color(1), color(2), mortar]
            })
        }
        _ => unreachable!("{} is compiled away", kind.name()),
    }
}

/// Outputs of the Voronoi node: distance, colour, position, w, radius.
fn voronoi_outputs(
    voronoi: &Voronoi,
    dimensions: Dimensions,
    [x, y, z, w]: [f32; 4],
    scale: f32,
) -> [f32; 9] {
    fn with<const N: usize>(voronoi: &Voronoi, p: [f32; N], scale: f32) -> (f32, [f32; 3], [f32; N]) {
        let cell = voronoi.evaluate(p);
        (cell.distance, cell.color, cell.position.map(|x| if scale == 0.0 { 0.0 } else { x / scale }))
    }
    let (d, c, p, w) = match dimensions {
        Dimensions::One => {
            let (d, c, [w]) = with(voronoi, [w], scale);
            (d, c, [0.0; 3], w)
        }
        Dimensions::Two => {
            let (d, c, [x, y]) = with(voronoi, [x, y], scale);
            (d, c, [x, y, 0.0], 0.0)
        }
        Dimensions::Three => {
            let (d, c, p) = with(voronoi, [x, y, z], scale);
            (d, c, p, 0.0)
        }
        Dimensions::Four => {
            let (d, c, [x, y, z, w]) = with(voronoi, [x, y, z, w], scale);
            (d, c, [x, y, z], w)
        }
    };
    // The radius is stored as the distance, but is a separate output.
    [d, c[0], c[1], c[2], p[0], p[1], p[2], w, d]
}
