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

/// Options of loading.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// The files that a glTF asset refers to may lie outside its folder.
    pub allow_external: bool,
    /// The caller lights the scene with an environment of its own, or wants none: a scene without light gets no default
    /// sky.
    pub brings_environment: bool,
    /// Options for Blender's files.
    pub blender: BlenderOptions,
    /// Options for glTF assets.
    pub gltf: GltfOptions,
    /// Radius, in metres, of the spheres that the points of a point cloud become; without it such a file is refused.
    pub point_radius: Option<f64>,
    /// Leave out the materials, textures and images of mesh files: the caller replaces all of them.
    pub geometry_only: bool,
    /// The named attributes of vertices that materials read; others of PLY files are left out. `None` for all.
    pub attributes: Option<Arc<BTreeSet<String>>>,
    /// The up axis of OBJ and PLY files; models are rotated to y up.
    pub up: Up,
    /// Smooth normals for meshes of OBJ and PLY files that have none: the angle between two faces, in radians from 0 to pi, up to
    /// which the edge between them is rounded. `None` shows their facets.
    pub smooth_rad: Option<f64>,
    /// Catmull-Clark subdivision of the meshes of OBJ and PLY files.
    pub subdivision: Option<Subdivision>,
    /// Keep the polygons of OBJ files ([`Loaded::polygons`]), as something asks for subdivision.
    pub keeps_polygons: bool,
    /// Shutter interval and motion keys.
    pub shutter: ShutterOptions,
    /// Names of empty nodes of the model where lights will be placed: the shutter's keys cover their trajectories. Those of a
    /// sidecar are added.
    pub lit_nodes: BTreeSet<String>,
    /// The stage of a model without camera or light.
    pub stage: StageOptions,
    /// Maximum number of bytes that the pixels of one image may take: larger ones are refused by their headers, as damaged ones are.
    pub memory_limit: Option<u64>,
    /// Records the files that are read or looked for.
    pub files: SavedFiles,
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
    /// Data that was not read because the picture doesn't need it, with the savings; for `--explain`.
    pub left_out: Vec<String>,
    /// Empty nodes of the model.
    pub empties: Vec<EmptyNode>,
    /// Losses of Blender's own exporter, where it wrote the file.
    pub blender: Option<BlenderExport>,
    /// The file declares area lights, however dim.
    pub has_area_lights: bool,
    /// Materials of faces for which the file has none.
    pub stand_ins: Vec<MaterialId>,
    /// The polygons of meshes, for subdivision.
    pub polygons: Polygons,
    /// The up axis by the file.
    pub up_hint: UpHint,
    /// The origin of the model's meshes in world space, metres: coordinates beyond the precision of
    /// f32 are stored relative to it. The scene is placed where the file says.
    pub offset: DVec3,
    /// The scene is the model of another program, whose emissive parts need not be meant as lights.
    pub is_model: bool,
    /// A stage that loading added lights the scene.
    pub is_stage_lit: bool,
    /// The turntable of a camera that loading added.
    pub turntable: Option<Turntable>,
}

/// A node without mesh, camera or light: a sidecar may place a light there, as exporters leave such nodes in
/// place of objects that glTF doesn't support.
#[derive(Clone, Debug, PartialEq)]
pub struct EmptyNode {
    /// Its name.
    pub name: String,
    /// Its world transform at the picture's time.
    pub world_from_node: DAffine3,
    /// Its world transform at other times, if it moves while the shutter is open.
    pub motion: Option<Keyframes<DAffine3>>,
}

/// Signs in a glTF file by Blender that its exporter dropped something. All by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlenderExport {
    /// Empty nodes with names of lights: the exporter turns area lights into these.
    pub lights: Vec<String>,
    /// Materials that are pure white and without a texture, as those become whose colour comes from other nodes.
    pub white: Vec<String>,
    /// Metals of roughness 1 without a texture, as those become whose roughness or metalness comes from other nodes.
    pub rough_metal: Vec<String>,
    /// Materials without any parameters, as those become that are made of other nodes than Principled BSDF.
    pub lost: Vec<String>,
    /// Opaque materials whose base colour has an image with alpha.
    pub unused_alpha: Vec<String>,
    /// Objects of such lost materials that enclose a camera or a light, as the cubes of fogs do: with the name of that.
    pub enclosing: Vec<(String, String)>,
}

impl From<Scene> for Loaded {
    /// A scene that was built in code.
    fn from(scene: Scene) -> Loaded {
        Loaded { scene, ..Loaded::default() }
    }
}

// Options for files of Blender.

/// Options for files of Blender.
#[derive(Clone, Debug, Default)]
pub struct BlenderOptions {
    /// Blender's program, or a Python that has `bpy`; else what the environment variable `OSCURA_BLENDER` names, else
    /// what is found.
    pub program: Option<PathBuf>,
    /// The frame to render, in Blender's numbering; else that of the requested time, else the file's current one.
    pub frame: Option<u32>,
    /// The view layer to show, by its name; else the first that is rendered.
    pub view_layer: Option<String>,
    /// Largest edge of pictures that nodes are baked to, pixels; else 1024.
    pub bake: Option<u32>,
    /// The cache folder for baked images, created if it is missing; `None`
    /// keeps nothing.
    pub cache: Option<PathBuf>,
}

// Options for glTF assets.

/// Options of a glTF asset; the defaults are the default scene of the file in its rest pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GltfOptions {
    /// The time of its animations, seconds; `None` shows the rest pose.
    pub time_s: Option<f64>,
    /// The scene to show, by name or number, in place of the file's default.
    pub scene: Option<String>,
    /// The node to show with all below it, by name or number, in place of a whole scene.
    pub node: Option<String>,
    /// The variant of its materials (KHR_materials_variants), by name or number.
    pub variant: Option<String>,
    /// Units of its lights.
    pub light_units: LightUnits,
    /// Interpretation of transmissive materials without a volume.
    pub glass: Glass,
    /// Go on without the extensions that the file demands and that are not supported.
    pub force: bool,
}

/// Units of the lights of KHR_lights_punctual. The file doesn't say which mode its exporter used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnits {
    /// The specification's units, also the default of Blender's exporter; spot lights in files by Blender
    /// fade as they do there.
    #[default]
    Auto,
    /// Candela and lux, turned into watts by 683 lm/W.
    Spec,
    /// Watts per steradian and per square metre (Blender's mode "Unitless").
    Compat,
    /// Watts of the whole light as Blender shows them; sun lights in watts per square metre (Blender's mode "Raw").
    Raw,
}

/// Interpretation of materials with transmission and without a volume (thickness 0). Where they become solids, their
/// colour applies once to light that has passed the whole body, as in Blender; the colour of solids that the file declares applies at
/// each crossing of their surface, as the specification says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Glass {
    /// Solid in files by Blender, which leaves the volume out for ordinary glass, where the meshes enclose bodies; thin
    /// where they don't, and in all other files, as the specification says. In Blender files all is solid, as in
    /// Blender, except open sheets, which refract nevertheless.
    #[default]
    Auto,
    /// They refract like the surface of a solid body.
    Solid,
    /// As [`Glass::Auto`]; and flat closed meshes, the panes of windows, become single sheets, whether a volume is declared or
    /// not. Light samples pass sheets, whereas light behind a solid is found by BSDF sampling only. Sheets don't refract and have no
    /// edges. The same applies to open sheets of Blender files.
    Panes,
    /// They are thin walls that do not refract, as the specification says.
    Thin,
}

impl GltfOptions {
    /// Finds an entry by name or number; `names` are those of all entries in order.
    ///
    /// # Errors
    /// A help text that lists the entries.
    pub(super) fn find(names: &[String], wanted: &str) -> Result<usize, String> {
        const LISTED: usize = 20;
        let by_number = || wanted.parse::<usize>().ok().filter(|&i| i < names.len());
        names.iter().position(|n| n == wanted).or_else(by_number).ok_or_else(|| {
            let mut list: Vec<String> =
                names.iter().take(LISTED).enumerate().map(|(i, name)| format!("{i} '{name}'")).collect();
            if names.len() > LISTED {
                list.push(format!("and {} more", names.len() - LISTED));
            }
            if list.is_empty() { "the file has none".into() } else { format!("it has: {}", list.join(", ")) }
        })
    }
}

// Axes of files.

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// Guessed by what the file says about its origin and by the model's shape.
    Auto,
    /// x.
    X,
    /// y, as in scenes.
    #[default]
    Y,
    /// z, as in Blender and most scans and CAD.
    Z,
    /// Against x.
    NegX,
    /// Against y.
    NegY,
    /// Against z.
    NegZ,
}

/// The writer of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UpHint {
    /// The axis that this writer's files have up.
    pub writer: Option<(Up, &'static str)>,
    /// Files of this format mostly have y up; else they have z up about as often.
    pub is_mostly_y: bool,
}

impl Up {
    /// All of them.
    pub const ALL: [Up; 7] = [Up::Auto, Up::X, Up::Y, Up::Z, Up::NegX, Up::NegY, Up::NegZ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Up::Auto => "auto",
            Up::X => "x",
            Up::Y => "y",
            Up::Z => "z",
            Up::NegX => "-x",
            Up::NegY => "-y",
            Up::NegZ => "-z",
        }
    }

    /// The rotation that turns the axis up, exact in every number. The front stays where most programs have it: -y of models
    /// with z up comes to the front, z.
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

// Which files a scene was made of, and when they were saved.

/// Modification time and size of a file; `None` if it does not exist.
type Stamp = Option<(Option<SystemTime>, u64)>;

/// The files that loading has read or not found. Clones are the same list.
#[derive(Clone, Debug, Default)]
pub struct SavedFiles(Arc<Mutex<BTreeMap<PathBuf, Stamp>>>);

impl SavedFiles {
    /// Records a file with its current modification time, before it is read.
    pub fn note(&self, path: impl AsRef<Path>) {
        let path = path.as_ref();
        self.lock().entry(path.to_path_buf()).or_insert_with(|| stamp(path));
    }

    /// Was any of them saved, removed or created since it was recorded or since the last call?
    pub fn have_changed(&self) -> bool {
        let mut has_any = false;
        for (path, known) in self.lock().iter_mut() {
            let now = stamp(path);
            has_any |= now != *known;
            *known = now;
        }
        has_any
    }

    /// Replaces the list by that of a newer load, or, if that load failed, adds to it.
    pub fn replace_by(&self, newer: &SavedFiles, has_failed: bool) {
        let newer = newer.lock().clone();
        let mut own = self.lock();
        if !has_failed {
            own.clear();
        }
        own.extend(newer);
    }

    /// Their paths.
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
    fn what_a_scene_is_made_of_is_watched_and_nothing_else() {
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
    fn a_load_that_failed_is_watched_besides() {
        let (own, newer) = (SavedFiles::default(), SavedFiles::default());
        own.note("a");
        newer.note("b");
        own.replace_by(&newer, true);
        assert_eq!(own.paths().len(), 2);
        own.replace_by(&newer, false);
        assert_eq!(own.paths(), [PathBuf::from("b")]);
    }
}

/// Options of the shutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShutterOptions {
    /// Shutter time, frames; `None`: as the scene says, else 0 (no motion blur).
    pub frames: Option<f64>,
    /// When it is open; `None`: as the scene says, else centred at the picture's time.
    pub position: Option<ShutterPosition>,
    /// Frames per second, for animations in seconds.
    pub fps: f64,
    /// Number of motion keys, 2 or more; `None`: as many as the trajectories need.
    pub keys: Option<u32>,
    /// Sample the previous and the next frame, too, for motion vectors.
    pub vectors: bool,
}

impl Default for ShutterOptions {
    fn default() -> ShutterOptions {
        ShutterOptions { frames: None, position: None, fps: 24.0, keys: None, vectors: false }
    }
}

/// When the shutter is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShutterPosition {
    /// It opens at the picture's time.
    Start,
    /// The picture's time is the middle of the interval.
    #[default]
    Centre,
    /// It closes at the picture's time.
    End,
}

impl ShutterPosition {
    /// All of them, by name.
    pub const ALL: [(&str, ShutterPosition); 3] = [
        ("start", ShutterPosition::Start),
        ("centre", ShutterPosition::Centre),
        ("end", ShutterPosition::End),
    ];
}

/// Maximum shutter time, frames.
pub const LONGEST_SHUTTER: f64 = 1000.0;

/// Maximum number of keys chosen automatically.
const MAX_KEYS: usize = 65;

/// Tolerance of interpolated transforms: axes relative to their length, positions relative to the whole trajectory.
const TOLERANCE: f64 = 1e-3;

/// The tolerance at the maximum number of keys; beyond, a warning is given.
const LAST_TOLERANCE: f64 = 1e-2;

impl ShutterOptions {
    /// With the scene's settings where the user has none.
    #[must_use]
    pub fn or(self, frames: Option<f64>, position: Option<ShutterPosition>) -> ShutterOptions {
        ShutterOptions { frames: self.frames.or(frames), position: self.position.or(position), ..self }
    }

    /// Is the shutter time above 0?
    pub fn is_open(&self) -> bool {
        self.frames.is_some_and(|frames| frames > 0.0)
    }

    /// Are samples at other times needed?
    pub fn needs_motion(&self) -> bool {
        self.is_open() || self.vectors
    }

    /// A time in the shutter interval (`share` 0 to 1), frames relative to the picture's time.
    pub fn frame_at(&self, share: f64) -> f64 {
        let frames = self.frames.unwrap_or(0.0);
        match self.position.unwrap_or_default() {
            ShutterPosition::Start => frames * share,
            ShutterPosition::Centre => frames * (share - 0.5),
            ShutterPosition::End => frames * (share - 1.0),
        }
    }

    /// The times of `keys` keys, frames relative to the picture's time.
    pub fn key_frames(&self, keys: usize) -> impl Iterator<Item = f64> + use<> {
        let options = *self;
        let last = keys.saturating_sub(1).max(1) as f64;
        (0..keys).map(move |key| options.frame_at(key as f64 / last))
    }

    /// Number of keys for objects whose transforms at a frame are `transforms(frame)`, such that interpolation between keys is within the
    /// tolerance; and whether it is within it at the maximum number of keys.
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

    /// Approximate lengths of the trajectories in the shutter interval.
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

    /// Is interpolation over this number of steps within the tolerance?
    fn is_accurate(
        &self,
        steps: usize,
        transforms: &mut dyn FnMut(f64) -> Vec<DAffine3>,
        path_lengths: &[f64],
        tolerance: f64,
    ) -> bool {
        // Some per step, at irregular times: periodic motion must not alias.
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

/// Does a transform approximate another within the tolerance? `path_length` is the length of the trajectory.
fn is_near(found: &DAffine3, sampled: &DAffine3, tolerance: f64, path_length: f64) -> bool {
    let axes = |m: &DAffine3| [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let is_near =
        |(found, sampled): (DVec3, DVec3)| (found - sampled).length() <= tolerance * sampled.length();
    // Motion below the precision of f64 counts as none.
    let distance = tolerance * path_length + 1e-12 * sampled.translation.length();
    let is_placed = found.translation.distance(sampled.translation) <= distance;
    is_placed && axes(found).into_iter().zip(axes(sampled)).all(is_near)
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
    fn straight_ways_need_two_keys_and_turns_as_many_as_their_angle() {
        let shift = |frame: f64| vec![DAffine3::from_translation(DVec3::X * frame)];
        assert_eq!(open(0.5).keys_for(&mut |f| shift(f)), (2, true));
        assert_eq!(open(0.0).keys_for(&mut |f| shift(f)), (0, true));
        let turn = |speed: f64| move |frame: f64| vec![DAffine3::from_rotation_y(speed * frame)];
        let keys = |speed: f64| open(1.0).keys_for(&mut turn(speed));
        assert_eq!(keys(0.05), (2, true));
        // 1 - cos(a / 2) is a thousandth at 5.1 degrees.
        assert_eq!(keys(1.0), (17, true));
        assert_eq!(keys(std::f64::consts::TAU), (65, true));
        assert_eq!(keys(20.0), (65, false));
        assert_eq!(ShutterOptions { keys: Some(3), ..open(1.0) }.keys_for(&mut turn(9.0)), (3, true));
    }

    #[test]
    fn the_shutter_opens_before_at_and_after_the_moment() {
        let frames = |position| {
            let options = ShutterOptions { position: Some(position), ..open(0.5) };
            options.key_frames(3).collect::<Vec<_>>()
        };
        assert_eq!(frames(ShutterPosition::Start), [0.0, 0.25, 0.5]);
        assert_eq!(frames(ShutterPosition::Centre), [-0.25, 0.0, 0.25]);
        assert_eq!(frames(ShutterPosition::End), [-0.5, -0.25, 0.0]);
    }
}
