//! Bytes that come in their own time: UDP, TCP, serial. Their arrival times are the clock's, counted from the first.
//!
//! A live source ends when its peer closes it or on Ctrl-C (see [`crate::interrupt`]); silence is handed on as chunks
//! without bytes, so that the pipeline's clock goes on.
//!
//! A network delivers in bursts what no UART could: bytes count as arriving at 921,600 baud at most, the fastest rate of
//! the monitor's port.

use std::io::{self, ErrorKind, Read};
use std::net::{TcpStream, UdpSocket};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::{Chunk, Source};
use crate::endpoint::Endpoint;
use crate::interrupt;

/// How long silence may last before it is handed on.
const SILENCE: Duration = Duration::from_millis(50);
const CONNECT: Duration = Duration::from_secs(10);
/// The largest UDP datagram.
const BUFFER_BYTES: usize = 65_536;
/// The fastest rate of the monitor's port, in bytes a second: 921,600 baud, ten bits a byte.
const BYTES_PER_SECOND_MAX: u64 = 92_160;
/// What is taken from a stream at once: 11 ms of the fastest port.
const STREAM_BYTES: usize = 1024;

/// Anything that reads with a time limit.
trait Port {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;
}

struct Stream<R>(R);

impl<R: Read> Port for Stream<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let end = buffer.len().min(STREAM_BYTES);
        self.0.read(buffer.get_mut(..end).unwrap_or_default())
    }
}

struct Datagrams {
    socket: UdpSocket,
}

impl Port for Datagrams {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.socket.recv(buffer) {
            // An empty datagram is not the end of anything.
            Ok(0) => Err(ErrorKind::WouldBlock.into()),
            // `udpout` before its peer listens: the peer may come yet.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => Err(ErrorKind::WouldBlock.into()),
            result => result,
        }
    }
}

struct Live {
    port: Box<dyn Port>,
    first: Option<Instant>,
    last_us: u64,
    buffer: Vec<u8>,
}

/// Opens a live SRC.
pub(super) fn open(endpoint: &Endpoint) -> Result<Box<dyn Source>> {
    let context = || format!("{endpoint}: cannot be opened");
    let port: Box<dyn Port> = match endpoint {
        Endpoint::UdpIn(address) => {
            let socket = UdpSocket::bind(address.resolve()?).with_context(context)?;
            socket.set_read_timeout(Some(SILENCE)).with_context(context)?;
            Box::new(Datagrams { socket })
        }
        Endpoint::UdpOut(address) => {
            let to = address.resolve()?;
            let any = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
            let socket = UdpSocket::bind(any).with_context(context)?;
            socket.connect(to).with_context(context)?;
            socket.set_read_timeout(Some(SILENCE)).with_context(context)?;
            // Who listens learns from a first, empty datagram where to answer.
            let _ = socket.send(&[]);
            Box::new(Datagrams { socket })
        }
        Endpoint::Tcp(address) => {
            let stream = TcpStream::connect_timeout(&address.resolve()?, CONNECT).with_context(context)?;
            stream.set_read_timeout(Some(SILENCE)).with_context(context)?;
            Box::new(Stream(stream))
        }
        Endpoint::Serial { device, baud } => {
            let port = serialport::new(device, *baud).timeout(SILENCE).open().with_context(context)?;
            Box::new(Stream(port))
        }
        Endpoint::File(_) | Endpoint::Standard => bail!("{endpoint} is not a live source"),
    };
    interrupt::watch();
    Ok(Box::new(Live { port, first: None, last_us: 0, buffer: vec![0; BUFFER_BYTES] }))
}

impl Source for Live {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        loop {
            if interrupt::requested() {
                return Ok(None);
            }
            let got = match self.port.read(&mut self.buffer) {
                Ok(0) => return Ok(None),
                Ok(got) => got,
                Err(error) if is_silence(&error) => 0,
                Err(error) => return Err(error),
            };
            // Before the first byte there is no time to speak of.
            if got == 0 && self.first.is_none() {
                continue;
            }
            let now = Instant::now();
            let first = *self.first.get_or_insert(now);
            let clock_us = u64::try_from(now.duration_since(first).as_micros()).unwrap_or(u64::MAX);
            let at_us = clock_us.max(self.last_us + got as u64 * 1_000_000 / BYTES_PER_SECOND_MAX);
            self.last_us = at_us;
            let bytes = self.buffer.get(..got).unwrap_or_default().to_vec();
            return Ok(Some(Chunk { at_us, bytes }));
        }
    }
}

fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}
