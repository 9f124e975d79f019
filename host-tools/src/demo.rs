//! `hums demo`: a recorded flight is recorded by the firmware (on the model of its chip, where there is an image), the card is
//! decoded, what came of it is summed up, and the dashboard plays the card.
//!
//! It is these commands one after the other. With `--force` the card and what the ground station got begin anew.

use std::fs;
use std::io::IsTerminal as _;
use std::net::TcpListener;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};

use crate::cli::{self, Dashboard, FaultFlags, Format};
use crate::endpoint::Endpoint;
use crate::files::{Inputs, Output, make_directory, settle};
use crate::logs;
use crate::outcome::{Outcome, usage};
use crate::output::line;
use crate::run::{emulate, sim};
use crate::summary::Overview;
use crate::{decode, info, live, report};

/// The flight that is shown, inside the source tree: a whole flight of a PX4 quadcopter.
const FLIGHT: &str = "tests/flights/px4_hil_quad_low.tlog";

/// Where `hums live` serves its page as well.
const PORT: u16 = 8080;

/// Runs `hums demo`.
pub fn run(args: &cli::Demo) -> Result<Outcome> {
    let flight = flight(args)?;
    let [card, gs, decoded, page] =
        ["card.img", "ground-station.bin", "decoded", "report.html"].map(|name| args.dir.join(name));
    let inputs = inputs(args, &flight, [&card, &gs, &page], &decoded)?;
    make_directory(&args.dir)?;
    for path in [&card, &gs, &page] {
        Output::check(path, &inputs)?;
    }
    line(&format!("1. {flight} goes in at the autopilot UART"))?;
    if let Endpoint::File(path) = &flight {
        fs::File::open(path).with_context(|| format!("{flight}: cannot be read"))?;
    }
    // Each demo begins with an empty card.
    for path in [&card, &gs].into_iter().filter(|path| path.exists()) {
        settle(fs::remove_file(path), path)?;
    }
    let recorded = record(&flight, &card, &gs)?;
    line("")?;
    line("2. what was on the SD card")?;
    let read = decode::run(&tables_of(args, &card, &decoded))?;
    let page_of = cli::Report {
        inputs: vec![card.clone()],
        output: Some(page.clone()),
        session: None,
        system: None,
        compare: false,
        force: args.force,
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
    line("5. the dashboard plays it, until Ctrl-C, at")?;
    dashboard(&card)?;
    Ok(outcome)
}

/// The flight, which none of the outputs may be, nor may it lie among the tables.
fn inputs(args: &cli::Demo, flight: &Endpoint, outputs: [&PathBuf; 3], decoded: &Path) -> Result<Inputs> {
    let mut inputs = Inputs::none().forcing(args.force);
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
        force: args.force,
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
