//! `ballbot view`: the browser page, served from the program itself.

use super::CommandError;
use crate::output;
use clap::Args;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::thread;
use std::time::Duration;

/// Arguments of `ballbot view`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ballbot view               then open the address that is printed
  ballbot view --port 0      on any free port

Only this machine can reach the page; it loads nothing from elsewhere. Ctrl-C ends it.")]
pub struct ViewArguments {
    /// Port to listen at; 0 for any that is free
    #[arg(long, default_value_t = 8017)]
    pub port: u16,
}

/// The page could not be served.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The port cannot be listened at.
    #[error("cannot listen at port {port} of this machine: {source}; choose another with --port")]
    Listen {
        /// The port.
        port: u16,
        /// What the system said.
        source: io::Error,
    },
}

/// Name and content of each file of the page.
#[cfg(feature = "page")]
static FILES: &[(&str, &[u8])] = &include!(concat!(env!("OUT_DIR"), "/page.in"));

/// Without the feature `page`, a page that says how to get it.
#[cfg(not(feature = "page"))]
static FILES: &[(&str, &[u8])] = &[(
    "index.html",
    b"<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Ballbot</title>\
      <h1>This program was built without its page</h1><p>With Node 20 or later: \
      <code>cd web &amp;&amp; npm ci &amp;&amp; npm run build</code>, then \
      <code>cargo build --release --features page</code>.</p></html>",
)];

/// Nothing from elsewhere, no inline code; `wasm-unsafe-eval` lets WebAssembly be compiled. The
/// last two headers give the page the finer clock that browsers keep for isolated pages.
const HEADERS: &str = "\
Content-Security-Policy: default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; \
style-src 'self'; img-src 'self' data:; connect-src 'self'; worker-src 'self'; base-uri 'none'; \
form-action 'none'; frame-ancestors 'none'\r
X-Content-Type-Options: nosniff\r
Referrer-Policy: no-referrer\r
Cache-Control: no-cache\r
Cross-Origin-Opener-Policy: same-origin\r
Cross-Origin-Embedder-Policy: require-corp\r
Cross-Origin-Resource-Policy: same-origin\r
Connection: close\r
";

/// Serves the page until the program is ended.
///
/// # Errors
/// The port cannot be listened at.
pub fn run(arguments: &ViewArguments) -> Result<String, CommandError> {
    let port = arguments.port;
    let failed = |source| ViewError::Listen { port, source };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    output::print(&format!("http://{address}/  (Ctrl-C ends)\n"));
    if cfg!(not(feature = "page")) {
        output::warn(
            "this program was built without the page, and serves only a note that says so. With Node \
             20 or later: `cd web && npm ci && npm run build`, then `cargo build --release -p \
             ballbot-cli --features page`, and view again",
        );
    }
    for stream in listener.incoming().flatten() {
        // Who goes away before the answer is complete does not need it.
        thread::spawn(move || answer(&stream));
    }
    Ok(String::new())
}

/// A request line and its headers are not longer than this, bytes.
const LONGEST_REQUEST: u64 = 16_384;
/// Who is silent for this long is left, s.
const PATIENCE: Duration = Duration::from_secs(10);

fn answer(mut stream: &TcpStream) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut lines = BufReader::new(stream.take(LONGEST_REQUEST)).lines();
    let request = lines.next().transpose()?.unwrap_or_default();
    for line in lines {
        if line?.is_empty() {
            break;
        }
    }
    let response = respond(&request);
    stream.write_all(&response)?;
    stream.flush()
}

/// The response to a request line.
fn respond(request: &str) -> Vec<u8> {
    let mut words = request.split(' ');
    let (method, target) = (words.next(), words.next());
    let with_content = match method {
        Some("GET") => true,
        Some("HEAD") => false,
        _ => return plain("405 Method Not Allowed", "only GET and HEAD are answered\n"),
    };
    let path = target.unwrap_or("/").split(['?', '#']).next();
    let name = match path {
        Some("/") | None => "index.html",
        Some(path) => path.trim_start_matches('/'),
    };
    match FILES.iter().find(|(file, _)| *file == name) {
        Some((_, content)) => response("200 OK", media_type(name), content, with_content),
        None => plain("404 Not Found", "there is no such file\n"),
    }
}

fn plain(status: &str, text: &str) -> Vec<u8> {
    response(status, "text/plain; charset=utf-8", text.as_bytes(), true)
}

fn response(status: &str, media_type: &str, content: &[u8], with_content: bool) -> Vec<u8> {
    let length = content.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {media_type}\r\nContent-Length: {length}\r\n\
         {HEADERS}\r\n"
    );
    let mut bytes = head.into_bytes();
    if with_content {
        bytes.extend_from_slice(content);
    }
    bytes
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("wasm") => "application/wasm",
        Some("svg") => "image/svg+xml",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(request: &str) -> String {
        String::from_utf8_lossy(&respond(request)).into_owned()
    }

    #[test]
    fn the_page_comes_with_its_policy() {
        let answer = text("GET /?flat HTTP/1.1");
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/html"));
        assert!(answer.contains("Content-Security-Policy: default-src 'none';"));
        assert!(answer.contains("<!doctype html>"));
    }

    #[test]
    fn a_head_has_no_content() {
        assert!(text("HEAD / HTTP/1.1").ends_with("\r\n\r\n"));
    }

    #[test]
    fn nothing_but_the_page_can_be_read() {
        for path in [
            "/../Cargo.toml",
            "//etc/passwd",
            "/%2e%2e/secret",
            "/nothing",
        ] {
            let answer = text(&format!("GET {path} HTTP/1.1"));
            assert!(answer.starts_with("HTTP/1.1 404"), "{path}: {answer}");
        }
    }

    #[test]
    fn other_methods_are_refused() {
        for request in ["POST / HTTP/1.1", "", "nonsense"] {
            assert!(text(request).starts_with("HTTP/1.1 405"), "{request}");
        }
    }
}
