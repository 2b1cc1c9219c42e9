//! Lines of OBJ and MTL files as the formats mean them: without a byte order mark, with any kind of line end, and
//! joined where a `\` says that a line goes on; and a reader that hands what is made of them to `tobj`.

use crate::load::guard;
use std::fs::File;
use std::io::{BufRead, BufReader, Error, Read, Result, Seek};

/// Bytes that are read at a time.
const CHUNK: usize = 1 << 18;

/// The lines of a file, read one after another so that the whole is never in memory.
pub(super) struct Lines<R> {
    inner: BufReader<R>,
    /// What was read up to a line feed; a carriage return may end lines inside it.
    raw: Vec<u8>,
    /// Where the next line begins in `raw`.
    at: usize,
    /// A line that goes on in the next, so far.
    joined: Vec<u8>,
    /// Lines taken so far.
    number: usize,
}

impl<R: Read + Seek> Lines<R> {
    /// Starts at the beginning of a file.
    pub fn new(inner: R) -> Lines<R> {
        let inner = BufReader::with_capacity(CHUNK, inner);
        Lines { inner, raw: Vec::new(), at: 0, joined: Vec::new(), number: 0 }
    }

    /// Starts again.
    fn rewind(&mut self) -> Result<()> {
        self.inner.rewind()?;
        (self.at, self.number) = (self.raw.len(), 0);
        Ok(())
    }

    /// The next line without its end, and the number of its first line in the file, from 1.
    ///
    /// # Errors
    /// Those of reading.
    pub fn next(&mut self) -> Result<Option<(usize, &[u8])>> {
        self.joined.clear();
        let mut first = 0;
        while let Some((from, to)) = self.physical()? {
            self.number += 1;
            if first == 0 {
                first = self.number;
            }
            let line = self.raw[from..to].trim_ascii_end();
            let is_comment = self.joined.is_empty() && line.trim_ascii_start().starts_with(b"#");
            match line.strip_suffix(b"\\") {
                // Paths in comments end in backslashes, too.
                Some(start) if !is_comment => {
                    self.joined.extend_from_slice(start);
                    self.joined.push(b' ');
                }
                _ if self.joined.is_empty() => return Ok(Some((first, self.raw[from..to].trim_ascii_end()))),
                _ => {
                    self.joined.extend_from_slice(line);
                    return Ok(Some((first, &self.joined)));
                }
            }
        }
        Ok((first > 0).then_some((first, self.joined.as_slice())))
    }

    /// The range of the next line of the file in `raw`; `None` at the file's end.
    fn physical(&mut self) -> Result<Option<(usize, usize)>> {
        if self.at == self.raw.len() {
            self.raw.clear();
            self.at = 0;
            if self.inner.read_until(b'\n', &mut self.raw)? == 0 {
                return Ok(None);
            }
            if self.number == 0 && self.raw.starts_with(b"\xef\xbb\xbf") {
                self.at = 3;
            }
        }
        let from = self.at;
        let rest = &self.raw[from..];
        let end = rest.strip_suffix(b"\n").unwrap_or(rest);
        let end = end.strip_suffix(b"\r").unwrap_or(end);
        // `contains` is fast where there is none, which is nearly always.
        let inner_end = end.contains(&b'\r').then(|| end.iter().position(|&b| b == b'\r')).flatten();
        let to = match inner_end {
            Some(length) => {
                self.at = from + length + 1;
                from + length
            }
            None => {
                self.at = self.raw.len();
                from + end.len()
            }
        };
        Ok(Some((from, to)))
    }
}

/// Says what `tobj` gets to see of a line.
pub(super) trait Clean {
    /// Appends to `out` what the line with this number becomes: nothing, or lines of its own.
    fn line(&mut self, number: usize, text: &[u8], out: &mut Vec<u8>);

    /// The file has ended: should it be read once more?
    fn again(&mut self) -> bool {
        false
    }
}

/// A file as its cleaner leaves it.
pub(super) struct Cleaned<R, C> {
    lines: Lines<R>,
    /// The cleaner, with all that it noted.
    pub cleaner: C,
    /// Why reading failed, which `tobj` doesn't tell.
    pub error: Option<Error>,
    out: Vec<u8>,
    at: usize,
}

impl<R: Read + Seek, C: Clean> Cleaned<R, C> {
    /// Starts at the beginning of a file.
    pub fn new(file: R, cleaner: C) -> Cleaned<R, C> {
        Cleaned { lines: Lines::new(file), cleaner, error: None, out: Vec::new(), at: 0 }
    }

    fn refill(&mut self) -> Result<()> {
        self.out.clear();
        self.at = 0;
        while self.out.len() < CHUNK {
            match self.lines.next()? {
                Some((number, text)) => self.cleaner.line(number, text, &mut self.out),
                None if self.cleaner.again() => self.lines.rewind()?,
                None => break,
            }
        }
        Ok(())
    }
}

impl<R: Read + Seek, C: Clean> BufRead for Cleaned<R, C> {
    fn fill_buf(&mut self) -> Result<&[u8]> {
        if self.at == self.out.len()
            && let Err(error) = self.refill()
        {
            let kind = error.kind();
            self.error = Some(error);
            return Err(kind.into());
        }
        Ok(&self.out[self.at..])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
    }
}

impl<R: Read + Seek, C: Clean> Read for Cleaned<R, C> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let count = self.fill_buf()?.read(out)?;
        self.consume(count);
        Ok(count)
    }
}

/// What `tobj` gives.
type Parsed<T> = std::result::Result<T, tobj::LoadError>;

/// What `tobj` makes of a file behind a cleaner, and the cleaner with its notes.
///
/// # Errors
/// Says in words why the file can't be read.
pub(super) fn by_tobj<C: Clean, T>(
    file: File,
    cleaner: C,
    parse: impl FnOnce(&mut Cleaned<File, C>) -> Parsed<T>,
) -> std::result::Result<(Parsed<T>, C), String> {
    let mut reader = Cleaned::new(file, cleaner);
    let parsed = guard::catch(|| parse(&mut reader))?;
    match reader.error {
        Some(e) => Err(format!("can't be read: {e}")),
        None => Ok((parsed, reader.cleaner)),
    }
}

/// Text of a name: UTF-8, else Latin-1.
pub(super) fn decoded(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_string(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
    }
}

/// The words of a statement, up to a comment.
#[derive(Clone)]
pub(super) struct Words<'a>(pub &'a [u8]);

impl<'a> Words<'a> {
    /// Everything behind the words taken so far, without blanks around it; comments included.
    pub fn rest(&self) -> &'a [u8] {
        self.0.trim_ascii()
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.0.iter().position(|b| !b.is_ascii_whitespace())?;
        let text = &self.0[start..];
        if text[0] == b'#' {
            return None;
        }
        let length = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        let (word, rest) = text.split_at(length);
        self.0 = rest;
        Some(word)
    }
}

/// The number that a word is.
#[inline]
pub(super) fn float(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, SeekFrom};

    /// Gives a few bytes at a time.
    struct Drops<'a>(Cursor<&'a [u8]>);

    impl Read for Drops<'_> {
        fn read(&mut self, out: &mut [u8]) -> Result<usize> {
            let n = out.len().min(3);
            self.0.read(&mut out[..n])
        }
    }

    impl Seek for Drops<'_> {
        fn seek(&mut self, to: SeekFrom) -> Result<u64> {
            self.0.seek(to)
        }
    }

    /// Repeats every line with its number, and the whole file once.
    #[derive(Default)]
    struct Twice(bool);

    impl Clean for Twice {
        fn line(&mut self, number: usize, text: &[u8], out: &mut Vec<u8>) {
            out.extend([format!("{number} ").as_bytes(), text, b"\n"].concat());
        }

        fn again(&mut self) -> bool {
            !std::mem::replace(&mut self.0, true)
        }
    }

    #[test]
    fn a_cleaner_may_see_the_file_twice() {
        let mut text = String::new();
        let mut cleaned = Cleaned::new(Drops(Cursor::new(b"\xef\xbb\xbfa\rb\nc")), Twice::default());
        cleaned.read_to_string(&mut text).expect("it can be read");
        assert_eq!(text, "1 a\n2 b\n3 c\n".repeat(2));
    }

    fn all(bytes: &[u8]) -> Vec<(usize, String)> {
        let (mut lines, mut out) = (Lines::new(Drops(Cursor::new(bytes))), Vec::new());
        while let Some((number, line)) = lines.next().expect("it can be read") {
            out.push((number, decoded(line)));
        }
        out
    }

    #[test]
    fn lines_end_in_every_way_and_go_on_behind_a_backslash() {
        let text = b"\xef\xbb\xbfa\nb \\\r\n c\\\n\nd\r\ne\rf\r\r# C:\\x\\\ng \\";
        let numbered: Vec<(usize, String)> = all(text);
        let expected =
            [(1, "a"), (2, "b   c "), (5, "d"), (6, "e"), (7, "f"), (8, ""), (9, "# C:\\x\\"), (10, "g  ")];
        assert_eq!(numbered.len(), expected.len(), "{numbered:?}");
        for ((line, text), (expected_line, expected_text)) in numbered.iter().zip(expected) {
            assert_eq!((*line, text.as_str()), (expected_line, expected_text));
        }
        assert!(all(b"").is_empty());
    }

    #[test]
    fn names_are_utf8_or_latin1() {
        assert_eq!(decoded("caf\u{e9}".as_bytes()), "caf\u{e9}");
        assert_eq!(decoded(b"caf\xe9"), "caf\u{e9}");
    }

    #[test]
    fn words_end_at_a_comment() {
        let mut words = Words(b" v  1 2.5e-1# 3 #x");
        assert_eq!(words.next(), Some(&b"v"[..]));
        assert_eq!(words.clone().map(float).collect::<Vec<_>>(), [Some(1.0), None, Some(3.0)]);
        assert_eq!(words.rest(), b"1 2.5e-1# 3 #x");
    }
}
