//! ```text
//! live_load HUMS SECONDS MESSAGES_PER_SECOND RECORDING.tlog
//! ```
//! Prints the server's share of one core, its memory, and the time of a page's frame in Chromium until it is
//! painted, in the first and in the last seconds.

use std::net::UdpSocket;
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, anyhow};
use hums_tests::flights::Manifest;
use hums_tests::frames::of_tlog;
use hums_tests::live::{Live, free_port, send};
use hums_tests::oracle::LivePage;

const LOOK_S: u32 = 20;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [hums, seconds, rate, recording] = arguments.as_slice() else {
        eprintln!("usage: live_load HUMS SECONDS MESSAGES_PER_SECOND RECORDING.tlog");
        return ExitCode::from(2);
    };
    let (Ok(seconds), Ok(rate)) = (seconds.parse::<u32>(), rate.parse::<f64>()) else {
        eprintln!("SECONDS and MESSAGES_PER_SECOND are numbers");
        return ExitCode::from(2);
    };
    match measure(Path::new(hums), seconds.max(2 * LOOK_S + 10), rate, Path::new(recording)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn measure(hums: &Path, seconds: u32, rate: f64, recording: &Path) -> Result<()> {
    let data = std::fs::read(recording).with_context(|| recording.display().to_string())?;
    let frames = of_tlog(&data, &Manifest::own().seeds, false);
    let frames: Vec<Vec<u8>> =
        frames.iter().filter(|frame| frame.verified).map(|frame| frame.bytes.to_vec()).collect();
    let port = free_port();
    let live = Live::start_at(hums, &[&format!("udpin:127.0.0.1:{port}")]);
    let address = live.address.clone();
    let count = (f64::from(seconds) * rate) as usize;
    let socket = UdpSocket::bind("127.0.0.1:0")?;
    let sender = std::thread::spawn(move || {
        let put = |frame: &[u8]| drop(socket.send_to(frame, ("127.0.0.1", port)));
        send(frames.iter().map(Vec::as_slice).cycle().take(count), rate, put, |_| ());
    });
    let mut page = LivePage::start();
    page.open(&address, "dark", 1440, 900);
    page.wait("return document.documentElement.dataset.ready === 'true'", 60);
    let start = Instant::now();
    let before = live.program.cost().context("it has ended")?;
    let first = page.frames_ms(LOOK_S);
    let last_at = Duration::from_secs(u64::from(seconds - LOOK_S - 8));
    std::thread::sleep(last_at.saturating_sub(start.elapsed()));
    let last = page.frames_ms(LOOK_S);
    let after = live.program.cost().context("it has ended")?;
    let share = (after.0 - before.0) / start.elapsed().as_secs_f64() * 100.0;
    let heard = page.read()["values"]["link:rate"].clone();
    sender.join().map_err(|_| anyhow!("the vehicle has failed"))?;
    let (code, words) = live.interrupt(Duration::from_secs(30));
    println!("messages a second   {rate:.0}, for {seconds} s; the page says {heard}");
    println!(
        "server              {share:.1} % of one core, {:.1} MB, at most {:.1} MB",
        mb(after.1),
        mb(after.2)
    );
    for (name, mut frames) in [("first", first), ("last", last)] {
        frames.sort_by(f64::total_cmp);
        let at = |part: f64| frames.get((frames.len() as f64 * part) as usize).copied().unwrap_or(f64::NAN);
        println!(
            "page, {name:<5} {LOOK_S} s    {:.1} ms a frame at the median, {:.1} ms at 95 %, {} frames",
            at(0.5),
            at(0.95),
            frames.len()
        );
    }
    println!("ended with          {code:?} {words}");
    Ok(())
}

fn mb(kib: u64) -> f64 {
    kib as f64 * 1024.0 / 1e6
}
