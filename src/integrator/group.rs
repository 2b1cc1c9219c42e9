//! Which loops shade a vertex, and the order that sorts vertices by it.

use crate::bsdf::{Bsdf, BsdfClass};
use crate::compile::{CompiledMaterial, CompiledScene};
use std::ops::Range;

/// Which loops shade a vertex. The order is that of the sorted vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Group {
    /// Lambertian, of constant albedo, on a triangle or quad: a vectorised loop makes the vertex.
    Plain,
    /// Other Lambertian ones.
    Lambert,
    /// Opaque glTF materials, the same everywhere, on a triangle or quad: a vectorised loop makes the vertex.
    PlainMetalRough,
    /// Opaque glTF materials with textures on triangles: vectorised loops make the vertices.
    Textured,
    /// Other opaque glTF materials.
    MetalRough,
    /// Points of media that scatter.
    Medium,
    /// Others that light sampling may reach.
    Rough,
    /// It can't.
    Specular,
    /// The path ends here.
    None,
}

const GROUPS: usize = 9;

impl Group {
    /// The group of the same materials on shapes of other kinds.
    pub fn of_any_shape(self) -> Group {
        match self {
            Group::Plain => Group::Lambert,
            Group::PlainMetalRough => Group::MetalRough,
            group => group,
        }
    }
}

/// How many hits there are of each group.
pub struct GroupCounts([usize; GROUPS]);

impl GroupCounts {
    /// Of no hit.
    pub fn new() -> GroupCounts {
        GroupCounts([0; GROUPS])
    }

    /// Counts a hit.
    #[inline(always)]
    pub fn add(&mut self, group: Group) {
        self.0[group as usize] += 1;
    }

    /// Where the vertices of each group lie.
    pub fn sorted(&self) -> Sorted {
        let mut sum = 0;
        let starts = self.0.map(|count| {
            sum += count;
            sum - count
        });
        Sorted { starts }
    }
}

/// Where the sorted vertices of each group lie.
#[derive(Clone, Copy, Debug)]
pub struct Sorted {
    starts: [usize; GROUPS],
}

impl Sorted {
    /// The same with each vertex several times.
    pub fn times(mut self, times: usize) -> Sorted {
        for start in &mut self.starts {
            *start *= times;
        }
        self
    }

    /// The first place of each group.
    pub fn starts(&self) -> [usize; GROUPS] {
        self.starts
    }

    fn from(&self, first: Group, behind: Group) -> Range<usize> {
        self.starts[first as usize]..self.starts[behind as usize]
    }

    /// The first ones: a loop makes them of their corners alone.
    pub fn plain(&self) -> Range<usize> {
        self.from(Group::Plain, Group::Lambert)
    }

    /// Those and the other Lambertian ones.
    pub fn lambert(&self) -> Range<usize> {
        self.from(Group::Plain, Group::PlainMetalRough)
    }

    /// The next: loops make them of their corners alone, too.
    pub fn plain_metal_rough(&self) -> Range<usize> {
        self.from(Group::PlainMetalRough, Group::Textured)
    }

    /// The next.
    pub fn textured(&self) -> Range<usize> {
        self.from(Group::Textured, Group::MetalRough)
    }

    /// Those two and the other ones of opaque glTF materials.
    pub fn metal_rough(&self) -> Range<usize> {
        self.from(Group::PlainMetalRough, Group::Medium)
    }

    /// All that a guide may guide: these and the Lambertian ones.
    pub fn guided(&self) -> Range<usize> {
        self.from(Group::Plain, Group::Medium)
    }

    /// The points of media.
    pub fn medium(&self) -> Range<usize> {
        self.from(Group::Medium, Group::Rough)
    }

    /// All others that light sampling can reach.
    pub fn rough(&self) -> Range<usize> {
        self.from(Group::Rough, Group::Specular)
    }

    /// Those and the specular ones: all without a vectorised class.
    pub fn general(&self) -> Range<usize> {
        self.from(Group::Rough, Group::None)
    }

    /// All that light sampling can reach, Lambertian ones included.
    pub fn lit(&self) -> Range<usize> {
        self.from(Group::Plain, Group::Specular)
    }

    /// All.
    pub fn all(&self) -> Range<usize> {
        self.from(Group::Plain, Group::None)
    }
}

/// The groups of all materials of a scene.
pub fn groups_of(scene: &CompiledScene) -> Vec<Group> {
    let own = scene.materials.iter().map(|m| group_of(m, scene.shading.spectral));
    let mut groups: Vec<Group> = own.collect();
    let is_rough = |(group, m): (&Group, &CompiledMaterial)| *group == Group::Rough && m.medium_index != 0;
    if scene.features.touching && groups.iter().zip(&scene.materials).any(is_rough) {
        // Where a smooth solid touches a rough one, the surface that counts may be the other's.
        for (group, material) in groups.iter_mut().zip(&scene.materials) {
            if *group == Group::Specular && material.medium_index != 0 {
                *group = Group::Rough;
            }
        }
    }
    groups
}

/// The group of a material's vertices, on shapes that don't demand another.
fn group_of(material: &CompiledMaterial, by_wavelength: bool) -> Group {
    let is_plain = material.constant.is_some() && !material.uses_uv && material.emission.is_none();
    match material.class {
        BsdfClass::Black => Group::None,
        // Neighbouring pixels don't share what it reflects, as they do in the groups below.
        BsdfClass::Lambert | BsdfClass::MetalRough if material.depends_on_viewer => Group::Rough,
        BsdfClass::Lambert => {
            if is_plain {
                Group::Plain
            } else {
                Group::Lambert
            }
        }
        _ if material.is_smooth_glass() => Group::Specular,
        _ => {
            // What is smooth in air need not be within another solid.
            let stays_smooth = |b: Bsdf| material.medium_index == 0 || b.with_ior(2.0).is_specular();
            let is_specular = material.alike().is_some_and(|b| b.is_specular() && stays_smooth(b));
            match material.class {
                _ if is_specular => Group::Specular,
                BsdfClass::MetalRough if by_wavelength && material.constant.is_none() => Group::MetalRough,
                BsdfClass::MetalRough if material.uses_uv && !material.uses_vertex_colors => Group::Textured,
                BsdfClass::MetalRough if is_plain && material.medium_index == 0 => Group::PlainMetalRough,
                BsdfClass::MetalRough => Group::MetalRough,
                _ => Group::Rough,
            }
        }
    }
}
