//! OBJ meshes with MTL materials: a filter validates and normalises the lines before `tobj` parses them.
//!
//! Supported: objects and groups (as instances); polygons, concave ones included; negative indices; normals, else smoothing
//! groups, else flat shading; texture coordinates (v is flipped to point down); vertex colours (sRGB-encoded). Points (`p`),
//! and the vertices of files without faces, become spheres; lines and free-form surfaces are ignored with a warning.
//! Positions beyond single precision are stored relative to a local origin. Text may be UTF-8 or Latin-1, with a byte order
//! mark, any line ends, and lines continued by `\`.
//!
//! The filters (`statements.rs`, `mtl.rs`) record what `tobj` drops: line numbers, smoothing groups, materials of several
//! libraries, texture options. Polygons are triangulated here, as `tobj` assumes convex ones.

mod lines;
mod materials;
mod mtl;
mod statements;

use super::files::{ModelReader, find};
use super::mesh_tools::Repairs;
use super::points::Cloud;
use super::subdivide::Cage;
use super::triangulate::triangulate;
use super::words::is_utf_16;
use super::{LoadOptions, Loaded, Up, UpHint, mesh_tools};
use crate::color::linear_from_srgb;
use crate::error::{Error, Result, Warning};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Instance, Material, MaterialId, Mesh, MeshId, MeshPart};
use lines::{CountedReader, LineFilter, Words, each_line, parse_by_tobj};
use materials::Maps;
use mtl::Mtl;
use statements::{MaterialName, Piece, Statements};
use std::collections::{HashMap, HashSet};
use std::io::{Read, Seek};
use std::iter::Peekable;
use std::path::{Path, PathBuf};
use std::slice::Iter;

/// Reads an OBJ file and its material libraries; each object or group becomes a mesh.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let (models, mut statements) = read(path, options)?;
    let color_warning = mesh_tools::bound_colors(&mut statements.colors, false);
    let points = statements.cloud();
    let origin = match models.is_empty() {
        false => mesh_tools::distant_origin(models.iter().flat_map(|m| m.mesh.positions.as_chunks().0)),
        true => mesh_tools::distant_origin(positions(path, &points)?.iter()),
    };
    let objects = objects(models, &statements, origin);
    let mut loaded = Loaded { up_hint: up_hint(path), ..Loaded::default() };
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    for (line, message) in statements.left_out() {
        loaded.warnings.push(Warning::new(path, format!("line {line}"), message));
    }
    loaded.warnings.extend(color_warning.map(|what| Warning::new(path, "", what)));
    let libraries = match options.geometry_only {
        true => Vec::new(),
        false => read_libraries(path, &statements, options, &mut loaded.warnings),
    };
    if statements.materials.is_empty() && !options.geometry_only {
        loaded.warnings.extend(unused_materials(path, &libraries));
    }
    let materials = statements.materials;
    let mut palette = Palette {
        file: path,
        names: &materials,
        ignores_missing: libraries.is_empty() && !statements.libraries.is_empty(),
        libraries: by_name(&libraries),
        maps: Maps::new(options),
        ids: HashMap::new(),
    };
    let mut repairs = Repairs::default();
    loaded.warnings.extend(shared_points(&objects).map(|what| Warning::new(path, "", what)));
    for object in objects {
        add_object(object, &mut palette, &mut loaded, &mut repairs);
    }
    loaded.warnings.extend(repairs.warnings(path));
    warn_of_missing_coordinates(path, &mut loaded);
    if !points.is_empty() {
        add_points(path, &points, &statements.colors, origin, options, &mut loaded)?;
    }
    mesh_tools::place_at_origin(path, origin, &mut loaded);
    let used: HashSet<&str> = materials.iter().map(|(name, _)| name.as_str()).collect();
    let mut defined = HashSet::new();
    for (library, m) in &libraries {
        if !defined.insert(&m.name) {
            let message = format!("material '{}' is defined repeatedly: the first is used", m.name);
            loaded.warnings.push(Warning::new(library, "", message));
            continue;
        }
        if !used.contains(m.name.as_str()) {
            loaded.left_out.push(format!("material '{}': no face uses it", m.name));
        }
    }
    Ok(loaded)
}

/// Warns of textured faces without texture coordinates, which show a single texel.
fn warn_of_missing_coordinates(path: &Path, loaded: &mut Loaded) {
    let scene = &loaded.scene;
    let bare = scene.meshes.iter().filter(|mesh| mesh.uv_sets.is_empty()).flat_map(|mesh| &mesh.parts);
    let mut ids: Vec<MaterialId> = bare.map(|part| part.material).collect();
    ids.sort_unstable();
    ids.dedup();
    for material in ids.into_iter().map(|id| &scene.materials[id.0 as usize]) {
        if material.textures().next().is_some() {
            let message = format!(
                "material '{}' has textures, but some of its faces have no texture coordinates ('vt')",
                material.name
            );
            loaded.warnings.push(Warning::new(path, "", message));
        }
    }
}

/// The up axis by the exporter in the comments at the head of a file.
fn up_hint(path: &Path) -> UpHint {
    let mut head = Vec::new();
    // Unreadable files were reported earlier.
    let _ = ModelReader::open(path).map(|file| file.take(1 << 10).read_to_end(&mut head));
    let head = String::from_utf8_lossy(&head);
    let is_blender_file = head.lines().any(|l| l.starts_with('#') && l.contains("Blender"));
    UpHint { writer: is_blender_file.then_some((Up::Y, "Blender, which wrote it")), is_mostly_y: true }
}

/// The models of `tobj`, and the filter with the statements that `tobj` doesn't return.
///
/// # Errors
/// An input error with all problems of the file.
fn read(path: &Path, options: &LoadOptions) -> Result<(Vec<tobj::Model>, Statements)> {
    match read_in(path, false, options) {
        Ok((_, statements)) if statements.needs_two_passes => read_in(path, true, options),
        read => read,
    }
}

/// Reads a file in one or two passes. If one pass is insufficient, `needs_two_passes` is set and the result is invalid.
fn read_in(
    path: &Path,
    has_two_passes: bool,
    options: &LoadOptions,
) -> Result<(Vec<tobj::Model>, Statements)> {
    let unreadable = |e| Error::input(path, format!("can't be read: {e}"));
    let mut file = ModelReader::open(path)?;
    let mut start = Vec::new();
    file.by_ref().take(16).read_to_end(&mut start).and_then(|_| file.rewind()).map_err(unreadable)?;
    if is_utf_16(&start) {
        return Err(Error::input(path, ("utf-16", "is UTF-16 text")).with_help("save the file as UTF-8"));
    }
    // Corners with the same indices become one vertex; polygons aren't triangulated.
    let tobj_options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
    let filter = Statements::new(has_two_passes, options.keeps_polygons);
    let no_library = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, statements) = parse_by_tobj(CountedReader::new(file, &options.counter), filter, |reader| {
        tobj::load_obj_buf(reader, &tobj_options, no_library).map(|(models, _)| models)
    })
    .map_err(|message| Error::input(path, message))?;
    if statements.needs_two_passes {
        return Ok((Vec::new(), statements));
    }
    let problems = statements.problems();
    match (problems.is_empty(), models) {
        (false, _) => Err(Error::input_problems(path, problems)),
        // `tobj` fails for files without faces.
        (true, Err(_)) if statements.pieces.is_empty() => Ok((Vec::new(), statements)),
        (true, Err(e)) => Err(Error::input(path, format!("can't be parsed: {e}"))),
        (true, Ok(models)) => Ok((models, statements)),
    }
}

/// Adds an object to the scene and counts repairs.
fn add_object(object: Object, palette: &mut Palette, loaded: &mut Loaded, repairs: &mut Repairs) {
    let Object { mut mesh, runs, cage, .. } = object;
    let ends = runs.iter().skip(1).map(|run| run.first_triangle).chain([mesh.triangles.len() as u32]);
    // Materials are indices of runs until the repair has dropped empty parts.
    let parts = (0..).zip(&runs).zip(ends).map(|((i, &Run { first_triangle, .. }), end)| MeshPart {
        first_triangle,
        triangle_count: end - first_triangle,
        material: MaterialId(i),
    });
    mesh.parts = parts.filter(|part| part.triangle_count > 0).collect();
    repairs.repair(&mut mesh);
    if mesh.triangles.is_empty() {
        return;
    }
    let has_colors = !mesh.colors.is_empty();
    for part in &mut mesh.parts {
        part.material = palette.id(runs[part.material.index()].material, has_colors, loaded);
    }
    if let Some((mut cage, names)) = cage {
        cage.materials = names.into_iter().map(|name| palette.id(name, has_colors, loaded)).collect();
        loaded.polygons.insert(MeshId(loaded.scene.meshes.len() as u32), cage);
    }
    let scene = &mut loaded.scene;
    if mesh.name.is_empty() {
        mesh.name = "mesh".to_string();
    }
    scene.instances.push(Instance {
        name: mesh.name.clone(),
        ..Instance::new(MeshId(scene.meshes.len() as u32), DAffine3::IDENTITY)
    });
    scene.meshes.push(mesh);
}

/// The materials of a file's libraries, converted on first use by a face.
struct Palette<'a> {
    file: &'a Path,
    /// Names of `usemtl` statements with their lines.
    names: &'a [(String, usize)],
    /// No warnings about missing materials: all libraries are missing, which was reported.
    ignores_missing: bool,
    /// All materials by name, with their library's file.
    libraries: HashMap<&'a str, (&'a Path, &'a Mtl)>,
    maps: Maps<'a>,
    /// Converted materials, by name and use of vertex colours.
    ids: HashMap<(MaterialName, bool), MaterialId>,
}

/// Materials by name; of several with one name the first.
fn by_name(libraries: &[(PathBuf, Mtl)]) -> HashMap<&str, (&Path, &Mtl)> {
    libraries.iter().rev().map(|(file, mtl)| (mtl.name.as_str(), (file.as_path(), mtl))).collect()
}

impl Palette<'_> {
    fn id(&mut self, name: MaterialName, has_colors: bool, loaded: &mut Loaded) -> MaterialId {
        if let Some(&id) = self.ids.get(&(name, has_colors)) {
            return id;
        }
        let used = name.and_then(|n| self.names.get(n as usize)).filter(|_| !self.maps.options.geometry_only);
        let found = used.and_then(|(name, _)| self.libraries.get(name.as_str()).copied());
        let mut material = match (found, used) {
            (Some((library, mtl)), _) => materials::convert(mtl, library, &mut self.maps, loaded),
            (None, Some((name, line))) => {
                if !self.ignores_missing {
                    let message = format!("there is no material '{name}'; its faces are grey");
                    loaded.warnings.push(Warning::new(self.file, format!("line {line}"), message));
                }
                Material::lambert(name, [0.8; 3])
            }
            // White is neutral for vertex colours.
            (None, None) => Material::lambert("default", [if has_colors { 1.0 } else { 0.8 }; 3]),
        };
        material.use_vertex_colors = has_colors;
        loaded.scene.materials.push(material);
        let id = MaterialId(loaded.scene.materials.len() as u32 - 1);
        if found.is_none() {
            loaded.default_materials.push(id);
        }
        self.ids.insert((name, has_colors), id);
        id
    }
}

/// The warning about unused material libraries in files without `usemtl`.
fn unused_materials(path: &Path, libraries: &[(PathBuf, Mtl)]) -> Option<Warning> {
    let (first, _) = libraries.first()?;
    let message = format!(
        "has no 'usemtl': its faces are grey, and the {} materials of '{}' are unused; add 'usemtl NAME' before the faces",
        libraries.len(),
        first.file_name().unwrap_or_default().display()
    );
    Some(Warning::new(path, "", ("materials-unused", message)))
}

/// The library with the model's file name, for files with `usemtl` but without `mtllib`.
fn library_by_name(
    path: &Path,
    statements: &Statements,
    warnings: &mut Vec<Warning>,
) -> Option<(String, usize)> {
    let file = path.with_extension("mtl");
    let name = file.file_name()?.to_string_lossy().into_owned();
    if !statements.libraries.is_empty() || !file.is_file() {
        return None;
    }
    let (used_at, (effect, remedy)) = match statements.materials.first() {
        Some((_, line)) => (Some(*line), ("is used, as it has the model's name", "'mtllib' selects others")),
        None => (None, ("is unused", "'mtllib' and 'usemtl' would select it")),
    };
    let message = format!("has no 'mtllib': '{name}' {effect} ({remedy})");
    let code = if used_at.is_some() { "library-guessed" } else { "library-unused" };
    warnings.push(Warning::new(path, "", (code, message)));
    used_at.map(|line| (name, line))
}

/// All materials of the file's libraries; missing libraries are warnings.
fn read_libraries(
    path: &Path,
    statements: &Statements,
    options: &LoadOptions,
    warnings: &mut Vec<Warning>,
) -> Vec<(PathBuf, Mtl)> {
    let (mut all, mut seen) = (Vec::new(), Vec::new());
    let guessed = library_by_name(path, statements, warnings);
    for (statement, line) in statements.libraries.iter().chain(&guessed) {
        let place = format!("line {line}");
        if statement.is_empty() {
            warnings.push(Warning::new(path, &place, "'mtllib' without a file name is ignored"));
        }
        // A name may contain blanks, and a statement several names.
        let names = match find(path, statement, options) {
            Ok(_) => vec![statement.as_str()],
            Err(_) if statement.starts_with('"') => vec![statement.as_str()],
            Err(_) => statement.split_whitespace().collect(),
        };
        for name in names {
            let file = match find(path, name, options) {
                Ok(file) if seen.contains(&file) => continue,
                Ok(file) => file,
                Err(message) => {
                    let message = format!("material library {message}; its materials are grey");
                    warnings.push(Warning::new(path, &place, message));
                    continue;
                }
            };
            match mtl::read(&file, warnings) {
                Ok(materials) => all.extend(materials.into_iter().map(|m| (file.clone(), m))),
                Err(message) => {
                    let message = format!("material library '{name}' {message}; its materials are grey");
                    warnings.push(Warning::new(path, &place, message));
                }
            }
            seen.push(file);
        }
    }
    all
}

// Conversion of `tobj` models to meshes: polygons are triangulated, models of one object merged, and missing normals
// computed from faces or smoothing groups.

/// Consecutive triangles of one material.
#[derive(Clone, Copy)]
struct Run {
    pub first_triangle: u32,
    pub material: MaterialName,
}

/// The faces of one object or group.
struct Object {
    /// The mesh without its parts.
    pub mesh: Mesh,
    /// Runs of triangles, one per material.
    pub runs: Vec<Run>,
    /// The control cage for subdivision, and the material name of each polygon.
    pub cage: Option<(Cage, Vec<MaterialName>)>,
    /// Vertices with normals of a smoothing group: vertex, index of the position in the file, group.
    smooth: Vec<(u32, u32, u32)>,
}

/// The objects of a file, relative to `origin`, from the models of `tobj`, one per piece.
fn objects(models: Vec<tobj::Model>, statements: &Statements, origin: DVec3) -> Vec<Object> {
    let mut builder = ObjectBuilder {
        statements,
        origin,
        corners: &statements.corners,
        runs: statements.runs.iter().peekable(),
        face: 0,
        material: None,
        sums: HashMap::new(),
    };
    let mut models = models.into_iter().map(|m| m.mesh);
    let mut objects = Vec::new();
    for pieces in statements.pieces.chunk_by(|a, b| a.object == b.object) {
        objects.push(builder.object(pieces, models.by_ref().take(pieces.len()).collect()));
    }
    for object in &mut objects {
        for (vertex, position, group) in std::mem::take(&mut object.smooth) {
            if let Some(sum) = builder.sums.get(&(position, group)) {
                object.mesh.normals[vertex as usize] = *sum;
            }
        }
    }
    objects
}

/// The warning about objects with shared positions: each is subdivided separately.
fn shared_points(objects: &[Object]) -> Option<String> {
    let mut owners: HashMap<u32, usize> = HashMap::new();
    for (number, object) in objects.iter().enumerate() {
        let (cage, _) = object.cage.as_ref()?;
        for &point in &cage.points {
            let owner = *owners.entry(point).or_insert(number);
            if owner != number {
                let names = [owner, number].map(|i| &objects[i].mesh.name);
                return Some(format!(
                    "objects or groups share points, such as '{}' and '{}': each is subdivided separately, with a crease between them",
                    names[0], names[1]
                ));
            }
        }
    }
    None
}

struct ObjectBuilder<'s> {
    statements: &'s Statements,
    /// Local origin, subtracted from positions.
    origin: DVec3,
    /// Recorded position indices of the remaining corners.
    corners: &'s [u32],
    /// Remaining material changes.
    runs: Peekable<Iter<'s, (usize, MaterialName)>>,
    /// Index of the next face.
    face: usize,
    material: MaterialName,
    /// Sums of face normals by position and smoothing group, across objects.
    sums: HashMap<(u32, u32), [f32; 3]>,
}

/// A model of `tobj` with data of its statements.
struct PieceModel<'s> {
    piece: &'s Piece,
    model: tobj::Mesh,
    triangles: Vec<[u32; 3]>,
    /// Index in the file of each vertex's position, if recorded.
    numbers: Vec<u32>,
}

impl ObjectBuilder<'_> {
    fn object(&mut self, pieces: &[Piece], models: Vec<tobj::Mesh>) -> Object {
        let mut mesh = Mesh { name: self.statements.objects[pieces[0].object].clone(), ..Mesh::default() };
        mesh.positions.reserve_exact(models.iter().map(|m| m.positions.len() / 3).sum());
        mesh.triangles.reserve_exact(models.iter().map(|m| m.indices.len() / 3).sum());
        if pieces.iter().any(|p| p.has_uvs) {
            mesh.uv_sets.push(Vec::with_capacity(mesh.positions.capacity()));
        }
        let is_flat = pieces.iter().all(Piece::is_flat);
        let cage = self.statements.keeps_polygons.then(Default::default);
        let mut object = Object { mesh, runs: Vec::new(), cage, smooth: Vec::new() };
        let mut is_colored = false;
        for (piece, mut model) in pieces.iter().zip(models) {
            let numbers = self.numbers(piece, &model);
            self.subtract_origin(&mut model, &numbers);
            let triangles = self.triangles(&model, &mut object);
            is_colored |= numbers.iter().any(|&n| (n as usize) < self.statements.colors.len());
            let part = PieceModel { piece, model, triangles, numbers };
            self.add_to_group(&part);
            object.add_polygons(&part, &self.statements.colors);
            object.add(&part, is_flat, &self.statements.colors);
        }
        if !is_colored {
            object.mesh.colors = Vec::new();
        }
        if let Some((cage, _)) = &mut object.cage {
            cage.finish(&object.mesh);
        }
        object.runs = merge_runs(&mut object.mesh.triangles, object.runs);
        object
    }

    /// Makes the positions of vertices relative to the origin in f64; `numbers` are their indices in the file.
    fn subtract_origin(&self, model: &mut tobj::Mesh, numbers: &[u32]) {
        for axis in (0..3).filter(|&axis| self.origin[axis] != 0.0) {
            let positions = model.positions.as_chunks_mut::<3>().0;
            for (position, &number) in positions.iter_mut().zip(numbers) {
                let precise = self.statements.precise.get(number as usize).map_or(f64::NAN, |p| p[axis]);
                let precise = if precise.is_nan() { f64::from(position[axis]) } else { precise };
                position[axis] = (precise - self.origin[axis]) as f32;
            }
        }
    }

    /// Triangulates a model's polygons and records changes of the material.
    fn triangles(&mut self, model: &tobj::Mesh, object: &mut Object) -> Vec<[u32; 3]> {
        let positions = model.positions.as_chunks::<3>().0;
        let first = object.mesh.triangles.len();
        let mut triangles = Vec::with_capacity(model.indices.len() / 3);
        let mut arities = model.face_arities.iter();
        let mut rest = &model.indices[..];
        while !rest.is_empty() {
            // `tobj` leaves arities empty for models of triangles.
            let (corners, behind) = rest.split_at(arities.next().map_or(3, |&n| n as usize));
            rest = behind;
            self.begin_face((first + triangles.len()) as u32, &mut object.runs);
            if let Some((_, materials)) = &mut object.cage {
                materials.push(self.material);
            }
            if let [a, b, c] = *corners {
                triangles.push([a, b, c]);
                continue;
            }
            let points: Vec<[f32; 3]> = corners.iter().map(|&i| positions[i as usize]).collect();
            triangles.extend(triangulate(&points).into_iter().map(|t| t.map(|k| corners[k])));
        }
        triangles
    }

    fn begin_face(&mut self, first_triangle: u32, runs: &mut Vec<Run>) {
        let change = self.runs.next_if(|run| run.0 == self.face);
        if let Some(&(_, material)) = change {
            self.material = material;
        }
        if runs.last().is_none_or(|r| r.material != self.material) {
            runs.push(Run { first_triangle, material: self.material });
        }
        self.face += 1;
    }

    /// Indices in the file of a model's positions, if recorded.
    fn numbers(&mut self, piece: &Piece, model: &tobj::Mesh) -> Vec<u32> {
        if !self.statements.records_corners(piece.group) {
            return Vec::new();
        }
        let (recorded, rest) = self.corners.split_at(model.indices.len());
        self.corners = rest;
        let mut numbers = vec![0; model.positions.len() / 3];
        for (&vertex, &number) in model.indices.iter().zip(recorded) {
            numbers[vertex as usize] = number;
        }
        numbers
    }

    /// Adds the normals of a smoothing group's triangles to their corners, weighted by the angle (Thuermer and Wuethrich 1998,
    /// "Computing Vertex Normals from Polygonal Facets"), which makes them independent of the triangulation.
    fn add_to_group(&mut self, part: &PieceModel) {
        let Some(group) = part.piece.group else { return };
        for triangle in &part.triangles {
            let p = part.corners(triangle);
            // Degenerate triangles have no normal.
            let Some(normal) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { continue };
            for (i, &vertex) in triangle.iter().enumerate() {
                let angle = (p[(i + 1) % 3] - p[i]).angle_between(p[(i + 2) % 3] - p[i]);
                let sum = self.sums.entry((part.numbers[vertex as usize], group)).or_default();
                let [x, y, z] = (normal * angle).as_vec3().to_array();
                *sum = [sum[0] + x, sum[1] + y, sum[2] + z];
            }
        }
    }
}

impl PieceModel<'_> {
    fn corners(&self, triangle: &[u32; 3]) -> [DVec3; 3] {
        let positions = self.model.positions.as_chunks::<3>().0;
        triangle.map(|i| DVec3::from(positions[i as usize].map(f64::from)))
    }
}

impl Object {
    /// Appends the polygons of a part to the cage.
    fn add_polygons(&mut self, part: &PieceModel, colors: &[[f32; 3]]) {
        let Some((cage, _)) = &mut self.cage else { return };
        let PieceModel { model, numbers, .. } = part;
        let base = cage.mesh.positions.len() as u32;
        cage.mesh.positions.extend_from_slice(model.positions.as_chunks::<3>().0);
        cage.points.extend_from_slice(numbers);
        if !self.mesh.uv_sets.is_empty() {
            cage.mesh.uv_sets.resize_with(1, Vec::new);
            cage.mesh.uv_sets[0].extend((0..numbers.len()).map(|v| texture_coordinates(model, v)));
        }
        if !colors.is_empty() {
            cage.mesh.colors.extend(numbers.iter().map(|&number| vertex_color(colors, number)));
        }
        cage.corners.extend(model.indices.iter().map(|v| base + v));
        match model.face_arities.is_empty() {
            true => cage.arities.extend(vec![3; model.indices.len() / 3]),
            false => cage.arities.extend_from_slice(&model.face_arities),
        }
    }

    /// Appends a part. In a mesh with smooth faces, flat faces get separate vertices.
    fn add(&mut self, part: &PieceModel, is_flat: bool, colors: &[[f32; 3]]) {
        let PieceModel { piece, model, triangles, numbers } = part;
        let (base, mesh) = (self.mesh.positions.len() as u32, &mut self.mesh);
        let vertices: Vec<u32> = if piece.is_flat() && !is_flat {
            let corners = triangles.iter().map(|t| part.corners(t));
            let normals =
                corners.map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array());
            mesh.normals.extend(normals.flat_map(|n| [n; 3]));
            mesh.triangles.extend((0..triangles.len() as u32).map(|t| [0, 1, 2].map(|k| base + 3 * t + k)));
            triangles.as_flattened().to_vec()
        } else {
            mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| base + i)));
            (0..model.positions.len() as u32 / 3).collect()
        };
        let of_vertices = vertices.iter().map(|&v| v as usize);
        mesh.positions.extend(of_vertices.clone().map(|v| model.positions.as_chunks::<3>().0[v]));
        if piece.has_normals {
            mesh.normals.extend_from_slice(model.normals.as_chunks::<3>().0);
        } else if let Some(group) = piece.group {
            mesh.normals.resize(mesh.positions.len(), [0.0; 3]);
            self.smooth.extend(numbers.iter().zip(base..).map(|(&number, v)| (v, number, group)));
        }
        if let Some(set) = mesh.uv_sets.first_mut() {
            set.extend(of_vertices.clone().map(|v| texture_coordinates(model, v)));
        }
        if !colors.is_empty() {
            mesh.colors.extend(of_vertices.map(|v| vertex_color(colors, numbers[v])));
        }
    }
}

/// The texture coordinates of a vertex, 0 by default. v points up in the file.
fn texture_coordinates(model: &tobj::Mesh, vertex: usize) -> [f32; 2] {
    model.texcoords.as_chunks::<2>().0.get(vertex).map_or([0.0, 1.0], |[u, v]| [*u, 1.0 - v])
}

/// The linear colour of a position of the file, white by default.
fn vertex_color(colors: &[[f32; 3]], number: u32) -> [f32; 4] {
    let [r, g, b] = colors.get(number as usize).copied().unwrap_or([1.0; 3]).map(linear_from_srgb);
    [r, g, b, 1.0]
}

/// Sorts triangles so that each material has one run, in the order of first use.
fn merge_runs(triangles: &mut Vec<[u32; 3]>, runs: Vec<Run>) -> Vec<Run> {
    let mut order: HashMap<MaterialName, usize> = HashMap::new();
    for run in &runs {
        let next = order.len();
        order.entry(run.material).or_insert(next);
    }
    if order.len() == runs.len() {
        return runs;
    }
    let mut sorted: Vec<Vec<[u32; 3]>> = vec![Vec::new(); order.len()];
    let mut names = vec![None; order.len()];
    for (i, run) in runs.iter().enumerate() {
        let end = runs.get(i + 1).map_or(triangles.len(), |r| r.first_triangle as usize);
        let place = order[&run.material];
        names[place] = run.material;
        sorted[place].extend_from_slice(&triangles[run.first_triangle as usize..end]);
    }
    triangles.clear();
    let mut merged = Vec::new();
    for (part, material) in sorted.iter().zip(names) {
        merged.push(Run { first_triangle: triangles.len() as u32, material });
        triangles.extend_from_slice(part);
    }
    merged
}

// The points of OBJ files (`p`), which `tobj` doesn't support: positions are read again.

/// All positions of a file.
struct Positions {
    origin: DVec3,
    positions: Vec<[f32; 3]>,
}

impl LineFilter for Positions {
    fn line(&mut self, _: usize, text: &[u8], _: &mut Vec<u8>) {
        let mut words = Words(text);
        if words.next() != Some(b"v") {
            return;
        }
        let mut position = [f64::NAN; 3];
        for (number, word) in position.iter_mut().zip(words.by_ref()) {
            *number = lines::double(word).unwrap_or(f64::NAN);
        }
        self.positions.push((DVec3::from_array(position) - self.origin).as_vec3().to_array());
    }
}

/// Adds points as spheres; `numbers` are indices of positions, from 0.
///
/// # Errors
/// An input error if the file can no longer be read, a usage error for an invalid radius.
fn add_points(
    path: &Path,
    numbers: &[u32],
    colors: &[[f32; 3]],
    origin: DVec3,
    options: &LoadOptions,
    loaded: &mut Loaded,
) -> Result<()> {
    let unreadable = |e| Error::input(path, format!("can't be read: {e}"));
    let file = ModelReader::open(path)?;
    let empty = Positions { origin, positions: Vec::new() };
    let all = each_line(file, empty).map_err(unreadable)?;
    let of_points = numbers.iter().map(|&n| n as usize).filter(|&n| n < all.positions.len());
    let positions: Vec<[f32; 3]> = of_points.clone().map(|n| all.positions[n]).collect();
    let is_colored = !colors.is_empty();
    let colors: Vec<_> = of_points.filter(|_| is_colored).map(|n| vertex_color(colors, n as u32)).collect();
    Cloud { positions: &positions, colors: &colors, origin }.add(path, options, loaded)
}

/// The positions of the points, for the origin of a file without faces ([`mesh_tools::distant_origin`]).
fn positions(path: &Path, numbers: &[u32]) -> Result<Vec<[f32; 3]>> {
    let unreadable = |e| Error::input(path, format!("can't be read: {e}"));
    let file = ModelReader::open(path)?;
    let empty = Positions { origin: DVec3::ZERO, positions: Vec::new() };
    let all = each_line(file, empty).map_err(unreadable)?;
    Ok(numbers.iter().filter_map(|&n| all.positions.get(n as usize).copied()).collect())
}
