//! Options and result of loading; the shutter interval and the number of motion keys.

use super::stage::{StageOptions, Turntable};
use super::subdivide::{Polygons, Subdivision};
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DVec3, mix};
use crate::scene::{Keyframes, MaterialId, Scene};
use crate::work_counter::WorkCounter;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::SystemTime;

/// Options for loading.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Allow a glTF asset to refer to files outside its own folder.
    pub allow_external: bool,
    /// The caller sets the environment itself: scenes without lights get no default sky.
    pub overrides_environment: bool,
    /// Options for Blender files.
    pub blender: BlenderOptions,
    /// Options for glTF assets.
    pub gltf: GltfOptions,
    /// Sphere radius for points of point clouds, metres; `None` estimates one from the spacing of the points.
    pub point_radius: Option<f64>,
    /// Skip the materials, textures and images of mesh files: the caller replaces all of them.
    pub geometry_only: bool,
    /// Names of the vertex attributes to load from PLY files; `None` loads all.
    pub attributes: Option<Arc<BTreeSet<String>>>,
    /// The up axis of OBJ and PLY files; models are rotated to y up.
    pub up: Up,
    /// Auto-smooth angle for meshes of OBJ and PLY files without normals, radians, 0 to pi: edges with a smaller angle between
    /// the face normals are smooth. `None`: flat shading.
    pub smooth_rad: Option<f64>,
    /// Catmull-Clark subdivision of the meshes of OBJ and PLY files.
    pub subdivision: Option<Subdivision>,
    /// Keep the polygons of OBJ files ([`Loaded::polygons`]) for subdivision.
    pub keeps_polygons: bool,
    /// Shutter interval and motion keys.
    pub shutter: ShutterOptions,
    /// Names of the model's empty nodes at which lights will be placed; their motion determines the number of motion keys too. The
    /// loader adds those of the sidecar.
    pub lit_nodes: BTreeSet<String>,
    /// Stage (camera, lights, ground) for models without a camera or light.
    pub stage: StageOptions,
    /// Maximum size of the pixels of one image, bytes; larger images are refused after reading their headers.
    pub memory_limit: Option<u64>,
    /// Collects the paths of all files that were read or not found.
    pub files: WatchedFiles,
    /// Progress of reading PLY and OBJ files.
    pub counter: WorkCounter,
    /// Don't look for the model's sidecar (`model.oscura.toml` next to `model.glb`).
    pub no_sidecar: bool,
}

/// A loaded scene with warnings and metadata.
#[derive(Debug, Default)]
pub struct Loaded {
    /// The scene; loaders have validated it.
    pub scene: Scene,
    /// Warnings about ignored, approximated or repaired data.
    pub warnings: Vec<Warning>,
    /// Notes about choices made and files found, where nothing is wrong.
    pub notes: Vec<Warning>,
    /// Data that was skipped because it has no effect on the picture, with the savings; for `--explain`.
    pub left_out: Vec<String>,
    /// Empty nodes of the model.
    pub empties: Vec<EmptyNode>,
    /// What Blender's glTF exporter dropped; `None` for files by other programs.
    pub blender: Option<BlenderExport>,
    /// The file declares area lights, however dim.
    pub has_area_lights: bool,
    /// Default materials, for faces without a material in the file.
    pub default_materials: Vec<MaterialId>,
    /// The polygons of meshes, for subdivision.
    pub polygons: Polygons,
    /// Hints of the file about its up axis.
    pub up_hint: UpHint,
    /// The origin of the model's meshes in world space, metres: coordinates beyond the precision of
    /// f32 are stored relative to it, and instances are translated by it.
    pub offset: DVec3,
    /// The scene is a model from another program, whose emissive surfaces may not be intended as lights.
    pub is_model: bool,
    /// The lights are those of a stage that the loader added.
    pub is_stage_lit: bool,
    /// The turntable of the camera that the loader added.
    pub turntable: Option<Turntable>,
}

/// A node without mesh, camera or light: a sidecar may place a light there, as exporters leave such nodes in
/// place of objects that glTF doesn't support.
#[derive(Clone, Debug, PartialEq)]
pub struct EmptyNode {
    /// Its name.
    pub name: String,
    /// At the frame's time.
    pub world_from_node: DAffine3,
    /// Keys over the shutter interval; `None` for nodes at rest.
    pub motion: Option<Keyframes<DAffine3>>,
}

/// Names of objects and materials of a glTF file from Blender from which the exporter seems to have dropped data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlenderExport {
    /// Empty nodes named like lights: the exporter writes area lights as empty nodes.
    pub lights: Vec<String>,
    /// Pure white materials without a texture: probably the colour came from a node that the exporter doesn't support.
    pub white: Vec<String>,
    /// Metals of roughness 1 without a texture: probably roughness or metalness came from an unsupported node.
    pub rough_metal: Vec<String>,
    /// Materials without any parameters: probably their shader is not a Principled BSDF.
    pub lost: Vec<String>,
    /// Opaque materials whose base colour has an image with alpha.
    pub unused_alpha: Vec<String>,
    /// Objects with a material in `lost` that enclose a camera or a light, such as the domain of a fog; with the name of the camera or light.
    pub enclosing: Vec<(String, String)>,
}

impl From<Scene> for Loaded {
    /// Wraps a scene that was built in code.
    fn from(scene: Scene) -> Loaded {
        Loaded { scene, ..Loaded::default() }
    }
}

/// Options for Blender files.
#[derive(Clone, Debug, Default)]
pub struct BlenderOptions {
    /// Path of Blender, or of a Python with `bpy`; `None`: the environment variable `OSCURA_BLENDER`, else the first one found.
    pub program: Option<PathBuf>,
    /// Frame to render, in Blender's numbering; `None`: the frame at the requested time, else the file's current one.
    pub frame: Option<u32>,
    /// Name of the view layer to render; `None`: the first that is enabled for rendering.
    pub view_layer: Option<String>,
    /// Maximum edge of baked textures, pixels; `None`: 1024.
    pub bake: Option<u32>,
    /// The cache folder for baked textures, created if it is missing; `None`: no cache.
    pub cache: Option<PathBuf>,
}

/// Options of a glTF asset; the defaults are the default scene of the file in its rest pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfOptions {
    /// Animation time, seconds; `None`: the rest pose.
    pub time_s: Option<f64>,
    /// Name or number of the scene to load; `None`: the file's default scene.
    pub scene: Option<String>,
    /// Name or number of the root node to load with its descendants; `None`: the whole scene.
    pub node: Option<String>,
    /// Name or number of the material variant (KHR_materials_variants).
    pub variant: Option<String>,
    /// Units of its lights.
    pub light_units: LightUnits,
    /// Interpretation of transmissive materials without a volume.
    pub glass: Glass,
    /// Ignore unsupported extensions that the file requires.
    pub force: bool,
}

named_enum! {
    /// Units of the lights of KHR_lights_punctual. The file doesn't say which mode its exporter used.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    LightUnits {
        /// The specification's units, also the default of Blender's exporter; spot lights in files by Blender
        /// get Blender's falloff from the inner to the outer cone angle.
        #[default]
        Auto = "auto",
        /// Candela and lux, converted to watts at 683 lm/W.
        Spec = "spec",
        /// Watts per steradian and per square metre (Blender's mode "Unitless").
        Compat = "compat",
        /// Total power in watts, as in Blender's interface; sun lights in watts per square metre (Blender's mode "Raw").
        Raw = "raw",
    }
}

named_enum! {
    /// Interpretation of materials with transmission and without a volume (thickness 0). As solids, they tint light once per
    /// traversal of the body, as in Blender; solids declared by the file tint at each interface, as the specification says.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Glass {
        /// In glTF files by Blender, whose exporter omits the volume of ordinary glass: solid for closed meshes, thin for open
        /// ones. In other glTF files: thin, as the specification says. In Blender files: refracting for all meshes.
        #[default]
        Auto = "auto",
        /// Refracting interfaces of solid bodies.
        Solid = "solid",
        /// As [`Glass::Auto`], but flat closed meshes (window panes) and open sheets of Blender files become thin sheets without
        /// refraction, declared volume or not. Shadow rays pass thin sheets; emitters behind a solid are reached by BSDF
        /// sampling only.
        Panes = "panes",
        /// Thin walls without refraction, as the specification says.
        Thin = "thin",
    }
}

impl GltfOptions {
    /// Index of the entry with this name, or else with this index.
    ///
    /// # Errors
    /// A help text that lists the entries.
    pub(super) fn find(names: &[String], name_or_index: &str) -> Result<usize, String> {
        const MAX_LISTED: usize = 20;
        let by_number = || name_or_index.parse::<usize>().ok().filter(|&i| i < names.len());
        names.iter().position(|n| n == name_or_index).or_else(by_number).ok_or_else(|| {
            let mut list: Vec<String> =
                names.iter().take(MAX_LISTED).enumerate().map(|(i, name)| format!("{i} '{name}'")).collect();
            if names.len() > MAX_LISTED {
                list.push(format!("and {} more", names.len() - MAX_LISTED));
            }
            if list.is_empty() { "the file has none".into() } else { format!("it has: {}", list.join(", ")) }
        })
    }
}

named_enum! {
    /// The up axis of a file.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Up {
        /// Guessed from the program that wrote the file and from the model's shape.
        Auto = "auto",
        /// +x.
        X = "x",
        /// +y, as in scenes.
        #[default]
        Y = "y",
        /// +z, as in Blender and most scans and CAD.
        Z = "z",
        /// -x.
        NegX = "-x",
        /// -y.
        NegY = "-y",
        /// -z.
        NegZ = "-z",
    }
}

/// Hints of a file about its up axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UpHint {
    /// The up axis customary for the program or format that wrote the file, with its name for messages.
    pub writer: Option<(Up, &'static str)>,
    /// Files of this format are mostly y-up; otherwise y-up and z-up are about equally likely.
    pub is_mostly_y: bool,
}

impl Up {
    /// Rotation from the file's axes to y up, all entries 0 or ±1. The front of z-up models, -y, becomes +z.
    pub(super) fn rotation(self) -> DMat3 {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let (x, y, z) = match self {
            Up::Auto | Up::Y => (x, y, z),
            Up::Z => (x, -z, y),
            Up::NegY => (x, -y, -z),
            Up::NegZ => (x, z, -y),
            Up::X => (y, -x, z),
            Up::NegX => (-y, x, z),
        };
        DMat3::from_cols(x, y, z)
    }
}

/// Modification time and size of a file; `None` if it does not exist.
type Stamp = Option<(Option<SystemTime>, u64)>;

/// The files that the loader has read or not found, with their modification times. Clones share one list.
#[derive(Clone, Debug, Default)]
pub struct WatchedFiles(Arc<Mutex<BTreeMap<PathBuf, Stamp>>>);

impl WatchedFiles {
    /// Records a file with its current modification time; call before reading it.
    pub fn note(&self, path: impl AsRef<Path>) {
        let path = path.as_ref();
        self.lock().entry(path.to_path_buf()).or_insert_with(|| stamp(path));
    }

    /// Whether any file was saved, removed or created since it was recorded or since the last call.
    pub fn have_changed(&self) -> bool {
        let mut has_any = false;
        for (path, known) in self.lock().iter_mut() {
            let now = stamp(path);
            has_any |= now != *known;
            *known = now;
        }
        has_any
    }

    /// Replaces the list by that of a newer load, or, if that load failed, merges the two.
    pub fn replace_by(&self, newer: &WatchedFiles, has_failed: bool) {
        let newer = newer.lock().clone();
        let mut own = self.lock();
        if !has_failed {
            own.clear();
        }
        own.extend(newer);
    }

    /// The recorded paths, sorted.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.lock().keys().cloned().collect()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Stamp>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

fn stamp(path: &Path) -> Stamp {
    let data = path.metadata().ok()?;
    Some((data.modified().ok(), data.len()))
}

/// Options of the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShutterOptions {
    /// Shutter time, frames; `None`: the scene's, else 0 (no motion blur).
    pub frames: Option<f64>,
    /// Position of the interval; `None`: the scene's, else centred on the frame.
    pub position: Option<ShutterPosition>,
    /// Frames per second, for animations in seconds.
    pub fps: f64,
    /// Number of motion keys, 2 or more; `None`: as many as interpolation within the tolerance needs.
    pub keys: Option<u32>,
    /// Also sample the previous and the next frame, for motion vectors.
    pub vectors: bool,
}

impl Default for ShutterOptions {
    fn default() -> ShutterOptions {
        ShutterOptions { frames: None, position: None, fps: 24.0, keys: None, vectors: false }
    }
}

named_enum! {
    /// Position of the shutter interval relative to the frame's time.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    ShutterPosition {
        /// Opens at the frame's time.
        Start = "start",
        /// Centred on the frame's time.
        #[default]
        Centre = "centre",
        /// Closes at the frame's time.
        End = "end",
    }
}

/// Maximum shutter time, frames.
pub const MAX_SHUTTER_FRAMES: f64 = 1000.0;

/// Maximum number of keys chosen automatically.
const MAX_KEYS: usize = 65;

/// Tolerance of interpolated transforms: axes relative to their length, positions relative to the whole trajectory.
const TOLERANCE: f64 = 1e-3;

/// The tolerance at the maximum number of keys; beyond, a warning is given.
const LAST_TOLERANCE: f64 = 1e-2;

impl ShutterOptions {
    /// Fills unset options with the scene's.
    #[must_use]
    pub fn or(self, frames: Option<f64>, position: Option<ShutterPosition>) -> ShutterOptions {
        ShutterOptions { frames: self.frames.or(frames), position: self.position.or(position), ..self }
    }

    /// Whether the shutter time is above 0.
    pub fn is_open(&self) -> bool {
        self.frames.is_some_and(|frames| frames > 0.0)
    }

    /// Whether transforms at times other than the frame's are needed.
    pub fn needs_motion(&self) -> bool {
        self.is_open() || self.vectors
    }

    /// A time in the shutter interval, `share` from 0 (open) to 1 (close), in frames relative to the frame's time.
    pub fn frame_at(&self, share: f64) -> f64 {
        let frames = self.frames.unwrap_or(0.0);
        match self.position.unwrap_or_default() {
            ShutterPosition::Start => frames * share,
            ShutterPosition::Centre => frames * (share - 0.5),
            ShutterPosition::End => frames * (share - 1.0),
        }
    }

    /// Equidistant times of `keys` motion keys, in frames relative to the frame's time.
    pub fn key_frames(&self, keys: usize) -> impl Iterator<Item = f64> + use<> {
        let options = *self;
        let last = keys.saturating_sub(1).max(1) as f64;
        (0..keys).map(move |key| options.frame_at(key as f64 / last))
    }

    /// Number of motion keys with which interpolation of `transforms(frame)` is within the tolerance; false if it is out of
    /// the tolerance even at the maximum number of keys.
    pub fn keys_for(&self, transforms: &mut dyn FnMut(f64) -> Vec<DAffine3>) -> (usize, bool) {
        if !self.is_open() {
            return (0, true);
        }
        if let Some(keys) = self.keys {
            return (keys as usize, true);
        }
        let path_lengths = self.path_lengths(transforms);
        let mut steps = 1;
        while steps + 1 < MAX_KEYS {
            if self.is_accurate(steps, transforms, &path_lengths, TOLERANCE) {
                return (steps + 1, true);
            }
            steps *= 2;
        }
        (steps + 1, self.is_accurate(steps, transforms, &path_lengths, LAST_TOLERANCE))
    }

    /// Approximate lengths of the trajectories over the shutter interval, metres.
    fn path_lengths(&self, transforms: &mut dyn FnMut(f64) -> Vec<DAffine3>) -> Vec<f64> {
        const STEPS: u32 = 8;
        let mut before = transforms(self.frame_at(0.0));
        let mut path_lengths = vec![0.0; before.len()];
        for step in 1..=STEPS {
            let next = transforms(self.frame_at(f64::from(step) / f64::from(STEPS)));
            for (path_length, (from, to)) in path_lengths.iter_mut().zip(before.iter().zip(&next)) {
                *path_length += from.translation.distance(to.translation);
            }
            before = next;
        }
        path_lengths
    }

    /// Whether interpolation between `steps + 1` equidistant keys is within the tolerance.
    fn is_accurate(
        &self,
        steps: usize,
        transforms: &mut dyn FnMut(f64) -> Vec<DAffine3>,
        path_lengths: &[f64],
        tolerance: f64,
    ) -> bool {
        // Irregular test times in each step: periodic motion must not alias.
        let between = (7 / steps).max(2);
        let inner = |k: usize| (k as f64 + 0.9) / (between as f64 + 0.8);
        let (mut from, mut is_accurate) = (transforms(self.frame_at(0.0)), true);
        for step in 0..steps {
            let at = |inner: f64| self.frame_at((step as f64 + inner) / steps as f64);
            let to = transforms(at(1.0));
            for share in (0..between).map(inner) {
                let sampled = transforms(at(share));
                let all = from.iter().zip(&to).zip(sampled.iter().zip(path_lengths));
                is_accurate &= all.into_iter().all(|((from, to), (sampled, path_length))| {
                    is_near(&mix(from, to, share), sampled, tolerance, *path_length)
                });
            }
            if !is_accurate {
                return false;
            }
            from = to;
        }
        true
    }
}

/// Whether an interpolated transform is within the tolerance. `path_length`: length of the trajectory, metres.
fn is_near(interpolated: &DAffine3, sampled: &DAffine3, tolerance: f64, path_length: f64) -> bool {
    let axes = |m: &DAffine3| [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let is_near = |(axis, sampled): (DVec3, DVec3)| (axis - sampled).length() <= tolerance * sampled.length();
    // Motion below the precision of f64 counts as none.
    let distance = tolerance * path_length + 1e-12 * sampled.translation.length();
    let is_placed = interpolated.translation.distance(sampled.translation) <= distance;
    is_placed && axes(interpolated).into_iter().zip(axes(sampled)).all(is_near)
}

#[cfg(test)]
mod saved_tests {
    use super::*;
    use crate::load::{LoadOptions, load};
    use std::fs;

    /// A grid of one voxel.
    fn grid() -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        [1u32, 1, 1, 1, 1].iter().for_each(|n| bytes.extend(n.to_le_bytes()));
        [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0, 0.5].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes
    }

    #[test]
    fn exactly_the_files_of_a_scene_are_watched() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        fs::create_dir(file("scenes")).unwrap();
        fs::write(file("part.obj"), "mtllib part.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        fs::write(file("smoke.vol"), grid()).unwrap();
        let scene = file("scenes/a.toml");
        let text = "[materials.smoke]\ntype = \"dielectric\"\nmedium = { density = 1.0, grid = \"../smoke.vol\" }\n\
                    [[objects]]\nmesh = \"../part.obj\"\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\n\
                    material = \"smoke\"\n";
        fs::write(&scene, text).unwrap();
        let options = LoadOptions::default();
        load(&scene, &options).unwrap();
        let files = &options.files;
        let read = files.paths();
        for name in ["a.toml", "../part.obj", "../part.mtl", "../smoke.vol"] {
            assert!(read.contains(&file("scenes").join(name)), "{name}: {read:?}");
        }
        assert!(!files.have_changed());
        for other in ["picture.png", "scenes/b.toml", "scenes/c.exr"] {
            fs::write(file(other), "no part").unwrap();
        }
        assert!(!files.have_changed(), "files that the scene isn't made of");
        for (name, text) in [("smoke.vol", ""), ("part.mtl", "newmtl a\n"), ("part.obj", "v 0 0 0")] {
            fs::write(file(name), text).unwrap();
            assert!(files.have_changed() && !files.have_changed(), "{name} was saved");
        }
        fs::remove_file(scene).unwrap();
        assert!(files.have_changed());
    }

    #[test]
    fn files_of_a_failed_load_are_added() {
        let (own, newer) = (WatchedFiles::default(), WatchedFiles::default());
        own.note("a");
        newer.note("b");
        own.replace_by(&newer, true);
        assert_eq!(own.paths().len(), 2);
        own.replace_by(&newer, false);
        assert_eq!(own.paths(), [PathBuf::from("b")]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_before_numbers() {
        let names = ["1".to_string(), "b".to_string(), "c".to_string()];
        assert_eq!(GltfOptions::find(&names, "1"), Ok(0));
        assert_eq!(GltfOptions::find(&names, "2"), Ok(2));
        assert_eq!(GltfOptions::find(&names, "b"), Ok(1));
        let error = GltfOptions::find(&names, "3").expect_err("there is none");
        assert!(error.contains("2 'c'"), "{error}");
    }

    fn open(frames: f64) -> ShutterOptions {
        ShutterOptions { frames: Some(frames), ..ShutterOptions::default() }
    }

    #[test]
    fn translations_need_two_keys_and_rotations_more_with_their_angle() {
        let shift = |frame: f64| vec![DAffine3::from_translation(DVec3::X * frame)];
        assert_eq!(open(0.5).keys_for(&mut |f| shift(f)), (2, true));
        assert_eq!(open(0.0).keys_for(&mut |f| shift(f)), (0, true));
        let turn = |speed: f64| move |frame: f64| vec![DAffine3::from_rotation_y(speed * frame)];
        let keys = |speed: f64| open(1.0).keys_for(&mut turn(speed));
        assert_eq!(keys(0.05), (2, true));
        // The error 1 - cos(a / 2) reaches the tolerance of 1e-3 at a step of 5.1 degrees.
        assert_eq!(keys(1.0), (17, true));
        assert_eq!(keys(std::f64::consts::TAU), (65, true));
        assert_eq!(keys(20.0), (65, false));
        assert_eq!(ShutterOptions { keys: Some(3), ..open(1.0) }.keys_for(&mut turn(9.0)), (3, true));
    }

    #[test]
    fn positions_shift_the_shutter_interval() {
        let frames = |position| {
            let options = ShutterOptions { position: Some(position), ..open(0.5) };
            options.key_frames(3).collect::<Vec<_>>()
        };
        assert_eq!(frames(ShutterPosition::Start), [0.0, 0.25, 0.5]);
        assert_eq!(frames(ShutterPosition::Centre), [-0.25, 0.0, 0.25]);
        assert_eq!(frames(ShutterPosition::End), [-0.5, -0.25, 0.0]);
    }
}
