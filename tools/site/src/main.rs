//! Writes the guide as a book for mdbook: `oscura-site FOLDER [--repository URL]`.
//!
//! The pages are those of `src/guide` and the scene file reference of `oscura help`; nothing is duplicated. Links between pages
//! become those of the book, images are copied, and links to other files of the repository become links below `URL`, or their
//! paths without one.

mod links;
mod pages;

use pages::{Page, Text};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const BOOK: &str = include_str!("book.toml");
const STYLE: &str = include_str!("style.css");

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let (mut folder, mut repository) = (None, None);
    while let Some(word) = arguments.next() {
        match word.as_str() {
            "--repository" => repository = arguments.next(),
            _ if word.starts_with('-') || folder.is_some() => return usage(),
            _ => folder = Some(PathBuf::from(word)),
        }
    }
    let Some(folder) = folder else { return usage() };
    match write(&folder, repository.as_deref()) {
        Ok(count) => {
            println!("{count} pages; next: mdbook build {}", folder.display());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("oscura-site: {error}");
            ExitCode::FAILURE
        }
    }
}

fn usage() -> ExitCode {
    eprintln!("usage: oscura-site FOLDER [--repository URL]");
    ExitCode::from(2)
}

/// Writes all pages; returns their number.
fn write(folder: &Path, repository: Option<&str>) -> Result<usize, String> {
    let pages = pages::all();
    let source = folder.join("src");
    put(&folder.join("book.toml"), BOOK.as_bytes())?;
    put(&folder.join("style.css"), STYLE.as_bytes())?;
    put(&source.join("SUMMARY.md"), summary(&pages).as_bytes())?;
    let mut pictures = BTreeSet::new();
    for page in &pages {
        let text = match &page.text {
            Text::File(path) => {
                let text = read(Path::new(path))?;
                let text = String::from_utf8(text).map_err(|e| format!("{path}: {e}"))?;
                links::rewritten(&text, path, &pages, repository, &mut pictures)
                    .map_err(|e| format!("{path}: {e}"))?
            }
            Text::Made(text) => text.clone(),
        };
        put(&source.join(&page.name), text.as_bytes())?;
    }
    for picture in pictures {
        put(&source.join(links::picture(&picture)), &read(&picture)?)?;
    }
    Ok(pages.len())
}

/// The table of contents.
fn summary(pages: &[Page]) -> String {
    let mut text = String::from("# Summary\n\n");
    for page in pages {
        let line = format!("{}- [{}]({})\n", "  ".repeat(page.level), page.title, page.name);
        match page.part {
            // Pages before the first part are unnumbered.
            Some("") => text += line.trim_start_matches("- "),
            Some(part) => text += &format!("\n# {part}\n\n{line}"),
            None => text += &line,
        }
    }
    text
}

/// A file of the repository.
fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(Path::new(ROOT).join(path)).map_err(|e| format!("{}: {e}", path.display()))
}

fn put(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let parent = path.parent().unwrap_or(Path::new("."));
    let written = fs::create_dir_all(parent).and_then(|()| fs::write(path, bytes));
    written.map_err(|e| format!("{}: {e}", path.display()))
}
