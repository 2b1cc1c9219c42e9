//! Copies the results into the documentation: pictures and the guide's table of times.

use oscura::error::{Error, Result};
use oscura::output::write_atomically;
use std::path::Path;

const BEGIN: &str = "<!-- times: begin -->\n";
const END: &str = "<!-- times: end -->";

/// Copies `hero.jpg` and the contact sheets (where present) from a folder into `assets/`, and the table into the guide's page on
/// speed.
///
/// # Errors
/// Where a file can't be read or written, or that page has no markers for the table.
pub fn publish(folder: &Path, table: Option<&str>) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for name in ["hero.jpg", "contact-sheet.jpg", "contact-sheet-physics.jpg"] {
        let source = folder.join(name);
        if source.exists() {
            write_atomically(root.join("assets").join(name), &read(&source)?)?;
        }
    }
    let Some(table) = table else { return Ok(()) };
    let page = root.join("src/guide/speed.md");
    let text = String::from_utf8_lossy(&read(&page)?).into_owned();
    let replaced = replace(&text, table)
        .ok_or_else(|| Error::output(&page, format!("has no place for the table: {BEGIN}{END}")))?;
    write_atomically(&page, replaced.as_bytes())
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))
}

/// The text with the table between the markers.
fn replace(text: &str, table: &str) -> Option<String> {
    let start = text.find(BEGIN)? + BEGIN.len();
    let end = start + text[start..].find(END)?;
    Some(format!("{}{table}{}", &text[..start], &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_is_inserted_between_the_markers() {
        let text = format!("a\n{BEGIN}old\n{END}\nb");
        assert_eq!(replace(&text, "new\n"), Some(format!("a\n{BEGIN}new\n{END}\nb")));
        assert_eq!(replace("nothing", "new"), None);
    }
}
