//! Markdown for terminals: tables become aligned columns, marks of code go, links keep their text.

use std::fmt::Write;
use textwrap::{Options, WordSplitter, fill, wrap};

/// Columns of a terminal.
const WIDTH: usize = 100;
/// Narrowest column of a table.
const LEAST: usize = 12;
const GAP: usize = 2;

/// Plain text for a terminal.
pub(crate) fn to_text(markdown: &str) -> String {
    let mut text = String::new();
    let lines: Vec<&str> = markdown.lines().collect();
    let mut i = 0;
    while i < lines.len() {
        let rest = &lines[i..];
        if rest[0].starts_with('|') {
            let count = rest.iter().take_while(|l| l.starts_with('|')).count();
            table(&mut text, &rest[..count]);
            i += count;
        } else if rest[0].trim().is_empty() {
            text.push('\n');
            i += 1;
        } else if let Some(title) = rest[0].strip_prefix('#') {
            let _ = writeln!(text, "{}", plain(title.trim_start_matches('#').trim()));
            i += 1;
        } else {
            let is_more =
                |l: &&&str| !l.trim().is_empty() && !l.starts_with(['|', '#']) && !l.starts_with("- ");
            let count = 1 + rest[1..].iter().take_while(is_more).count();
            let paragraph = rest[..count].iter().map(|l| l.trim()).collect::<Vec<_>>().join(" ");
            let indent = if paragraph.starts_with("- ") { "  " } else { "" };
            let _ = writeln!(text, "{}", fill(&plain(&paragraph), lines_of(WIDTH).subsequent_indent(indent)));
            i += count;
        }
    }
    text
}

/// Without marks of code and links.
fn plain(text: &str) -> String {
    let mut text = text.replace("\\|", "|").replace('`', "");
    while let Some(start) = text.find("](")
        && let Some(length) = text[start..].find(')')
    {
        text.replace_range(start..=start + length, "");
        if let Some(open) = text[..start].rfind('[') {
            text.remove(open);
        }
    }
    text
}

/// Lines of at most so many columns; a longer word has a line of its own.
fn lines_of(columns: usize) -> Options<'static> {
    Options::new(columns).break_words(false).word_splitter(WordSplitter::NoHyphenation)
}

fn cells(line: &str) -> Vec<String> {
    let inside = line.trim().trim_start_matches('|').trim_end_matches('|');
    inside.split(" | ").map(|c| plain(c.trim())).collect()
}

fn table(text: &mut String, lines: &[&str]) {
    let is_rule = |l: &&&str| l.chars().all(|c| matches!(c, '|' | '-' | ':' | ' '));
    let rows: Vec<Vec<String>> = lines.iter().filter(|l| !is_rule(l)).map(|l| cells(l)).collect();
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let longest = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max();
    let mut widths: Vec<usize> = (0..columns).map(|c| longest(c).unwrap_or(0)).collect();
    // The widest columns give way.
    while widths.iter().sum::<usize>() + GAP * columns > WIDTH {
        let Some(widest) = (0..columns).max_by_key(|&c| widths[c]).filter(|&c| widths[c] > LEAST) else {
            break;
        };
        widths[widest] -= 1;
    }
    for row in &rows {
        let wrapped: Vec<_> = row.iter().zip(&widths).map(|(cell, w)| wrap(cell, lines_of(*w))).collect();
        for i in 0..wrapped.iter().map(Vec::len).max().unwrap_or(0) {
            let mut line = String::new();
            for (cell, width) in wrapped.iter().zip(&widths) {
                let part = cell.get(i).map_or("", |line| line.as_ref());
                let _ = write!(line, "{part:<width$}  ");
            }
            let _ = writeln!(text, "  {}", line.trim_end());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_align_and_wrap() {
        let long = "word ".repeat(40);
        let text =
            to_text(&format!("| Key | Meaning |\n|---|---|\n| `a`, `b` | {long} |\n| `key` | short |"));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "  Key   Meaning");
        assert!(lines[1].starts_with("  a, b  word word") && lines[2].starts_with("        word"), "{text}");
        assert_eq!(lines.last(), Some(&"  key   short"));
        assert!(lines.iter().all(|l| l.len() <= WIDTH), "{text}");
    }

    #[test]
    fn paragraphs_flow_and_marks_go() {
        let text = to_text("One\ntwo `three` [four](five).\n\n## Six\n- seven\n- eight");
        assert_eq!(text, "One two three four.\n\nSix\n- seven\n- eight\n");
        let long = to_text(&format!("- {}", "word ".repeat(30)));
        assert_eq!(long.lines().map(str::len).collect::<Vec<_>>(), [96, 56], "{long}");
    }
}
