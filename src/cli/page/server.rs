//! Serves the page and what it asks for, on this machine only.
//!
//! Requests must name this machine as their host, so that no foreign name that leads here is served, and must not come from
//! another site's pages.

use super::answer::{self, Answer};
use super::state::Shared;
use oscura::error::{Error, Result};
use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use tiny_http::{Header, Method, Request, Response, Server};

/// Most requests at a time; each has a thread.
const MOST_REQUESTS: usize = 64;
/// Longest body of a request, bytes.
const MOST_BYTES: u64 = 1 << 16;

const HEADERS: [(&str, &str); 4] = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    (
        "Content-Security-Policy",
        "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    ),
];

/// Takes a port of this machine, 0 for any that is free.
///
/// # Errors
/// A usage error if it is taken.
pub(crate) fn bind(port: u16) -> Result<Server> {
    Server::http(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).map_err(|e| {
        Error::usage(format!("port {port} of this machine can't be used: {e}"))
            .with_help("give another one by --port, or none for any that is free")
    })
}

fn port(server: &Server) -> u16 {
    server.server_addr().to_ip().map_or(0, |address| address.port())
}

/// A page that is served until it is dropped.
pub(crate) struct Page {
    server: Arc<Server>,
    /// What it shows.
    pub shared: Arc<Shared>,
}

impl Page {
    /// Serves a page, tells where it is, and opens it.
    pub fn open(server: Server, shared: Shared, opens: bool, is_quiet: bool) -> Page {
        let page = Page { server: Arc::new(server), shared: Arc::new(shared) };
        let address = format!("http://127.0.0.1:{}/", port(&page.server));
        if !is_quiet {
            say!("view     {address} (Ctrl-C ends it)");
        }
        if opens && let Err(error) = open::that_detached(&address) {
            say!("no browser could be started ({error}): open {address} in one");
        }
        let (server, shared) = (page.server.clone(), page.shared.clone());
        std::thread::spawn(move || serve(&server, &shared));
        page
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.shared.end();
        self.server.unblock();
    }
}

/// Answers until the server is unblocked.
fn serve(server: &Server, shared: &Arc<Shared>) {
    let port = port(server);
    let under_way = Arc::new(AtomicUsize::new(0));
    for request in server.incoming_requests() {
        if under_way.fetch_add(1, Ordering::SeqCst) >= MOST_REQUESTS {
            under_way.fetch_sub(1, Ordering::SeqCst);
            respond(request, Answer::text(503, "too many requests at a time"));
            continue;
        }
        let (under_way, shared) = (under_way.clone(), shared.clone());
        std::thread::spawn(move || {
            handle(request, port, &shared);
            under_way.fetch_sub(1, Ordering::SeqCst);
        });
    }
}

fn handle(mut request: Request, port: u16, shared: &Shared) {
    let answer = match refusal(&request, port) {
        Some(reason) => Answer::text(403, reason),
        None => {
            let mut body = String::new();
            let url = request.url().to_string();
            let method = request.method().clone();
            let is_read = request.as_reader().take(MOST_BYTES).read_to_string(&mut body).is_ok();
            match (method, is_read) {
                (Method::Get, _) => answer::get(&url, shared),
                (Method::Post, true) => answer::post(&url, &body, shared),
                _ => Answer::text(405, "only GET and POST"),
            }
        }
    };
    respond(request, answer);
}

/// Why a request isn't answered, if so.
fn refusal(request: &Request, port: u16) -> Option<&'static str> {
    let header = |name: &str| {
        let is_it = |h: &&Header| h.field.as_str().as_str().eq_ignore_ascii_case(name);
        request.headers().iter().find(is_it).map(|h| h.value.as_str())
    };
    refusal_of(header("Host"), header("Origin"), header("Sec-Fetch-Site"), port)
}

fn refusal_of(
    host: Option<&str>,
    origin: Option<&str>,
    site: Option<&str>,
    port: u16,
) -> Option<&'static str> {
    let hosts = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !hosts.iter().any(|own| host == Some(own)) {
        return Some("this page is served to this machine only, by the name 127.0.0.1 or localhost");
    }
    let is_own =
        |origin: &str| origin.strip_prefix("http://").is_some_and(|host| hosts.iter().any(|own| own == host));
    if origin.is_some_and(|origin| !is_own(origin)) || matches!(site, Some("cross-site" | "same-site")) {
        return Some("requests from other sites' pages are not answered");
    }
    None
}

fn respond(request: Request, answer: Answer) {
    let header = |name: &str, value: &str| Header::from_bytes(name, value).ok();
    let mut response = Response::from_data(answer.body).with_status_code(answer.status);
    let own = HEADERS.iter().filter_map(|(name, value)| header(name, value));
    let more = answer
        .name
        .and_then(|name| header("Content-Disposition", &format!("attachment; filename=\"{name}\"")));
    for header in own.chain(header("Content-Type", answer.kind)).chain(more) {
        response.add_header(header);
    }
    // A page that was closed meanwhile is no loss.
    let _ = request.respond(response);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_and_its_own_page_are_answered() {
        let own = Some("127.0.0.1:80");
        assert_eq!(refusal_of(own, None, None, 80), None);
        assert_eq!(
            refusal_of(Some("localhost:80"), Some("http://localhost:80"), Some("same-origin"), 80),
            None
        );
        assert_eq!(refusal_of(own, None, Some("none"), 80), None);
        for host in
            [None, Some("evil.example"), Some("evil.example:80"), Some("127.0.0.1:81"), Some("127.0.0.1")]
        {
            assert!(refusal_of(host, None, None, 80).is_some(), "{host:?}");
        }
        for origin in ["http://evil.example", "null", "https://127.0.0.1:80", "http://127.0.0.1:8080"] {
            assert!(refusal_of(own, Some(origin), None, 80).is_some(), "{origin}");
        }
        assert!(refusal_of(own, None, Some("cross-site"), 80).is_some());
    }
}
