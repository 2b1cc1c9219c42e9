//! Textures as node graphs: functions of a surface point.

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

/// Source of an input's value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NodeInput {
    /// The socket's default.
    #[default]
    Default,
    /// A constant; floats use the first component.
    Value([f32; 3]),
    /// Another texture at the same point.
    Texture {
        /// The texture.
        texture: TextureId,
        /// Use its alpha instead of its colour.
        alpha: bool,
    },
    /// An output of another node.
    Link {
        /// Index of the node.
        node: usize,
        /// Index of the output.
        output: usize,
    },
}

/// A node of a graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Kind with settings.
    pub kind: NodeKind,
    /// One per input of the kind.
    pub inputs: Vec<NodeInput>,
    /// Image texture of an image or environment node.
    pub image: Option<TextureId>,
    /// Another graph of the material reads the alpha of the image, so that colours aren't multiplied by it in this one either.
    pub reads_alpha: bool,
}

/// A function of a surface point as a graph of nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeGraph {
    /// Nodes, in any order.
    pub nodes: Vec<Node>,
    /// Output of the graph.
    pub result: NodeInput,
    /// Vectors in world and camera space have Blender's axes (z up): (x, -z, y) of the scene's.
    pub is_z_up: bool,
}

/// Maximum number of rays that a node traces at a hit.
pub const MAX_NODE_RAYS: u32 = 128;

/// Node outputs that read a vertex attribute if the mesh has it: node kind, output, attribute name.
const STANDARD_ATTRIBUTES: [(&str, &str, &str); 4] = [
    ("texture_coordinate", "generated", "generated"),
    ("geometry", "tangent", "generated"),
    ("geometry", "pointiness", "pointiness"),
    ("geometry", "random_per_island", "random_per_island"),
];

impl NodeGraph {
    /// Whether the result is a vector.
    pub fn is_vector(&self) -> bool {
        let NodeInput::Link { node, output } = self.result else { return false };
        let outputs = self.nodes.get(node).map(|node| node.kind.outputs());
        outputs.and_then(|outputs| outputs.get(output)).is_some_and(|o| o.kind == SocketType::Vector)
    }

    /// Errors of the graph: broken or cyclic links, wrong numbers of inputs, invalid settings.
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
            let (count, expected) = (node.inputs.len(), node.kind.inputs().len());
            if count != expected {
                problems.push(format!(
                    "node {i} ({}) has {count} inputs instead of {expected}",
                    node.kind.name()
                ));
            }
            let needs_image =
                matches!(node.kind, NodeKind::ImageTexture { .. } | NodeKind::EnvironmentTexture { .. });
            if needs_image && node.image.is_none() {
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

    /// Nodes that the result depends on in topological order; `None` if there is a cycle.
    pub fn order(&self) -> Option<Vec<usize>> {
        self.order_of(&self.result)
    }

    /// Whether it uses the tangent frame of the first UV set.
    pub fn reads_tangents(&self) -> bool {
        self.nodes.iter().any(|node| match &node.kind {
            NodeKind::NormalMap { space, uv_map } => *space == NormalSpace::Tangent && uv_map.is_empty(),
            NodeKind::Tangent { direction_type, .. } => *direction_type == TangentType::UvMap,
            _ => false,
        })
    }

    /// Nodes that an input depends on in topological order; `None` if there is a cycle.
    pub fn order_of(&self, input: &NodeInput) -> Option<Vec<usize>> {
        let NodeInput::Link { node, .. } = *input else { return Some(Vec::new()) };
        let (mut order, mut state) = (Vec::new(), vec![0u8; self.nodes.len()]);
        // Depth first, without recursion: graphs may be arbitrarily deep.
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

    /// Type of an input's link or texture, `otherwise` for constants.
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

    /// If an input is a UV set, with or without mapping nodes: the set's name (empty for the first) and the scale of the mappings.
    pub fn texture_coordinates(&self, input: &NodeInput) -> Option<(&str, f32)> {
        let (mut input, mut factor) = (*input, 1.0);
        // Valid graphs have no cycles; the bound ensures termination for others.
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

    /// Names of the vertex attributes that it may read, with repetitions.
    pub fn attributes(&self) -> impl Iterator<Item = &str> + '_ {
        let named = self.nodes.iter().filter_map(|node| node.kind.attribute());
        let inputs = self.nodes.iter().flat_map(|node| &node.inputs).chain([&self.result]);
        let standard = inputs.filter_map(|input| {
            let NodeInput::Link { node, output } = *input else { return None };
            let kind = &self.nodes.get(node)?.kind;
            let output = kind.outputs().get(output)?.name;
            let row = STANDARD_ATTRIBUTES.iter().find(|row| (row.0, row.1) == (kind.name(), output));
            row.map(|row| row.2)
        });
        named.chain(standard)
    }

    /// Textures that it reads, with repetitions.
    pub fn textures(&self) -> impl Iterator<Item = TextureId> + '_ {
        let inputs = self.nodes.iter().flat_map(|node| &node.inputs).chain([&self.result]);
        let of_inputs = inputs.filter_map(|input| match input {
            NodeInput::Texture { texture, .. } => Some(*texture),
            _ => None,
        });
        of_inputs.chain(self.nodes.iter().filter_map(|node| node.image))
    }

    /// Replaces the ids of the textures that it reads.
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
    /// Name of the vertex attribute that the node reads.
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

    /// Error of the settings.
    fn problem(&self) -> Option<String> {
        let table = |rows: &[Vec<f32>], columns: usize| {
            if rows.is_empty() {
                return Some("has no rows".to_string());
            }
            let invalid =
                rows.iter().position(|row| row.len() != columns || row.iter().any(|v| !v.is_finite()));
            invalid.map(|row| format!("row {row} must have {columns} finite numbers"))
        };
        match self {
            NodeKind::ColorRamp { stops, .. } => {
                table(&stops.0, 5).map(|problem| format!("stops: {problem}"))
            }
            NodeKind::RgbCurves { table: rows, .. } | NodeKind::VectorCurves { table: rows, .. } => {
                table(&rows.0, 3).map(|problem| format!("table: {problem}"))
            }
            NodeKind::GaborTexture { dimensions } => {
                let is_supported = matches!(dimensions, Dimensions::Two | Dimensions::Three);
                (!is_supported).then(|| "dimensions must be 2d or 3d".to_string())
            }
            NodeKind::AmbientOcclusion { samples, .. } | NodeKind::Bevel { samples } => {
                let is_valid = (1..=MAX_NODE_RAYS).contains(samples);
                (!is_valid).then(|| format!("samples must be 1 to {MAX_NODE_RAYS}"))
            }
            NodeKind::FloatCurve { table: rows, .. } => {
                table(&rows.0, 1).map(|problem| format!("table: {problem}"))
            }
            _ => None,
        }
    }
}
