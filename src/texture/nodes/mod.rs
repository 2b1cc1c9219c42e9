//! Compiles node graphs to flat register programs: with common subexpression elimination, constant folding, dead code elimination and
//! register allocation.

mod color;
mod evaluate;
mod math;
mod noise;
mod patterns;
mod source;
mod traced;
mod voronoi;

use super::image::ImageSampling;
use super::{HitData, TexturePoint};
use crate::scene::TextureId;
use crate::scene::nodes::{
    Axis, ImageProjection, MathOperation, NodeGraph, NodeInput, NodeKind, SocketDefault, SocketType, Space,
    TangentType, TransformType, VectorOperation,
};
use evaluate::{CompiledStep, Operation, Points, ReadImage, Registers, UNUSED, fold, run};
use source::{FIRST_UV_SET, Source, from_node_world};
use std::cell::Cell;
use std::collections::HashMap;
use traced::AmbientOcclusion;

/// A scalar operand before register allocation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Scalar {
    /// The bits of an f32.
    Constant(u32),
    Result {
        step: u32,
        output: u32,
    },
}

impl Scalar {
    fn of(value: f32) -> Scalar {
        Scalar::Constant(value.to_bits())
    }
}

/// A step before register allocation.
struct Step {
    operation: Operation,
    inputs: Vec<Scalar>,
    outputs: u32,
}

/// A program that evaluates one or several graphs at many points at a time.
#[derive(Clone, Debug)]
pub struct Program {
    steps: Vec<CompiledStep>,
    constants: Vec<(u16, f32)>,
    registers: usize,
    /// By graph.
    results: Vec<[u16; 3]>,
    is_z_up: bool,
}

/// Maximum number of points that are evaluated together.
pub const LANES: usize = 16;

impl Program {
    /// Compiles a graph; black if it has [problems](NodeGraph::problems). `attributes` are the names of vertex attributes by index.
    pub fn new(graph: &NodeGraph, attributes: &[String]) -> Program {
        Program::of_graphs(&[graph], attributes)
    }

    /// Compiles graphs with the same up axis, which share common parts.
    pub fn of_graphs(graphs: &[&NodeGraph], attributes: &[String]) -> Program {
        let is_z_up = graphs.first().is_some_and(|graph| graph.is_z_up);
        let mut builder = Builder { attributes, is_z_up, ..Builder::default() };
        let results = graphs.iter().map(|graph| builder.result(graph)).collect();
        builder.finish(results)
    }

    /// The result, if it is constant; negative components become 0.
    pub fn constant(&self) -> Option<[f32; 3]> {
        let value = |register: u16| self.constants.iter().find(|c| c.0 == register).map(|c| c.1);
        let [r, g, b] = self.results[0].map(|register| value(register).map(reflectance));
        if self.steps.is_empty() { Some([r?, g?, b?]) } else { None }
    }

    /// Does the result depend on the viewing direction?
    pub fn depends_on_viewer(&self) -> bool {
        self.traces_rays() || self.sources().any(Source::depends_on_viewer)
    }

    /// Does it read data beyond [`TexturePoint`]?
    pub fn reads_hit(&self) -> bool {
        self.traces_rays() || self.sources().any(Source::reads_hit)
    }

    /// Does it trace rays into the scene?
    pub fn traces_rays(&self) -> bool {
        self.steps.iter().any(|step| step.operation.traces_rays())
    }

    /// Does it read tangents of the first UV set?
    pub fn reads_tangents(&self) -> bool {
        self.sources().any(|source| matches!(source, Source::UvTangent | Source::Frame(FIRST_UV_SET)))
    }

    /// Does it depend on the incident path?
    pub fn reads_path(&self) -> bool {
        self.sources().any(|source| source == Source::Path)
    }

    /// Does it read the width of the ray footprint?
    pub fn reads_width(&self) -> bool {
        self.sources().any(|source| matches!(source, Source::Steps | Source::Edge))
    }

    /// The textures that it reads.
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

    /// The unclamped result of the first graph at a point, with the data of its hit if there are any. `texture` gives linear RGBA of other
    /// textures there.
    pub fn at(
        &self,
        point: TexturePoint,
        hit: Option<&HitData<'_>>,
        texture: &dyn Fn(TextureId) -> [f32; 4],
        images: &ReadImage<'_>,
    ) -> [f32; 3] {
        thread_local! {
            /// Registers of the last evaluation, for reuse; taken during one, since nested textures may run programs, too.
            static REGISTERS: Cell<Registers<1>> = Cell::default();
        }
        let mut registers = REGISTERS.take();
        let textures = &|id, _| texture(id);
        let points = Points { points: &[point], hits: &[hit], is_z_up: self.is_z_up, textures, images };
        self.evaluate(&points, &mut registers);
        let result = self.results[0].map(|register| registers.at(register, 0));
        REGISTERS.set(registers);
        result
    }

    /// Appends the unclamped results of all graphs at up to [`LANES`] points, those of a point together. `textures` and `images` are as
    /// in [`Points`].
    pub fn at_points(
        &self,
        (points, hits): (&[TexturePoint], &[Option<&HitData<'_>>]),
        textures: &dyn Fn(TextureId, usize) -> [f32; 4],
        images: &ReadImage<'_>,
        results: &mut Vec<[f32; 3]>,
    ) {
        thread_local! {
            static REGISTERS: Cell<Registers<LANES>> = Cell::default();
        }
        let mut registers = REGISTERS.take();
        self.evaluate(&Points { points, hits, is_z_up: self.is_z_up, textures, images }, &mut registers);
        for lane in 0..points.len() {
            results.extend(self.results.iter().map(|of_graph| of_graph.map(|r| registers.at(r, lane))));
        }
        REGISTERS.set(registers);
    }

    /// A result as a vector in the scene's world space (y up).
    pub fn as_vector(&self, result: [f32; 3]) -> [f32; 3] {
        from_node_world(result, self.is_z_up).to_array()
    }

    /// Evaluates the program at points.
    fn evaluate<const LANES: usize>(&self, points: &Points<'_>, registers: &mut Registers<LANES>) {
        registers.prepare(self.registers, &self.constants, points.points.len());
        for step in &self.steps {
            run(step, points, registers);
        }
    }
}

/// The first three values of a list.
fn xyz(numbers: &[Scalar]) -> [Scalar; 3] {
    [numbers[0], numbers[1], numbers[2]]
}

/// A scalar as a vector of equal components.
fn splat(number: Scalar) -> [Scalar; 3] {
    [number; 3]
}

/// Replaces negative, infinite and NaN values by 0.
pub(super) fn reflectance(value: f32) -> f32 {
    if value > 0.0 && value.is_finite() { value } else { 0.0 }
}

#[derive(Default)]
struct Builder<'a> {
    steps: Vec<Step>,
    steps_by_key: HashMap<(String, Vec<Scalar>), u32>,
    /// Names of vertex attributes by index.
    attributes: &'a [String],
    is_z_up: bool,
    /// Offset at which nodes are currently built, for the derivatives of bumps: index of the step, and fraction of it.
    sample_offset: Option<(usize, f32)>,
    /// Number of bump nodes around the nodes being built.
    bump_depth: u32,
}

/// Maximum nesting of bump nodes in each other's heights.
const MAX_BUMP_DEPTH: u32 = 2;

impl Builder<'_> {
    fn result(&mut self, graph: &NodeGraph) -> [Scalar; 3] {
        if !graph.problems().is_empty() {
            return [Scalar::of(0.0); 3];
        }
        let mut outputs: HashMap<usize, Vec<[Scalar; 3]>> = HashMap::new();
        for node in graph.order().unwrap_or_default() {
            let node_outputs = self.node(graph, node, &outputs);
            outputs.insert(node, node_outputs);
        }
        self.input(graph, &graph.result, SocketType::Color, &outputs)
    }

    /// Adds a step unless an equal one exists; folds it if all inputs are constant.
    fn step(&mut self, operation: Operation, inputs: Vec<Scalar>, outputs: u32) -> Vec<Scalar> {
        let constants: Option<Vec<f32>> = inputs
            .iter()
            .map(|number| match number {
                Scalar::Constant(bits) => Some(f32::from_bits(*bits)),
                Scalar::Result { .. } => None,
            })
            .collect();
        if let (Some(constants), false) = (constants, operation.reads_external_data()) {
            let values = fold(&operation, &constants, outputs);
            return values.into_iter().map(Scalar::of).collect();
        }
        let next = self.steps.len() as u32;
        let step = *self.steps_by_key.entry((format!("{operation:?}"), inputs.clone())).or_insert(next);
        if step == next {
            self.steps.push(Step { operation, inputs, outputs });
        }
        (0..outputs).map(|output| Scalar::Result { step, output }).collect()
    }

    fn load(&mut self, source: Source) -> Vec<Scalar> {
        let operation = match self.sample_offset {
            Some((step, fraction)) if source.varies_along_surface() => {
                Operation::LoadOffset { source, step, fraction }
            }
            _ => Operation::Load(source),
        };
        self.step(operation, Vec::new(), source.width())
    }

    fn load_vector(&mut self, source: Source) -> [Scalar; 3] {
        let numbers = self.load(source);
        [numbers[0], numbers[1], numbers[2]]
    }

    /// A value converted from one socket type to another.
    fn convert(&mut self, value: [Scalar; 3], from: SocketType, to: SocketType) -> [Scalar; 3] {
        match (from, to) {
            (SocketType::Float, SocketType::Vector | SocketType::Color) => [value[0]; 3],
            (SocketType::Vector, SocketType::Float) => [self.step(Operation::Mean, value.to_vec(), 1)[0]; 3],
            (SocketType::Color, SocketType::Float) => {
                [self.step(Operation::Luminance, value.to_vec(), 1)[0]; 3]
            }
            _ => value,
        }
    }

    /// The value of an input, converted to the type of its socket.
    fn input(
        &mut self,
        graph: &NodeGraph,
        input: &NodeInput,
        to: SocketType,
        outputs: &HashMap<usize, Vec<[Scalar; 3]>>,
    ) -> [Scalar; 3] {
        let value = match *input {
            NodeInput::Link { node, output } => outputs[&node][output],
            NodeInput::Texture { texture, alpha: true } => [self.load(Source::Texture(texture))[3]; 3],
            NodeInput::Texture { texture, alpha: false } => self.load_vector(Source::Texture(texture)),
            NodeInput::Value(value) => value.map(Scalar::of),
            NodeInput::Default => [Scalar::of(0.0); 3],
        };
        self.convert(value, graph.given_type(input, to), to)
    }

    /// The outputs of a node.
    fn node(
        &mut self,
        graph: &NodeGraph,
        index: usize,
        outputs: &HashMap<usize, Vec<[Scalar; 3]>>,
    ) -> Vec<[Scalar; 3]> {
        let node = &graph.nodes[index];
        let mut inputs = Vec::new();
        for (socket, input) in node.kind.inputs().iter().zip(&node.inputs) {
            let value = match (input, socket.default) {
                (NodeInput::Default, SocketDefault::Value(default)) => default.map(Scalar::of),
                (NodeInput::Default, SocketDefault::Position) => self.load_vector(Source::Position),
                (NodeInput::Default, SocketDefault::Uv) => self.load_vector(Source::Uv),
                // Other nodes use the viewing cosine instead.
                (NodeInput::Default, SocketDefault::Normal) => match node.kind {
                    NodeKind::Bump { .. } | NodeKind::AmbientOcclusion { .. } | NodeKind::Bevel { .. } => {
                        self.load_vector(Source::Normal)
                    }
                    _ => [Scalar::of(0.0); 3],
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

    /// A bump-mapped normal. The nodes of its height are built three times: at the point and at two offsets, for finite differences.
    fn bump(
        &mut self,
        graph: &NodeGraph,
        index: usize,
        inputs: &[(SocketType, [Scalar; 3])],
        (distance, invert, filter_width): (Scalar, bool, f32),
    ) -> [Scalar; 3] {
        let (height, normal) = (graph.nodes[index].inputs[2], inputs[3].1);
        if self.bump_depth >= MAX_BUMP_DEPTH
            || !matches!(height, NodeInput::Link { .. } | NodeInput::Texture { .. })
        {
            return normal;
        }
        let mut flat = vec![inputs[0].1[0], distance];
        let outer = self.sample_offset;
        self.bump_depth += 1;
        for sample_offset in [outer, Some((0, filter_width)), Some((1, filter_width))] {
            self.sample_offset = sample_offset;
            let mut outputs: HashMap<usize, Vec<[Scalar; 3]>> = HashMap::new();
            for node in graph.order_of(&height).unwrap_or_default() {
                let node_outputs = self.node(graph, node, &outputs);
                outputs.insert(node, node_outputs);
            }
            flat.push(self.input(graph, &height, SocketType::Float, &outputs)[0]);
        }
        self.bump_depth -= 1;
        self.sample_offset = outer;
        flat.extend(normal);
        flat.extend(self.load(Source::Steps));
        xyz(&self.step(Operation::Bump { invert, filter_width }, flat, 3))
    }

    /// The distance of a bump node, times a power of the object's scale along the normal.
    fn scaled_distance(&mut self, inputs: &[(SocketType, [Scalar; 3])], power: f32) -> Scalar {
        let distance = inputs[1].1[0];
        if power == 0.0 {
            return distance;
        }
        let mut along = inputs[3].1.to_vec();
        along.extend(self.load(Source::WorldFromObject));
        let along = self.step(Operation::Transposed, along, 3);
        let scale = self.step(Operation::Length, along, 1)[0];
        let factor = self.math(MathOperation::Power, scale, Scalar::of(power));
        self.math(MathOperation::Multiply, distance, factor)
    }

    fn math(&mut self, operation: MathOperation, a: Scalar, b: Scalar) -> Scalar {
        let kind = NodeKind::Math { operation, use_clamp: false };
        self.step(Operation::Node(kind), vec![a, b, Scalar::of(0.0)], 1)[0]
    }

    /// The outputs of an image node.
    fn image(
        &mut self,
        graph: &NodeGraph,
        index: usize,
        texture: TextureId,
        vector: [Scalar; 3],
    ) -> Vec<[Scalar; 3]> {
        let node = &graph.nodes[index];
        let Some(sampling) = ImageSampling::of(graph, index) else {
            return vec![[Scalar::of(0.0); 3]; node.kind.outputs().len()];
        };
        if let NodeKind::EnvironmentTexture { projection, .. } = &node.kind {
            let operation = Operation::Environment { texture, sampling, projection: *projection };
            return vec![xyz(&self.step(operation, vector.to_vec(), 3))];
        }
        let (projection, blend) = match &node.kind {
            NodeKind::ImageTexture { projection, blend, .. } => (*projection, *blend),
            _ => (ImageProjection::Flat, 0.0),
        };
        let zero = Scalar::of(0.0);
        let mut flat = vector.to_vec();
        flat.push(match graph.texture_coordinates(&node.inputs[0]) {
            // As in Cycles, images are not filtered in the height of a bump: filtering would flatten slopes.
            Some((name, factor)) if projection == ImageProjection::Flat && self.bump_depth == 0 => {
                let footprint = self.load(Source::Footprint(self.attribute(name)));
                let scale = NodeKind::Math { operation: MathOperation::Multiply, use_clamp: false };
                self.step(Operation::of(&scale), vec![footprint[0], Scalar::of(factor), zero], 1)[0]
            }
            _ => zero,
        });
        flat.extend(match projection {
            ImageProjection::Box => self.load_vector(Source::ObjectNormal),
            _ => [zero; 3],
        });
        let own = self.step(Operation::Image { texture, sampling, projection, blend }, flat, 4);
        vec![xyz(&own), splat(own[3])]
    }

    /// The index of an attribute; `u16::MAX`, which no surface has, for unknown names.
    fn attribute(&self, name: &str) -> u16 {
        self.attributes.iter().position(|known| known == name).map_or(u16::MAX, |number| number as u16)
    }

    /// The outputs of nodes that only read hit data; `None` for other nodes.
    fn sources_of(
        &mut self,
        kind: &NodeKind,
        inputs: &[(SocketType, [Scalar; 3])],
    ) -> Option<Vec<[Scalar; 3]>> {
        self.surface_sources(kind).or_else(|| self.other_sources(kind, inputs))
    }

    /// The outputs of nodes for coordinates and attributes.
    fn surface_sources(&mut self, kind: &NodeKind) -> Option<Vec<[Scalar; 3]>> {
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
                        xyz(&self.step(Operation::Affine(rows), position.to_vec(), 3))
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
                outputs.push(splat(self.load(Source::Backfacing)[0]));
                for name in ["pointiness", "random_per_island"] {
                    let number = self.attribute(name);
                    outputs.push(splat(self.load(Source::Attribute(number))[4]));
                }
                outputs
            }
            NodeKind::Attribute { name } => {
                let own = self.load(Source::Attribute(self.attribute(name)));
                vec![xyz(&own), xyz(&own), splat(own[4]), splat(own[3])]
            }
            NodeKind::ColorAttribute { name } => {
                let own = self.load(Source::Attribute(self.attribute(name)));
                vec![xyz(&own), splat(own[3])]
            }
            NodeKind::UvMap { name } => vec![self.load_vector(match self.attribute(name) {
                FIRST_UV_SET => Source::Uv,
                number => Source::UvMap(number),
            })],
            _ => return None,
        })
    }

    /// The outputs of nodes that read data of the object, camera and path, or transform by them.
    fn other_sources(
        &mut self,
        kind: &NodeKind,
        inputs: &[(SocketType, [Scalar; 3])],
    ) -> Option<Vec<[Scalar; 3]>> {
        Some(match kind {
            NodeKind::ObjectInfo {} => {
                let own = self.load(Source::Object);
                let mut outputs = vec![xyz(&own), xyz(&own[3..])];
                outputs.extend([6, 7, 8, 9].map(|i| splat(own[i])));
                outputs
            }
            NodeKind::CameraData {} => {
                let point = self.load_vector(Source::CameraPoint);
                let direction = self.step(Operation::Normalize, point.to_vec(), 3);
                let distance = self.step(Operation::Length, point.to_vec(), 1);
                vec![xyz(&direction), splat(point[2]), splat(distance[0])]
            }
            NodeKind::LightPath {} => self.load(Source::Path).into_iter().map(splat).collect(),
            NodeKind::HairInfo {} => {
                let s = self.load(Source::Strand);
                vec![splat(s[0]), splat(s[1]), splat(s[2]), splat(s[3]), xyz(&s[4..]), splat(s[7])]
            }
            NodeKind::Tangent { direction_type, axis } => vec![self.load_vector(match direction_type {
                TangentType::Radial => Source::Radial(*axis, self.attribute("generated")),
                TangentType::UvMap => Source::UvTangent,
            })],
            NodeKind::Wireframe { use_pixel_size } => {
                let edge = self.load(Source::Edge);
                let inputs = vec![inputs[0].1[0], edge[0], edge[1]];
                vec![splat(self.step(Operation::Wireframe { in_pixels: *use_pixel_size }, inputs, 1)[0])]
            }
            NodeKind::NormalMap { space, uv_map } => {
                let number = if uv_map.is_empty() { FIRST_UV_SET } else { self.attribute(uv_map) };
                let mut flat = vec![inputs[0].1[0]];
                flat.extend(inputs[1].1);
                flat.extend(self.load(Source::Frame(number)));
                flat.extend(self.load_vector(Source::Normal));
                flat.extend(self.load(Source::ObjectFromWorld));
                flat.extend(self.load(Source::Backfacing));
                vec![xyz(&self.step(Operation::NormalMap(*space), flat, 3))]
            }
            NodeKind::Normal { direction } => {
                let direction = self.step(Operation::Normalize, direction.0.map(Scalar::of).to_vec(), 3);
                let given = self.step(Operation::Normalize, inputs[0].1.to_vec(), 3);
                let dot = NodeKind::VectorMath { operation: VectorOperation::Dot };
                let mut flat = [&direction[..], &given].concat();
                flat.extend([Scalar::of(0.0); 4]);
                vec![xyz(&direction), splat(self.step(Operation::of(&dot), flat, 4)[3])]
            }
            NodeKind::VectorTransform { vector_type, convert_from, convert_to } => {
                vec![self.transformed(*vector_type, [*convert_from, *convert_to], inputs[0].1)]
            }
            _ => return None,
        })
    }

    /// A vector transformed from one space to another by way of world space.
    fn transformed(
        &mut self,
        transform_type: TransformType,
        [from, to]: [Space; 2],
        vector: [Scalar; 3],
    ) -> [Scalar; 3] {
        // Normals are transformed by the inverse transpose, and normalized.
        let mut vector = vector;
        let is_normal = transform_type == TransformType::Normal;
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
                false => Operation::Transform(transform_type),
            };
            vector = xyz(&self.step(operation, inputs, 3));
        }
        if is_normal {
            vector = xyz(&self.step(Operation::Normalize, vector.to_vec(), 3));
        }
        vector
    }

    fn outputs_of(
        &mut self,
        kind: &NodeKind,
        inputs: &[(SocketType, [Scalar; 3])],
        has_default_normal: bool,
    ) -> Vec<[Scalar; 3]> {
        let value = |i: usize| inputs[i].1;
        match kind {
            // These only rearrange values, without a step.
            NodeKind::Value {} | NodeKind::Rgb {} => vec![value(0)],
            NodeKind::CombineXyz {} => vec![[value(0)[0], value(1)[0], value(2)[0]]],
            NodeKind::SeparateXyz {} => value(0).map(|number| [number; 3]).to_vec(),
            NodeKind::AmbientOcclusion { samples, inside, only_local } => {
                let node = AmbientOcclusion { samples: *samples, inside: *inside, only_local: *only_local };
                let flat = [&value(1)[..1], &value(2)].concat();
                let ao = self.step(Operation::AmbientOcclusion(node), flat, 1)[0];
                vec![value(0).map(|channel| self.math(MathOperation::Multiply, channel, ao)), splat(ao)]
            }
            NodeKind::Bevel { samples } => {
                let flat = [&value(0)[..1], &value(1)].concat();
                vec![xyz(&self.step(Operation::Bevel { samples: *samples }, flat, 3))]
            }
            _ => {
                let mut flat = Vec::new();
                for (kind, value) in inputs {
                    flat.extend_from_slice(if *kind == SocketType::Float { &value[..1] } else { &value[..] });
                }
                if let NodeKind::Fresnel {} | NodeKind::LayerWeight {} = kind {
                    // Replace the normal by the viewing cosine and the back-face flag.
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
                let mut node_outputs = Vec::new();
                for socket in kind.outputs() {
                    let (own, other) = rest.split_at(width(socket.kind) as usize);
                    node_outputs.push(std::array::from_fn(|i| own[i % own.len()]));
                    rest = other;
                }
                node_outputs
            }
        }
    }

    /// Removes unused steps and allocates registers.
    fn finish(self, results: Vec<[Scalar; 3]>) -> Program {
        let last_reads = last_reads(&self.steps, results.as_flattened());
        let mut registers = RegisterAllocator::default();
        let mut steps = Vec::new();
        for (i, step) in self.steps.into_iter().enumerate() {
            let reads = &last_reads[i];
            if reads.iter().all(Option::is_none) {
                continue;
            }
            let inputs = step.inputs.iter().map(|&number| registers.of(number)).collect();
            let outputs =
                reads.iter().map(|read| if read.is_some() { registers.allocate() } else { UNUSED }).collect();
            registers.results.insert(i as u32, outputs);
            for &number in &step.inputs {
                if let Scalar::Result { step, output } = number
                    && last_reads[step as usize][output as usize] == Some(i)
                {
                    registers.release(step, output);
                }
            }
            let outputs = registers.results[&(i as u32)].clone();
            steps.push(CompiledStep { operation: step.operation, inputs, outputs });
        }
        let results = results.into_iter().map(|result| result.map(|number| registers.of(number))).collect();
        let (constants, count) = (registers.constants(), registers.count as usize);
        Program { steps, constants, registers: count, results, is_z_up: self.is_z_up }
    }
}

/// By step and output: the index of the last step that reads it; the number of steps for results, `None` for unused outputs.
fn last_reads(steps: &[Step], results: &[Scalar]) -> Vec<Vec<Option<usize>>> {
    let mut last: Vec<Vec<Option<usize>>> =
        steps.iter().map(|step| vec![None; step.outputs as usize]).collect();
    let mark = |numbers: &[Scalar], by: usize, last: &mut Vec<Vec<Option<usize>>>| {
        for number in numbers {
            if let Scalar::Result { step, output } = *number {
                last[step as usize][output as usize].get_or_insert(by);
            }
        }
    };
    mark(results, steps.len(), &mut last);
    for (i, step) in steps.iter().enumerate().rev() {
        if last[i].iter().any(Option::is_some) {
            mark(&step.inputs, i, &mut last);
        }
    }
    last
}

/// Assigns registers to constants and step outputs.
#[derive(Default)]
struct RegisterAllocator {
    count: u16,
    free: Vec<u16>,
    constants: HashMap<u32, u16>,
    results: HashMap<u32, Vec<u16>>,
}

impl RegisterAllocator {
    /// Allocates a register, reusing a free one if there is one.
    fn allocate(&mut self) -> u16 {
        self.free.pop().unwrap_or_else(|| {
            self.count += 1;
            self.count - 1
        })
    }

    /// Frees the register of an output, unless it is free already.
    fn release(&mut self, step: u32, output: u32) {
        let outputs = self.results.get_mut(&step).expect("steps read those before them");
        let register = std::mem::replace(&mut outputs[output as usize], UNUSED);
        if register != UNUSED {
            self.free.push(register);
        }
    }

    fn of(&mut self, number: Scalar) -> u16 {
        match number {
            Scalar::Result { step, output } => self.results[&step][output as usize],
            Scalar::Constant(bits) => match self.constants.get(&bits) {
                Some(register) => *register,
                None => {
                    // Not a reused register: constants are live during the whole program.
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
