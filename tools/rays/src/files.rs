//! Meshes and rays in plain binary files, to exchange with other programs.
//!
//! `.tri`: u32 number of vertices, u32 number of triangles, f32 x 3 a vertex, u32 x 3 a triangle.
//! `.rays`: 8 f32 a ray: origin, t_min, direction, t_max. `.hits`: f32 t (infinite: miss), u32 primitive a ray.
//! All little-endian.

use oscura::accel::Geometry;
use oscura::math::{Hit, Ray, Vec3};
use std::fs;
use std::path::Path;

/// A file error.
pub type Result<T> = std::result::Result<T, String>;

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}

/// Reads a `.tri` file.
pub fn read_mesh(path: &Path) -> Result<Geometry> {
    let bytes = read(path)?;
    let words: Vec<u32> =
        bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let (vertices, triangles) = match words[..] {
        [v, t, ..] => (v as usize, t as usize),
        _ => return Err(format!("{}: shorter than its header", path.display())),
    };
    let wanted = 8 + 12 * (vertices + triangles);
    if bytes.len() != wanted {
        return Err(format!("{}: {} bytes, but its header asks for {wanted}", path.display(), bytes.len()));
    }
    let (v, t) = words[2..].split_at(3 * vertices);
    Ok(Geometry {
        positions: v.chunks_exact(3).map(|v| [v[0], v[1], v[2]].map(f32::from_bits)).collect(),
        triangles: t.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        ..Geometry::default()
    })
}

/// Writes a `.tri` file.
pub fn write_mesh(path: &Path, mesh: &Geometry) -> Result<()> {
    let mut bytes = Vec::with_capacity(8 + 12 * (mesh.positions.len() + mesh.triangles.len()));
    for count in [mesh.positions.len(), mesh.triangles.len()] {
        bytes.extend_from_slice(&(count as u32).to_le_bytes());
    }
    bytes.extend_from_slice(bytemuck::cast_slice(&mesh.positions));
    bytes.extend_from_slice(bytemuck::cast_slice(&mesh.triangles));
    write(path, &bytes)
}

/// A ray as stored: origin, `t_min`, direction, `t_max`.
type Record = [f32; 8];

/// Reads a `.rays` file.
pub fn read_rays(path: &Path) -> Result<Vec<Ray>> {
    let bytes = read(path)?;
    if bytes.len() % size_of::<Record>() != 0 {
        return Err(format!("{}: {} bytes are no whole number of rays", path.display(), bytes.len()));
    }
    let ray = |record: &[u8]| {
        let [ox, oy, oz, t_min, dx, dy, dz, t_max] = bytemuck::pod_read_unaligned::<Record>(record);
        Ray { t_min, t_max, ..Ray::new(Vec3::new(ox, oy, oz), Vec3::new(dx, dy, dz)) }
    };
    Ok(bytes.chunks_exact(size_of::<Record>()).map(ray).collect())
}

/// Writes a `.rays` file.
pub fn write_rays(path: &Path, rays: &[Ray]) -> Result<()> {
    let record = |ray: &Ray| -> Record {
        let (o, d) = (ray.origin, ray.direction);
        [o.x, o.y, o.z, ray.t_min, d.x, d.y, d.z, ray.t_max]
    };
    write(path, bytemuck::cast_slice(&rays.iter().map(record).collect::<Vec<Record>>()))
}

/// Writes a `.hits` file.
pub fn write_hits(path: &Path, hits: &[Hit]) -> Result<()> {
    let bytes: Vec<u8> =
        hits.iter().flat_map(|h| [h.t.to_bits(), h.prim]).flat_map(u32::to_le_bytes).collect();
    write(path, &bytes)
}

/// Reads all triangles of an OBJ file.
pub fn read_obj(path: &Path) -> Result<Geometry> {
    let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    let (models, _) = tobj::load_obj(path, &options).map_err(|e| format!("{}: {e}", path.display()))?;
    let mut mesh = Geometry::default();
    for model in models {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(model.mesh.positions.chunks_exact(3).map(|v| [v[0], v[1], v[2]]));
        mesh.triangles
            .extend(model.mesh.indices.chunks_exact(3).map(|t| [first + t[0], first + t[1], first + t[2]]));
    }
    Ok(mesh)
}
