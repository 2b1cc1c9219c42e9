//! Scenes with many copies of one thing and little else, to measure the scaling of cost.

use std::fmt::Write;

/// Triangles of an instanced mesh: more than the limit for flattening (1,024).
const SHARED_GRID: u32 = 23;
/// Vertices along an edge of a small mesh.
const SMALL_GRID: u32 = 5;

/// A glTF file and its buffer.
pub struct Model {
    /// The text; it names `growing.bin`.
    pub gltf: String,
    /// The buffer.
    pub bin: Vec<u8>,
}

/// The parts of a glTF file: JSON objects, separated by commas.
#[derive(Default)]
struct Builder {
    bin: Vec<u8>,
    views: String,
    accessors: String,
    accessor_count: usize,
    meshes: String,
    nodes: String,
    materials: String,
    extensions_used: &'static str,
    animations: String,
    /// The nodes of the scene; all of them, where empty.
    roots: String,
}

fn push(list: &mut String, object: std::fmt::Arguments<'_>) {
    if !list.is_empty() {
        list.push(',');
    }
    let _ = list.write_fmt(object);
}

impl Builder {
    /// Adds an accessor with its own data; returns its index.
    fn accessor(&mut self, bytes: &[u8], component: u32, count: usize, rest: &str) -> usize {
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        push(
            &mut self.views,
            format_args!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{}}}"#, bytes.len()),
        );
        let view = self.accessor_count;
        push(
            &mut self.accessors,
            format_args!(r#"{{"bufferView":{view},"componentType":{component},"count":{count},{rest}}}"#),
        );
        self.accessor_count += 1;
        view
    }

    fn floats(&mut self, numbers: &[f32], kind: &str, lanes: usize) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let extreme = |start: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..lanes)
                .map(|lane| numbers.iter().skip(lane).step_by(lanes).copied().fold(start, pick))
                .collect()
        };
        let (min, max) = (extreme(f32::INFINITY, f32::min), extreme(f32::NEG_INFINITY, f32::max));
        let rest = format!(r#""type":"{kind}","min":{min:?},"max":{max:?}"#);
        self.accessor(&bytes, 5126, numbers.len() / lanes, &rest)
    }

    fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, 5125, indices.len(), r#""type":"SCALAR""#)
    }

    fn mesh(&mut self, positions: usize, indices: usize, more: &str) {
        push(
            &mut self.meshes,
            format_args!(
                r#"{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{indices}{more}}}]}}"#
            ),
        );
    }

    fn node(&mut self, mesh: usize, [x, y, z]: [f64; 3]) {
        push(&mut self.nodes, format_args!(r#"{{"mesh":{mesh},"translation":[{x},{y},{z}]}}"#));
    }

    fn finish(self, node_count: usize) -> Model {
        let roots = match self.roots.is_empty() {
            true => (0..node_count).map(|i| i.to_string()).collect::<Vec<_>>().join(","),
            false => self.roots,
        };
        let mut gltf = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[{roots}]}}],"buffers":[{{"uri":"growing.bin","byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],"meshes":[{}],"nodes":[{}]"#,
            self.bin.len(),
            self.views,
            self.accessors,
            self.meshes,
            self.nodes
        );
        for (key, list) in [
            ("materials", &self.materials),
            ("animations", &self.animations),
            ("extensionsUsed", &self.extensions_used.to_string()),
        ] {
            if !list.is_empty() {
                let _ = write!(gltf, r#","{key}":[{list}]"#);
            }
        }
        gltf.push('}');
        Model { gltf, bin: self.bin }
    }
}

/// A sheet of `2 n n` triangles of about unit size, whose heights depend on `seed`.
fn sheet(n: u32, seed: u32) -> Vec<f32> {
    let mut positions = Vec::new();
    for (x, y) in (0..=n).flat_map(|y| (0..=n).map(move |x| (x, y))) {
        let mut bits = (x + y * 1009).wrapping_mul(2_654_435_761) ^ seed.wrapping_mul(0x9e37_79b9);
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x85eb_ca6b);
        let height = (bits >> 8) as f32 / (1 << 24) as f32 * 0.02;
        positions.extend([x as f32 / n as f32 - 0.5, y as f32 / n as f32 - 0.5, height]);
    }
    positions
}

fn sheet_indices(n: u32) -> Vec<u32> {
    let mut indices = Vec::new();
    for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
        let a = y * (n + 1) + x;
        indices.extend([a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1]);
    }
    indices
}

/// The position of one of `n` objects in a square grid of cells of size 1.1.
fn in_square(i: usize, n: usize) -> [f64; 2] {
    let side = (n as f64).sqrt().ceil() as usize;
    [i % side, i / side].map(|cell| cell as f64 * 1.1)
}

/// `n` meshes of 1,058 triangles, each instanced twice.
pub fn shared_meshes(n: usize) -> Model {
    meshes(n, SHARED_GRID, 2)
}

/// `n` meshes of 50 triangles, each used once.
pub fn small_meshes(n: usize) -> Model {
    meshes(n, SMALL_GRID, 1)
}

fn meshes(n: usize, grid: u32, uses: usize) -> Model {
    let mut model = Builder::default();
    let indices = model.indices(&sheet_indices(grid));
    for mesh in 0..n {
        let positions = model.floats(&sheet(grid, mesh as u32), "VEC3", 3);
        model.mesh(positions, indices, "");
        let [x, y] = in_square(mesh, n);
        (0..uses).for_each(|level| model.node(mesh, [x, y, -2.0 * level as f64]));
    }
    model.finish(uses * n)
}

/// `n` instances of a mesh of 1,058 triangles.
pub fn instances(n: usize) -> Model {
    placed(n, SHARED_GRID)
}

/// `n` instances of a mesh of 128 triangles.
pub fn small_instances(n: usize) -> Model {
    placed(n, 8)
}

/// `n` instances of a sheet of `2 grid grid` triangles.
fn placed(n: usize, grid: u32) -> Model {
    let mut model = Builder::default();
    let indices = model.indices(&sheet_indices(grid));
    let positions = model.floats(&sheet(grid, 1), "VEC3", 3);
    model.mesh(positions, indices, "");
    for i in 0..n {
        let [x, y] = in_square(i, n);
        model.node(0, [x, y, 0.0]);
    }
    model.finish(n)
}

/// `n` nodes in chains of a hundred, with a small mesh at the end of each.
pub fn chains(n: usize) -> Model {
    const LENGTH: usize = 100;
    let mut model = Builder::default();
    let indices = model.indices(&sheet_indices(SMALL_GRID));
    let positions = model.floats(&sheet(SMALL_GRID, 1), "VEC3", 3);
    model.mesh(positions, indices, "");
    for i in 0..n {
        let [x, y] = in_square(i / LENGTH, n.div_ceil(LENGTH));
        let is_last = i % LENGTH == LENGTH - 1 || i == n - 1;
        match is_last {
            true => push(&mut model.nodes, format_args!(r#"{{"mesh":0}}"#)),
            false if i % LENGTH == 0 => {
                push(
                    &mut model.nodes,
                    format_args!(r#"{{"translation":[{x},{y},0],"children":[{}]}}"#, i + 1),
                );
            }
            false => push(&mut model.nodes, format_args!(r#"{{"children":[{}]}}"#, i + 1)),
        }
        if i % LENGTH == 0 {
            push(&mut model.roots, format_args!("{i}"));
        }
    }
    model.finish(n)
}

/// `n` disjoint glass meshes of 80 triangles, with inward normals on request.
pub fn glass_bodies(n: usize, are_inverted: bool) -> Model {
    let mut model = Builder {
        extensions_used: r#""KHR_materials_transmission","KHR_materials_volume""#,
        materials: r#"{"pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0},"extensions":{"KHR_materials_transmission":{"transmissionFactor":1},"KHR_materials_volume":{"thicknessFactor":1}}}"#.into(),
        ..Builder::default()
    };
    let (positions, mut triangles) = ball();
    if are_inverted {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let indices = model.indices(triangles.as_flattened());
    let side = (n as f64).cbrt().ceil() as usize;
    for i in 0..n {
        // Each is a separate mesh.
        let radius = 0.3 * (1.0 + 1e-3 * (i % 7) as f32);
        let scaled: Vec<f32> = positions.as_flattened().iter().map(|x| x * radius).collect();
        let positions = model.floats(&scaled, "VEC3", 3);
        model.mesh(positions, indices, r#","material":0"#);
        model.node(i, [i % side, i / side % side, i / side / side].map(|cell| cell as f64));
    }
    model.finish(n)
}

/// A sphere of radius 1 as an octahedron subdivided twice: 128 triangles.
fn ball() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut positions: Vec<[f32; 3]> = vec![
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let mut triangles =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..2 {
        let mut known = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32, positions: &mut Vec<[f32; 3]>| {
            *known.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (a, b) = (positions[a as usize], positions[b as usize]);
                let sum: [f32; 3] = std::array::from_fn(|i| a[i] + b[i]);
                let length = sum.iter().map(|x| x * x).sum::<f32>().sqrt();
                positions.push(sum.map(|x| x / length));
                positions.len() as u32 - 1
            })
        };
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]: [u32; 3]| {
                let ab = middle(a, b, &mut positions);
                let bc = middle(b, c, &mut positions);
                let ca = middle(c, a, &mut positions);
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (positions, triangles)
}

/// A mesh of 99,458 triangles that rotates for an hour, at one of two positions.
pub fn turning() -> Model {
    const GRID: u32 = 223;
    let mut model = Builder::default();
    let indices = model.indices(&sheet_indices(GRID));
    let positions = model.floats(&sheet(GRID, 1), "VEC3", 3);
    model.mesh(positions, indices, "");
    model.node(0, [0.0; 3]);
    model.node(0, [1.5, 0.0, 0.0]);
    let times = model.floats(&[0.0, 3600.0], "SCALAR", 1);
    let turns = model.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.7, 0.0, 0.7], "VEC4", 4);
    model.animations = format!(
        r#"{{"channels":[{{"sampler":0,"target":{{"node":0,"path":"rotation"}}}}],"samplers":[{{"input":{times},"output":{turns}}}]}}"#
    );
    model.finish(2)
}

const HEAD: &str = "camera = { look_from = [0, 0, 20], look_at = [0, 0, 0] }\nenvironment = { background = [0.2, 0.2, 0.2] }\n";

/// `n` spheres, each with its own material; with `traits`, each sphere is excluded from some of that many lights.
pub fn materials(n: usize, traits: u32) -> String {
    let mut text = HEAD.to_string();
    for i in 0..n {
        let color = [97, 89, 83].map(|modulus| (i % modulus) as f64 / modulus as f64);
        let roughness = 0.1 + (i % 53) as f64 / 60.0;
        let _ = write!(
            text,
            "[materials.m{i}]\ntype = \"pbr\"\nbase_color = {color:?}\nroughness = {roughness}\n\
             [[objects]]\nname = \"o{i}\"\nsphere = {{ center = {}, radius = 0.05 }}\nmaterial = \"m{i}\"\n",
            cell(i, n)
        );
    }
    for bit in 0..traits {
        let lit: Vec<String> = (0..n).filter(|i| i >> bit & 1 == 1).map(|i| format!("\"o{i}\"")).collect();
        let _ = write!(
            text,
            "[[lights]]\npoint = {{ position = [{bit}, 3, 5], power = 90 }}\nlight_link = {{ include = [{}] }}\n",
            lit.join(", ")
        );
    }
    text
}

fn cell(i: usize, n: usize) -> String {
    let side = (n as f64).sqrt().ceil() as usize;
    let at = |cell: usize| 12.0 * (cell as f64 / side as f64 - 0.5);
    format!("[{}, {}, 0]", at(i % side), at(i / side))
}

/// `n` squares with a texture each, `pixels/I.bmp`.
pub fn textures(n: usize) -> String {
    let mut text = HEAD.to_string();
    for i in 0..n {
        let _ = write!(
            text,
            "[textures.t{i}]\ntype = \"image\"\nfile = \"t{i}.bmp\"\n[materials.m{i}]\ntype = \"lambert\"\ncolor = \"t{i}\"\n\
             [[objects]]\nquad = {{ corner = {}, u = [0.1, 0, 0], v = [0, 0.1, 0] }}\nmaterial = \"m{i}\"\n",
            cell(i, n)
        );
    }
    text
}

/// An uncompressed colour image of `n` by `n` texels.
pub fn bmp(n: u32, seed: u32) -> Vec<u8> {
    let row = (3 * n).next_multiple_of(4);
    let mut bytes = b"BM".to_vec();
    for word in [54 + row * n, 0, 54, 40, n, n, 24 << 16 | 1, 0, row * n, 2835, 2835, 0, 0] {
        bytes.extend(word.to_le_bytes());
    }
    for y in 0..n {
        let start = bytes.len();
        for x in 0..n {
            bytes.extend([(x >> 3).wrapping_add(seed * 40) as u8, (y >> 3) as u8, ((x + y) >> 4) as u8]);
        }
        bytes.resize(start + row as usize, 0);
    }
    bytes
}

/// `n` strands of eight points, as a `.curves` file and a scene that uses it.
pub fn strands(n: usize) -> (String, String) {
    let mut text = "curves 1\n".to_string();
    for i in 0..n {
        let [x, y] = in_square(i, n).map(|x| x / (n as f64).sqrt());
        for step in 0..8 {
            let t = f64::from(step);
            let _ = writeln!(text, "{} {} {}", x + 0.002 * t * t, y, 0.05 * t);
        }
        text.push('\n');
    }
    let scene = format!(
        "{HEAD}[materials]\nbrown = {{ type = \"hair\", melanin = 0.6 }}\n[[curves]]\nfile = \"strands.curves\"\nradius = 0.002\nmaterial = \"brown\"\n"
    );
    (scene, text)
}

/// An OBJ file of `n` objects of two triangles with a material each, and its material library.
pub fn obj(n: usize) -> (String, String) {
    let (mut obj, mut mtl) = ("mtllib growing.mtl\n".to_string(), String::new());
    for i in 0..n {
        let [x, y] = in_square(i, n);
        let _ = write!(obj, "o part{i}\nusemtl m{i}\n");
        for (dx, dy) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
            let _ = writeln!(obj, "v {} {} 0", x + f64::from(dx), y + f64::from(dy));
        }
        obj += "f -4 -3 -2\nf -4 -2 -1\n";
        let _ = writeln!(mtl, "newmtl m{i}\nKd {} 0.5 0.4", (i % 97) as f64 / 97.0);
    }
    (obj, mtl)
}
