//! `[textures.NAME]` of `type = "nodes"`: a node graph.
//!
//! ```toml
//! [textures.rust]
//! type = "nodes"
//! result = "ramp.color"
//! [textures.rust.nodes]
//! noise = { type = "noise_texture", scale = 8, detail = 5 }
//! ramp = { type = "color_ramp", factor = "noise.factor", stops = [[0.4, 0.1, 0.02, 0.01, 1], [0.6, 0.5, 0.5, 0.5, 1]] }
//! ```
//!
//! An input is a number, a list of three, an output `"NODE.OUTPUT"` of another node, or another texture: `"textures.NAME"`, or its alpha,
//! `"textures.NAME.alpha"`. The other keys of a node except `type` are its settings. With `up = "z"` next to `result`, world and
//! camera vectors are in Blender's axes, (x, -z, y).

use super::builder::SceneFileBuilder;
use super::fields::{Fields, number, numbers, suggestion};
use super::textures::{Textures, read_image};
use crate::error::Warning;
use crate::load::image::Use;
use crate::load::ply::TANGENT;
use crate::scene::nodes::{
    ColorSpace, Extension, ImageInterpolation, ImageProjection, Node, NodeGraph, NodeInput, NodeKind,
    SettingValue,
};
use crate::scene::{Interpolation, Mapping, Texture, TextureId, Wrap};
use std::collections::BTreeSet;
use std::sync::Arc;
use toml::Spanned;
use toml::de::DeValue;

/// A value with its span in the file.
pub(super) type Value<'a> = &'a Spanned<DeValue<'a>>;

/// Resolves links of a graph.
pub(super) struct Links<'g, 'a> {
    /// Names and kinds of the nodes, in order.
    pub nodes: &'g [(&'a str, NodeKind)],
    pub textures: &'g mut Textures<'a>,
    /// Name of the texture with the graph, for messages about cycles.
    pub texture_name: &'g str,
}

/// Names of the vertex attributes that nodes of a file may read, including those for baked node outputs.
pub(super) fn attribute_names(root: &Fields) -> BTreeSet<String> {
    let mut names: BTreeSet<String> =
        ["generated", "pointiness", "random_per_island", TANGENT].map(str::to_string).into();
    let lists =
        ["textures", "materials"].map(|key| root.raw(key).and_then(|value| value.get_ref().as_table()));
    for graph in lists.into_iter().flatten().flat_map(|table| table.values()) {
        let nodes = graph.get_ref().as_table().and_then(|table| table.get("nodes")?.get_ref().as_table());
        for node in nodes.into_iter().flat_map(|table| table.values()) {
            for key in ["name", "uv_map"] {
                let name = node.get_ref().as_table().and_then(|table| table.get(key)?.get_ref().as_str());
                names.extend(name.map(str::to_string));
            }
        }
    }
    names
}

/// Adds notes about attributes that graphs read and no mesh has.
pub(super) fn warn_of_missing_attributes(build: &mut SceneFileBuilder) {
    let scene = &build.loaded.scene;
    let known: BTreeSet<&str> =
        scene.meshes.iter().flat_map(|mesh| &mesh.attributes).map(|a| a.name.as_str()).collect();
    let nodes = scene.textures.iter().filter_map(|texture| match texture {
        Texture::Nodes(graph) => Some(&graph.nodes),
        _ => None,
    });
    let named = nodes.flatten().filter_map(|node| match &node.kind {
        NodeKind::Attribute { name } | NodeKind::ColorAttribute { name } => Some(name.as_str()),
        _ => None,
    });
    let missing: BTreeSet<String> = named.filter(|name| !known.contains(name)).map(str::to_string).collect();
    for name in missing {
        let message = format!("no mesh has the attribute '{name}' that nodes read: its value is 0");
        build.loaded.notes.push(Warning::new(build.file, "", message));
    }
}

/// Names and kinds of nodes, and the graph of the nodes.
pub(super) type NamedNodes<'a> = (Vec<(&'a str, NodeKind)>, NodeGraph);

impl<'a> Textures<'a> {
    /// Reads a texture of `type = "nodes"`; `None` after a problem.
    pub(super) fn nodes(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        texture_name: &str,
    ) -> Option<Texture> {
        let result = fields.require("result", fields.raw("result"));
        let table = fields.require("nodes", fields.table("nodes"))?;
        let (named, mut graph) =
            self.value_nodes(build, &table.entries().collect::<Vec<_>>(), texture_name)?;
        let mut links = Links { nodes: &named, textures: self, texture_name };
        graph.result = links.input(build, result?)?;
        graph.is_z_up = fields.choice("up", &[("y", false), ("z", true)]).unwrap_or(false);
        let problems = graph.problems();
        for problem in &problems {
            build.problems.push(fields.span(), format!("{}: {problem}", fields.description()));
        }
        problems.is_empty().then(|| Texture::Nodes(Arc::new(graph)))
    }

    /// Adds the texture of one output of a graph; `None` after a problem.
    pub(super) fn output_texture(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        (named, graph): (&[(&'a str, NodeKind)], &NodeGraph),
        value: Value<'a>,
    ) -> Option<TextureId> {
        let result = Links { nodes: named, textures: self, texture_name: "" }.input(build, value)?;
        let graph = NodeGraph { result, ..graph.clone() };
        if let Some(problem) = graph.problems().first() {
            build.problems.push(fields.span(), format!("{}: {problem}", fields.description()));
            return None;
        }
        if self.checks_only() {
            return Some(TextureId(0));
        }
        Some(build.loaded.scene.add_texture(Texture::Nodes(Arc::new(graph))))
    }

    /// Reads nodes as a graph without a result; `None` after a problem.
    pub(super) fn value_nodes(
        &mut self,
        build: &mut SceneFileBuilder,
        tables: &[(&'a str, Value<'a>)],
        texture_name: &str,
    ) -> Option<NamedNodes<'a>> {
        let mut named = Vec::new();
        for (name, value) in tables {
            named.push((*name, read_kind(build, name, value)?));
        }
        let kinds = named.clone();
        let mut links = Links { nodes: &kinds, textures: self, texture_name };
        let mut nodes = Vec::new();
        for ((name, value), (_, kind)) in tables.iter().zip(&mut named) {
            let inputs = read_inputs(build, &mut links, name, value, kind);
            nodes.push(Node { kind: kind.clone(), inputs: inputs?, image: None, reads_alpha: false });
        }
        let mut graph = NodeGraph { nodes, result: NodeInput::Default, is_z_up: false };
        for (index, table) in tables.iter().enumerate() {
            self.node_image(build, &mut graph, index, *table)?;
        }
        Some((named, graph))
    }

    /// Reads the image of an image node; `None` after a problem.
    fn node_image(
        &mut self,
        build: &mut SceneFileBuilder,
        graph: &mut NodeGraph,
        index: usize,
        (name, value): (&str, Value<'a>),
    ) -> Option<()> {
        let (file, color_space, interpolation, wrap, is_flat) = match &graph.nodes[index].kind {
            NodeKind::ImageTexture { file, color_space, interpolation, extension, projection, .. } => {
                let wrap = match extension {
                    Extension::Repeat => Wrap::Repeat,
                    Extension::Mirror => Wrap::Mirror,
                    Extension::Extend | Extension::Clip => Wrap::Clamp,
                };
                (file, color_space, interpolation, wrap, *projection == ImageProjection::Flat)
            }
            NodeKind::EnvironmentTexture { file, color_space, interpolation, .. } => {
                (file, color_space, interpolation, Wrap::Repeat, false)
            }
            _ => return Some(()),
        };
        if file.is_empty() {
            let message = format!("node '{name}' needs 'file', the image relative to the scene file");
            build.problems.push(value.span(), message);
            return None;
        }
        let purpose = if *color_space == ColorSpace::Srgb { Use::Color } else { Use::Data };
        let is_filtered = is_flat && graph.texture_coordinates(&graph.nodes[index].inputs[0]).is_some();
        let interpolation = match interpolation {
            ImageInterpolation::Closest => Interpolation::Nearest,
            _ if is_filtered => Interpolation::Trilinear,
            _ => Interpolation::Bilinear,
        };
        if self.checks_only() {
            graph.nodes[index].image = Some(TextureId(0));
            return Some(());
        }
        let image = read_image(build, file, value.span(), purpose)?;
        let mapping = Mapping::default();
        let texture = Texture::Image { image, wrap_u: wrap, wrap_v: wrap, interpolation, mapping };
        let textures = &mut build.loaded.scene.textures;
        // Nodes with equal settings share a texture.
        let known = textures.iter().position(|other| *other == texture);
        let number = known.unwrap_or_else(|| {
            textures.push(texture);
            textures.len() - 1
        });
        graph.nodes[index].image = Some(TextureId(number as u32));
        Some(())
    }
}

/// The kind of a node, from its `type`; `None` after a problem.
fn read_kind(build: &mut SceneFileBuilder, name: &str, value: Value) -> Option<NodeKind> {
    let Some(table) = value.get_ref().as_table() else {
        build.problems.push(value.span(), format!("node '{name}' must be a table"));
        return None;
    };
    let Some((text, span)) = table.get("type").and_then(|v| Some((v.get_ref().as_str()?, v.span()))) else {
        build.problems.push(value.span(), format!("node '{name}' needs 'type', a string"));
        return None;
    };
    let kind = NodeKind::from_name(text);
    if kind.is_none() {
        let default = format!("node types: {}", NodeKind::NAMES.join(", "));
        let help = suggestion(text, NodeKind::NAMES.iter().copied(), default);
        build.problems.push_help(span, format!("there is no node type '{text}'"), help);
    }
    kind
}

/// Reads the inputs of a node, and its settings into `kind`; `None` after a problem.
fn read_inputs<'a>(
    build: &mut SceneFileBuilder,
    links: &mut Links<'_, 'a>,
    name: &str,
    value: Value<'a>,
    kind: &mut NodeKind,
) -> Option<Vec<NodeInput>> {
    let sockets = kind.inputs();
    let mut inputs = vec![NodeInput::Default; sockets.len()];
    let mut is_valid = true;
    for (key, value) in value.get_ref().as_table()?.iter() {
        let key = key.get_ref().as_ref();
        if let Some(i) = sockets.iter().position(|socket| socket.name == key) {
            match links.input(build, value) {
                Some(input) => inputs[i] = input,
                None => is_valid = false,
            }
        } else if key != "type" {
            let set = setting_value(value.get_ref())
                .ok_or_else(|| format!("'{key}' has a value of a type that no setting has"))
                .and_then(|setting| kind.set(key, &setting));
            if let Err(problem) = set {
                is_valid = false;
                let names: Vec<&str> = sockets.iter().map(|socket| socket.name).collect();
                let help = format!(
                    "its inputs: {}",
                    if names.is_empty() { "none".to_string() } else { names.join(", ") }
                );
                build.problems.push_help(value.span(), format!("node '{name}': {problem}"), help);
            }
        }
    }
    is_valid.then_some(inputs)
}

fn setting_value(value: &DeValue) -> Option<SettingValue> {
    match value {
        DeValue::Boolean(value) => Some(SettingValue::Bool(*value)),
        DeValue::String(text) => Some(SettingValue::Text(text.to_string())),
        DeValue::Integer(_) => number(value).map(|x| SettingValue::Integer(x as i64)),
        DeValue::Float(_) => number(value).map(|x| SettingValue::Number(x as f32)),
        DeValue::Array(rows) => {
            let row = |row: &Spanned<DeValue>| -> Option<Vec<f32>> {
                row.get_ref().as_array()?.iter().map(|v| number(v.get_ref()).map(|x| x as f32)).collect()
            };
            let numbers = rows.iter().map(|v| number(v.get_ref()).map(|x| x as f32)).collect::<Option<_>>();
            match numbers {
                Some(numbers) => Some(SettingValue::Numbers(numbers)),
                None => rows.iter().map(row).collect::<Option<_>>().map(SettingValue::Table),
            }
        }
        _ => None,
    }
}

impl<'a> Links<'_, 'a> {
    /// Reads an input or the result of a graph; `None` after a problem.
    pub fn input(&mut self, build: &mut SceneFileBuilder, value: Value<'a>) -> Option<NodeInput> {
        if let Some(text) = value.get_ref().as_str() {
            return self.link(build, value, text);
        }
        let numbers = number(value.get_ref()).map(|x| [x; 3]).or_else(|| numbers::<3>(value.get_ref()));
        if numbers.is_none() {
            let message = "an input must be a finite number, a list of three, or \"NODE.OUTPUT\"";
            build.problems.push(value.span(), message);
        }
        numbers.map(|v| NodeInput::Value(v.map(|x| x as f32)))
    }

    fn link(&mut self, build: &mut SceneFileBuilder, value: Value<'a>, text: &'a str) -> Option<NodeInput> {
        if let Some(texture) = text.strip_prefix("textures.") {
            let (name, alpha) = match texture.strip_suffix(".alpha") {
                Some(name) => (name, true),
                None => (texture, false),
            };
            let texture = self.textures.input_by_name(build, name, self.texture_name, value.span())?;
            return Some(NodeInput::Texture { texture, alpha });
        }
        let (node, output) = text.split_once('.').unwrap_or((text, ""));
        let Some(index) = self.nodes.iter().position(|(name, _)| *name == node) else {
            let names = self.nodes.iter().map(|(name, _)| *name);
            let default = format!("nodes of this texture: {}", names.clone().collect::<Vec<_>>().join(", "));
            let help = suggestion(node, names, default);
            build.problems.push_help(value.span(), format!("there is no node '{node}'"), help);
            return None;
        };
        let outputs = self.nodes[index].1.outputs();
        let found = outputs.iter().position(|socket| socket.name == output);
        // The output may be omitted if there is only one.
        let found = found.or_else(|| (output.is_empty() && outputs.len() == 1).then_some(0));
        if found.is_none() {
            let names: Vec<&str> = outputs.iter().map(|socket| socket.name).collect();
            let message = match output {
                "" => format!("node '{node}' has several outputs: name one, as in '{node}.{}'", names[0]),
                _ => format!("node '{node}' has no output '{output}'"),
            };
            build.problems.push_help(value.span(), message, format!("its outputs: {}", names.join(", ")));
        }
        found.map(|output| NodeInput::Link { node: index, output })
    }
}
