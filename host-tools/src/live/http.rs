//! HTTP/1.1 (RFC 9112) as far as a page needs it: one request for each connection, and its answer.
//!
//! `httparse` reads the head. A framework for servers would bring an executor and thirty other crates for four routes.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

use httparse::{EMPTY_HEADER, Status};

/// Of a request with its body: a browser's head has about 700 bytes.
const REQUEST_BYTES_MAX: usize = 8 * 1024;
/// Fields of a request's head; a browser sends about 15.
const FIELDS_MAX: usize = 64;

/// Our scripts and styles, no inline code, no frame around the page.
const FIXED: &str = "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                     img-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
                     X-Content-Type-Options: nosniff\r\n\
                     Referrer-Policy: no-referrer\r\n\
                     Cache-Control: no-store\r\n\
                     Cross-Origin-Resource-Policy: same-origin\r\n\
                     Cross-Origin-Opener-Policy: same-origin\r\n\
                     Connection: close\r\n";

/// A whole request.
#[derive(Debug, PartialEq)]
pub struct Request {
    /// For instance `GET`.
    pub method: String,
    /// Without the query.
    pub path: String,
    /// After the `?`.
    query: String,
    /// By name in lower case; values of one name are joined.
    fields: Vec<(String, String)>,
    /// As long as `Content-Length` says.
    pub body: Vec<u8>,
}

impl Request {
    /// Reads one within `limit`; otherwise the status to answer.
    pub fn read(from: &mut impl Read, limit: Duration) -> Result<Self, &'static str> {
        let (start, mut bytes) = (Instant::now(), Vec::new());
        while start.elapsed() < limit {
            let mut piece = [0; 1_024];
            let Ok(got @ 1..) = from.read(&mut piece) else { break };
            bytes.extend_from_slice(piece.get(..got).unwrap_or_default());
            if let Some(request) = Self::parse(&bytes)? {
                return Ok(request);
            }
            if bytes.len() > REQUEST_BYTES_MAX {
                return Err("413 Content Too Large");
            }
        }
        Err("408 Request Timeout")
    }

    /// `None` if it goes on after these bytes.
    fn parse(bytes: &[u8]) -> Result<Option<Self>, &'static str> {
        let mut fields = [EMPTY_HEADER; FIELDS_MAX];
        let mut head = httparse::Request::new(&mut fields);
        let Status::Complete(length) = head.parse(bytes).map_err(|_| "400 Bad Request")? else {
            return Ok(None);
        };
        let (path, query) = head.path.map_or(("", ""), |path| path.split_once('?').unwrap_or((path, "")));
        let field = |field: &httparse::Header<'_>| {
            (field.name.to_ascii_lowercase(), String::from_utf8_lossy(field.value).into_owned())
        };
        let mut request = Self {
            method: head.method.unwrap_or_default().to_owned(),
            path: path.to_owned(),
            query: query.to_owned(),
            fields: head.headers.iter().map(field).collect(),
            body: Vec::new(),
        };
        if request.field("transfer-encoding").is_some() {
            return Err("411 Length Required");
        }
        let body = request.field("content-length").map_or(Ok(0), |length| length.parse::<usize>());
        let end = length.saturating_add(body.map_err(|_| "400 Bad Request")?);
        if end > REQUEST_BYTES_MAX {
            return Err("413 Content Too Large");
        }
        let Some(body) = bytes.get(length..end) else { return Ok(None) };
        request.body = body.to_vec();
        Ok(Some(request))
    }

    /// A field of the head, by its name in lower case. If it came several times, all values with commas.
    pub fn field(&self, name: &str) -> Option<String> {
        let values: Vec<&str> =
            self.fields.iter().filter(|(key, _)| key == name).map(|(_, value)| value.as_str()).collect();
        (!values.is_empty()).then(|| values.join(", "))
    }

    /// A value of the query, not decoded.
    pub fn query(&self, name: &str) -> Option<&str> {
        let mut pairs = self.query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.find(|(key, _)| *key == name).map(|(_, value)| value)
    }
}

/// A whole answer.
pub fn answer(to: &mut impl Write, status: &str, kind: &str, body: &[u8]) -> io::Result<()> {
    write_head(to, status, kind, &format!("Content-Length: {}\r\n", body.len()))?;
    to.write_all(body)
}

/// An answer that ends with the connection.
pub fn begin(to: &mut impl Write, kind: &str) -> io::Result<()> {
    write_head(to, "200 OK", kind, "")
}

fn write_head(to: &mut impl Write, status: &str, kind: &str, length: &str) -> io::Result<()> {
    to.write_all(format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\n{length}{FIXED}\r\n").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Duration = Duration::from_secs(5);

    fn read(mut bytes: &[u8]) -> Result<Request, &'static str> {
        Request::read(&mut bytes, LIMIT)
    }

    #[test]
    fn a_request_is_read_when_it_is_whole_and_no_sooner() {
        let sent = b"POST /command?token=t0&a=%20&token=t1 HTTP/1.1\r\nHost: a:1\r\nX: 1\r\nhost: b\r\n\
                     Content-Length: 4\r\n\r\nbody";
        let request = read(sent).expect("it is whole");
        assert_eq!((request.method.as_str(), request.path.as_str()), ("POST", "/command"));
        assert_eq!((request.query("token"), request.query("b")), (Some("t0"), None));
        assert_eq!(request.field("host").as_deref(), Some("a:1, b"));
        assert_eq!((request.field("x").as_deref(), request.field("y")), (Some("1"), None));
        assert_eq!(request.body, b"body");
        for end in 0..sent.len() {
            assert_eq!(read(&sent[..end]), Err("408 Request Timeout"), "{end}");
        }
        // What comes after it belongs to no request.
        assert_eq!(read(&[&sent[..], b"more"].concat()), Ok(request));
    }

    #[test]
    fn what_is_no_request_or_too_large_is_refused() {
        let with = |fields: &str| read(format!("POST / HTTP/1.1\r\n{fields}\r\n").as_bytes()).map(|_| ());
        assert_eq!(with(""), Ok(()));
        for (fields, status) in [
            ("Content-Length: -1\r\n", "400 Bad Request"),
            ("Content-Length: 1\r\nContent-Length: 2\r\n", "400 Bad Request"),
            ("Content-Length: 9000\r\n", "413 Content Too Large"),
            ("Content-Length: 18446744073709551615\r\n", "413 Content Too Large"),
            ("Content-Length: 18446744073709551616\r\n", "400 Bad Request"),
            ("Transfer-Encoding: chunked\r\n", "411 Length Required"),
            (&"A: b\r\n".repeat(FIELDS_MAX + 1), "400 Bad Request"),
            (&format!("A: {}\r\n", "b".repeat(REQUEST_BYTES_MAX)), "413 Content Too Large"),
            ("\0: a\r\n", "400 Bad Request"),
        ] {
            assert_eq!(with(fields), Err(status), "{fields:.40}");
        }
        for bytes in [&b"\x16\x03\x01\x02\x00\x01\x00"[..], b"GET / HTTP/2.0\r\n\r\n", b"\xFF\xFE"] {
            assert_eq!(read(bytes), Err("400 Bad Request"), "{bytes:?}");
        }
    }

    #[test]
    fn who_sends_a_byte_now_and_then_is_answered_in_time() {
        struct Slow;
        impl Read for Slow {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                std::thread::sleep(Duration::from_millis(5));
                buffer[0] = b'A';
                Ok(1)
            }
        }
        assert_eq!(Request::read(&mut Slow, Duration::from_millis(50)), Err("408 Request Timeout"));
    }
}
