//! The parsers alone, without checks or conversions, used as documented.

use ply_rs::parser::{Parser, Reader};
use ply_rs::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

#[derive(Default)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Vertex {
        Vertex::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Property::Float(v) = value else { return PropertyAccessResult::Ignored };
        match name {
            "x" => self.position[0] = v,
            "y" => self.position[1] = v,
            "z" => self.position[2] = v,
            "nx" => self.normal[0] = v,
            "ny" => self.normal[1] = v,
            "nz" => self.normal[2] = v,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

#[derive(Default)]
struct Face {
    corners: Vec<i32>,
}

impl PropertyAccess for Face {
    fn new() -> Face {
        Face::default()
    }

    fn set_property(&mut self, _: &str, value: Property) -> PropertyAccessResult {
        let Property::ListInt(v) = value else { return PropertyAccessResult::Ignored };
        self.corners = v;
        PropertyAccessResult::Set
    }
}

/// Reads a PLY file by `ply-rs` into typed records; returns their size in bytes.
pub fn ply(path: &Path) -> Result<u64, String> {
    let mut reader = Reader::new(BufReader::new(File::open(path).map_err(|e| e.to_string())?));
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(|e| e.to_string())?;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                vertices = Parser::<Vertex>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| e.to_string())?;
            }
            _ => {
                faces = Parser::<Face>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(|e| e.to_string())?;
            }
        }
    }
    let corners: usize = faces.iter().map(|f| f.corners.len()).sum();
    let numbers: usize = vertices.iter().map(|v| v.position.len() + v.normal.len()).sum();
    Ok(4 * (corners + numbers) as u64)
}

/// Reads an OBJ file by `tobj` with its GPU options; returns the size of the result in bytes.
pub fn obj(path: &Path) -> Result<u64, String> {
    let mut reader = BufReader::new(File::open(path).map_err(|e| e.to_string())?);
    let options = tobj::GPU_LOAD_OPTIONS;
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, |_| Err(tobj::LoadError::OpenFileFailed))
        .map_err(|e| e.to_string())?;
    let numbers = |m: &tobj::Mesh| m.positions.len() + m.normals.len() + m.texcoords.len() + m.indices.len();
    Ok(models.iter().map(|m| 4 * numbers(&m.mesh) as u64).sum())
}
