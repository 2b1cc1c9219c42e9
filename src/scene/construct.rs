//! Methods of [`Scene`], and constructors for scenes built in code.

use super::{
    Camera, Environment, Grid, GridId, Image, ImageId, Instance, Light, LightKind, Material, MaterialId,
    Mesh, MeshId, MeshPart, Motion, Projection, Quad, Scene, Shape, ShapeKind, SpotFalloff, Texture,
    TextureId, group_or_default, looking_at,
};
use super::{LightLinks, LightProfile, ObjectInfo, ObjectTraits, ProfileId, RayKinds};
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use std::sync::Arc;

/// Defines methods that add to a list and return the index as id.
macro_rules! add {
    ($($(#[$doc:meta])* $name:ident: $type:ty => $list:ident, $id:ident;)*) => {
        impl Scene {$(
            $(#[$doc])*
            ///
            /// # Panics
            /// If there are 2^32 entries already.
            pub fn $name(&mut self, item: $type) -> $id {
                let id = u32::try_from(self.$list.len()).expect("fewer than 2^32 items");
                self.$list.push(item);
                $id(id)
            }
        )*}
    };
}

add! {
    /// Adds a mesh and returns its id, for an [`Instance`].
    add_mesh: Mesh => meshes, MeshId;
    /// Adds a material and returns its id, for meshes, shapes and quads.
    add_material: Material => materials, MaterialId;
    /// Adds a texture and returns its id, for materials. Textures that it refers to must be added first.
    add_texture: Texture => textures, TextureId;
    /// Adds an image and returns its id, for textures and the environment.
    add_image: Image => images, ImageId;
    /// Adds a grid and returns its id, for media.
    add_grid: Grid => grids, GridId;
    /// Adds a light profile (IES) and returns its id, for the directional distribution of emissive surfaces.
    add_profile: Arc<LightProfile> => profiles, ProfileId;
}

impl Mesh {
    /// A flat-shaded mesh of one material without texture coordinates; triangles are counter-clockwise from the front.
    pub fn new(
        name: impl Into<String>,
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        material: MaterialId,
    ) -> Mesh {
        let triangle_count = u32::try_from(triangles.len()).unwrap_or(u32::MAX);
        let parts = vec![MeshPart { first_triangle: 0, triangle_count, material }];
        Mesh { name: name.into(), positions, triangles, parts, ..Mesh::default() }
    }

    /// The positions of a triangle's vertices; the origin for missing vertices.
    // Not by `map` of arrays, which is often not inlined: this is called for all triangles of a scene.
    #[inline]
    pub(crate) fn corners(&self, [a, b, c]: [u32; 3]) -> [[f32; 3]; 3] {
        let position = |vertex: u32| self.positions.get(vertex as usize).copied().unwrap_or_default();
        [position(a), position(b), position(c)]
    }

    /// [`Mesh::corners`] in f64.
    #[inline]
    pub(crate) fn corners_f64(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        let [a, b, c] = self.corners(triangle);
        let wide = |[x, y, z]: [f32; 3]| DVec3::new(x.into(), y.into(), z.into());
        [wide(a), wide(b), wide(c)]
    }
}

impl Instance {
    /// An instance with the mesh's materials.
    pub fn new(mesh: MeshId, world_from_object: DAffine3) -> Instance {
        Instance {
            name: String::new(),
            mesh,
            world_from_object,
            material: None,
            motion: Motion::Still,
            traits: ObjectTraits::default(),
            info: ObjectInfo::default(),
            light_group: None,
        }
    }
}

impl Shape {
    /// A sphere.
    pub fn sphere(center: impl Into<DVec3>, radius: f64, material: MaterialId) -> Shape {
        let (name, kind, traits) = (String::new(), ShapeKind::Sphere, ObjectTraits::default());
        Shape {
            name,
            kind,
            center: center.into(),
            radius,
            rotation: DQuat::IDENTITY,
            material,
            traits,
            info: ObjectInfo::default(),
        }
    }

    /// A flat disk whose front faces `normal`, which need not be normalised.
    pub fn disk(
        center: impl Into<DVec3>,
        normal: impl Into<DVec3>,
        radius: f64,
        material: MaterialId,
    ) -> Shape {
        let rotation = DQuat::from_rotation_arc(DVec3::Z, normal.into().normalize_or(DVec3::Z));
        let (name, kind, traits) = (String::new(), ShapeKind::Disk, ObjectTraits::default());
        Shape {
            name,
            kind,
            center: center.into(),
            radius,
            rotation,
            material,
            traits,
            info: ObjectInfo::default(),
        }
    }
}

impl Quad {
    /// A parallelogram; its front is on the side of `edge_u x edge_v`.
    pub fn new(
        corner: impl Into<DVec3>,
        edge_u: impl Into<DVec3>,
        edge_v: impl Into<DVec3>,
        material: MaterialId,
    ) -> Quad {
        let (corner, edge_u, edge_v) = (corner.into(), edge_u.into(), edge_v.into());
        let (traits, info) = (ObjectTraits::default(), ObjectInfo::default());
        Quad { name: String::new(), corner, edge_u, edge_v, material, traits, info }
    }

    /// The corners, metres: `corner`, the ends of both edges, the opposite one.
    pub fn corners(&self) -> [DVec3; 4] {
        let Quad { corner, edge_u, edge_v, .. } = self;
        [*corner, corner + edge_u, corner + edge_v, corner + edge_u + edge_v]
    }
}

impl Light {
    /// A light visible to all rays, without a name, in the default group. For the unit of `intensity` see [`Light::intensity`].
    pub fn new(kind: LightKind, intensity: [f32; 3]) -> Light {
        let (name, group) = (String::new(), String::new());
        Light {
            name,
            kind,
            intensity,
            profile: None,
            group,
            visible_to: RayKinds::ALL,
            links: LightLinks::ALL,
            motion: None,
        }
    }

    /// An isotropic point light with a radiant intensity, W/sr.
    pub fn point(position: impl Into<DVec3>, intensity: [f32; 3]) -> Light {
        Light::new(LightKind::Point { position: position.into() }, intensity)
    }

    /// A spot light with a radiant intensity, W/sr, within `inner_angle_rad` of its axis, that falls off to 0 at
    /// `outer_angle_rad`; both are half angles, radians. The direction need not be normalised.
    pub fn spot(
        position: impl Into<DVec3>,
        direction: impl Into<DVec3>,
        [inner_angle_rad, outer_angle_rad]: [f64; 2],
        intensity: [f32; 3],
    ) -> Light {
        let direction = direction.into().normalize_or(DVec3::NEG_Z);
        let (position, falloff) = (position.into(), SpotFalloff::Square);
        let kind = LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, falloff };
        Light::new(kind, intensity)
    }

    /// Parallel light that travels along `direction` (need not be normalised), with an irradiance, W/m2, on surfaces facing it.
    pub fn directional(direction: impl Into<DVec3>, irradiance: [f32; 3]) -> Light {
        let direction = direction.into().normalize_or(DVec3::NEG_Z);
        Light::new(LightKind::Directional { direction }, irradiance)
    }
}

impl Camera {
    /// An unnamed camera at rest with square pixels, without lens, shift and clip distances.
    pub fn new(world_from_camera: DAffine3, projection: Projection) -> Camera {
        Camera {
            name: String::new(),
            world_from_camera,
            projection,
            aspect_ratio: None,
            pixel_aspect: 1.0,
            lens: None,
            shift: [0.0; 2],
            clip: None,
            motion: None,
        }
    }

    /// A pinhole camera at `from` that looks at a point with y up; `vfov_deg` is the vertical field of view, degrees.
    pub fn look_at(from: impl Into<DVec3>, at: impl Into<DVec3>, vfov_deg: f64) -> Camera {
        let (from, at) = (from.into(), at.into());
        let world_from_camera = looking_at(from, at, DVec3::Y).unwrap_or_else(|| {
            // Looking straight down, -z is up in the picture; straight up, z is.
            let back = (from - at).normalize_or(DVec3::Z);
            let rotation = DMat3::from_cols(DVec3::X, back.cross(DVec3::X), back);
            DAffine3::from_mat3_translation(rotation, from)
        });
        Camera::new(world_from_camera, Projection::Perspective { vfov_rad: vfov_deg.to_radians() })
    }
}

impl Scene {
    /// Sets the traits of all existing objects with a name.
    pub fn set_object_traits(&mut self, name: &str, traits: ObjectTraits) {
        let named = self.object_traits_mut().filter(|(other, _)| *other == name);
        named.for_each(|(_, own)| *own = traits);
    }

    /// The names and mutable traits of all objects.
    pub fn object_traits_mut(&mut self) -> impl Iterator<Item = (&str, &mut ObjectTraits)> {
        let instances = self.instances.iter_mut().map(|i| (i.name.as_str(), &mut i.traits));
        let quads = self.quads.iter_mut().map(|q| (q.name.as_str(), &mut q.traits));
        let shapes = self.shapes.iter_mut().map(|s| (s.name.as_str(), &mut s.traits));
        let curves = self.curves.iter_mut().map(|c| (c.name.as_str(), &mut c.traits));
        instances.chain(quads).chain(shapes).chain(curves)
    }

    /// The names and traits of all instances, quads, shapes and curves.
    fn named_traits(&self) -> impl Iterator<Item = (&str, &ObjectTraits)> {
        let instances = self.instances.iter().map(|i| (i.name.as_str(), &i.traits));
        let quads = self.quads.iter().map(|q| (q.name.as_str(), &q.traits));
        let shapes = self.shapes.iter().map(|s| (s.name.as_str(), &s.traits));
        let curves = self.curves.iter().map(|c| (c.name.as_str(), &c.traits));
        instances.chain(quads).chain(shapes).chain(curves)
    }

    /// The names of all objects.
    pub fn object_names(&self) -> impl Iterator<Item = &str> {
        self.named_traits().map(|(name, _)| name)
    }

    /// The traits of all instances, quads, shapes and curves.
    pub fn object_traits(&self) -> impl Iterator<Item = &ObjectTraits> {
        self.named_traits().map(|(_, traits)| traits)
    }

    /// Whether there are shadow catchers.
    pub fn has_catchers(&self) -> bool {
        self.object_traits().any(|traits| traits.is_shadow_catcher)
    }

    /// The names of all light groups in use, sorted. Each light is in exactly one.
    pub fn light_groups(&self) -> Vec<String> {
        let emitters = self.materials.iter().filter(|m| m.emission.is_some()).map(|m| &m.light_group);
        let environment = (self.environment != Environment::Black).then_some(&self.environment_group);
        let all = emitters
            .chain(self.instances.iter().filter_map(|instance| instance.light_group.as_ref()))
            .chain(self.lights.iter().map(|l| &l.group))
            .chain(environment);
        let mut names: Vec<String> = all.map(|name| group_or_default(name).to_string()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Sets the rotation of the environment image, radians. Rotates with it the environment that camera rays see, and the
    /// environment's sun. Does nothing for other environments.
    pub fn set_environment_rotation(&mut self, to_rad: f64) {
        let Environment::Image { rotation_rad, .. } = &mut self.environment else { return };
        let by = DQuat::from_rotation_y(to_rad - *rotation_rad);
        if let Some(Environment::Image { rotation_rad: seen, .. }) = &mut self.camera_environment {
            *seen += to_rad - *rotation_rad;
        }
        *rotation_rad = to_rad;
        let sun = self.environment_sun.and_then(|sun| self.lights.get_mut(sun as usize));
        if let Some(LightKind::Sun { direction, .. }) = sun.map(|sun| &mut sun.kind) {
            *direction = by * *direction;
        }
    }

    /// Scales the intensity of the environment's sun, if any.
    pub fn scale_environment_sun(&mut self, factor: f32) {
        let sun = self.environment_sun.and_then(|sun| self.lights.get_mut(sun as usize));
        if let Some(sun) = sun {
            sun.intensity = sun.intensity.map(|v| v * factor);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn traits_are_set_on_all_objects_with_a_name() {
        let mut scene = Scene::default();
        for name in ["a", "b", "a"] {
            let sphere = Shape::sphere(DVec3::ZERO, 1.0, MaterialId(0));
            scene.shapes.push(Shape { name: name.into(), ..sphere });
        }
        scene
            .quads
            .push(Quad { name: "a".into(), ..Quad::new(DVec3::ZERO, DVec3::X, DVec3::Y, MaterialId(0)) });
        let traits = ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() };
        scene.set_object_traits("a", traits);
        let usual = ObjectTraits::default();
        assert!(scene.object_traits().copied().eq([traits, traits, usual, traits]) && scene.has_catchers());
        scene.quads[0].traits = usual;
        assert!(scene.object_traits().copied().eq([usual, traits, usual, traits]));
        scene.set_object_traits("a", usual);
        assert!(!scene.has_catchers());
    }
}
