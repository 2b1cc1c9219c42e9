//! 64-bit hashes of the inputs of compilation, to reuse results for equal inputs.

use super::material::CompiledMaterial;
use crate::math::{DAffine3, DVec3};
use crate::sampling::hash::mix64;
use crate::scene::{Curves, Mesh, Splats};
use bytemuck::Pod;
use rayon::prelude::*;

/// A running 64-bit hash; the collision probability of a pair is 2^-64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(u64);

/// Multiplier: odd, with half of its bits set.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// Size of the blocks that threads hash separately, bytes.
const BLOCK: usize = 1 << 20;

impl Fingerprint {
    /// The fingerprint of no data.
    pub const START: Fingerprint = Fingerprint(0x5851_f42d_4c95_7f2d);

    /// Appends a number.
    pub fn with(self, number: u64) -> Fingerprint {
        Fingerprint(mix64((self.0 ^ number).wrapping_mul(FACTOR).wrapping_add(number)))
    }

    /// The hash as a number.
    pub fn value(self) -> u64 {
        self.0
    }

    /// Appends another fingerprint.
    pub fn with_fingerprint(self, other: Fingerprint) -> Fingerprint {
        self.with(other.0)
    }

    /// Appends a list: its length and its bytes. Long lists are hashed in blocks on all threads, combined in order.
    pub fn with_all<T: Pod>(self, list: &[T]) -> Fingerprint {
        let bytes: &[u8] = bytemuck::cast_slice(list);
        if bytes.len() <= BLOCK {
            return self.with_block(bytes);
        }
        let blocks = bytes.par_chunks(BLOCK).map(|block| Fingerprint::START.with_block(block));
        blocks
            .collect::<Vec<_>>()
            .into_iter()
            .fold(self.with(bytes.len() as u64), Fingerprint::with_fingerprint)
    }

    fn with_block(self, bytes: &[u8]) -> Fingerprint {
        // Four independent lanes hide the latency of multiplications.
        let mut lanes = [1u64, 2, 3, 4];
        let mut blocks = bytes.chunks_exact(32);
        for block in &mut blocks {
            for (lane, word) in lanes.iter_mut().zip(block.chunks_exact(8)) {
                let word = u64::from_le_bytes(word.try_into().unwrap_or_default());
                *lane = (*lane ^ word).wrapping_mul(FACTOR).rotate_left(29);
            }
        }
        let combined = lanes.into_iter().fold(self.with(bytes.len() as u64), Fingerprint::with);
        blocks.remainder().iter().fold(combined, |sum, &byte| sum.with(u64::from(byte)))
    }

    /// Appends a point or vector.
    pub fn with_vector(self, v: DVec3) -> Fingerprint {
        v.to_array().into_iter().fold(self, |sum, x| sum.with(x.to_bits()))
    }

    /// Appends a transform.
    pub fn with_transform(self, transform: &DAffine3) -> Fingerprint {
        transform.to_cols_array().into_iter().fold(self, |sum, x| sum.with(x.to_bits()))
    }
}

/// The fingerprint of a mesh without its name.
pub fn of_mesh(mesh: &Mesh) -> Fingerprint {
    let lists = Fingerprint::START
        .with_all(&mesh.positions)
        .with_all(&mesh.triangles)
        .with_all(&mesh.normals)
        .with_all(&mesh.tangents)
        .with_all(&mesh.colors);
    let lists = mesh.attributes.iter().fold(lists, |sum, attribute| {
        sum.with_all(attribute.name.as_bytes()).with(attribute.width.into()).with_all(&attribute.values)
    });
    let lists = mesh.splats.iter().fold(lists, |sum, splats| {
        let Splats { scales, rotations, opacities, degree, coefficients, is_linear } = &**splats;
        let sum = sum.with_all(scales).with_all(rotations).with_all(opacities).with_all(coefficients);
        sum.with(u64::from(*degree)).with(u64::from(*is_linear))
    });
    let sets = mesh.uv_sets.iter().fold(lists, |sum, set| sum.with_all(set));
    mesh.parts.iter().fold(sets.with(mesh.uv_sets.len() as u64), |sum, part| {
        let numbers = [part.first_triangle, part.triangle_count, part.material.0];
        numbers.into_iter().fold(sum, |sum, n| sum.with(u64::from(n)))
    })
}

/// The fingerprint of curves without their name and traits.
pub fn of_curves(curves: &Curves) -> Fingerprint {
    Fingerprint::START
        .with(curves.basis as u64)
        .with_all(&curves.strands)
        .with_all(&curves.points)
        .with_all(&curves.radii)
        .with_all(&curves.colors)
        .with_transform(&curves.world_from_object)
        .with(u64::from(curves.material.0))
}

/// A hash of all material properties that affect geometry. `normal_sets`: UV set of each material's normal map.
pub(super) fn of_materials(materials: &[CompiledMaterial], normal_sets: &[Option<usize>]) -> Fingerprint {
    materials.iter().zip(normal_sets).fold(Fingerprint::START, |sum, (material, set)| {
        let flags = [
            material.is_invisible(),
            material.uses_normals(),
            material.uses_tangents(),
            material.uses_uv,
            material.uses_vertex_colors,
            material.reads_hit,
            material.emission.is_some(),
        ];
        let bits = flags.into_iter().fold(1u64, |bits, flag| bits << 1 | u64::from(flag));
        sum.with(bits).with(set.map_or(u64::MAX, |set| set as u64))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_and_list_length_changes_the_hash() {
        let list: Vec<u8> = (0..100).collect();
        let whole = Fingerprint::START.with_all(&list);
        for i in 0..list.len() {
            let mut other = list.clone();
            other[i] ^= 1;
            assert_ne!(Fingerprint::START.with_all(&other), whole, "{i}");
        }
        let split = |at: usize| Fingerprint::START.with_all(&list[..at]).with_all(&list[at..]);
        assert_ne!(split(32), split(64));
        assert_ne!(split(0), split(100));
    }

    /// The hash of long lists depends on all blocks and their order, but not on the number of threads.
    #[test]
    fn blocks_of_long_lists_are_combined_in_order() {
        let list: Vec<u32> = (0..BLOCK as u32).collect();
        let of = |list: &[u32]| Fingerprint::START.with_all(list);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        assert_eq!(pool.install(|| of(&list)), of(&list));
        for place in [0, BLOCK / 4, BLOCK / 2 + 7, BLOCK - 1] {
            let mut other = list.clone();
            other[place] ^= 1;
            assert_ne!(of(&other), of(&list), "{place}");
        }
        let mut swapped = list.clone();
        swapped.rotate_left(BLOCK / 4);
        assert_ne!(of(&swapped), of(&list));
    }

    #[test]
    fn meshes_differ_by_any_of_their_lists() {
        let mesh = Mesh { positions: vec![[0.0; 3]; 3], triangles: vec![[0, 1, 2]], ..Mesh::default() };
        let with_normals = Mesh { normals: vec![[0.0; 3]; 3], ..mesh.clone() };
        let with_uv = Mesh { uv_sets: vec![vec![[0.0; 2]; 3]], ..mesh.clone() };
        let all = [&mesh, &with_normals, &with_uv].map(of_mesh);
        assert!(all[0] != all[1] && all[1] != all[2] && all[0] != all[2]);
        assert_eq!(of_mesh(&Mesh { name: "other".into(), ..mesh.clone() }), all[0]);
    }
}
