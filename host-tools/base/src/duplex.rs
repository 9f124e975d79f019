//! Both directions of a live endpoint: a reader that waits a while, and a writer.
//!
//! `udpin` answers the last sender, or one fixed by [`Port::keep_to`]; `udpout` its fixed peer. Before the first
//! datagram bytes go nowhere, as on a UART without a plug.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};

use crate::endpoint::Endpoint;

const CONNECT: Duration = Duration::from_secs(10);
const WRITE: Duration = Duration::from_secs(5);
/// A datagram that fits the smallest path without being cut up.
const DATAGRAM_BYTES_MAX: usize = 1200;

/// Anything that reads with a time limit.
pub trait Port: Send {
    /// As `Read::read`; silence is an error that [`is_silence`] knows.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// As [`Port::read`], and with it all else that has come already; the buffer has room for [`ALL_BYTES`]. Bytes
    /// written meanwhile may be lost.
    fn read_all(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // A stream gives its available bytes.
        self.read(buffer)
    }

    /// From now on the destination is the sender of the last received bytes, whoever else sends.
    fn keep_to(&mut self) {}
}

/// Both directions.
pub struct Duplex {
    /// Input.
    pub reader: Box<dyn Port>,
    /// Output.
    pub writer: Box<dyn Write + Send>,
}

/// Whether nothing came in time.
pub fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

/// Opens a live endpoint; reading waits for `silence` at most.
pub fn open(endpoint: &Endpoint, silence: Duration) -> Result<Duplex> {
    let context = || format!("{endpoint}: cannot be opened");
    Ok(match endpoint {
        Endpoint::UdpIn(address) => {
            let bound = UdpSocket::bind(address.resolve()?);
            let socket =
                bound.map_err(|error| anyhow!("{endpoint}: cannot be opened: {}", why_not_bound(&error)))?;
            datagrams(socket, None, silence).with_context(context)?
        }
        Endpoint::UdpOut(address) => {
            let to = address.resolve()?;
            let any = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
            let socket = UdpSocket::bind(any).with_context(context)?;
            // Who listens learns from a first, empty datagram where to answer.
            let _ = socket.send_to(&[], to);
            datagrams(socket, Some(to), silence).with_context(context)?
        }
        Endpoint::Tcp(address) => {
            let stream = TcpStream::connect_timeout(&address.resolve()?, CONNECT).with_context(context)?;
            stream.set_read_timeout(Some(silence)).with_context(context)?;
            stream.set_write_timeout(Some(WRITE)).with_context(context)?;
            stream.set_nodelay(true).with_context(context)?;
            let writer = stream.try_clone().with_context(context)?;
            Duplex { reader: Box::new(Stream(stream)), writer: Box::new(writer) }
        }
        Endpoint::Serial { device, baud } => {
            let mut reader = serial2::SerialPort::open(device, *baud).with_context(context)?;
            #[cfg(unix)]
            take_alone(&reader).with_context(|| {
                format!("{endpoint}: another program, perhaps a ground station, has this port: close it")
            })?;
            reader.set_read_timeout(silence).with_context(context)?;
            reader.set_write_timeout(WRITE).with_context(context)?;
            let writer = reader.try_clone().with_context(context)?;
            Duplex { reader: Box::new(Stream(reader)), writer: Box::new(writer) }
        }
        Endpoint::File(_) | Endpoint::Standard => bail!("{endpoint} is not live: nobody there answers"),
    })
}

/// Two programs would each get a part of the bytes. A lock for those that ask for it, and no later opening by the others.
#[cfg(unix)]
fn take_alone(port: &serial2::SerialPort) -> rustix::io::Result<()> {
    rustix::fs::flock(port, rustix::fs::FlockOperation::NonBlockingLockExclusive)?;
    rustix::termios::ioctl_tiocexcl(port)
}

fn why_not_bound(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::AddrInUse => "another program, perhaps a ground station, has this port: close it, or let it forward the vehicle's \
             messages to another port and name that one"
            .to_owned(),
        ErrorKind::AddrNotAvailable => {
            "that is no address of this computer: 0.0.0.0 listens on all that it has".to_owned()
        }
        _ => error.to_string(),
    }
}

fn datagrams(socket: UdpSocket, peer: Option<SocketAddr>, silence: Duration) -> io::Result<Duplex> {
    socket.set_read_timeout(Some(silence))?;
    let fixed = peer.is_some();
    let peer = Arc::new(Mutex::new(peer));
    let writer = DatagramWriter { socket: socket.try_clone()?, peer: Arc::clone(&peer) };
    let reader = DatagramReader { socket, peer, fixed, last: None, kept: false };
    Ok(Duplex { reader: Box::new(reader), writer: Box::new(writer) })
}

struct Stream<R>(R);

/// Bytes taken from a stream at once: 11 ms of the fastest port.
const STREAM_BYTES: usize = 1024;

impl<R: Read + Send> Port for Stream<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let end = buffer.len().min(STREAM_BYTES);
        self.0.read(buffer.get_mut(..end).unwrap_or_default())
    }
}

struct DatagramReader {
    socket: UdpSocket,
    peer: Arc<Mutex<Option<SocketAddr>>>,
    fixed: bool,
    last: Option<SocketAddr>,
    /// Whoever else speaks does not become the peer.
    kept: bool,
}

const LARGEST_BYTES: usize = 65_536;
/// Room for [`Port::read_all`]: it reads on while another datagram surely fits.
pub const ALL_BYTES: usize = 2 * LARGEST_BYTES;
/// Maximum datagrams taken at once: a flood of the port must not block the program.
const AT_ONCE_MAX: usize = 4_096;

impl DatagramReader {
    /// No bytes where the datagram is of no use.
    fn next(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.socket.recv_from(buffer) {
            Ok((_, from)) if self.fixed && Some(from) != *lock(&self.peer) => Ok(0),
            Ok((count, from)) => {
                self.last = Some(from);
                if !self.kept {
                    *lock(&self.peer) = self.last;
                }
                Ok(count)
            }
            // The peer may come yet.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => Ok(0),
            Err(error) => Err(error),
        }
    }
}

impl Port for DatagramReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.next(buffer)? {
            // An empty datagram is not the end of anything.
            0 => Err(ErrorKind::WouldBlock.into()),
            count => Ok(count),
        }
    }

    fn read_all(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut count = self.read(buffer)?;
        self.socket.set_nonblocking(true)?;
        for _ in 0..AT_ONCE_MAX {
            let Some(room) = buffer.get_mut(count..).filter(|room| room.len() >= LARGEST_BYTES) else {
                break;
            };
            // The next read reports the port's error.
            let Ok(more) = self.next(room) else { break };
            count += more;
        }
        self.socket.set_nonblocking(false)?;
        Ok(count)
    }

    fn keep_to(&mut self) {
        if self.last.is_some() {
            (*lock(&self.peer), self.kept) = (self.last, true);
        }
    }
}

struct DatagramWriter {
    socket: UdpSocket,
    peer: Arc<Mutex<Option<SocketAddr>>>,
}

impl Write for DatagramWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let peer = *lock(&self.peer);
        if let Some(peer) = peer {
            for datagram in bytes.chunks(DATAGRAM_BYTES_MAX) {
                match self.socket.send_to(datagram, peer) {
                    // Nobody listens (yet), or the line is full: UDP loses, that is its nature.
                    Err(error)
                        if !matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::WouldBlock) =>
                    {
                        return Err(error);
                    }
                    _ => {}
                }
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn lock(peer: &Mutex<Option<SocketAddr>>) -> std::sync::MutexGuard<'_, Option<SocketAddr>> {
    // An address is complete, whatever happened to the holder of the lock.
    peer.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_kept_to_gets_the_answers_whoever_else_speaks() {
        let here = || UdpSocket::bind("127.0.0.1:0").expect("a port");
        let (socket, first, second) = (here(), here(), here());
        let to = socket.local_addr().expect("an address");
        let mut line = datagrams(socket, None, Duration::from_secs(5)).expect("a line");
        let hear = |line: &mut Duplex, from: &UdpSocket| {
            from.send_to(b"x", to).expect("sent");
            line.reader.read(&mut [0; 8]).expect("it comes");
        };
        first.set_read_timeout(Some(Duration::from_secs(5))).expect("set");
        hear(&mut line, &second);
        hear(&mut line, &first);
        line.reader.keep_to();
        for other in [&second, &first, &second] {
            hear(&mut line, other);
            line.writer.write_all(b"answer").expect("sent");
            assert_eq!(first.recv(&mut [0; 8]).expect("the answer"), 6);
        }
    }

    #[test]
    fn all_that_has_come_is_read_at_once_and_then_nothing_is_there() {
        let here = || UdpSocket::bind("127.0.0.1:0").expect("a port");
        let (socket, peer, stranger) = (here(), here(), here());
        let to = socket.local_addr().expect("an address");
        let fixed = Some(peer.local_addr().expect("an address"));
        let mut line = datagrams(socket, fixed, Duration::from_millis(20)).expect("a line");
        let mut buffer = vec![0; ALL_BYTES];
        let large = vec![7; 40_000];
        for (from, bytes) in [
            (&peer, &b"one"[..]),
            (&stranger, b"foreign"),
            (&peer, b""),
            (&peer, b"two"),
            (&peer, &large),
            (&peer, &large),
            (&peer, &large),
        ] {
            from.send_to(bytes, to).expect("sent");
        }
        // The third large one might not have fitted.
        let got = line.reader.read_all(&mut buffer).expect("they came");
        assert_eq!((got, &buffer[..6]), (6 + 2 * large.len(), &b"onetwo"[..]));
        assert_eq!(line.reader.read_all(&mut buffer).expect("it came"), large.len());
        let silence = line.reader.read_all(&mut buffer).expect_err("nothing more");
        assert!(is_silence(&silence), "{silence}");
        peer.send_to(b"later", to).expect("sent");
        assert_eq!(line.reader.read(&mut buffer).expect("it came"), 5);
    }
    #[cfg(target_os = "linux")]
    #[test]
    fn a_serial_port_passes_every_byte_both_ways_and_has_one_user() {
        use rustix::pty::{OpenptFlags, openpt, ptsname, unlockpt};
        let vehicle = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo terminal");
        unlockpt(&vehicle).expect("unlocked");
        let device = ptsname(&vehicle, Vec::new()).expect("its name").into_string().expect("text");
        let endpoint = Endpoint::Serial { device, baud: 57_600 };
        let mut line = open(&endpoint, Duration::from_millis(50)).expect("a port");
        let mut vehicle = std::fs::File::from(vehicle);
        let mut got = [0; 16];
        assert!(is_silence(&line.reader.read(&mut got).expect_err("nothing yet")));
        // A terminal would act on most of these.
        let bytes = [0x11, 0x13, b'\r', b'\n', 3, 4, 0x7F, 0xFF];
        vehicle.write_all(&bytes).expect("sent");
        assert_eq!(line.reader.read(&mut got).expect("they come"), bytes.len());
        assert_eq!(got[..8], bytes);
        line.writer.write_all(&bytes).expect("sent");
        vehicle.read_exact(&mut got[8..]).expect("they come");
        assert_eq!(got[8..], bytes);
        let second = open(&endpoint, Duration::ZERO).err().expect("it has a user");
        assert!(format!("{second:#}").contains("another program"), "{second:#}");
        drop(vehicle);
        // Unplugged: no silence.
        assert!(line.reader.read(&mut got).is_ok_and(|got| got == 0));
    }
}
