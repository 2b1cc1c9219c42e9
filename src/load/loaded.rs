//! What loading is asked for, and what it gives.

use super::blender::BlenderOptions;
use super::gltf::GltfOptions;
use super::saved::SavedFiles;
use super::shutter::ShutterOptions;
use super::stage::{StageOptions, Turntable};
use super::subdivide::{Polygons, Subdivision};
use super::upright::{Up, UpHint};
use crate::error::Warning;
use crate::gauge::Gauge;
use crate::math::{DAffine3, DVec3};
use crate::scene::{MaterialId, Moving, Scene};
use std::collections::BTreeSet;

/// What the user may choose about loading.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// The files that a glTF asset refers to may lie outside its folder.
    pub allow_external: bool,
    /// The caller lights the scene with an environment of its own, or wants none: a scene without light gets no default
    /// sky.
    pub brings_environment: bool,
    /// Choices about files of Blender.
    pub blender: BlenderOptions,
    /// Choices about glTF assets.
    pub gltf: GltfOptions,
    /// Radius, in metres, of the spheres that the points of a point cloud become; without it such a file is refused.
    pub point_radius: Option<f64>,
    /// Leave out the materials, textures and images of mesh files: the caller replaces all of them.
    pub geometry_only: bool,
    /// Which axis of an OBJ or PLY file points up: its model is turned to stand upright.
    pub up: Up,
    /// Smooth normals for meshes of OBJ and PLY files that have none: the angle between two faces, in radians from 0 to pi, up to
    /// which the edge between them is rounded. `None` shows their facets.
    pub smooth_rad: Option<f64>,
    /// Catmull-Clark subdivision of the meshes of OBJ and PLY files.
    pub subdivision: Option<Subdivision>,
    /// Keep the polygons of OBJ files ([`Loaded::polygons`]), as something asks for subdivision.
    pub keeps_polygons: bool,
    /// How long the shutter is open, and when.
    pub shutter: ShutterOptions,
    /// Names of empty nodes of the model where lights will be placed: the shutter needs as many keys as their ways. What a
    /// file beside the model says is added.
    pub lit_nodes: BTreeSet<String>,
    /// How a model without camera or light is shown.
    pub stage: StageOptions,
    /// Is told which files are read or looked for.
    pub files: SavedFiles,
    /// Is told how far reading is, of PLY and OBJ files.
    pub gauge: Gauge,
    /// Don't look for a file of settings beside the model (`model.oscura.toml` beside `model.glb`).
    pub no_sidecar: bool,
}

/// A scene and what happened on the way to it.
#[derive(Debug, Default)]
pub struct Loaded {
    /// The scene; loaders have validated it.
    pub scene: Scene,
    /// What was ignored, approximated or repaired.
    pub warnings: Vec<Warning>,
    /// What the user may want to know, though nothing is amiss: a choice that was made, a file that was found.
    pub notes: Vec<Warning>,
    /// What was not read because the picture doesn't need it, with what that saved; for `--explain`.
    pub left_out: Vec<String>,
    /// Nodes of the model that hold nothing themselves.
    pub empties: Vec<EmptyNode>,
    /// What Blender's own exporter left out of the file, where it wrote it.
    pub blender: Option<BlenderExport>,
    /// Some surfaces are lamps by the file's own word, however little they light.
    pub has_area_lights: bool,
    /// Materials of faces for which the file has none.
    pub stand_ins: Vec<MaterialId>,
    /// The polygons that meshes were cut from, where they are kept, until all is subdivided.
    pub polygons: Polygons,
    /// What the file tells about which axis points up.
    pub up_hint: UpHint,
    /// How far from the world's origin the model's meshes have their own, metres: coordinates beyond the precision of
    /// their single floats are kept as sums with it. The scene stands where the file says.
    pub offset: DVec3,
    /// It comes from a model as other programs write them, whose shining parts need not be meant as its light.
    pub is_model: bool,
    /// Its light is that of a stage, which loading added.
    pub is_stage_lit: bool,
    /// What a camera that loading added goes around.
    pub turntable: Option<Turntable>,
}

/// A node of a model that holds nothing itself: where a file beside the model may put a light, as exporters leave such nodes in the
/// place of what glTF can't carry.
#[derive(Clone, Debug, PartialEq)]
pub struct EmptyNode {
    /// Its name.
    pub name: String,
    /// Where it stands at the picture's moment.
    pub world_from_node: DAffine3,
    /// Where it stands at other times, if it moves while the shutter is open.
    pub motion: Option<Moving<DAffine3>>,
}

/// What tells in a glTF file by Blender that its exporter left something out. All by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlenderExport {
    /// Empty nodes with names of lamps: what becomes of area lights.
    pub lamps: Vec<String>,
    /// Materials that are pure white and without a texture, as those become whose colour comes from other nodes.
    pub white: Vec<String>,
    /// Metals of roughness 1 without a texture, as those become whose roughness or metalness comes from other nodes.
    pub rough_metal: Vec<String>,
    /// Materials without any parameters, as those become that are made of other nodes than Principled BSDF.
    pub lost: Vec<String>,
    /// Opaque materials whose base colour has an image with alpha.
    pub unused_alpha: Vec<String>,
    /// Objects of such lost materials that enclose a camera or a lamp, as the cubes of fogs do: with the name of that.
    pub enclosing: Vec<(String, String)>,
}

impl From<Scene> for Loaded {
    /// A scene that was built in code.
    fn from(scene: Scene) -> Loaded {
        Loaded { scene, ..Loaded::default() }
    }
}
