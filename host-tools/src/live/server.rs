//! The page, its data as server-sent events (HTML standard, 9.2), and its commands.
//!
//! Each connection has a thread and one request. A page's thread takes the newest state when it can send. A page that
//! takes nothing for `PATIENCE` is dropped.

use std::io::{self, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{self, Builder};
use std::time::Duration;

use anyhow::{Context as _, Result};

use super::assets;
use super::guard::Guard;
use super::http::{self, Request};
use super::hub::{Hub, PublishedState};
use crate::page::history::Cursor;
use crate::page::json;

/// Pages at once.
const PAGES_MAX: usize = 16;
/// Connections at once: all pages, and the six of a browser for each of eight others that load it.
const CONNECTIONS_MAX: usize = 64;
/// Then a page is gone, or a request does not come any more.
const PATIENCE: Duration = Duration::from_secs(10);
/// A page without news gets a comment: that shows a broken connection, and frees its place.
const COMMENT_EVERY: Duration = Duration::from_secs(1);
/// After a failed accept, for instance without a free file descriptor.
const AGAIN: Duration = Duration::from_millis(100);

struct Server {
    hub: Arc<Hub>,
    guard: Guard,
    pages: Arc<AtomicUsize>,
}

/// A place of a limited number, free again when dropped.
struct Permit(Arc<AtomicUsize>);

impl Permit {
    fn take(taken: &Arc<AtomicUsize>, max: usize) -> Option<Self> {
        let place = Self(Arc::clone(taken));
        (taken.fetch_add(1, Ordering::SeqCst) < max).then_some(place)
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Serves until the program ends.
pub fn start(listener: TcpListener, hub: Arc<Hub>, guard: Guard) -> Result<()> {
    let server = Arc::new(Server { hub, guard, pages: Arc::default() });
    let connections = Arc::default();
    let accept = move || {
        for stream in listener.incoming() {
            let Ok(mut stream) = stream else {
                thread::sleep(AGAIN);
                continue;
            };
            let Some(place) = Permit::take(&connections, CONNECTIONS_MAX) else { continue };
            let server = Arc::clone(&server);
            // Without a thread the connection is closed; so it is after an error.
            let _ = Builder::new().name("page".to_owned()).spawn(move || {
                let _place = place;
                server.answer(&mut stream)
            });
        }
    };
    Builder::new().name("server".to_owned()).spawn(accept).context("no thread; close other programs")?;
    Ok(())
}

impl Server {
    fn answer(&self, stream: &mut TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let request = match Request::read(stream, PATIENCE) {
            Ok(request) => request,
            Err(status) => return say(stream, status, "This is no request of a page.\n"),
        };
        let (host, origin) = (request.field("host"), request.field("origin"));
        if !self.guard.knows_host(host.as_deref()) {
            return say(stream, "403 Forbidden", "This server is asked by its address only.\n");
        }
        if !self.guard.knows_origin(host.as_deref(), origin.as_deref()) {
            return say(stream, "403 Forbidden", "Other pages may not ask this server.\n");
        }
        match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/events") | ("POST", "/command") if !self.guard.knows_token(request.query("token")) => {
                say(stream, "401 Unauthorized", "The token is missing or wrong.\n")
            }
            ("GET", "/events") => self.follow(stream, request.query("vehicle")),
            ("POST", "/command") => self.obey(stream, &request.body),
            ("GET", path) => {
                match assets::find(if path == "/" { "index.html" } else { path.trim_start_matches('/') }) {
                    Some((kind, text)) => http::answer(stream, "200 OK", kind, text.as_bytes()),
                    None => say(stream, "404 Not Found", "There is no such thing here.\n"),
                }
            }
            _ => say(stream, "501 Not Implemented", "The page does not ask so.\n"),
        }
    }

    fn obey(&self, stream: &mut TcpStream, command: &[u8]) -> io::Result<()> {
        let Ok(command) = serde_json::from_slice(command) else {
            return say(stream, "400 Bad Request", "This is no command.\n");
        };
        if self.hub.command(command) {
            say(stream, "200 OK", "")
        } else {
            say(stream, "503 Service Unavailable", "Too many commands wait.\n")
        }
    }

    /// Ends with the connection, or with a page that takes nothing.
    fn follow(&self, stream: &mut TcpStream, vehicle: Option<&str>) -> io::Result<()> {
        let Some(_place) = Permit::take(&self.pages, PAGES_MAX) else {
            return say(stream, "503 Service Unavailable", "Too many pages are open.\n");
        };
        http::begin(stream, "text/event-stream")?;
        let vehicle = vehicle.and_then(|system| system.parse().ok());
        let mut page = Page { vehicle, cursor: Cursor::default(), epoch: 0, aside: Arc::default() };
        let mut seen = 0;
        loop {
            let events = match self.hub.after(seen, COMMENT_EVERY) {
                Some((number, published)) => {
                    seen = number;
                    page.news(&published, &self.hub)
                }
                None => ":\n\n".to_owned(),
            };
            // One write: several would wake page and network.
            stream.write_all(events.as_bytes())?;
        }
    }
}

fn say(stream: &mut TcpStream, status: &str, words: &str) -> io::Result<()> {
    http::answer(stream, status, "text/plain; charset=utf-8", words.as_bytes())
}

struct Page {
    vehicle: Option<u8>,
    cursor: Cursor,
    epoch: u64,
    aside: Arc<str>,
}

impl Page {
    /// Each message is an event with one line of data: JSON as we write it has no line breaks.
    fn news(&mut self, published: &PublishedState, hub: &Hub) -> String {
        if published.epoch != self.epoch {
            self.epoch = published.epoch;
            self.cursor = Cursor::default();
        }
        let mut events = String::new();
        let mut add = |message: &str| {
            if !message.is_empty() {
                events.extend(["data: ", message, "\n\n"]);
            }
        };
        add(&published.head);
        if !Arc::ptr_eq(&self.aside, &published.aside) {
            self.aside = Arc::clone(&published.aside);
            add(&self.aside);
        }
        let wanted =
            self.vehicle.and_then(|wanted| published.crafts.iter().find(|(system, _)| *system == wanted));
        if let Some((system, state)) = wanted.or_else(|| published.crafts.first()) {
            if self.vehicle != Some(*system) {
                self.vehicle = Some(*system);
                self.cursor = Cursor::default();
            }
            if let Some(part) = hub.since(*system, &mut self.cursor, published.now) {
                add(&json::json(&part));
            }
            add(state);
        }
        events
    }
}
