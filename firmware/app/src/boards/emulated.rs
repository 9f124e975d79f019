//! QEMU's `netduinoplus2`: the same chip, without what QEMU does not model (clocks, GPIO, DMA, watchdog, SPI card).
//! So `embassy_stm32::init` is never called here; the USARTs are driven by their registers.
//!
//! Time is virtual ([`clock`]): idle moves it, to the next alarm or to the next arrival of the [`feed`], whichever is
//! earlier, alarms first where both fall together. Tasks take no time, so that runs repeat to the byte.
//!
//! Arguments (of the semihosting command line, `key=value`, each in double quotes):
//!
//! | key | value |
//! |---|---|
//! | `feed` | when the input's bytes arrive; a file or a FIFO (see [`feed`]). Its end ends the run |
//! | `sd` | the card's image, opened for writing in place; without it the slot is empty |
//! | `store` | the store's flash, two sectors of 16 KiB; without it there is no store (see [`store`]) |
//! | `log` | where defmt's messages go |
//! | `seed` | a number that stands for the true random number of a real board |
//! | `provoke` | `WHAT`, `WHAT:TASK` or either `@SECONDS`: that fault goes wrong, once (see [`provoke`]) |
//! | `resets` | `1`: the host starts the emulator again after a reset, and the start goes on where the last one was (see [`reset`]) |
//! | `cost` | `1`: tell the instructions of each stage; QEMU must run with `-icount shift=3` |
//!
//! Exit codes: 0 done, 2 no feed, 3 to be started again, 101 a fault, 102 all tasks wait for ever.

mod card;
mod clock;
mod feed;
mod log;
mod provoke;
mod reset;
mod store;
mod uart;

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use cortex_m::peripheral::syst::SystClkSource;
use embassy_stm32::interrupt;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use heapless::CString;
use hums_onboard::Task;
use semihosting::experimental::env;
use semihosting::fs::File;
use semihosting::{println, process};

pub(crate) use card::ImageCard as Card;
use feed::Feed;
pub(crate) use store::StoreFlash;
pub(crate) use uart::{AutopilotRx, AutopilotTx, GsRx, GsTx};

use super::machine::{Boot, Machine, Parts, ResetCause, SYSTICK_RELOAD};
use crate::fault;
use crate::memory::depth;
use crate::report::{Report, Stage};

/// The board's name.
pub(crate) const NAME: &str = "emulated";

/// What moves the ports' bytes.
pub(crate) const PORT_INTERRUPTS: [interrupt::Interrupt; 2] = [interrupt::USART1, interrupt::USART2];
/// Turns of `SysTick` that a task may take in one go: ten seconds of the emulated processor's clock, which follows this
/// PC's, however busy that is. Waiting has its own limit, in virtual time ([`WATCHDOG_MS`]).
pub(crate) const LATE_TURNS: u32 = 100;
/// Virtual time stands still while tasks run.
pub(crate) const TIME_STOPS_WITH_TASKS: bool = true;
/// Nobody fed the watchdog for this long in virtual time: as on the real board.
const WATCHDOG_MS: u32 = 1_000;
/// Bytes of all arguments together.
const ARGUMENTS_BYTES: usize = 1024;
/// Bytes of a path.
const PATH_BYTES: usize = 512;

/// There was no feed, or it cannot be opened.
const EXIT_NO_FEED: i32 = 2;
/// All tasks wait, and nothing will ever come.
const EXIT_STUCK: i32 = 102;

/// The input has ended.
static ENDED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
/// Whether `done` tells the instructions.
static TELL_COSTS: AtomicBool = AtomicBool::new(false);
/// When the watchdog bites, in virtual milliseconds; before it is fed first, never.
static BITES_AT_MS: AtomicU32 = AtomicU32::new(u32::MAX);

/// What the command line says.
#[derive(Default)]
struct Arguments {
    feed: CString<PATH_BYTES>,
    card: CString<PATH_BYTES>,
    store: CString<PATH_BYTES>,
    log: CString<PATH_BYTES>,
    seed: u32,
    tell_costs: bool,
    resets: bool,
    provoked: Option<provoke::Plan>,
}

/// The types of its parts.
pub(crate) struct Board;

impl Machine for Board {
    type AutopilotRx = AutopilotRx;
    type AutopilotTx = AutopilotTx;
    type GsRx = GsRx;
    type GsTx = GsTx;
    type Card = Card;
    type StoreFlash = StoreFlash;
    type Led = Led;
    type Watchdog = Watchdog;
    type Idle = Idle;
}

/// Memory that survives a reset.
pub(crate) fn remember() {
    if Arguments::read().resets {
        reset::remember();
    }
}

/// Reads the arguments, opens what they name and switches the ports on.
pub(crate) fn take() -> Parts<Board> {
    start_systick();
    let arguments = Arguments::read();
    TELL_COSTS.store(arguments.tell_costs, Ordering::Relaxed);
    if arguments.tell_costs {
        depth::measure();
    }
    // Once: what it came to is what the next start shows.
    if fault::starts() <= 1 {
        provoke::arm(arguments.provoked);
    }
    log::open(File::create(arguments.log.as_c_str()).ok());
    let image = File::options().read(true).write(true).open(arguments.card.as_c_str());
    let store = File::options().read(true).write(true).open(arguments.store.as_c_str());
    let (autopilot, gs) = uart::init();
    // From here on no byte is lost. Whoever feeds us waits for this line.
    println!("ready");
    let Ok(feed) = File::open(arguments.feed.as_c_str()) else {
        println!("no feed: the argument feed=PATH is missing or cannot be opened");
        process::exit(EXIT_NO_FEED);
    };
    Parts {
        autopilot,
        gs,
        card: Card::new(image.ok()),
        store: store.ok().map(StoreFlash::new),
        led: Led(()),
        watchdog: Watchdog(()),
        idle: Idle { feed: Feed::new(feed) },
        boot: Boot {
            id: [0; 12],
            cause: reset::cause(),
            cause_register: 0,
            entropy: Some(arguments.seed.wrapping_add(1)),
        },
    }
}

impl Arguments {
    fn read() -> Self {
        let mut arguments = Self::default();
        let Ok(words) = env::args::<ARGUMENTS_BYTES>() else { return arguments };
        for (key, value) in words.flatten().filter_map(|word| word.split_once('=')) {
            match key {
                "feed" => set_path(&mut arguments.feed, value),
                "sd" => set_path(&mut arguments.card, value),
                "store" => set_path(&mut arguments.store, value),
                "log" => set_path(&mut arguments.log, value),
                "seed" => arguments.seed = value.parse().unwrap_or_default(),
                "resets" => arguments.resets = value == "1",
                "cost" => arguments.tell_costs = value == "1",
                "provoke" => arguments.provoked = provoke::Plan::parse(value),
                _ => println!("unknown argument: {}", key),
            }
        }
        arguments
    }
}

/// A path that is too long stays empty, and an empty path cannot be opened.
fn set_path(path: &mut CString<PATH_BYTES>, value: &str) {
    if path.extend_from_bytes(value.as_bytes()).is_err() {
        println!("a path of more than {} bytes: {}", PATH_BYTES, value);
        *path = CString::new();
    }
}

/// The processor's own clock, free running: under `-icount` it counts instructions.
fn start_systick() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(SYSTICK_RELOAD);
        core.SYST.clear_current();
        core.SYST.enable_interrupt();
        core.SYST.enable_counter();
    }
}

/// There is none.
pub(crate) struct Led(());

impl Led {
    #[expect(clippy::unused_self, reason = "on a real board there is a pin")]
    pub(crate) fn set(&mut self, _lit: bool) {
        let _ = provoke::here(Task::Monitor);
    }
}

/// In virtual time: idle looks whether it bites.
pub(crate) struct Watchdog(());

impl Watchdog {
    #[expect(clippy::unused_self, reason = "on a real board there is a timer")]
    pub(crate) fn feed(&mut self) {
        BITES_AT_MS.store(now_ms().saturating_add(WATCHDOG_MS), Ordering::Relaxed);
    }
}

fn now_ms() -> u32 {
    embassy_time::Instant::now().as_millis() as u32
}

/// Moves the time.
pub(crate) struct Idle {
    feed: Feed,
}

impl Idle {
    /// All tasks wait whenever this runs: it is thread mode, and they are interrupts.
    pub(crate) fn run(mut self) -> ! {
        let mut ended = false;
        loop {
            let alarm_us = clock::next_alarm();
            match self.feed.peek() {
                Some(arrival) if arrival.time_us.max(clock::now_us()) < alarm_us => {
                    clock::advance(arrival.time_us);
                    if arrival.is_power_off() {
                        reset::power_off();
                    }
                    uart::receive(arrival.from_gs, arrival.bytes);
                    self.feed.take();
                }
                None if !ended => {
                    ended = true;
                    // What is still to be done is bounded, and the monitor does not feed it any more.
                    BITES_AT_MS.store(u32::MAX, Ordering::Relaxed);
                    ENDED.signal(());
                }
                None if alarm_us == u64::MAX => {
                    println!("fault: all tasks wait for ever");
                    process::exit(EXIT_STUCK);
                }
                _ => clock::advance(alarm_us),
            }
            if now_ms() > BITES_AT_MS.load(Ordering::Relaxed) {
                fault::late(None);
                bites_soon();
            }
        }
    }
}

/// Before it is fed first, and after the end of the input, nobody is to feed it: time does not go on.
pub(crate) fn is_watched() -> bool {
    BITES_AT_MS.load(Ordering::Relaxed) != u32::MAX
}

/// The emulator has no watchdog: this is its bite.
pub(crate) fn bites_soon() {
    println!("the watchdog bites");
    reset::reset(ResetCause::Watchdog)
}

/// There is none.
pub(crate) const fn crystal_failed() -> bool {
    false
}

/// Waits for the end of the feed.
pub(crate) async fn ended() {
    ENDED.wait().await;
}

/// Counts up where `SysTick` counts down.
pub(crate) fn cycles() -> u32 {
    SYSTICK_RELOAD - cortex_m::peripheral::SYST::get_current()
}

/// Instructions are counted only where that was asked for; then each takes 1.5 cycles.
pub(crate) fn busy_cycles(counted: u64) -> u64 {
    if TELL_COSTS.load(Ordering::Relaxed) { instructions(counted) * 3 / 2 } else { 0 }
}

/// With `-icount shift=3` an instruction takes 8 ns, and `SysTick` counts 168 MHz: 168 / 125 ticks.
const fn instructions(ticks: u64) -> u64 {
    ticks * 125 / 168
}

/// Prints the figures of the run as one line of JSON, and ends the emulator.
pub(crate) fn done(report: &Report) {
    let Report { stats, frames_left, costs, stack: (stack_used, stack_all) } = report;
    println!(
        "{{\"frames_in\":{},\"frames_logged\":{},\"frames_lost\":{},\"bytes_in\":{},\"bytes_not_frames\":{},\
         \"bytes_logged\":{},\"blocks_written\":{},\"queue_bytes_max\":{},\"queue_bytes_capacity\":{},\
         \"sd_stall_ms_max\":{},\"gs_frames\":{},\"gs_bytes\":{},\"stack_bytes_max\":{},\"stack_bytes\":{}{}}}",
        stats.frames_in,
        stats.frames_logged.saturating_sub(*frames_left),
        stats.frames_lost + frames_left,
        stats.bytes_in,
        stats.bytes_not_frames,
        stats.bytes_logged,
        stats.blocks_written,
        stats.queue_bytes_max,
        stats.queue_bytes_capacity,
        stats.sd_stall_ms_max,
        stats.gs_frames,
        stats.gs_bytes,
        stack_used,
        stack_all,
        Costs(costs),
    );
    process::exit(0);
}

/// The members `instructions` and `stack_by_urgency` of the report.
struct Costs<'a>(&'a [u64]);

impl core::fmt::Display for Costs<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if !TELL_COSTS.load(Ordering::Relaxed) {
            return Ok(());
        }
        f.write_str(",\"instructions\":{")?;
        // Idle is left out: it sleeps, and no instruction says how long.
        let busy = Stage::NAMES.iter().zip(self.0).filter(|((stage, _), _)| *stage != Stage::Idle);
        for (index, ((_, name), ticks)) in busy.enumerate() {
            let comma = if index == 0 { "" } else { "," };
            write!(f, "{comma}\"{name}\":{}", instructions(*ticks))?;
        }
        f.write_str("},\"stack_by_urgency\":{")?;
        for (index, (name, bytes)) in depth::all().enumerate() {
            let comma = if index == 0 { "" } else { "," };
            write!(f, "{comma}\"{name}\":{bytes}")?;
        }
        f.write_str("}")
    }
}

/// Starts anew, or ends the emulator and says why where nobody starts it again.
pub(crate) fn restart() -> ! {
    reset::reset(ResetCause::Software)
}
