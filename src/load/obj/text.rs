//! Text of OBJ and MTL files made fit for the parser: byte order marks, Latin-1 and continued lines, none of which
//! `tobj` takes.

use std::borrow::Cow;
use std::io::{BufRead, Read, Result};

/// Bytes that are read at a time.
const CHUNK: usize = 1 << 18;

/// A file's text, cleaned chunk by chunk while it is read, so that the whole is never in memory.
pub(super) struct Text<R> {
    inner: R,
    /// Read, but not yet handed on: the start of a line that the last chunk cut.
    raw: Vec<u8>,
    /// Cleaned text that is being handed on, from `at`.
    clean: Vec<u8>,
    at: usize,
    /// Lines before `clean`.
    lines: usize,
    started: bool,
    ended: bool,
}

impl<R: Read> Text<R> {
    /// Starts at the beginning of a file.
    pub fn new(inner: R) -> Text<R> {
        let (raw, clean) = (Vec::new(), Vec::new());
        Text { inner, raw, clean, at: 0, lines: 0, started: false, ended: false }
    }

    /// The number of the line that was taken last, from 1.
    pub fn line(&self) -> usize {
        (self.lines + count_lines(&self.clean[..self.at])).max(1)
    }

    /// Reads until there are whole lines and makes them the cleaned text.
    fn refill(&mut self) -> Result<()> {
        self.lines += count_lines(&self.clean);
        self.at = 0;
        self.clean.clear();
        let mut whole = 0;
        while whole == 0 && !self.ended {
            let before = self.raw.len();
            (&mut self.inner).take(CHUNK as u64).read_to_end(&mut self.raw)?;
            self.ended = self.raw.len() == before;
            if !self.started && self.raw.starts_with(b"\xef\xbb\xbf") {
                self.raw.drain(..3);
            }
            self.started = true;
            if self.ended && self.raw.last().is_some_and(|&b| b != b'\n') {
                self.raw.push(b'\n');
            }
            whole = if self.ended { self.raw.len() } else { whole_lines(&self.raw) };
        }
        match clean(&self.raw[..whole]) {
            Cow::Borrowed(text) => self.clean.extend_from_slice(text.as_bytes()),
            Cow::Owned(text) => self.clean = text.into_bytes(),
        }
        self.raw.drain(..whole);
        Ok(())
    }
}

impl<R: Read> BufRead for Text<R> {
    fn fill_buf(&mut self) -> Result<&[u8]> {
        if self.at == self.clean.len() {
            self.refill()?;
        }
        Ok(&self.clean[self.at..])
    }

    fn consume(&mut self, n: usize) {
        self.at = (self.at + n).min(self.clean.len());
    }
}

impl<R: Read> Read for Text<R> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let n = self.fill_buf()?.read(out)?;
        self.consume(n);
        Ok(n)
    }
}

fn count_lines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b == b'\n').count()
}

/// Length of the lines at the front that have ended and don't go on in the next.
fn whole_lines(bytes: &[u8]) -> usize {
    let mut end = bytes.len();
    while let Some(at) = bytes[..end].iter().rposition(|&b| b == b'\n') {
        if !bytes[..at].trim_ascii_end().ends_with(b"\\") {
            return at + 1;
        }
        end = at;
    }
    0
}

/// The text of a file or of some of its lines: UTF-8, else Latin-1, without a byte order mark. A line that ends in `\`
/// goes on in the next; empty lines make up for it, so that line numbers stay.
pub(super) fn clean(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text: Cow<str> = match std::str::from_utf8(bytes) {
        Ok(text) => text.into(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
    };
    if !text.as_bytes().contains(&b'\\') {
        return text;
    }
    let (mut out, mut joined) = (String::with_capacity(text.len()), 0);
    for line in text.lines() {
        match line.trim_end().strip_suffix('\\') {
            Some(start) => {
                out.push_str(start);
                out.push(' ');
                joined += 1;
            }
            None => {
                out.push_str(line);
                out.extend(std::iter::repeat_n('\n', joined + 1));
                joined = 0;
            }
        }
    }
    out.into()
}

/// The file name at the end of a texture statement, behind its options (`-s 1 1 1 name.png`).
pub(super) fn texture_file(statement: &str) -> &str {
    let mut rest = statement.trim();
    while rest.starts_with('-') {
        let (option, mut after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        let most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            "-blendu" | "-blendv" | "-bm" | "-boost" | "-cc" | "-clamp" | "-imfchan" | "-texres"
            | "-type" => 1,
            _ => break,
        };
        for _ in 0..most {
            let (value, next) = after.trim_start().split_once(char::is_whitespace).unwrap_or((after, ""));
            if most > 1 && value.parse::<f32>().is_err() {
                break;
            }
            after = next;
        }
        rest = after.trim_start();
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_made_fit() {
        assert_eq!(clean(b"\xef\xbb\xbfv 1 \\\n2 3\nf 1"), "v 1  2 3\n\nf 1\n");
        assert_eq!(clean(b"# caf\xe9"), "# caf\u{e9}");
        assert_eq!(texture_file("-s 2 2 -clamp on wood grain.png"), "wood grain.png");
        assert_eq!(texture_file("-o"), "");
    }

    /// Gives a few bytes at a time, and so many chunks.
    struct Drops<'a>(&'a [u8]);

    impl Read for Drops<'_> {
        fn read(&mut self, out: &mut [u8]) -> Result<usize> {
            let n = out.len().min(3);
            self.0.read(&mut out[..n])
        }
    }

    #[test]
    fn a_stream_gives_the_same_text_as_the_whole() {
        let line = "v 1.5 2.5 \\\n  3.5\nvn 0 0 1\r\n";
        let long = format!("\u{feff}# start\n{}end", line.repeat(30_000));
        let (whole, mut streamed) = (clean(long.as_bytes()), String::new());
        Text::new(Drops(long.as_bytes())).read_to_string(&mut streamed).expect("it is text");
        assert!(long.len() > 2 * CHUNK && streamed.lines().eq(whole.lines()));
    }

    #[test]
    fn lines_are_counted_as_they_are_taken() {
        let mut text = Text::new(&b"a\nb \\\nc\nd"[..]);
        let mut line = || {
            let mut out = String::new();
            text.read_line(&mut out).expect("it is text");
            (out.trim().to_string(), text.line())
        };
        assert_eq!(line(), ("a".to_string(), 1));
        assert_eq!(line(), ("b  c".to_string(), 2));
        assert_eq!(line(), (String::new(), 3));
        assert_eq!(line(), ("d".to_string(), 4));
    }
}
