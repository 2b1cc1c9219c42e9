//! A small server of HTTP/1.1 (RFC 9112) over the standard library's sockets: one request a connection, answered in a thread
//! of its own. Whatever a client decides has a limit: how long a request is, how long it takes, how slowly an answer is
//! taken, and how many come at a time.

use std::collections::BTreeMap;
use std::io;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Maximum number of connections at a time; each has a thread.
const MAX_CONNECTIONS: usize = 64;
/// Longest request line with all its headers, and longest body, bytes.
const MAX_BYTES: usize = 1 << 16;
/// How long a request may take to arrive.
const READING: Duration = Duration::from_secs(5);
/// How long an answer may take to leave.
const WRITING: Duration = Duration::from_secs(30);
/// Bytes and time for reading the rest of a refused request: closing the socket earlier would discard the response.
const LINGERING: (usize, Duration) = (1 << 20, Duration::from_millis(500));
/// Between two tries to accept a connection where the system has no room for it.
const PAUSE: Duration = Duration::from_millis(50);

/// A request that has arrived in full.
pub(super) struct Request {
    pub method: String,
    /// Path and query.
    pub target: String,
    /// Names in small letters.
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Request {
    /// The value of a header, by its name in small letters.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str())
    }
}

/// A response. Content-Length and Connection are added when it is sent.
pub(super) struct Response {
    pub status: u16,
    pub headers: Vec<(&'static str, String)>,
    pub body: Vec<u8>,
}

/// Answers requests, in many threads.
pub(super) type Answering = dyn Fn(&Request) -> Response + Send + Sync;

/// Why a request is not answered as asked.
enum Flaw {
    /// The client is gone or too slow: nothing more is reported.
    Gone,
    /// Refused with a status and a reason.
    Refused(u16, &'static str),
}

impl From<io::Error> for Flaw {
    fn from(_: io::Error) -> Flaw {
        Flaw::Gone
    }
}

/// Answers until all is over, which is noticed with the next connection.
pub(super) fn serve(listener: &TcpListener, is_over: &AtomicBool, answer: &Arc<Answering>) {
    let open = Arc::new(Open::default());
    for (number, stream) in (0u64..).zip(listener.incoming()) {
        if is_over.load(Ordering::SeqCst) {
            return;
        }
        let Ok(stream) = stream else {
            std::thread::sleep(PAUSE);
            continue;
        };
        let Some(slot) = Slot::take(&open, number, &stream) else { continue };
        let answer = answer.clone();
        let work = move || {
            // A client that is gone is no loss.
            let _ = converse(stream, &slot, &*answer);
        };
        // If no thread can be started, the connection and its slot are dropped with the closure.
        let _ = std::thread::Builder::new().name("page".to_string()).spawn(work);
    }
}

/// The connections that are open, by their numbers.
#[derive(Default)]
struct Open(Mutex<BTreeMap<u64, Connection>>);

struct Connection {
    stream: TcpStream,
    /// Its request has not arrived yet.
    is_reading: bool,
}

impl Open {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Connection>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// A connection's place among those that may be open; it is free again when this is dropped, also by a panic.
struct Slot {
    open: Arc<Open>,
    number: u64,
}

impl Slot {
    /// Where all places are taken, the oldest connection that has not sent its request yet is closed; without one, there is
    /// no place.
    fn take(open: &Arc<Open>, number: u64, stream: &TcpStream) -> Option<Slot> {
        let stream = stream.try_clone().ok()?;
        let mut connections = open.lock();
        if connections.len() >= MAX_CONNECTIONS {
            let slow = connections.iter().find(|(_, connection)| connection.is_reading).map(|(n, _)| *n)?;
            if let Some(connection) = connections.remove(&slow) {
                // Its thread wakes up and ends.
                let _ = connection.stream.shutdown(Shutdown::Both);
            }
        }
        connections.insert(number, Connection { stream, is_reading: true });
        Some(Slot { open: open.clone(), number })
    }

    /// Says that the request has arrived in full. Returns whether the connection still has its place.
    fn request_arrived(&self) -> bool {
        match self.open.lock().get_mut(&self.number) {
            Some(connection) => {
                connection.is_reading = false;
                true
            }
            None => false,
        }
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.open.lock().remove(&self.number);
    }
}

fn converse(mut stream: TcpStream, slot: &Slot, answer: &Answering) -> io::Result<()> {
    stream.set_nodelay(true)?;
    match receive(&mut stream, Instant::now() + READING) {
        Ok(_) if !slot.request_arrived() => Ok(()),
        Ok(request) => send(&mut stream, &answer(&request), request.method == "HEAD"),
        Err(Flaw::Gone) => Ok(()),
        Err(Flaw::Refused(status, reason)) => {
            let headers = vec![("Content-Type", "text/plain; charset=utf-8".to_string())];
            send(&mut stream, &Response { status, headers, body: reason.into() }, false)?;
            stream.shutdown(Shutdown::Write)?;
            let (mut bytes, until) = (Vec::new(), Instant::now() + LINGERING.1);
            while bytes.len() < LINGERING.0 && more(&mut stream, &mut bytes, until).is_ok() {}
            Ok(())
        }
    }
}

/// Reads a request.
fn receive(stream: &mut TcpStream, until: Instant) -> Result<Request, Flaw> {
    let mut bytes = Vec::new();
    let mut searched = 0;
    let end = loop {
        let found = bytes[searched..].windows(4).position(|four| four == b"\r\n\r\n");
        if let Some(at) = found {
            break searched + at;
        }
        if bytes.len() > MAX_BYTES {
            return Err(Flaw::Refused(431, "the request's header is too long"));
        }
        searched = bytes.len().saturating_sub(3);
        more(stream, &mut bytes, until)?;
    };
    let mut body = bytes.split_off(end + 4);
    bytes.truncate(end);
    let mut request = parse(&bytes).ok_or(Flaw::Refused(400, "this is no request of HTTP/1.1"))?;
    if request.header("transfer-encoding").is_some() {
        return Err(Flaw::Refused(501, "bodies are taken by their length only"));
    }
    let length = request.header("content-length").map_or(Some(0), |text| {
        let is_number = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        // A length that overflows is too long.
        is_number.then(|| text.parse().unwrap_or(usize::MAX))
    });
    let length = length.ok_or(Flaw::Refused(400, "the body's length is no number"))?;
    if length > MAX_BYTES {
        return Err(Flaw::Refused(413, "the request's body is too long"));
    }
    while body.len() < length {
        more(stream, &mut body, until)?;
    }
    body.truncate(length);
    request.body = body;
    Ok(request)
}

/// Appends received bytes.
fn more(stream: &mut TcpStream, bytes: &mut Vec<u8>, until: Instant) -> Result<(), Flaw> {
    stream.set_read_timeout(Some(left(until)?))?;
    let mut chunk = [0; 4096];
    match stream.read(&mut chunk) {
        Ok(0) => Err(Flaw::Gone),
        Ok(length) => {
            bytes.extend(&chunk[..length]);
            Ok(())
        }
        Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
        Err(error) => Err(error.into()),
    }
}

fn left(until: Instant) -> io::Result<Duration> {
    let left = until.saturating_duration_since(Instant::now());
    if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
}

/// The request line and the headers; `None` for what RFC 9112 doesn't allow.
fn parse(head: &[u8]) -> Option<Request> {
    let mut lines = std::str::from_utf8(head).ok()?.split("\r\n");
    let words: Vec<&str> = lines.next()?.split(' ').collect();
    let [method, target, version] = words[..] else { return None };
    if method.is_empty() || !target.starts_with('/') || !matches!(version, "HTTP/1.0" | "HTTP/1.1") {
        return None;
    }
    let is_of_name = |b: u8| b.is_ascii_alphanumeric() || b"!#$%&'*+-.^_`|~".contains(&b);
    let header = |line: &str| {
        let (name, value) = line.split_once(':').filter(|(name, _)| !name.is_empty())?;
        let value = value.trim_matches([' ', '\t']);
        let is_sound = name.bytes().all(is_of_name) && !value.contains(['\r', '\n', '\0']);
        is_sound.then(|| (name.to_ascii_lowercase(), value.to_string()))
    };
    let headers: Vec<_> = lines.map(header).collect::<Option<_>>()?;
    let count = |name: &str| headers.iter().filter(|(own, _)| own == name).count();
    if count("host") > 1 || count("content-length") > 1 {
        return None;
    }
    Some(Request { method: method.to_string(), target: target.to_string(), headers, body: Vec::new() })
}

/// Sends an answer, without its body if only the head is asked for.
fn send(stream: &mut TcpStream, response: &Response, is_head_only: bool) -> io::Result<()> {
    let Response { status, headers, body } = response;
    let mut head = format!("HTTP/1.1 {status} {}\r\nConnection: close\r\n", reason(*status));
    if *status != 204 {
        head += &format!("Content-Length: {}\r\n", body.len());
    }
    headers.iter().for_each(|(name, value)| head += &format!("{name}: {value}\r\n"));
    head += "\r\n";
    let until = Instant::now() + WRITING;
    write(stream, head.as_bytes(), until)?;
    if is_head_only { Ok(()) } else { write(stream, body, until) }
}

/// Writes in parts, so that who takes them slowly doesn't get more time for each.
fn write(stream: &mut TcpStream, mut bytes: &[u8], until: Instant) -> io::Result<()> {
    while !bytes.is_empty() {
        stream.set_write_timeout(Some(left(until)?))?;
        match stream.write(&bytes[..bytes.len().min(1 << 18)]) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(length) => bytes = &bytes[length..],
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        204 => "No Content",
        303 => "See Other",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        413 => "Content Too Large",
        431 => "Request Header Fields Too Large",
        501 => "Not Implemented",
        _ => "Error",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_parsed() {
        let request =
            parse(b"POST /set?a=1 HTTP/1.1\r\nHost: a\r\nX-Y:\t b c \r\nEmpty:").expect("a request");
        assert_eq!((request.method.as_str(), request.target.as_str()), ("POST", "/set?a=1"));
        assert_eq!(request.header("host"), Some("a"));
        assert_eq!((request.header("x-y"), request.header("empty")), (Some("b c"), Some("")));
        assert_eq!(request.header("other"), None);
    }

    #[test]
    fn malformed_requests_are_refused() {
        for text in [
            "",
            "GET /",
            "GET  / HTTP/1.1",
            "GET / HTTP/2.0",
            "GET http://evil/ HTTP/1.1",
            "GET / HTTP/1.1\r\nno colon",
            "GET / HTTP/1.1\r\nHost : a",
            "GET / HTTP/1.1\r\nA: b\r\n folded: c",
            "GET / HTTP/1.1\r\nHost: a\r\nHost: b",
            "GET / HTTP/1.1\r\nContent-Length: 1\r\nContent-length: 2",
            "GET / HTTP/1.1\r\nA: b\nHost: c",
        ] {
            assert!(parse(text.as_bytes()).is_none(), "{text:?}");
        }
    }
}
