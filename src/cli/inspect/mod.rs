//! `oscura inspect`: the contents of a scene, and unused parts of it.

use super::args::InspectArgs;
use super::json;
use super::process::Outcome;
use super::report::{ShapeCounts, name_options_in_loaded, print_line};
use super::scene_args::check_scene_path;
use oscura::error::{Result, Warning};
use oscura::image::Damage;
use oscura::load::stage::StageOptions;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::scene::{
    Camera, Extent, Light, MaterialId, Panorama, Projection, Scene, instance_extents, scene_extent,
};
use serde::Serialize;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use text::{
    environment_name, instance_materials, light_unit, material_images, placed_triangles, used_images,
    used_materials,
};

mod text;

pub(crate) fn run(args: &InspectArgs) -> Result<Outcome> {
    check_scene_path(&args.scene)?;
    let options = LoadOptions {
        allow_external: args.source.allow_external,
        point_radius: args.source.point_radius,
        no_sidecar: args.source.no_sidecar,
        blender: args.blender.options(),
        gltf: args.asset.options(),
        // Reports what 'render' would add to the scene: camera, light, ground.
        stage: StageOptions { is_dry_run: true, ..StageOptions::studio() },
        ..LoadOptions::default()
    };
    let mut loaded = load(&args.scene, &options)?;
    decode_images(&mut loaded)?;
    name_options_in_loaded(&mut loaded);
    if args.json {
        json::print(&of(&args.scene, &loaded));
    } else {
        text::lines(&args.scene, &loaded).iter().for_each(|l| print_line(l));
    }
    Ok(Outcome::Done)
}

/// Decodes images, one at a time, to report damaged ones as rendering would.
fn decode_images(loaded: &mut Loaded) -> Result<()> {
    let mut seen = HashSet::new();
    for image in &loaded.scene.images {
        if !image.is_encoded() || !seen.insert(Arc::as_ptr(&image.pixels)) {
            continue;
        }
        match image.decoded(&mut loaded.warnings) {
            Ok(_) => {}
            Err(Damage::LeftOut(warning)) => loaded.warnings.push(warning),
            Err(Damage::Fatal(error)) => return Err(error),
        }
    }
    Ok(())
}

/// The JSON output.
#[derive(Serialize)]
struct Contents<'a> {
    file: String,
    name: &'a str,
    meshes: usize,
    instances: usize,
    triangles: u64,
    #[serde(flatten)]
    shapes: ShapeCounts,
    quads: usize,
    extent: Option<Bounds>,
    objects: Vec<Object<'a>>,
    materials: Vec<MaterialEntry<'a>>,
    lights: Vec<LightEntry<'a>>,
    environment: &'static str,
    images: Vec<ImageEntry<'a>>,
    cameras: Vec<CameraEntry<'a>>,
    notes: Vec<WarningEntry<'a>>,
    warnings: Vec<WarningEntry<'a>>,
    left_out: &'a [String],
}

/// The contents of a file.
pub fn of(path: &Path, loaded: &Loaded) -> impl Serialize {
    let scene = &loaded.scene;
    let extents = instance_extents(scene);
    Contents {
        file: path.display().to_string(),
        name: &scene.name,
        meshes: scene.meshes.len(),
        instances: scene.instances.len(),
        triangles: placed_triangles(scene),
        shapes: ShapeCounts::of(scene),
        quads: scene.quads.len(),
        extent: bounds(scene_extent(scene, &extents)),
        objects: objects(scene, &extents),
        materials: materials(scene),
        lights: scene.lights.iter().map(light).collect(),
        environment: environment_name(&scene.environment),
        images: images(scene),
        cameras: scene.cameras.iter().map(camera).collect(),
        notes: loaded.notes.iter().map(warning).collect(),
        warnings: loaded.warnings.iter().map(warning).collect(),
        left_out: &loaded.left_out,
    }
}

#[derive(Serialize)]
struct MaterialEntry<'a> {
    name: &'a str,
    model: &'static str,
    used: bool,
    emits: bool,
    radiance: Option<[f64; 3]>,
    images: Vec<usize>,
}

fn materials(scene: &Scene) -> Vec<MaterialEntry<'_>> {
    let entries = scene.materials.iter().zip(used_materials(scene)).map(|(m, used)| MaterialEntry {
        name: &m.name,
        model: m.model.name(),
        used,
        emits: m.emission.is_some(),
        radiance: m.emission.map(|e| e.radiance.factor.map(f64::from)),
        images: material_images(scene, m),
    });
    entries.collect()
}

#[derive(Serialize)]
struct LightEntry<'a> {
    name: &'a str,
    kind: &'static str,
    intensity: [f64; 3],
    unit: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    position: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    direction: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    inner_angle_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    outer_angle_deg: Option<f64>,
}

fn light(light: &Light) -> LightEntry<'_> {
    let (position, direction, angles) =
        (light.kind.position(), light.kind.direction(), light.kind.cone_rad());
    LightEntry {
        name: &light.name,
        kind: light.kind.name(),
        intensity: light.intensity.map(f64::from),
        unit: light_unit(light),
        position: position.map(|p| p.to_array()),
        direction: direction.map(|d| d.to_array()),
        inner_angle_deg: angles.map(|a| a[0].to_degrees()),
        outer_angle_deg: angles.map(|a| a[1].to_degrees()),
    }
}

#[derive(Serialize)]
struct CameraEntry<'a> {
    name: &'a str,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    vfov_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    panorama: Option<PanoramaEntry>,
    aspect_ratio: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pixel_aspect: Option<f64>,
    position: [f64; 3],
    direction: [f64; 3],
    up: [f64; 3],
    lens: Option<LensEntry>,
}

/// The angles of a panorama, degrees.
#[derive(Serialize)]
struct PanoramaEntry {
    projection: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    longitude_deg: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    latitude_deg: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fov_deg: Option<f64>,
}

fn panorama(panorama: &Panorama) -> PanoramaEntry {
    let degrees = |limits: [f64; 2]| limits.map(f64::to_degrees);
    let (longitude_deg, latitude_deg, fov_deg) = match *panorama {
        Panorama::Equirectangular { longitude_rad, latitude_rad } => {
            (Some(degrees(longitude_rad)), Some(degrees(latitude_rad)), None)
        }
        Panorama::FisheyeEquidistant { fov_rad } | Panorama::FisheyeEquisolid { fov_rad, .. } => {
            (None, None, Some(fov_rad.to_degrees()))
        }
    };
    PanoramaEntry { projection: panorama.name(), longitude_deg, latitude_deg, fov_deg }
}

#[derive(Serialize)]
struct LensEntry {
    defocus_angle_deg: f64,
    focus_distance: f64,
}

fn camera(camera: &Camera) -> CameraEntry<'_> {
    let placement = camera.world_from_camera;
    let (kind, vfov_deg, height) = match camera.projection {
        Projection::Perspective { vfov_rad } => ("perspective", Some(vfov_rad.to_degrees()), None),
        Projection::Orthographic { half_height } => ("orthographic", None, Some(2.0 * half_height)),
        Projection::Panorama(_) => ("panorama", None, None),
    };
    let panorama = match &camera.projection {
        Projection::Panorama(own) => Some(panorama(own)),
        _ => None,
    };
    CameraEntry {
        name: &camera.name,
        kind,
        vfov_deg,
        height,
        panorama,
        aspect_ratio: camera.aspect_ratio,
        pixel_aspect: Some(camera.pixel_aspect).filter(|a| *a != 1.0),
        position: placement.translation.to_array(),
        direction: (-placement.matrix3.z_axis).to_array(),
        up: placement.matrix3.y_axis.to_array(),
        lens: camera.lens.map(|l| LensEntry {
            defocus_angle_deg: l.defocus_angle_rad.to_degrees(),
            focus_distance: l.focus_distance,
        }),
    }
}

#[derive(Serialize)]
struct ImageEntry<'a> {
    name: &'a str,
    width: u32,
    height: u32,
    channels: u32,
    bytes: usize,
    used: bool,
}

fn images(scene: &Scene) -> Vec<ImageEntry<'_>> {
    let entries = scene.images.iter().zip(used_images(scene)).map(|(image, used)| ImageEntry {
        name: &image.name,
        width: image.width,
        height: image.height,
        channels: image.channels,
        bytes: image.bytes(),
        used,
    });
    entries.collect()
}

#[derive(Serialize)]
struct WarningEntry<'a> {
    file: Option<String>,
    place: &'a str,
    message: &'a str,
}

fn warning(warning: &Warning) -> WarningEntry<'_> {
    let file = warning.file.as_ref().map(|f| f.display().to_string());
    WarningEntry { file, place: &warning.place, message: &warning.message }
}

/// Minimum and maximum corner, metres.
pub type Bounds = [[f64; 3]; 2];

/// The bounds of a non-empty extent.
pub fn bounds(extent: Extent) -> Option<Bounds> {
    extent.0.map(|(low, high)| [low.to_array(), high.to_array()])
}

/// An instance of a mesh, a shape, a quad or curves.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Object<'a> {
    Mesh {
        kind: &'static str,
        name: &'a str,
        mesh: &'a str,
        mesh_index: usize,
        vertices: usize,
        triangles: usize,
        gaussian_splats: usize,
        normals: bool,
        uv_sets: usize,
        #[serde(skip_serializing_if = "Vec::is_empty")]
        attributes: Vec<&'a str>,
        materials: Vec<&'a str>,
        extent: Option<Bounds>,
    },
    Shape {
        kind: &'static str,
        name: &'a str,
        center: [f64; 3],
        radius: f64,
        materials: [&'a str; 1],
    },
    Quad {
        kind: &'static str,
        name: &'a str,
        corner: [f64; 3],
        edge_u: [f64; 3],
        edge_v: [f64; 3],
        materials: [&'a str; 1],
    },
    Curves {
        kind: &'static str,
        name: &'a str,
        basis: &'static str,
        strands: usize,
        points: usize,
        materials: [&'a str; 1],
    },
}

/// All objects of a scene; `extents`: of the instances.
pub fn objects<'a>(scene: &'a Scene, extents: &[Extent]) -> Vec<Object<'a>> {
    let named = |id: MaterialId| scene.materials[id.index()].name.as_str();
    let instances = scene.instances.iter().zip(extents).map(|(i, e)| {
        let mesh = &scene.meshes[i.mesh.index()];
        Object::Mesh {
            kind: "mesh",
            name: &i.name,
            mesh: &mesh.name,
            mesh_index: i.mesh.index(),
            vertices: mesh.positions.len(),
            triangles: mesh.triangles.len(),
            gaussian_splats: mesh.splats.as_ref().map_or(0, |splats| splats.len()),
            normals: !mesh.normals.is_empty(),
            uv_sets: mesh.uv_sets.len(),
            attributes: mesh.attributes.iter().map(|attribute| attribute.name.as_str()).collect(),
            materials: instance_materials(scene, i).into_iter().map(named).collect(),
            extent: bounds(*e),
        }
    });
    let shapes = scene.shapes.iter().map(|s| Object::Shape {
        kind: s.kind.name(),
        name: &s.name,
        center: s.center.to_array(),
        radius: s.radius,
        materials: [named(s.material)],
    });
    let quads = scene.quads.iter().map(|q| Object::Quad {
        kind: "quad",
        name: &q.name,
        corner: q.corner.to_array(),
        edge_u: q.edge_u.to_array(),
        edge_v: q.edge_v.to_array(),
        materials: [named(q.material)],
    });
    let curves = scene.curves.iter().map(|c| Object::Curves {
        kind: "curves",
        name: &c.name,
        basis: c.basis.name(),
        strands: c.strands.len(),
        points: c.points.len(),
        materials: [named(c.material)],
    });
    instances.chain(shapes).chain(quads).chain(curves).collect()
}
