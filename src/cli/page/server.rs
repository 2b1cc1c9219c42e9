//! Serves the page and what it asks for, on this machine only.
//!
//! Requests must name this machine as their host, so that no foreign name that leads here is served, must not come from
//! another site's pages, and must have the page's key in their path, which other users of this machine don't know.

use super::answer::{self, Answer};
use super::door::{Door, Way};
use super::http::{self, Answering, Request, Response};
use super::state::Shared;
use oscura::error::{Error, Result};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const HEADERS: [(&str, &str); 5] = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    (
        "Content-Security-Policy",
        "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    ),
];

/// A port of this machine that is taken, and the key of what is to be served there.
pub(crate) struct Server {
    listener: TcpListener,
    address: SocketAddr,
    door: Door,
}

/// Takes a port of this machine, 0 for any that is free.
///
/// # Errors
/// A usage error if it is taken.
pub(crate) fn bind(port: u16) -> Result<Server> {
    let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
    let taken = taken.and_then(|listener| listener.local_addr().map(|address| (listener, address)));
    let (listener, address) = taken.map_err(|e| {
        Error::usage(format!("port {port} of this machine can't be used: {e}"))
            .with_help("give another one by --port, or none for any that is free")
    })?;
    Ok(Server { listener, address, door: Door::new()? })
}

/// A page that is served until it is dropped.
pub(crate) struct Page {
    address: SocketAddr,
    is_over: Arc<AtomicBool>,
    /// What it shows.
    pub shared: Arc<Shared>,
}

impl Page {
    /// Serves a page, tells where it is, and opens it.
    pub fn open(server: Server, shared: Shared, opens: bool, is_quiet: bool) -> Page {
        let Server { listener, address, door } = server;
        let page = Page { address, is_over: Arc::default(), shared: Arc::new(shared) };
        let place = format!("http://{address}{}", door.page());
        if !is_quiet {
            say!("view     {place} (Ctrl-C ends it)");
        }
        let way_in = format!("http://{address}{}", door.way_in());
        let (is_over, shared) = (page.is_over.clone(), page.shared.clone());
        let answer = move |request: &Request| response(answered(request, address.port(), &door, &shared));
        let answer: Arc<Answering> = Arc::new(answer);
        std::thread::spawn(move || http::serve(&listener, &is_over, &answer));
        if opens && let Err(error) = open::that_detached(&way_in) {
            say!("no browser could be started ({error}): open {place} in one");
        }
        page
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.shared.end();
        self.is_over.store(true, Ordering::SeqCst);
        // The thread that accepts connections looks up at the next one.
        let _ = TcpStream::connect(self.address);
    }
}

fn answered(request: &Request, port: u16, door: &Door, shared: &Shared) -> Answer {
    if let Some(reason) = refusal(request, port) {
        return Answer::text(403, reason);
    }
    let url = match door.way(&request.target) {
        Way::To(url) => url,
        Way::Elsewhere(place) => return Answer { place: Some(place), ..Answer::text(303, "") },
        Way::Closed => return Answer::text(403, "open the address that the program printed"),
    };
    match (request.method.as_str(), std::str::from_utf8(&request.body)) {
        ("GET", _) => answer::get(url, shared),
        ("POST", Ok(body)) => answer::post(url, body, shared),
        ("POST", Err(_)) => Answer::text(400, "the body is not UTF-8 text"),
        _ => Answer::text(405, "only GET and POST"),
    }
}

/// Why a request isn't answered, if so.
fn refusal(request: &Request, port: u16) -> Option<&'static str> {
    let [host, origin, site] = ["host", "origin", "sec-fetch-site"].map(|name| request.header(name));
    refusal_of(host, origin, site, port)
}

fn refusal_of(
    host: Option<&str>,
    origin: Option<&str>,
    site: Option<&str>,
    port: u16,
) -> Option<&'static str> {
    let is_own = |host: &str| {
        ["127.0.0.1", "localhost"].into_iter().any(|own| match host.strip_prefix(own) {
            // The port that browsers leave out.
            Some("") => port == 80,
            Some(rest) => rest.strip_prefix(':') == Some(port.to_string().as_str()),
            None => false,
        })
    };
    if !host.is_some_and(is_own) {
        return Some("this page is served to this machine only, by the name 127.0.0.1 or localhost");
    }
    let is_own_page = |origin: &str| origin.strip_prefix("http://").is_some_and(is_own);
    if origin.is_some_and(|origin| !is_own_page(origin)) || matches!(site, Some("cross-site" | "same-site")) {
        return Some("requests from other sites' pages are not answered");
    }
    None
}

fn response(answer: Answer) -> Response {
    let mut headers: Vec<_> = HEADERS.iter().map(|(name, value)| (*name, value.to_string())).collect();
    headers.push(("Content-Type", answer.kind.to_string()));
    headers
        .extend(answer.name.map(|name| ("Content-Disposition", format!("attachment; filename=\"{name}\""))));
    headers.extend(answer.place.map(|place| ("Location", place)));
    Response { status: answer.status, headers, body: answer.body }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_and_its_own_page_are_answered() {
        let own = Some("127.0.0.1:8080");
        assert_eq!(refusal_of(own, None, None, 8080), None);
        let page = Some("http://localhost:8080");
        assert_eq!(refusal_of(Some("localhost:8080"), page, Some("same-origin"), 8080), None);
        assert_eq!(refusal_of(own, None, Some("none"), 8080), None);
        for host in [
            None,
            Some("evil.example"),
            Some("evil.example:8080"),
            Some("127.0.0.1:81"),
            Some("127.0.0.1"),
            Some("127.0.0.1:"),
            Some("127.0.0.1.evil.example:8080"),
        ] {
            assert!(refusal_of(host, None, None, 8080).is_some(), "{host:?}");
        }
        for origin in ["http://evil.example", "null", "https://127.0.0.1:8080", "http://127.0.0.1:80"] {
            assert!(refusal_of(own, Some(origin), None, 8080).is_some(), "{origin}");
        }
        assert!(refusal_of(own, None, Some("cross-site"), 8080).is_some());
    }

    #[test]
    fn browsers_leave_out_port_80() {
        for host in ["127.0.0.1", "localhost", "localhost:80"] {
            assert_eq!(refusal_of(Some(host), Some(&format!("http://{host}")), None, 80), None, "{host}");
        }
        for host in ["127.0.0.1:81", "localhost:", "evil.example"] {
            assert!(refusal_of(Some(host), None, None, 80).is_some(), "{host}");
        }
    }
}
