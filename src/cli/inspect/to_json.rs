//! The answer for programs.

use super::facts::{instance_materials, material_images, placed_triangles, used_images, used_materials};
use super::words::{environment_name, light_kind};
use crate::cli::json::Json;
use oscura::error::Warning;
use oscura::load::Loaded;
use oscura::scene::{Camera, Extent, Light, LightKind, Projection, Scene, instance_extents, scene_extent};
use std::path::Path;

/// One object with everything.
pub fn of(path: &Path, loaded: &Loaded) -> Json {
    let scene = &loaded.scene;
    let extents = instance_extents(scene);
    Json::Object(vec![
        ("file", Json::Text(path.display().to_string())),
        ("name", text(&scene.name)),
        ("meshes", count(scene.meshes.len())),
        ("instances", count(scene.instances.len())),
        ("triangles", Json::Integer(placed_triangles(scene))),
        ("spheres", count(scene.spheres.len())),
        ("quads", count(scene.quads.len())),
        ("extent", extent(scene_extent(scene, &extents))),
        ("objects", objects(scene, &extents)),
        ("materials", materials(scene)),
        ("lights", Json::List(scene.lights.iter().map(light).collect())),
        ("environment", text(environment_name(&scene.environment))),
        ("images", images(scene)),
        ("cameras", Json::List(scene.cameras.iter().map(camera).collect())),
        ("notes", Json::List(loaded.notes.iter().map(warning).collect())),
        ("warnings", Json::List(loaded.warnings.iter().map(warning).collect())),
        ("left_out", Json::texts(&loaded.left_out)),
    ])
}

fn count(n: usize) -> Json {
    Json::Integer(n as u64)
}

fn text(text: &str) -> Json {
    Json::Text(text.to_string())
}

fn colors(rgb: [f32; 3]) -> Json {
    Json::decimals(&rgb.map(f64::from))
}

fn extent(extent: Extent) -> Json {
    extent.0.map_or(Json::Null, |(low, high)| {
        Json::List(vec![Json::decimals(&low.to_array()), Json::decimals(&high.to_array())])
    })
}

fn objects(scene: &Scene, extents: &[Extent]) -> Json {
    let named = |id: oscura::scene::MaterialId| text(&scene.materials[id.index()].name);
    let instances = scene.instances.iter().zip(extents).map(|(i, e)| {
        let mesh = &scene.meshes[i.mesh.index()];
        let materials = instance_materials(scene, i).into_iter().map(named).collect();
        Json::Object(vec![
            ("kind", text("mesh")),
            ("name", text(&i.name)),
            ("mesh", text(&mesh.name)),
            ("mesh_index", count(i.mesh.index())),
            ("vertices", count(mesh.positions.len())),
            ("triangles", count(mesh.triangles.len())),
            ("normals", Json::Bool(!mesh.normals.is_empty())),
            ("uv_sets", count(mesh.uv_sets.len())),
            ("materials", Json::List(materials)),
            ("extent", extent(*e)),
        ])
    });
    let spheres = scene.spheres.iter().map(|s| {
        Json::Object(vec![
            ("kind", text("sphere")),
            ("name", text(&s.name)),
            ("center", Json::decimals(&s.center.to_array())),
            ("radius", Json::Decimal(s.radius)),
            ("materials", Json::List(vec![named(s.material)])),
        ])
    });
    let quads = scene.quads.iter().map(|q| {
        Json::Object(vec![
            ("kind", text("quad")),
            ("name", text(&q.name)),
            ("corner", Json::decimals(&q.corner.to_array())),
            ("edge_u", Json::decimals(&q.edge_u.to_array())),
            ("edge_v", Json::decimals(&q.edge_v.to_array())),
            ("materials", Json::List(vec![named(q.material)])),
        ])
    });
    Json::List(instances.chain(spheres).chain(quads).collect())
}

fn materials(scene: &Scene) -> Json {
    let list = scene.materials.iter().zip(used_materials(scene)).map(|(m, used)| {
        let images = material_images(scene, m).into_iter().map(count).collect();
        let radiance = m.emission.map_or(Json::Null, |e| colors(e.radiance.factor));
        Json::Object(vec![
            ("name", text(&m.name)),
            ("model", text(m.model.name())),
            ("used", Json::Bool(used)),
            ("emits", Json::Bool(m.emission.is_some())),
            ("radiance", radiance),
            ("images", Json::List(images)),
        ])
    });
    Json::List(list.collect())
}

fn light(light: &Light) -> Json {
    let (kind, unit) = light_kind(light);
    let vector = |v: oscura::math::DVec3| Json::decimals(&v.to_array());
    let mut fields = vec![
        ("name", text(&light.name)),
        ("kind", text(kind)),
        ("intensity", colors(light.intensity)),
        ("unit", text(unit)),
    ];
    match light.kind {
        LightKind::Point { position } => fields.push(("position", vector(position))),
        LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, .. } => fields.extend([
            ("position", vector(position)),
            ("direction", vector(direction)),
            ("inner_angle_deg", Json::Decimal(inner_angle_rad.to_degrees())),
            ("outer_angle_deg", Json::Decimal(outer_angle_rad.to_degrees())),
        ]),
        LightKind::Directional { direction } => fields.push(("direction", vector(direction))),
    }
    Json::Object(fields)
}

fn camera(camera: &Camera) -> Json {
    let placement = camera.world_from_camera;
    let (kind, size) = match camera.projection {
        Projection::Perspective { vfov_rad } => ("perspective", ("vfov_deg", vfov_rad.to_degrees())),
        Projection::Orthographic { half_height } => ("orthographic", ("height", 2.0 * half_height)),
    };
    let lens = camera.lens.map_or(Json::Null, |l| {
        Json::Object(vec![
            ("defocus_angle_deg", Json::Decimal(l.defocus_angle_rad.to_degrees())),
            ("focus_distance", Json::Decimal(l.focus_distance)),
        ])
    });
    Json::Object(vec![
        ("name", text(&camera.name)),
        ("kind", text(kind)),
        (size.0, Json::Decimal(size.1)),
        ("aspect_ratio", camera.aspect_ratio.map_or(Json::Null, Json::Decimal)),
        ("position", Json::decimals(&placement.translation.to_array())),
        ("direction", Json::decimals(&(-placement.matrix3.z_axis).to_array())),
        ("up", Json::decimals(&placement.matrix3.y_axis.to_array())),
        ("lens", lens),
    ])
}

fn images(scene: &Scene) -> Json {
    let list = scene.images.iter().zip(used_images(scene)).map(|(image, used)| {
        Json::Object(vec![
            ("name", text(&image.name)),
            ("width", Json::Integer(image.width.into())),
            ("height", Json::Integer(image.height.into())),
            ("channels", Json::Integer(image.channels.into())),
            ("bytes", count(image.bytes())),
            ("used", Json::Bool(used)),
        ])
    });
    Json::List(list.collect())
}

fn warning(warning: &Warning) -> Json {
    let file = warning.file.as_ref().map_or(Json::Null, |f| Json::Text(f.display().to_string()));
    Json::Object(vec![("file", file), ("place", text(&warning.place)), ("message", text(&warning.message))])
}
