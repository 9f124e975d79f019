//! USB: a serial port for a ground station, beside the radio's. The summary stream goes out, requests come in.
//!
//! It is as urgent as the uplink, and so is its interrupt. Without a host nothing runs. A host is given at most
//! a packet each [`PACE`], and a frame [`SEND_MAX`]; then the port counts as closed, and costs nothing until a host takes a packet.
//! A pulled cable gives no event: it is a host that takes nothing.

use embassy_futures::join::join3;
use embassy_time::{Duration, Timer, with_timeout};
use hums_onboard::queues::{UplinkIn, UsbOut};
use hums_onboard::uplink::{Port, Uplink};
use hums_usb::class::Control;
use hums_usb::guard::Link;
use hums_usb::scsi::SERIAL_BYTES;
use hums_usb::serial::{self, CdcAcmClass, DESCRIPTOR_BYTES, Receiver, Sender, State};
use hums_usb::{Builder, UsbDevice};
use static_cell::{ConstStaticCell, StaticCell};

use crate::boards::board;
use crate::links;
use crate::usb::{self, Driver, Identity, Packets};

const PACKET_BYTES: u16 = hums_usb::PACKET_BYTES as u16;

const IDENTITY: Identity = Identity { product: 2, name: "HUMS" };

/// Between two packets of the host, which take some 7,000 cycles each: 2 % of the processor. 32 kB/s.
const PACE: Duration = Duration::from_millis(2);
/// Timeout of a frame. A host that reads takes it in some milliseconds.
const SEND_MAX: Duration = Duration::from_millis(500);
/// How often an open port looks for the next frame. A text has 50 ms.
const EMPTY: Duration = Duration::from_millis(5);
/// How often a closed port looks again.
const LOOK: Duration = Duration::from_secs(1);

type Bus = Driver<'static>;

/// The device: its parts refer to statics.
pub(crate) struct Plug {
    device: UsbDevice<'static, Bus>,
    sender: Sender<'static, Bus>,
    receiver: Receiver<'static, Bus>,
}

// SAFETY: made once, before the tasks, and lent to one of them. The statics below are its own.
unsafe impl Send for Plug {}

static LINK: Link = Link::new();
static DIGITS: StaticCell<[u8; SERIAL_BYTES]> = StaticCell::new();
static PACKETS: ConstStaticCell<Packets> = ConstStaticCell::new([0; _]);
static DESCRIPTOR: ConstStaticCell<[u8; DESCRIPTOR_BYTES]> = ConstStaticCell::new([0; _]);
static BOS: ConstStaticCell<[u8; 16]> = ConstStaticCell::new([0; _]);
static DATA: ConstStaticCell<[u8; 64]> = ConstStaticCell::new([0; _]);
static CONTROL: StaticCell<Control<'static>> = StaticCell::new();
static STATE: StaticCell<State<'static>> = StaticCell::new();
static PLUG: StaticCell<Plug> = StaticCell::new();

/// The device, before the tasks run: this takes more stack than they have.
#[inline(never)]
pub(crate) fn plug(port: board::Usb, id: [u8; 12]) -> &'static mut Plug {
    let driver = usb::driver(port, PACKETS.take(), &LINK);
    let config = usb::config(IDENTITY, DIGITS.init(usb::digits(id)));
    let mut builder = Builder::new(driver, config, DESCRIPTOR.take(), BOS.take(), &mut [], DATA.take());
    builder.handler(CONTROL.init(Control::new(&LINK)));
    let class = CdcAcmClass::new(&mut builder, STATE.init(State::new()), PACKET_BYTES);
    let (sender, receiver) = class.split();
    PLUG.init_with(|| Plug { device: builder.build(), sender, receiver })
}

#[embassy_executor::task]
pub(crate) async fn run(
    plug: &'static mut Plug,
    queue: UsbOut<'static>,
    frames: &'static UplinkIn<'static>,
) -> ! {
    let Plug { device, sender, receiver } = plug;
    join3(device.run(), send(sender, queue), receive(receiver, frames)).await.0
}

async fn send(sender: &mut Sender<'static, Bus>, mut queue: UsbOut<'static>) -> ! {
    loop {
        sender.wait_connection().await;
        if !matches!(with_timeout(LOOK, serial::wait_for_reader(sender)).await, Ok(Ok(()))) {
            continue;
        }
        queue.open();
        let mut is_taken = true;
        while is_taken {
            let send = async |frame: &[u8]| {
                matches!(with_timeout(SEND_MAX, serial::send(sender, frame)).await, Ok(Ok(())))
            };
            match queue.lend(send).await {
                Some(is_sent) => is_taken = is_sent,
                None => Timer::after(EMPTY).await,
            }
        }
        queue.close();
    }
}

/// A checksum detects a frame that was cut by the end of a connection.
async fn receive(receiver: &mut Receiver<'static, Bus>, frames: &UplinkIn<'static>) -> ! {
    let mut body = Uplink::new(Port::Usb);
    loop {
        receiver.wait_connection().await;
        while let Ok(count) = receiver.read_packet(body.room()).await {
            body.received(count, frames);
            links::UPLINK.signal(());
            Timer::after(PACE).await;
        }
        body.idle(frames);
    }
}
