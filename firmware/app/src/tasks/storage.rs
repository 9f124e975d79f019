//! Storage: writes sectors to the card and, between them, items to the store. It is the least urgent task, because the card's
//! driver blocks the processor and may delay only idle.

use core::sync::atomic::Ordering;

use embassy_time::{Duration, Timer, with_timeout};
use hums_core::clock::Instant;
use hums_onboard::queues::SectorsOut;
use hums_onboard::shelf::Server;
use hums_onboard::storage::{self, NO_CARD_RETRY};
use hums_onboard::update::{RunningImage, UpdateSearch};
use hums_onboard::{Service, StoreWriter, Task};
use hums_recorder::{Buffers, Recorder};
use static_cell::{ConstStaticCell, StaticCell};

use crate::status::{CARD_STATUS, LOG_ENDED, LOG_ENDS, SUPERVISOR, UPDATE_STATUS};
use crate::update;

use crate::boards::board;
use crate::costs::{Stage, measure};
use crate::links::{self, now};

const REPORT: Duration = Duration::from_secs(1);

const END_LOOK: Duration = Duration::from_millis(10);

type Saving = &'static mut StoreWriter<'static, board::StoreFlash>;

pub(crate) struct Body {
    recorder: Recorder<'static, board::Card>,
    sectors: SectorsOut<'static>,
    shelf: Server<'static>,
    store_writer: Saving,
    running: RunningImage<'static>,
    search: UpdateSearch,
}

// SAFETY: `BUFFERS` and `CARD`, the only parts that may not be shared, are lent to the one body. The others are `Send` (below).
unsafe impl Send for Body {}

const fn is_send<T: Send>() {}
const _: () = {
    is_send::<board::Card>();
    is_send::<SectorsOut<'static>>();
    is_send::<Server<'static>>();
    is_send::<Saving>();
};

pub(crate) static BUFFERS: ConstStaticCell<Buffers> = ConstStaticCell::new(Buffers::new());
static CARD: StaticCell<board::Card> = StaticCell::new();
// In a static of its own: a task's arguments take their room twice.
static BODY: StaticCell<Body> = StaticCell::new();

#[inline(never)]
pub(crate) fn body(
    card: board::Card,
    entropy: u32,
    sectors: SectorsOut<'static>,
    shelf: Server<'static>,
    store_writer: Saving,
) -> &'static mut Body {
    BODY.init_with(|| {
        let recorder = Recorder::new(CARD.init(card), &CARD_STATUS, BUFFERS.take(), entropy);
        let (running, search) = (update::running(), UpdateSearch::new());
        Body { recorder, sectors, shelf, store_writer, running, search }
    })
}

#[embassy_executor::task]
pub(crate) async fn run(body: &'static mut Body) -> ! {
    loop {
        SUPERVISOR.report(Task::Storage, now());
        let service = service(body, now());
        keep(body);
        look_for_update(body, service);
        // In this order: the monitor preempts this task, and asks for the end after it has queued the last sector.
        if service != Service::Wrote && LOG_ENDS.load(Ordering::Acquire) && end(body) {
            // For items of the store.
            Timer::after(END_LOOK).await;
            continue;
        }
        match service {
            Service::Wrote => {}
            Service::Idle if !body.sectors.is_empty() || serve(body) => {}
            Service::Idle => wait_for_work(body).await,
            Service::NoCard => Timer::after(links::wait(NO_CARD_RETRY)).await,
        }
    }
}

#[inline(never)]
fn end(body: &mut Body) -> bool {
    let has_ended =
        LOG_ENDED.load(Ordering::Relaxed) || storage::finish_after(&mut body.recorder, &body.sectors);
    LOG_ENDED.store(has_ended, Ordering::Relaxed);
    has_ended
}

async fn wait_for_work(body: &mut Body) {
    let mut asked = body.shelf.is_wanted();
    while body.sectors.is_empty() && !asked && !LOG_ENDS.load(Ordering::Relaxed) {
        SUPERVISOR.report(Task::Storage, now());
        keep(body);
        let _ = with_timeout(REPORT, links::SECTORS.wait()).await;
        asked = body.shelf.is_wanted();
    }
}

// Own stack frame (ARCHITECTURE.md, Memory). As all that follow.

#[inline(never)]
fn service(body: &mut Body, begun: Instant) -> Service {
    measure(Stage::Storage, || storage::service(&mut body.recorder, begun, &mut body.sectors))
}

#[inline(never)]
fn serve(body: &mut Body) -> bool {
    measure(Stage::Storage, || body.shelf.serve(&mut body.recorder))
}

#[inline(never)]
fn keep(body: &mut Body) {
    measure(Stage::Storage, || body.store_writer.service(false));
}

#[inline(never)]
fn look_for_update(body: &mut Body, service: Service) {
    if service == Service::Wrote {
        return;
    }
    body.search.look(&mut body.recorder, &body.running, &UPDATE_STATUS);
    if update::is_on_trial() && body.search.is_proved(now(), &CARD_STATUS) {
        update::confirm(&body.running);
    }
}
