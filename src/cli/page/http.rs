//! A small HTTP/1.1 server (RFC 9112) on the standard library's sockets: one request per connection, one thread per connection.
//! Sizes of requests, times of receiving and sending, and the number of connections are limited.

use std::collections::BTreeMap;
use std::io;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Maximum number of concurrent connections.
const MAX_CONNECTIONS: usize = 64;
/// Maximum size of the request line with all headers, and of the body, bytes.
const MAX_BYTES: usize = 1 << 16;
/// Timeout of receiving a request.
const RECEIVE_TIMEOUT: Duration = Duration::from_secs(5);
/// Timeout of sending a response.
const SEND_TIMEOUT: Duration = Duration::from_secs(30);
/// Maximum bytes and time for reading the rest of a refused request: closing the socket earlier would discard the response.
const MAX_DISCARDED_BYTES: usize = 1 << 20;
const DISCARD_TIME: Duration = Duration::from_millis(500);
/// Time between two attempts after a connection could not be accepted.
const RETRY_INTERVAL: Duration = Duration::from_millis(50);

/// A complete request.
pub(super) struct Request {
    pub method: String,
    /// Path and query.
    pub target: String,
    /// Names in lower case.
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Request {
    /// The value of a header; `name` in lower case.
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

/// Handles requests, in several threads.
pub(super) type Handler = dyn Fn(&Request) -> Response + Send + Sync;

enum ReceiveError {
    /// The client is gone or too slow: no response is sent.
    Gone,
    /// The request is refused with a status and a reason.
    Refused(u16, &'static str),
}

impl From<io::Error> for ReceiveError {
    fn from(_: io::Error) -> ReceiveError {
        ReceiveError::Gone
    }
}

/// Serves until `is_stopped`, which is checked at the next connection.
pub(super) fn serve(listener: &TcpListener, is_stopped: &AtomicBool, answer: &Arc<Handler>) {
    let open = Arc::new(Open::default());
    for (number, stream) in (0u64..).zip(listener.incoming()) {
        if is_stopped.load(Ordering::SeqCst) {
            return;
        }
        let Ok(stream) = stream else {
            std::thread::sleep(RETRY_INTERVAL);
            continue;
        };
        let Some(slot) = Slot::reserve(&open, number, &stream) else { continue };
        let answer = answer.clone();
        let work = move || {
            // Errors of clients that are gone are ignored.
            let _ = handle_connection(stream, &slot, &*answer);
        };
        // If no thread can be started, the connection and its slot are dropped with the closure.
        let _ = std::thread::Builder::new().name("page".to_string()).spawn(work);
    }
}

/// The open connections, by number.
#[derive(Default)]
struct Open(Mutex<BTreeMap<u64, Connection>>);

struct Connection {
    stream: TcpStream,
    /// The request is not complete yet.
    is_reading: bool,
}

impl Open {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Connection>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// One of the allowed connections; freed on drop, also by a panic.
struct Slot {
    open: Arc<Open>,
    number: u64,
}

impl Slot {
    /// Reserves a slot. If all are in use, closes the oldest connection without a complete request; `None` without one.
    fn reserve(open: &Arc<Open>, number: u64, stream: &TcpStream) -> Option<Slot> {
        let stream = stream.try_clone().ok()?;
        let mut connections = open.lock();
        if connections.len() >= MAX_CONNECTIONS {
            let slow = connections.iter().find(|(_, connection)| connection.is_reading).map(|(n, _)| *n)?;
            if let Some(connection) = connections.remove(&slow) {
                // The read in its thread fails, and the thread ends.
                let _ = connection.stream.shutdown(Shutdown::Both);
            }
        }
        connections.insert(number, Connection { stream, is_reading: true });
        Some(Slot { open: open.clone(), number })
    }

    /// Marks the request as complete. Returns false if the connection has lost its slot.
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

fn handle_connection(mut stream: TcpStream, slot: &Slot, answer: &Handler) -> io::Result<()> {
    stream.set_nodelay(true)?;
    match receive(&mut stream, Instant::now() + RECEIVE_TIMEOUT) {
        Ok(_) if !slot.request_arrived() => Ok(()),
        Ok(request) => send(&mut stream, &answer(&request), request.method == "HEAD"),
        Err(ReceiveError::Gone) => Ok(()),
        Err(ReceiveError::Refused(status, reason)) => {
            let headers = vec![("Content-Type", "text/plain; charset=utf-8".to_string())];
            send(&mut stream, &Response { status, headers, body: reason.into() }, false)?;
            stream.shutdown(Shutdown::Write)?;
            let (mut bytes, until) = (Vec::new(), Instant::now() + DISCARD_TIME);
            while bytes.len() < MAX_DISCARDED_BYTES && receive_some(&mut stream, &mut bytes, until).is_ok() {}
            Ok(())
        }
    }
}

/// Reads a request.
fn receive(stream: &mut TcpStream, until: Instant) -> Result<Request, ReceiveError> {
    let mut bytes = Vec::new();
    let mut searched = 0;
    let end = loop {
        let found = bytes[searched..].windows(4).position(|four| four == b"\r\n\r\n");
        if let Some(at) = found {
            break searched + at;
        }
        if bytes.len() > MAX_BYTES {
            return Err(ReceiveError::Refused(431, "the request's header is too long"));
        }
        searched = bytes.len().saturating_sub(3);
        receive_some(stream, &mut bytes, until)?;
    };
    let mut body = bytes.split_off(end + 4);
    bytes.truncate(end);
    let mut request = parse(&bytes).ok_or(ReceiveError::Refused(400, "this is not an HTTP/1.1 request"))?;
    if request.header("transfer-encoding").is_some() {
        return Err(ReceiveError::Refused(501, "only bodies with Content-Length are supported"));
    }
    let length = request.header("content-length").map_or(Some(0), |text| {
        let is_number = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
        // Overflow means too long.
        is_number.then(|| text.parse().unwrap_or(usize::MAX))
    });
    let length = length.ok_or(ReceiveError::Refused(400, "Content-Length is not a number"))?;
    if length > MAX_BYTES {
        return Err(ReceiveError::Refused(413, "the request's body is too long"));
    }
    while body.len() < length {
        receive_some(stream, &mut body, until)?;
    }
    body.truncate(length);
    request.body = body;
    Ok(request)
}

/// Appends received bytes.
fn receive_some(stream: &mut TcpStream, bytes: &mut Vec<u8>, until: Instant) -> Result<(), ReceiveError> {
    stream.set_read_timeout(Some(remaining(until)?))?;
    let mut chunk = [0; 4096];
    match stream.read(&mut chunk) {
        Ok(0) => Err(ReceiveError::Gone),
        Ok(length) => {
            bytes.extend(&chunk[..length]);
            Ok(())
        }
        Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
        Err(error) => Err(error.into()),
    }
}

fn remaining(until: Instant) -> io::Result<Duration> {
    let remaining = until.saturating_duration_since(Instant::now());
    if remaining.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(remaining) }
}

/// Parses the request line and the headers; `None` if RFC 9112 doesn't allow them.
fn parse(head: &[u8]) -> Option<Request> {
    let mut lines = std::str::from_utf8(head).ok()?.split("\r\n");
    let words: Vec<&str> = lines.next()?.split(' ').collect();
    let [method, target, version] = words[..] else { return None };
    if method.is_empty() || !target.starts_with('/') || !matches!(version, "HTTP/1.0" | "HTTP/1.1") {
        return None;
    }
    let is_token = |b: u8| b.is_ascii_alphanumeric() || b"!#$%&'*+-.^_`|~".contains(&b);
    let header = |line: &str| {
        let (name, value) = line.split_once(':').filter(|(name, _)| !name.is_empty())?;
        let value = value.trim_matches([' ', '\t']);
        let is_valid = name.bytes().all(is_token) && !value.contains(['\r', '\n', '\0']);
        is_valid.then(|| (name.to_ascii_lowercase(), value.to_string()))
    };
    let headers: Vec<_> = lines.map(header).collect::<Option<_>>()?;
    let count = |name: &str| headers.iter().filter(|(own, _)| own == name).count();
    if count("host") > 1 || count("content-length") > 1 {
        return None;
    }
    Some(Request { method: method.to_string(), target: target.to_string(), headers, body: Vec::new() })
}

/// Sends a response, without the body for HEAD requests.
fn send(stream: &mut TcpStream, response: &Response, is_head_only: bool) -> io::Result<()> {
    let Response { status, headers, body } = response;
    let mut head = format!("HTTP/1.1 {status} {}\r\nConnection: close\r\n", reason(*status));
    if *status != 204 {
        head += &format!("Content-Length: {}\r\n", body.len());
    }
    headers.iter().for_each(|(name, value)| head += &format!("{name}: {value}\r\n"));
    head += "\r\n";
    let until = Instant::now() + SEND_TIMEOUT;
    write(stream, head.as_bytes(), until)?;
    if is_head_only { Ok(()) } else { write(stream, body, until) }
}

/// Writes in chunks, so that the timeout applies to the whole response.
fn write(stream: &mut TcpStream, mut bytes: &[u8], until: Instant) -> io::Result<()> {
    while !bytes.is_empty() {
        stream.set_write_timeout(Some(remaining(until)?))?;
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
