//! Decoders that a build may lack: Cargo features named like them bring them in.

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decoder {
    /// Compressed meshes of glTF.
    Draco,
    /// Basis Universal textures in KTX2 files.
    Ktx2,
    Tiff,
    WebP,
}

impl Decoder {
    /// Is it in this build; its feature; what it reads.
    fn facts(self) -> (bool, &'static str, &'static str) {
        match self {
            Decoder::Draco => (cfg!(feature = "draco"), "draco", "Draco meshes"),
            Decoder::Ktx2 => (cfg!(feature = "ktx2"), "ktx2", "Basis Universal textures"),
            Decoder::Tiff => (cfg!(feature = "tiff"), "tiff", "TIFF images"),
            Decoder::WebP => (cfg!(feature = "webp"), "webp", "WebP images"),
        }
    }

    /// Is it in this build?
    pub fn is_built_in(self) -> bool {
        self.facts().0
    }

    /// What a build without it can't do.
    pub fn lack(self) -> String {
        format!("this build of oscura reads no {}", self.facts().2)
    }

    /// How to get it.
    pub fn remedy(self) -> String {
        format!("build it with `--features {}`", self.facts().1)
    }
}
