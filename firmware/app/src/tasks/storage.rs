//! Storage: writes sectors to the card and, between them, items to the store. It is the least urgent task, because the card's
//! driver blocks the processor and may delay only idle.

use embassy_time::{Duration, Timer, with_timeout};
use hums_core::clock::Instant;
use hums_onboard::queues::SectorsOut;
use hums_onboard::shelf::Server;
use hums_onboard::storage::NO_CARD_RETRY;
use hums_onboard::{Service, Storage, StoreWriter, Task};
use hums_recorder::Buffers;
use static_cell::{ConstStaticCell, StaticCell};

use crate::status::{CARD_STATUS, SUPERVISOR};

use crate::boards::board;
use crate::costs::{Stage, measure};
use crate::links::{self, now};

/// Check-in interval while idle.
const REPORT: Duration = Duration::from_secs(1);

type Body = Storage<'static, board::Card>;

// Statics of their own: made within the task, both would take 8 and 1.5 KiB of its stack first.
static HELD: ConstStaticCell<Buffers> = ConstStaticCell::new(Buffers::new());
static BODY: StaticCell<Body> = StaticCell::new();

#[inline(never)]
fn prepare(card: board::Card, entropy: u32) -> &'static mut Body {
    BODY.init_with(|| Storage::new(card, &CARD_STATUS, HELD.take(), entropy))
}

#[embassy_executor::task]
pub(crate) async fn run(
    card: board::Card,
    entropy: u32,
    mut sectors: SectorsOut<'static>,
    mut shelf: Server<'static>,
    store_writer: &'static mut StoreWriter<'static, board::StoreFlash>,
) -> ! {
    let body = prepare(card, entropy);
    loop {
        SUPERVISOR.report(Task::Storage, now());
        let begun = now();
        let service = service(body, begun, &mut sectors);
        keep(store_writer);
        match service {
            Service::Wrote => {}
            Service::Idle if !sectors.is_empty() || serve(body, &mut shelf) => {}
            Service::Idle => wait_for_work(&sectors, &shelf, store_writer).await,
            Service::NoCard => Timer::after(links::wait(NO_CARD_RETRY)).await,
        }
    }
}

/// Returns when there is a sector or a question.
async fn wait_for_work(
    sectors: &SectorsOut<'_>,
    shelf: &Server<'_>,
    store_writer: &mut StoreWriter<'static, board::StoreFlash>,
) {
    let mut asked = shelf.is_wanted();
    while sectors.is_empty() && !asked {
        SUPERVISOR.report(Task::Storage, now());
        keep(store_writer);
        let _ = with_timeout(REPORT, links::SECTORS.wait()).await;
        asked = shelf.is_wanted();
    }
}

// Own stack frame (ARCHITECTURE.md, Memory). As all that follow.

#[inline(never)]
fn service(body: &mut Body, begun: Instant, sectors: &mut SectorsOut<'static>) -> Service {
    measure(Stage::Storage, || body.service(begun, sectors))
}

#[inline(never)]
fn serve(body: &mut Body, shelf: &mut Server<'static>) -> bool {
    measure(Stage::Storage, || body.serve(shelf))
}

#[inline(never)]
fn keep(store_writer: &mut StoreWriter<'static, board::StoreFlash>) {
    measure(Stage::Storage, || store_writer.service(false));
}
