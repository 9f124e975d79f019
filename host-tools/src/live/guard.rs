//! Access control: only pages of this server, and other machines only with the token.
//!
//! * `Host` must be an address, `localhost`, or the user's name: a foreign name pointed here (DNS rebinding)
//!   is refused.
//! * A browser names the requesting page in `Origin`: only ours is accepted. Programs send none.
//! * Where other machines reach it, the data connection needs the token. The page itself is part of the
//!   program and public.

use std::net::{IpAddr, SocketAddr};

use anyhow::Result;
use axum::http::{HeaderMap, header};
use sha2::{Digest as _, Sha256};

use crate::outcome::usage;

/// A token of this length cannot be guessed.
const TOKEN_BYTES: usize = 16;
/// Minimum length of the user's own token.
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
            Some(short) if short.len() < TOKEN_CHARS_MIN => {
                return Err(usage(format!(
                    "--listen-token: is too short; give at least {TOKEN_CHARS_MIN} characters"
                )));
            }
            Some(given)
                if !given.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte)) =>
            {
                return Err(usage(
                    "--listen-token: has other characters; give letters, digits, and - _ . only",
                ));
            }
            Some(given) => Some(given.to_owned()),
            None if listen.ip().is_loopback() => None,
            None => Some(random()?),
        };
        let hashed = token.as_deref().map(hash);
        Ok((Self { token: hashed, host: host.to_ascii_lowercase() }, token))
    }

    /// Whether the host has a name of this computer alone.
    pub fn knows_host(&self, headers: &HeaderMap) -> bool {
        host(headers).is_some_and(|host| {
            let name = without_port(host).to_ascii_lowercase();
            name == "localhost" || name == self.host || name.parse::<IpAddr>().is_ok()
        })
    }

    /// Own page's request.
    pub fn knows_origin(&self, headers: &HeaderMap) -> bool {
        let Some(origin) = headers.get(header::ORIGIN) else { return true };
        let ours = host(headers).map(|host| format!("http://{host}"));
        ours.is_some_and(|ours| origin.to_str().is_ok_and(|origin| origin.eq_ignore_ascii_case(&ours)))
    }

    /// Has the token, if needed.
    pub fn knows_token(&self, query: Option<&str>) -> bool {
        let Some(wanted) = &self.token else { return true };
        let mut pairs = query.unwrap_or_default().split('&').filter_map(|pair| pair.split_once('='));
        let given = pairs.find(|(name, _)| *name == "token").map_or("", |(_, token)| token);
        let differ = hash(given).iter().zip(wanted).fold(0, |differ, (a, b)| differ | (a ^ b));
        differ == 0
    }
}

fn host(headers: &HeaderMap) -> Option<&str> {
    let mut hosts = headers.get_all(header::HOST).iter();
    let host = hosts.next()?.to_str().ok()?;
    // Two of them are an attack.
    hosts.next().is_none().then_some(host)
}

/// `[::1]:8080` and `127.0.0.1:8080` without the rest.
fn without_port(host: &str) -> &str {
    if let Some(rest) = host.strip_prefix('[') {
        return rest.split(']').next().unwrap_or_default();
    }
    host.split(':').next().unwrap_or_default()
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

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().expect("a header"));
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().expect("a header"));
        }
        headers
    }

    fn guard(listen: &str, token: Option<&str>) -> (Guard, Option<String>) {
        Guard::new(listen.parse().expect("an address"), "drone-pc", token).expect("good")
    }

    #[test]
    fn a_foreign_name_that_points_here_is_refused() {
        let (guard, _) = guard("127.0.0.1:8080", None);
        for good in
            ["127.0.0.1:8080", "localhost:8080", "LOCALHOST", "[::1]:8080", "192.168.1.5:80", "drone-pc:8080"]
        {
            assert!(guard.knows_host(&headers(good, None)), "{good}");
        }
        for bad in
            ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "", "localhost.evil.example:8080"]
        {
            assert!(!guard.knows_host(&headers(bad, None)), "{bad}");
        }
        assert!(!guard.knows_host(&HeaderMap::new()));
    }

    #[test]
    fn only_our_own_page_may_ask_from_a_browser() {
        let (guard, _) = guard("127.0.0.1:8080", None);
        let knows = |origin| guard.knows_origin(&headers("127.0.0.1:8080", origin));
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
        assert!(closed.knows_token(Some(&format!("a=b&token={token}"))));
        for bad in [None, Some(""), Some("token="), Some("token=0"), Some("nekot=1")] {
            assert!(!closed.knows_token(bad), "{bad:?}");
        }
        assert!(guard("127.0.0.1:80", Some("correct-horse")).0.knows_token(Some("token=correct-horse")));
        assert!(Guard::new("0.0.0.0:1".parse().expect("an address"), "", Some("short")).is_err());
    }
}
