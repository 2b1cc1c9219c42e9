//! The part of a very long line that a problem is about: scene files by programs may have all in one line.

use std::ops::Range;

/// Characters of the longest line that is shown as a whole.
const LONGEST: usize = 240;
/// Characters shown on each side of the place.
const AROUND: usize = 40;

/// A place in a text.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Excerpt {
    /// Number of the line, from 1.
    pub line: usize,
    /// Number of the character in it, from 1.
    pub column: usize,
    /// What stands there, with dots where it is cut.
    pub shown: String,
    /// Marks under it.
    pub marker: String,
}

impl Excerpt {
    /// The place of a span of bytes in a line that is too long to show, or whose neighbours are; `None` where lines are
    /// short, and for a span that doesn't fit the text.
    pub fn of_long_line(text: &str, span: &Range<usize>) -> Option<Excerpt> {
        let (before, rest) = (text.get(..span.start)?, text.get(span.start..)?);
        let line = before.matches('\n').count();
        let neighbours = text.lines().skip(line.saturating_sub(1)).take(if line == 0 { 2 } else { 3 });
        if neighbours.map(str::len).max()? <= LONGEST {
            return None;
        }
        let start = before.rfind('\n').map_or(0, |at| at + 1);
        let rest = rest.lines().next().unwrap_or_default();
        let column = before[start..].chars().count();
        let head: String = before[start..].chars().skip(column.saturating_sub(AROUND)).collect();
        let marked = text.get(span.clone()).and_then(|t| t.lines().next()).map_or(1, |t| t.chars().count());
        let marked = marked.clamp(1, AROUND);
        let tail: String = rest.chars().take(marked + AROUND).collect();
        let (left, right) = (
            if column > AROUND { "..." } else { "" },
            if rest.chars().count() > marked + AROUND { "..." } else { "" },
        );
        // Tabs and the like would move the marks.
        let shown = format!("{left}{head}{tail}{right}").replace(char::is_control, " ");
        let indent = left.len() + head.chars().count();
        let marker = " ".repeat(indent) + &"^".repeat(marked);
        Some(Excerpt { line: line + 1, column: column + 1, shown, marker })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_long_lines_are_cut() {
        assert_eq!(Excerpt::of_long_line("a = 1\nb = 2\n", &(6..7)), None);
        let long = format!("a = 1\nb = [{} \u{e4}\u{1f600}X, 9 ]", "0, ".repeat(1000));
        let at = long.find('X').expect("the mark");
        let excerpt = Excerpt::of_long_line(&long, &(at..at + 1)).expect("a long line");
        assert_eq!((excerpt.line, excerpt.column), (2, 3009));
        assert!(excerpt.shown.starts_with("...") && excerpt.shown.ends_with("X, 9 ]"), "{excerpt:?}");
        assert!(excerpt.shown.len() < 120, "{excerpt:?}");
        assert_eq!(excerpt.shown.chars().nth(excerpt.marker.find('^').expect("a mark")), Some('X'));
        // A neighbour would be shown too.
        assert!(Excerpt::of_long_line(&long, &(0..1)).is_some());
    }

    #[test]
    fn spans_at_and_beyond_the_end() {
        let long = "x".repeat(1000);
        assert_eq!(Excerpt::of_long_line(&long, &(1000..1000)).map(|e| e.column), Some(1001));
        assert_eq!(Excerpt::of_long_line(&long, &(2000..2001)), None);
        assert!(Excerpt::of_long_line(&long, &(0..1000)).is_some_and(|e| e.marker.len() <= 40));
    }
}
