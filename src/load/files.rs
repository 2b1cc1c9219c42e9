//! Referenced files: searched relative to the referring file, with tolerance for path syntax of other systems, and read
//! only if they are regular files below a maximum size. Models may be untrusted, also in the thumbnailer of a file
//! manager: references must not block (pipes), be endless (devices) or lie outside the folder.
//!
//! [`content_of`] identifies a file of the wrong type by its first bytes, for error messages.

use super::LoadOptions;
use crate::error::{Choice, Error};
use crate::simd::prefer_huge_pages;
use flate2::read::MultiGzDecoder;
use std::borrow::Cow;
use std::fs::File;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};

/// Maximum size of text files (scene files, material libraries, IES profiles), bytes.
pub(super) const MAX_TEXT: u64 = 1 << 28;
/// Maximum size of other files (images, buffers, grids), bytes.
pub(super) const MAX_DATA: u64 = 1 << 35;

/// Maximum number of suffixes of a path that are tried as relative paths.
const MAX_TRAILING: usize = 64;

/// Reads a regular file of at most `max_bytes` bytes.
///
/// # Errors
/// A message why it can't be read.
pub(super) fn read(path: &Path, max_bytes: u64) -> Result<Vec<u8>, String> {
    let file = open(path)?;
    let length = file.metadata().map_or(0, |data| data.len());
    if length > max_bytes {
        return Err(format!(
            "can't be read: it has {length} bytes, of which at most {max_bytes} are accepted"
        ));
    }
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))
        .map_err(|_| format!("can't be read: there is no memory for its {length} bytes"))?;
    // The file may grow meanwhile; files in /proc have the length 0 whatever they contain.
    file.take(max_bytes + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    match bytes.len() as u64 > max_bytes {
        true => Err(format!("can't be read: it has more than {max_bytes} bytes")),
        false => Ok(bytes),
    }
}

/// Reads a model file that the user named, which may be a pipe; gzip is decompressed.
pub(super) fn read_model(path: &Path) -> crate::error::Result<Vec<u8>> {
    let fail = |e: std::io::Error| Error::input(path, unreadable(e));
    let mut file = File::open(path).map_err(fail)?;
    let mut bytes = Vec::new();
    // The length is only a hint: the file is read to its end.
    let length = file.metadata().map_or(0, |m| m.len());
    if bytes.try_reserve_exact(usize::try_from(length).unwrap_or(0)).is_ok() {
        prefer_huge_pages(&mut bytes);
    }
    file.read_to_end(&mut bytes).map_err(fail)?;
    let unpacked = match gunzipped(&bytes).map_err(|why| Error::input(path, why))? {
        Cow::Owned(unpacked) => Some(unpacked),
        Cow::Borrowed(_) => None,
    };
    Ok(unpacked.unwrap_or(bytes))
}

/// Decompresses gzip; returns other data unchanged.
///
/// # Errors
/// A message about damaged gzip data.
pub(super) fn gunzipped(bytes: &[u8]) -> Result<Cow<'_, [u8]>, String> {
    if !bytes.starts_with(GZIP) {
        return Ok(Cow::Borrowed(bytes));
    }
    let mut unpacked = Vec::new();
    let read = MultiGzDecoder::new(bytes).take(MAX_DATA).read_to_end(&mut unpacked);
    read.map_err(|e| format!("can't be unpacked as gzip: {e}"))?;
    Ok(Cow::Owned(unpacked))
}

/// A model file that is read sequentially, in several passes.
pub(super) enum ModelReader {
    Plain(File),
    /// A gzip file, decompressed.
    Unpacked(Cursor<Vec<u8>>),
}

impl ModelReader {
    /// Opens a file.
    ///
    /// # Errors
    /// As for [`read_model`].
    pub fn open(path: &Path) -> crate::error::Result<ModelReader> {
        let fail = |e: std::io::Error| Error::input(path, unreadable(e));
        let mut file = File::open(path).map_err(fail)?;
        let mut start = Vec::new();
        if file.metadata().is_ok_and(|data| data.is_file()) {
            file.by_ref().take(2).read_to_end(&mut start).and_then(|_| file.rewind()).map_err(fail)?;
        }
        match start == GZIP {
            true => Ok(ModelReader::Unpacked(Cursor::new(read_model(path)?))),
            false => Ok(ModelReader::Plain(file)),
        }
    }

    /// File length in bytes; 0 if unknown.
    pub fn length(&self) -> u64 {
        match self {
            ModelReader::Plain(file) => file.metadata().map_or(0, |data| data.len()),
            ModelReader::Unpacked(bytes) => bytes.get_ref().len() as u64,
        }
    }
}

impl Read for ModelReader {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        match self {
            ModelReader::Plain(file) => file.read(out),
            ModelReader::Unpacked(bytes) => bytes.read(out),
        }
    }
}

impl Seek for ModelReader {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        match self {
            ModelReader::Plain(file) => file.seek(to),
            ModelReader::Unpacked(bytes) => bytes.seek(to),
        }
    }
}

/// First bytes of gzip files.
pub(super) const GZIP: &[u8] = b"\x1f\x8b";

/// Maximum size of a text file to edit, bytes.
const MAX_EDITED_TEXT: u64 = 1 << 24;

/// The text of a file to edit; `None` if it does not exist.
///
/// # Errors
/// An input error if it can't be read or isn't UTF-8.
pub fn text_of(path: &Path) -> crate::error::Result<Option<String>> {
    if !path.exists() {
        return Ok(None);
    }
    let bytes = read(path, MAX_EDITED_TEXT).map_err(|why| Error::input(path, why))?;
    let text = String::from_utf8(bytes).map_err(|_| Error::input(path, "is not UTF-8 text"))?;
    Ok(Some(text))
}

/// The names of all files and folders in a folder.
///
/// # Errors
/// An input error if it can't be read.
pub fn file_names_in(folder: &Path) -> crate::error::Result<Vec<String>> {
    let unreadable = |e| Error::input(folder, unreadable(e));
    let entries = std::fs::read_dir(folder).map_err(unreadable)?;
    entries.map(|entry| Ok(entry.map_err(unreadable)?.file_name().to_string_lossy().into_owned())).collect()
}

/// Opens a regular file.
///
/// # Errors
/// A message why it can't be read.
pub(super) fn open(path: &Path) -> Result<File, String> {
    // Opening a pipe blocks until it has a writer, so the type is checked first.
    check_kind(&std::fs::metadata(path).map_err(unreadable)?)?;
    let file = File::open(path).map_err(unreadable)?;
    check_kind(&file.metadata().map_err(unreadable)?)?;
    Ok(file)
}

fn unreadable(error: std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => "can't be read: there is no such file".to_string(),
        _ => format!("can't be read: {error}"),
    }
}

/// Fails unless it is a regular file.
fn check_kind(of: &std::fs::Metadata) -> Result<(), String> {
    match (of.is_file(), of.is_dir()) {
        (true, _) => Ok(()),
        (_, true) => Err("can't be read: it is a folder".into()),
        _ => Err("can't be read: it is a device or a pipe, not a file".into()),
    }
}

/// The file that `name` refers to, relative to `file`. Tried in order, each also case-insensitively: the path as written,
/// with `\` as a separator, then its suffixes from the longest (for absolute paths of another machine).
///
/// # Errors
/// A message that the file is missing or outside the folder.
pub(super) fn find(file: &Path, name: &str, options: &LoadOptions) -> Result<PathBuf, String> {
    // Some programs quote names, or escape spaces.
    let quoted = name.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(name);
    let mut names = vec![name.to_string(), quoted.to_string(), quoted.replace("\\ ", " ")];
    names.dedup();
    let found = find_any(file, &names, options.allow_external);
    match &found {
        Ok(path) => options.files.note(path),
        // Watch for the file: it may be created later.
        Err(_) => options.files.note(relative_to(file, &name.replace('\\', "/"))),
    }
    found
}

/// A path relative to the folder of `file`.
pub(super) fn relative_to(file: &Path, name: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(name)
}

/// The first file that exists among several interpretations of a name.
///
/// # Errors
/// A message about the first interpretation.
pub(super) fn find_any(file: &Path, names: &[String], allow_external: bool) -> Result<PathBuf, String> {
    let slashed: Vec<String> = names.iter().map(|name| name.replace('\\', "/")).collect();
    let each = names.iter().zip(&slashed).flat_map(|(name, slashed)| [name.as_str(), slashed.as_str()]);
    let ends = slashed.iter().flat_map(|name| name.match_indices('/').map(|(slash, _)| &name[slash + 1..]));
    let mut is_outside = false;
    for wanted in each.chain(ends.take(MAX_TRAILING)) {
        let relative = Path::new(wanted);
        if wanted.is_empty() || wanted.contains('\0') {
            continue;
        }
        let path = relative_to(file, wanted);
        if !allow_external && leads_outside(relative) {
            is_outside |= path.is_file();
            continue;
        }
        if path.is_file() {
            return Ok(path);
        }
        if let Some(path) = find_ignoring_case(&path) {
            return Ok(path);
        }
    }
    let name = names.first().map_or("", String::as_str);
    Err(match is_outside {
        true => format!("'{name}' is outside the folder; permit it by {}", Choice::AllowExternal),
        false => format!("'{name}' does not exist"),
    })
}

/// Whether a relative path leads outside its base folder.
pub(super) fn leads_outside(path: &Path) -> bool {
    let mut depth = 0i64;
    path.components().any(|part| {
        match part {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => depth = -1,
        }
        depth < 0
    })
}

/// The file with this name in any case, if there is exactly one.
fn find_ignoring_case(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?.to_lowercase();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let mut same = entries.filter(|e| e.file_name().to_str().is_some_and(|n| n.to_lowercase() == name));
    let found = same.next()?.path();
    (same.next().is_none() && found.is_file()).then_some(found)
}

/// File content recognised by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Content {
    /// Description that follows "is" in messages.
    pub what: &'static str,
    /// Remedy for the user.
    pub remedy: &'static str,
}

const CONVERT: &str = "convert it to PNG";
const UNPACK: &str = "unpack it first";
const FETCH: &str = "fetch the file itself: git lfs pull";
const DOWNLOAD: &str = "download the file itself: the server sent a page about it, or an error";

/// First bytes of file types, with a description and a remedy.
const SIGNATURES: &[(&[u8], &str, &str)] = &[
    (b"version https://git-lfs.github.com/", "a Git LFS pointer instead of the file", FETCH),
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
    (b"BLENDER", "a Blender file", "give it the extension .blend"),
    (b"glTF", "a glTF model", "give it the extension .glb"),
    (b"ply\n", "a PLY model", "give it the extension .ply"),
    (b"ply\r", "a PLY model", "give it the extension .ply"),
];

/// Brands of AVIF and HEIC in the HEIF container (ISO/IEC 23008-12).
const AVIF: [&[u8]; 2] = [b"avif", b"avis"];
const HEIC: [&[u8]; 8] = [b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"mif1", b"msf1"];

/// Length of the file header that is searched for HTML, SVG and XML, bytes.
pub(super) const HEAD: usize = 512;

/// The content of a file, if recognised.
pub(super) fn content_of(bytes: &[u8]) -> Option<Content> {
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
    fn foreign_paths_are_found_within_the_folder_only() {
        let outer = tempfile::tempdir().expect("a folder");
        let folder = outer.path().join("model");
        std::fs::create_dir_all(folder.join("maps")).expect("made");
        for name in ["model/a b.png", "model/maps/C.png", "secret.png", "model/back\\slash.png"] {
            std::fs::write(outer.path().join(name), "").expect("written");
        }
        let obj = folder.join("a.obj");
        let options = LoadOptions::default();
        let found = |name: &str| find(&obj, name, &options);
        let inside = |name: &str| folder.join(name);
        assert_eq!(found("a b.png"), Ok(inside("a b.png")));
        assert_eq!(found("maps\\c.PNG"), Ok(inside("maps/C.png")));
        assert_eq!(found("D:\\work\\A B.png"), Ok(inside("a b.png")));
        assert_eq!(found("back\\slash.png"), Ok(inside("back\\slash.png")));
        assert_eq!(found("\"a b.png\""), Ok(inside("a b.png")));
        assert_eq!(found("a\\ b.png"), Ok(inside("a b.png")));
        assert!(found("../secret.png").expect_err("outside").contains(&Choice::AllowExternal.to_string()));
        assert!(found("nothing.png").is_err() && found("").is_err());
        let options = LoadOptions { allow_external: true, ..LoadOptions::default() };
        let outside = find(&obj, "../secret.png", &options).expect("permitted");
        assert!(outside.ends_with("../secret.png"));
    }

    #[test]
    fn only_regular_files_below_the_size_limit_are_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        std::fs::write(&path, "12345").expect("written");
        assert_eq!(read(&path, 5).as_deref(), Ok(&b"12345"[..]));
        assert!(read(&path, 4).expect_err("too long").contains("at most 4"));
        assert!(read(folder.path(), 9).expect_err("no file").contains("folder"));
        File::options().write(true).open(&path).and_then(|file| file.set_len(1 << 36)).expect("sparse");
        assert!(read(&path, MAX_DATA).expect_err("too long").contains("68719476736 bytes"));
        if cfg!(unix) {
            for device in ["/dev/zero", "/dev/null"] {
                assert!(read(Path::new(device), 9).expect_err(device).contains("a device or a pipe"));
            }
        }
    }

    #[test]
    fn contents_are_recognised_by_their_first_bytes() {
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
            (b"ply\r\nformat", "PLY"),
        ] {
            assert!(content_of(bytes).expect(what).what.contains(what), "{what}");
        }
        for bytes in [&b"\x89PNG"[..], b"solid a", b"plywood", b"\0\0\0\x20ftypmp42"] {
            assert_eq!(content_of(bytes), None);
        }
    }
}
