//! The media of a scene by index: the exterior medium first, then those of materials. Warnings about overlapping media.

use super::box_tree::{Bounds, BoxTree, NumberedBox};
use super::density_grid::{CompiledEmissionGrid, DensityGrid};
use super::material::CompiledMaterial;
use super::medium::{Ball, Density, GridMedium, Medium, Scattering, ScatteringSpectra};
use super::objects::part_materials;
use crate::color::Rgb;
use crate::error::Warning;
use crate::light::VolumeLight;
use crate::math::{DAffine3, DVec3, Mat3, Vec3};
use crate::scene::{
    self, ColorSlot, Environment, FloatSlot, Fog, GridId, Instance, Keyframes, Material, MaterialId,
    MaterialUses, Model, Motion, Scene, Watertightness, instance_extents,
};
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Collects the exterior medium and the media of a scene's materials, and sets their indices in the materials.
///
/// Unused materials have no medium; neither have open surfaces of clear glass: a window modelled as a single sheet would fill
/// the room behind it with glass.
pub(super) fn collect(
    scene: &Scene,
    anchor: DVec3,
    materials: &mut [CompiledMaterial],
    is_spectral: bool,
    warnings: &mut Vec<Warning>,
) -> Vec<Medium> {
    warn_of_unbounded_fog(scene, warnings);
    warn_of_static_grids(scene, warnings);
    let grid = |grid| Arc::new(DensityGrid::new(grid, anchor));
    let grids: Vec<Arc<DensityGrid>> = scene.grids.iter().map(grid).collect();
    let (mut media, mut left_out) = (vec![exterior(scene.fog.as_ref(), anchor, is_spectral)], 0);
    let uses = OnceCell::new();
    for (id, material) in materials.iter_mut().enumerate() {
        let Some(mut medium) = material.medium.clone() else { continue };
        let uses = uses.get_or_init(|| MaterialUses::of(scene));
        let watertightness = uses.watertightness(MaterialId(id as u32));
        let is_kept = match watertightness {
            Watertightness::None => false,
            Watertightness::Open if medium.scattering.is_some() => {
                let name = &scene.materials[id].name;
                warnings.push(Warning::general(format!(
                    "the medium of material '{name}' has no effect: its meshes are open, and a medium needs a closed solid"
                )));
                false
            }
            Watertightness::Open => medium.absorption.is_some() || medium.is_dispersive(),
            Watertightness::Closed => true,
        };
        if !is_kept {
            continue;
        }
        match u16::try_from(media.len()) {
            Ok(index) => {
                material.medium_index = index;
                medium.priority = scene.materials[id].priority;
                medium.is_additive = medium.is_boundary && medium.has_effect();
                medium.keeps_overlapping_media &= medium.scattering.is_none();
                if let Some(scattering) = &mut medium.scattering {
                    if let Some(filling) = &scene.materials[id].medium {
                        scattering.density = density(filling, scene, &grids);
                    }
                    scattering.counts_as_bounces = material.is_boundary;
                }
                material.bounds_medium = material.is_boundary || material.alpha_leads_into(&medium);
                media.push(medium);
            }
            Err(_) => left_out += 1,
        }
        if watertightness == Watertightness::Closed {
            left_out += add_component_media(material, scene.materials[id].priority, &mut media);
        }
    }
    warn_of_excess(left_out, warnings);
    media
}

fn warn_of_excess(left_out: usize, warnings: &mut Vec<Warning>) {
    if left_out > 0 {
        warnings.push(Warning::general(format!(
            "{left_out} materials of solids exceed the maximum of {} media: their interiors have no effect",
            u16::MAX
        )));
    }
}

/// Marks media that are enclosed by surfaces which no shadow ray passes.
pub(super) fn mark_enclosed(scene: &Scene, materials: &[CompiledMaterial], media: &mut [Medium]) {
    if !media.iter().filter_map(|m| m.scattering.as_ref()).any(|s| !s.counts_as_bounces) {
        return;
    }
    let mut is_open = vec![false; media.len()];
    let mut open = |material: &CompiledMaterial| {
        let parts = material.components.iter().map(|part| &materials[part.index as usize]);
        parts.chain([material]).for_each(|m| is_open[usize::from(m.medium_index)] = true);
    };
    materials.iter().filter(|m| m.may_pass_through()).for_each(&mut open);
    // A mesh may have different materials where rays enter and leave.
    for instance in &scene.instances {
        let parts = || {
            part_materials(&scene.meshes[instance.mesh.index()], instance).map(|id| &materials[id.index()])
        };
        if parts().any(CompiledMaterial::may_pass_through) {
            parts().for_each(&mut open);
        }
    }
    if scene.quads.iter().any(|quad| materials[quad.material.index()].may_pass_through()) {
        scene.quads.iter().for_each(|quad| open(&materials[quad.material.index()]));
    }
    for (medium, is_open) in media.iter_mut().zip(is_open) {
        if let Some(scattering) = &mut medium.scattering {
            scattering.is_enclosed = !scattering.counts_as_bounces && !is_open;
        }
    }
}

/// Adds the media of a mix's components that differ from its own, such as subsurface scattering in clear glass. Returns the
/// number of media beyond the maximum.
fn add_component_media(mix: &mut CompiledMaterial, priority: i32, media: &mut Vec<Medium>) -> usize {
    let mut left_out = 0;
    for (component, mut medium) in mix.components_with_other_media() {
        match u16::try_from(media.len()) {
            Ok(index) => {
                component.medium_index = index;
                if let Some(scattering) = &mut medium.scattering {
                    scattering.counts_as_bounces = false;
                }
                media.push(Medium { priority, ..medium });
            }
            Err(_) => left_out += 1,
        }
    }
    left_out
}

/// Replacements of subsurface materials on open meshes, where all light would pass to the other side: a diffuse base with the
/// albedo of a semi-infinite slab.
pub(super) fn replace_open_subsurface(scene: &Scene, warnings: &mut Vec<Warning>) -> Vec<Option<Material>> {
    let uses = OnceCell::new();
    let watertightness =
        |id: usize| uses.get_or_init(|| MaterialUses::of(scene)).watertightness(MaterialId(id as u32));
    let mut replacement = |(id, material): (usize, &Material)| {
        let (medium, pbr) = (material.medium?, material.model.pbr()?);
        let through = pbr.diffuse_transmission.filter(|t| t.factor == FloatSlot::constant(1.0))?;
        let scatters = (0..3).any(|c| medium.extinction[c] * medium.albedo[c] > 0.0);
        let is_subsurface = pbr.has_volume && pbr.transmission.factor == 0.0 && scatters;
        if !is_subsurface || watertightness(id) != Watertightness::Open {
            return None;
        }
        let name = &material.name;
        let message = format!(
            "the subsurface scattering of material '{name}' needs a closed mesh: it is replaced by diffuse reflection of \
            its colour; close the mesh"
        );
        warnings.push(Warning::general(("subsurface-open", message)));
        let (color, slot) = (medium.color(), through.color);
        let mut model = pbr.clone();
        model.base_color = ColorSlot { factor: [0, 1, 2].map(|c| slot.factor[c] * color[c]), ..slot };
        (model.diffuse_transmission, model.has_volume) = (None, false);
        Some(Material { medium: None, model: Model::Pbr(Box::new(model)), ..material.clone() })
    };
    scene.materials.iter().enumerate().map(&mut replacement).collect()
}

/// Warns of distant lights that unbounded fog occludes.
fn warn_of_unbounded_fog(scene: &Scene, warnings: &mut Vec<Warning>) {
    let is_unbounded =
        |fog: &Fog| fog_density(fog, DVec3::ZERO).is_unbounded() && fog.medium.extinction != [0.0; 3];
    let has_far_light = scene.environment != Environment::Black
        || scene.lights.iter().any(|light| light.kind.position().is_none());
    if scene.fog.as_ref().is_some_and(is_unbounded) && has_far_light {
        warnings.push(Warning::general(
            "the fog is unbounded, so no light of the environment or of suns passes: set its radius",
        ));
    }
}

/// Warns of moving objects whose medium has a density grid, which is static.
fn warn_of_static_grids(scene: &Scene, warnings: &mut Vec<Warning>) {
    let is_on_grid = |id: MaterialId| {
        scene.materials.get(id.index()).and_then(|m| m.medium).is_some_and(|medium| medium.grid.is_some())
    };
    if !scene.materials.iter().any(|m| m.medium.is_some_and(|medium| medium.grid.is_some())) {
        return;
    }
    // Differences above rounding.
    let differ = |a: &DAffine3, b: &DAffine3| !a.abs_diff_eq(*b, 1e-9);
    let moves = |instance: &Instance| match instance.motion {
        Motion::Still => false,
        Motion::Moves | Motion::Deforms => true,
        Motion::Keyed(number) => {
            let placed = instance.world_from_object;
            scene
                .motion
                .instances
                .get(number as usize)
                .is_some_and(|keys| keys.all().any(|key| differ(key, &placed)))
        }
    };
    let displaced = |keys: Option<&Keyframes<DAffine3>>| {
        keys.is_some_and(|k| k.all().any(|key| differ(key, &DAffine3::IDENTITY)))
    };
    let instances = scene.instances.iter().filter(|instance| moves(instance)).flat_map(|instance| {
        let mesh = scene.meshes.get(instance.mesh.index());
        let materials = mesh.into_iter().flat_map(|mesh| part_materials(mesh, instance));
        materials.map(|id| (instance.name.as_str(), id))
    });
    let is_displaced = |moving: &BTreeMap<usize, Keyframes<DAffine3>>, i: usize| displaced(moving.get(&i));
    let quads = scene.quads.iter().enumerate().filter(|(i, _)| is_displaced(&scene.motion.quads, *i));
    let shapes = scene.shapes.iter().enumerate().filter(|(i, _)| is_displaced(&scene.motion.shapes, *i));
    let quads = quads.map(|(_, quad)| (quad.name.as_str(), quad.material));
    let shapes = shapes.map(|(_, shape)| (shape.name.as_str(), shape.material));
    let moving = instances.chain(quads).chain(shapes).filter(|&(_, id)| is_on_grid(id));
    for (object, id) in moving.collect::<BTreeSet<(&str, MaterialId)>>() {
        let material = &scene.materials[id.index()].name;
        warnings.push(Warning::general(format!(
            "object '{object}' moves, but the grid of its medium (material '{material}') is static"
        )));
    }
}

/// The density of the medium inside a solid.
fn density(medium: &scene::Medium, scene: &Scene, grids: &[Arc<DensityGrid>]) -> Density {
    let Some(grid) = medium.grid else { return Density::Homogeneous };
    let ready = |id: GridId| grids[id.index()].clone();
    let density = ready(grid);
    let channels = |grids: Option<[GridId; 3]>| grids.map(|grids| Arc::new(grids.map(ready)));
    let (extinction, scattering) = (channels(medium.extinction_grids), channels(medium.scattering_grids));
    let emission = Arc::new(match medium.emission_grid {
        Some(grid) => CompiledEmissionGrid::new(grid, &scene.grids, grids),
        None => CompiledEmissionGrid::of_density(&density),
    });
    Density::Grid(GridMedium { density, extinction, scattering, emission })
}

/// Emissive media as lights: those with grids, and homogeneous ones with a single object, by its bounding box. Only
/// index-matched media: shadow rays don't pass other interfaces.
pub(super) fn volume_lights(
    scene: &Scene,
    materials: &[CompiledMaterial],
    media: &[Medium],
    anchor: DVec3,
) -> Vec<VolumeLight> {
    let light = |(index, medium): (usize, &Medium)| {
        let scattering = medium.scattering.as_ref().filter(|s| s.emission.max_element() > 0.0)?;
        if !medium.is_boundary {
            return None;
        }
        let Some(grid) = scattering.grid() else {
            let is_of_medium = |m: &CompiledMaterial| usize::from(m.medium_index) == index;
            let body = only_body(scene, |id| materials.get(id.index()).is_some_and(is_of_medium))?;
            let edges = Mat3::from_diagonal((body.high - body.low).as_vec3());
            let corner = (body.low - anchor).as_vec3();
            return VolumeLight::new(
                index as u16,
                (corner, edges),
                [1; 3],
                &[scattering.emission.luminance()],
            );
        };
        let (size, emission) = grid.emission.cells(|factor| (scattering.emission * factor).luminance());
        VolumeLight::new(index as u16, grid.emission.parallelepiped(), size, &emission)
    };
    media.iter().enumerate().filter_map(light).collect()
}

/// Is the transmittance of fog to infinity 0 in all channels?
pub(super) fn is_opaque_to_far_light(fog: &Fog) -> bool {
    let is_dense = fog.medium.extinction.iter().all(|&extinction| extinction > 0.0);
    is_dense && fog_density(fog, DVec3::ZERO).is_unbounded()
}

/// The density of fog, relative to `anchor`.
fn fog_density(fog: &Fog, anchor: DVec3) -> Density {
    match fog.radius.is_finite() {
        true => Density::Ball(Ball { center: (fog.center - anchor).as_vec3(), radius: fog.radius as f32 }),
        false => Density::Homogeneous,
    }
}

/// The exterior medium, relative to `anchor`.
fn exterior(fog: Option<&Fog>, anchor: DVec3, is_spectral: bool) -> Medium {
    let Some(fog) = fog else { return Medium::AIR };
    let extinction = Rgb::from_array(fog.medium.extinction);
    let has_extinction = extinction.max_element() > 0.0;
    let scattering = Scattering {
        extinction,
        scattering_coefficient: extinction * Rgb::from_array(fog.medium.albedo),
        emission: Rgb::from_array(fog.medium.emission),
        anisotropy: fog.medium.anisotropy,
        density: fog_density(fog, anchor),
        counts_as_bounces: true,
        is_subsurface: false,
        is_enclosed: false,
        spectra: if is_spectral {
            ScatteringSpectra::of(&fog.medium, None, false).map(Arc::new)
        } else {
            None
        },
    };
    // Absorbing fog also needs `Scattering`, for its bounds.
    let scattering = (has_extinction || scattering.emission.max_element() > 0.0).then_some(scattering);
    Medium { is_additive: scattering.is_some(), scattering, ..Medium::AIR }
}

/// Maximum number of enclosing solids that a path keeps track of.
pub const OVERLAP_LIMIT: usize = 8;

/// Warns if more than [`OVERLAP_LIMIT`] index-matched media may overlap at a point.
pub(super) fn warn_of_overlaps(scene: &Scene, materials: &[CompiledMaterial], warnings: &mut Vec<Warning>) {
    let Some(place) = point_of_overlap(bodies(scene, materials), OVERLAP_LIMIT) else { return };
    warnings.push(Warning::general(format!(
        "more than {OVERLAP_LIMIT} media without a surface overlap, by their bounding boxes, as at ({:.4}, {:.4}, {:.4}): only the last \
        {OVERLAP_LIMIT} media entered have an effect there; make their objects smaller, or merge several",
        place.x, place.y, place.z
    )));
}

/// The bounding boxes of all index-matched media; empty if there are at most [`OVERLAP_LIMIT`].
fn bodies(scene: &Scene, materials: &[CompiledMaterial]) -> Vec<Bounds> {
    let is_body = |id: MaterialId| {
        materials.get(id.index()).is_some_and(|material| material.is_boundary && material.medium_index != 0)
    };
    let mut found = boxes_of_shapes(scene, is_body);
    let has_body = |&i: &usize| has_part(scene, &scene.instances[i], is_body);
    let placed: Vec<usize> = (0..scene.instances.len()).filter(has_body).collect();
    if found.len() + placed.len() > OVERLAP_LIMIT {
        let extents = instance_extents(scene);
        found.extend(placed.into_iter().filter_map(|i| extents[i].0).map(|(low, high)| Bounds { low, high }));
    }
    found
}

/// Has any part of an instance a material that satisfies `is_body`?
fn has_part(scene: &Scene, instance: &Instance, is_body: impl Fn(MaterialId) -> bool) -> bool {
    let mesh = scene.meshes.get(instance.mesh.index());
    mesh.is_some_and(|mesh| part_materials(mesh, instance).any(is_body))
}

/// The bounding box of the only object with a material that satisfies `is_body`; `None` if there are several.
fn only_body(scene: &Scene, is_body: impl Fn(MaterialId) -> bool) -> Option<Bounds> {
    let shapes = boxes_of_shapes(scene, &is_body);
    let mut placed = scene.instances.iter().filter(|instance| has_part(scene, instance, &is_body));
    match (&shapes[..], placed.next(), placed.next()) {
        ([body], None, _) => Some(*body),
        ([], Some(instance), None) => {
            let place = |&p: &[f32; 3]| instance.world_from_object.transform_point3(Vec3::from(p).as_dvec3());
            Some(Bounds::of(scene.meshes[instance.mesh.index()].positions.iter().map(place)))
        }
        _ => None,
    }
}

/// The bounding boxes of shapes, and of quads grouped by material, whose material satisfies `is_body`.
fn boxes_of_shapes(scene: &Scene, is_body: impl Fn(MaterialId) -> bool) -> Vec<Bounds> {
    let mut of_quads: BTreeMap<MaterialId, Bounds> = BTreeMap::new();
    for quad in scene.quads.iter().filter(|quad| is_body(quad.material)) {
        let bounds = of_quads.entry(quad.material).or_insert(Bounds::EMPTY);
        *bounds = bounds.union(Bounds::of(quad.corners()));
    }
    let shapes = scene.shapes.iter().filter(|shape| is_body(shape.material));
    let shapes = shapes.map(|s| Bounds { low: s.center - s.half_extent(), high: s.center + s.half_extent() });
    of_quads.into_values().chain(shapes).collect()
}

/// A point in more than `most` boxes. If any exists, there is one whose coordinates are those of minimum corners of boxes.
fn point_of_overlap(mut boxes: Vec<Bounds>, most: usize) -> Option<DVec3> {
    if boxes.len() <= most {
        return None;
    }
    boxes.sort_by(|a, b| a.low.x.total_cmp(&b.low.x));
    let numbered = |(number, &bounds): (usize, &Bounds)| NumberedBox { bounds, number: number as u32 };
    let mut numbered: Vec<NumberedBox> = boxes.iter().enumerate().map(numbered).collect();
    let tree = BoxTree::sort(&mut numbered);
    let contains = |b: &Bounds, axis: usize, at: f64| b.low[axis] <= at && at < b.high[axis];
    let overlaps_in_yz =
        |a: &Bounds, b: &Bounds| [1, 2].into_iter().all(|k| a.low[k] < b.high[k] && b.low[k] < a.high[k]);
    for own in &boxes {
        let x = own.low.x;
        let side = Bounds { high: DVec3::new(x, own.high.y, own.high.z), ..*own };
        let mut neighbours = Vec::new();
        tree.any(&side, |place| {
            let NumberedBox { bounds, number } = numbered[place];
            neighbours.extend((contains(&bounds, 0, x) && overlaps_in_yz(&bounds, own)).then_some(number));
            false
        });
        // In the order of the list, so that the reported point is deterministic.
        neighbours.sort_unstable();
        let neighbours: Vec<&Bounds> = neighbours.iter().map(|&number| &boxes[number as usize]).collect();
        if neighbours.len() <= most {
            continue;
        }
        for y in neighbours.iter().map(|b| b.low.y) {
            let row: Vec<&Bounds> = neighbours.iter().copied().filter(|b| contains(b, 1, y)).collect();
            if row.len() <= most {
                continue;
            }
            let exceeds = |&z: &f64| row.iter().filter(|b| contains(b, 2, z)).count() > most;
            if let Some(z) = row.iter().map(|b| b.low.z).find(exceeds) {
                return Some(DVec3::new(x, y, z));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube([x, y, z]: [f64; 3], size: f64) -> Bounds {
        Bounds { low: DVec3::new(x, y, z), high: DVec3::new(x, y, z) + size }
    }

    #[test]
    fn overlaps_are_found_at_one_point() {
        // A row of pairwise overlapping boxes, inside one large box.
        let row: Vec<Bounds> = (0..40).map(|k| cube([f64::from(k), 0.0, 0.0], 1.9)).collect();
        let around = [row.clone(), vec![cube([-1.0; 3], 50.0)]].concat();
        assert_eq!(point_of_overlap(row, 2), None);
        assert_eq!(point_of_overlap(around.clone(), 3), None);
        let place = point_of_overlap(around, 2).expect("three");
        assert!(place.x >= 1.0 && place.y == 0.0 && place.z == 0.0, "{place}");
        // Two bars that cross a third.
        let bars = vec![
            Bounds { low: DVec3::ZERO, high: DVec3::new(9.0, 1.0, 1.0) },
            Bounds { low: DVec3::ZERO, high: DVec3::new(1.0, 9.0, 1.0) },
            Bounds { low: DVec3::new(0.0, 2.0, 0.0), high: DVec3::new(9.0, 3.0, 1.0) },
        ];
        assert_eq!(point_of_overlap(bars, 2), None);
        let same = vec![cube([1.0, 2.0, 3.0], 4.0); 3];
        assert_eq!(point_of_overlap(same.clone(), 2), Some(DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!(point_of_overlap(same, 3), None);
    }
}
