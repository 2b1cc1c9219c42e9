//! Displacement mapping at load time: meshes with height maps are subdivided and their vertices moved along the normals.
//! Also converts height maps to normal maps.
//!
//! Edges are bisected until none is longer than requested. The decision depends on the edge's vertices alone, so that
//! adjacent triangles agree and no cracks open.

use super::Loaded;
use crate::error::Warning;
use crate::image::{Encoding, Image, Pixels};
use crate::math::{DAffine3, DVec3, Vec2, Vec3};
use crate::scene::{
    Displacement, Instance, Mapping, MaterialId, Mesh, MeshId, MeshPart, Motion, Quad, Scene, Texture,
    TextureId, TextureTransform, Wrap,
};
use std::collections::HashMap;
use std::sync::Arc;

/// Maximum number of triangles of all displaced meshes of a scene together.
const MAX_TRIANGLES: usize = 16_000_000;
/// Default edge length, as a fraction of the diagonal of the mesh's bounding box.
const DEFAULT_EDGE: f32 = 1.0 / 256.0;

/// Displaces all meshes whose materials have a height map, then removes the height maps from the materials.
pub(super) fn apply(loaded: &mut Loaded) {
    if loaded.scene.materials.iter().all(|m| m.displacement.is_none()) {
        return;
    }
    let mut heights = HashMap::new();
    let scene = &loaded.scene;
    for (id, material) in (0..).map(MaterialId).zip(&scene.materials) {
        let Some(displacement) = material.displacement else { continue };
        match Heights::of(scene, displacement.texture) {
            Ok(found) => drop(heights.insert(id, (displacement, found))),
            Err(why) => warn(&mut loaded.warnings, &material.name, why),
        }
    }
    let Loaded { scene, warnings, .. } = loaded;
    warn_of_shapes(scene, &heights, warnings);
    quads_to_meshes(scene, &heights, warnings);
    displace_instances(scene, &heights, warnings);
    loaded.scene.materials.iter_mut().for_each(|m| m.displacement = None);
}

type AllHeights = HashMap<MaterialId, (Displacement, Heights)>;

fn warn(warnings: &mut Vec<Warning>, name: &str, message: impl Into<String>) {
    warnings.push(Warning::general(format!("'{name}': {}", message.into())));
}

/// Warns of displaced analytic shapes, which have no triangles.
fn warn_of_shapes(scene: &Scene, heights: &AllHeights, warnings: &mut Vec<Warning>) {
    let shape = scene.shapes.iter().find(|shape| heights.contains_key(&shape.material));
    if let Some(shape) = shape {
        warn(warnings, &shape.name, "only meshes, boxes and quads are displaced, no spheres or disks");
    }
}

/// Converts displaced quads to meshes.
fn quads_to_meshes(scene: &mut Scene, heights: &AllHeights, warnings: &mut Vec<Warning>) {
    let displaced = |quad: &Quad| heights.contains_key(&quad.material);
    let Some(first) = scene.quads.iter().find(|quad| displaced(quad)) else { return };
    if !scene.motion.quads.is_empty() {
        return warn(warnings, &first.name, "is not displaced where quads move: make a mesh of it");
    }
    let (wanted, rest) = std::mem::take(&mut scene.quads).into_iter().partition(displaced);
    scene.quads = rest;
    let wanted: Vec<Quad> = wanted;
    for quad in wanted {
        let corners = [DVec3::ZERO, quad.edge_u, quad.edge_u + quad.edge_v, quad.edge_v];
        let positions = corners.map(|corner| corner.as_vec3().to_array()).to_vec();
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let uv_sets = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]];
        let mesh = Mesh::new(&quad.name, positions, triangles, quad.material);
        let mesh = scene.add_mesh(Mesh { uv_sets, ..mesh });
        let placed = Instance::new(mesh, DAffine3::from_translation(quad.corner));
        scene.instances.push(Instance { name: quad.name, traits: quad.traits, ..placed });
    }
}

/// Replaces the meshes of instances with displaced materials; instances of one mesh share the displaced mesh.
fn displace_instances(scene: &mut Scene, heights: &AllHeights, warnings: &mut Vec<Warning>) {
    let mut made: HashMap<(MeshId, Option<MaterialId>), Option<MeshId>> = HashMap::new();
    let mut triangles = 0;
    for index in 0..scene.instances.len() {
        let Instance { mesh, material, motion, ref name, .. } = scene.instances[index];
        let Some(own) = scene.meshes.get(mesh.index()) else { continue };
        let over = |id: MaterialId| heights.get(&id).map(|(displacement, heights)| (displacement, heights));
        let parts: Parts = own.parts.iter().map(|part| over(material.unwrap_or(part.material))).collect();
        if parts.iter().all(Option::is_none) {
            continue;
        }
        let deforms = motion == Motion::Deforms || scene.motion.meshes.contains_key(&mesh.index());
        if deforms {
            warn(warnings, name, "is not displaced: its mesh deforms");
            continue;
        }
        let key = (mesh, material.filter(|id| heights.contains_key(id)));
        let displaced = match made.get(&key) {
            Some(known) => *known,
            None => {
                let displaced = displaced(own, &parts, MAX_TRIANGLES - triangles, warnings);
                triangles += displaced.as_ref().map_or(0, |mesh| mesh.triangles.len());
                triangles = triangles.min(MAX_TRIANGLES);
                let id = displaced.map(|mesh| scene.add_mesh(mesh));
                made.insert(key, id);
                id
            }
        };
        if let Some(mesh) = displaced {
            scene.instances[index].mesh = mesh;
        }
    }
}

/// The mesh with its parts displaced; `None`, with a warning, if it has no texture coordinates.
fn displaced(own: &Mesh, parts: &Parts, budget: usize, warnings: &mut Vec<Warning>) -> Option<Mesh> {
    let has_coordinates = parts
        .iter()
        .flatten()
        .all(|(_, heights)| own.uv_sets.get(heights.set()).is_some_and(|s| !s.is_empty()));
    if !has_coordinates {
        warn(warnings, &own.name, "is not displaced: it has no texture coordinates");
        return None;
    }
    let edges: Vec<Option<f32>> = parts
        .iter()
        .map(|part| part.map(|(d, _)| if d.edge > 0.0 { d.edge } else { DEFAULT_EDGE * diagonal(own) }))
        .collect();
    let edges = limit_edges(own, edges, budget, warnings);
    let (fine, longest) = subdivided(own, &edges, budget);
    if let Some(longest) = longest {
        let message = format!(
            "is subdivided to edges of {longest:.3}, not finer: all displaced meshes together may have {MAX_TRIANGLES} triangles"
        );
        warn(warnings, &own.name, message);
    }
    Some(displace_vertices(fine, parts))
}

/// Replaces edge lengths that need far more triangles than the budget by the default length.
fn limit_edges(
    own: &Mesh,
    mut edges: Vec<Option<f32>>,
    budget: usize,
    warnings: &mut Vec<Warning>,
) -> Vec<Option<f32>> {
    /// Multiple of the budget above which edges count as too short.
    const MAX_EXCESS: f64 = 16.0;
    let min_count = min_triangles(own, &edges);
    if min_count <= MAX_EXCESS * budget as f64 {
        return edges;
    }
    let default = DEFAULT_EDGE * diagonal(own);
    // Bisection makes up to four times the minimum number of triangles.
    let shortest = (min_count * 4.0 / budget.max(1) as f64).sqrt();
    let requested = edges.iter().flatten().copied().fold(f32::INFINITY, f32::min);
    let message = format!(
        "is subdivided to edges of {default:.3}, the default: edges of {requested:e} would take at least {min_count:.1e} triangles, and all displaced \
         meshes together may have {MAX_TRIANGLES}; edge = {:.1e} is possible",
        f64::from(requested) * shortest
    );
    warn(warnings, &own.name, message);
    edges.iter_mut().flatten().for_each(|edge| *edge = edge.max(default));
    edges
}

/// Diagonal of a mesh's bounding box, object units.
fn diagonal(mesh: &Mesh) -> f32 {
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for p in &mesh.positions {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f32>().sqrt()
}

/// Displacement and height map of each part of a mesh.
type Parts<'a> = Vec<Option<(&'a Displacement, &'a Heights)>>;

/// A height map: one channel of an image, with bilinear filtering.
struct Heights {
    size: [usize; 2],
    values: Vec<f32>,
    wrap: [Wrap; 2],
    set: u32,
    transform: TextureTransform,
}

impl Heights {
    /// The height map of an image texture with texture coordinates.
    ///
    /// # Errors
    /// A message for all other textures.
    pub fn of(scene: &Scene, (id, channel): (TextureId, u8)) -> Result<Heights, String> {
        let texture = scene.textures.get(id.index());
        let Some(Texture::Image { image, wrap_u, wrap_v, mapping: Mapping::Uv { set, transform }, .. }) =
            texture
        else {
            return Err("is displaced by images only, which lie by texture coordinates".into());
        };
        let image = scene.images.get(image.index()).ok_or("is displaced by an image that is not there")?;
        let image =
            image.decoded(&mut Vec::new()).map_err(|_| "is displaced by an image that can't be decoded")?;
        // Heights are linear data, even if the image is also a colour texture.
        let image = Image { encoding: Encoding::Linear, ..image };
        let size = [image.width as usize, image.height as usize];
        let texel =
            |i: usize| image.rgba((i % size[0]) as u32, (i / size[0]) as u32)[usize::from(channel.min(3))];
        Ok(Heights {
            size,
            values: (0..size[0] * size[1]).map(texel).collect(),
            wrap: [*wrap_u, *wrap_v],
            set: *set,
            transform: *transform,
        })
    }

    /// Index of the UV set.
    pub fn set(&self) -> usize {
        self.set as usize
    }

    /// The height at coordinates of the UV set.
    pub fn at(&self, uv: [f32; 2]) -> f32 {
        let TextureTransform { offset, rotation_rad, scale } = self.transform;
        let scaled = Vec2::from_array(uv) * scale;
        let (sin, cos) = rotation_rad.sin_cos();
        let turned = Vec2::new(cos * scaled.x + sin * scaled.y, cos * scaled.y - sin * scaled.x);
        let at = (offset + turned).to_array();
        let texel = |k: usize| f64::from(at[k]) * self.size[k] as f64 - 0.5;
        let (x, y) = (texel(0), texel(1));
        let (s, t) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
        let value = |i: i64, j: i64| {
            let column = wrapped(x.floor() as i64 + i, self.size[0], self.wrap[0]);
            let row = wrapped(y.floor() as i64 + j, self.size[1], self.wrap[1]);
            self.values[row * self.size[0] + column]
        };
        let mix = |a: f32, b: f32, share: f32| a + (b - a) * share;
        mix(mix(value(0, 0), value(1, 0), s), mix(value(0, 1), value(1, 1), s), t)
    }
}

fn wrapped(at: i64, size: usize, wrap: Wrap) -> usize {
    let size = size as i64;
    let inside = match wrap {
        Wrap::Repeat => at.rem_euclid(size),
        Wrap::Mirror => {
            let twice = at.rem_euclid(2 * size);
            twice.min(2 * size - 1 - twice)
        }
        Wrap::Clamp => at.clamp(0, size - 1),
    };
    inside as usize
}

// Displaces the vertices of a tessellated mesh and recomputes its normals.

/// The bits of a position, with -0 as +0.
type Key = [u32; 3];

fn key(p: [f32; 3]) -> Key {
    p.map(|x| (x + 0.0).to_bits())
}

/// Common displacement of vertices with the same position, as at UV seams and hard edges.
#[derive(Clone, Copy, Default)]
struct Place {
    direction: Vec3,
    /// Sum of the lengths of the vectors in `direction`.
    length: f32,
    /// Sum of the displacements of `count` vertices.
    heights: f32,
    count: f32,
}

impl Place {
    /// The displacement direction of a vertex with the normal `own`: the shared direction, or `own` where normals cancel, as
    /// on a two-sided card.
    fn direction_of(&self, own: Vec3) -> Vec3 {
        let is_shared = self.direction.length() > MIN_COHERENCE * self.length;
        if is_shared { self.direction.normalize_or_zero() } else { own.normalize_or_zero() }
    }
}

/// Minimum length of the summed normals of a position, relative to the sum of their lengths, for a shared direction.
const MIN_COHERENCE: f32 = 0.1;

/// The mesh with the vertices of its displaced parts moved along their normals.
fn displace_vertices(mut mesh: Mesh, parts: &Parts) -> Mesh {
    let over = vertices_over(&mesh, parts);
    let vertex_directions = directions(&mesh);
    let mut places: HashMap<Key, Place> = HashMap::new();
    for (vertex, part) in over.iter().enumerate() {
        let Some((displacement, heights)) = part.and_then(|part| parts[part]) else { continue };
        let place = places.entry(key(mesh.positions[vertex])).or_default();
        place.heights +=
            displacement.scale * (heights.at(mesh.uv_sets[heights.set()][vertex]) - displacement.midlevel);
        place.count += 1.0;
    }
    for (vertex, direction) in vertex_directions.iter().enumerate() {
        if let Some(place) = places.get_mut(&key(mesh.positions[vertex])) {
            place.direction += *direction;
            place.length += direction.length();
        }
    }
    // Vertices with the same position and normal share a normal after displacement. Flat meshes become smooth.
    let smooth: Vec<(Key, Key)> = (0..mesh.positions.len())
        .map(|v| (key(mesh.positions[v]), mesh.normals.get(v).map_or([0; 3], |n| key(*n))))
        .collect();
    for vertex in (0..over.len()).filter(|&vertex| over[vertex].is_some()) {
        let Some(place) = places.get(&smooth[vertex].0) else { continue };
        let moved = place.direction_of(vertex_directions[vertex]) * (place.heights / place.count);
        let p = Vec3::from_array(mesh.positions[vertex]) + moved;
        if p.is_finite() {
            mesh.positions[vertex] = p.to_array();
        }
    }
    set_normals(&mut mesh, &over, &smooth);
    mesh
}

/// Index of the first displaced part with each vertex.
fn vertices_over(mesh: &Mesh, parts: &Parts) -> Vec<Option<usize>> {
    let mut over = vec![None; mesh.positions.len()];
    for (index, part) in mesh.parts.iter().enumerate().filter(|(index, _)| parts[*index].is_some()) {
        let first = part.first_triangle as usize;
        for vertex in mesh.triangles[first..first + part.triangle_count as usize].as_flattened() {
            over[*vertex as usize].get_or_insert(index);
        }
    }
    over
}

/// Vertex normals; without them the area-weighted sums of adjacent face normals, not normalised.
fn directions(mesh: &Mesh) -> Vec<Vec3> {
    if !mesh.normals.is_empty() {
        return mesh.normals.iter().map(|n| Vec3::from_array(*n)).collect();
    }
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for (triangle, normal) in mesh.triangles.iter().zip(face_normals(mesh)) {
        triangle.iter().for_each(|&vertex| sums[vertex as usize] += normal);
    }
    sums
}

/// Face normals; their length is twice the area.
fn face_normals(mesh: &Mesh) -> impl Iterator<Item = Vec3> + '_ {
    mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|v| Vec3::from_array(mesh.positions[v as usize]));
        (b - a).cross(c - a)
    })
}

/// Sets vertex normals to the area-weighted means of adjacent face normals.
fn set_normals(mesh: &mut Mesh, over: &[Option<usize>], smooth: &[(Key, Key)]) {
    let mut sums: HashMap<(Key, Key), Vec3> = HashMap::new();
    for (triangle, normal) in mesh.triangles.iter().zip(face_normals(mesh)) {
        for vertex in triangle {
            *sums.entry(smooth[*vertex as usize]).or_default() += normal;
        }
    }
    let had_normals = !mesh.normals.is_empty();
    let normals = (0..mesh.positions.len()).map(|vertex| {
        let sum = sums.get(&smooth[vertex]).and_then(|sum| sum.try_normalize());
        let kept = mesh.normals.get(vertex).copied();
        match (over[vertex].is_some() || !had_normals, sum) {
            (true, Some(sum)) => sum.to_array(),
            _ => kept.unwrap_or([0.0, 1.0, 0.0]),
        }
    });
    mesh.normals = normals.collect();
}

/// The mesh without tangents, its parts subdivided to the maximum edge lengths; and its longest edge if the subdivision
/// stopped at `most` triangles.
fn subdivided(mesh: &Mesh, edges: &[Option<f32>], most: usize) -> (Mesh, Option<f32>) {
    let mut fine = Mesh { tangents: Vec::new(), triangles: Vec::new(), parts: Vec::new(), ..mesh.clone() };
    let mut longest = None;
    for (part, edge) in mesh.parts.iter().zip(edges) {
        let first = part.first_triangle as usize;
        let mut triangles = mesh.triangles[first..first + part.triangle_count as usize].to_vec();
        while let Some(edge) = *edge {
            let cuts: usize =
                triangles.iter().map(|t| sides(t).filter(|&side| is_cut(&fine, side, edge)).count()).sum();
            if cuts == 0 {
                break;
            }
            if fine.triangles.len() + triangles.len() + cuts > most {
                let remaining = triangles.iter().flat_map(sides).map(|[a, b]| length(&fine, a, b));
                longest = Some(remaining.fold(longest.unwrap_or(0.0), f32::max));
                break;
            }
            triangles = cut(&mut fine, &triangles, edge);
        }
        fine.parts.push(MeshPart {
            first_triangle: fine.triangles.len() as u32,
            triangle_count: triangles.len() as u32,
            material: part.material,
        });
        fine.triangles.append(&mut triangles);
    }
    (fine, longest)
}

/// A lower bound on the number of triangles after subdivision: no triangle is larger than the equilateral one.
fn min_triangles(mesh: &Mesh, edges: &[Option<f32>]) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| Vec3::from_array(mesh.positions[i as usize]).as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    };
    let of_part = |(part, edge): (&MeshPart, &Option<f32>)| {
        let first = part.first_triangle as usize;
        let triangles = &mesh.triangles[first..first + part.triangle_count as usize];
        let edge = f64::from((*edge)?);
        let largest = 3f64.sqrt() / 4.0 * edge * edge;
        Some(triangles.iter().map(|t| (area(t) / largest).max(1.0)).sum::<f64>())
    };
    mesh.parts.iter().zip(edges).filter_map(of_part).sum()
}

fn sides(triangle: &[u32; 3]) -> impl Iterator<Item = [u32; 2]> + use<> {
    let [a, b, c] = *triangle;
    [[a, b], [b, c], [c, a]].into_iter()
}

fn length(mesh: &Mesh, a: u32, b: u32) -> f32 {
    let [a, b] = [a, b].map(|i| Vec3::from_array(mesh.positions[i as usize]));
    // `abs` makes the result independent of the order of the vertices.
    (a - b).abs().length()
}

/// Is an edge longer than `edge`, and its midpoint distinct from its ends? Far from the origin the spacing of f32 may
/// exceed the edge length, and the midpoint rounds to an end.
fn is_cut(mesh: &Mesh, [a, b]: [u32; 2], edge: f32) -> bool {
    let full_length = length(mesh, a, b);
    if full_length <= edge {
        return false;
    }
    let [p, q] = [a, b].map(|i| mesh.positions[i as usize]);
    let middle = Vec3::from_array(mean(p, q));
    [p, q].iter().all(|&end| middle.distance(Vec3::from_array(end)) < 0.75 * full_length)
}

/// Bisects all edges longer than `edge` once.
fn cut(mesh: &mut Mesh, triangles: &[[u32; 3]], edge: f32) -> Vec<[u32; 3]> {
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut finer = Vec::with_capacity(2 * triangles.len());
    for triangle in triangles {
        let middle = sides(triangle).map(|[a, b]| {
            is_cut(mesh, [a, b], edge)
                .then(|| *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| add_midpoint(mesh, a, b)))
        });
        let middle: Vec<Option<u32>> = middle.collect();
        // Rotate the triangle so that cut edges come first.
        let turn = match [middle[0].is_some(), middle[1].is_some(), middle[2].is_some()] {
            [false, true, _] => 1,
            [_, false, true] => 2,
            _ => 0,
        };
        let [a, b, c] = [0, 1, 2].map(|k| triangle[(k + turn) % 3]);
        let [ab, bc, ca] = [0, 1, 2].map(|k| middle[(k + turn) % 3]);
        match (ab, bc, ca) {
            (Some(ab), Some(bc), Some(ca)) => {
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            (Some(ab), Some(bc), None) => finer.extend([[ab, b, bc], [a, ab, bc], [a, bc, c]]),
            (Some(ab), None, _) => finer.extend([[a, ab, c], [ab, b, c]]),
            _ => finer.push(*triangle),
        }
    }
    finer
}

/// Adds a vertex at the midpoint of two others.
fn add_midpoint(mesh: &mut Mesh, a: u32, b: u32) -> u32 {
    let (a, b) = (a as usize, b as usize);
    let index = mesh.positions.len() as u32;
    mesh.positions.push(mean(mesh.positions[a], mesh.positions[b]));
    if !mesh.normals.is_empty() {
        let sum = mean(mesh.normals[a], mesh.normals[b]);
        let unit = Vec3::from_array(sum).try_normalize().map_or(mesh.normals[a], |n| n.to_array());
        mesh.normals.push(unit);
    }
    for set in mesh.uv_sets.iter_mut().filter(|set| !set.is_empty()) {
        set.push(mean(set[a], set[b]));
    }
    if !mesh.colors.is_empty() {
        mesh.colors.push(mean(mesh.colors[a], mesh.colors[b]));
    }
    mesh.attributes.iter_mut().for_each(|attribute| attribute.push_mean(a, b));
    index
}

fn mean<const N: usize>(a: [f32; N], b: [f32; N]) -> [f32; N] {
    std::array::from_fn(|k| 0.5 * a[k] + 0.5 * b[k])
}

// Normal maps from height maps.

/// Height range of a bump map from black to white at factor 1 (`-bm` in MTL), as a fraction of the texture's width. The
/// formats don't define the unit.
pub(super) const BUMP_HEIGHT: f32 = 0.01;

/// Is an image a normal map rather than a height map? At least 90 % of up to 4096 sampled texels must be coloured and
/// decode to unit vectors with z > 0.
pub(super) fn holds_normals(image: &Image) -> bool {
    let (w, h) = (image.width, image.height);
    let (columns, rows) = (w.min(64), h.min(64));
    let mut vectors = 0;
    for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
        let at = |k: u32, n: u32, size: u32| (u64::from(k) * u64::from(size) / u64::from(n)) as u32;
        let [r, g, b, _] = image.rgba(at(i, columns, w), at(j, rows, h));
        let n = Vec3::new(r, g, b) * 2.0 - 1.0;
        vectors += u32::from(n.z > 0.0 && (n.length() - 1.0).abs() < 0.15 && (r - b).abs() > 0.02);
    }
    vectors * 10 >= columns * rows * 9
}

/// The tangent-space normal map of a tileable height map, by central differences: x along u, y against the rows.
/// `height` is the height range from black to white, in image widths.
pub(super) fn normals_of_heights(image: &Image, height: f32) -> Image {
    let (w, h) = (image.width, image.height);
    // Assumes square texels: one scale for both axes.
    let slope = height * w as f32 * 0.5;
    let value = |x: u32, y: u32| image.rgba(x, y)[0];
    let mut texels = Vec::with_capacity(w as usize * h as usize * 3);
    for y in 0..h {
        for x in 0..w {
            let along_u = value((x + 1) % w, y) - value((x + w - 1) % w, y);
            let along_rows = value(x, (y + 1) % h) - value(x, (y + h - 1) % h);
            let n = Vec3::new(-slope * along_u, slope * along_rows, 1.0).normalize();
            texels.extend((n * 0.5 + 0.5).to_array().map(|c| (c * 65535.0).round() as u16));
        }
    }
    Image {
        name: format!("{} as normals", image.name),
        width: w,
        height: h,
        channels: 3,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::U16(texels)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Image, Pixels};
    use crate::math::Vec3;
    use crate::scene::{Interpolation, Mapping, Material, Shape, Texture, TextureTransform, Wrap};
    use std::sync::Arc;

    /// A displaced material with a height map of `n` by `n` texels.
    fn displaced_by(scene: &mut Scene, n: u32, edge: f32, height: impl Fn(u32, u32) -> f32) -> MaterialId {
        let texels = (0..n * n).map(|i| height(i % n, i / n)).collect();
        let image = scene.add_image(Image {
            name: "heights".into(),
            width: n,
            height: n,
            channels: 1,
            encoding: Encoding::Linear,
            pixels: Arc::new(Pixels::F32(texels)),
        });
        let transform = TextureTransform::default();
        scene.textures.push(Texture::Image {
            image,
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Repeat,
            interpolation: Interpolation::Bilinear,
            mapping: Mapping::Uv { set: 0, transform },
        });
        let texture = (TextureId(scene.textures.len() as u32 - 1), 0);
        let displacement = Some(Displacement { texture, scale: 0.5, midlevel: 0.25, edge });
        scene.add_material(Material { displacement, ..Material::lambert("rock", [0.5; 3]) })
    }

    fn applied(scene: Scene) -> Loaded {
        let mut loaded = Loaded::from(scene);
        apply(&mut loaded);
        assert!(loaded.scene.materials.iter().all(|m| m.displacement.is_none()));
        assert!(loaded.scene.validate().is_empty(), "{:?}", loaded.scene.validate());
        loaded
    }

    fn vertex(mesh: &Mesh, v: u32) -> Vec3 {
        Vec3::from_array(mesh.positions[v as usize])
    }

    /// A 2 x 1 quad with a linear ramp along u becomes an inclined plane between the centres of the outer texels.
    #[test]
    fn a_ramp_tilts_a_quad() {
        let mut scene = Scene::default();
        let n = 16;
        let rock = displaced_by(&mut scene, n, 0.05, |x, _| (x as f32 + 0.5) / 16.0);
        scene.quads.push(Quad::new([1.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -1.0], rock));
        let loaded = applied(scene);
        assert!(loaded.warnings.is_empty() && loaded.scene.quads.is_empty());
        let instance = &loaded.scene.instances[0];
        let mesh = &loaded.scene.meshes[instance.mesh.index()];
        assert!(mesh.triangles.len() > 800, "{} triangles", mesh.triangles.len());
        let slope = Vec3::new(-0.25, 1.0, 0.0).normalize();
        for (v, (p, normal)) in mesh.positions.iter().zip(&mesh.normals).enumerate() {
            let u = f64::from(p[0]) / 2.0;
            let height = (u.clamp(0.5 / 16.0, 15.5 / 16.0) - 0.25) * 0.5;
            assert!((f64::from(p[1]) - height).abs() < 1e-6, "{p:?} {height}");
            let is_inner = (0.1..0.9).contains(&u) && (-0.95..-0.05).contains(&p[2]);
            let normal = Vec3::from_array(*normal);
            assert!(!is_inner || normal.distance(slope) < 1e-4, "{v}: {p:?} {normal}");
        }
    }

    #[test]
    fn no_edge_is_longer_than_wanted_and_no_crack_opens() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 32, 0.11, |x, y| ((x * 7 + y * 5) % 11) as f32 / 11.0);
        // A cube with hard edges: separate vertices per face.
        let (mut positions, mut normals, mut uv) = (Vec::new(), Vec::new(), Vec::new());
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [-1.0f32, 1.0] {
                let first = positions.len() as u32;
                for [a, b] in [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, a * side, b);
                    let mut normal = [0.0; 3];
                    normal[axis] = side;
                    positions.push(p);
                    normals.push(normal);
                    uv.push([0.5 * a + 0.5, 0.5 * b + 0.5]);
                }
                triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        let mesh = Mesh { normals, uv_sets: vec![uv], ..Mesh::new("cube", positions, triangles, rock) };
        let (fine, longest) = subdivided(&mesh, &[Some(0.11)], usize::MAX);
        assert!(longest.is_none());
        for t in &fine.triangles {
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                assert!(vertex(&fine, a).distance(vertex(&fine, b)) <= 0.11001);
            }
        }
        let id = scene.add_mesh(mesh);
        scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
        scene.instances.push(Instance::new(id, DAffine3::from_translation(DVec3::X * 5.0)));
        let loaded = applied(scene);
        assert_eq!(loaded.scene.instances[0].mesh, loaded.scene.instances[1].mesh, "made once");
        let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
        assert_eq!(mesh.triangles.len(), fine.triangles.len());
        // Watertight: every edge, by the positions of its ends, has an opposite edge.
        let mut open: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
        for t in &mesh.triangles {
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                let [a, b] = [a, b].map(|v| vertex(mesh, v).to_array().map(f32::to_bits));
                *open.entry([a, b]).or_default() += 1;
                *open.entry([b, a]).or_default() -= 1;
            }
        }
        assert!(open.values().all(|&count| count == 0), "cracks");
    }

    #[test]
    fn the_triangle_limit_is_kept_and_reported() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 0.1, |_, _| 1.0);
        let mesh =
            Mesh::new("sheet", vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], rock);
        let (fine, longest) = subdivided(&mesh, &[Some(1e-3)], 5000);
        assert!(fine.triangles.len() <= 5000 && fine.triangles.len() > 1000);
        assert!(longest.is_some_and(|longest| (0.01..0.1).contains(&longest)), "{longest:?}");
    }

    #[test]
    fn meshes_without_uv_and_shapes_are_reported() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 0.1, |_, _| 1.0);
        let sheet =
            Mesh::new("sheet", vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], rock);
        let id = scene.add_mesh(sheet);
        scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
        scene.shapes.push(Shape::sphere([0.0; 3], 1.0, rock));
        let loaded = applied(scene);
        let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
        let all = warnings.join("\n");
        assert!(all.contains("no texture coordinates") && all.contains("no spheres"), "{all}");
        assert_eq!(loaded.scene.instances[0].mesh, id);
    }

    /// The spacing of f32 at 1e8 is 8: an edge of that length has no midpoint and isn't cut.
    #[test]
    fn edges_without_a_representable_midpoint_are_not_cut() {
        let positions = vec![[1e8, 0.0, 0.0], [1e8 + 32.0, 0.0, 0.0], [1e8, 0.0, 1e-3]];
        let rock = displaced_by(&mut Scene::default(), 4, 1.0, |_, _| 1.0);
        let mesh = Mesh::new("far", positions, vec![[0, 1, 2]], rock);
        let (fine, longest) = subdivided(&mesh, &[Some(1.0)], 10_000);
        assert!(longest.is_none() && (4..100).contains(&fine.triangles.len()), "{}", fine.triangles.len());
        let steps = fine.positions.iter().map(|p| (p[0] - 1e8) / 8.0);
        assert_eq!(steps.clone().fold(0.0, f32::max), 4.0);
        assert!([0.0, 1.0, 2.0, 3.0].iter().all(|n| steps.clone().any(|step| step == *n)));
    }

    /// The sides of a card have the same positions and opposite normals: each is displaced along its own normal.
    #[test]
    fn both_sides_of_a_card_are_displaced() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 10.0, |_, _| 1.0);
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let normals = [[0.0, 0.0, 1.0]; 4].into_iter().chain([[0.0, 0.0, -1.0]; 4]).collect();
        let uv = vec![[0.5, 0.5]; 8];
        let triangles = vec![[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]];
        let mesh = Mesh::new("card", [square, square].concat(), triangles, rock);
        let id = scene.add_mesh(Mesh { normals, uv_sets: vec![uv], ..mesh });
        scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
        let loaded = applied(scene);
        let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
        let heights: Vec<f32> = mesh.positions.iter().map(|p| p[2]).collect();
        assert_eq!(heights, [0.375, 0.375, 0.375, 0.375, -0.375, -0.375, -0.375, -0.375]);
    }

    #[test]
    fn edge_lengths_far_beyond_the_budget_are_reported() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 1e-6, |x, _| x as f32 / 4.0);
        scene.quads.push(Quad::new([0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], rock));
        let loaded = applied(scene);
        let messages: Vec<String> = loaded.warnings.iter().map(|w| w.message.clone()).collect();
        assert!(messages.iter().any(|w| w.contains("at least") && w.contains("is possible")), "{messages:?}");
        let triangles: usize = loaded.scene.meshes.iter().map(|mesh| mesh.triangles.len()).max().unwrap_or(0);
        assert!((10_000..1_000_000).contains(&triangles), "{triangles}");
    }
}

#[cfg(test)]
mod normal_map_tests {
    use super::*;

    fn image(channels: u32, texel: impl Fn(u32, u32) -> Vec<u8>) -> Image {
        let pixels =
            (0..8).flat_map(|y| (0..8).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
        let pixels = Arc::new(Pixels::U8(pixels));
        Image { name: "a".into(), width: 8, height: 8, channels, encoding: Encoding::Linear, pixels }
    }

    #[test]
    fn normals_and_heights_are_distinguished() {
        assert!(holds_normals(&image(3, |x, _| vec![128 + x as u8, 120, 255])));
        for grey in [0, 128, 201, 255] {
            assert!(!holds_normals(&image(3, |_, _| vec![grey; 3])), "{grey}");
            assert!(!holds_normals(&image(1, |_, _| vec![grey])), "{grey}");
        }
    }

    #[test]
    fn normals_of_a_ramp_tilt_against_its_slope() {
        // Slope of 16/255 per texel along u, -8/255 per row.
        let ramp = image(1, |x, y| vec![(100 + 16 * x - 8 * y) as u8]);
        let normals = normals_of_heights(&ramp, 0.5);
        let [r, g, b, _] = normals.rgba(3, 3);
        let n = Vec3::new(r, g, b) * 2.0 - 1.0;
        let expected = Vec3::new(-0.5 * 8.0 * 16.0 / 255.0, -0.5 * 8.0 * 8.0 / 255.0, 1.0).normalize();
        assert!(n.distance(expected) < 1e-4, "{n} {expected}");
    }
}
