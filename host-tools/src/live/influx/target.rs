//! The destination of points: a database and its interface.
//!
//! | flags | interface | for |
//! |---|---|---|
//! | `--org O` | `/api/v2/write?org=O&bucket=B` | `InfluxDB` 2 and 3, `VictoriaMetrics` |
//! | none | `/write?db=B` | `InfluxDB` 1.x (and 3), `VictoriaMetrics`, `QuestDB` |

use std::fmt::Write as _;

use anyhow::Result;

use crate::outcome::usage;

/// A database.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// Address for batches.
    pub write: String,
    /// Creates the database: 1.x has no buckets to set up.
    pub create: Option<String>,
    /// Value of the header `Authorization`.
    pub authorization: Option<String>,
}

impl Target {
    /// The database of the flags.
    pub fn new(url: &str, token: Option<&str>, org: Option<&str>, bucket: &str) -> Result<Self> {
        let base = url.trim_end_matches('/');
        if base.starts_with("https://") {
            return Err(usage(
                "--influx: this program speaks http only; put a proxy on this PC before an https database",
            ));
        }
        let host = base.strip_prefix("http://").unwrap_or_default();
        if host.is_empty() || base.contains(['?', '#', ' ']) {
            return Err(usage(format!("--influx `{url}` is no address; for instance http://127.0.0.1:8086")));
        }
        for (flag, name) in [("--org", org), ("--bucket", Some(bucket))] {
            if name == Some("") {
                return Err(usage(format!("{flag} is empty; name one")));
            }
        }
        let statement = format!("CREATE DATABASE \"{}\"", bucket.replace(['"', '\\'], "_"));
        let bucket = percent(bucket);
        let authorization = token.map(|token| format!("Token {token}"));
        Ok(match org {
            Some(org) => Self {
                write: format!("{base}/api/v2/write?org={}&bucket={bucket}&precision=ns", percent(org)),
                create: None,
                authorization,
            },
            None => Self {
                write: format!("{base}/write?db={bucket}&precision=ns"),
                create: Some(format!("{base}/query?q={}", percent(&statement))),
                authorization,
            },
        })
    }
}

/// Escaped for an address.
fn percent(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.' | b'~') {
            out.push(byte as char);
        } else {
            // Writing to a `String` cannot fail.
            let _ = write!(out, "%{byte:02X}");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_choose_the_interface() {
        let two = Target::new("http://h:8086/", Some("t"), Some("my org"), "b&b").expect("good");
        assert_eq!(two.write, "http://h:8086/api/v2/write?org=my%20org&bucket=b%26b&precision=ns");
        assert_eq!(two.authorization.as_deref(), Some("Token t"));
        let one = Target::new("http://h:8086", None, None, "hums").expect("good");
        assert_eq!(one.write, "http://h:8086/write?db=hums&precision=ns");
        assert_eq!(one.create.as_deref(), Some("http://h:8086/query?q=CREATE%20DATABASE%20%22hums%22"));
    }

    #[test]
    fn what_is_no_address_is_a_usage_error() {
        for url in ["", "localhost:8086", "http://", "https://cloud.example", "http://h/?a=b"] {
            assert!(Target::new(url, None, None, "hums").is_err(), "{url}");
        }
    }
}
