//! Typed indices into the lists of a scene.

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// The index as a `usize`.
            #[inline(always)]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

id!(
    /// Index into `Scene::meshes`.
    MeshId
);
id!(
    /// Index into `Scene::materials`.
    MaterialId
);
id!(
    /// Index into `Scene::textures`.
    TextureId
);
id!(
    /// Index into `Scene::images`.
    ImageId
);
id!(
    /// Index into `Scene::grids`.
    GridId
);
id!(
    /// Index into `Scene::profiles`.
    ProfileId
);
