//! Instances from a PLY file: each vertex is one instance, with position, orientation and scale.

use super::header::Source;
use super::rows::{List, Record, Slot, color, to_f64, unit};
use crate::error::Problem;
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use crate::work_counter::WorkCounter;
use ply_rs::ply::Property;

/// Names of the supported vertex properties.
const NAMES: [&str; 29] = [
    "x", "y", "z", "nx", "ny", "nz", "qx", "qy", "qz", "qw", "scale", "sx", "sy", "sz", "m00", "m01", "m02",
    "m10", "m11", "m12", "m20", "m21", "m22", "red", "green", "blue", "alpha", "random", "index",
];
const NORMAL: usize = 3;
const ROTATION: usize = 6;
const SCALE: usize = 10;
const SCALES: usize = 11;
const MATRIX: usize = 14;
const COLOR: usize = 23;
const ALPHA: usize = 26;
const RANDOM: usize = 27;
const INDEX: usize = 28;

/// The transform of an instance, and the outputs of its `object_info` nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::load) struct PointInstance {
    pub world_from_object: DAffine3,
    /// Linear RGBA.
    pub color: Option<[f32; 4]>,
    /// 0 to 1.
    pub random: Option<f32>,
    /// Any number.
    pub index: Option<f32>,
}

/// The instances of a file.
#[derive(Debug, Default)]
pub(in crate::load) struct PointInstances {
    /// In file order.
    pub list: Vec<PointInstance>,
    /// Number of skipped instances with a singular transform, such as scale 0.
    pub degenerate: usize,
}

/// One vertex: values by index of `NAMES`.
struct Row {
    values: [f64; NAMES.len()],
}

impl Record for Row {
    fn new() -> Row {
        Row { values: [0.0; NAMES.len()] }
    }

    fn slot(name: &str) -> Option<Slot> {
        NAMES.iter().position(|known| *known == name).map(|place| Slot::Value(place as u8))
    }

    #[inline]
    fn set(&mut self, slot: Slot, value: &Property) {
        if let Slot::Value(place) = slot {
            let place = usize::from(place);
            self.values[place] = match place {
                COLOR..ALPHA => f64::from(color(value)),
                ALPHA => f64::from(unit(value)),
                _ => to_f64(value),
            };
        }
    }

    fn list(&mut self, _: &str) -> Option<List<'_>> {
        None
    }
}

/// Properties present in a file.
struct Layout {
    has_normal: bool,
    has_rotation: bool,
    has_scale: bool,
    has_scales: bool,
    has_matrix: bool,
    has_color: bool,
    has_alpha: bool,
    has_random: bool,
    has_index: bool,
}

impl Layout {
    /// # Errors
    /// Positions or components of another property are missing, or scales or rotations are given twice.
    fn of(source: &Source) -> Result<Layout, Problem> {
        let group = |first: usize, end: usize| {
            let missing: Vec<&str> =
                NAMES[first..end].iter().filter(|name| !source.has("vertex", name)).copied().collect();
            match missing.len() {
                0 => Ok(true),
                n if n == end - first => Ok(false),
                _ => Err(Problem::new("header", format!("vertices lack {}", missing.join(", ")))),
            }
        };
        if !group(0, NORMAL)? {
            return Err(Problem::new("header", "vertices lack x, y, z, the positions of the instances"));
        }
        let layout = Layout {
            has_normal: group(NORMAL, ROTATION)?,
            has_rotation: group(ROTATION, SCALE)?,
            has_scale: group(SCALE, SCALES)?,
            has_scales: group(SCALES, MATRIX)?,
            has_matrix: group(MATRIX, COLOR)?,
            has_color: group(COLOR, ALPHA)?,
            has_alpha: group(ALPHA, RANDOM)?,
            has_random: group(RANDOM, INDEX)?,
            has_index: group(INDEX, NAMES.len())?,
        };
        let is_scaled_twice = layout.has_scale && layout.has_scales;
        let is_given_twice =
            layout.has_matrix && (layout.has_rotation || layout.has_scale || layout.has_scales);
        if is_scaled_twice || is_given_twice {
            let message =
                "gives scales or rotations twice: 'scale' or 'sx', 'sy', 'sz', or all in 'm00' to 'm22'";
            return Err(Problem::new("header", message));
        }
        Ok(layout)
    }

    fn instance(&self, row: &Row) -> PointInstance {
        let v = &row.values;
        let triple = |first: usize| DVec3::new(v[first], v[first + 1], v[first + 2]);
        let rotation = if self.has_rotation {
            let [x, y, z, w] = std::array::from_fn(|i| v[ROTATION + i]);
            let length = (x * x + y * y + z * z + w * w).sqrt();
            DMat3::from_quat(DQuat::from_xyzw(x / length, y / length, z / length, w / length))
        } else if self.has_normal && !self.has_matrix {
            triple(NORMAL)
                .try_normalize()
                .map_or(DMat3::IDENTITY, |up| DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Y, up)))
        } else {
            DMat3::IDENTITY
        };
        let scale = match (self.has_scale, self.has_scales) {
            (true, _) => DVec3::splat(v[SCALE]),
            (_, true) => triple(SCALES),
            _ => DVec3::ONE,
        };
        let matrix3 = if self.has_matrix {
            DMat3::from_cols(triple(MATRIX), triple(MATRIX + 3), triple(MATRIX + 6)).transpose()
        } else {
            rotation * DMat3::from_diagonal(scale)
        };
        let alpha = if self.has_alpha { v[ALPHA] as f32 } else { 1.0 };
        let rgb = |i: usize| v[COLOR + i] as f32;
        PointInstance {
            world_from_object: DAffine3 { matrix3, translation: triple(0) },
            color: self.has_color.then(|| [rgb(0), rgb(1), rgb(2), alpha]),
            random: self.has_random.then(|| v[RANDOM].clamp(0.0, 1.0) as f32),
            index: self.has_index.then(|| v[INDEX] as f32),
        }
    }
}

/// Reads the instances of a file.
///
/// # Errors
/// A truncated file, missing properties, or transforms that aren't finite.
pub(in crate::load) fn read(bytes: &[u8], counter: &WorkCounter) -> Result<PointInstances, Problem> {
    let mut source = Source::open(bytes, counter)?;
    let layout = Layout::of(&source)?;
    let mut instances = PointInstances { list: Vec::with_capacity(source.count("vertex")), degenerate: 0 };
    let mut first_invalid = None;
    for (name, definition) in source.elements() {
        let is_vertex = name == "vertex";
        source.read(&definition, |number, row: &Row| {
            if !is_vertex {
                return;
            }
            let instance = layout.instance(row);
            if !instance.world_from_object.is_finite() {
                first_invalid.get_or_insert(number);
            } else if is_degenerate(&instance.world_from_object.matrix3) {
                instances.degenerate += 1;
            } else {
                instances.list.push(instance);
            }
        })?;
    }
    match first_invalid {
        Some(number) => Err(Problem::new(format!("vertex {number}"), "the transform isn't finite")),
        None => Ok(instances),
    }
}

/// Whether a transform reduces objects to lines or points.
fn is_degenerate(m: &DMat3) -> bool {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    [x.cross(y), y.cross(z), z.cross(x)].iter().all(|area| area.length_squared() == 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(properties: &[&str], rows: &str) -> Result<PointInstances, Problem> {
        let count = rows.lines().count();
        let properties: String = properties.iter().map(|p| format!("property {p}\n")).collect();
        let text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{rows}\n");
        read(text.as_bytes(), &WorkCounter::default())
    }

    #[test]
    fn instances_are_rotated_and_scaled() {
        let names =
            ["float x", "float y", "float z", "float qx", "float qy", "float qz", "float qw", "float scale"];
        // A rotation by 90 degrees about y maps z to x.
        let instances = parse(&names, "1 2 3 0 2 0 2 0.5\n0 0 0 0 0 0 1 0").unwrap();
        assert_eq!((instances.list.len(), instances.degenerate), (1, 1));
        let at = instances.list[0].world_from_object.transform_point3(DVec3::Z);
        assert!((at - DVec3::new(1.5, 2.0, 3.0)).length() < 1e-12, "{at}");
        let normals =
            parse(&["float x", "float y", "float z", "float nx", "float ny", "float nz"], "0 0 0 0 0 -2");
        let at = normals.unwrap().list[0].world_from_object.transform_point3(DVec3::Y);
        assert!((at - DVec3::NEG_Z).length() < 1e-12, "{at}");
    }

    #[test]
    fn matrices_are_row_major() {
        let names: Vec<String> =
            NAMES[..3].iter().chain(&NAMES[MATRIX..COLOR]).map(|n| format!("float {n}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let instances = parse(&names, "0 0 9 1 2 3 0 1 0 0 0 1").unwrap();
        let at = instances.list[0].world_from_object.transform_point3(DVec3::new(1.0, 10.0, 100.0));
        assert_eq!(at, DVec3::new(321.0, 10.0, 109.0));
    }

    #[test]
    fn colours_random_and_index_are_read() {
        let names = [
            "float x",
            "float y",
            "float z",
            "uchar red",
            "uchar green",
            "uchar blue",
            "float random",
            "int index",
        ];
        let instance = parse(&names, "0 0 0 255 0 188 0.25 7").unwrap().list[0];
        let color = instance.color.unwrap();
        assert!(
            (color[2] - 0.503).abs() < 2e-3 && [color[0], color[1], color[3]] == [1.0, 0.0, 1.0],
            "{color:?}"
        );
        assert_eq!((instance.random, instance.index), (Some(0.25), Some(7.0)));
    }

    #[test]
    fn incomplete_and_invalid_files_are_refused() {
        let error_place = |names: &[&str], rows: &str| parse(names, rows).unwrap_err().place;
        assert_eq!(error_place(&["float x", "float y"], "0 0"), "header");
        assert_eq!(error_place(&["float x", "float y", "float z", "float qx"], "0 0 0 0"), "header");
        let twice = ["float x", "float y", "float z", "float scale", "float sx", "float sy", "float sz"];
        assert_eq!(error_place(&twice, "0 0 0 1 1 1 1"), "header");
        let rotated = ["float x", "float y", "float z", "float qx", "float qy", "float qz", "float qw"];
        assert_eq!(error_place(&rotated, "0 0 0 0 0 0 1\n0 0 0 0 0 0 0"), "vertex 1");
    }
}
