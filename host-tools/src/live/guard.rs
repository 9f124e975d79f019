//! Access control: only pages of this server, and other machines only with the token.
//!
//! * `Host` must be an address, `localhost`, or the user's name: a foreign name pointed here (DNS rebinding)
//!   is refused.
//! * A browser names the requesting page in `Origin`: only ours is accepted. Programs send none.
//! * Where other machines reach it, the data connection needs the token.

use std::net::{IpAddr, SocketAddr};

use anyhow::Result;
use sha2::{Digest as _, Sha256};

use crate::outcome::usage;

/// A token of this length cannot be guessed.
const TOKEN_BYTES: usize = 16;
const TOKEN_CHARS_MIN: usize = 8;

/// Checks of a request.
#[derive(Clone, Debug)]
pub struct Guard {
    /// Hashed, so that the time of a comparison reveals no part of it.
    token: Option<[u8; 32]>,
    host: String,
}

impl Guard {
    /// The user named it `host`; returns the token that the page needs.
    pub fn new(listen: SocketAddr, host: &str, token: Option<&str>) -> Result<(Self, Option<String>)> {
        let token = match token {
            Some(given) => {
                let is_good = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
                if given.len() < TOKEN_CHARS_MIN || !given.bytes().all(is_good) {
                    return Err(usage(format!(
                        "--listen-token: give at least {TOKEN_CHARS_MIN} letters, digits, or - _ ."
                    )));
                }
                Some(given.to_owned())
            }
            None if listen.ip().is_loopback() => None,
            None => Some(random()?),
        };
        let hashed = token.as_deref().map(hash);
        Ok((Self { token: hashed, host: host.to_ascii_lowercase() }, token))
    }

    /// Whether the request's `Host` is a name of this computer alone.
    pub fn knows_host(&self, host: Option<&str>) -> bool {
        host.and_then(without_port).is_some_and(|name| {
            let name = name.to_ascii_lowercase();
            name == "localhost" || name == self.host || name.parse::<IpAddr>().is_ok()
        })
    }

    /// Own page's request, by its `Host` and `Origin`.
    pub fn knows_origin(&self, host: Option<&str>, origin: Option<&str>) -> bool {
        let Some(origin) = origin else { return true };
        host.is_some_and(|host| origin.eq_ignore_ascii_case(&format!("http://{host}")))
    }

    /// Has the token, if needed.
    pub fn knows_token(&self, given: Option<&str>) -> bool {
        let Some(wanted) = &self.token else { return true };
        let given = hash(given.unwrap_or_default());
        given.iter().zip(wanted).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
    }
}

/// `[::1]:8080` and `127.0.0.1:8080` without the rest; `None` if a port is no number.
fn without_port(host: &str) -> Option<&str> {
    let (name, port) =
        if host.ends_with(']') { (host, "") } else { host.rsplit_once(':').unwrap_or((host, "")) };
    let name = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    port.bytes().all(|byte| byte.is_ascii_digit()).then_some(name)
}

fn hash(token: &str) -> [u8; 32] {
    Sha256::digest(token.as_bytes()).into()
}

fn random() -> Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(|error| anyhow::anyhow!("no random numbers for a token: {error}"))?;
    Ok(format!("{:032x}", u128::from_be_bytes(bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard(listen: &str, token: Option<&str>) -> (Guard, Option<String>) {
        Guard::new(listen.parse().expect("an address"), "drone-pc", token).expect("good")
    }

    #[test]
    fn a_foreign_name_that_points_here_is_refused() {
        let (guard, _) = guard("127.0.0.1:8080", None);
        for good in
            ["127.0.0.1:8080", "localhost:8080", "LOCALHOST", "[::1]:8080", "192.168.1.5:80", "drone-pc:8080"]
        {
            assert!(guard.knows_host(Some(good)), "{good}");
        }
        for bad in [
            "evil.example",
            "evil.example:8080",
            "127.0.0.1.evil.example",
            "",
            "localhost.evil.example:8080",
            "localhost:8080, evil.example",
        ] {
            assert!(!guard.knows_host(Some(bad)), "{bad}");
        }
        assert!(!guard.knows_host(None));
    }

    #[test]
    fn only_our_own_page_may_ask_from_a_browser() {
        let (guard, _) = guard("127.0.0.1:8080", None);
        let knows = |origin| guard.knows_origin(Some("127.0.0.1:8080"), origin);
        assert!(knows(None) && knows(Some("http://127.0.0.1:8080")));
        for bad in ["http://evil.example", "null", "http://127.0.0.1:8081", "https://127.0.0.1:8080", ""] {
            assert!(!knows(Some(bad)), "{bad}");
        }
    }

    #[test]
    fn other_machines_need_the_token() {
        let (open, none) = guard("127.0.0.1:8080", None);
        assert!(none.is_none() && open.knows_token(None));
        let (closed, token) = guard("0.0.0.0:8080", None);
        let token = token.expect("one is made");
        assert_eq!(token.len(), 2 * TOKEN_BYTES);
        assert!(closed.knows_token(Some(&token)));
        for bad in [None, Some(""), Some("0"), Some(&token[1..])] {
            assert!(!closed.knows_token(bad), "{bad:?}");
        }
        assert!(guard("127.0.0.1:80", Some("correct-horse")).0.knows_token(Some("correct-horse")));
        assert!(Guard::new("0.0.0.0:1".parse().expect("an address"), "", Some("short")).is_err());
    }
}
