//! Lines of OBJ and MTL files: removes a byte order mark, accepts all line ends, joins lines continued by `\`, and applies a
//! filter before `tobj` parses them.

use crate::load::decoders;
use crate::load::files::ModelReader;
use crate::load::words::next_word;
use crate::work_counter::WorkCounter;
use memchr::memchr;
use std::io::{BufRead, ErrorKind, Read, Result, Seek, SeekFrom};
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, sync_channel};

/// Bytes to read at a time: the whole file is never in memory.
const CHUNK: usize = 1 << 18;

/// Maximum number of filtered chunks that wait for `tobj`.
const MAX_QUEUED: usize = 4;

/// A reader that reports progress.
pub(super) struct CountedReader<'a> {
    file: ModelReader,
    counter: &'a WorkCounter,
}

impl<'a> CountedReader<'a> {
    /// Reads a file from its current position.
    pub fn new(file: ModelReader, counter: &'a WorkCounter) -> CountedReader<'a> {
        // Pipes have no length, so no progress.
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
    /// Appends the filtered line to `out`. `number`, from 1, is that of the first of joined lines.
    fn line(&mut self, number: usize, text: &[u8], out: &mut Vec<u8>);

    /// Whether reading should stop.
    fn is_finished(&self) -> bool {
        false
    }

    /// Called at the end of a pass; returns whether another pass is needed.
    fn needs_next_pass(&mut self) -> bool {
        false
    }
}

/// Passes the lines of a file through a filter.
struct FilteredLines<R, C> {
    file: R,
    filter: C,
    /// Number of lines so far.
    number: usize,
    /// Number of the first line and text of lines joined by `\`.
    joined: (usize, Vec<u8>),
    out: Vec<u8>,
}

impl<R: Read + Seek, C: LineFilter> FilteredLines<R, C> {
    fn new(file: R, filter: C) -> FilteredLines<R, C> {
        FilteredLines { file, filter, number: 0, joined: (0, Vec::new()), out: Vec::new() }
    }

    /// Filters the file and calls `emit` with chunks of it.
    fn run(&mut self, mut emit: impl FnMut(Vec<u8>)) -> Result<()> {
        // `rest` is the length of the incomplete line at the start of the buffer.
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
                self.split_line(&buffer[start..from + length]);
                start = from + length + 1;
                from = start;
                if self.out.len() >= CHUNK {
                    emit(std::mem::take(&mut self.out));
                }
                if self.filter.is_finished() {
                    return Ok(());
                }
            }
            buffer.copy_within(start..end, 0);
            rest = end - start;
            if count > 0 {
                continue;
            }
            if rest > 0 {
                self.split_line(&buffer[..rest]);
            }
            self.end_joined();
            if !self.filter.needs_next_pass() {
                emit(std::mem::take(&mut self.out));
                return Ok(());
            }
            self.file.rewind()?;
            (self.number, rest) = (0, 0);
        }
    }

    /// Handles a line up to `\n`, which may be several lines separated by `\r`.
    fn split_line(&mut self, raw: &[u8]) {
        let text = raw.strip_suffix(b"\r").unwrap_or(raw);
        let is_first = self.number == 0;
        let text = text.strip_prefix(b"\xef\xbb\xbf").filter(|_| is_first).unwrap_or(text);
        // `memchr` is faster than splitting, and `\r` is rare.
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
        // Paths in comments may end in a backslash.
        let is_comment = joined.is_empty() && text.trim_ascii_start().starts_with(b"#");
        match text.strip_suffix(b"\\") {
            Some(start) if !is_comment => joined.extend(start.iter().chain(b" ")),
            _ if joined.is_empty() => self.filter.line(self.number, text, &mut self.out),
            _ => {
                joined.extend(text);
                self.end_joined();
            }
        }
    }

    fn end_joined(&mut self) {
        let (first, joined) = &mut self.joined;
        if !joined.is_empty() {
            self.filter.line(*first, joined, &mut self.out);
            joined.clear();
        }
    }
}

/// Passes all lines of a file to a filter and returns it; its output is discarded.
pub(super) fn each_line<C: LineFilter>(file: impl Read + Seek, filter: C) -> Result<C> {
    let mut filtered = FilteredLines::new(file, filter);
    filtered.run(|_| {})?;
    Ok(filtered.filter)
}

/// Reader of the chunks of a file that another thread filters.
pub(super) struct FilteredChunks {
    chunks: Receiver<Vec<u8>>,
    chunk: Vec<u8>,
    at: usize,
}

impl BufRead for FilteredChunks {
    fn fill_buf(&mut self) -> Result<&[u8]> {
        while self.at == self.chunk.len() {
            // An error means that the filter thread has finished.
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

type Parsed<T> = std::result::Result<T, tobj::LoadError>;

/// Parses a filtered file by `tobj`; also returns the filter. The filter runs in its own thread.
///
/// # Errors
/// The error message about an unreadable file.
pub(super) fn parse_by_tobj<C: LineFilter + Send, T>(
    file: impl Read + Seek + Send,
    filter: C,
    parse: impl FnOnce(&mut FilteredChunks) -> Parsed<T>,
) -> std::result::Result<(Parsed<T>, C), String> {
    let (sender, chunks) = sync_channel(MAX_QUEUED);
    let mut filtered = FilteredLines::new(file, filter);
    let (parsed, read) = std::thread::scope(|scope| {
        let filtered = &mut filtered;
        let read = scope.spawn(move || {
            filtered.run(|chunk| {
                // The filter continues after errors of `tobj`, to report all problems.
                let _ = sender.send(chunk);
            })
        });
        let parsed =
            decoders::catch_panic(|| parse(&mut FilteredChunks { chunks, chunk: Vec::new(), at: 0 }));
        (parsed, read.join().unwrap_or_else(|panic| resume_unwind(panic)))
    });
    read.map_err(|e| format!("can't be read: {e}"))?;
    Ok((parsed?, filtered.filter))
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
    /// The remaining text without surrounding white space, comments included.
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

    /// A reader that returns three bytes at a time.
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

    /// Outputs each line in brackets with its number; reads the file twice if true.
    struct Echo(bool);

    impl LineFilter for Echo {
        fn line(&mut self, number: usize, text: &[u8], out: &mut Vec<u8>) {
            out.extend(format!("{number}[{}]", decoded(text)).bytes());
        }

        fn needs_next_pass(&mut self) -> bool {
            std::mem::take(&mut self.0)
        }
    }

    fn echo(bytes: &[u8], again: bool) -> String {
        let mut text = Vec::new();
        let mut filtered = FilteredLines::new(Drops(Cursor::new(bytes)), Echo(again));
        filtered.run(|chunk| text.extend(chunk)).expect("it can be read");
        decoded(&text)
    }

    #[test]
    fn all_line_ends_and_continuation_lines_are_accepted() {
        let text = b"\xef\xbb\xbfa\nb \\\r\n c\\\n\nd\r\ne\rf\r\r# C:\\x\\\ng \\";
        assert_eq!(echo(text, false), "1[a]2[b   c ]5[d]6[e]7[f]8[]9[# C:\\x\\]10[g  ]");
        assert_eq!(echo(b"", false), "");
    }

    #[test]
    fn a_filter_may_request_a_second_pass() {
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
