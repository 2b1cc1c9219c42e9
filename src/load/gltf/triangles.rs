//! The triangles of a primitive: lists, strips and fans, with or without indices.

use super::accessor::Accessor;
use super::report::{Report, Sound};
use crate::error::Problem;
use crate::simd::prefer_huge_pages;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::Mode;

/// What the triangles of a primitive are made of.
pub(super) struct Corners<'c, 'd> {
    /// How corners become triangles.
    pub mode: Mode,
    /// Which vertices they are; all in order without.
    pub indices: Option<&'c Accessor<'d>>,
    /// How many vertices there are.
    pub vertices: usize,
    /// May the largest index there is begin another strip or fan (KHR_mesh_primitive_restart)?
    pub may_restart: bool,
}

/// Appends a primitive's triangles to `triangles`, with `base` added to each index. Every index is below `base` plus
/// the number of vertices afterwards; nothing is appended if the file says otherwise.
pub(super) fn append(
    Corners { mode, indices, vertices, may_restart }: Corners,
    base: u32,
    at: &str,
    triangles: &mut Vec<[u32; 3]>,
    report: &mut Report,
) -> Sound<()> {
    let count = indices.map_or(vertices, |a| a.count);
    indices.map_or(Ok(()), |accessor| check_indices(accessor, report))?;
    let whole = match mode {
        Mode::Triangles => count.is_multiple_of(3),
        _ => count == 0 || count >= 3,
    };
    if !whole {
        report.warn(at, format!("{count} corners make no whole number of triangles; the rest is ignored"));
    }
    let first = triangles.len();
    if mode == Mode::Triangles {
        if first == 0 {
            // Fresh zeros come from the system without being written.
            *triangles = vec![[0; 3]; count / 3];
            prefer_huge_pages(triangles);
        } else {
            triangles.resize(first + count / 3, [0; 3]);
        }
        read(indices, bytemuck::cast_slice_mut(&mut triangles[first..]));
    } else {
        let mut corners = vec![0; count];
        read(indices, &mut corners);
        let restart = indices.filter(|_| may_restart).map(restart_index);
        let pieces = corners.split(|&corner| Some(corner) == restart);
        match mode {
            Mode::TriangleStrip => triangles.extend(pieces.flat_map(strip)),
            Mode::TriangleFan => triangles.extend(pieces.flat_map(fan)),
            _ => {}
        }
    }
    let added: &mut [u32] = bytemuck::cast_slice_mut(&mut triangles[first..]);
    let largest = added.iter().copied().max();
    if let Some(largest) = largest.filter(|&i| i as usize >= vertices) {
        let at = indices.map_or(at, |a| &a.pointer);
        let message = format!("holds the index {largest}, but there are {vertices} vertices");
        let is_restart = mode != Mode::Triangles && indices.is_some_and(|a| restart_index(a) == largest);
        let help = "where that index begins another strip or fan, the file must say so in \
                    extensionsUsed and extensionsRequired: KHR_mesh_primitive_restart";
        triangles.truncate(first);
        let problem = Problem::new(at, message);
        return Err(report.add(if is_restart { problem.with_help(help) } else { problem }));
    }
    if base > 0 {
        added.iter_mut().for_each(|i| *i += base);
    }
    Ok(())
}

/// The index that no vertex can have: the largest of its type.
fn restart_index(accessor: &Accessor) -> u32 {
    match accessor.component {
        ComponentType::U8 => u32::from(u8::MAX),
        ComponentType::U16 => u32::from(u16::MAX),
        _ => u32::MAX,
    }
}

fn check_indices(accessor: &Accessor, report: &mut Report) -> Sound<()> {
    let unsigned = matches!(accessor.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
    let fits = unsigned && accessor.kind == Type::Scalar && !accessor.normalized;
    if !fits {
        let message = format!("holds {}; indices are unsigned scalars, not normalised", accessor.contents());
        return Err(report.problem(accessor.pointer.clone(), message));
    }
    Ok(())
}

fn read(indices: Option<&Accessor>, out: &mut [u32]) {
    match indices {
        Some(accessor) => accessor.read_indices(out),
        None => out.iter_mut().zip(0..).for_each(|(out, i)| *out = i),
    }
}

/// The triangles of a strip (glTF 2.0, section 3.7.2.1); those with two equal corners only join pieces and are left out.
fn strip(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
    corners.windows(3).enumerate().map(turned).filter(|[a, b, c]| a != b && b != c && c != a)
}

/// The triangles of a fan about the first corner.
fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    let center = corners.first().copied().unwrap_or_default();
    corners.get(1..).unwrap_or_default().windows(2).map(move |w| [w[0], w[1], center])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_keep_their_winding() {
        let triangles: Vec<_> = strip(&[0, 1, 2, 3, 3, 4]).collect();
        assert_eq!(triangles, [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(strip(&[0, 1]).count(), 0);
    }

    #[test]
    fn fans_turn_about_the_first() {
        let triangles: Vec<_> = fan(&[5, 6, 7, 8]).collect();
        assert_eq!(triangles, [[6, 7, 5], [7, 8, 5]]);
        assert_eq!(fan(&[]).count(), 0);
    }
}
