//! Textures as graphs of nodes: functions of a surface point, made of functions whose outputs feed inputs of others.

mod kinds;

pub use kinds::{
    AlphaMode, Axis, BandsDirection, BlendMode, ClampType, ColorModel, ColorSpace, Dimensions, Direction,
    DistanceMetric, EnvironmentProjection, Extension, FactorMode, GradientType, ImageInterpolation,
    ImageProjection, MappingType, MathOperation, Matrix, MixType, NodeKind, NoiseType, NormalSpace,
    RampInterpolation, RangeInterpolation, RingsDirection, RotationType, Rows, SettingValue, Socket,
    SocketDefault, SocketType, Space, TangentType, TransformType, VectorOperation, VoronoiFeature,
    WaveProfile, WaveType,
};

use super::TextureId;

/// Where an input takes its value from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NodeInput {
    /// The socket's default.
    #[default]
    Default,
    /// A number stands in the first component.
    Value([f32; 3]),
    /// Another texture at the same point.
    Texture {
        /// Which.
        texture: TextureId,
        /// Its alpha instead of its colour?
        alpha: bool,
    },
    /// An output of another node.
    Link {
        /// Which node.
        node: usize,
        /// Which of its outputs.
        output: usize,
    },
}

/// A node of a graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Operation.
    pub kind: NodeKind,
    /// One an input of the kind.
    pub inputs: Vec<NodeInput>,
    /// The image that a node of images reads: a texture of one.
    pub image: Option<TextureId>,
    /// Another graph of the material reads the alpha of the image, so that colours aren't multiplied by it in this one either.
    pub reads_alpha: bool,
}

/// Functions of a surface point, made of nodes whose outputs feed inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeGraph {
    /// In any order.
    pub nodes: Vec<Node>,
    /// Which output the graph gives.
    pub result: NodeInput,
    /// Vectors of world and camera space are those of Blender's world, whose z is up: (x, -z, y) of the scene's.
    pub is_z_up: bool,
}

/// The attributes that stand for outputs of nodes where meshes have them: kind, output, name.
const STANDARD_ATTRIBUTES: [(&str, &str, &str); 4] = [
    ("texture_coordinate", "generated", "generated"),
    ("geometry", "tangent", "generated"),
    ("geometry", "pointiness", "pointiness"),
    ("geometry", "random_per_island", "random_per_island"),
];

impl NodeGraph {
    /// Does it give a vector?
    pub fn is_vector(&self) -> bool {
        let NodeInput::Link { node, output } = self.result else { return false };
        let outputs = self.nodes.get(node).map(|node| node.kind.outputs());
        outputs.and_then(|outputs| outputs.get(output)).is_some_and(|o| o.kind == SocketType::Vector)
    }

    /// All that is wrong with it: links that lead nowhere or form a cycle, inputs that are too many or too few.
    pub fn problems(&self) -> Vec<String> {
        let mut problems = Vec::new();
        let mut check = |place: String, input: &NodeInput| match *input {
            NodeInput::Link { node, output } => match self.nodes.get(node) {
                Some(other) if output < other.kind.outputs().len() => {}
                _ => problems.push(format!(
                    "{place} is linked to output {output} of node {node}, which doesn't exist"
                )),
            },
            NodeInput::Value(value) if value.iter().any(|v| !v.is_finite()) => {
                problems.push(format!("{place} isn't finite"));
            }
            _ => {}
        };
        check("the result".to_string(), &self.result);
        for (i, node) in self.nodes.iter().enumerate() {
            for (k, input) in node.inputs.iter().enumerate() {
                check(format!("input {k} of node {i} ({})", node.kind.name()), input);
            }
        }
        for (i, node) in self.nodes.iter().enumerate() {
            let (given, expected) = (node.inputs.len(), node.kind.inputs().len());
            if given != expected {
                problems.push(format!(
                    "node {i} ({}) has {given} inputs instead of {expected}",
                    node.kind.name()
                ));
            }
            let is_of_image =
                matches!(node.kind, NodeKind::ImageTexture { .. } | NodeKind::EnvironmentTexture { .. });
            if is_of_image && node.image.is_none() {
                problems.push(format!("node {i} ({}) has no image", node.kind.name()));
            }
            problems.extend(
                node.kind.problem().map(|problem| format!("node {i} ({}): {problem}", node.kind.name())),
            );
        }
        if problems.is_empty() && self.order().is_none() {
            problems.push("its links form a cycle".to_string());
        }
        problems
    }

    /// The nodes that the result needs, each after those that it needs; `None` if links form a cycle.
    pub fn order(&self) -> Option<Vec<usize>> {
        self.order_of(&self.result)
    }

    /// Does it read normals in the space of tangents of the first texture coordinates?
    pub fn reads_tangents(&self) -> bool {
        self.nodes.iter().any(|node| match &node.kind {
            NodeKind::NormalMap { space, uv_map } => *space == NormalSpace::Tangent && uv_map.is_empty(),
            NodeKind::Tangent { direction_type, .. } => *direction_type == TangentType::UvMap,
            _ => false,
        })
    }

    /// The nodes that an input needs, each after those that it needs; `None` if links form a cycle.
    pub fn order_of(&self, input: &NodeInput) -> Option<Vec<usize>> {
        let NodeInput::Link { node, .. } = *input else { return Some(Vec::new()) };
        let (mut order, mut state) = (Vec::new(), vec![0u8; self.nodes.len()]);
        // Depth first, without recursion: graphs of files may be as deep as they like.
        let mut stack = vec![(node, 0)];
        state[node] = 1;
        while let Some((node, next)) = stack.pop() {
            let Some(input) = self.nodes[node].inputs.get(next) else {
                state[node] = 2;
                order.push(node);
                continue;
            };
            stack.push((node, next + 1));
            if let NodeInput::Link { node: other, .. } = *input {
                match state[other] {
                    0 => {
                        state[other] = 1;
                        stack.push((other, 0));
                    }
                    1 => return None,
                    _ => {}
                }
            }
        }
        Some(order)
    }

    /// Type of an input's source: that of its link or texture, `otherwise` for values.
    pub fn given_type(&self, input: &NodeInput, otherwise: SocketType) -> SocketType {
        match *input {
            NodeInput::Link { node, output } => self.nodes[node].kind.outputs()[output].kind,
            NodeInput::Texture { alpha, .. } => {
                if alpha {
                    SocketType::Float
                } else {
                    SocketType::Color
                }
            }
            NodeInput::Default | NodeInput::Value(_) => otherwise,
        }
    }

    /// If an input is a set of texture coordinates, by a mapping or not: the set's name, empty for the first, and by how much they are scaled.
    pub fn texture_coordinates(&self, input: &NodeInput) -> Option<(&str, f32)> {
        let (mut input, mut factor) = (*input, 1.0);
        // Graphs have no circles here; the nodes bound the way all the same.
        for _ in 0..=self.nodes.len() {
            let (node, output) = match input {
                NodeInput::Default => return Some(("", factor)),
                NodeInput::Link { node, output } => (self.nodes.get(node)?, output),
                _ => return None,
            };
            match &node.kind {
                NodeKind::TextureCoordinate { .. } if output == 0 => return Some(("", factor)),
                NodeKind::UvMap { name } => return Some((name, factor)),
                NodeKind::Mapping { vector_type } => {
                    let [x, y, _] = match *node.inputs.get(3)? {
                        NodeInput::Default => [1.0; 3],
                        NodeInput::Value(scale) => scale,
                        _ => return None,
                    };
                    let scale = (x * y).abs().sqrt();
                    factor *= if *vector_type == MappingType::Texture { 1.0 / scale } else { scale };
                    input = *node.inputs.first().filter(|input| **input != NodeInput::Default)?;
                }
                _ => return None,
            }
        }
        None
    }

    /// Attributes of vertices that it may read, by name; some more than once.
    pub fn attributes(&self) -> impl Iterator<Item = &str> + '_ {
        let named = self.nodes.iter().filter_map(|node| node.kind.attribute());
        let inputs = self.nodes.iter().flat_map(|node| &node.inputs).chain([&self.result]);
        let standard = inputs.filter_map(|input| {
            let NodeInput::Link { node, output } = *input else { return None };
            let kind = &self.nodes.get(node)?.kind;
            let output = kind.outputs().get(output)?.name;
            let known = STANDARD_ATTRIBUTES.iter().find(|known| (known.0, known.1) == (kind.name(), output));
            known.map(|known| known.2)
        });
        named.chain(standard)
    }

    /// Textures that it reads.
    pub fn textures(&self) -> impl Iterator<Item = TextureId> + '_ {
        let inputs = self.nodes.iter().flat_map(|node| &node.inputs).chain([&self.result]);
        let of_inputs = inputs.filter_map(|input| match input {
            NodeInput::Texture { texture, .. } => Some(*texture),
            _ => None,
        });
        of_inputs.chain(self.nodes.iter().filter_map(|node| node.image))
    }

    /// Renames the textures that it reads.
    pub fn map_textures(&mut self, rename: impl Fn(TextureId) -> TextureId) {
        for image in self.nodes.iter_mut().filter_map(|node| node.image.as_mut()) {
            *image = rename(*image);
        }
        let inputs = self.nodes.iter_mut().flat_map(|node| &mut node.inputs).chain([&mut self.result]);
        for input in inputs {
            if let NodeInput::Texture { texture, .. } = input {
                *texture = rename(*texture);
            }
        }
    }
}

impl NodeKind {
    /// The attribute that a setting names.
    fn attribute(&self) -> Option<&str> {
        match self {
            NodeKind::Attribute { name } | NodeKind::UvMap { name } | NodeKind::ColorAttribute { name } => {
                Some(name.as_str()).filter(|name| !name.is_empty())
            }
            NodeKind::NormalMap { uv_map, .. } => Some(uv_map.as_str()).filter(|name| !name.is_empty()),
            NodeKind::Tangent { direction_type: TangentType::Radial, .. } => Some("generated"),
            _ => None,
        }
    }

    /// The error in its settings.
    fn problem(&self) -> Option<String> {
        let table = |rows: &[Vec<f32>], columns: usize| {
            if rows.is_empty() {
                return Some("has no rows".to_string());
            }
            let odd = rows.iter().position(|row| row.len() != columns || row.iter().any(|v| !v.is_finite()));
            odd.map(|row| format!("row {row} isn't made of {columns} finite numbers"))
        };
        match self {
            NodeKind::ColorRamp { stops, .. } => {
                table(&stops.0, 5).map(|problem| format!("stops: {problem}"))
            }
            NodeKind::RgbCurves { table: rows, .. } | NodeKind::VectorCurves { table: rows, .. } => {
                table(&rows.0, 3).map(|problem| format!("table: {problem}"))
            }
            NodeKind::GaborTexture { dimensions } => {
                let is_known = matches!(dimensions, Dimensions::Two | Dimensions::Three);
                (!is_known).then(|| "dimensions must be 2d or 3d".to_string())
            }
            NodeKind::FloatCurve { table: rows, .. } => {
                table(&rows.0, 1).map(|problem| format!("table: {problem}"))
            }
            _ => None,
        }
    }
}
