//! Rewrites links from their location in the repository to that in the book.

use crate::pages::{Page, Text};
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// The text with the book's links; referenced images are collected.
pub(crate) fn rewritten(
    text: &str,
    path: &str,
    pages: &[Page],
    repository: Option<&str>,
    pictures: &mut BTreeSet<PathBuf>,
) -> Result<String, String> {
    let mut result = String::new();
    for (i, part) in text.split("```").enumerate() {
        if i % 2 == 1 {
            // A code block.
            result += &format!("```{part}```");
            continue;
        }
        let mut rest = part;
        while let Some(middle) = rest.find("](") {
            let end = rest[middle..].find(')').map(|n| middle + n).ok_or("a link without an end")?;
            let begin = rest[..middle].rfind('[').ok_or("a link without a beginning")?;
            let (shown, target) = (&rest[begin + 1..middle], &rest[middle + 2..end]);
            result += &rest[..begin];
            result += &link(shown, target, path, pages, repository, pictures)?;
            rest = &rest[end + 1..];
        }
        result += rest;
    }
    Ok(result)
}

/// A link, without the `!` of images.
fn link(
    shown: &str,
    target: &str,
    path: &str,
    pages: &[Page],
    repository: Option<&str>,
    pictures: &mut BTreeSet<PathBuf>,
) -> Result<String, String> {
    if target.contains("://") || target.starts_with('#') {
        return Ok(format!("[{shown}]({target})"));
    }
    let (file, anchor) =
        target.split_once('#').map_or((target, String::new()), |(f, a)| (f, format!("#{a}")));
    let file = normalized(&Path::new(path).parent().unwrap_or(Path::new("")).join(file));
    if !Path::new(crate::ROOT).join(&file).exists() {
        return Err(format!("links to {}, which doesn't exist", file.display()));
    }
    let is_file = |p: &&Page| matches!(p.text, Text::File(path) if Path::new(path) == file);
    if let Some(page) = pages.iter().find(is_file) {
        return Ok(format!("[{shown}]({}{anchor})", page.name));
    }
    let extension = file.extension().and_then(|e| e.to_str()).unwrap_or("");
    if ["jpg", "png", "svg"].contains(&extension) {
        let target = picture(&file);
        pictures.insert(file);
        return Ok(format!("[{shown}]({target})"));
    }
    let file = file.to_string_lossy().replace('\\', "/");
    Ok(match repository {
        Some(address) => format!("[{shown}]({}/{file}{anchor})", address.trim_end_matches('/')),
        None if shown.trim_matches('`') == file => format!("`{file}`"),
        None => format!("{shown} (`{file}`)"),
    })
}

/// The location of an image of the repository in the book.
pub(crate) fn picture(path: &Path) -> String {
    format!("pictures/{}", path.file_name().unwrap_or_default().to_string_lossy())
}

/// Resolves `.` and `..`.
fn normalized(path: &Path) -> PathBuf {
    let mut result = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                result.pop();
            }
            Component::CurDir => {}
            other => result.push(other),
        }
    }
    result
}
