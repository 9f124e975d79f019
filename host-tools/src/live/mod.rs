//! `hums live`: a page of the vehicle as it flies, from a link or a recording.
//!
//! ```text
//! link or recording -> frames -> world (a monitor a vehicle) -> hub -> server -> pages
//!                                       \-> points -> InfluxDB
//! ```
//!
//! One thread follows the vehicle (`feed`, `playback`) and never waits for the others; each page has one, and one writes
//! to a database.

pub mod assets;
pub mod bench;
pub mod board;
pub mod companion;
pub mod craft;
pub mod feed;
pub mod guard;
pub mod http;
pub mod hub;
pub mod influx;
pub mod native;
pub mod playback;
pub mod qr;
pub mod rate;
pub mod recording;
pub mod server;
pub mod show;
pub mod spool;
pub mod told;
pub mod values;
pub mod world;

use std::io::IsTerminal as _;
use std::net::{IpAddr, SocketAddr, TcpListener, ToSocketAddrs};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;
use std::time::SystemTime;

use anyhow::{Context as _, Result, anyhow};
use serde::Serialize;

use self::bench::Bench;
use self::feed::Feed;
use self::guard::Guard;
use self::hub::Hub;
use self::influx::Influx;
use self::influx::target::Target;
use self::playback::Player;
use self::told::Limits;
use crate::cli;
use crate::interrupt;
use crate::outcome::{Outcome, usage};
use crate::output::{self, Schema};
use crate::plural::{are, count};

/// Runs `hums live`.
pub fn run(args: &cli::Live) -> Result<Outcome> {
    if args.influx.is_some() {
        interrupt::watch_twice();
    } else {
        interrupt::watch();
    }
    let limits = Limits::new(&crate::params::read(args.params.as_deref())?);
    let influx = database(args)?;
    let (listener, address) = listen(&args.listen)?;
    let host = args.listen.rsplit_once(':').map_or("", |(host, _)| host);
    let (guard, token) = Guard::new(address, host, args.listen_token.as_deref())?;
    let (hub, commands) = Hub::new();
    let follower = follow(args, &limits, &hub, commands, influx)?;
    server::start(listener, hub, guard)?;
    let pages = page_addresses(address, token.as_deref(), others());
    tell(args, &pages)?;
    if let Some(page) = pages.first().filter(|_| args.open) {
        open(page);
    }
    let influx = follower.join().map_err(|_| {
        anyhow!("the reading of the vehicle failed by a fault of hums; start it again, and please report it")
    })??;
    Ok(influx.map_or(Outcome::Done, finish))
}

const SCHEMA: Schema = Schema::first("hums-live");

#[derive(Debug, Serialize)]
struct PagesJson<'a> {
    /// Addresses for this PC, then for other machines.
    pages: &'a [String],
}

/// Prints addresses; on a terminal also as a code for a phone that can reach it.
fn tell(args: &cli::Live, pages: &[String]) -> Result<()> {
    if args.json {
        return output::json(SCHEMA, &PagesJson { pages });
    }
    pages.iter().try_for_each(|page| output::line(page))?;
    let Some(page) = pages.iter().find(|page| !is_here_only(page)) else { return Ok(()) };
    if std::io::stdout().is_terminal() {
        output::terminal_only(&qr::code(page, output::is_in_colour())?)?;
    }
    Ok(())
}

/// Whether other machines cannot reach it.
fn is_here_only(page: &str) -> bool {
    ["http://localhost:", "http://127.", "http://[::1]:"].iter().any(|here| page.starts_with(here))
}

/// Errors of the source are reported at once.
fn follow(
    args: &cli::Live,
    limits: &Limits,
    hub: &Arc<Hub>,
    commands: Receiver<hub::PageCommand>,
    influx: Option<Influx>,
) -> Result<JoinHandle<Result<Option<Influx>>>> {
    let thread = std::thread::Builder::new().name("vehicle".to_owned());
    let hub = Arc::clone(hub);
    let started = if args.input.is_live() {
        if args.session.is_some() {
            return Err(usage("--session is for what was recorded: a log, a card or a folder"));
        }
        let bench = args.setup.map(|port| Bench::new(cli::Setup::of_page(args.input.clone(), port)));
        let feed = Feed::open(&args.input, limits.clone(), (hub, commands), bench, influx)?;
        thread.spawn(move || Ok(feed.run()))
    } else {
        if args.setup.is_some() {
            return Err(usage("--setup is for a link to a box; a recording answers nothing"));
        }
        let opened = recording::open(&args.input, args.session.as_deref())?;
        let name = opened.name.clone();
        let player = Player::new(&name, limits.clone(), hub, commands, influx);
        thread.spawn(move || player.run(opened))
    };
    started.context("no thread; close other programs")
}

fn database(args: &cli::Live) -> Result<Option<Influx>> {
    let Some(url) = &args.influx else {
        if args.token.is_some() || args.org.is_some() {
            return Err(usage("--token and --org are for --influx; the page's own token is --listen-token"));
        }
        return Ok(None);
    };
    let token = args.token.clone().or_else(|| std::env::var("HUMS_INFLUX_TOKEN").ok());
    let target = Target::new(url, token.as_deref(), args.org.as_deref(), &args.bucket)?;
    let session = influx::names::session(SystemTime::now())?;
    Influx::start(target, session, !args.input.is_live()).map(Some)
}

fn finish(influx: Influx) -> Outcome {
    let figures = influx.finish();
    let missing = figures.waiting + figures.lost + figures.rejected;
    output::aside(&format!("{} written", count(figures.written, "point")));
    if missing > 0 {
        let why = if figures.trouble.is_empty() { String::new() } else { format!(": {}", figures.trouble) };
        output::aside(&format!("{} not in the database{why}", are(missing, "point")));
        if figures.rejected > 0 {
            output::aside(&format!("  {} refused by the database: {}", figures.rejected, figures.refusal));
        }
        if figures.lost + figures.waiting > 0 {
            output::aside(&format!("  {} lost while the database took none", figures.lost + figures.waiting));
        }
    }
    if !figures.left_out.is_empty() {
        note!("{}; the rest is not in the database: write the recording again", figures.left_out);
    }
    Outcome::lossy(missing > 0 || !figures.left_out.is_empty())
}

fn listen(text: &str) -> Result<(TcpListener, SocketAddr)> {
    let wrong = || usage(format!("--listen `{text}` is not ADDR:PORT, for instance 127.0.0.1:8080"));
    let addresses = text.to_socket_addrs().map_err(|_| wrong())?;
    let address = addresses.into_iter().next().ok_or_else(wrong)?;
    let listener = TcpListener::bind(address).with_context(|| {
        format!("--listen {address}: cannot listen there; 127.0.0.1:0 takes any free port")
    })?;
    let address = listener.local_addr()?;
    Ok((listener, address))
}

/// This machine first. The token is after the `#`: the browser does not send it.
fn page_addresses(
    listen: SocketAddr,
    token: Option<&str>,
    others: impl IntoIterator<Item = IpAddr>,
) -> Vec<String> {
    let token = token.map_or_else(String::new, |token| format!("#token={token}"));
    if !listen.ip().is_unspecified() {
        return vec![format!("http://{listen}/{token}")];
    }
    // `[::]` takes both kinds, `0.0.0.0` only its own.
    let reached = others.into_iter().filter(|ip| listen.is_ipv6() || ip.is_ipv4());
    let elsewhere = reached.map(|ip| format!("http://{}/{token}", SocketAddr::new(ip, listen.port())));
    [format!("http://localhost:{}/{token}", listen.port())].into_iter().chain(elsewhere).collect()
}

/// For other machines, IPv4 first, without link-local ones (`fe80::`, 169.254.0.0/16). Empty if unknown.
fn others() -> Vec<IpAddr> {
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    let mut addresses: Vec<IpAddr> = interfaces
        .iter()
        .filter(|interface| !interface.is_loopback() && !interface.is_link_local())
        .map(if_addrs::Interface::ip)
        .collect();
    addresses.sort();
    addresses.dedup();
    addresses
}

/// The browser; without one the printed address is enough.
fn open(page: &str) {
    let (program, first): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("cmd", &["/C", "start", ""])
    } else {
        ("xdg-open", &[])
    };
    let mut command = Command::new(program);
    command.args(first).arg(page).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if command.spawn().is_err() {
        output::aside("no browser was found: open the address above");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phone_is_given_an_address_that_it_can_reach() {
        let others: [IpAddr; 2] =
            ["192.168.1.5".parse().expect("good"), "2001:db8::5".parse().expect("good")];
        let pages = |listen: &str| page_addresses(listen.parse().expect("an address"), Some("t0"), others);
        assert_eq!(pages("0.0.0.0:80"), ["http://localhost:80/#token=t0", "http://192.168.1.5:80/#token=t0"]);
        assert_eq!(pages("[::]:80").last().map(String::as_str), Some("http://[2001:db8::5]:80/#token=t0"));
        assert_eq!(pages("127.0.0.1:80"), ["http://127.0.0.1:80/#token=t0"]);
        assert!(pages("127.0.0.1:80").iter().chain(&pages("[::1]:80")).all(|page| is_here_only(page)));
        assert!(is_here_only(&pages("0.0.0.0:80")[0]) && !is_here_only(&pages("0.0.0.0:80")[1]));
    }
}
