//! `[[objects]]`: each has exactly one shape, a `material`, optionally a `name`, a `transform` (`oscura help
//! transform`) and a `motion` (`oscura help motion`).
//!
//! | Shape | Value |
//! |---|---|
//! | `mesh` | a .gltf, .glb, .vrm, .obj, .ply, .spz, .stl or .3mf file; its cameras and, with a note, its lights are ignored, `material` replaces all of its materials; `materials` is a list, indexed by the `material_index` of faces of PLY files, from 0 |
//! | `quad` | `{ corner, u, v }`; the front faces along u x v |
//! | `box` | `{ min, max }`; `materials` may name six: -x, +x, -y, +y, -z, +z |
//! | `pyramid` | `{ base, size = [x, z], height }`, `base` is the centre of its base; `materials` may name five: base, +z, +x, -z, -x |
//! | `triangle` | three points |
//!
//! `smooth = 30` gives a `mesh` without normals smooth normals; edges with a larger angle between the face normals, degrees, stay sharp.
//!
//! `mesh_keys = [{ frame = -0.5, mesh = "before.ply" }, { frame = 0.5, mesh = "after.ply" }]` deforms a `mesh`: each file has the same vertices
//! at another frame (see `motion`), with linear interpolation in between. All objects with a mesh have the same `mesh_keys`.
//!
//! `instances = "leaves.ply"` places instances of the object (after its `transform`) at the vertices of a PLY file. Vertex properties: the position `x y z`;
//! optionally an orientation, either the quaternion `qx qy qz qw` or the direction `nx ny nz` of the object's y axis; a factor `scale` or one for each
//! axis, `sx sy sz`; instead of these the matrix `m00` to `m22`, row by row; and `red green blue alpha`, `index` and `random`, the outputs of nodes of type
//! `object_info`. All instances have the object's name. An instance takes 0.1 to 0.2 KiB; triangles are stored once.
//!
//! `subdivide = 2` subdivides the polygons of a `mesh` into smooth surfaces (`oscura help subdivision`).
//!
//! `visible_to = ["camera", "diffuse", "glossy", "transmission", "volume", "shadow"]` lists the types of rays that hit an
//! object, by default all: other rays pass through, and receive no light from it. `visible_to_camera = false` removes
//! `camera`. Without `shadow` an object casts no shadow. With `holdout = true` the picture is transparent where the
//! camera sees the object. With `shadow_catcher = true` the camera sees only the shadows and light of other objects on it, for compositing
//! over a photograph; the layer `ShadowCatcher` has the factors per channel.
//!
//! `color = [r, g, b]` or `[r, g, b, alpha]` (white), `index` (0) and `random` (0 to 1; by default a hash of the name) are the outputs of nodes
//! of type `object_info`.
//!
//! `light_link` and `shadow_link` of an emissive object select the objects that it lights, and those that cast shadows in its light
//! (`oscura help lights`).
//!
//! Shapes without a material use `[materials.default]`. Quads remain quads under any transform.
//!
//! Shapes with a centre and a radius:
//!
//! | Shape | Value |
//! |---|---|
//! | `sphere` | `{ center, radius }` |
//! | `disk` | `{ center, normal, radius }`; flat, its front faces along `normal` (default y, up) |
//!
//! They remain spheres and disks under rotation, translation and uniform scaling, and become meshes, with a warning, under any other
//! transform (spheres of 81,920 triangles), as do emissive spheres with non-uniformly scaling motion. The unit UV square of a disk encloses its edge; its top points up (for a
//! horizontal disk to -z) and rotates with the object.
//!
//! # subdivision
//!
//! `subdivide = 2`, or `subdivide = { levels = 2 }`, applies Catmull-Clark subdivision to the meshes of an object at load time: quads of OBJ
//! files become smooth surfaces, as in modelling programs. Vertices and normals are those of the limit surface. For meshes of other files
//! the base faces are triangles.
//!
//! | Subdivision | Default | Meaning |
//! |---|---|---|
//! | `levels` | required | levels, 0 to 10; each splits a face into four. The limit for all subdivided meshes together is 16 million triangles |
//! | `scheme` | `catmull-clark` | the only scheme |
//! | `corners` | `sharp` | boundary vertices of only one face stay fixed; `round`: they are smoothed, as by default in Blender |
//!
//! Open edges, and edges of more than two faces, become smooth curves. Texture coordinates are interpolated linearly, and keep their seams.

use super::assets::Assets;
use super::builder::SceneFileBuilder;
use super::fields::{Fields, number, numbers, suggestion};
use super::instances;
use super::instances::MeshKeys;
use super::materials::Materials;
use super::textures::Textures;
use super::traits::{self, TraitOverrides, group};
use super::transform::{self, EvaluatedMotion};
use crate::load::mesh_tools::{
    Faces, NAMELESS, box_faces, placed_shape, pyramid_faces, triangle_faces, uniform_scale,
};
use crate::load::subdivide::{DEFORMS, MAX_LEVELS, Subdivision};
use crate::math::{DAffine3, DMat3, DQuat, DVec3, transform_at};
use crate::scene::{
    Instance, Keyframes, MaterialId, Mesh, MeshId, MeshPart, Motion, Quad, Scene, SceneMotion, Shape,
    ShapeKind,
};
use crate::shape::mesh_of;
use std::ops::Range;
use toml::de::DeValue;

/// The keys of all shapes.
fn shape_keys() -> impl Iterator<Item = &'static str> {
    ["mesh"].into_iter().chain(round_shape_keys()).chain(["quad", "box", "pyramid", "triangle"])
}

/// Reads all objects.
pub(super) fn read<'a>(
    build: &mut SceneFileBuilder,
    root: &Fields<'a>,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
    assets: &mut Assets,
) {
    if build.is_sidecar && root.raw("objects").is_some_and(|v| v.get_ref().is_table()) {
        if let Some(all) = root.table("objects") {
            override_objects(build, &all, materials, textures);
        }
        return build.nodes.remove_hidden(&mut build.loaded.scene);
    }
    let Some(list) = root.list("objects") else { return };
    for table in list.iter().filter_map(|v| v.get_ref().as_table()) {
        let file = table.get("mesh").and_then(|v| v.get_ref().as_str());
        let is_replaced = table.contains_key("material") || table.contains_key("materials");
        if let Some(file) = file.filter(|_| !is_replaced) {
            assets.expect_materials(build, file);
        }
        if let Some(file) = file.filter(|_| table.contains_key("subdivide")) {
            assets.expect_polygons(build, file);
        }
    }
    for (i, value) in list.iter().enumerate() {
        let Some(fields) = Fields::of_value(format!("object {}", i + 1), value, root.problems) else {
            continue;
        };
        if build.is_sidecar
            && let Some(node) = fields.string("node")
        {
            override_object(build, &fields, (node.value, node.span), materials, textures);
            continue;
        }
        let name = fields.string("name").map_or_else(|| format!("object {}", i + 1), |n| n.value.to_string());
        let object = Object::read(build, &fields, name);
        let before = counts(build);
        let points = instances::read(build, &fields, &object.name);
        read_object(build, &fields, &object, materials, textures, assets);
        apply_traits(build, &fields, before);
        // A shape given as a type is one problem, although its keys are unknown, too.
        if shape_keys().any(|shape| fields.has(shape)) || !fields.is_given("type") {
            fields.finish();
        }
        if let Some(points) = points {
            instances::copy(build, fields.span(), before, &points, assets);
        }
    }
    assets.apply_listed_materials(&mut build.loaded.scene);
    build.nodes.remove_hidden(&mut build.loaded.scene);
}

/// The current counts of instances, quads and shapes.
fn counts(build: &SceneFileBuilder) -> [usize; 3] {
    let scene = &build.loaded.scene;
    [scene.instances.len(), scene.quads.len(), scene.shapes.len()]
}

/// Applies visibility, links and `object_info` to the instances, quads and shapes that an object added to the scene.
fn apply_traits(build: &mut SceneFileBuilder, fields: &Fields, [instances, quads, shapes]: [usize; 3]) {
    let overrides = TraitOverrides::read(build, fields);
    let scene = &mut build.loaded.scene;
    if let Some(info) = traits::info(fields) {
        scene.instances[instances..].iter_mut().for_each(|instance| instance.info = info);
        scene.quads[quads..].iter_mut().for_each(|quad| quad.info = info);
        scene.shapes[shapes..].iter_mut().for_each(|shape| shape.info = info);
    }
    scene.instances[instances..].iter_mut().for_each(|instance| overrides.apply(&mut instance.traits));
    scene.quads[quads..].iter_mut().for_each(|quad| overrides.apply(&mut quad.traits));
    scene.shapes[shapes..].iter_mut().for_each(|shape| overrides.apply(&mut shape.traits));
}

fn read_object<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    object: &Object,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
    assets: &mut Assets,
) {
    let keys: Vec<&'static str> = shape_keys().filter(|s| fields.has(s)).collect();
    let material_name = fields.string("material");
    let material = material_name.clone().and_then(|m| materials.get(build, textures, m.value, m.span));
    let [shape] = keys[..] else {
        let message =
            format!("{} needs exactly one of {}", object.name, shape_keys().collect::<Vec<_>>().join(", "));
        let help = "such as mesh = \"chair.ply\" or sphere = { center = [0, 1, 0], radius = 1 }";
        fields.report_help(message, help);
        return;
    };
    if shape == "mesh" {
        let listed = mesh_materials(build, fields, materials, textures);
        return add_mesh(build, fields, object, (material, &listed), assets);
    }
    let faces = match shape {
        "box" => fields.table("box").and_then(|f| read_box(&f)),
        "pyramid" => fields.table("pyramid").and_then(|f| read_pyramid(&f)),
        "triangle" => read_triangle(fields),
        _ => None,
    };
    let per_face = faces.as_ref().filter(|f| f.faces.len() > 1 && fields.has("materials"));
    if let Some(faces) = per_face {
        if let Some(ids) = face_materials(build, fields, faces.faces.len(), materials, textures) {
            add_faces(build, object, faces, &ids);
        }
        return;
    }
    let material = match material_name {
        Some(_) => material,
        None if materials.contains("default") => materials.get(build, textures, "default", fields.span()),
        None => {
            let message = format!("{} needs 'material'", object.name);
            fields.report_help(
                message,
                "name one, or add [materials.default] for all objects without a material",
            );
            None
        }
    };
    // Problems of the shape are reported even if its material has some.
    let id = material.unwrap_or(MaterialId(0));
    match shape {
        "quad" => add_quad(build, fields, object, id),
        "box" | "pyramid" | "triangle" => {
            if let Some(faces) = faces {
                add_faces(build, object, &faces, &vec![id; faces.faces.len()]);
            }
        }
        _ => read_round_shape(build, fields, object, shape, id),
    }
}

fn add_mesh(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    object: &Object,
    (material, listed): (Option<MaterialId>, &[MaterialId]),
    assets: &mut Assets,
) {
    let Some(file) = fields.string("mesh") else { return };
    let crease = fields.has("smooth").then(|| fields.number_in("smooth", 0.0..180.0, 0.0).to_radians());
    let subdivision = read_subdivision(fields);
    let Some(asset) = assets.get(build, file.value, file.span.clone(), crease) else { return };
    let mut asset = asset.into_owned();
    if let Some(subdivision) = subdivision {
        for i in &mut asset.instances {
            i.mesh = subdivided_mesh(build, fields, i.mesh, i.motion, subdivision).unwrap_or(i.mesh);
        }
    }
    let keys = MeshKeys::read(build, fields, assets);
    for i in &asset.instances {
        let scene = &mut build.loaded.scene;
        if !listed.is_empty()
            && let Err(message) = assets.list_materials(scene, i.mesh, &asset.materials, listed)
        {
            fields.problems.push(file.span.clone(), format!("'{}': {message}", file.value));
        }
        let world_from_object = object.world_from_object * i.world_from_object;
        let mut motion = object.instance_motion(&mut scene.motion, i);
        if let Some(keys) = &keys {
            match keys.apply(build, assets, (i.mesh, motion, world_from_object)) {
                Ok(with_keys) => motion = with_keys,
                Err(message) => fields.problems.push(file.span.clone(), message),
            }
        }
        let name =
            if i.name == NAMELESS { object.name.clone() } else { format!("{}/{}", object.name, i.name) };
        let mut instance = Instance { name, world_from_object, motion, ..i.clone() };
        set_material(&mut build.loaded.scene, &mut instance, material);
        build.loaded.scene.instances.push(instance);
    }
    let Some(first) = asset.shapes.first() else { return };
    if object.motion.is_some() {
        let message = "a point cloud can't have a 'motion'";
        return fields.problems.push_help(file.span, message, "leave 'motion' out");
    }
    if placed_shape(&object.world_from_object, first.clone()).is_none() {
        let message = ("points-deformed", "this transform would deform the spheres of a point cloud");
        return fields.problems.push_help(file.span, message, "scale uniformly");
    }
    let shapes =
        asset.shapes.iter().filter_map(|shape| placed_shape(&object.world_from_object, shape.clone()));
    let shapes = shapes.map(|s| Shape { material: material.unwrap_or(s.material), ..s });
    build.loaded.scene.shapes.extend(shapes);
}

/// Replaces the materials of an instance. For splats, the material is multiplied by their colours.
fn set_material(scene: &mut Scene, instance: &mut Instance, material: Option<MaterialId>) {
    let Some(material) = material else { return };
    if scene.meshes[instance.mesh.index()].splats.is_some() {
        scene.materials[material.index()].use_vertex_colors = true;
    }
    instance.material = Some(material);
}

/// The key `materials` of a mesh, indexed by `material_index`.
fn mesh_materials<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) -> Vec<MaterialId> {
    if !fields.has("materials") {
        return Vec::new();
    }
    let count = fields.list("materials").map_or(0, |list| list.len());
    if count == 0 {
        fields.report("'materials' must name at least one material");
    }
    face_materials(build, fields, count, materials, textures).unwrap_or_default()
}

fn face_materials<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    count: usize,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) -> Option<Vec<MaterialId>> {
    let list = fields.list("materials")?;
    fields.exclusive(["material", "materials"]);
    if list.len() != count {
        fields.report(format!("'materials' names {} materials, but the shape has {count} faces", list.len()));
        return None;
    }
    let mut ids = Vec::new();
    for value in list {
        match value.get_ref().as_str() {
            Some(name) => ids.extend(materials.get(build, textures, name, value.span())),
            None => fields.problems.push(value.span(), "'materials' must hold names of materials"),
        }
    }
    (ids.len() == count).then_some(ids)
}

fn read_box(fields: &Fields) -> Option<Faces> {
    let min = fields.require("min", fields.vector("min"));
    let max = fields.require("max", fields.vector("max"));
    fields.finish();
    let (min, max) = (min?, max?);
    if !min.value.cmplt(max.value).all() {
        fields.problems.push(max.span, "'max' of a box must exceed 'min' in every coordinate");
        return None;
    }
    Some(box_faces(min.value, max.value))
}

fn read_pyramid(fields: &Fields) -> Option<Faces> {
    let base = fields.vector("base").map_or(DVec3::ZERO, |b| b.value);
    let size = fields.require("size", fields.numbers::<2>("size"));
    let height = fields.require("height", fields.number("height"));
    fields.finish();
    let (size, height) = (size?, height?);
    if size.value.iter().any(|s| *s <= 0.0) || height.value <= 0.0 {
        fields.report("'size' and 'height' of a pyramid must be above 0");
        return None;
    }
    Some(pyramid_faces(base, size.value, height.value))
}

fn read_triangle(fields: &Fields) -> Option<Faces> {
    let list = fields.list("triangle")?;
    let corners: Option<Vec<[f64; 3]>> = list.iter().map(|p| numbers::<3>(p.get_ref())).collect();
    match corners.as_deref() {
        Some([a, b, c]) => Some(triangle_faces([*a, *b, *c].map(DVec3::from))),
        _ => {
            let span = fields.raw("triangle").map_or(fields.span(), |t| t.span());
            fields.problems.push(span, "'triangle' must be a list of three points");
            None
        }
    }
}

/// Adds flat faces as one mesh with a part for each face.
fn add_faces(build: &mut SceneFileBuilder, object: &Object, faces: &Faces, ids: &[MaterialId]) {
    let origin = faces.faces[0][0].0;
    let (mut mesh, counts) = faces.to_mesh(&object.name, origin);
    let mut first_triangle = 0;
    for (&material, triangle_count) in ids.iter().zip(counts) {
        mesh.parts.push(MeshPart { first_triangle, triangle_count, material });
        first_triangle += triangle_count;
    }
    add_mesh_instance(build, object, mesh, object.world_from_object * DAffine3::from_translation(origin));
}

fn add_quad(build: &mut SceneFileBuilder, object_fields: &Fields, object: &Object, material: MaterialId) {
    let Some(fields) = object_fields.table("quad") else { return };
    let corner = fields.require("corner", fields.vector("corner"));
    let u = fields.require("u", fields.vector("u"));
    let v = fields.require("v", fields.vector("v"));
    fields.finish();
    let (Some(corner), Some(u), Some(v)) = (corner, u, v) else { return };
    if u.value.cross(v.value).length() == 0.0 {
        return fields.report("'u' and 'v' of a quad are parallel or 0");
    }
    let m = object.world_from_object;
    let (mut corner, mut edge_u) = (m.transform_point3(corner.value), m.transform_vector3(u.value));
    let edge_v = m.transform_vector3(v.value);
    // Mirroring transforms keep the front.
    if m.matrix3.determinant() < 0.0 {
        corner += edge_u;
        edge_u = -edge_u;
    }
    let scene = &mut build.loaded.scene;
    scene.motion.quads.extend(object.motion.clone().map(|keys| (scene.quads.len(), keys)));
    scene.quads.push(Quad { name: object.name.clone(), ..Quad::new(corner, edge_u, edge_v, material) });
}

/// A table of `[[objects]]`.
struct Object {
    pub name: String,
    pub world_from_object: DAffine3,
    /// Motion relative to `world_from_object`.
    pub motion: Option<Keyframes<DAffine3>>,
}

impl Object {
    /// Reads transform and motion of a table.
    pub fn read(build: &mut SceneFileBuilder, fields: &Fields, name: String) -> Object {
        let world_from_object = transform::read(fields);
        match transform::read_motion(build, fields, &name) {
            None => Object { name, world_from_object, motion: None },
            Some(EvaluatedMotion { at_time, relative_keys }) => {
                let world_from_object = at_time * world_from_object;
                Object { name, world_from_object, motion: relative_keys }
            }
        }
    }

    /// The motion of an instance of a mesh file under the object's transform and motion.
    fn instance_motion(&self, motion: &mut SceneMotion, instance: &Instance) -> Motion {
        let file_keys = match instance.motion {
            Motion::Keyed(number) => motion.instances.get(number as usize).cloned(),
            _ => None,
        };
        motion.add_instance(match (&self.motion, file_keys) {
            (None, None) => return instance.motion,
            (Some(keys), None) => keys.map(|key| *key * self.world_from_object * instance.world_from_object),
            (None, Some(keys)) => keys.map(|key| self.world_from_object * *key),
            (Some(keys), Some(file_keys)) => combined_motion(keys, &file_keys, &self.world_from_object),
        })
    }
}

/// The motion of an animated instance of a file under a moving object, with as many keys as the longer list.
fn combined_motion(
    object: &Keyframes<DAffine3>,
    instance: &Keyframes<DAffine3>,
    world_from_object: &DAffine3,
) -> Keyframes<DAffine3> {
    let count = object.keys.len().max(instance.keys.len());
    let at = |i: usize| {
        let time = i as f32 / count.saturating_sub(1).max(1) as f32;
        transform_at(&object.keys, time) * *world_from_object * transform_at(&instance.keys, time)
    };
    let neighbours = object.neighbours.zip(instance.neighbours);
    let neighbours = neighbours.map(|(o, i)| [0, 1].map(|k| o[k] * *world_from_object * i[k]));
    Keyframes { keys: (0..count).map(at).collect(), neighbours }
}

/// Adds a mesh with an instance.
fn add_mesh_instance(build: &mut SceneFileBuilder, object: &Object, mesh: Mesh, world_from_object: DAffine3) {
    let scene = &mut build.loaded.scene;
    let mesh = scene.add_mesh(mesh);
    let motion = match &object.motion {
        Some(keys) => scene.motion.add_instance(keys.map(|key| *key * world_from_object)),
        None => Motion::Still,
    };
    let name = object.name.clone();
    scene.instances.push(Instance { name, motion, ..Instance::new(mesh, world_from_object) });
}

/// Reads `[objects.NAME]`: changes of the model's objects.
fn override_objects<'a>(
    build: &mut SceneFileBuilder,
    all: &Fields<'a>,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) {
    for (name, value) in all.entries() {
        if let Some(fields) = Fields::of_value(format!("object '{name}'"), value, all.problems) {
            override_object(build, &fields, (name, value.span()), materials, textures);
        }
    }
}

/// Changes a node of the model and its descendants: `hidden`, `material`, `light_group`, links, subdivision, and visibility
/// (see [`super::traits`]).
fn override_object<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    (name, span): (&str, Range<usize>),
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) {
    let is_hidden = fields.flag("hidden", false);
    let material =
        fields.string("material").and_then(|name| materials.get(build, textures, name.value, name.span));
    let overrides = TraitOverrides::read(build, fields);
    let light_group = fields.has("light_group").then(|| group(fields, "light_group"));
    let subdivision = read_subdivision(fields);
    fields.finish();
    let scene = &mut build.loaded.scene;
    build.nodes.update(scene);
    let (instances, lights) = (build.nodes.instances(name, scene), build.nodes.lights(name));
    if instances.is_empty() && lights.is_empty() {
        let nodes = scene.instances.iter().flat_map(|i| i.name.split('/'));
        let names = nodes.chain(scene.lights.iter().map(|l| l.name.as_str()));
        let help = suggestion(name, names, format!("it has {} mesh instances", scene.instances.len()));
        return fields.problems.push_help(span, format!("the model has no object '{name}'"), help);
    }
    if is_hidden {
        return build.nodes.hide(&instances, &lights);
    }
    for i in lights {
        let light = &mut scene.lights[i];
        light.group = light_group.clone().unwrap_or(std::mem::take(&mut light.group));
        light.visible_to = overrides.traits.map_or(light.visible_to, |traits| traits.visible_to);
        light.links = overrides.links.unwrap_or(light.links);
    }
    for &i in &instances {
        let mut instance = scene.instances[i].clone();
        instance.light_group = light_group.clone().or(instance.light_group.take());
        overrides.apply(&mut instance.traits);
        set_material(scene, &mut instance, material);
        scene.instances[i] = instance;
    }
    for i in instances.into_iter().filter(|_| subdivision.is_some()) {
        let Instance { mesh, motion, .. } = build.loaded.scene.instances[i];
        if let Some(mesh) =
            subdivision.and_then(|options| subdivided_mesh(build, fields, mesh, motion, options))
        {
            build.loaded.scene.instances[i].mesh = mesh;
        }
    }
}

/// Reads the keys specific to a shape: its kind and rotation. `None` after a problem.
type ReadShape = fn(&Fields) -> Option<(ShapeKind, DQuat)>;

/// Shapes with centre and radius, by key.
const ROUND_SHAPES: &[(&str, ReadShape)] = &[
    ("sphere", |_| Some((ShapeKind::Sphere, DQuat::IDENTITY))),
    ("disk", |fields| Some((ShapeKind::Disk, facing_normal(fields)?))),
];

/// Keys of the shapes with centre and radius.
fn round_shape_keys() -> impl Iterator<Item = &'static str> {
    ROUND_SHAPES.iter().map(|(key, _)| *key)
}

/// Reads and adds a shape with centre and radius.
fn read_round_shape(
    build: &mut SceneFileBuilder,
    object_fields: &Fields,
    object: &Object,
    key: &'static str,
    material: MaterialId,
) {
    let Some((_, read_shape_kind)) = ROUND_SHAPES.iter().find(|(known, _)| *known == key) else { return };
    let Some(fields) = object_fields.table(key) else { return };
    let (center, radius) = center_and_radius(&fields, key);
    let kind = read_shape_kind(&fields);
    fields.finish();
    let (Some(center), Some(radius), Some((kind, rotation))) = (center, radius, kind) else { return };
    let shape =
        Shape { name: object.name.clone(), kind, rotation, ..Shape::sphere(center, radius, material) };
    add_shape(build, object, shape);
}

fn center_and_radius(fields: &Fields, shape: &str) -> (Option<DVec3>, Option<f64>) {
    let center = fields.require("center", fields.vector("center"));
    let radius = fields.require("radius", fields.number("radius"));
    let radius = radius.and_then(|r| match r.value > 0.0 {
        true => Some(r.value),
        false => {
            fields.problems.push(r.span, format!("'radius' of a {shape} must be above 0"));
            None
        }
    });
    (center.map(|c| c.value), radius)
}

/// The rotation from z to the key `normal`, default y.
fn facing_normal(fields: &Fields) -> Option<DQuat> {
    let Some(normal) = fields.vector("normal") else { return Some(facing(DVec3::Y)) };
    let unit = normal.value.try_normalize();
    if unit.is_none() {
        fields.problems.push(normal.span, "'normal' has length 0");
    }
    unit.map(facing)
}

/// The rotation from z to a unit normal, with y as near to up as possible; to -z for vertical normals.
fn facing(normal: DVec3) -> DQuat {
    let is_vertical = normal.y.abs() > 1.0 - 1e-9;
    let up = if is_vertical { DVec3::NEG_Z } else { DVec3::Y };
    let right = up.cross(normal).normalize();
    DQuat::from_mat3(&DMat3::from_cols(right, normal.cross(right), normal)).normalize()
}

/// Whether the shape is an emissive sphere with non-uniformly scaling motion, which can't be sampled as a light.
fn is_stretched_light(build: &SceneFileBuilder, object: &Object, shape: &Shape) -> bool {
    let material = build.loaded.scene.materials.get(shape.material.index());
    let is_emissive = material.is_some_and(|material| material.emission.is_some());
    let stretches = |motion: &Keyframes<DAffine3>| motion.all().any(|key| uniform_scale(key).is_none());
    is_emissive && shape.kind == ShapeKind::Sphere && object.motion.as_ref().is_some_and(stretches)
}

/// Adds a shape under the transform of its object; ellipsoids and ellipses become meshes, with a warning.
fn add_shape(build: &mut SceneFileBuilder, object: &Object, shape: Shape) {
    let (is_stretched, kind) = (is_stretched_light(build, object, &shape), shape.kind.name());
    let reason = if is_stretched { "motion deforms the emissive" } else { "transform deforms the" };
    if let Some(placed) = placed_shape(&object.world_from_object, shape.clone()).filter(|_| !is_stretched) {
        let scene = &mut build.loaded.scene;
        scene.motion.shapes.extend(object.motion.clone().map(|keys| (scene.shapes.len(), keys)));
        return scene.shapes.push(placed);
    }
    let mut mesh = Mesh { name: shape.name.clone(), ..mesh_of(shape.kind) };
    let triangle_count = mesh.triangles.len() as u32;
    mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material: shape.material });
    let message =
        format!("{}: its {reason} {kind}, which becomes a mesh of {triangle_count} triangles", shape.name);
    let code = if is_stretched { "light-stretched" } else { "shape-bent" };
    build.warn((code, message));
    let scale = DVec3::splat(shape.radius);
    let unit = DAffine3::from_scale_rotation_translation(scale, shape.rotation, shape.center);
    add_mesh_instance(build, object, mesh, object.world_from_object * unit);
}

/// Whether any object has the key `subdivide`.
pub(super) fn uses_subdivision(root: &Fields) -> bool {
    let has_key = |value: &DeValue| value.as_table().is_some_and(|table| table.contains_key("subdivide"));
    match root.raw("objects").map(|objects| objects.get_ref()) {
        Some(DeValue::Array(list)) => list.iter().any(|value| has_key(value.get_ref())),
        Some(DeValue::Table(all)) => all.values().any(|value| has_key(value.get_ref())),
        _ => false,
    }
}

/// The key `subdivide` of an object.
fn read_subdivision(fields: &Fields) -> Option<Subdivision> {
    let value = fields.raw("subdivide")?;
    if number(value.get_ref()).is_some() {
        let levels = fields.unsigned("subdivide", 0, MAX_LEVELS)?;
        return Some(Subdivision { levels, has_round_corners: false });
    }
    let Some(table) = value.get_ref().as_table() else {
        let message =
            format!("'subdivide' of {} must be a number of levels or a table", fields.description());
        fields.problems.push_help(value.span(), message, "write subdivide = 2");
        return None;
    };
    let table = Fields::new("'subdivide'", table, value.span(), fields.problems);
    let levels = table.require("levels", table.unsigned("levels", 0, MAX_LEVELS));
    table.choice("scheme", &[("catmull-clark", ())]);
    let corners = table.choice("corners", &[("sharp", false), ("round", true)]);
    table.finish();
    Some(Subdivision { levels: levels?, has_round_corners: corners.unwrap_or(false) })
}

/// The subdivided mesh; `None` after reporting that it can't be subdivided.
fn subdivided_mesh(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    id: MeshId,
    motion: Motion,
    subdivision: Subdivision,
) -> Option<MeshId> {
    let subdivided = match motion {
        Motion::Deforms => Err(DEFORMS.to_string()),
        _ => build.loaded.polygons.add_to(&mut build.loaded.scene, id, subdivision),
    };
    let span = fields.raw("subdivide").map_or(fields.span(), |value| value.span());
    subdivided.map_err(|message| fields.problems.push(span, message)).ok()
}
