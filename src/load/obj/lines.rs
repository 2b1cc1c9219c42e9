//! Lines of OBJ and MTL files as the formats mean them: without a byte order mark, with any kind of line end, and
//! joined where a `\` says that a line continues; and a filter between them and `tobj`.

use crate::load::decoders;
use crate::load::files::ModelReader;
use crate::load::words::next_word;
use crate::work_counter::WorkCounter;
use memchr::memchr;
use std::io::{BufRead, ErrorKind, Read, Result, Seek, SeekFrom};
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, sync_channel};

/// Bytes that are read at a time, so that the whole file is never in memory.
const CHUNK: usize = 1 << 18;

/// Maximum number of chunks that the filter may be ahead of `tobj`.
const AHEAD: usize = 4;

/// A reader that reports progress.
pub(super) struct CountedReader<'a> {
    file: ModelReader,
    counter: &'a WorkCounter,
}

impl<'a> CountedReader<'a> {
    /// The file from its current position.
    pub fn new(file: ModelReader, counter: &'a WorkCounter) -> CountedReader<'a> {
        // A pipe has no length, and so no progress.
        counter.begin(file.length());
        CountedReader { file, counter }
    }
}

impl Read for CountedReader<'_> {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let count = self.file.read(out)?;
        self.counter.add(count as u64);
        Ok(count)
    }
}

impl Seek for CountedReader<'_> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.file.seek(to)
    }
}

/// Filters a line before `tobj` reads it.
pub(super) trait LineFilter {
    /// Appends the filtered line to `out`. The number is that of its first line where lines are joined, from 1.
    fn line(&mut self, number: usize, text: &[u8], out: &mut Vec<u8>);

    /// Should reading stop?
    fn gives_up(&self) -> bool {
        false
    }

    /// Called at the end of the file: is a second pass needed?
    fn again(&mut self) -> bool {
        false
    }
}

/// Feeds the lines of a file to a filter.
struct Cleaning<R, C> {
    file: R,
    cleaner: C,
    /// Lines taken so far.
    number: usize,
    /// The beginning of a line that continues in the next, and the number of its first line.
    joined: (usize, Vec<u8>),
    out: Vec<u8>,
}

impl<R: Read + Seek, C: LineFilter> Cleaning<R, C> {
    fn new(file: R, cleaner: C) -> Cleaning<R, C> {
        Cleaning { file, cleaner, number: 0, joined: (0, Vec::new()), out: Vec::new() }
    }

    /// Returns the filtered file chunk by chunk.
    fn run(&mut self, mut give: impl FnMut(Vec<u8>)) -> Result<()> {
        // The unread rest of the buffer: the beginning of a line.
        let (mut buffer, mut rest) = (vec![0; CHUNK], 0);
        loop {
            if rest == buffer.len() {
                buffer.resize(2 * rest, 0);
            }
            let count = match self.file.read(&mut buffer[rest..]) {
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                count => count?,
            };
            let (end, mut start, mut from) = (rest + count, 0, rest);
            while let Some(length) = memchr(b'\n', &buffer[from..end]) {
                self.with_end(&buffer[start..from + length]);
                start = from + length + 1;
                from = start;
                if self.out.len() >= CHUNK {
                    give(std::mem::take(&mut self.out));
                }
                if self.cleaner.gives_up() {
                    return Ok(());
                }
            }
            buffer.copy_within(start..end, 0);
            rest = end - start;
            if count > 0 {
                continue;
            }
            if rest > 0 {
                self.with_end(&buffer[..rest]);
            }
            self.end_joined();
            if !self.cleaner.again() {
                give(std::mem::take(&mut self.out));
                return Ok(());
            }
            self.file.rewind()?;
            (self.number, rest) = (0, 0);
        }
    }

    /// A line up to its `\n`, or several that end otherwise.
    fn with_end(&mut self, raw: &[u8]) {
        let text = raw.strip_suffix(b"\r").unwrap_or(raw);
        let is_first = self.number == 0;
        let text = text.strip_prefix(b"\xef\xbb\xbf").filter(|_| is_first).unwrap_or(text);
        // That is fast where there is none, which is nearly always.
        match memchr(b'\r', text) {
            Some(_) => text.split(|&b| b == b'\r').for_each(|line| self.line(line)),
            None => self.line(text),
        }
    }

    fn line(&mut self, text: &[u8]) {
        self.number += 1;
        let text = text.trim_ascii_end();
        let (first, joined) = &mut self.joined;
        if joined.is_empty() {
            *first = self.number;
        }
        // Paths in comments end in backslashes, too.
        let is_comment = joined.is_empty() && text.trim_ascii_start().starts_with(b"#");
        match text.strip_suffix(b"\\") {
            Some(start) if !is_comment => joined.extend(start.iter().chain(b" ")),
            _ if joined.is_empty() => self.cleaner.line(self.number, text, &mut self.out),
            _ => {
                joined.extend(text);
                self.end_joined();
            }
        }
    }

    fn end_joined(&mut self) {
        let (first, joined) = &mut self.joined;
        if !joined.is_empty() {
            self.cleaner.line(*first, joined, &mut self.out);
            joined.clear();
        }
    }
}

/// Feeds all lines of a file to a filter and returns it; its output is discarded.
pub(super) fn each_line<C: LineFilter>(file: impl Read + Seek, cleaner: C) -> Result<C> {
    let mut cleaning = Cleaning::new(file, cleaner);
    cleaning.run(|_| {})?;
    Ok(cleaning.cleaner)
}

/// Reads the chunks of a file that another thread filters.
pub(super) struct FilteredChunks {
    chunks: Receiver<Vec<u8>>,
    chunk: Vec<u8>,
    at: usize,
}

impl BufRead for FilteredChunks {
    fn fill_buf(&mut self) -> Result<&[u8]> {
        while self.at == self.chunk.len() {
            // An error means that the filter has finished.
            let Ok(chunk) = self.chunks.recv() else { break };
            (self.chunk, self.at) = (chunk, 0);
        }
        Ok(&self.chunk[self.at..])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
    }
}

impl Read for FilteredChunks {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        let count = self.fill_buf()?.read(out)?;
        self.consume(count);
        Ok(count)
    }
}

/// The result of `tobj`.
type Parsed<T> = std::result::Result<T, tobj::LoadError>;

/// The result of `tobj` for a filtered file, and the filter with its records; the filter runs ahead in its own thread.
///
/// # Errors
/// The error message about an unreadable file.
pub(super) fn by_tobj<C: LineFilter + Send, T>(
    file: impl Read + Seek + Send,
    cleaner: C,
    parse: impl FnOnce(&mut FilteredChunks) -> Parsed<T>,
) -> std::result::Result<(Parsed<T>, C), String> {
    let (sender, chunks) = sync_channel(AHEAD);
    let mut cleaning = Cleaning::new(file, cleaner);
    let (parsed, read) = std::thread::scope(|scope| {
        let cleaning = &mut cleaning;
        let read = scope.spawn(move || {
            cleaning.run(|chunk| {
                // If `tobj` gives up, the filter continues, to report all problems.
                let _ = sender.send(chunk);
            })
        });
        let parsed = decoders::catch(|| parse(&mut FilteredChunks { chunks, chunk: Vec::new(), at: 0 }));
        (parsed, read.join().unwrap_or_else(|panic| resume_unwind(panic)))
    });
    read.map_err(|e| format!("can't be read: {e}"))?;
    Ok((parsed?, cleaning.cleaner))
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
    /// Everything after the words taken so far, without blanks around it; comments included.
    pub fn rest(&self) -> &'a [u8] {
        self.0.trim_ascii()
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let (word, rest) = next_word(self.0).filter(|(word, _)| word[0] != b'#')?;
        self.0 = rest;
        Some(word)
    }
}

/// Parses a number.
#[inline]
pub(super) fn float(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A number in double precision.
#[inline]
pub(super) fn double(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, SeekFrom};

    /// A reader that returns few bytes at a time.
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

    /// Repeats every line in brackets with its number; the whole file once more if so wanted.
    struct Echo(bool);

    impl LineFilter for Echo {
        fn line(&mut self, number: usize, text: &[u8], out: &mut Vec<u8>) {
            out.extend(format!("{number}[{}]", decoded(text)).bytes());
        }

        fn again(&mut self) -> bool {
            std::mem::take(&mut self.0)
        }
    }

    fn echo(bytes: &[u8], again: bool) -> String {
        let mut text = Vec::new();
        let mut cleaning = Cleaning::new(Drops(Cursor::new(bytes)), Echo(again));
        cleaning.run(|chunk| text.extend(chunk)).expect("it can be read");
        decoded(&text)
    }

    #[test]
    fn lines_end_in_every_way_and_go_on_behind_a_backslash() {
        let text = b"\xef\xbb\xbfa\nb \\\r\n c\\\n\nd\r\ne\rf\r\r# C:\\x\\\ng \\";
        assert_eq!(echo(text, false), "1[a]2[b   c ]5[d]6[e]7[f]8[]9[# C:\\x\\]10[g  ]");
        assert_eq!(echo(b"", false), "");
    }

    #[test]
    fn a_cleaner_may_see_the_file_twice() {
        assert_eq!(echo(b"\xef\xbb\xbfa\rb\nc\\", true), "1[a]2[b]3[c ]".repeat(2));
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
