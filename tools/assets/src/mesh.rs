//! A large smooth mesh, written as PLY, OBJ and GLB with the same data: positions, normals and triangles.

use serde_json::json;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Vertices with normals, and triangles.
pub struct Mesh {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// A point of a wavy torus of radii 1 and 0.4, at two angles.
fn surface(u: f64, v: f64) -> [f64; 3] {
    let r = 0.4 + 0.05 * (9.0 * u).sin() * (5.0 * v).cos();
    let ring = 1.0 + r * v.cos();
    [ring * u.cos(), r * v.sin(), -ring * u.sin()]
}

impl Mesh {
    /// The torus of `surface`, as a grid of about this many triangles, without a seam.
    pub fn torus(triangles: usize) -> Mesh {
        let rows = ((triangles as f64 / 4.0).sqrt() as u32).max(3);
        let columns = ((triangles as u32 / 2) / rows).max(3);
        let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
        let (mut positions, mut normals, mut faces) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..columns {
            for j in 0..rows {
                let (u, v) = (turn(i, columns), turn(j, rows));
                let slope = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| b[k] - a[k]);
                let step = 1e-4;
                let along_u = slope(surface(u - step, v), surface(u + step, v));
                let along_v = slope(surface(u, v - step), surface(u, v + step));
                let n = [0, 1, 2].map(|k| {
                    let (p, q) = ((k + 1) % 3, (k + 2) % 3);
                    along_u[p] * along_v[q] - along_u[q] * along_v[p]
                });
                let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
                positions.push(surface(u, v).map(|x| x as f32));
                normals.push(n.map(|x| (x / length) as f32));
                let at = |i: u32, j: u32| (i % columns) * rows + j % rows;
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                faces.extend([[a, b, c], [a, c, d]]);
            }
        }
        Mesh { positions, normals, triangles: faces }
    }

    fn ply(&self, out: &mut impl Write) -> std::io::Result<()> {
        write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", self.positions.len())?;
        for name in ["x", "y", "z", "nx", "ny", "nz"] {
            writeln!(out, "property float {name}")?;
        }
        let faces = self.triangles.len();
        write!(out, "element face {faces}\nproperty list uchar int vertex_indices\nend_header\n")?;
        for (p, n) in self.positions.iter().zip(&self.normals) {
            for x in p.iter().chain(n) {
                out.write_all(&x.to_le_bytes())?;
            }
        }
        for t in &self.triangles {
            out.write_all(&[3])?;
            for i in t {
                out.write_all(&i.to_le_bytes())?;
            }
        }
        Ok(())
    }

    fn obj(&self, out: &mut impl Write) -> std::io::Result<()> {
        writeln!(out, "o torus")?;
        for [x, y, z] in &self.positions {
            writeln!(out, "v {x:.6} {y:.6} {z:.6}")?;
        }
        for [x, y, z] in &self.normals {
            writeln!(out, "vn {x:.4} {y:.4} {z:.4}")?;
        }
        for [a, b, c] in self.triangles.iter().map(|t| t.map(|i| i + 1)) {
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
        }
        Ok(())
    }

    fn glb(&self, out: &mut impl Write) -> std::io::Result<()> {
        let (vertices, corners) = (self.positions.len(), self.triangles.len() * 3);
        let (vertex_bytes, index_bytes) = (vertices * 12, corners * 4);
        let extreme = |pick: fn(f32, f32) -> f32| {
            let all = self.positions.iter().copied();
            all.reduce(|a, b| [0, 1, 2].map(|i| pick(a[i], b[i]))).map(|p| p.map(f64::from))
        };
        let view = |offset: usize, length: usize, target: u32| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length, "target": target });
        let mut text = json!({
            "asset": { "version": "2.0", "generator": "oscura-assets" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0, "name": "torus" }],
            "meshes": [{ "name": "torus", "primitives": [
                { "attributes": { "POSITION": 0, "NORMAL": 1 }, "indices": 2, "mode": 4 },
            ] }],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
                  "min": extreme(f32::min), "max": extreme(f32::max) },
                { "bufferView": 1, "componentType": 5126, "count": vertices, "type": "VEC3" },
                { "bufferView": 2, "componentType": 5125, "count": corners, "type": "SCALAR" },
            ],
            "bufferViews": [
                view(0, vertex_bytes, 34962),
                view(vertex_bytes, vertex_bytes, 34962),
                view(2 * vertex_bytes, index_bytes, 34963),
            ],
            "buffers": [{ "byteLength": 2 * vertex_bytes + index_bytes }],
        })
        .to_string();
        while !text.len().is_multiple_of(4) {
            text.push(' ');
        }
        let payload = 2 * vertex_bytes + index_bytes;
        let total = 12 + 8 + text.len() + 8 + payload;
        let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes).map_err(std::io::Error::other);
        out.write_all(b"glTF")?;
        for n in [2, total, text.len()] {
            out.write_all(&word(n)?)?;
        }
        out.write_all(b"JSON")?;
        out.write_all(text.as_bytes())?;
        out.write_all(&word(payload)?)?;
        out.write_all(b"BIN\0")?;
        for x in self.positions.as_flattened().iter().chain(self.normals.as_flattened()) {
            out.write_all(&x.to_le_bytes())?;
        }
        for i in self.triangles.as_flattened() {
            out.write_all(&i.to_le_bytes())?;
        }
        Ok(())
    }
}

/// Writes `mesh.ply` (binary), `mesh.obj` and `mesh.glb` into a folder.
pub fn write_all(folder: &Path, triangles: usize) -> Result<(), String> {
    let mesh = Mesh::torus(triangles);
    to_file(&folder.join("mesh.ply"), |out| mesh.ply(out))?;
    to_file(&folder.join("mesh.obj"), |out| mesh.obj(out))?;
    to_file(&folder.join("mesh.glb"), |out| mesh.glb(out))
}

/// Writes the torus as a binary PLY file.
pub fn write_ply(path: &Path, triangles: usize) -> Result<(), String> {
    to_file(path, |out| Mesh::torus(triangles).ply(out))
}

/// Quads of the coarse torus in both directions. Four subdivision levels make 1,003,520 triangles of them.
const QUADS: (u32, u32) = (56, 35);

/// Writes a coarse torus of quads as an OBJ file, to be subdivided.
pub fn write_quads(path: &Path) -> Result<(), String> {
    let (around, across) = QUADS;
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    let at = |i: u32, j: u32| (i % around) * across + j % across + 1;
    let grid = || (0..around).flat_map(|i| (0..across).map(move |j| (i, j)));
    to_file(path, |out| {
        writeln!(out, "o torus")?;
        for (i, j) in grid() {
            let [x, y, z] = surface(turn(i, around), turn(j, across));
            writeln!(out, "v {x:.4} {y:.4} {z:.4}")?;
        }
        grid().try_for_each(|(i, j)| {
            writeln!(out, "f {} {} {} {}", at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1))
        })
    })
}

fn to_file(path: &Path, write: impl Fn(&mut BufWriter<File>) -> std::io::Result<()>) -> Result<(), String> {
    let failed = |e: std::io::Error| format!("{}: {e}", path.display());
    let mut out = BufWriter::new(File::create(path).map_err(failed)?);
    write(&mut out).and_then(|()| out.flush()).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::load::{LoadOptions, load};

    #[test]
    fn written_files_load_as_the_same_mesh() {
        let folder = std::env::temp_dir().join(format!("oscura-assets-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        write_all(&folder, 1000).expect("written");
        let mesh = Mesh::torus(1000);
        for name in ["mesh.ply", "mesh.obj"] {
            let scene =
                load(folder.join(name), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}")).scene;
            let read = &scene.meshes[0];
            assert_eq!(
                (read.triangles.len(), read.positions.len()),
                (mesh.triangles.len(), mesh.positions.len())
            );
            let t = mesh.triangles[17].map(|i| mesh.positions[i as usize]);
            let r = read.triangles[17].map(|i| read.positions[i as usize]);
            let close = t.as_flattened().iter().zip(r.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close, "{name}: {t:?} {r:?}");
        }
        std::fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn the_torus_is_closed_and_its_normals_point_out() {
        let mesh = Mesh::torus(2000);
        assert!((1900..=2000).contains(&mesh.triangles.len()), "{}", mesh.triangles.len());
        let p = |i: u32| mesh.positions[i as usize];
        let volume: f32 = mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(p);
                a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0])
            })
            .sum();
        assert!(volume > 0.0, "the triangles face inwards");
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            let ring = (p[0] * p[0] + p[2] * p[2]).sqrt();
            let out = [p[0] - p[0] / ring, p[1], p[2] - p[2] / ring];
            assert!((0..3).map(|k| out[k] * n[k]).sum::<f32>() > 0.0);
        }
    }
}
