//! Numbered sequences of pictures: `--frames 1-10x2`.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Most pictures of one command; beyond, the range is surely a slip.
const MOST: u64 = 1 << 20;

/// Most digits of a number in a name.
const MOST_DIGITS: usize = 20;

/// A range of frames: first, last (included) and step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Frames {
    first: u32,
    last: u32,
    step: u32,
}

impl FromStr for Frames {
    type Err = String;

    /// `7`, `1-10` or `1-10x2`.
    fn from_str(text: &str) -> Result<Frames, String> {
        let wrong = || "not a range of frames such as 7, 1-10 or 1-10x2".to_string();
        let number = |text: &str| text.parse::<u32>().map_err(|_| wrong());
        let (range, step) = match text.split_once('x') {
            Some((range, step)) => (range, number(step)?),
            None => (text, 1),
        };
        let (first, last) = match range.split_once('-') {
            Some((first, last)) => (number(first)?, number(last)?),
            None => (number(range)?, number(range)?),
        };
        if step == 0 || last < first {
            return Err("the last frame comes before the first, or the step is 0".to_string());
        }
        if u64::from(last - first) / u64::from(step) >= MOST {
            return Err(format!("more than {MOST} frames"));
        }
        Ok(Frames { first, last, step })
    }
}

impl Frames {
    /// The numbers of the frames.
    pub(crate) fn numbers(self) -> impl Iterator<Item = u32> {
        (self.first..=self.last).step_by(self.step as usize)
    }

    /// The file for a frame: `#` in the name stand for the digits of its number, as `%04d` does for four; without any,
    /// `.####` comes before the extension.
    pub(crate) fn file(path: &Path, number: u32) -> PathBuf {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = with_marks(&name);
        let pattern = match name.contains('#') {
            true => name.to_string(),
            false => {
                let (stem, extension) = name.rsplit_once('.').unwrap_or((&name, ""));
                format!("{stem}.####.{extension}")
            }
        };
        let start = pattern.find('#').unwrap_or(0);
        let width = pattern[start..].chars().take_while(|c| *c == '#').count();
        let (head, tail) = (&pattern[..start], &pattern[start + width..]);
        path.with_file_name(format!("{head}{number:0width$}{tail}"))
    }
}

/// A name with `#` in place of the first `%d`, `%4d` or `%04d` of C.
fn with_marks(name: &str) -> Cow<'_, str> {
    for (at, _) in name.match_indices('%') {
        let rest = &name[at + 1..];
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let width = if digits == 0 { Some(1) } else { rest[..digits].parse().ok() };
        if let (Some(tail), Some(width @ 1..=MOST_DIGITS)) = (rest[digits..].strip_prefix('d'), width) {
            return Cow::Owned(format!("{}{}{tail}", &name[..at], "#".repeat(width)));
        }
    }
    Cow::Borrowed(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges() {
        let list = |text: &str| Frames::from_str(text).map(|f| f.numbers().collect::<Vec<_>>());
        assert_eq!(list("7"), Ok(vec![7]));
        assert_eq!(list("1-4"), Ok(vec![1, 2, 3, 4]));
        assert_eq!(list("0-9x4"), Ok(vec![0, 4, 8]));
        for wrong in ["", "a", "3-1", "1-5x0", "-3", "1-", "0-4294967295"] {
            assert!(list(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn names() {
        let file = |path: &str, n| Frames::file(Path::new(path), n).to_string_lossy().replace('\\', "/");
        assert_eq!(file("a/out.exr", 7), "a/out.0007.exr");
        assert_eq!(file("a/out_##.exr", 7), "a/out_07.exr");
        assert_eq!(file("out.##.exr", 123), "out.123.exr");
        assert_eq!(file("a%d/out.%04d.exr", 7), "a%d/out.0007.exr");
        assert_eq!(file("out_%d.exr", 7), "out_7.exr");
        assert_eq!(file("100%-%3d.exr", 7), "100%-007.exr");
        assert_eq!(file("50%.exr", 7), "50%.0007.exr");
    }
}
