//! What a file holds by its first bytes, where it can't be read in its place: for messages that name it and say
//! what to do.

/// A kind of content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Content {
    /// What it is, after "is".
    pub what: &'static str,
    /// What to do.
    pub remedy: &'static str,
}

const CONVERT: &str = "convert it to PNG";
const UNPACK: &str = "unpack it first";
const FETCH: &str = "fetch the file itself: git lfs pull";
const DOWNLOAD: &str = "download the file itself: the server sent a page about it, or an error";

/// Beginnings of files.
const SIGNATURES: &[(&[u8], &str, &str)] = &[
    (b"version https://git-lfs.github.com/", "a pointer of Git LFS that stands for the file", FETCH),
    (b"PK\x03\x04", "a ZIP archive", UNPACK),
    (b"\x1f\x8b", "compressed by gzip", UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (b"Rar!\x1a\x07", "a RAR archive", UNPACK),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", UNPACK),
    (b"\xfd7zXZ\0", "compressed by xz", UNPACK),
    (b"BZh", "compressed by bzip2", UNPACK),
    (b"%PDF-", "a PDF document", CONVERT),
    (b"DDS ", "a DDS image", CONVERT),
    (b"8BPS", "a Photoshop document", CONVERT),
    (b"gimp xcf", "a GIMP document", CONVERT),
    (b"\0\0\0\x0cjP  ", "a JPEG 2000 image", CONVERT),
    (b"\xff\x4f\xff\x51", "a JPEG 2000 image", CONVERT),
    (b"\0\0\0\x0cJXL ", "a JPEG XL image", CONVERT),
    (b"\xff\x0a", "a JPEG XL image", CONVERT),
    (b"\xabKTX 11\xbb", "a KTX image of version 1", "convert it to KTX2 or PNG"),
    (b"sB\x13\0", "a Basis Universal image without its KTX2 file", "convert it to KTX2 or PNG"),
    (b"Kaydara FBX Binary", "an FBX model", "give it the extension .fbx"),
    (b"BLENDER", "a file of Blender", "give it the extension .blend"),
    (b"glTF", "a glTF model", "give it the extension .glb"),
];

/// Brands of the container of AVIF and HEIC (ISO/IEC 23008-12).
const AVIF: [&[u8]; 2] = [b"avif", b"avis"];
const HEIC: [&[u8]; 8] = [b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"mif1", b"msf1"];

/// Bytes of a text that are searched for its first words.
pub(super) const HEAD: usize = 512;

/// What a file holds, if that is known.
pub(super) fn of(bytes: &[u8]) -> Option<Content> {
    if bytes.is_empty() {
        return Some(Content { what: "empty", remedy: "export or download the file again" });
    }
    let by_start = SIGNATURES.iter().find(|(start, ..)| bytes.starts_with(start));
    if let Some(&(_, what, remedy)) = by_start {
        return Some(Content { what, remedy });
    }
    if bytes.get(4..8) == Some(b"ftyp") {
        let brand = bytes.get(8..12).unwrap_or_default();
        let name = [("an AVIF image", &AVIF[..]), ("an HEIC image", &HEIC[..])];
        let found = name.into_iter().find(|(_, brands)| brands.contains(&brand));
        return found.map(|(what, _)| Content { what, remedy: CONVERT });
    }
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD)]).to_ascii_lowercase();
    let head = head.trim_start_matches('\u{feff}').trim_start();
    if head.starts_with("<!doctype html") || head.starts_with("<html") {
        return Some(Content { what: "a web page (HTML)", remedy: DOWNLOAD });
    }
    if head.starts_with('<') && head.contains("<svg") {
        return Some(Content { what: "an SVG drawing", remedy: CONVERT });
    }
    let is_xml = head.starts_with("<?xml") || head.starts_with('<');
    is_xml.then_some(Content { what: "an XML document", remedy: DOWNLOAD })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_reported_by_their_first_bytes() {
        for (bytes, what) in [
            (&b""[..], "empty"),
            (b"version https://git-lfs.github.com/spec/v1\noid", "Git LFS"),
            (b"\n<!DOCTYPE HTML>\n<html>", "HTML"),
            (b"<?xml version=\"1.0\"?>\n<svg>", "SVG"),
            (b"<?xml version=\"1.0\"?><Error/>", "XML"),
            (b"\0\0\0\x20ftypavif\0\0", "AVIF"),
            (b"\0\0\0\x18ftypheic\0\0", "HEIC"),
            (b"PK\x03\x04...", "ZIP"),
            (b"DDS |", "DDS"),
        ] {
            assert!(of(bytes).expect(what).what.contains(what), "{what}");
        }
        for bytes in [&b"\x89PNG"[..], b"solid a", b"ply\n", b"\0\0\0\x20ftypmp42"] {
            assert_eq!(of(bytes), None);
        }
    }
}
