//! Where the bytes of the ground-station UART go.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::time::Duration;

use anyhow::{Context, Result};

use crate::endpoint::Endpoint;
use crate::output::Stdout;

const CONNECT: Duration = Duration::from_secs(10);
const WRITE: Duration = Duration::from_secs(5);
/// A datagram that fits the smallest path without being cut up.
const DATAGRAM_BYTES_MAX: usize = 1200;

/// Opens SINK.
pub fn open(endpoint: &Endpoint) -> Result<Box<dyn Write + Send>> {
    let context = || format!("{endpoint}: cannot be opened for writing");
    Ok(match endpoint {
        Endpoint::File(path) => Box::new(BufWriter::new(File::create(path).with_context(context)?)),
        Endpoint::Standard => Box::new(BufWriter::new(Stdout::new())),
        Endpoint::UdpOut(address) => {
            let to = address.resolve()?;
            let any = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
            Box::new(Datagrams {
                socket: UdpSocket::bind(any).with_context(context)?,
                peer: Some(to),
                answers: false,
            })
        }
        Endpoint::UdpIn(address) => {
            let socket = UdpSocket::bind(address.resolve()?).with_context(context)?;
            socket.set_nonblocking(true).with_context(context)?;
            Box::new(Datagrams { socket, peer: None, answers: true })
        }
        Endpoint::Tcp(address) => {
            let stream = TcpStream::connect_timeout(&address.resolve()?, CONNECT).with_context(context)?;
            stream.set_write_timeout(Some(WRITE)).with_context(context)?;
            stream.set_nodelay(true).with_context(context)?;
            Box::new(stream)
        }
        Endpoint::Serial { device, baud } => {
            Box::new(serialport::new(device, *baud).timeout(WRITE).open().with_context(context)?)
        }
    })
}

/// UDP: to a fixed peer, or (`udpin`) to whoever spoke last; before anyone did, bytes go nowhere, as on a UART that
/// nothing is plugged into.
struct Datagrams {
    socket: UdpSocket,
    peer: Option<SocketAddr>,
    answers: bool,
}

impl Write for Datagrams {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.answers {
            let mut scrap = [0; 16];
            while let Ok((_, from)) = self.socket.recv_from(&mut scrap) {
                self.peer = Some(from);
            }
        }
        if let Some(peer) = self.peer {
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
