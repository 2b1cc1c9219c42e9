//! Messages of one kind: the first few are shown, the others counted.

use std::collections::HashMap;

/// Messages of a kind that are shown.
const FIRST: usize = 5;

/// What is shown in place of a list of messages.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Line<'m, T> {
    /// One of them.
    One(&'m T),
    /// So many more are of the kind of the one before.
    More(usize),
}

/// A list in its order without those that are like many before them, by their texts.
pub(crate) fn shortened<'m, T>(list: &'m [T], text: impl Fn(&T) -> &str) -> Vec<Line<'m, T>> {
    let kinds: Vec<String> = list.iter().map(|item| kind(text(item))).collect();
    let mut counts: HashMap<&str, usize> = HashMap::new();
    kinds.iter().for_each(|kind| *counts.entry(kind).or_default() += 1);
    let mut shown: HashMap<&str, usize> = HashMap::new();
    let mut lines = Vec::new();
    for (item, kind) in list.iter().zip(&kinds) {
        let (count, at) = (counts[kind.as_str()], shown.entry(kind).or_default());
        *at += 1;
        // A line about one more would be as long as that.
        if *at <= FIRST || count == FIRST + 1 {
            lines.push(Line::One(item));
        }
        if *at == FIRST && count > FIRST + 1 {
            lines.push(Line::More(count - FIRST));
        }
    }
    lines
}

/// What messages have in common that differ in names and numbers only.
fn kind(text: &str) -> String {
    let mut out = String::new();
    let (mut rest, mut is_in_word) = (text, false);
    while let Some(first) = rest.chars().next() {
        // An apostrophe begins no name.
        let quoted = rest.strip_prefix('\'').filter(|_| !is_in_word);
        let quoted = quoted.and_then(|inner| Some(inner.find('\'')? + 2));
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let (mark, length) = match quoted {
            Some(length) => ('\'', length),
            None if digits > 0 => ('0', digits),
            None => (first, first.len_utf8()),
        };
        out.push(mark);
        is_in_word = mark.is_alphanumeric();
        rest = &rest[length..];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_make_no_kinds() {
        assert_eq!(kind("there is no material 'm7' in 12 files"), "there is no material ' in 0 files");
        assert_eq!(kind("it's the ä 'x"), "it's the ä 'x");
        assert_ne!(kind("2 triangles"), kind("2 quads"));
    }

    #[test]
    fn the_first_of_each_kind_are_shown() {
        let list: Vec<String> =
            (0..20).flat_map(|i| [format!("no '{i}'"), format!("other {i}")]).take(27).collect();
        let lines = shortened(&list, |text| text);
        let count = |line: &Line<String>| match line {
            Line::One(_) => 1,
            Line::More(n) => *n,
        };
        assert_eq!(lines.iter().map(count).sum::<usize>(), 27);
        assert_eq!(lines.len(), 12);
        assert_eq!((&lines[9], &lines[11]), (&Line::More(9), &Line::More(8)));
        // Six are shown: no line is saved by counting one.
        assert_eq!(shortened(&list[..12], |text| text).len(), 12);
    }
}
