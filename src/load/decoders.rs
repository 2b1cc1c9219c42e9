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
    /// Is it in this build?
    pub fn is_built_in(self) -> bool {
        match self {
            Decoder::Draco => cfg!(feature = "draco"),
            Decoder::Ktx2 => cfg!(feature = "ktx2"),
            Decoder::Tiff => cfg!(feature = "tiff"),
            Decoder::WebP => cfg!(feature = "webp"),
        }
    }

    /// What a build without it can't do.
    pub fn lack(self) -> String {
        let what = match self {
            Decoder::Draco => "Draco meshes",
            Decoder::Ktx2 => "Basis Universal textures",
            Decoder::Tiff => "TIFF images",
            Decoder::WebP => "WebP images",
        };
        format!("this build of oscura reads no {what}")
    }

    /// How to get it.
    pub fn remedy(self) -> String {
        let feature = match self {
            Decoder::Draco => "draco",
            Decoder::Ktx2 => "ktx2",
            Decoder::Tiff => "tiff",
            Decoder::WebP => "webp",
        };
        format!("build it with `--features {feature}`")
    }
}
