//! `hums demo`: a recorded flight is recorded by the firmware (on the model of its chip, where there is an image), the card is
//! decoded, what came of it is summed up, and the dashboard plays the card.
//!
//! It is these commands one after the other, each with its own rules for what is there already. The card and what the ground
//! station got are recorded beside their places, and get their names together. One demo at a time has a folder: it holds a
//! lock on the file `.hums-demo`, which has nothing in it and stays.

use std::collections::HashSet;
use std::io::IsTerminal as _;
use std::net::TcpListener;
use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::cli::{self, Dashboard, FaultFlags, Format};
use crate::decode::naming::is_made_by_content;
use crate::endpoint::Endpoint;
use crate::files::{Begun, Inputs, make_directory, take_turn};
use crate::logs;
use crate::outcome::{Differs, Outcome, usage};
use crate::output::line;
use crate::run::{emulate, sim};
use crate::source::item::{Item, Stop, Want};
use crate::source::recording::Place;
use crate::summary::Overview;
use crate::{decode, info, live, report};

/// The flight that is shown, inside the source tree: a whole flight of a PX4 quadcopter.
const FLIGHT: &str = "tests/flights/px4_hil_quad_low.tlog";

/// Where `hums live` serves its page as well.
const PORT: u16 = 8080;

/// Runs `hums demo`.
pub fn run(args: &cli::Demo) -> Result<Outcome> {
    let flight = flight(args)?;
    let [turn, card, gs, decoded, page] =
        [".hums-demo", "card.img", "ground-station.bin", "decoded", "report.html"]
            .map(|name| args.dir.join(name));
    let inputs = inputs(args, &flight, [&card, &gs, &page], &decoded)?;
    make_directory(&args.dir)?;
    let turn = take_turn(&turn)?;
    if !args.replace {
        refuse_others(&flight, [&card, &gs, &page], &decoded)?;
    }
    line(&format!("1. {flight} goes in at the autopilot UART"))?;
    // Each demo begins with an empty card.
    let parts = [Begun::of(&card, &inputs)?, Begun::of(&gs, &inputs)?];
    let [card_part, gs_part] = parts.each_ref().map(Begun::path);
    let recorded = record(&flight, card_part, gs_part)?;
    parts.iter().try_for_each(Begun::check)?;
    parts.into_iter().try_for_each(Begun::finish)?;
    line("")?;
    line("2. what was on the SD card")?;
    let read = decode::run(&tables_of(args, &card, &decoded))?;
    let page_of = cli::Report {
        inputs: vec![card.clone()],
        output: Some(page.clone()),
        session: None,
        system: None,
        compare: false,
        replace: args.replace,
        json: false,
    };
    report::run(&page_of)?;
    line("")?;
    line("3. what it says of the flight")?;
    for log in &logs::find(std::slice::from_ref(&card), false)?.logs {
        line(info::text::text(&Overview::of(log)?).trim_end())?;
    }
    line("")?;
    line("4. where everything lies")?;
    for (what, path) in [
        ("the SD card's image", &card),
        ("the decoded flight", &decoded),
        ("a page about it", &page),
        ("what the ground station got", &gs),
    ] {
        line(&format!("   {what:<28} {}", shown(path)))?;
    }
    line("   try: hums info CARD, hums verify CARD, hums decode CARD -o OUT --format jsonl")?;
    line("")?;
    let outcome = recorded.and(read);
    if !is_wanted(args.dashboard) {
        line(&format!("5. the dashboard: hums live --input {} --open", shown(&card)))?;
        return Ok(outcome);
    }
    drop(turn);
    line("5. the dashboard plays it, until Ctrl-C, at")?;
    dashboard(&card)?;
    Ok(outcome)
}

/// The flight, which none of the outputs may be, nor may it lie among the tables.
fn inputs(args: &cli::Demo, flight: &Endpoint, outputs: [&PathBuf; 3], decoded: &Path) -> Result<Inputs> {
    let mut inputs = Inputs::none().replacing(args.replace);
    inputs.add_endpoint(flight);
    outputs.into_iter().try_for_each(|output| inputs.refuse(output))?;
    if let Endpoint::File(path) = flight
        && let (Ok(path), Ok(decoded)) = (path.canonicalize(), decoded.canonicalize())
        && path.starts_with(&decoded)
    {
        return Err(usage(format!(
            "{flight}: lies in {}, where the demo writes; copy it elsewhere first",
            decoded.display()
        )));
    }
    Ok(inputs)
}

/// Refuses what lies in the folder and no demo of this flight has made, before anything is recorded. What one may have made is compared
/// with what this one makes.
fn refuse_others(flight: &Endpoint, [card, gs, page]: [&PathBuf; 3], decoded: &Path) -> Result<()> {
    let has_bytes = |path: &&PathBuf| path.metadata().is_ok_and(|about| about.is_file() && about.len() > 0);
    let has_files = || std::fs::read_dir(decoded).is_ok_and(|mut entries| entries.next().is_some());
    let other = if has_bytes(&card) {
        let is_not_made = |page: &&PathBuf| has_bytes(page) && !is_made_by_content(page);
        if is_card_of(card, flight) { Some(page).filter(is_not_made) } else { Some(card) }
            .map(PathBuf::as_path)
    } else {
        // The card and what the ground station got are there before the others.
        let others = [gs, page].into_iter().find(has_bytes).map(PathBuf::as_path);
        others.or_else(|| has_files().then_some(decoded))
    };
    other.map_or(Ok(()), |other| Err(Differs::new(other).into()))
}

/// Whether a card is one of this flight: most of the flight's first frames are among the card's first ones.
fn is_card_of(card: &Path, flight: &Endpoint) -> bool {
    /// Of the flight. A box that starts with it misses some of them.
    const FRAMES: usize = 400;
    let Endpoint::File(flight) = flight else { return false };
    let logs = logs::find(&[card.to_owned()], false).map(|found| found.logs).unwrap_or_default();
    let first = |place: &Place, most: usize| {
        let mut frames = HashSet::new();
        // What cannot be read is told where it is recorded.
        let _ = place.open().and_then(|recording| {
            recording.read(Want { frames: true, ..Want::default() }, &mut |_, item| {
                if let Item::Frame(frame) = item {
                    frames.insert(frame.bytes().to_vec());
                }
                if frames.len() < most { Ok(()) } else { Err(Stop.into()) }
            })
        });
        frames
    };
    let wanted = first(&Place::file(flight), FRAMES);
    let [log] = logs.as_slice() else { return false };
    let there = first(&Place::log(card.display().to_string(), log.clone()), 2 * FRAMES);
    2 * wanted.intersection(&there).count() >= wanted.len()
}

/// What becomes of the card.
fn tables_of(args: &cli::Demo, card: &Path, decoded: &Path) -> cli::Decode {
    cli::Decode {
        salvage: false,
        session: None,
        inputs: vec![card.to_owned()],
        output: decoded.to_owned(),
        format: vec![Format::Tlog, Format::Csv],
        from: None,
        to: None,
        message: Vec::new(),
        replace: args.replace,
        json: false,
    }
}

/// Whoever calls this from a script waits for its end.
fn is_wanted(dashboard: Dashboard) -> bool {
    match dashboard {
        Dashboard::Auto => std::io::stdout().is_terminal(),
        Dashboard::Always => true,
        Dashboard::Never => false,
    }
}

/// Plays the card, until Ctrl-C.
fn dashboard(card: &Path) -> Result<Outcome> {
    // Where that port is taken, any other will do.
    let port = TcpListener::bind(("127.0.0.1", PORT)).map_or(0, |_| PORT);
    live::run(&cli::Live {
        input: Endpoint::File(card.to_owned()),
        session: None,
        listen: format!("127.0.0.1:{port}"),
        listen_token: None,
        params: None,
        open: false,
        json: false,
        influx: None,
        token: None,
        org: None,
        bucket: "hums".to_owned(),
    })
}

fn shown(path: &Path) -> String {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).display().to_string()
}

fn flight(args: &cli::Demo) -> Result<Endpoint> {
    if let Some(input) = &args.input {
        if !matches!(input, Endpoint::File(_)) {
            return Err(usage(format!(
                "{input}: hums demo takes a file; hums sim records what comes otherwise"
            )));
        }
        return Ok(input.clone());
    }
    let flight: Option<PathBuf> =
        emulate::source_tree().map(|tree| tree.join(FLIGHT)).filter(|flight| flight.is_file());
    match flight {
        Some(flight) => Ok(Endpoint::File(flight)),
        None => Err(usage(
            "hums demo shows a flight of the source tree, and this is outside of it; name a recording with --input",
        )),
    }
}

/// By the firmware on the model of its chip; where there is no image, by the same pipeline on this PC.
fn record(flight: &Endpoint, card: &Path, gs: &Path) -> Result<Outcome> {
    let run = cli::Run {
        input: flight.clone(),
        sd: card.to_owned(),
        gs_input: None,
        gs: Some(Endpoint::File(gs.to_owned())),
        store: None,
        params: None,
        speed: None,
        overwrite_oldest: false,
        json: false,
        faults: FaultFlags::default(),
    };
    let here = |why: &anyhow::Error| -> Result<Outcome> {
        note!("not by the firmware: {why:#}");
        line("   recorded by the same pipeline on this PC")?;
        sim::run(&cli::Sim { run: run.clone(), tap: None })
    };
    let firmware = match emulate::firmware(None) {
        Ok(firmware) => firmware,
        Err(why) => return here(&why),
    };
    line("   recorded by the image that is flashed, on a model of its chip")?;
    emulate::run(&cli::Emulate { run, firmware: Some(firmware), costs: false })
}
