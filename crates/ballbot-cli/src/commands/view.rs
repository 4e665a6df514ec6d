//! `ballbot view`: the browser page, served from the program itself.

use super::CommandError;
use crate::output;
use clap::Args;
use sha2::{Digest, Sha256};
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
    /// Port to listen on; 0 for any that is free
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
        // Nor is it answered while the system has no thread left.
        let _ = thread::Builder::new().spawn(move || answer(&stream));
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
    let lines = BufReader::new(stream.take(LONGEST_REQUEST)).lines();
    let lines: io::Result<Vec<String>> = lines
        .take_while(|line| !matches!(line, Ok(text) if text.is_empty()))
        .collect();
    let response = respond(&Request { lines: lines? });
    stream.write_all(&response)?;
    stream.flush()
}

/// The request line, then the headers.
struct Request {
    lines: Vec<String>,
}

impl Request {
    /// The content of a header; empty if it is not there.
    fn header(&self, name: &str) -> &str {
        let headers = self.lines.iter().skip(1);
        let mut fields = headers.filter_map(|line| line.split_once(':'));
        let found = fields.find(|(field, _)| field.eq_ignore_ascii_case(name));
        found.map_or("", |(_, content)| content.trim())
    }

    /// Whether the browser unpacks this encoding.
    fn unpacks(&self, encoding: &str) -> bool {
        self.header("Accept-Encoding").split(',').any(|offer| {
            let mut parts = offer.split(';').map(str::trim);
            let refused = |weight: &str| {
                let weight = weight.strip_prefix("q=").unwrap_or("1");
                weight.parse() == Ok(0.0)
            };
            parts.next() == Some(encoding) && !parts.any(refused)
        })
    }
}

/// Encodings in which the built page lies beside its files, the shortest first, and their endings.
const PACKED: [(&str, &str); 2] = [("br", ".br"), ("gzip", ".gz")];

/// A file of the page.
fn file(name: &str) -> Option<&'static [u8]> {
    let found = FILES.iter().find(|(file, _)| *file == name);
    found.map(|(_, content)| *content)
}

/// The response to a request.
fn respond(request: &Request) -> Vec<u8> {
    let mut words = request.lines.first().map_or("", String::as_str).split(' ');
    let (method, target) = (words.next(), words.next());
    let with_content = match method {
        Some("GET") => true,
        Some("HEAD") => false,
        _ => {
            return plain(
                "405 Method Not Allowed",
                "only GET and HEAD are answered\n",
                true,
            );
        }
    };
    let path = target.unwrap_or("/").split(['?', '#']).next();
    let name = match path {
        Some("/") | None => "index.html",
        Some(path) => path.trim_start_matches('/'),
    };
    let Some(content) = file(name) else {
        return plain("404 Not Found", "there is no such file\n", with_content);
    };
    let offered = PACKED
        .iter()
        .filter(|(encoding, _)| request.unpacks(encoding));
    let mut packed = offered
        .filter_map(|(encoding, ending)| Some((encoding, file(&format!("{name}{ending}"))?)));
    let (coding, content) = match packed.next() {
        Some((encoding, content)) => (format!("Content-Encoding: {encoding}\r\n"), content),
        None => (String::new(), content),
    };
    let tag = format!("\"{:x}\"", Sha256::digest(content));
    let about = format!(
        "Content-Type: {}\r\n{coding}Vary: Accept-Encoding\r\nETag: {tag}\r\n",
        media_type(name)
    );
    if request
        .header("If-None-Match")
        .split(',')
        .any(|known| known.trim() == tag)
    {
        return response("304 Not Modified", &about, &[], false);
    }
    response("200 OK", &about, content, with_content)
}

fn plain(status: &str, text: &str, with_content: bool) -> Vec<u8> {
    let about = "Content-Type: text/plain; charset=utf-8\r\n";
    response(status, about, text.as_bytes(), with_content)
}

/// `about` are the headers that tell of the content.
fn response(status: &str, about: &str, content: &[u8], with_content: bool) -> Vec<u8> {
    let length = match status {
        "304 Not Modified" => String::new(),
        _ => format!("Content-Length: {}\r\n", content.len()),
    };
    let head = format!("HTTP/1.1 {status}\r\n{about}{length}{HEADERS}\r\n");
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
        Some("txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(request: &str) -> String {
        text_with(request, &[])
    }

    fn text_with(request: &str, headers: &[&str]) -> String {
        let lines = std::iter::once(&request).chain(headers);
        let lines = lines.map(|line| (*line).to_owned()).collect();
        String::from_utf8_lossy(&respond(&Request { lines })).into_owned()
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
        for (target, status) in [("/", "200"), ("/nothing", "404")] {
            let answer = text(&format!("HEAD {target} HTTP/1.1"));
            assert!(
                answer.starts_with(&format!("HTTP/1.1 {status}")),
                "{answer}"
            );
            assert!(answer.ends_with("\r\n\r\n"), "{answer}");
        }
    }

    #[test]
    fn what_the_browser_has_already_is_not_sent_again() {
        let first = text("GET / HTTP/1.1");
        let tag = first.lines().find_map(|line| line.strip_prefix("ETag: "));
        let tag = tag.expect("an ETag");
        for known in [tag.to_owned(), format!("\"other\", {tag}")] {
            let again = text_with("GET / HTTP/1.1", &[&format!("if-none-match: {known}")]);
            assert!(again.starts_with("HTTP/1.1 304"), "{again}");
            assert!(again.ends_with("\r\n\r\n"), "{again}");
        }
        let other = text_with("GET / HTTP/1.1", &["If-None-Match: \"other\""]);
        assert!(other.starts_with("HTTP/1.1 200"), "{other}");
    }

    #[test]
    fn a_refused_encoding_is_not_offered() {
        let offers = |accepted: &str| {
            let lines = vec![String::new(), format!("Accept-Encoding: {accepted}")];
            let request = Request { lines };
            PACKED.map(|(encoding, _)| request.unpacks(encoding))
        };
        assert_eq!(offers("gzip, deflate, br"), [true, true]);
        assert_eq!(offers("br;q=0, gzip;q=0.5"), [false, true]);
        assert_eq!(offers("identity"), [false, false]);
    }

    #[cfg(feature = "page")]
    #[test]
    fn the_page_is_sent_packed() {
        let head = |accepted: &str| {
            let answer = text_with(
                "HEAD / HTTP/1.1",
                &[&format!("Accept-Encoding: {accepted}")],
            );
            let find = |name: &str| answer.lines().find_map(|line| line.strip_prefix(name));
            let length = find("Content-Length: ").expect("a length");
            let length: usize = length.parse().expect("a number");
            (find("Content-Encoding: ").unwrap_or("").to_owned(), length)
        };
        let (plain, whole) = head("identity");
        let (brotli, shortest) = head("gzip, deflate, br");
        let (gzip, short) = head("gzip");
        assert_eq!([plain.as_str(), &brotli, &gzip], ["", "br", "gzip"]);
        assert!(shortest < short && short < whole);
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
