//! Points and lines of meshes (glTF 2.0, section 3.7.2.1, modes 0 to 3): points become spheres, lines cylindrical curves.
//! Files define no sizes: radii derive from the spacing of the points and the size of the scene.
//!
//! Gaussian splats: `KHR_gaussian_splatting`, and its SPZ compression (`KHR_gaussian_splatting_compression_spz_2`, or the
//! older draft `KHR_spz_gaussian_splats_compression` of the primitive itself).
//!
//! SPZ data is not rotated: the draft of the extension defines a different orientation from SPZ files, but CesiumJS, for which
//! it was designed, doesn't rotate it either.

use super::buffers::Accessor;
use super::document::{Document, pointer};
use super::materials::Materials;
use super::report::{Report, Valid};
use super::vertices::{AttributeFormat, AttributeReader};
use crate::error::{Choice, Result, Warning};
use crate::load::mesh_tools::bound_colors;
use crate::load::points::Cloud;
use crate::load::splats::{FileSplat, SplatList, exp};
use crate::load::{LoadOptions, Loaded, files, splats};
use crate::math::{DAffine3, DVec3};
use crate::scene::{
    CurveBasis, Curves, MaterialId, Mesh, Model, ObjectTraits, Splats, instance_extents, scene_extent,
};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use serde_json::Value;
use std::collections::HashMap;

/// Radius of lines, as a fraction of the diagonal of the scene.
const LINE_RADIUS: f64 = 1e-3;
/// Approximate bytes per point in the scene.
const BYTES_PER_POINT: u64 = 256;

/// Points or lines of a primitive.
#[derive(Clone)]
struct PointsOrLines {
    positions: Vec<[f32; 3]>,
    /// Linear RGBA per position; empty if absent.
    colors: Vec<[f32; 4]>,
    material: MaterialId,
    /// Indices of the positions of each line strip; `None` for points.
    strands: Option<Vec<Vec<u32>>>,
}

/// The points and lines of the visible nodes.
#[derive(Default)]
pub(super) struct PointsAndLines {
    /// By index of the mesh in the file.
    read: HashMap<usize, Vec<PointsOrLines>>,
    /// Instances: mesh, world transform and name.
    placed: Vec<(usize, DAffine3, String)>,
}

impl PointsAndLines {
    /// Adds an instance of the points and lines of a mesh.
    pub fn place(
        &mut self,
        (doc, materials): (&Document, &mut Materials),
        mesh: usize,
        world_from_object: DAffine3,
        name: &str,
        report: &mut Report,
    ) {
        let read = self.read.entry(mesh).or_insert_with(|| read(doc, materials, mesh, report));
        if !read.is_empty() {
            self.placed.push((mesh, world_from_object, name.to_string()));
        }
    }

    /// Adds the points and lines to a scene, after everything else: their radii depend on the size of the scene.
    ///
    /// # Errors
    /// A usage error for an invalid radius.
    pub fn add(&self, doc: &Document, options: &LoadOptions, loaded: &mut Loaded) -> Result<()> {
        if self.placed.is_empty() {
            return Ok(());
        }
        let placed = || {
            self.placed
                .iter()
                .flat_map(|(mesh, place, name)| self.read[mesh].iter().map(move |l| (l, place, name)))
        };
        let mut cloud: (Vec<[f32; 3]>, Vec<[f32; 4]>) = Default::default();
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (primitive, place, _) in placed() {
            let world =
                primitive.positions.iter().map(|p| place.transform_point3(DVec3::from(p.map(f64::from))));
            let finite: Vec<DVec3> = world.clone().filter(|p| p.is_finite()).collect();
            (min, max) = finite.iter().fold((min, max), |(min, max), p| (min.min(*p), max.max(*p)));
            if primitive.strands.is_none() {
                let base = base_color(loaded, primitive.material);
                let color = |i: usize| {
                    let [r, g, b, _] = primitive.colors.get(i).copied().unwrap_or([1.0; 4]);
                    [r * base[0], g * base[1], b * base[2], 1.0]
                };
                cloud.0.extend(world.map(|p| p.as_vec3().to_array()));
                cloud.1.extend((0..primitive.positions.len()).map(color));
            }
        }
        if let Some((low, high)) = scene_extent(&loaded.scene, &instance_extents(&loaded.scene)).0 {
            (min, max) = (min.min(low), max.max(high));
        }
        let size = (max - min).length();
        if !cloud.0.is_empty() {
            Cloud { positions: &cloud.0, colors: &cloud.1, origin: DVec3::ZERO }
                .add(doc.path, options, loaded)?;
        }
        let radius = options.point_radius.unwrap_or(if size > 0.0 && size.is_finite() {
            size * LINE_RADIUS
        } else {
            LINE_RADIUS
        });
        let lines: Vec<Curves> = placed()
            .filter_map(|(primitive, place, name)| cylinders(primitive, place, name, radius))
            .collect();
        if !lines.is_empty() {
            let count: usize = lines.iter().map(|curves| curves.strands.len()).sum();
            let message = format!(
                "{count} lines are shown as cylinders of radius {radius:.3e} ({})",
                Choice::PointRadius
            );
            loaded.notes.push(Warning::new(doc.path, "/meshes", message));
        }
        for curves in &lines {
            loaded.scene.materials[curves.material.index()].use_vertex_colors |= !curves.colors.is_empty();
        }
        loaded.scene.curves.extend(lines);
        Ok(())
    }
}

/// The constant colour of a material: points have no texture coordinates.
fn base_color(loaded: &Loaded, material: MaterialId) -> [f32; 3] {
    let material = &loaded.scene.materials[material.index()];
    match &material.model {
        Model::Pbr(pbr) => pbr.base_color.factor,
        _ => material.emission.map_or([0.8; 3], |emission| emission.radiance.factor),
    }
}

/// The lines of a primitive as linear curves.
fn cylinders(primitive: &PointsOrLines, place: &DAffine3, name: &str, radius: f64) -> Option<Curves> {
    let strands = primitive.strands.as_ref()?;
    let scale = place.matrix3.determinant().abs().cbrt();
    let is_flat = scale.is_nan() || scale <= 0.0;
    // Radii scale with the transform. Curves need an invertible transform: for singular ones points are transformed here.
    let world_from_object = if is_flat { DAffine3::IDENTITY } else { *place };
    let point = |i: u32| {
        let p = primitive.positions[i as usize];
        match is_flat {
            true => place.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array(),
            false => p,
        }
    };
    let is_finite = |strand: &&Vec<u32>| strand.iter().all(|&i| point(i).iter().all(|x| x.is_finite()));
    let strands: Vec<&Vec<u32>> = strands.iter().filter(is_finite).collect();
    let points: Vec<[f32; 3]> = strands.iter().flat_map(|strand| strand.iter().map(|&i| point(i))).collect();
    if points.is_empty() {
        return None;
    }
    let color = |i: &u32| {
        let [r, g, b, _] = primitive.colors[*i as usize];
        [r, g, b]
    };
    let colors = match primitive.colors.is_empty() {
        true => Vec::new(),
        false => strands.iter().flat_map(|strand| strand.iter().map(color)).collect(),
    };
    let radius = if is_flat { radius } else { radius / scale };
    Some(Curves {
        name: name.to_string(),
        basis: CurveBasis::Linear,
        strands: strands.iter().map(|strand| strand.len() as u32).collect(),
        radii: vec![radius as f32; points.len()],
        points,
        colors,
        world_from_object,
        material: primitive.material,
        traits: ObjectTraits::default(),
        info: Default::default(),
    })
}

/// The points and lines of a mesh of the file. Problems are warnings, since the file may also have surfaces.
fn read(doc: &Document, materials: &mut Materials, mesh: usize, report: &mut Report) -> Vec<PointsOrLines> {
    let at = pointer("meshes", mesh);
    let Ok(json) = doc.entry::<gltf::json::Mesh>("meshes", mesh, &at, report) else { return Vec::new() };
    let mut list = Vec::new();
    for (number, primitive) in json.primitives.iter().enumerate() {
        let Checked::Valid(mode) = primitive.mode else { continue };
        let is_loose = matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip);
        if is_loose && !are_splats(doc, mesh, number, report) {
            let at = format!("{at}/primitives/{number}");
            match report.optional(|report| primitive_of(doc, materials, primitive, mode, &at, report)) {
                Ok(primitive) => list.push(primitive),
                Err(problem) => drop(report.warn(at, format!("is left out: {}", problem.message))),
            }
        }
    }
    list
}

fn primitive_of(
    doc: &Document,
    materials: &mut Materials,
    primitive: &Primitive,
    mode: Mode,
    at: &str,
    report: &mut Report,
) -> Valid<PointsOrLines> {
    let material =
        materials.get(doc, primitive.material.map(|m| m.value()), &format!("{at}/material"), report)?;
    let accessor =
        |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(|index| index.value());
    let mut reader = AttributeReader::new(doc, at, "/attributes", None, report);
    let positions =
        reader.open(accessor(Semantic::Positions), "POSITION", &[Type::Vec3], AttributeFormat::Signed);
    let kinds = [Type::Vec3, Type::Vec4];
    let colors = reader.open(accessor(Semantic::Colors(0)), "COLOR_0", &kinds, AttributeFormat::Unsigned);
    let count = reader.finish(0, BYTES_PER_POINT)?;
    let Some(accessor) = positions else { return Err(report.problem(at, "has no positions")) };
    let mut positions = vec![[0.0; 3]; count];
    accessor.read_floats(&mut positions);
    let mut linear = Vec::new();
    if let Some(accessor) = colors {
        linear = vec![[1.0; 4]; count];
        super::vertices::read_colors(&accessor, &mut linear);
        linear.as_flattened_mut().iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        if let Some(what) = bound_colors(&mut linear, false) {
            report.warn(at, what);
        }
    }
    let order = match primitive.indices {
        Some(index) => indices(doc, index.value(), count, at, report)?,
        None => (0..count as u32).collect(),
    };
    let strands = match mode {
        Mode::Points => {
            let picked = |list: &mut Vec<_>| *list = order.iter().map(|&i| list[i as usize]).collect();
            picked(&mut positions);
            if !linear.is_empty() {
                linear = order.iter().map(|&i| linear[i as usize]).collect();
            }
            None
        }
        mode => Some(strands(mode, order)),
    };
    Ok(PointsOrLines { positions, colors: linear, material, strands })
}

/// Vertex indices of a primitive; indices beyond its vertices are a problem.
fn indices(doc: &Document, index: usize, count: usize, at: &str, report: &mut Report) -> Valid<Vec<u32>> {
    let accessor = Accessor::open(doc, index, &format!("{at}/indices"), report)?;
    let unsigned = matches!(accessor.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
    if !unsigned || accessor.kind != Type::Scalar || !doc.may_decode(accessor.count as u64 * BYTES_PER_POINT)
    {
        return Err(report.problem(at, "has indices that can't be read"));
    }
    let mut order = vec![0; accessor.count];
    accessor.read_indices(&mut order);
    match order.iter().find(|&&i| i as usize >= count) {
        Some(i) => Err(report.problem(at, format!("holds the index {i}, but there are {count} vertices"))),
        None => Ok(order),
    }
}

/// The line strips, each of at least two points.
fn strands(mode: Mode, mut order: Vec<u32>) -> Vec<Vec<u32>> {
    match mode {
        Mode::Lines => order.as_chunks::<2>().0.iter().map(|pair| pair.to_vec()).collect(),
        _ if order.len() < 2 => Vec::new(),
        Mode::LineLoop => {
            order.push(order[0]);
            vec![order]
        }
        _ => vec![order],
    }
}

/// The extension for Gaussian splats.
pub(super) const NAME: &str = "KHR_gaussian_splatting";
/// Prefix of its extensions for SPZ data in a buffer view.
const SPZ: &str = "KHR_gaussian_splatting_compression_spz";
/// The older draft: an extension of primitives.
const SPZ_OF_PRIMITIVES: &str = "KHR_spz_gaussian_splats_compression";

/// Approximate size of a splat in the scene, bytes.
const BYTES_PER_SPLAT: u64 = 160;

/// Whether a primitive is a set of Gaussian splats.
pub(super) fn are_splats(doc: &Document, mesh: usize, primitive: usize, report: &mut Report) -> bool {
    raw(doc, mesh, primitive, report).is_some_and(|raw| extension(raw).is_some())
}

fn raw<'d>(doc: &'d Document, mesh: usize, primitive: usize, report: &mut Report) -> Option<&'d Value> {
    let at = pointer("meshes", mesh);
    doc.raw("meshes", mesh, &at, report).ok()?.get("primitives")?.get(primitive)
}

fn extension(raw: &Value) -> Option<&Value> {
    let extensions = raw.get("extensions")?;
    extensions.get(NAME).or_else(|| extensions.get(SPZ_OF_PRIMITIVES))
}

/// Index of the buffer view with a primitive's SPZ data.
fn spz_view(raw: &Value, extension: &Value) -> Option<usize> {
    let draft = raw.get("extensions").and_then(|all| all.get(SPZ_OF_PRIMITIVES));
    let inner = extension.get("extensions").and_then(Value::as_object);
    // The suffix is the version of SPZ, which is also in the data.
    let inner = inner.and_then(|all| all.iter().find(|(name, _)| name.starts_with(SPZ)));
    let spz = inner.map(|(_, spz)| spz).or(draft)?;
    spz.get("bufferView")?.as_u64().map(|view| view as usize)
}

/// The splats of a primitive as a mesh.
pub(super) fn read_splats(
    doc: &Document,
    (mesh, primitive): (usize, usize),
    material: impl FnOnce() -> MaterialId,
    at: &str,
    report: &mut Report,
) -> Valid<Option<Mesh>> {
    let Some(raw) = raw(doc, mesh, primitive, report) else { return Ok(None) };
    let Some(extension) = extension(raw) else { return Ok(None) };
    let inner = extension.get("extensions").and_then(Value::as_object);
    let mut list = match (spz_view(raw, extension), inner) {
        (Some(view), _) => compressed(doc, view, at, report)?,
        (None, Some(inner)) => {
            let names: Vec<&str> = inner.keys().map(String::as_str).collect();
            let message = format!("is compressed by {}, which is not supported", names.join(", "));
            return Err(report.warn(at, message));
        }
        (None, None) => uncompressed(doc, raw, at, report)?,
    };
    warn_of_kinds(extension, at, report);
    list.set_linear(extension.get("colorSpace").and_then(Value::as_str) == Some("lin_rec709_display"));
    let (messages, faint) = list.messages();
    for what in messages {
        report.warn(at, what);
    }
    if let Some(what) = faint {
        report.warn(at, what);
    }
    match list.is_empty() {
        true => Err(report.warn(at, ("splats-invisible", "holds no visible splats"))),
        false => Ok(Some(list.into_mesh("splats", material()))),
    }
}

/// Warns of unsupported kernels and colour spaces.
fn warn_of_kinds(extension: &Value, at: &str, report: &mut Report) {
    let supported =
        [("kernel", &["ellipse"][..]), ("colorSpace", &["srgb_rec709_display", "lin_rec709_display"])];
    for (key, values) in supported {
        if let Some(other) = extension.get(key).and_then(Value::as_str).filter(|v| !values.contains(v)) {
            report.warn(
                at,
                ("splats-kernel", format!("has the unsupported {key} '{other}', taken as '{}'", values[0])),
            );
        }
    }
}

/// The splats of an SPZ file in a buffer view.
fn compressed(doc: &Document, view: usize, at: &str, report: &mut Report) -> Valid<SplatList> {
    let bytes = files::gunzipped(doc.view(view, at, report)?.bytes).map_err(|why| report.problem(at, why))?;
    let (list, messages) = splats::read(&bytes).map_err(|problem| report.problem(at, problem.message))?;
    if let Some(what) = messages {
        report.warn(at, what);
    }
    Ok(list)
}

/// The splats in accessors.
fn uncompressed(doc: &Document, raw: &Value, at: &str, report: &mut Report) -> Valid<SplatList> {
    let index = |name: &str| raw.get("attributes")?.get(name)?.as_u64().map(|index| index as usize);
    let attribute = |name: &str| index(&format!("{NAME}:{name}"));
    let coefficient = |(l, n): (u8, u8)| attribute(&format!("SH_DEGREE_{l}_COEF_{n}"));
    let of_degree = |l: u8| (0..2 * l + 1).map(move |n| (l, n));
    let needed = [
        ("ROTATION", attribute("ROTATION")),
        ("SCALE", attribute("SCALE")),
        ("OPACITY", attribute("OPACITY")),
    ];
    let needed = needed.into_iter().chain([("SH_DEGREE_0_COEF_0", coefficient((0, 0)))]);
    let missing: Vec<&str> = needed.filter(|(_, index)| index.is_none()).map(|(name, _)| name).collect();
    if index("POSITION").is_none() || !missing.is_empty() {
        return Err(
            report.warn(at, ("splats-incomplete", format!("lacks splat attributes: {}", missing.join(", "))))
        );
    }
    let degree =
        (1..=Splats::MAX_DEGREE).take_while(|&l| of_degree(l).all(|c| coefficient(c).is_some())).count();
    let mut reader = AttributeReader::new(doc, at, "/attributes", None, report);
    let mut open = |index, name: &str, kind: Type| reader.open(index, name, &[kind], AttributeFormat::Any);
    let positions = open(index("POSITION"), "POSITION", Type::Vec3);
    let rotations = open(attribute("ROTATION"), "ROTATION", Type::Vec4);
    let scales = open(attribute("SCALE"), "SCALE", Type::Vec3);
    let opacities = open(attribute("OPACITY"), "OPACITY", Type::Scalar);
    let all = (0..=degree as u8).flat_map(of_degree);
    let harmonics: Vec<_> = all.map(|c| open(coefficient(c), "SH_DEGREE", Type::Vec3)).collect();
    let count = reader.finish(0, BYTES_PER_SPLAT)?;
    let mut lists =
        (vec![[0.0; 3]; count], vec![[0.0; 4]; count], vec![[0.0; 3]; count], vec![[0.0; 1]; count]);
    positions.iter().for_each(|accessor| accessor.read_floats(&mut lists.0));
    rotations.iter().for_each(|accessor| accessor.read_floats(&mut lists.1));
    scales.iter().for_each(|accessor| accessor.read_floats(&mut lists.2));
    opacities.iter().for_each(|accessor| accessor.read_floats(&mut lists.3));
    // Coefficient-major.
    let mut colors = vec![[0.0f32; 3]; count * harmonics.len()];
    for (accessor, list) in harmonics.iter().flatten().zip(colors.chunks_exact_mut(count.max(1))) {
        accessor.read_floats(list);
    }
    let are_logarithms = lists.2.iter().flatten().any(|scale| *scale < 0.0);
    if are_logarithms {
        report.warn(at, "has scales below 0: all are taken as logarithms, as in drafts of the extension");
    }
    let mut list = SplatList::new(count, degree as u8, DVec3::ZERO)
        .map_err(|problem| report.problem(at, problem.message))?;
    let mut coefficients = Vec::new();
    for i in 0..count {
        coefficients.clear();
        coefficients.extend((0..harmonics.len()).map(|k| colors[k * count + i]));
        let scales = if are_logarithms { lists.2[i].map(exp) } else { lists.2[i] };
        list.push(&FileSplat {
            center: DVec3::from(lists.0[i].map(f64::from)),
            scales,
            rotation: lists.1[i],
            opacity: lists.3[i][0],
            coefficients: &coefficients,
        });
    }
    Ok(list)
}
