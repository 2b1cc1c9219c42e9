//! `[[objects]]`: each has exactly one shape, a `material`, optionally a `name`, a `transform` (`oscura help
//! transform`) and a `motion` (`oscura help motion`).
//!
//! | Shape | Value |
//! |---|---|
//! | `mesh` | a .gltf, .glb, .obj or .ply file; its cameras and, with a note, its lights are ignored, `material` replaces all of its own |
//! | `quad` | `{ corner, u, v }`; the front is where u x v points |
//! | `box` | `{ min, max }`; `materials` may name six: -x, +x, -y, +y, -z, +z |
//! | `pyramid` | `{ base, size = [x, z], height }`, over the middle `base`; `materials` may name five: base, +z, +x, -z, -x |
//! | `triangle` | three points |
//!
//! `smooth = 30` gives a `mesh` without normals smooth ones, of any type; edges where faces meet at more degrees stay sharp.
//!
//! `subdivide = 2` makes smooth surfaces of the polygons of a `mesh` (`oscura help subdivision`).
//!
//! `visible_to = ["camera", "diffuse", "glossy", "transmission", "volume", "shadow"]` lists the kinds of rays that see an
//! object, by default all: rays of other kinds pass it, and get no light of it. `visible_to_camera = false` leaves out
//! the camera. What `shadow` rays don't see casts no shadow. With `holdout = true` the picture is transparent where the
//! camera sees the object. With `shadow_catcher = true` the camera sees only what other objects change on it, to be laid
//! over a photograph; the layer `ShadowCatcher` has the factors by channel.
//!
//! `light_link` and `shadow_link` say which objects the light of one that shines lights, and which cast shadows in it
//! (`oscura help lights`).
//!
//! Shapes without a material take `[materials.default]`. Quads stay what they are under every transform.

use super::assets::Assets;
use super::build::Build;
use super::fields::{Fields, numbers};
use super::materials::Materials;
use super::object::{Object, add_placed};
use super::textures::Textures;
use super::visibility::GivenTraits;
use super::{overrides, round, subdivided};
use crate::load::shapes::{Faces, box_faces, pyramid_faces, triangle_faces};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Instance, MaterialId, MeshPart, Quad, Shape};

/// The keys of shapes.
fn shapes() -> impl Iterator<Item = &'static str> {
    ["mesh"].into_iter().chain(round::keys()).chain(["quad", "box", "pyramid", "triangle"])
}

/// Reads all objects.
pub(super) fn read<'a>(
    build: &mut Build,
    root: &Fields<'a>,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
    assets: &mut Assets,
) {
    if build.is_beside_model && root.raw("objects").is_some_and(|v| v.get_ref().is_table()) {
        let changed = root.table("objects");
        changed.into_iter().for_each(|all| overrides::objects(build, &all, materials, textures));
        return build.nodes.remove_hidden(&mut build.loaded.scene);
    }
    let Some(list) = root.list("objects") else { return };
    for table in list.iter().filter_map(|v| v.get_ref().as_table()) {
        let file = table.get("mesh").and_then(|v| v.get_ref().as_str());
        if let Some(file) = file.filter(|_| !table.contains_key("material")) {
            assets.expect_materials(build, file);
        }
        if let Some(file) = file.filter(|_| table.contains_key("subdivide")) {
            assets.expect_polygons(build, file);
        }
    }
    for (i, value) in list.iter().enumerate() {
        let Some(table) = value.get_ref().as_table() else {
            root.problems.push(value.span(), "an object must be a table");
            continue;
        };
        let fields = Fields::new(format!("object {}", i + 1), table, value.span(), root.problems);
        if build.is_beside_model
            && let Some(node) = fields.string("node")
        {
            overrides::object(build, &fields, (node.value, node.span), materials, textures);
            continue;
        }
        let name = fields.string("name").map_or_else(|| format!("object {}", i + 1), |n| n.value.to_string());
        let object = Object::read(build, &fields, name);
        let before = counts(build);
        read_object(build, &fields, &object, materials, textures, assets);
        give_traits(build, &fields, before);
        fields.finish();
    }
    build.nodes.remove_hidden(&mut build.loaded.scene);
}

/// How many instances, quads and shapes there are.
fn counts(build: &Build) -> [usize; 3] {
    let scene = &build.loaded.scene;
    [scene.instances.len(), scene.quads.len(), scene.shapes.len()]
}

/// Gives what was added to the scene the traits that its object has.
fn give_traits(build: &mut Build, fields: &Fields, [instances, quads, shapes]: [usize; 3]) {
    let given = GivenTraits::read(build, fields);
    let scene = &mut build.loaded.scene;
    scene.instances[instances..].iter_mut().for_each(|instance| given.apply(&mut instance.traits));
    scene.quads[quads..].iter_mut().for_each(|quad| given.apply(&mut quad.traits));
    scene.shapes[shapes..].iter_mut().for_each(|shape| given.apply(&mut shape.traits));
}

fn read_object<'a>(
    build: &mut Build,
    fields: &Fields<'a>,
    object: &Object,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
    assets: &mut Assets,
) {
    let given: Vec<&'static str> = shapes().filter(|s| fields.has(s)).collect();
    let named = fields.string("material");
    let material = named.clone().and_then(|m| materials.get(build, textures, m.value, m.span));
    let [shape] = given[..] else {
        let message =
            format!("{} needs exactly one of {}", object.name, shapes().collect::<Vec<_>>().join(", "));
        fields.problems.push(fields.span(), message);
        return;
    };
    if shape == "mesh" {
        return add_mesh(build, fields, object, material, assets);
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
    let material = match named {
        Some(_) => material,
        None if materials.contains("default") => materials.get(build, textures, "default", fields.span()),
        None => {
            let message = format!("{} needs 'material'", object.name);
            fields.problems.push_help(
                fields.span(),
                message,
                "name one, or write a table [materials.default] for all objects without",
            );
            None
        }
    };
    // The shape's own problems are noted even where its material has one.
    let id = material.unwrap_or(MaterialId(0));
    match shape {
        "quad" => add_quad(build, fields, object, id),
        "box" | "pyramid" | "triangle" => {
            if let Some(faces) = faces {
                add_faces(build, object, &faces, &vec![id; faces.faces.len()]);
            }
        }
        round => round::add(build, fields, object, round, id),
    }
}

fn add_mesh(
    build: &mut Build,
    fields: &Fields,
    object: &Object,
    material: Option<MaterialId>,
    assets: &mut Assets,
) {
    let Some(file) = fields.string("mesh") else { return };
    let crease = fields.has("smooth").then(|| fields.number_in("smooth", 0.0..180.0, 0.0).to_radians());
    let how = subdivided::read(fields);
    let Some(mut asset) = assets.get(build, file.value, file.span.clone(), crease) else { return };
    if let Some(how) = how {
        for i in &mut asset.to_mut().instances {
            i.mesh = subdivided::mesh(build, fields, i.mesh, i.motion, how).unwrap_or(i.mesh);
        }
    }
    let scene = &mut build.loaded.scene;
    for i in &asset.instances {
        let world_from_object = object.world_from_object * i.world_from_object;
        let motion = object.moved(&mut scene.motion, i);
        let (name, material) = (format!("{}/{}", object.name, i.name), material.or(i.material));
        scene.instances.push(Instance { name, world_from_object, material, motion, ..i.clone() });
    }
    let Some(first) = asset.shapes.first() else { return };
    if object.motion.is_some() {
        let message = "the points of a point cloud can't move";
        return fields.problems.push_help(file.span, message, "leave 'motion' out");
    }
    if round::placed(object, first.clone()).is_none() {
        let message = "the points of a point cloud are spheres, which this transform bends";
        return fields.problems.push_help(file.span, message, "scale by the same factor along all axes");
    }
    let shapes = asset.shapes.iter().filter_map(|shape| round::placed(object, shape.clone()));
    let shapes = shapes.map(|s| Shape { material: material.unwrap_or(s.material), ..s });
    build.loaded.scene.shapes.extend(shapes);
}

fn face_materials<'a>(
    build: &mut Build,
    fields: &Fields<'a>,
    count: usize,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) -> Option<Vec<MaterialId>> {
    let list = fields.list("materials")?;
    if fields.has("material") {
        fields.problems.push(fields.span(), "'material' and 'materials' say the same: leave one out");
    }
    if list.len() != count {
        let message = format!("'materials' names {} materials, but the shape has {count} faces", list.len());
        fields.problems.push(fields.span(), message);
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
        fields.problems.push(fields.span(), "'size' and 'height' of a pyramid must be above 0");
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
fn add_faces(build: &mut Build, object: &Object, faces: &Faces, ids: &[MaterialId]) {
    let origin = faces.faces[0][0].0;
    let (mut mesh, counts) = faces.to_mesh(&object.name, origin);
    let mut first_triangle = 0;
    for (&material, triangle_count) in ids.iter().zip(counts) {
        mesh.parts.push(MeshPart { first_triangle, triangle_count, material });
        first_triangle += triangle_count;
    }
    add_placed(build, object, mesh, object.world_from_object * DAffine3::from_translation(origin));
}

fn add_quad(build: &mut Build, object_fields: &Fields, object: &Object, material: MaterialId) {
    let Some(fields) = object_fields.table("quad") else { return };
    let corner = fields.require("corner", fields.vector("corner"));
    let u = fields.require("u", fields.vector("u"));
    let v = fields.require("v", fields.vector("v"));
    fields.finish();
    let (Some(corner), Some(u), Some(v)) = (corner, u, v) else { return };
    if u.value.cross(v.value).length() == 0.0 {
        return fields.problems.push(fields.span(), "'u' and 'v' of a quad span no area");
    }
    let m = object.world_from_object;
    let (mut corner, mut edge_u) = (m.transform_point3(corner.value), m.transform_vector3(u.value));
    let edge_v = m.transform_vector3(v.value);
    // A mirroring transform would turn the front to the back.
    if m.matrix3.determinant() < 0.0 {
        corner += edge_u;
        edge_u = -edge_u;
    }
    let scene = &mut build.loaded.scene;
    scene.motion.quads.extend(object.motion.clone().map(|moving| (scene.quads.len(), moving)));
    scene.quads.push(Quad { name: object.name.clone(), ..Quad::new(corner, edge_u, edge_v, material) });
}
