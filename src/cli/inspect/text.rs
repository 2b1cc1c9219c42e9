//! Text output of `oscura inspect`.

use crate::cli::report::ShapeCounts;
use oscura::image::{Encoded, Encoding, Image, Pixels};
use oscura::load::Loaded;
use oscura::scene::{
    AlphaMode, BounceLimits, Camera, Clamp, ColorSlot, Environment, FloatSlot, GlassReflection, Instance,
    Light, LightKind, Material, MaterialId, MixComponent, Model, Panorama, Parameter, Parameters,
    PbrMaterial, Projection, Scene, SkippedCaustics, Texture, instance_extents, scene_extent,
};
use std::collections::HashMap;
use std::path::Path;

/// All lines of the output.
pub fn lines(path: &Path, loaded: &Loaded) -> Vec<String> {
    let scene = &loaded.scene;
    let mut out = vec![path.display().to_string()];
    if !scene.name.is_empty() {
        out.push(format!("  scene      '{}'", scene.name));
    }
    geometry(scene, &mut out);
    out.extend(tree(scene).iter().map(|l| format!("    {l}")));
    section(&mut out, "materials", scene.materials.len());
    for (m, used) in scene.materials.iter().zip(used_materials(scene)) {
        let unused = if used { "" } else { "; not used" };
        out.push(format!("    '{}': {}{unused}", m.name, describe_material(scene, m)));
    }
    section(&mut out, "lights", scene.lights.len());
    for l in &scene.lights {
        out.push(format!("    '{}': {}", l.name, describe_light(l)));
    }
    out.push(format!("  environment {}", describe_environment(scene)));
    section(&mut out, "images", scene.images.len());
    for (image, used) in scene.images.iter().zip(used_images(scene)) {
        out.push(format!("    {}, {}", image_line(image), if used { "used" } else { "not used" }));
    }
    section(&mut out, "cameras", scene.cameras.len());
    for (i, camera) in scene.cameras.iter().enumerate() {
        out.push(format!("    {i} '{}': {}", camera.name, describe_camera(camera)));
    }
    let settings = settings(scene);
    if !settings.is_empty() {
        out.push(format!("  settings   {}", settings.join(", ")));
    }
    if !loaded.notes.is_empty() {
        section(&mut out, "notes", loaded.notes.len());
        out.extend(loaded.notes.iter().map(|w| format!("    {w}")));
    }
    section(&mut out, "warnings", loaded.warnings.len());
    out.extend(loaded.warnings.iter().map(|w| format!("    {w}")));
    section(&mut out, "left out", loaded.left_out.len());
    out.extend(loaded.left_out.iter().map(|w| format!("    {w}")));
    out
}

fn section(out: &mut Vec<String>, name: &str, count: usize) {
    out.push(format!("  {name:<10} {count}"));
}

fn plural(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}

fn geometry(scene: &Scene, out: &mut Vec<String>) {
    let vertices: usize = scene.meshes.iter().map(|m| m.positions.len()).sum();
    out.push(format!(
        "  geometry   {} of {vertices} vertices, placed {} ({}), {}{}{}",
        plural(scene.meshes.len(), "mesh", "meshes"),
        plural(scene.instances.len(), "time", "times"),
        plural(placed_triangles(scene) as usize, "triangle", "triangles"),
        ShapeCounts::of(scene).text(),
        plural(scene.quads.len(), "quad", "quads"),
        strands(scene)
    ));
    if let Some((low, high)) = scene_extent(scene, &instance_extents(scene)).0 {
        let (from, to) = (list(&low.to_array()), list(&high.to_array()));
        out.push(format!("  extent     {from} to {to} m"));
    }
    let count = scene.instances.len() + scene.shapes.len() + scene.quads.len() + scene.curves.len();
    section(out, "objects", count);
}

/// The number of strands, with a comma in front; empty without curves.
fn strands(scene: &Scene) -> String {
    match scene.curves.iter().map(|c| c.strands.len()).sum::<usize>() {
        0 => String::new(),
        count => format!(", {count} curves"),
    }
}

fn image_line(image: &Image) -> String {
    let bits = match &*image.pixels {
        Pixels::U8(_) | Pixels::Encoded(Encoded { bits: 8, .. }) => "8 bits",
        Pixels::U16(_) | Pixels::Encoded(Encoded { bits: 16, .. }) => "16 bits",
        Pixels::F32(_) | Pixels::Encoded(_) => "32-bit floats",
    };
    let encoding = match image.encoding {
        Encoding::Linear => "linear",
        Encoding::Srgb => "sRGB",
    };
    format!(
        "'{}': {} x {}, {} channels of {bits}, {encoding}, {} bytes",
        image.name,
        image.width,
        image.height,
        image.channels,
        image.bytes()
    )
}

/// Comma-separated entries.
fn join(entries: impl Iterator<Item = String>) -> String {
    entries.collect::<Vec<_>>().join(",")
}

/// The render settings of the scene.
fn settings(scene: &Scene) -> Vec<String> {
    let s = &scene.settings;
    let numbers = [
        ("width", s.width),
        ("height", s.height),
        ("samples", s.samples),
        ("depth", s.depth),
        ("seed", s.seed),
    ];
    let mut shown: Vec<String> =
        numbers.iter().filter_map(|(name, value)| Some(format!("{name} {}", (*value)?))).collect();
    let limits = |b: BounceLimits| join(b.iter().map(|(kind, limit)| format!("{kind}={limit}")));
    shown.extend(s.bounces.map(|bounces| format!("bounces {}", limits(bounces))));
    let clamps = |c: Clamp| join(c.iter().map(|(kind, limit)| format!("{kind}={limit}")));
    shown.extend(s.clamp.map(|clamp| format!("clamp {}", clamps(clamp))));
    let skipped = |c: SkippedCaustics| {
        let kinds = [("reflective", c.reflective), ("refractive", c.refractive)];
        format!(
            "skip_caustics {}",
            join(kinds.iter().filter(|(_, is_skipped)| *is_skipped).map(|(kind, _)| (*kind).to_string()))
        )
    };
    shown.extend(s.skip_caustics.map(skipped));
    shown.extend(s.filter_glossy.map(|f| format!("filter_glossy {f}")));
    shown.extend(s.terminator.map(|t| format!("terminator {}", t.name())));
    shown.extend(s.filter.map(|f| format!("filter {f:?}")));
    shown.extend(s.filter_radius.map(|radius| format!("filter_radius {radius}")));
    shown.extend(s.energy_compensation.map(|e| format!("microfacet {}", e.name())));
    shown.extend(s.fresnel.map(|f| format!("fresnel {}", f.name())));
    shown.extend(s.spectral.map(|spectral| format!("spectral {spectral}")));
    shown.extend(s.exposure.map(|e| format!("exposure {e}")));
    shown.extend(s.view.as_ref().map(|view| format!("view {}", view.name())));
    shown.extend(s.white_balance.map(|kelvin| format!("white balance {kelvin} K")));
    shown.extend(s.noise.map(|percent| format!("noise {percent} %")));
    shown.extend(s.denoise.map(|denoise| format!("denoise {denoise}")));
    shown.extend(s.caught.map(|caught| format!("caught {caught:?}").to_lowercase()));
    shown.extend(s.crop.map(|[x0, y0, x1, y1]| format!("crop {x0},{y0},{x1},{y1}")));
    shown
}

/// A number with up to four decimals.
pub fn number(x: f64) -> String {
    let text = format!("{x:.4}");
    let trimmed = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    match trimmed {
        "0" | "-0" if x != 0.0 => format!("{x:.3e}"),
        "-0" => "0".to_string(),
        _ => trimmed.to_string(),
    }
}

/// Numbers in parentheses.
pub fn list<T: Into<f64> + Copy>(values: &[T]) -> String {
    let shown: Vec<String> = values.iter().map(|&v| number(v.into())).collect();
    format!("({})", shown.join(", "))
}

/// Description of a material: model and parameters.
pub fn describe_material(scene: &Scene, m: &Material) -> String {
    let mut parts = vec![match &m.model {
        Model::SchlickMetal { color: c, roughness } => {
            format!("metal, colour {}, roughness {}", color_slot(c), number_slot(roughness))
        }
        Model::Conductor { eta, k, roughness, .. } => {
            format!("metal of index {} + i {}, roughness {}", list(eta), list(k), number_slot(roughness))
        }
        Model::Dielectric { ior, tint, .. } => {
            format!("glass of index {}, tint {}", number((*ior).into()), color_slot(tint))
        }
        Model::Glass { ior, tint, roughness, is_thin } => {
            let (ior, kind) = (number((*ior).into()), if *is_thin { "thin glass" } else { "glass" });
            format!("{kind} of index {ior}, tint {}, roughness {}", color_slot(tint), number_slot(roughness))
        }
        Model::Pbr(p) => pbr(p),
        Model::Mix { components } => {
            let part = |c: &MixComponent| format!("{} of {}", color_slot(&c.weight), c.material.model.name());
            format!("mix: {}", components.iter().map(part).collect::<Vec<_>>().join(", "))
        }
        plain => parameters(plain),
    }];
    if let Some(e) = &m.emission {
        let sides = if e.two_sided { "both sides" } else { "its front" };
        parts.push(format!("emits {} W/sr/m2 from {sides}", color_slot(&e.radiance)));
    }
    if let Some(medium) = &m.medium {
        let (extinction, albedo) = (list(&medium.extinction), list(&medium.albedo));
        parts.push(format!("medium of extinction {extinction} 1/m, albedo {albedo}"));
    }
    match m.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => {
            parts.push(format!("alpha {} cut at {}", number_slot(&m.alpha), number(cutoff.into())))
        }
        AlphaMode::Blend => parts.push(format!("alpha {}", number_slot(&m.alpha))),
    }
    if m.normal_map.is_some() {
        parts.push("normal map".to_string());
    }
    if !m.double_sided {
        parts.push("one-sided".to_string());
    }
    if m.use_vertex_colors {
        parts.push("vertex colours".to_string());
    }
    let images: Vec<String> =
        material_images(scene, m).into_iter().map(|i| format!("'{}'", scene.images[i].name)).collect();
    if !images.is_empty() {
        parts.push(format!("images {}", images.join(", ")));
    }
    parts.join("; ")
}

/// The name of a model and its parameters.
fn parameters(model: &Model) -> String {
    let mut text = model.name().to_string();
    model.visit("", &mut |name, parameter| {
        let name = if name == "color" { "colour" } else { name };
        match parameter {
            Parameter::Color(slot) => text += &format!(", {name} {}", color_slot(slot)),
            Parameter::Number(slot) => text += &format!(", {name} {}", number_slot(slot)),
            Parameter::Constant(value) => text += &format!(", {name} {}", number((*value).into())),
            Parameter::Texture(_) => {}
        }
    });
    text
}

fn pbr(p: &PbrMaterial) -> String {
    let mut parts = vec![format!(
        "glTF, base colour {}, metallic {}, roughness {}",
        color_slot(&p.base_color),
        number_slot(&p.metallic),
        number_slot(&p.roughness)
    )];
    if p.transmission.factor > 0.0 {
        let wall = match (p.has_volume, p.keeps_radiance) {
            (true, _) => "solid",
            (false, true) => "a refracting open sheet",
            (false, false) => "thin-walled",
        };
        let ior = number(p.ior.into());
        parts.push(format!("transmission {} ({wall}, index {ior})", number_slot(&p.transmission)));
    }
    if p.specular.factor != 1.0 || p.specular.texture.is_some() {
        parts.push(format!("specular {}", number_slot(&p.specular)));
    }
    let layers = [
        ("rough diffuse", p.diffuse_roughness.factor > 0.0),
        ("clearcoat", p.clearcoat.is_some()),
        ("sheen", p.sheen.is_some()),
        ("anisotropy", p.anisotropy.is_some()),
        ("iridescence", p.iridescence.is_some()),
        ("diffuse transmission", p.diffuse_transmission.is_some()),
        ("dispersion", p.dispersion > 0.0),
        ("tinted reflection", p.glass_reflection == GlassReflection::Tinted),
        ("no reflection", p.glass_reflection == GlassReflection::None),
    ];
    parts.extend(layers.iter().filter(|l| l.1).map(|l| l.0.to_string()));
    parts.join(", ")
}

fn color_slot(slot: &ColorSlot) -> String {
    match (slot.texture, slot.factor) {
        (None, c) => list(&c),
        (Some(_), [1.0, 1.0, 1.0]) => "texture".to_string(),
        (Some(_), c) => format!("texture x {}", list(&c)),
    }
}

fn number_slot(slot: &FloatSlot) -> String {
    match (slot.texture, slot.factor) {
        (None, x) => number(x.into()),
        (Some(_), 1.0) => "texture".to_string(),
        (Some(_), x) => format!("texture x {}", number(x.into())),
    }
}

/// The unit of a light's intensity or irradiance.
pub fn light_unit(light: &Light) -> &'static str {
    if light.kind.position().is_some() { "W/sr" } else { "W/m2" }
}

/// Description of a light: type, intensity, position and direction.
pub fn describe_light(light: &Light) -> String {
    let at = light.kind.position().map(|p| format!("at {}", list(&p.to_array())));
    let towards = light.kind.direction().map(|d| format!("towards {}", list(&d.to_array())));
    let place: Vec<String> = at.into_iter().chain(towards).collect();
    let more = match light.kind {
        LightKind::Spot { inner_angle_rad, outer_angle_rad, .. } => format!(
            ", full to {} and dark from {} degrees off the axis",
            number(inner_angle_rad.to_degrees()),
            number(outer_angle_rad.to_degrees())
        ),
        LightKind::Sun { angle_rad, .. } => format!(", {} degrees wide", number(angle_rad.to_degrees())),
        _ => String::new(),
    };
    let (kind, unit) = (light.kind.name(), light_unit(light));
    format!("{kind}, {} {unit}, {}{more}", list(&light.intensity), place.join(" "))
}

/// The kind of the environment.
pub fn environment_name(environment: &Environment) -> &'static str {
    match environment {
        Environment::Black => "none",
        Environment::Constant(_) => "constant",
        Environment::Gradient { .. } => "gradient",
        Environment::Image { .. } => "image",
    }
}

/// Description of the environment.
pub fn describe_environment(scene: &Scene) -> String {
    match &scene.environment {
        Environment::Black => "none".to_string(),
        Environment::Constant(c) => format!("constant, {} W/sr/m2", list(c)),
        Environment::Gradient { nadir, zenith } => {
            format!("gradient, {} W/sr/m2 below to {} above", list(nadir), list(zenith))
        }
        Environment::Image { image, strength, rotation_rad } => format!(
            "image '{}', strength {}, rotated by {} degrees",
            scene.images[image.index()].name,
            number((*strength).into()),
            number(rotation_rad.to_degrees())
        ),
    }
}

/// Description of a panorama's projection.
fn describe_panorama(panorama: &Panorama) -> String {
    let from_to = |[from, to]: [f64; 2]| {
        format!("{} to {} degrees", number(from.to_degrees()), number(to.to_degrees()))
    };
    let fisheye =
        |kind: &str, fov_rad: f64| format!("{kind} fisheye of {} degrees", number(fov_rad.to_degrees()));
    match *panorama {
        Panorama::Equirectangular { longitude_rad, latitude_rad } => format!(
            "equirectangular panorama, longitude {}, latitude {}",
            from_to(longitude_rad),
            from_to(latitude_rad)
        ),
        Panorama::FisheyeEquidistant { fov_rad } => fisheye("equidistant", fov_rad),
        Panorama::FisheyeEquisolid { fov_rad, .. } => fisheye("equisolid", fov_rad),
    }
}

/// Description of a camera: projection, position, direction and lens.
pub fn describe_camera(camera: &Camera) -> String {
    let projection = match camera.projection {
        Projection::Perspective { vfov_rad } => {
            format!("perspective, {} degrees high", number(vfov_rad.to_degrees()))
        }
        Projection::Orthographic { half_height } => {
            format!("orthographic, {} m high", number(2.0 * half_height))
        }
        Projection::Panorama(panorama) => describe_panorama(&panorama),
    };
    let placement = camera.world_from_camera;
    let mut text = format!(
        "{projection}, at {} towards {}",
        list(&placement.translation.to_array()),
        list(&(-placement.matrix3.z_axis).to_array())
    );
    if let Some(aspect) = camera.aspect_ratio {
        text += &format!(", aspect ratio {}", number(aspect));
    }
    if camera.pixel_aspect != 1.0 {
        text += &format!(", pixel aspect {}", number(camera.pixel_aspect));
    }
    if let Some(lens) = camera.lens {
        let radius = lens.focus_distance * (lens.defocus_angle_rad / 2.0).tan();
        text += &format!(
            ", lens radius {} mm, focus distance {} m",
            number(radius * 1000.0),
            number(lens.focus_distance)
        );
    }
    text
}

/// Maximum number of lines of the tree.
const MAX_LINES: usize = 400;

#[derive(Default)]
struct Node<'a> {
    name: &'a str,
    /// Descriptions of the node's objects.
    content: Vec<String>,
    children: Vec<usize>,
}

/// The tree of all objects, from their names as node paths; indented by two spaces per level.
pub fn tree(scene: &Scene) -> Vec<String> {
    let mut nodes: Vec<Node> = vec![Node::default()];
    let mut known: HashMap<(usize, &str), usize> = HashMap::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.index()];
        let materials: Vec<String> =
            instance_materials(scene, instance).into_iter().map(|m| material_name(scene, m)).collect();
        let primitives = match &mesh.splats {
            None => plural(mesh.triangles.len(), "triangle", "triangles"),
            Some(splats) => format!("{} Gaussian splats of degree {}", splats.len(), splats.degree),
        };
        let content = format!("mesh '{}', {primitives}, {}", mesh.name, materials.join(", "));
        insert(&mut nodes, &mut known, &instance.name, content);
    }
    for s in &scene.shapes {
        let content =
            format!("{} of radius {}, {}", s.kind.name(), s.radius, material_name(scene, s.material));
        insert(&mut nodes, &mut known, &s.name, content);
    }
    for q in &scene.quads {
        let (u, v) = (q.edge_u.length(), q.edge_v.length());
        let content = format!("quad of {u:.4} x {v:.4} m, {}", material_name(scene, q.material));
        insert(&mut nodes, &mut known, &q.name, content);
    }
    for c in &scene.curves {
        let (strands, points) = (c.strands.len(), c.points.len());
        let material = material_name(scene, c.material);
        let content = format!("{strands} {} curves of {points} points, {material}", c.basis.name());
        insert(&mut nodes, &mut known, &c.name, content);
    }
    let mut lines = Vec::new();
    let mut stack: Vec<(usize, usize)> = nodes[0].children.iter().rev().map(|&c| (c, 0)).collect();
    while let Some((at, depth)) = stack.pop() {
        let node = &nodes[at];
        let name = if node.name.is_empty() { "(unnamed)" } else { node.name };
        lines.push(format!("{}{name}{}", "  ".repeat(depth), node_contents(&node.content)));
        stack.extend(node.children.iter().rev().map(|&c| (c, depth + 1)));
    }
    if lines.len() > MAX_LINES {
        let more = lines.len() - MAX_LINES;
        lines.truncate(MAX_LINES);
        lines.push(format!("... and {more} more"));
    }
    lines
}

fn insert<'a>(
    nodes: &mut Vec<Node<'a>>,
    known: &mut HashMap<(usize, &'a str), usize>,
    path: &'a str,
    content: String,
) {
    let mut at = 0;
    for name in path.split('/') {
        let next = nodes.len();
        let child = *known.entry((at, name)).or_insert(next);
        if child == next {
            nodes.push(Node { name, ..Node::default() });
            nodes[at].children.push(child);
        }
        at = child;
    }
    nodes[at].content.push(content);
}

/// The objects of a node in one line; equal ones are counted.
fn node_contents(content: &[String]) -> String {
    let Some(first) = content.first() else { return String::new() };
    if content.iter().all(|c| c == first) && content.len() > 1 {
        return format!(": {} times {first}", content.len());
    }
    let shown: Vec<&str> = content.iter().take(3).map(String::as_str).collect();
    let more = if content.len() > 3 { format!(" and {} more", content.len() - 3) } else { String::new() };
    format!(": {}{more}", shown.join("; "))
}

fn material_name(scene: &Scene, id: MaterialId) -> String {
    format!("'{}'", scene.materials[id.index()].name)
}

/// Number of triangles of all instances.
pub fn placed_triangles(scene: &Scene) -> u64 {
    scene.instances.iter().map(|i| scene.meshes[i.mesh.index()].triangles.len() as u64).sum()
}

/// The distinct materials of an instance.
pub fn instance_materials(scene: &Scene, instance: &Instance) -> Vec<MaterialId> {
    if let Some(material) = instance.material {
        return vec![material];
    }
    let mut ids: Vec<MaterialId> = Vec::new();
    for part in &scene.meshes[instance.mesh.index()].parts {
        if !ids.contains(&part.material) {
            ids.push(part.material);
        }
    }
    ids
}

/// Whether each material is used.
pub fn used_materials(scene: &Scene) -> Vec<bool> {
    let mut used = vec![false; scene.materials.len()];
    let surfaces = scene.shapes.iter().map(|s| s.material).chain(scene.quads.iter().map(|q| q.material));
    let surfaces = surfaces.chain(scene.curves.iter().map(|c| c.material));
    let instances = scene.instances.iter().flat_map(|i| instance_materials(scene, i));
    for id in surfaces.chain(instances) {
        used[id.index()] = true;
    }
    used
}

/// Whether each image is used by a used material or the environment.
pub fn used_images(scene: &Scene) -> Vec<bool> {
    let used = used_materials(scene);
    let materials = scene.materials.iter().zip(used).filter(|(_, used)| *used);
    let mut images = vec![false; scene.images.len()];
    for (material, _) in materials {
        for image in material_images(scene, material) {
            images[image] = true;
        }
    }
    if let Environment::Image { image, .. } = scene.environment {
        images[image.index()] = true;
    }
    images
}

/// The indices of a material's images, sorted and distinct.
pub fn material_images(scene: &Scene, material: &Material) -> Vec<usize> {
    let mut textures = vec![false; scene.textures.len()];
    for id in material.textures() {
        textures[id.index()] = true;
    }
    let mut images = Vec::new();
    // Input textures precede the textures that use them: one backward pass visits all.
    for (i, texture) in scene.textures.iter().enumerate().rev() {
        if !textures[i] {
            continue;
        }
        if let Texture::Image { image, .. } = texture {
            images.push(image.index());
        }
        for part in texture.parts() {
            textures[part.index()] = true;
        }
    }
    images.sort_unstable();
    images.dedup();
    images
}
