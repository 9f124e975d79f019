//! Sources and destinations of bytes on the command line: SRC and SINK.

use std::fmt;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Context, Result};

/// The forms, for `--help` and every usage error.
pub const FORMS: &str =
    "a file, `-`, `udpin:ADDR:PORT`, `udpout:ADDR:PORT`, `tcp:ADDR:PORT` or `serial:DEVICE:BAUD`";

/// One end of a connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// A file.
    File(PathBuf),
    /// Standard input or output.
    Standard,
    /// A UDP port that others send to.
    UdpIn(Address),
    /// A UDP port of another machine, to send to.
    UdpOut(Address),
    /// A TCP server to connect to.
    Tcp(Address),
    /// A serial port, 8N1 without flow control.
    Serial {
        /// For instance `/dev/ttyUSB0` or `COM3`.
        device: String,
        /// Bits per second.
        baud: u32,
    },
}

/// A host and a port, looked up when it is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    host: String,
    port: u16,
}

impl Address {
    /// The first address that the name stands for.
    pub fn resolve(&self) -> Result<SocketAddr> {
        (self.host.as_str(), self.port)
            .to_socket_addrs()
            .with_context(|| format!("{self}: there is no such host; check its name and the network"))?
            .next()
            .with_context(|| format!("{self}: the name has no address; give the address itself"))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.host.contains(':') {
            write!(f, "[{}]:{}", self.host, self.port)
        } else {
            write!(f, "{}:{}", self.host, self.port)
        }
    }
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is not ADDR:PORT, for instance 0.0.0.0:14550 to listen on all addresses of this computer"
            )
        };
        let (host, port) = text.rsplit_once(':').ok_or_else(wrong)?;
        let host = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
        if host.is_empty() {
            return Err(format!(
                "`{text}` has no address before the port: 0.0.0.0 stands for every interface"
            ));
        }
        let port = port.parse().map_err(|_| format!("`{port}` is no port: 1 to 65535"))?;
        if port == 0 { Err(wrong()) } else { Ok(Self { host: host.to_owned(), port }) }
    }
}

impl Endpoint {
    /// Whether bytes come in their own time, not from a store.
    pub fn is_live(&self) -> bool {
        !matches!(self, Self::File(_) | Self::Standard)
    }
}

/// A path without a slash at its end: behind the name of a file it has no meaning.
pub fn without_slash(path: PathBuf) -> PathBuf {
    let bare: PathBuf = path.components().collect();
    if bare.is_file() { bare } else { path }
}

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "-" {
            return Ok(Self::Standard);
        }
        if text.is_empty() {
            return Err(format!("nothing is named: give {FORMS}"));
        }
        match text.split_once(':') {
            Some(("udpin", rest)) => rest.parse().map(Self::UdpIn),
            Some(("udpout", rest)) => rest.parse().map(Self::UdpOut),
            Some(("tcp", rest)) => rest.parse().map(Self::Tcp),
            Some(("serial", rest)) => serial(rest),
            // A scheme that other tools have is a slip, unless there is such a file.
            Some((
                scheme @ ("udp" | "udpbcast" | "tcpin" | "tcpout" | "com" | "uart" | "file" | "http"),
                _,
            )) if !PathBuf::from(text).exists() => Err(format!("there is no `{scheme}:` here: give {FORMS}")),
            _ => Ok(Self::File(without_slash(PathBuf::from(text)))),
        }
    }
}

/// Beginnings of the names of ports without a line, on Linux and macOS: a device on USB that is a port itself.
const USB_PORTS: [&str; 2] = ["/dev/ttyACM", "/dev/cu.usbmodem"];
/// Their rate, which has no effect.
const ANY_RATE: u32 = 115_200;

fn serial(text: &str) -> Result<Endpoint, String> {
    let wrong =
        || format!("`serial:{text}` is not serial:DEVICE:BAUD, for instance serial:/dev/ttyUSB0:57600");
    let (device, baud) = match text.rsplit_once(':') {
        Some((device, baud)) => (device, baud.parse().map_err(|_| wrong())?),
        None if USB_PORTS.iter().any(|start| text.starts_with(start)) => (text, ANY_RATE),
        None => return Err(wrong()),
    };
    if device.is_empty() || baud == 0 {
        return Err(wrong());
    }
    Ok(Endpoint::Serial { device: device.to_owned(), baud })
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(f, "{}", path.display()),
            Self::Standard => f.write_str("-"),
            Self::UdpIn(address) => write!(f, "udpin:{address}"),
            Self::UdpOut(address) => write!(f, "udpout:{address}"),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Serial { device, baud } => write!(f, "serial:{device}:{baud}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slash_behind_the_name_of_a_file_is_no_part_of_it() {
        let dir = tempfile::tempdir().expect("a folder");
        let slash = |name: &str| PathBuf::from(format!("{}/", dir.path().join(name).display()));
        std::fs::write(dir.path().join("card.img"), "").expect("room");
        assert_eq!(without_slash(slash("card.img")), dir.path().join("card.img"));
        for other in [slash(""), slash("nosuch"), PathBuf::from("-")] {
            assert_eq!(without_slash(other.clone()), other);
        }
    }

    #[test]
    fn every_form_reads_and_prints_alike() {
        for text in [
            "-",
            "flight.tlog",
            "udpin:0.0.0.0:14550",
            "udpout:[::1]:14550",
            "tcp:localhost:5760",
            "serial:/dev/ttyUSB0:921600",
        ] {
            let endpoint: Endpoint = text.parse().expect(text);
            assert_eq!(endpoint.to_string(), text);
        }
    }

    #[test]
    fn a_port_on_usb_needs_no_rate() {
        for device in ["/dev/ttyACM0", "/dev/cu.usbmodem1234"] {
            let endpoint: Endpoint = format!("serial:{device}").parse().expect(device);
            assert_eq!(endpoint, Endpoint::Serial { device: device.to_owned(), baud: ANY_RATE });
        }
    }

    #[test]
    fn a_windows_path_is_a_file() {
        assert_eq!(Ok(Endpoint::File(PathBuf::from("C:\\log.tlog"))), "C:\\log.tlog".parse());
    }

    #[test]
    fn what_is_malformed_says_what_to_give() {
        for text in [
            "",
            "udpin:14550",
            "udpin::14550",
            "udpout:host:0",
            "tcp:host:70000",
            "tcp:host",
            "serial:/dev/ttyUSB0",
            "serial::57600",
            "udp:127.0.0.1:14550",
        ] {
            let error = text.parse::<Endpoint>().expect_err(text);
            assert!(error.len() > 20, "{text}: {error}");
        }
    }
}
