//! Node graphs as flat programs: common subexpressions once, constants folded, unused steps removed, registers reused.

mod color;
mod evaluate;
mod math;
mod noise;
mod patterns;
mod source;
mod voronoi;

use super::image::ImageReading;
use super::{HitData, TexturePoint};
use crate::scene::TextureId;
use crate::scene::nodes::{
    Axis, ImageProjection, MathOperation, NodeGraph, NodeInput, NodeKind, SocketDefault, SocketType, Space,
    TangentType, TransformType, VectorOperation,
};
use evaluate::{Compiled, Operation, Points, ReadImage, Registers, UNUSED, fold, run};
use source::{FIRST_SET, Source};
use std::cell::Cell;
use std::collections::HashMap;

/// A number of a program before registers are given to them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Number {
    /// By its bits.
    Constant(u32),
    /// An output of a step.
    Result { step: u32, output: u32 },
}

impl Number {
    fn of(value: f32) -> Number {
        Number::Constant(value.to_bits())
    }
}

/// A step before registers are given.
struct Step {
    operation: Operation,
    inputs: Vec<Number>,
    outputs: u32,
}

/// A program that evaluates a graph at many points at a time.
#[derive(Clone, Debug)]
pub struct Program {
    steps: Vec<Compiled>,
    constants: Vec<(u16, f32)>,
    registers: usize,
    result: [u16; 3],
    is_z_up: bool,
}

impl Program {
    /// Compiles a graph; black if it has [problems](NodeGraph::problems). `attributes` are the names of the attributes of hits.
    pub fn new(graph: &NodeGraph, attributes: &[String]) -> Program {
        let mut builder = Builder { attributes, is_z_up: graph.is_z_up, ..Builder::default() };
        if !graph.problems().is_empty() {
            return builder.finish([Number::of(0.0); 3]);
        }
        let mut outputs: HashMap<usize, Vec<[Number; 3]>> = HashMap::new();
        for node in graph.order().unwrap_or_default() {
            let made = builder.node(graph, node, &outputs);
            outputs.insert(node, made);
        }
        let result = builder.input(graph, &graph.result, SocketType::Color, &outputs);
        builder.finish(result)
    }

    /// The result, if it is the same everywhere.
    pub fn constant(&self) -> Option<[f32; 3]> {
        let value = |register: u16| self.constants.iter().find(|c| c.0 == register).map(|c| c.1);
        let [r, g, b] = self.result.map(|register| value(register).map(reflectance));
        if self.steps.is_empty() { Some([r?, g?, b?]) } else { None }
    }

    /// Does the result differ with the direction from which a surface is seen?
    pub fn depends_on_viewer(&self) -> bool {
        self.sources().any(Source::depends_on_viewer)
    }

    /// Does it need more than a [`TexturePoint`] has?
    pub fn reads_hit(&self) -> bool {
        self.sources().any(Source::reads_hit)
    }

    /// Does it read tangents of the first texture coordinates?
    pub fn reads_tangents(&self) -> bool {
        self.sources().any(|source| matches!(source, Source::UvTangent | Source::Frame(FIRST_SET)))
    }

    /// Does it depend on the incident path?
    pub fn reads_path(&self) -> bool {
        self.sources().any(|source| source == Source::Path)
    }

    /// Does it read how wide a pixel is on the surface?
    pub fn reads_width(&self) -> bool {
        self.sources().any(|source| matches!(source, Source::Steps | Source::Edge))
    }

    /// Textures that it reads.
    pub fn textures(&self) -> impl Iterator<Item = TextureId> + '_ {
        self.steps.iter().filter_map(|step| match step.operation {
            Operation::Load(Source::Texture(texture))
            | Operation::Image { texture, .. }
            | Operation::Environment { texture, .. } => Some(texture),
            _ => None,
        })
    }

    fn sources(&self) -> impl Iterator<Item = Source> + '_ {
        self.steps.iter().filter_map(|step| match step.operation {
            Operation::Load(source) => Some(source),
            _ => None,
        })
    }

    /// The result at a point as it is; `hit` is what is known of it beyond that. `texture` gives linear RGBA of other textures there.
    pub fn at(
        &self,
        point: TexturePoint,
        hit: Option<&HitData<'_>>,
        texture: &dyn Fn(TextureId) -> [f32; 4],
        images: &ReadImage<'_>,
    ) -> [f32; 3] {
        thread_local! {
            /// Registers of the last evaluation; taken while one is under way, since textures may hold programs in turn.
            static REGISTERS: Cell<Registers<1>> = Cell::default();
        }
        let mut registers = REGISTERS.take();
        let textures = &|id, _| texture(id);
        let points = Points { points: &[point], hits: &[hit], is_z_up: self.is_z_up, textures, images };
        self.evaluate(&points, &mut registers);
        let result = self.result.map(|register| registers.at(register, 0));
        REGISTERS.set(registers);
        result
    }

    /// A result as a vector of the scene's world.
    pub fn as_vector(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        if self.is_z_up { [x, z, -y] } else { [x, y, z] }
    }

    /// Evaluates the program at points.
    fn evaluate<const LANES: usize>(&self, points: &Points<'_>, registers: &mut Registers<LANES>) {
        registers.prepare(self.registers, &self.constants);
        for step in &self.steps {
            run(step, points, registers);
        }
    }
}

/// The first three numbers of a source.
fn three(numbers: &[Number]) -> [Number; 3] {
    [numbers[0], numbers[1], numbers[2]]
}

/// A number as a vector.
fn one(number: Number) -> [Number; 3] {
    [number; 3]
}

/// Negative values and those that aren't numbers count as 0.
pub(super) fn reflectance(value: f32) -> f32 {
    if value > 0.0 && value.is_finite() { value } else { 0.0 }
}

#[derive(Default)]
struct Builder<'a> {
    steps: Vec<Step>,
    known: HashMap<(String, Vec<Number>), u32>,
    /// Names of the attributes of hits.
    attributes: &'a [String],
    is_z_up: bool,
    /// Offset of the points that nodes under construction read: along which step, by how much of it.
    beside: Option<(usize, f32)>,
    /// Bumps around what is built.
    bumps: u32,
}

/// Maximum number of bumps whose heights depend on another.
const MAX_BUMPS: u32 = 2;

impl Builder<'_> {
    /// Adds a step or finds the same one; folds it where all its inputs are constant.
    fn step(&mut self, operation: Operation, inputs: Vec<Number>, outputs: u32) -> Vec<Number> {
        let constants: Option<Vec<f32>> = inputs
            .iter()
            .map(|number| match number {
                Number::Constant(bits) => Some(f32::from_bits(*bits)),
                Number::Result { .. } => None,
            })
            .collect();
        if let (Some(constants), false) = (constants, operation.reads_images()) {
            let values = fold(&operation, &constants, outputs);
            return values.into_iter().map(Number::of).collect();
        }
        let next = self.steps.len() as u32;
        let step = *self.known.entry((format!("{operation:?}"), inputs.clone())).or_insert(next);
        if step == next {
            self.steps.push(Step { operation, inputs, outputs });
        }
        (0..outputs).map(|output| Number::Result { step, output }).collect()
    }

    fn load(&mut self, source: Source) -> Vec<Number> {
        let operation = match self.beside {
            Some((step, share)) if source.moves() => Operation::LoadMoved { source, step, share },
            _ => Operation::Load(source),
        };
        self.step(operation, Vec::new(), source.width())
    }

    fn load_vector(&mut self, source: Source) -> [Number; 3] {
        let numbers = self.load(source);
        [numbers[0], numbers[1], numbers[2]]
    }

    /// A value converted from one type to another.
    fn convert(&mut self, value: [Number; 3], from: SocketType, to: SocketType) -> [Number; 3] {
        match (from, to) {
            (SocketType::Float, SocketType::Vector | SocketType::Color) => [value[0]; 3],
            (SocketType::Vector, SocketType::Float) => [self.step(Operation::Mean, value.to_vec(), 1)[0]; 3],
            (SocketType::Color, SocketType::Float) => {
                [self.step(Operation::Luminance, value.to_vec(), 1)[0]; 3]
            }
            _ => value,
        }
    }

    /// The value of an input, as the type of its socket.
    fn input(
        &mut self,
        graph: &NodeGraph,
        input: &NodeInput,
        to: SocketType,
        outputs: &HashMap<usize, Vec<[Number; 3]>>,
    ) -> [Number; 3] {
        let value = match *input {
            NodeInput::Link { node, output } => outputs[&node][output],
            NodeInput::Texture { texture, alpha: true } => [self.load(Source::Texture(texture))[3]; 3],
            NodeInput::Texture { texture, alpha: false } => self.load_vector(Source::Texture(texture)),
            NodeInput::Value(value) => value.map(Number::of),
            NodeInput::Default => [Number::of(0.0); 3],
        };
        self.convert(value, graph.given_type(input, to), to)
    }

    /// The outputs of a node.
    fn node(
        &mut self,
        graph: &NodeGraph,
        index: usize,
        outputs: &HashMap<usize, Vec<[Number; 3]>>,
    ) -> Vec<[Number; 3]> {
        let node = &graph.nodes[index];
        let mut inputs = Vec::new();
        for (socket, input) in node.kind.inputs().iter().zip(&node.inputs) {
            let value = match (input, socket.default) {
                (NodeInput::Default, SocketDefault::Value(default)) => default.map(Number::of),
                (NodeInput::Default, SocketDefault::Position) => self.load_vector(Source::Position),
                (NodeInput::Default, SocketDefault::Uv) => self.load_vector(Source::Uv),
                // The cosine stands for it in others.
                (NodeInput::Default, SocketDefault::Normal) => match node.kind {
                    NodeKind::Bump { .. } => self.load_vector(Source::Normal),
                    _ => [Number::of(0.0); 3],
                },
                _ => self.input(graph, input, socket.kind, outputs),
            };
            inputs.push((socket.kind, value));
        }
        if let Some(texture) = node.image {
            return self.image(graph, index, texture, inputs[0].1);
        }
        if let NodeKind::Bump { invert, filter_width, object_scale } = node.kind {
            let distance = self.scaled_distance(&inputs, object_scale);
            return vec![self.bump(graph, index, &inputs, (distance, invert, filter_width))];
        }
        match self.sources_of(&node.kind, &inputs) {
            Some(outputs) => outputs,
            None => self.outputs_of(&node.kind, &inputs, node.inputs.last() == Some(&NodeInput::Default)),
        }
    }

    /// A normal that leans by the slope of heights, whose part of the graph is built once more for the point and for each of two beside.
    fn bump(
        &mut self,
        graph: &NodeGraph,
        index: usize,
        inputs: &[(SocketType, [Number; 3])],
        (distance, invert, filter_width): (Number, bool, f32),
    ) -> [Number; 3] {
        let (height, normal) = (graph.nodes[index].inputs[2], inputs[3].1);
        if self.bumps >= MAX_BUMPS || !matches!(height, NodeInput::Link { .. } | NodeInput::Texture { .. }) {
            return normal;
        }
        let mut flat = vec![inputs[0].1[0], distance];
        let outer = self.beside;
        self.bumps += 1;
        for beside in [outer, Some((0, filter_width)), Some((1, filter_width))] {
            self.beside = beside;
            let mut outputs: HashMap<usize, Vec<[Number; 3]>> = HashMap::new();
            for node in graph.order_of(&height).unwrap_or_default() {
                let made = self.node(graph, node, &outputs);
                outputs.insert(node, made);
            }
            flat.push(self.input(graph, &height, SocketType::Float, &outputs)[0]);
        }
        self.bumps -= 1;
        self.beside = outer;
        flat.extend(normal);
        flat.extend(self.load(Source::Steps));
        three(&self.step(Operation::Bump { invert, filter_width }, flat, 3))
    }

    /// The distance of a bump, multiplied by a power of the object's scale along the normal.
    fn scaled_distance(&mut self, inputs: &[(SocketType, [Number; 3])], power: f32) -> Number {
        let distance = inputs[1].1[0];
        if power == 0.0 {
            return distance;
        }
        let mut along = inputs[3].1.to_vec();
        along.extend(self.load(Source::WorldFromObject));
        let along = self.step(Operation::Transposed, along, 3);
        let scale = self.step(Operation::Length, along, 1)[0];
        let factor = self.math(MathOperation::Power, scale, Number::of(power));
        self.math(MathOperation::Multiply, distance, factor)
    }

    fn math(&mut self, operation: MathOperation, a: Number, b: Number) -> Number {
        let kind = NodeKind::Math { operation, use_clamp: false };
        self.step(Operation::Node(kind), vec![a, b, Number::of(0.0)], 1)[0]
    }

    /// The outputs of a node of images.
    fn image(
        &mut self,
        graph: &NodeGraph,
        index: usize,
        texture: TextureId,
        vector: [Number; 3],
    ) -> Vec<[Number; 3]> {
        let node = &graph.nodes[index];
        let Some(reading) = ImageReading::of(graph, index) else {
            return vec![[Number::of(0.0); 3]; node.kind.outputs().len()];
        };
        if let NodeKind::EnvironmentTexture { projection, .. } = &node.kind {
            let operation = Operation::Environment { texture, reading, projection: *projection };
            return vec![three(&self.step(operation, vector.to_vec(), 3))];
        }
        let (projection, blend) = match &node.kind {
            NodeKind::ImageTexture { projection, blend, .. } => (*projection, *blend),
            _ => (ImageProjection::Flat, 0.0),
        };
        let zero = Number::of(0.0);
        let mut flat = vector.to_vec();
        flat.push(match graph.texture_coordinates(&node.inputs[0]) {
            // Heights are those of points, as in Cycles: slopes are steeper than those of averages.
            Some((name, factor)) if projection == ImageProjection::Flat && self.bumps == 0 => {
                let footprint = self.load(Source::Footprint(self.attribute(name)));
                let scale = NodeKind::Math { operation: MathOperation::Multiply, use_clamp: false };
                self.step(Operation::of(&scale), vec![footprint[0], Number::of(factor), zero], 1)[0]
            }
            _ => zero,
        });
        flat.extend(match projection {
            ImageProjection::Box => self.load_vector(Source::ObjectNormal),
            _ => [zero; 3],
        });
        let own = self.step(Operation::Image { texture, reading, projection, blend }, flat, 4);
        vec![three(&own), one(own[3])]
    }

    /// The number of an attribute; one that nothing has where there is no name.
    fn attribute(&self, name: &str) -> u16 {
        self.attributes.iter().position(|known| known == name).map_or(u16::MAX, |number| number as u16)
    }

    /// The outputs of nodes that read of hits; `None` of others.
    fn sources_of(
        &mut self,
        kind: &NodeKind,
        inputs: &[(SocketType, [Number; 3])],
    ) -> Option<Vec<[Number; 3]>> {
        self.surface_sources(kind).or_else(|| self.other_sources(kind, inputs))
    }

    /// The sources of coordinates and attributes.
    fn surface_sources(&mut self, kind: &NodeKind) -> Option<Vec<[Number; 3]>> {
        let generated = self.attribute("generated");
        Some(match kind {
            NodeKind::TextureCoordinate { object_matrix } => {
                let [uv, generated, normal, object, camera, window, reflection] = [
                    Source::Uv,
                    Source::Generated(generated),
                    Source::ObjectNormal,
                    Source::ObjectPoint,
                    Source::CameraPoint,
                    Source::Window,
                    Source::Reflection,
                ]
                .map(|source| self.load_vector(source));
                let object = match object_matrix.0 {
                    Some(rows) => {
                        let position = self.load_vector(Source::Position);
                        three(&self.step(Operation::Affine(rows), position.to_vec(), 3))
                    }
                    None => object,
                };
                vec![uv, generated, normal, object, camera, window, reflection]
            }
            NodeKind::Geometry {} => {
                let vectors = [
                    Source::Position,
                    Source::TrueNormal,
                    Source::Normal,
                    Source::Radial(Axis::Z, generated),
                    Source::Incoming,
                    Source::Parametric,
                ];
                let mut outputs = vectors.map(|source| self.load_vector(source)).to_vec();
                outputs.push(one(self.load(Source::Backfacing)[0]));
                for name in ["pointiness", "random_per_island"] {
                    let number = self.attribute(name);
                    outputs.push(one(self.load(Source::Attribute(number))[4]));
                }
                outputs
            }
            NodeKind::Attribute { name } => {
                let own = self.load(Source::Attribute(self.attribute(name)));
                vec![three(&own), three(&own), one(own[4]), one(own[3])]
            }
            NodeKind::ColorAttribute { name } => {
                let own = self.load(Source::Attribute(self.attribute(name)));
                vec![three(&own), one(own[3])]
            }
            NodeKind::UvMap { name } => vec![self.load_vector(match self.attribute(name) {
                FIRST_SET => Source::Uv,
                number => Source::UvMap(number),
            })],
            _ => return None,
        })
    }

    /// The sources of the object, the camera and the path.
    fn other_sources(
        &mut self,
        kind: &NodeKind,
        inputs: &[(SocketType, [Number; 3])],
    ) -> Option<Vec<[Number; 3]>> {
        Some(match kind {
            NodeKind::ObjectInfo {} => {
                let own = self.load(Source::Object);
                let mut outputs = vec![three(&own), three(&own[3..])];
                outputs.extend([6, 7, 8, 9].map(|i| one(own[i])));
                outputs
            }
            NodeKind::CameraData {} => {
                let point = self.load_vector(Source::CameraPoint);
                let direction = self.step(Operation::Normalize, point.to_vec(), 3);
                let distance = self.step(Operation::Length, point.to_vec(), 1);
                vec![three(&direction), one(point[2]), one(distance[0])]
            }
            NodeKind::LightPath {} => self.load(Source::Path).into_iter().map(one).collect(),
            NodeKind::HairInfo {} => {
                let own = self.load(Source::Strand);
                vec![one(own[0]), one(own[1]), one(own[2]), one(own[3]), three(&own[4..]), one(own[7])]
            }
            NodeKind::Tangent { direction_type, axis } => vec![self.load_vector(match direction_type {
                TangentType::Radial => Source::Radial(*axis, self.attribute("generated")),
                TangentType::UvMap => Source::UvTangent,
            })],
            NodeKind::Wireframe { use_pixel_size } => {
                let edge = self.load(Source::Edge);
                let inputs = vec![inputs[0].1[0], edge[0], edge[1]];
                vec![one(self.step(Operation::IsNear { in_pixels: *use_pixel_size }, inputs, 1)[0])]
            }
            NodeKind::NormalMap { space, uv_map } => {
                let number = if uv_map.is_empty() { FIRST_SET } else { self.attribute(uv_map) };
                let mut flat = vec![inputs[0].1[0]];
                flat.extend(inputs[1].1);
                flat.extend(self.load(Source::Frame(number)));
                flat.extend(self.load_vector(Source::Normal));
                flat.extend(self.load(Source::ObjectFromWorld));
                flat.extend(self.load(Source::Backfacing));
                vec![three(&self.step(Operation::NormalMap(*space), flat, 3))]
            }
            NodeKind::Normal { direction } => {
                let direction = self.step(Operation::Normalize, direction.0.map(Number::of).to_vec(), 3);
                let given = self.step(Operation::Normalize, inputs[0].1.to_vec(), 3);
                let dot = NodeKind::VectorMath { operation: VectorOperation::Dot };
                let mut flat = [&direction[..], &given].concat();
                flat.extend([Number::of(0.0); 4]);
                vec![three(&direction), one(self.step(Operation::of(&dot), flat, 4)[3])]
            }
            NodeKind::VectorTransform { vector_type, convert_from, convert_to } => {
                vec![self.transformed(*vector_type, [*convert_from, *convert_to], inputs[0].1)]
            }
            _ => return None,
        })
    }

    /// A vector from one space to another, by way of the world.
    fn transformed(
        &mut self,
        what: TransformType,
        [from, to]: [Space; 2],
        vector: [Number; 3],
    ) -> [Number; 3] {
        // Normals go to and from objects by the transposed inverse, and have unit length afterwards.
        let mut vector = vector;
        let is_normal = what == TransformType::Normal;
        let steps = [
            match from {
                Space::World => None,
                Space::Object if is_normal => Some(Source::ObjectFromWorld),
                Space::Object => Some(Source::WorldFromObject),
                Space::Camera => Some(Source::WorldFromCamera),
            },
            match to {
                Space::World => None,
                Space::Object if is_normal => Some(Source::WorldFromObject),
                Space::Object => Some(Source::ObjectFromWorld),
                Space::Camera => Some(Source::CameraFromWorld),
            },
        ];
        for source in steps.into_iter().flatten().filter(|_| from != to) {
            let mut inputs = vector.to_vec();
            inputs.extend(self.load(source));
            let of_object = matches!(source, Source::ObjectFromWorld | Source::WorldFromObject);
            let operation = match is_normal && of_object {
                true => Operation::Transposed,
                false => Operation::Transform(what),
            };
            let made = self.step(operation, inputs, 3);
            vector = [made[0], made[1], made[2]];
        }
        if is_normal {
            let made = self.step(Operation::Normalize, vector.to_vec(), 3);
            vector = [made[0], made[1], made[2]];
        }
        vector
    }

    fn outputs_of(
        &mut self,
        kind: &NodeKind,
        inputs: &[(SocketType, [Number; 3])],
        has_default_normal: bool,
    ) -> Vec<[Number; 3]> {
        let value = |i: usize| inputs[i].1;
        match kind {
            // Names for what is there, without a step.
            NodeKind::Value {} | NodeKind::Rgb {} => vec![value(0)],
            NodeKind::CombineXyz {} => vec![[value(0)[0], value(1)[0], value(2)[0]]],
            NodeKind::SeparateXyz {} => value(0).map(|number| [number; 3]).to_vec(),
            _ => {
                let mut flat = Vec::new();
                for (kind, value) in inputs {
                    flat.extend_from_slice(if *kind == SocketType::Float { &value[..1] } else { &value[..] });
                }
                if let NodeKind::Fresnel {} | NodeKind::LayerWeight {} = kind {
                    // In place of the normal: the cosine, and the side that is seen.
                    let normal = flat.split_off(1);
                    let cosine = match has_default_normal {
                        true => self.load(Source::Cosine),
                        false => {
                            let incoming = self.load_vector(Source::Incoming);
                            self.step(Operation::Cosine, [normal, incoming.to_vec()].concat(), 1)
                        }
                    };
                    flat.push(cosine[0]);
                    flat.extend(self.load(Source::Backfacing));
                }
                let width = |kind: SocketType| if kind == SocketType::Float { 1 } else { 3 };
                let count = kind.outputs().iter().map(|socket| width(socket.kind)).sum();
                let numbers = self.step(Operation::of(kind), flat, count);
                let mut rest = &numbers[..];
                let mut made = Vec::new();
                for socket in kind.outputs() {
                    let (own, other) = rest.split_at(width(socket.kind) as usize);
                    made.push(std::array::from_fn(|i| own[i % own.len()]));
                    rest = other;
                }
                made
            }
        }
    }

    /// Removes unused steps and allocates registers, which later steps reuse.
    fn finish(self, result: [Number; 3]) -> Program {
        let last_reads = last_reads(&self.steps, result);
        let mut registers = Assignment::default();
        let mut steps = Vec::new();
        for (i, step) in self.steps.into_iter().enumerate() {
            let reads = &last_reads[i];
            if reads.iter().all(Option::is_none) {
                continue;
            }
            let inputs = step.inputs.iter().map(|&number| registers.of(number)).collect();
            let outputs =
                reads.iter().map(|read| if read.is_some() { registers.take() } else { UNUSED }).collect();
            registers.results.insert(i as u32, outputs);
            for &number in &step.inputs {
                if let Number::Result { step, output } = number
                    && last_reads[step as usize][output as usize] == Some(i)
                {
                    registers.give_back(step, output);
                }
            }
            let outputs = registers.results[&(i as u32)].clone();
            steps.push(Compiled { operation: step.operation, inputs, outputs });
        }
        let result = result.map(|number| registers.of(number));
        let (constants, count) = (registers.constants(), registers.count as usize);
        Program { steps, constants, registers: count, result, is_z_up: self.is_z_up }
    }
}

/// By step and output: the last step that reads it; the number of steps for the result, `None` for unused outputs.
fn last_reads(steps: &[Step], result: [Number; 3]) -> Vec<Vec<Option<usize>>> {
    let mut last: Vec<Vec<Option<usize>>> =
        steps.iter().map(|step| vec![None; step.outputs as usize]).collect();
    let mark = |numbers: &[Number], by: usize, last: &mut Vec<Vec<Option<usize>>>| {
        for number in numbers {
            if let Number::Result { step, output } = *number {
                last[step as usize][output as usize].get_or_insert(by);
            }
        }
    };
    mark(&result, steps.len(), &mut last);
    for (i, step) in steps.iter().enumerate().rev() {
        if last[i].iter().any(Option::is_some) {
            mark(&step.inputs, i, &mut last);
        }
    }
    last
}

/// Which number stands in which register.
#[derive(Default)]
struct Assignment {
    count: u16,
    free: Vec<u16>,
    constants: HashMap<u32, u16>,
    results: HashMap<u32, Vec<u16>>,
}

impl Assignment {
    /// A register that is free now.
    fn take(&mut self) -> u16 {
        self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        })
    }

    /// Frees the register of an output, once.
    fn give_back(&mut self, step: u32, output: u32) {
        let outputs = self.results.get_mut(&step).expect("steps read those before them");
        let register = std::mem::replace(&mut outputs[output as usize], UNUSED);
        if register != UNUSED {
            self.free.push(register);
        }
    }

    fn of(&mut self, number: Number) -> u16 {
        match number {
            Number::Result { step, output } => self.results[&step][output as usize],
            Number::Constant(bits) => match self.constants.get(&bits) {
                Some(register) => *register,
                None => {
                    // Not a free one: constants hold for the whole program.
                    self.count += 1;
                    let register = self.count - 1;
                    self.constants.insert(bits, register);
                    register
                }
            },
        }
    }

    fn constants(&self) -> Vec<(u16, f32)> {
        self.constants.iter().map(|(bits, register)| (*register, f32::from_bits(*bits))).collect()
    }
}
