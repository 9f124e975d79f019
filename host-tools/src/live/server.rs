//! The page, and its data connection: a WebSocket.
//!
//! Each page's task takes the newest state when it can send. A page that takes nothing for `PATIENCE` is
//! dropped.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::{Context as _, Result};
use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, RawQuery, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_util::SinkExt as _;
use serde::Deserialize;
use tokio::net::TcpListener;
use tokio::sync::oneshot;

use super::assets;
use super::guard::Guard;
use super::hub::{Hub, PageCommand, Published};
use crate::page::history::Cursor;
use crate::page::json;

/// Pages at once.
const PAGES_MAX: usize = 16;
/// Of a page's commands, and of the buffer cleared before each look for one.
const COMMAND_BYTES_MAX: usize = 1_024;
/// Then a page is gone.
const PATIENCE: Duration = Duration::from_secs(10);

/// Our scripts and styles, no inline code, no frame around the page.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

#[derive(Clone)]
struct Shared {
    hub: Arc<Hub>,
    guard: Guard,
    pages: Arc<AtomicUsize>,
}

/// One page's place. Freed when dropped, also if the connection breaks before it is a WebSocket: the closure
/// is then dropped without a call.
struct Place(Arc<AtomicUsize>);

impl Place {
    /// `None` if [`PAGES_MAX`] pages are open.
    fn take(pages: &Arc<AtomicUsize>) -> Option<Self> {
        let place = Self(Arc::clone(pages));
        (pages.fetch_add(1, Ordering::SeqCst) < PAGES_MAX).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Serves until the following thread ends: `followed` is then closed.
pub fn serve(
    listener: std::net::TcpListener,
    hub: Arc<Hub>,
    guard: Guard,
    followed: oneshot::Receiver<Infallible>,
) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("no runtime")?;
    runtime.block_on(async move {
        listener.set_nonblocking(true)?;
        let listener = TcpListener::from_std(listener)?;
        let shared = Shared { hub, guard, pages: Arc::default() };
        let router = Router::new()
            .route("/", get(index))
            .route("/ws", get(connect))
            .route("/{name}", get(asset))
            .layer(middleware::from_fn_with_state(shared.clone(), check))
            .with_state(shared);
        tokio::select! {
            served = async { axum::serve(listener, router).await } => served.context("the server has ended"),
            _ = followed => Ok(()),
        }
    })
}

/// Rules for every request and every answer.
async fn check(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let mut response = if !shared.guard.knows_host(headers) {
        (StatusCode::FORBIDDEN, "This server is asked by its address only.\n").into_response()
    } else if !shared.guard.knows_origin(headers) {
        (StatusCode::FORBIDDEN, "Other pages may not ask this server.\n").into_response()
    } else {
        next.run(request).await
    };
    let fixed = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
        (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    ];
    for (name, value) in fixed {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

async fn index() -> Response {
    found("index.html")
}

async fn asset(Path(name): Path<String>) -> Response {
    found(&name)
}

fn found(name: &str) -> Response {
    match assets::find(name) {
        Some((kind, text)) => ([(header::CONTENT_TYPE, kind)], text).into_response(),
        None => (StatusCode::NOT_FOUND, "There is no such thing here.\n").into_response(),
    }
}

async fn connect(
    State(shared): State<Shared>,
    RawQuery(query): RawQuery,
    _: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !shared.guard.knows_token(query.as_deref()) {
        return (StatusCode::UNAUTHORIZED, "The token is missing or wrong.\n").into_response();
    }
    let Some(place) = Place::take(&shared.pages) else {
        return (StatusCode::SERVICE_UNAVAILABLE, "Too many pages are open.\n").into_response();
    };
    let upgrade = upgrade
        .read_buffer_size(COMMAND_BYTES_MAX)
        .max_message_size(COMMAND_BYTES_MAX)
        .max_frame_size(COMMAND_BYTES_MAX);
    upgrade.on_upgrade(async move |socket| {
        let _place = place;
        Page::new(&shared.hub).run(socket, &shared.hub).await;
    })
}

/// One write: several would wake page and network.
async fn send(socket: &mut WebSocket, messages: Vec<String>) -> Result<(), axum::Error> {
    for text in messages {
        socket.feed(Message::Text(text.into())).await?;
    }
    socket.flush().await
}

#[derive(Debug, Deserialize)]
#[serde(tag = "cmd", rename_all = "lowercase")]
enum Asked {
    Vehicle { system: u8 },
    Pause,
    Play,
    Seek { to: f64 },
    Speed { to: f64 },
}

struct Page {
    follow: tokio::sync::watch::Receiver<Arc<Published>>,
    vehicle: Option<u8>,
    cursor: Cursor,
    epoch: u64,
    timeline: Arc<str>,
}

impl Page {
    fn new(hub: &Hub) -> Self {
        Self {
            follow: hub.follow(),
            vehicle: None,
            cursor: Cursor::default(),
            epoch: 0,
            timeline: Arc::default(),
        }
    }

    async fn run(mut self, mut socket: WebSocket, hub: &Hub) {
        self.follow.mark_changed();
        loop {
            let messages = tokio::select! {
                received = socket.recv() => match received {
                    Some(Ok(Message::Text(text))) => {
                        self.obey(text.as_str(), hub);
                        Vec::new()
                    }
                    Some(Ok(Message::Binary(_) | Message::Ping(_) | Message::Pong(_))) => Vec::new(),
                    Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                },
                changed = self.follow.changed() => match changed {
                    Ok(()) => self.news(hub),
                    Err(_) => return,
                },
            };
            if !matches!(tokio::time::timeout(PATIENCE, send(&mut socket, messages)).await, Ok(Ok(()))) {
                return;
            }
        }
    }

    fn obey(&mut self, text: &str, hub: &Hub) {
        let command = match serde_json::from_str(text) {
            Ok(Asked::Vehicle { system }) => {
                self.vehicle = Some(system);
                self.cursor = Cursor::default();
                self.follow.mark_changed();
                return;
            }
            Ok(Asked::Pause) => PageCommand::Pause,
            Ok(Asked::Play) => PageCommand::Play,
            Ok(Asked::Seek { to }) => PageCommand::Seek(to),
            Ok(Asked::Speed { to }) => PageCommand::Speed(to),
            Err(_) => return,
        };
        hub.command(command);
    }

    fn news(&mut self, hub: &Hub) -> Vec<String> {
        let published = Arc::clone(&self.follow.borrow_and_update());
        if published.epoch != self.epoch {
            self.epoch = published.epoch;
            self.cursor = Cursor::default();
        }
        let mut messages = vec![published.head.clone()];
        if !Arc::ptr_eq(&self.timeline, &published.timeline) && !published.timeline.is_empty() {
            self.timeline = Arc::clone(&published.timeline);
            messages.push(self.timeline.to_string());
        }
        let wanted =
            self.vehicle.and_then(|wanted| published.crafts.iter().find(|(system, _)| *system == wanted));
        if let Some((system, state)) = wanted.or_else(|| published.crafts.first()) {
            if self.vehicle != Some(*system) {
                self.vehicle = Some(*system);
                self.cursor = Cursor::default();
            }
            let part = hub.since(*system, &mut self.cursor, published.now);
            messages.extend(part.map(|part| json::json(&part)));
            messages.push(state.clone());
        }
        messages.retain(|message| !message.is_empty());
        messages
    }
}
