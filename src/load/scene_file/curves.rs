//! `[[curves]]`: hair, fur, grass, threads; each table has many strands of one material.
//!
//! | Key | Value |
//! |---|---|
//! | `name` | for reports |
//! | `strands` | a list of strands, each a list of points `[x, y, z]` from root to tip |
//! | `file` | or a file of strands: `.curves` (text) or `.hair` (binary), see the guide |
//! | `basis` | `"linear"`, `"bezier"` (4, 7, 10, ... points per strand), `"bspline"` (4 points or more) or `"catmull-rom"`; default: the file's, else `"catmull-rom"`, and `"linear"` for `.hair` |
//! | `radius` | metres: one number, or `[root, tip]`; replaces the file's radii, and is required without them |
//! | `material` | name of a material, default `"default"`: of type `"hair"`, or any opaque or thin material without emission |
//! | `transform` | as for objects; scales radii by the cube root of its determinant |
//!
//! `visible_to`, `visible_to_camera`, `holdout`, `shadow_catcher`, `color`, `index` and `random` are as for objects. Texture
//! coordinate u runs along the strand, from 0 at the root to 1 at the tip, and v around it. Colours of a file multiply the
//! `color` of the material. Rays hit curves from outside only; curves are not emissive and have no motion.

use super::builder::SceneFileBuilder;
use super::fields::{Fields, number, numbers};
use super::materials::Materials;
use super::textures::Textures;
use super::{traits, transform};
use crate::load::curves::{self, CurveFile};
use crate::scene::{CurveBasis, Curves};
use std::ops::Range;

/// Reads all tables.
pub(super) fn read<'a>(
    build: &mut SceneFileBuilder,
    root: &Fields<'a>,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) {
    for (i, fields) in root.tables("curves").iter().enumerate() {
        let name = fields.string("name").map_or(format!("curves {}", i + 1), |n| n.value.to_string());
        let curves = read_table(build, fields, name, materials, textures);
        fields.finish();
        build.loaded.scene.curves.extend(curves);
    }
}

/// Reads one table; `None` after a problem.
fn read_table<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    name: String,
    materials: &mut Materials<'a>,
    textures: &mut Textures<'a>,
) -> Option<Curves> {
    let (material_name, material_span) =
        fields.string("material").map_or(("default", fields.span()), |m| (m.value, m.span));
    let material = materials.get(build, textures, material_name, material_span);
    let traits = traits::traits(fields).unwrap_or_default();
    let info = traits::info(fields).unwrap_or_default();
    let world_from_object = transform::read(fields);
    let basis = fields.choice("basis", &CurveBasis::NAMED);
    let radius = radius(fields);
    let (file, span, default) = match (fields.has("strands"), fields.has("file")) {
        (true, false) => (strands(fields)?, fields.span(), CurveBasis::default()),
        (false, true) => from_file(build, fields, &name)?,
        _ => {
            fields.report(format!("{name} need exactly one of 'strands' and 'file'"));
            return None;
        }
    };
    let basis = basis.or(file.basis).unwrap_or(default);
    if let Some(invalid) = file.strands.iter().position(|n| !basis.accepts(*n as usize)) {
        let (number, count) = (invalid + 1, file.strands[invalid]);
        let message = format!("strand {number} of {name} has {count} points");
        fields.problems.push_help(
            span,
            message,
            format!("'{}' needs {} per strand", basis.name(), basis.requirement()),
        );
        return None;
    }
    let mut file = file;
    match radius {
        Some(ends) => file.radii = tapered_radii(&file.strands, ends),
        None if file.radii.len() == file.points.len() => {}
        None => {
            fields.problems.push_help(span, format!("{name} have no radii"), "write 'radius', in metres");
            return None;
        }
    }
    let distant = file.remove_distant_strands(world_from_object);
    let message = match (distant, file.strands.is_empty()) {
        (0, true) => Some(format!("{name} hold no strands")),
        (0, false) => None,
        (1, _) => Some(format!("a strand of {name} reaches beyond 1e18 m and is left out")),
        _ => Some(format!("{distant} strands of {name} reach beyond 1e18 m and are left out")),
    };
    if let Some(message) = message {
        build.warn(message);
    }
    let CurveFile { strands, points, radii, colors, .. } = file;
    let material = material?;
    if !colors.is_empty() {
        build.loaded.scene.materials[material.index()].use_vertex_colors = true;
    }
    Some(Curves { name, basis, strands, points, radii, colors, world_from_object, material, traits, info })
}

/// Radii at root and tip, metres.
fn radius(fields: &Fields) -> Option<[f64; 2]> {
    let value = fields.raw("radius")?;
    let ends = number(value.get_ref()).map(|r| [r; 2]).or_else(|| numbers::<2>(value.get_ref()));
    let ends = ends.filter(|ends| ends.iter().all(|r| *r >= 0.0) && *ends != [0.0; 2]);
    if ends.is_none() {
        let message = "'radius' must be a number above 0, or two from 0 up: at the root and at the tip";
        fields.problems.push(value.span(), message);
    }
    // Problems have been reported.
    ends.or(Some([1.0; 2]))
}

/// Radii per point, linear over the point numbers of each strand.
fn tapered_radii(strands: &[u32], [root, tip]: [f64; 2]) -> Vec<f32> {
    let of_strand = |count: u32| {
        (0..count).map(move |i| {
            let t = f64::from(i) / f64::from((count - 1).max(1));
            (root + (tip - root) * t) as f32
        })
    };
    strands.iter().flat_map(|&count| of_strand(count)).collect()
}

/// The strands listed by the key `strands`.
fn strands(fields: &Fields) -> Option<CurveFile> {
    let mut file = CurveFile::default();
    for strand in fields.list("strands")? {
        let points = strand
            .get_ref()
            .as_array()
            .map(|list| list.iter().map(|p| numbers::<3>(p.get_ref())).collect::<Option<Vec<[f64; 3]>>>());
        let Some(Some(points)) = points else {
            fields.problems.push(strand.span(), "a strand must be a list of points [x, y, z]");
            return None;
        };
        file.strands.push(points.len() as u32);
        file.points.extend(points.iter().map(|p| p.map(|x| x as f32)));
    }
    Some(file)
}

fn from_file(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    name: &str,
) -> Option<(CurveFile, Range<usize>, CurveBasis)> {
    let given = fields.string("file")?;
    let path = build.readable_path(given.value, given.span.clone())?;
    build.options.files.note(&path);
    match curves::read(&path) {
        Ok(file) => {
            if let Some(what) = file.ignored {
                build.warn(format!("{name}: the {what} of '{}' is left out", given.value));
            }
            let is_text = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("curves"));
            let basis = if is_text { CurveBasis::default() } else { CurveBasis::Linear };
            Some((file, given.span, basis))
        }
        Err(e) => {
            let message = e.replacen(&path.display().to_string(), &format!("'{}'", given.value), 1);
            fields.problems.push_of_file(given.span, &path, message);
            None
        }
    }
}
