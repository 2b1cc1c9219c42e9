//! Media with procedural textures as coefficients: baked to voxel grids over the bounding boxes of the solids at load time,
//! so that all later stages handle grids only.

use super::Loaded;
use crate::error::{Error, Warning};
use crate::math::{DAffine3, DMat4, DVec3, Vec3};
use crate::scene::{
    EmissionGrid, Grid, Instance, Material, MaterialId, Medium, MediumTextures, Mesh, Model, Scene,
    TextureId, instance_extents,
};
use crate::texture::{
    CameraData, CompiledTextures, HitAttributes, HitData, ObjectData, PathData, PointReader, TexturePoint,
};
use rayon::prelude::*;
use std::sync::Arc;

/// Default maximum number of voxels of a grid.
const DEFAULT_MAX_VOXELS: f64 = (1u64 << 21) as f64;
/// Default maximum number of voxels along the longest edge of a grid.
const MAX_RESOLUTION: u32 = 512;

/// Maximum number of voxels of all grids of a material; limits their resolution.
const MAX_VOXELS: f64 = (1u64 << 26) as f64;

/// Replaces the textures of all media by grids.
///
/// # Errors
/// If an image of such a texture is damaged.
pub(super) fn apply(loaded: &mut Loaded) -> Result<(), Error> {
    for id in (0..loaded.scene.materials.len() as u32).map(MaterialId) {
        let Some(medium) = loaded.scene.materials[id.index()].medium else { continue };
        if !medium.textures.is_empty() {
            evaluate(loaded, id, medium)?;
        }
    }
    let Loaded { scene, warnings, .. } = loaded;
    scene.materials.iter_mut().for_each(|material| remove_from_mixes(material, warnings));
    Ok(())
}

/// Removes the media's textures in components of mixes, with a warning: these media become homogeneous.
fn remove_from_mixes(material: &mut Material, warnings: &mut Vec<Warning>) {
    let Model::Mix { components } = &mut material.model else { return };
    for part in components.iter_mut().map(|component| &mut component.material) {
        let Some(medium) = part.medium.as_mut().filter(|medium| !medium.textures.is_empty()) else {
            continue;
        };
        medium.textures = MediumTextures::default();
        let message = format!("material '{}': textures of its medium are left out in a mix", part.name);
        warnings.push(Warning::general(("medium-texture-in-mix", message)));
    }
}

/// Bakes the medium's textures for each solid with the material. Solids after the first get copies of the material.
fn evaluate(loaded: &mut Loaded, id: MaterialId, medium: Medium) -> Result<(), Error> {
    let textures = medium.textures;
    let solids = Solid::all(&loaded.scene, id);
    if solids.is_empty() {
        loaded.scene.materials[id.index()].medium =
            Some(Medium { textures: MediumTextures::default(), ..medium });
        return Ok(());
    }
    let used = [textures.density, textures.color, textures.emission].into_iter().flatten();
    let (compiled, report) =
        CompiledTextures::of_subset(&loaded.scene.textures, &loaded.scene.images, &used.collect::<Vec<_>>())?;
    loaded.warnings.extend(report.warnings);
    let max_voxels = MAX_VOXELS / solids.len() as f64;
    let (resolution, max_voxels) = match textures.resolution {
        0 => (MAX_RESOLUTION, DEFAULT_MAX_VOXELS.min(max_voxels)),
        resolution => (resolution, max_voxels),
    };
    let camera_from_world = loaded
        .scene
        .cameras
        .first()
        .map_or(DMat4::IDENTITY, |camera| DMat4::from(camera.world_from_camera.inverse()));
    let mut is_clamped = false;
    for (number, solid) in solids.iter().enumerate() {
        let voxels = Voxels::of(solid, resolution, max_voxels);
        let at = |texture| voxels.values(solid, (&compiled, texture), &camera_from_world);
        let baked = BakedTextures {
            density: textures.density.map(at),
            color: textures.color.map(at),
            emission: textures.emission.map(at),
        };
        let own = &loaded.scene.materials[id.index()];
        let (name, own) = (own.name.clone(), own.clone());
        let (baked, was_clamped) = baked.medium(&mut loaded.scene, medium, &voxels, &name);
        is_clamped |= was_clamped;
        let baked = Material { medium: Some(baked), ..own };
        if number == 0 {
            loaded.scene.materials[id.index()] = baked;
        } else {
            let copy = loaded.scene.add_material(baked);
            solid.set_material(&mut loaded.scene, copy);
        }
    }
    if is_clamped {
        let name = &loaded.scene.materials[id.index()].name;
        let message = format!("material '{name}': the density of its medium is clamped where it is too high");
        loaded.warnings.push(Warning::general(("medium-too-dense", message)));
    }
    Ok(())
}

/// A solid with a procedural medium.
struct Solid {
    object: SolidObject,
    data: ObjectData,
    world_from_box: DAffine3,
    /// Corners of the bounding box, in box space.
    low: DVec3,
    high: DVec3,
}

#[derive(Clone, Copy)]
enum SolidObject {
    Instance(usize),
    Shape(usize),
    /// Several objects with one shared grid, since they can't have materials of their own.
    Several,
}

impl Solid {
    /// The solids of a material: one for each instance and shape that can have its own material, and one for all others.
    fn all(scene: &Scene, id: MaterialId) -> Vec<Solid> {
        let has = |instance: &Instance, mesh: &Mesh| {
            instance.material.map_or_else(|| mesh.parts.iter().any(|p| p.material == id), |own| own == id)
        };
        let is_single = |instance: &Instance, mesh: &Mesh| {
            instance.material.is_some() || mesh.parts.iter().all(|part| part.material == id)
        };
        let mut solids = Vec::new();
        let mut others: Option<Solid> = None;
        let extents = instance_extents(scene);
        for (index, instance) in scene.instances.iter().enumerate() {
            let Some(mesh) = scene.meshes.get(instance.mesh.index()).filter(|mesh| has(instance, mesh))
            else {
                continue;
            };
            let [low, high] = ObjectData::bounds_of_mesh(mesh);
            let data = ObjectData::of_instance(instance, [low, high], DVec3::ZERO);
            if is_single(instance, mesh) {
                let world_from_box = instance.world_from_object;
                let (low, high) = (low.as_dvec3(), high.as_dvec3());
                solids.push(Solid { object: SolidObject::Instance(index), data, world_from_box, low, high });
            } else if let Some(extent) = extents[index].0 {
                add_to_shared(&mut others, data, extent);
            }
        }
        for quad in scene.quads.iter().filter(|quad| quad.material == id) {
            let corners = quad.corners();
            let extent =
                corners.iter().fold((corners[0], corners[0]), |(low, high), &c| (low.min(c), high.max(c)));
            add_to_shared(&mut others, ObjectData::of_quad(quad, DVec3::ZERO), extent);
        }
        for (index, shape) in scene.shapes.iter().enumerate().filter(|(_, shape)| shape.material == id) {
            let (low, high) = (shape.center - shape.half_extent(), shape.center + shape.half_extent());
            let data = ObjectData::of_shape(shape, DVec3::ZERO);
            solids.push(Solid {
                object: SolidObject::Shape(index),
                data,
                world_from_box: DAffine3::IDENTITY,
                low,
                high,
            });
        }
        // The others keep the material itself.
        others.into_iter().chain(solids).collect()
    }

    /// Assigns a material to the object.
    fn set_material(&self, scene: &mut Scene, material: MaterialId) {
        match self.object {
            SolidObject::Instance(index) => scene.instances[index].material = Some(material),
            SolidObject::Shape(index) => scene.shapes[index].material = material,
            SolidObject::Several => {}
        }
    }
}

/// Adds an object to the solid with a shared grid, which is axis-aligned in world space.
fn add_to_shared(others: &mut Option<Solid>, data: ObjectData, (low, high): (DVec3, DVec3)) {
    let (world_from_object, object_from_world) = (DAffine3::IDENTITY, DAffine3::IDENTITY);
    let data = ObjectData { world_from_object, object_from_world, location: Vec3::ZERO, ..data };
    let (object, world_from_box) = (SolidObject::Several, DAffine3::IDENTITY);
    let all = others.get_or_insert(Solid { object, data, world_from_box, low, high });
    (all.low, all.high) = (all.low.min(low), all.high.max(high));
    all.data.generated = ObjectData::generated(all.low.as_vec3(), all.high.as_vec3());
}

/// The voxels of a box, padded by one on each side, so that points on its faces are interpolated.
struct Voxels {
    size: [u32; 3],
    world_from_voxels: DAffine3,
}

impl Voxels {
    /// `resolution` voxels along the longest edge, but at most `max_voxels` in total.
    fn of(solid: &Solid, resolution: u32, max_voxels: f64) -> Voxels {
        let longest = (solid.high - solid.low).max_element();
        let extent = (solid.high - solid.low).max(DVec3::splat(1e-6 * longest));
        let columns = solid.world_from_box.matrix3;
        let metres = DVec3::new(columns.x_axis.length(), columns.y_axis.length(), columns.z_axis.length());
        let along = extent * metres;
        let share = along / along.max_element().max(f64::MIN_POSITIVE);
        let counts_for = |n: f64| (share * n - 1e-3).ceil().max(DVec3::ONE);
        let mut counts = counts_for(resolution.into());
        while counts.element_product() > max_voxels && counts.max_element() > 1.0 {
            counts = counts_for((0.97 * counts.max_element()).floor());
        }
        let step = (extent / counts).max(DVec3::splat(1e-12));
        let box_from_voxels = DAffine3::from_translation(solid.low - step) * DAffine3::from_scale(step);
        let size = [counts.x, counts.y, counts.z].map(|n| n as u32 + 2);
        Voxels { size, world_from_voxels: solid.world_from_box * box_from_voxels }
    }

    /// Texture values at the voxel centres, x fastest; negative and non-finite values become 0.
    fn values(
        &self,
        solid: &Solid,
        (textures, texture): (&CompiledTextures, TextureId),
        camera_from_world: &DMat4,
    ) -> Vec<[f32; 3]> {
        let [nx, ny, nz] = self.size.map(|n| n as usize);
        let mut values = vec![[0.0; 3]; nx * ny * nz];
        values.par_chunks_exact_mut(nx).enumerate().for_each(|(row, values)| {
            for (x, value) in values.iter_mut().enumerate() {
                let voxel = DVec3::new(x as f64, (row % ny) as f64, (row / ny) as f64) + 0.5;
                let world = self.world_from_voxels.transform_point3(voxel);
                let [r, g, b, _] = color(solid, (textures, texture), camera_from_world, world);
                *value = [r, g, b].map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
            }
        });
        values
    }

    fn grid(&self, name: &str, values: impl Iterator<Item = f32>) -> Grid {
        let world_from_voxels = self.world_from_voxels;
        Grid {
            name: name.to_string(),
            size: self.size,
            values: Arc::new(values.collect()),
            world_from_voxels,
        }
    }

    /// A uniform grid: one voxel of value 1 that covers the box.
    fn uniform_grid(&self, name: &str) -> Grid {
        let size = DVec3::from_array(self.size.map(f64::from));
        let world_from_voxels = self.world_from_voxels * DAffine3::from_scale(size);
        Grid { name: name.to_string(), size: [1; 3], values: Arc::new(vec![1.0]), world_from_voxels }
    }
}

/// Evaluates a texture at a world-space point of a solid: linear RGBA.
fn color(
    solid: &Solid,
    (textures, texture): (&CompiledTextures, TextureId),
    camera_from_world: &DMat4,
    world: DVec3,
) -> [f32; 4] {
    let p = world.as_vec3();
    let point = TexturePoint { world: p, normal: Vec3::Y, cosine: 1.0, ..TexturePoint::default() };
    let hit = HitData {
        attributes: HitAttributes::default(),
        object: &solid.data,
        camera: CameraData { camera_from_world, ndc_from_world: None },
        object_point: solid.data.object_from_world.transform_point3(world).as_vec3(),
        shading_normal: Vec3::Y,
        true_normal: Vec3::Y,
        incoming: Vec3::Y,
        is_back: false,
        parametric: [0.0; 2],
        corners: None,
        corner_uv: None,
        point: p,
        tangent_frame: None,
        material_index: 0.0,
        path: PathData::default(),
        strand: None,
        rays: None,
    };
    PointReader::new(textures, point).with_hit(Some(&hit)).eval(texture)
}

/// Baked textures of a medium, linear RGB per voxel; `None` for coefficients without a texture.
struct BakedTextures {
    density: Option<Vec<[f32; 3]>>,
    color: Option<Vec<[f32; 3]>>,
    emission: Option<Vec<[f32; 3]>>,
}

impl BakedTextures {
    /// The medium with grids instead of textures, and whether densities were clamped.
    fn medium(self, scene: &mut Scene, medium: Medium, voxels: &Voxels, name: &str) -> (Medium, bool) {
        let mut baked = Medium { textures: MediumTextures::default(), ..medium };
        let rgb_density = match (self.density, &self.color) {
            (Some(values), _) => values,
            (None, Some(color)) => vec![[1.0; 3]; color.len()],
            (None, None) => Vec::new(),
        };
        let (mut density, tint) = factor_tint(&rgb_density);
        baked.extinction = [0, 1, 2].map(|c| medium.extinction[c] * tint.map_or(1.0, |tint| tint[c]));
        let max_extinction = baked.extinction.into_iter().fold(0.0, f32::max);
        // Slightly below the maximum that validation allows.
        let mean_free_paths = voxels.uniform_grid(name).longest_diagonal() * f64::from(max_extinction);
        let max_density = (0.9 * Grid::MAX_MEAN_FREE_PATHS / mean_free_paths) as f32;
        let is_clamped = density.iter().any(|&d| d > max_density);
        density.iter_mut().for_each(|d| *d = d.min(max_density));
        let density = &density;
        let mut add = |channel: &dyn Fn(usize, usize) -> f32| {
            [0, 1, 2].map(|c| {
                let values = (0..density.len()).map(|i| channel(i, c).min(density[i]));
                scene.add_grid(voxels.grid(name, values))
            })
        };
        if tint.is_none() {
            baked.extinction_grids = Some(add(&|i, c| rgb_density[i][c]));
        }
        if let Some(color) = &self.color {
            let extinction = |i: usize, c: usize| if tint.is_none() { rgb_density[i][c] } else { density[i] };
            baked.scattering_grids = Some(add(&|i, c| extinction(i, c) * color[i][c].min(1.0)));
        }
        let is_uniform = density.is_empty();
        let grid =
            if is_uniform { voxels.uniform_grid(name) } else { voxels.grid(name, density.iter().copied()) };
        baked.grid = Some(scene.add_grid(grid));
        if medium.emission != [0.0; 3] {
            let (grids, tint) = emission_grids(self.emission, scene, voxels, name);
            baked.emission = [0, 1, 2].map(|c| medium.emission[c] * tint[c]);
            baked.emission_grid = Some(grids);
        }
        (baked, is_clamped)
    }
}

/// The grids of the emission, and a factor per channel.
fn emission_grids(
    values: Option<Vec<[f32; 3]>>,
    scene: &mut Scene,
    voxels: &Voxels,
    name: &str,
) -> (EmissionGrid, [f32; 3]) {
    let Some(values) = values else {
        return (EmissionGrid::Factors(scene.add_grid(voxels.uniform_grid(name))), [1.0; 3]);
    };
    let mut add = |values: Vec<f32>| scene.add_grid(voxels.grid(name, values.into_iter()));
    match factor_tint(&values) {
        (factors, Some(tint)) => (EmissionGrid::Factors(add(factors)), tint),
        (_, None) => {
            let channel = |c: usize| values.iter().map(|value| value[c]).collect();
            (EmissionGrid::Channels([channel(0), channel(1), channel(2)].map(&mut add)), [1.0; 3])
        }
    }
}

/// Factors colours into scalars and one tint with largest channel 1. If hues differ, there is no tint, and the scalars are
/// the largest channels.
fn factor_tint(values: &[[f32; 3]]) -> (Vec<f32>, Option<[f32; 3]>) {
    const CLOSE: f32 = 1e-3;
    let sums = values.iter().fold([0.0f64; 3], |sums, v| [0, 1, 2].map(|c| sums[c] + f64::from(v[c])));
    let brightest = (0..3).max_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0);
    if sums[brightest] <= 0.0 {
        return (vec![0.0; values.len()], Some([1.0; 3]));
    }
    let tint = sums.map(|sum| (sum / sums[brightest]) as f32);
    let follows =
        |v: &[f32; 3]| (0..3).all(|c| (v[c] - tint[c] * v[brightest]).abs() <= CLOSE * v[brightest]);
    match values.iter().all(follows) {
        true => (values.iter().map(|v| v[brightest]).collect(), Some(tint)),
        false => (values.iter().map(|[r, g, b]| r.max(*g).max(*b)).collect(), None),
    }
}
