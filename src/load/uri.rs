//! URIs inside asset files: `data:` URIs are decoded, relative references become paths beside the asset. Nothing is
//! ever fetched over a network.

use crate::error::Choice;
use base64::engine::{DecodePaddingMode, Engine, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, alphabet};
use percent_encoding::percent_decode;
use std::path::{Component, Path, PathBuf};

/// The target of a URI.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// A `data:` URI, decoded.
    Embedded {
        /// The media type, if given.
        mime: Option<String>,
        /// The decoded bytes.
        bytes: Vec<u8>,
    },
    /// A file.
    File(PathBuf),
}

/// Resolves a URI reference of the asset at `asset`. A reference must stay inside the asset's folder unless
/// `allow_external`.
///
/// # Errors
/// The error message about a URI, with help.
pub(super) fn resolve(uri: &str, asset: &Path, allow_external: bool) -> Result<Target, String> {
    if let Some(rest) = strip_scheme(uri, "data:") {
        return embedded(rest);
    }
    if let Some(scheme) = scheme(uri) {
        return Err(format!(
            "'{}' has the scheme '{scheme}:', but only files beside the asset and data: URIs are read; \
             download the file and refer to it by a relative path",
            shortened(uri)
        ));
    }
    let decoded = percent_decoded(uri.as_bytes())
        .ok_or_else(|| format!("'{}' has a broken percent sequence", shortened(uri)))?;
    let decoded = String::from_utf8(decoded)
        .map_err(|_| format!("'{}' is not UTF-8 after percent decoding", shortened(uri)))?;
    if decoded.is_empty() || decoded.contains('\0') {
        return Err(format!("'{}' names no file", shortened(uri)));
    }
    let relative = Path::new(&decoded);
    if !allow_external && leaves_folder(relative) {
        return Err(format!(
            "'{}' leads out of the asset's folder; move the file beside the asset, or permit it by {}",
            shortened(uri),
            Choice::AllowExternal
        ));
    }
    Ok(Target::File(asset.parent().unwrap_or(Path::new("")).join(relative)))
}

/// The URI, cut to a length that fits a message.
pub(super) fn shortened(uri: &str) -> String {
    match uri.char_indices().nth(60) {
        Some((cut, _)) => format!("{}...", &uri[..cut]),
        None => uri.to_string(),
    }
}

fn strip_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme).then(|| &uri[scheme.len()..])
}

/// The scheme of an absolute URI (RFC 3986, section 3.1).
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut letters = scheme.chars();
    let starts = letters.next().is_some_and(|c| c.is_ascii_alphabetic());
    (starts && letters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))).then_some(scheme)
}

/// Does a relative path climb above where it starts, or start elsewhere?
fn leaves_folder(path: &Path) -> bool {
    let mut depth = 0i64;
    for part in path.components() {
        match part {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => return true,
        }
        if depth < 0 {
            return true;
        }
    }
    false
}

/// What follows `data:` (RFC 2397).
fn embedded(rest: &str) -> Result<Target, String> {
    let (head, payload) = rest.split_once(',').ok_or("the data: URI has no comma before its data")?;
    let (mime, is_base64) = match head.strip_suffix(";base64") {
        Some(mime) => (mime, true),
        None => (head, false),
    };
    let bytes = if is_base64 {
        base64_decoded(payload.as_bytes()).map_err(|e| format!("the data: URI is not valid base64: {e}"))?
    } else {
        percent_decoded(payload.as_bytes()).ok_or("the data: URI has a broken percent sequence")?
    };
    let mime = mime.split(';').next().filter(|m| !m.is_empty()).map(str::to_string);
    Ok(Target::Embedded { mime, bytes })
}

/// Replaces `%41` by its byte; `None` where two hexadecimal digits are missing, which the crate would leave as they are.
fn percent_decoded(text: &[u8]) -> Option<Vec<u8>> {
    let has_digits = |rest: &[u8]| rest.get(..2).is_some_and(|d| d.iter().all(u8::is_ascii_hexdigit));
    let is_sound = text.split(|&b| b == b'%').skip(1).all(has_digits);
    is_sound.then(|| percent_decode(text).collect())
}

/// Decodes base64 with or without padding, in the standard or the URL-safe alphabet (RFC 4648, sections 4 and 5). What is
/// left over of the last digit is not looked at: encoders differ there.
fn base64_decoded(text: &[u8]) -> Result<Vec<u8>, DecodeError> {
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let is_url_safe = text.iter().any(|b| b"-_".contains(b));
    let alphabet = if is_url_safe { &alphabet::URL_SAFE } else { &alphabet::STANDARD };
    GeneralPurpose::new(alphabet, config).decode(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn embedded_bytes(uri: &str) -> Result<Vec<u8>, String> {
        match resolve(uri, Path::new("a.gltf"), false)? {
            Target::Embedded { bytes, .. } => Ok(bytes),
            Target::File(path) => Err(path.display().to_string()),
        }
    }

    #[test]
    fn base64_of_every_length() {
        // RFC 4648, section 10.
        let cases = [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob")];
        for (text, plain) in cases {
            let bytes = embedded_bytes(&format!("data:a/b;base64,{text}")).expect(text);
            assert_eq!(bytes, plain.as_bytes());
        }
        assert_eq!(embedded_bytes("DATA:;base64,_-8="), Ok(vec![0xff, 0xef]));
        for broken in ["data:;base64,Z", "data:;base64,Zm9*", "data:;base64", "data:,%4", "data:;base64,Zm=v"]
        {
            assert!(embedded_bytes(broken).is_err(), "{broken}");
        }
    }

    #[test]
    fn mime_and_plain_data() {
        let target = resolve("data:text/plain;charset=utf-8,a%20b", Path::new("a"), false);
        let mime = Some("text/plain".to_string());
        assert_eq!(target, Ok(Target::Embedded { mime, bytes: b"a b".to_vec() }));
    }

    #[test]
    fn paths() {
        let file = |uri: &str| resolve(uri, Path::new("dir/a.gltf"), false);
        assert_eq!(file("b%20c/d.bin"), Ok(Target::File("dir/b c/d.bin".into())));
        assert_eq!(file("b/../d.bin"), Ok(Target::File("dir/b/../d.bin".into())));
        for refused in
            ["../d.bin", "b/../../d", "/etc/passwd", "%2e%2e/d", "http://a/b", "file:///b", "%ff", "%zz", ""]
        {
            assert!(file(refused).is_err(), "{refused}");
        }
        assert!(resolve("../d.bin", Path::new("dir/a.gltf"), true).is_ok());
    }
}
