//! Graphs of nodes as flat programs: common parts once, what is constant folded, what nothing needs left out, registers reused.

mod color;
mod evaluate;
mod hash;
mod math;
mod noise;
mod patterns;
mod voronoi;

use super::TexturePoint;
use crate::scene::TextureId;
use crate::scene::nodes::{NodeGraph, NodeInput, NodeKind, SocketType};
use evaluate::{Compiled, Operation, Points, Registers, Source, UNUSED, fold, run};
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
}

impl Program {
    /// Compiles a graph; black if it has [problems](NodeGraph::problems).
    pub fn new(graph: &NodeGraph) -> Program {
        let mut builder = Builder::default();
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
        self.sources().any(|source| source == Source::Cosine)
    }

    /// Textures that it reads.
    pub fn textures(&self) -> impl Iterator<Item = TextureId> + '_ {
        self.sources().filter_map(|source| match source {
            Source::Texture(id) => Some(id),
            _ => None,
        })
    }

    fn sources(&self) -> impl Iterator<Item = Source> + '_ {
        self.steps.iter().filter_map(|step| match step.operation {
            Operation::Load(source) => Some(source),
            _ => None,
        })
    }

    /// The result at a point. `texture` gives linear RGBA of other textures there.
    pub fn at(&self, point: TexturePoint, texture: &dyn Fn(TextureId) -> [f32; 4]) -> [f32; 3] {
        thread_local! {
            /// Registers of the last evaluation; taken while one is under way, since textures may hold programs in turn.
            static REGISTERS: Cell<Registers<1>> = Cell::default();
        }
        let mut registers = REGISTERS.take();
        let points = Points { points: &[point], textures: &|id, _| texture(id) };
        self.evaluate(&points, &mut registers);
        let result = self.result.map(|register| reflectance(registers.at(register, 0)));
        REGISTERS.set(registers);
        result
    }

    /// Evaluates the program at points.
    fn evaluate<const LANES: usize>(&self, points: &Points<'_>, registers: &mut Registers<LANES>) {
        registers.prepare(self.registers, &self.constants);
        for step in &self.steps {
            run(step, points, registers);
        }
    }
}

/// Negative values and those that aren't numbers count as 0.
fn reflectance(value: f32) -> f32 {
    if value > 0.0 && value.is_finite() { value } else { 0.0 }
}

#[derive(Default)]
struct Builder {
    steps: Vec<Step>,
    known: HashMap<(String, Vec<Number>), u32>,
}

impl Builder {
    /// Adds a step or finds the same one; folds it where all its inputs are constant.
    fn step(&mut self, operation: Operation, inputs: Vec<Number>, outputs: u32) -> Vec<Number> {
        let constants: Option<Vec<f32>> = inputs
            .iter()
            .map(|number| match number {
                Number::Constant(bits) => Some(f32::from_bits(*bits)),
                Number::Result { .. } => None,
            })
            .collect();
        if let (Some(constants), false) = (constants, matches!(operation, Operation::Load(_))) {
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
        self.step(Operation::Load(source), Vec::new(), source.width())
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

    /// What an input is given, as the type of its socket.
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
                (NodeInput::Default, Some(default)) => default.map(Number::of),
                (NodeInput::Default, None) => self.load_vector(Source::Position),
                _ => self.input(graph, input, socket.kind, outputs),
            };
            inputs.push((socket.kind, value));
        }
        self.outputs_of(&node.kind, &inputs)
    }

    fn outputs_of(&mut self, kind: &NodeKind, inputs: &[(SocketType, [Number; 3])]) -> Vec<[Number; 3]> {
        let value = |i: usize| inputs[i].1;
        match kind {
            // Names for what is there, without a step.
            NodeKind::Value {} | NodeKind::Rgb {} => vec![value(0)],
            NodeKind::CombineXyz {} => vec![[value(0)[0], value(1)[0], value(2)[0]]],
            NodeKind::SeparateXyz {} => value(0).map(|number| [number; 3]).to_vec(),
            NodeKind::TextureCoordinate {} => vec![self.load_vector(Source::Uv)],
            NodeKind::Geometry {} => {
                [Source::Position, Source::TrueNormal].map(|source| self.load_vector(source)).to_vec()
            }
            _ => {
                let mut flat = Vec::new();
                for (kind, value) in inputs {
                    flat.extend_from_slice(if *kind == SocketType::Float { &value[..1] } else { &value[..] });
                }
                if let NodeKind::Fresnel {} | NodeKind::LayerWeight {} = kind {
                    flat.extend(self.load(Source::Cosine));
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

    /// Leaves out what the result doesn't need, and gives registers, which later steps reuse.
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
        Program { steps, constants: registers.constants(), registers: registers.count as usize, result }
    }
}

/// By step and output: the last step that reads it; the number of steps for the result, `None` for what nothing reads.
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
