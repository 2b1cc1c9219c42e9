//! The ground below a bare model.
//!
//! Undersides, one-sided faces that lie on the ground and face down, are removed: they are invisible from above, but would block
//! light reflected by the ground, and leave a black patch.

use super::framing::{Outline, on_grid};
use super::light;
use super::options::{Background, Ground, StageOptions};
use crate::color::luminance;
use crate::error::{Choice, Warning};
use crate::image::Image;
use crate::load::Loaded;
use crate::load::mesh_tools::retain_triangles;
use crate::math::{DVec3, Vec2};
use crate::scene::{
    AlphaMode, Backdrop, ColorSlot, FloatSlot, Instance, Interpolation, Mapping, Material, Mesh, MeshId,
    Model, ObjectTraits, PbrMaterial, RayKinds, Scene, Shape, Texture, TextureTransform, Transmission, Wrap,
};
use std::collections::{HashMap, HashSet};

/// Radius of the ground in model radii: its edge is a degree below the horizon.
const GROUND_RADIUS: f64 = 60.0;
/// Distance of the ground below the lowest point of the model, in model radii: avoids coplanar faces.
const GAP: f64 = 2e-4;
/// Roughness of the ground: slightly reflective.
const ROUGHNESS: f32 = 0.4;
/// Factor on the ground's specular reflection.
const SPECULAR: f32 = 0.45;
/// Luminance of the ground's colour above which specular reflection has its full strength.
const FULL_SPECULAR_LUMINANCE: f32 = 0.3;
/// Radius of the specular reflection, in model radii: at the grazing angles farther away it would reflect the stage's lights, and
/// differ from the background.
const SPECULAR_RADIUS: f64 = 3.0;
/// Roughness of a floor.
const FLOOR_ROUGHNESS: f32 = 0.12;
/// Colour of a floor.
const FLOOR_COLOR: [f32; 3] = [0.16, 0.16, 0.165];
/// Radius where grounds with another colour than the background have faded out, in model radii; hides the horizon.
const FADE_RADIUS: f64 = 30.0;
/// Resolution of the fade texture, texels.
const FADE_TEXELS: u32 = 128;
/// Fraction of a fade's radius where it starts.
const FADE_START: f64 = 0.2;
/// Maximum reflectance of a ground.
const MAX_REFLECTANCE: f64 = 0.95;

/// The blending of a ground into the background.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Blending {
    /// Looks like the background's colour under the stage's light.
    Color,
    /// A shadow catcher, for any background.
    Catcher,
    /// Fades out with distance.
    Fading,
}

/// Adds the ground of the options, and sets the stage's backdrop.
pub(super) fn add(loaded: &mut Loaded, options: &StageOptions, outline: &Outline, is_lit: bool) {
    let ground = options.ground_for(is_lit);
    let is_stage = options.light.is_stage() && !is_lit;
    if is_stage && options.background.is_none() {
        hide_environment(&mut loaded.scene);
        loaded.scene.backdrop = Some(Backdrop::Color(options.light.background()));
    }
    if ground == Ground::None {
        return;
    }
    if options.view.elevation_degrees < 0.0 {
        let message = format!("the model is seen from below: {} is left out", Choice::Ground);
        return loaded.notes.push(Warning::general(message));
    }
    let size = outline.radius();
    let center = outline.center();
    let below = DVec3::new(center.x, outline.min.y - GAP * size, center.z);
    remove_undersides(loaded, outline.min.y + GAP * size);
    let (blending, color) = choose_blending(options, ground, is_stage);
    let material = material(&mut loaded.scene, ground, blending, color);
    let material = loaded.scene.add_material(material);
    let center = on_grid(below, size) + loaded.offset;
    let mut disk = Shape::disk(center, DVec3::Y, GROUND_RADIUS * size, material);
    disk.name = unused_name(&loaded.scene);
    if blending == Blending::Catcher {
        disk.traits = ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() };
    }
    loaded.scene.shapes.push(disk);
}

/// The blending of a ground into the background, and its colour.
///
/// Shadow catchers trace paths twice and turn off some techniques, so they are used only for backgrounds that no ground can
/// match: pictures, transparency, and colours brighter than white under the stage's light.
fn choose_blending(options: &StageOptions, ground: Ground, is_stage: bool) -> (Blending, [f32; 3]) {
    if ground == Ground::Floor {
        return (Blending::Fading, FLOOR_COLOR);
    }
    let target = match (&options.background, is_stage) {
        (None, false) => return (Blending::Fading, [0.5; 3]),
        (Some(Background::Transparent | Background::Picture(_)), _) | (_, false) => {
            return (Blending::Catcher, [0.5; 3]);
        }
        _ => options.backdrop(),
    };
    let white = light::reflected(options.light, target, DVec3::Y);
    let color: [f64; 3] = std::array::from_fn(|c| f64::from(target[c]) / white[c].max(1e-3));
    let blending = match color.iter().any(|&v| v > MAX_REFLECTANCE) {
        true => Blending::Catcher,
        false => Blending::Color,
    };
    (blending, color.map(|v| v.clamp(0.0, MAX_REFLECTANCE) as f32))
}

fn material(scene: &mut Scene, ground: Ground, blending: Blending, color: [f32; 3]) -> Material {
    // White reflections would hide saturated or dark colours of the ground.
    let gloss = SPECULAR * (luminance(color) / FULL_SPECULAR_LUMINANCE).min(1.0);
    let max = color.iter().copied().fold(1e-3, f32::max);
    let tint = ColorSlot::constant(color.map(|v| v / max));
    let (roughness, specular) = match ground {
        Ground::Floor => (FLOOR_ROUGHNESS, FloatSlot::constant(1.0)),
        _ => (ROUGHNESS, FloatSlot { factor: gloss, ..fade_texture(scene, SPECULAR_RADIUS) }),
    };
    let parameters = PbrMaterial {
        base_color: ColorSlot::constant(color),
        metallic: FloatSlot::constant(0.0),
        roughness: FloatSlot::constant(roughness),
        specular,
        specular_color: if ground == Ground::Floor { ColorSlot::constant([1.0; 3]) } else { tint },
        ..PbrMaterial::default()
    };
    let mut material = Material::gltf("ground", parameters);
    if blending == Blending::Fading {
        (material.alpha_mode, material.alpha) = (AlphaMode::Blend, fade_texture(scene, FADE_RADIUS));
    }
    material
}

/// A texture that is 1 at the centre of the ground and fades to 0 at `radius` model radii.
fn fade_texture(scene: &mut Scene, radius: f64) -> FloatSlot {
    let coordinate = |i: u32| (f64::from(i) + 0.5) / f64::from(FADE_TEXELS) * 2.0 - 1.0;
    let mut rgb = Vec::with_capacity((FADE_TEXELS * FADE_TEXELS * 3) as usize);
    for row in 0..FADE_TEXELS {
        for column in 0..FADE_TEXELS {
            let distance = coordinate(row).hypot(coordinate(column));
            // The wrap mode repeats the outermost texels, which must be 0.
            let end = 1.0 - 2.0 / f64::from(FADE_TEXELS);
            rgb.extend([(1.0 - light::smoothstep(FADE_START, end, distance)) as f32; 3]);
        }
    }
    let image = scene.add_image(Image::from_linear_rgb("fading", FADE_TEXELS, FADE_TEXELS, rgb));
    let scale = GROUND_RADIUS / radius;
    let transform = TextureTransform {
        offset: Vec2::splat((0.5 - 0.5 * scale) as f32),
        scale: Vec2::splat(scale as f32),
        ..TextureTransform::default()
    };
    let texture = scene.add_texture(Texture::Image {
        image,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        interpolation: Interpolation::Bilinear,
        mapping: Mapping::Uv { set: 0, transform },
    });
    FloatSlot::texture(texture, 0)
}

/// A name that no instance has.
fn unused_name(scene: &Scene) -> String {
    let is_taken = |name: &str| scene.instances.iter().any(|i| i.name == name);
    let names = (1..).map(|n| if n == 1 { "ground".to_string() } else { format!("ground {n}") });
    names.into_iter().find(|name| !is_taken(name)).unwrap_or_default()
}

/// Makes the environment invisible to camera rays.
pub(super) fn hide_environment(scene: &mut Scene) {
    scene.environment_visible_to = scene.environment_visible_to.without(RayKinds::CAMERA);
}

/// The bits of an edge's end positions, sorted.
type Edge = [[u32; 3]; 2];

/// Removes undersides up to a height, metres relative to the model's offset. Undersides of closed bodies stay. Instances get
/// copies of their meshes, as other instances may share them.
pub(super) fn remove_undersides(loaded: &mut Loaded, height: f64) {
    let scene = &mut loaded.scene;
    let (mut count, mut emptied) = (0, HashSet::new());
    for index in 0..scene.instances.len() {
        let instance = &scene.instances[index];
        let is_static = !scene.motion.meshes.contains_key(&instance.mesh.index());
        let Some(removed) = is_static.then(|| undersides(scene, instance, loaded.offset, height)).flatten()
        else {
            continue;
        };
        count += removed.len();
        let rest = without_triangles(&scene.meshes[instance.mesh.index()], &removed);
        if rest.triangles.is_empty() {
            emptied.insert(index);
            continue;
        }
        scene.instances[index].mesh = MeshId(scene.meshes.len() as u32);
        scene.meshes.push(rest);
    }
    let mut number = 0..;
    scene.instances.retain(|_| !number.next().is_some_and(|index: usize| emptied.contains(&index)));
    if count > 0 {
        let message = format!("{count} one-sided faces that face the ground are invisible: left out");
        loaded.notes.push(Warning::general(message));
    }
}

/// Indices of an instance's triangles that are undersides; `None` if there are none.
fn undersides(scene: &Scene, instance: &Instance, offset: DVec3, height: f64) -> Option<HashSet<usize>> {
    let mesh = &scene.meshes[instance.mesh.index()];
    let world_from_object = &instance.world_from_object;
    let world =
        |i: u32| world_from_object.transform_point3(DVec3::from(mesh.positions[i as usize].map(f64::from)));
    let is_low: Vec<bool> =
        (0..mesh.positions.len() as u32).map(|i| world(i).y - offset.y <= height).collect();
    let low_count = |t: &[u32; 3]| t.iter().filter(|&&i| is_low[i as usize]).count();
    let side = world_from_object.matrix3.determinant().signum();
    let mut down: Vec<usize> = Vec::new();
    for part in &mesh.parts {
        let material = &scene.materials[instance.material.unwrap_or(part.material).index()];
        let is_sheet = !material.double_sided && is_opaque(&material.model);
        down.extend(part.triangles().filter(|&t| is_sheet && low_count(&mesh.triangles[t]) == 3).filter(
            |&t| {
                let [a, b, c] = mesh.triangles[t].map(world);
                (b - a).cross(c - a).y * side < 0.0
            },
        ));
    }
    if down.is_empty() {
        return None;
    }
    // Where walls rise from the ground, the face is the bottom of a body.
    let wall_edges =
        mesh.triangles.iter().filter(|t| low_count(t) == 2).flat_map(|t| edges(mesh, t)).collect();
    let removed = without_walls(mesh, &down, &wall_edges);
    (!removed.is_empty()).then_some(removed)
}

/// Whether the surface transmits no light.
fn is_opaque(model: &Model) -> bool {
    match model.transmission() {
        Transmission::None => true,
        Transmission::Thin | Transmission::Clear(_) => false,
        Transmission::Pbr(pbr) => pbr.transmission.factor <= 0.0 && pbr.diffuse_transmission.is_none(),
    }
}

/// The edges of a triangle by position: coincident vertices count as one.
fn edges(mesh: &Mesh, triangle: &[u32; 3]) -> [Edge; 3] {
    let corner = |i: u32| mesh.positions[i as usize].map(|x| (x + 0.0).to_bits());
    let [a, b, c] = triangle.map(corner);
    [[a, b], [b, c], [c, a]].map(|[a, b]| if a <= b { [a, b] } else { [b, a] })
}

/// The triangles among `down` in connected components without any of `wall_edges`.
fn without_walls(mesh: &Mesh, down: &[usize], wall_edges: &HashSet<Edge>) -> HashSet<usize> {
    let mut neighbours: HashMap<Edge, Vec<usize>> = HashMap::new();
    for &t in down {
        edges(mesh, &mesh.triangles[t])
            .into_iter()
            .for_each(|edge| neighbours.entry(edge).or_default().push(t));
    }
    let mut attached: HashSet<usize> = HashSet::new();
    let touches = |t: &&usize| edges(mesh, &mesh.triangles[**t]).iter().any(|edge| wall_edges.contains(edge));
    let mut stack: Vec<usize> = down.iter().filter(touches).copied().collect();
    while let Some(t) = stack.pop() {
        if attached.insert(t) {
            let near = edges(mesh, &mesh.triangles[t]);
            stack.extend(
                near.iter().flat_map(|edge| &neighbours[edge]).filter(|other| !attached.contains(other)),
            );
        }
    }
    down.iter().copied().filter(|t| !attached.contains(t)).collect()
}

/// A mesh without the `removed` triangles.
fn without_triangles(mesh: &Mesh, removed: &HashSet<usize>) -> Mesh {
    let mut rest = mesh.clone();
    retain_triangles(&mut rest, |_, t| !removed.contains(&t));
    rest.parts.retain(|part| part.triangle_count > 0);
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::mesh_tools::box_faces;
    use crate::math::DAffine3;
    use crate::scene::{Material, MaterialId, MeshPart};

    /// A scene of one-sided triangles.
    fn loaded(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Loaded {
        let mut loaded = Loaded::default();
        let scene = &mut loaded.scene;
        let model = PbrMaterial::default();
        scene.materials.push(Material { double_sided: false, ..Material::gltf("a", model) });
        let triangle_count = triangles.len() as u32;
        let parts = vec![MeshPart { first_triangle: 0, triangle_count, material: MaterialId(0) }];
        scene.meshes.push(Mesh { positions, triangles, parts, ..Mesh::default() });
        scene.instances.push(Instance::new(MeshId(0), DAffine3::IDENTITY));
        loaded
    }

    #[test]
    fn open_undersides_are_removed_and_bottoms_of_boxes_stay() {
        let square = || vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
        let (down, up) = ([[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]);
        let mut alone = loaded(square(), down.to_vec());
        remove_undersides(&mut alone, 1e-4);
        assert!(alone.scene.instances.is_empty() && alone.notes[0].message.starts_with("2 one-sided"));
        // Back to back with a sheet that faces up and stays.
        let mut sheet = loaded(square(), [down, up].concat());
        remove_undersides(&mut sheet, 1e-4);
        let mesh = &sheet.scene.instances[0].mesh;
        assert_eq!(sheet.scene.meshes[mesh.index()].triangles, up);
        assert_eq!(sheet.scene.meshes[0].triangles.len(), 4, "shared meshes don't change");
        let (mesh, _) = box_faces(DVec3::ZERO, DVec3::ONE).to_mesh("box", DVec3::ZERO);
        let mut closed = loaded(mesh.positions, mesh.triangles);
        remove_undersides(&mut closed, 1e-4);
        assert_eq!((closed.scene.meshes.len(), closed.notes.len()), (1, 0));
        // High above the ground.
        let mut high = loaded(square(), down.to_vec());
        remove_undersides(&mut high, -0.5);
        assert_eq!(high.scene.instances.len(), 1);
    }
}
