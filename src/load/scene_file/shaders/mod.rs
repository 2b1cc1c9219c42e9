//! `type = "nodes"`: a material as a graph of Blender's shader nodes.
//!
//! | Key | Meaning |
//! |---|---|
//! | `nodes` | nodes by name: those of textures of `type = "nodes"`, and the shaders below |
//! | `surface` | name of the output shader: `"NODE"` |
//! | `displacement` | `{ vector = "NODE.OUTPUT" }`: meshes' vertices move by this vector, world space, metres; with `keep_normals = true` the surface is shaded with the normals of the undisplaced mesh (false). Meshes aren't subdivided, and instances of a mesh are displaced as the first is |
//! | `bumps` | the output with the bump-mapped normal of a displacement, like `normal` of shaders: `"NODE.OUTPUT"`; normal maps self-shadow relative to it |
//! | `volume` | true: the surface bounds a solid (false) |
//! | `up` | `"z"`: world vectors are in Blender's axes, as in textures of nodes (`"y"`) |
//! | `medium`, `priority` | of the solid, as for `type = "pbr"` |
//! | `light_group` | light group of the emission |
//!
//! | Shader | Inputs |
//! |---|---|
//! | `principled_bsdf` | those of Blender's node, in lower case with `_` for spaces: `base_color`, `metallic`, `roughness`, `specular_ior_level`, ... |
//! | `diffuse_bsdf`, `glossy_bsdf`, `glass_bsdf`, `refraction_bsdf`, `translucent_bsdf`, `transparent_bsdf`, `sheen_bsdf`, `metallic_bsdf`, `subsurface_scattering` | the same: `color`, `roughness`, `ior`, `anisotropy`, `normal` |
//! | `velvet_bsdf` | `color`, `roughness`, `normal`: Blender's Sheen with Ashikhmin's distribution |
//! | `toon_bsdf`, `toon_highlight_bsdf` | `color`, `size`, `smooth`, `normal`: Blender's Toon, Diffuse and Glossy |
//! | `subsurface_scattering`, `principled_bsdf` | `body`, `subsurface_body`: the body's colour beneath a textured colour |
//! | | `skin_ior`, `subsurface_skin_ior`: above 0, Random Walk (Skin) with this index of refraction: the radius is a diffusion length, and mean free paths depend on the colour |
//! | `glossy_bsdf`, `glass_bsdf`, `refraction_bsdf` | `beckmann`: 1 for the Beckmann distribution with single scattering instead of GGX |
//! | all with microfacets | `multiscatter`: 1 compensates the energy loss of single scattering, 0 doesn't, as Blender's GGX; default: `microfacet` of `[render]` |
//! | `emission` | `color`, `strength` (1) |
//! | `mix_shader` | `factor` (0.5), `a`, `b`: shaders; a missing one is black |
//! | `add_shader` | `a`, `b` |
//!
//! A colour instead of a shader is an emission, as in Cycles.

use super::builder::SceneFileBuilder;
use super::fields::{Fields, suggestion};
use super::media;
use super::nodes::{Links, Value};
use super::textures::Textures;
use crate::scene::nodes::{
    ClampType, MathOperation, Node, NodeGraph, NodeInput, NodeKind, SocketType, VectorOperation,
};
use crate::scene::{
    AlphaMode, ColorSlot, Displacement, DisplacementKind, Emission, EmitterTraits, FloatSlot, Material,
    Medium, MixComponent, Model, Texture, TextureId,
};
use std::collections::HashMap;
use std::sync::Arc;

mod closures;

/// Maximum number of closures of a material; shaders shared by several mixes count once for each.
const MAX_CLOSURES: usize = 64;

/// A shader node with its inputs, in the order of [`Shader::inputs`].
struct ShaderNode<'a> {
    name: &'a str,
    shader: Shader,
    inputs: Vec<ShaderInput>,
}

/// The value of an input of a shader node.
#[derive(Clone, Copy)]
enum ShaderInput {
    Value(NodeInput),
    Shader(usize),
}

/// Reads the material; `None` after a problem.
pub(super) fn read<'a>(
    build: &mut SceneFileBuilder,
    textures: &mut Textures<'a>,
    fields: &Fields<'a>,
    name: &str,
) -> Option<Material> {
    fields.mark_known(&["surface", "nodes", "bumps", "volume", "up", "medium"]);
    let surface = fields.require("surface", fields.string("surface"));
    let table = fields.require("nodes", fields.table("nodes"))?;
    let is_solid = fields.flag("volume", false);
    let medium = media::read(build, textures, fields, "medium");
    let is_shader = |value: Value| Shader::of(value).is_some();
    let values: Vec<(&str, Value)> = table.entries().filter(|(_, value)| !is_shader(value)).collect();
    let shader_tables: Vec<(&str, Value)> = table.entries().filter(|(_, value)| is_shader(value)).collect();
    let (kinds, mut graph) = textures.value_nodes(build, &values, "")?;
    graph.is_z_up = fields.choice("up", &[("y", false), ("z", true)]).unwrap_or(false);
    let names: Vec<&str> = shader_tables.iter().map(|(name, _)| *name).collect();
    let mut links = Links { nodes: &kinds, textures, texture_name: "" };
    let read = |(name, value): &(&'a str, Value<'a>)| shader_node(build, &mut links, &names, name, value);
    let shaders: Vec<ShaderNode<'a>> = shader_tables.iter().filter_map(read).collect();
    if shaders.len() < shader_tables.len() {
        return None;
    }
    let bumps = fields.raw("bumps").map_or(Some(NodeInput::Value([0.0; 3])), |v| links.input(build, v))?;
    let displacement =
        has_displacement(fields).then(|| read_displacement(build, &mut links, fields)).flatten();
    let surface = surface?;
    let Some(first) = position(&names, surface.value) else {
        report_unknown(build, &names, surface.value, surface.span);
        return None;
    };
    if let Some(problem) = graph.problems().first() {
        build.problems.push(fields.span(), format!("{}: {problem}", fields.description()));
        return None;
    }
    let mut closures = ClosureList {
        build,
        material: name,
        is_solid,
        checks_only: textures.checks_only(),
        graph,
        bumps,
        shaders: &shaders,
        textures: HashMap::new(),
        components: Vec::new(),
        emission: NodeInput::Value([0.0; 3]),
        transparency: NodeInput::Value([0.0; 3]),
        is_tinted: false,
        only_mixes: true,
        stack: Vec::new(),
    };
    if let Err(problem) = closures.add(first, NodeInput::Value([1.0; 3])) {
        let span = fields.span();
        build.problems.push(span, ("shader-graph-invalid", format!("{}: {problem}", fields.description())));
        return None;
    }
    let displacement = displacement.and_then(|vector| closures.displacement(vector));
    Some(Material { displacement, ..with_medium(closures.finish(), medium) })
}

/// Sets the medium, if any, of a material and of the refracting components of a mix, through which light enters.
fn with_medium(mut material: Material, medium: Option<Medium>) -> Material {
    let Some(medium) = medium else { return material };
    if let Model::Mix { components } = &mut material.model {
        for component in components.iter_mut().map(|component| &mut component.material) {
            let refracts =
                component.model.pbr().is_some_and(|pbr| pbr.has_volume && pbr.transmission.factor > 0.0);
            component.medium = component.medium.or(refracts.then_some(medium));
        }
    }
    material.medium = Some(medium);
    material
}

/// Whether the material has a displacement by vectors.
pub(super) fn has_displacement(fields: &Fields) -> bool {
    let table = fields.raw("displacement").and_then(|value| value.get_ref().as_table());
    table.is_some_and(|table| table.contains_key("vector"))
}

/// The vector of a displacement, and whether normals are kept.
fn read_displacement<'a>(
    build: &mut SceneFileBuilder,
    links: &mut Links<'_, 'a>,
    fields: &Fields<'a>,
) -> Option<(NodeInput, bool)> {
    let table = fields.table("displacement")?;
    let vector = links.input(build, table.raw("vector")?);
    let keeps_normals = table.flag("keep_normals", false);
    table.finish();
    Some((vector?, keeps_normals))
}

/// The index of a shader by name; `"NODE.OUTPUT"` is equivalent to `"NODE"`.
fn position(names: &[&str], text: &str) -> Option<usize> {
    let node = text.split_once('.').map_or(text, |(node, _)| node);
    names.iter().position(|name| *name == node)
}

fn report_unknown(build: &mut SceneFileBuilder, names: &[&str], text: &str, span: std::ops::Range<usize>) {
    let default = format!("shaders of this material: {}", names.join(", "));
    let help = suggestion(text, names.iter().copied(), default);
    build.problems.push_help(span, ("unknown-shader", format!("there is no shader '{text}'")), help);
}

/// A shader node; `None` after a problem.
fn shader_node<'a>(
    build: &mut SceneFileBuilder,
    links: &mut Links<'_, 'a>,
    names: &[&str],
    name: &'a str,
    value: Value<'a>,
) -> Option<ShaderNode<'a>> {
    let shader = Shader::of(value)?;
    let sockets = shader.inputs();
    let mut inputs = vec![ShaderInput::Value(NodeInput::Default); sockets.len()];
    let mut is_valid = true;
    for (key, value) in value.get_ref().as_table()?.iter() {
        let key = key.get_ref().as_ref();
        let Some(i) = sockets.iter().position(|socket| *socket == key) else {
            if key != "type" {
                let help = format!("its inputs: {}", sockets.join(", "));
                let message = format!("node '{name}': {} has no input '{key}'", shader.name());
                build.problems.push_help(value.span(), message, help);
                is_valid = false;
            }
            continue;
        };
        let shader = value.get_ref().as_str().and_then(|text| position(names, text));
        match shader {
            Some(shader) => inputs[i] = ShaderInput::Shader(shader),
            None => match links.input(build, value) {
                Some(input) => inputs[i] = ShaderInput::Value(input),
                None => is_valid = false,
            },
        }
    }
    is_valid.then_some(ShaderNode { name, shader, inputs })
}

/// The closures of a shader graph: materials with weights, emission and transparency. Weights are node graphs.
struct ClosureList<'l, 'b, 'a> {
    build: &'l mut SceneFileBuilder<'b>,
    material: &'l str,
    is_solid: bool,
    /// Only check the graph, and add nothing to the scene.
    checks_only: bool,
    /// The value nodes, and nodes added for weights.
    graph: NodeGraph,
    /// The bump-mapped normal of the surface.
    bumps: NodeInput,
    shaders: &'l [ShaderNode<'a>],
    /// Textures by node and output.
    textures: HashMap<(usize, usize), TextureId>,
    components: Vec<(NodeInput, Material)>,
    /// Radiance, W/sr/m2.
    emission: NodeInput,
    /// RGB fraction of light that passes straight through.
    transparency: NodeInput,
    /// The transparency may be coloured.
    is_tinted: bool,
    /// There is no add shader: weights and transparency sum to 1.
    only_mixes: bool,
    /// Shaders from the output to the current one, to detect cycles.
    stack: Vec<usize>,
}

impl ClosureList<'_, '_, '_> {
    /// Adds the closures and the emission of a shader.
    fn add(&mut self, index: usize, weight: NodeInput) -> Result<(), String> {
        let node = &self.shaders[index];
        if self.stack.contains(&index) {
            return Err(format!("the shaders around '{}' form a cycle", node.name));
        }
        if self.components.len() > MAX_CLOSURES {
            return Err(format!("its shaders make more than {MAX_CLOSURES} closures"));
        }
        self.stack.push(index);
        match node.shader {
            Shader::Mix => {
                let factor = self.clamped(self.number(index, "factor", 0.5));
                let rest = self.complement(factor);
                for (key, fraction) in [("a", rest), ("b", factor)] {
                    let weight = self.product(weight, fraction);
                    self.add_input(index, key, weight)?;
                }
            }
            Shader::Add => {
                self.only_mixes = false;
                self.add_input(index, "a", weight)?;
                self.add_input(index, "b", weight)?;
            }
            _ => self.add_closure(index, weight),
        }
        self.stack.pop();
        Ok(())
    }

    /// Adds the shader of an input; a colour instead is an emission.
    fn add_input(&mut self, index: usize, key: &str, weight: NodeInput) -> Result<(), String> {
        if weight == NodeInput::Value([0.0; 3]) {
            return Ok(());
        }
        match self.input(index, key) {
            ShaderInput::Shader(other) => self.add(other, weight),
            ShaderInput::Value(NodeInput::Default) => Ok(()),
            ShaderInput::Value(color) => {
                self.add_emission(weight, color);
                Ok(())
            }
        }
    }

    fn add_emission(&mut self, weight: NodeInput, radiance: NodeInput) {
        let radiance = self.product(weight, radiance);
        self.emission = self.sum(self.emission, radiance);
    }

    fn add_transparency(&mut self, weight: NodeInput, color: NodeInput) {
        let transparency = self.product(weight, color);
        self.transparency = self.sum(self.transparency, transparency);
    }

    /// An input of a shader node by name.
    fn input(&self, index: usize, key: &str) -> ShaderInput {
        let node = &self.shaders[index];
        let i = node.shader.inputs().iter().position(|name| *name == key);
        i.map_or(ShaderInput::Value(NodeInput::Default), |i| node.inputs[i])
    }

    /// A colour input; the default for shaders.
    fn color(&self, index: usize, key: &str, default: [f32; 3]) -> NodeInput {
        match self.input(index, key) {
            ShaderInput::Value(NodeInput::Default) | ShaderInput::Shader(_) => NodeInput::Value(default),
            ShaderInput::Value(input) => input,
        }
    }

    fn number(&self, index: usize, key: &str, default: f32) -> NodeInput {
        self.color(index, key, [default; 3])
    }

    /// An input that must be constant; the default with a warning if it isn't.
    fn constant(&mut self, index: usize, key: &str, default: f32) -> f32 {
        self.constant_color(index, key, [default; 3])[0]
    }

    fn constant_color(&mut self, index: usize, key: &str, default: [f32; 3]) -> [f32; 3] {
        match self.color(index, key, default) {
            NodeInput::Value(value) => value,
            _ => {
                let shader = self.shaders[index].shader.name();
                self.warn(format!(
                    "'{key}' of {shader} '{}' must be constant: its default is used",
                    self.shaders[index].name
                ));
                default
            }
        }
    }

    fn warn(&mut self, message: String) {
        self.build.warn(format!("material '{}': {message}", self.material));
    }

    // Arithmetic of weights, with constant folding.

    fn push(&mut self, kind: NodeKind, inputs: &[NodeInput]) -> NodeInput {
        let mut all = vec![NodeInput::Default; kind.inputs().len()];
        all[..inputs.len()].copy_from_slice(inputs);
        self.graph.nodes.push(Node { kind, inputs: all, image: None, reads_alpha: false });
        NodeInput::Link { node: self.graph.nodes.len() - 1, output: 0 }
    }

    fn product(&mut self, a: NodeInput, b: NodeInput) -> NodeInput {
        const ZERO: NodeInput = NodeInput::Value([0.0; 3]);
        const ONE: NodeInput = NodeInput::Value([1.0; 3]);
        match (a, b) {
            (NodeInput::Value(a), NodeInput::Value(b)) => NodeInput::Value([0, 1, 2].map(|c| a[c] * b[c])),
            (ZERO, _) | (_, ZERO) => ZERO,
            (ONE, other) | (other, ONE) => other,
            _ => self.push(NodeKind::VectorMath { operation: VectorOperation::Multiply }, &[a, b]),
        }
    }

    fn sum(&mut self, a: NodeInput, b: NodeInput) -> NodeInput {
        const ZERO: NodeInput = NodeInput::Value([0.0; 3]);
        match (a, b) {
            (NodeInput::Value(a), NodeInput::Value(b)) => NodeInput::Value([0, 1, 2].map(|c| a[c] + b[c])),
            (ZERO, other) | (other, ZERO) => other,
            _ => self.push(NodeKind::VectorMath { operation: VectorOperation::Add }, &[a, b]),
        }
    }

    fn complement(&mut self, a: NodeInput) -> NodeInput {
        match a {
            NodeInput::Value(a) => NodeInput::Value(a.map(|x| 1.0 - x)),
            _ => {
                let subtract = NodeKind::Math { operation: MathOperation::Subtract, use_clamp: false };
                self.push(subtract, &[NodeInput::Value([1.0; 3]), a])
            }
        }
    }

    /// `a / b`, where `b` is a number.
    fn quotient(&mut self, a: NodeInput, b: NodeInput) -> NodeInput {
        match (a, b) {
            (NodeInput::Value(a), NodeInput::Value([b, ..])) if b > 0.0 => NodeInput::Value(a.map(|x| x / b)),
            // As in Cycles, division by 0 is 0.
            _ => self.push(NodeKind::VectorMath { operation: VectorOperation::Divide }, &[a, b]),
        }
    }

    fn clamped(&mut self, a: NodeInput) -> NodeInput {
        match a {
            NodeInput::Value(a) => NodeInput::Value(a.map(|x| x.clamp(0.0, 1.0))),
            _ => self.push(NodeKind::Clamp { clamp_type: ClampType::MinMax }, &[a]),
        }
    }

    /// Converts a colour to a number, as links to number inputs do.
    fn as_number(&mut self, a: NodeInput) -> NodeInput {
        let kind = match a {
            NodeInput::Link { node, output } => self.graph.nodes[node].kind.outputs()[output].kind,
            NodeInput::Texture { alpha: false, .. } => SocketType::Color,
            _ => SocketType::Float,
        };
        match (kind, a) {
            (SocketType::Float, _) | (_, NodeInput::Value(_)) => a,
            _ => {
                let add = NodeKind::Math { operation: MathOperation::Add, use_clamp: false };
                self.push(add, &[a, NodeInput::Value([0.0; 3])])
            }
        }
    }

    // Parameters of materials.

    /// The texture of an input; `None` for constants and alpha.
    fn texture(&mut self, input: NodeInput) -> Option<TextureId> {
        if self.checks_only {
            return Some(TextureId(0));
        }
        match input {
            NodeInput::Texture { texture, alpha: false } => Some(texture),
            NodeInput::Link { node, output } => Some(match self.textures.get(&(node, output)) {
                Some(&known) => known,
                None => {
                    let graph = self.pruned(input);
                    let id = self.build.loaded.scene.add_texture(Texture::Nodes(Arc::new(graph)));
                    self.textures.insert((node, output), id);
                    id
                }
            }),
            _ => None,
        }
    }

    /// The texture of a vector; `None` for zero.
    fn vector_texture(&mut self, input: NodeInput) -> Option<TextureId> {
        match input {
            NodeInput::Value([0.0, 0.0, 0.0]) => None,
            NodeInput::Link { node, output }
                if self.graph.nodes[node].kind.outputs()[output].kind == SocketType::Vector =>
            {
                self.texture(input)
            }
            _ => {
                let add = NodeKind::VectorMath { operation: VectorOperation::Add };
                let vector = self.push(add, &[input, NodeInput::Value([0.0; 3])]);
                self.texture(vector)
            }
        }
    }

    /// The displacement by a vector, which may keep normals; `None` for zero.
    fn displacement(&mut self, (vector, keeps_normals): (NodeInput, bool)) -> Option<Displacement> {
        let texture = (self.vector_texture(vector)?, 0);
        Some(Displacement { texture, kind: DisplacementKind::Vectors { keeps_normals } })
    }

    /// The subgraph of the nodes that a result depends on.
    fn pruned(&self, result: NodeInput) -> NodeGraph {
        let whole = NodeGraph { result, ..self.graph.clone() };
        let order = whole.order().unwrap_or_default();
        let new_index: HashMap<usize, usize> =
            order.iter().enumerate().map(|(new, &old)| (old, new)).collect();
        let renumbered = |input: NodeInput| match input {
            NodeInput::Link { node, output } => NodeInput::Link { node: new_index[&node], output },
            other => other,
        };
        let nodes = order.iter().map(|&old| {
            let node = &whole.nodes[old];
            let inputs = node.inputs.iter().copied().map(renumbered).collect();
            Node { kind: node.kind.clone(), inputs, image: node.image, reads_alpha: self.reads_alpha(old) }
        });
        NodeGraph { nodes: nodes.collect(), result: renumbered(result), is_z_up: whole.is_z_up }
    }

    /// Whether anything in the material reads the second output of a node, the alpha of images.
    fn reads_alpha(&self, node: usize) -> bool {
        let alpha = NodeInput::Link { node, output: 1 };
        let mut inputs = self.graph.nodes.iter().flat_map(|node| &node.inputs);
        let mut shaders = self.shaders.iter().flat_map(|shader| &shader.inputs);
        inputs.any(|input| *input == alpha)
            || shaders.any(|input| matches!(input, ShaderInput::Value(value) if *value == alpha))
    }

    fn color_slot(&mut self, input: NodeInput) -> ColorSlot {
        match input {
            NodeInput::Value(value) => ColorSlot::constant(value),
            _ => self.texture(input).map_or(ColorSlot::constant([1.0; 3]), ColorSlot::texture),
        }
    }

    fn float_slot(&mut self, input: NodeInput) -> FloatSlot {
        if let NodeInput::Texture { texture, alpha } = input {
            return FloatSlot::texture(texture, if alpha { 3 } else { 0 });
        }
        match self.as_number(input) {
            NodeInput::Value([value, ..]) => FloatSlot::constant(value),
            number => self.texture(number).map_or(FloatSlot::constant(1.0), |id| FloatSlot::texture(id, 0)),
        }
    }

    /// The probability that a ray passes straight through, and the factor on its throughput. The probability is 1 without
    /// closures and emission.
    fn straight_transmission(&mut self) -> (NodeInput, ColorSlot) {
        const ALL: NodeInput = NodeInput::Value([1.0; 3]);
        let transparency = self.transparency;
        if !self.is_tinted {
            return (self.as_number(transparency), ColorSlot::constant([1.0; 3]));
        }
        if self.components.is_empty() && self.emission == NodeInput::Value([0.0; 3]) {
            return (ALL, self.color_slot(transparency));
        }
        let probability = match transparency {
            NodeInput::Value([r, g, b]) => NodeInput::Value([((r + g + b) / 3.0).clamp(0.0, 1.0); 3]),
            textured => {
                let number = self.as_number(textured);
                self.clamped(number)
            }
        };
        let color = self.quotient(transparency, probability);
        (probability, self.color_slot(color))
    }

    /// The material of all closures. Closures and emission are divided by alpha, the probability that a ray doesn't pass.
    fn finish(mut self) -> Material {
        let (transparency, transparent_color) = self.straight_transmission();
        let alpha = self.complement(transparency);
        let is_opaque = alpha == NodeInput::Value([1.0; 3]);
        let is_sole =
            self.components.len() == 1 && self.only_mixes && self.emission == NodeInput::Value([0.0; 3]);
        let is_clear = matches!(alpha, NodeInput::Value([a, ..]) if a <= 0.0);
        let components = std::mem::take(&mut self.components);
        let mut mixed: Vec<MixComponent> = Vec::new();
        for (weight, material) in components.into_iter().filter(|_| !is_clear) {
            let weight = match (is_opaque, is_sole) {
                (true, _) => weight,
                // The weight of the only closure is alpha.
                (false, true) => NodeInput::Value([1.0; 3]),
                (false, false) => self.quotient(weight, alpha),
            };
            mixed.push(MixComponent { weight: self.color_slot(weight), material });
        }
        let mut material = match mixed.pop() {
            None => Material::new(self.material, Model::Black),
            Some(only) if mixed.is_empty() && only.weight == ColorSlot::constant([1.0; 3]) => only.material,
            Some(last) => {
                mixed.push(last);
                Material::new(self.material, Model::Mix { components: mixed })
            }
        };
        if self.emission != NodeInput::Value([0.0; 3]) {
            let emission =
                if is_opaque || is_clear { self.emission } else { self.quotient(self.emission, alpha) };
            let radiance = self.color_slot(emission);
            material.emission = Some(Emission { radiance, two_sided: true });
        }
        if is_clear && material.emission.is_some() {
            // Emission is added to the rays that pass.
            material.emitter_traits = Some(EmitterTraits { is_obstacle: false, ..EmitterTraits::default() });
        } else if !is_opaque {
            material.transparent_color = transparent_color;
            (material.alpha_mode, material.alpha) = (AlphaMode::Blend, self.float_slot(alpha));
        }
        material
    }
}

/// Defines the shader nodes: doc comment, name in files, inputs.
macro_rules! shaders {
    ($($(#[$doc:meta])* $shader:ident $name:literal ($($input:ident),*);)*) => {
        /// A shader node.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        enum Shader { $($(#[$doc])* $shader,)* }

        impl Shader {
            fn from_name(name: &str) -> Option<Shader> {
                match name {
                    $($name => Some(Shader::$shader),)*
                    _ => None,
                }
            }

            /// The name in files.
            pub fn name(self) -> &'static str {
                match self { $(Shader::$shader => $name,)* }
            }

            /// Names of the inputs.
            pub fn inputs(self) -> &'static [&'static str] {
                match self { $(Shader::$shader => &[$(stringify!($input)),*],)* }
            }
        }
    };
}

shaders! {
    /// Principled BSDF of Blender (Disney 2012, OpenPBR).
    Principled "principled_bsdf" (
        base_color, metallic, roughness, ior, alpha, normal, diffuse_roughness, subsurface_weight, subsurface_radius,
        subsurface_scale, subsurface_ior, subsurface_anisotropy, subsurface_skin_ior, subsurface_body, specular_ior_level, specular_tint,
        anisotropic, anisotropic_rotation, transmission_weight, coat_weight, coat_roughness, coat_ior, coat_tint, sheen_weight, sheen_roughness, sheen_tint,
        emission_color, emission_strength, thin_film_thickness, thin_film_ior, multiscatter
    );
    /// Lambert, or Oren-Nayar with a roughness above 0.
    Diffuse "diffuse_bsdf" (color, roughness, normal);
    /// Microfacet reflection without Fresnel.
    Glossy "glossy_bsdf" (color, roughness, anisotropy, rotation, multiscatter, beckmann, normal);
    /// A metal with reflectance at normal incidence and edge tint (F82).
    Metallic "metallic_bsdf" (base_color, edge_tint, roughness, anisotropy, rotation, multiscatter, normal);
    /// A dielectric interface.
    Glass "glass_bsdf" (color, roughness, ior, multiscatter, beckmann, normal);
    /// A dielectric interface without reflection.
    Refraction "refraction_bsdf" (color, roughness, ior, multiscatter, beckmann, normal);
    /// Diffuse transmission.
    Translucent "translucent_bsdf" (color, normal);
    /// Straight transmission.
    Transparent "transparent_bsdf" (color);
    /// Microfibre sheen.
    Sheen "sheen_bsdf" (color, roughness, normal);
    /// Ashikhmin velvet.
    Velvet "velvet_bsdf" (color, roughness, normal);
    /// A constant lobe around the normal.
    Toon "toon_bsdf" (color, size, smooth, normal);
    /// A constant lobe around the mirror direction.
    ToonHighlight "toon_highlight_bsdf" (color, size, smooth, normal);
    Subsurface "subsurface_scattering" (color, roughness, scale, radius, ior, anisotropy, skin_ior, body, normal);
    Emission "emission" (color, strength);
    /// Two shaders mixed.
    Mix "mix_shader" (factor, a, b);
    /// Two shaders added.
    Add "add_shader" (a, b);
}

impl Shader {
    /// The shader of a node's table; `None` for value nodes.
    pub fn of(value: Value) -> Option<Shader> {
        let name = value.get_ref().as_table()?.get("type")?.get_ref().as_str()?;
        Shader::from_name(name)
    }
}
