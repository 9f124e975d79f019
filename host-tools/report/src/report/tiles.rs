//! Server of map tiles, which only `--map` names.

use std::str::FromStr;

/// Address of map tiles with `{z}`, `{x}` and `{y}`, as XYZ tile servers have it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tiles {
    address: String,
    origin: String,
}

impl Tiles {
    pub(crate) fn policy(&self) -> String {
        format!("img-src {}; ", self.origin)
    }

    pub(crate) fn element(&self) -> String {
        format!("\n<meta name=\"tiles\" content=\"{}\">", self.address.replace('&', "&amp;"))
    }
}

impl FromStr for Tiles {
    type Err = String;

    fn from_str(address: &str) -> Result<Self, String> {
        const EXAMPLE: &str = "for example https://tiles.example.org/{z}/{x}/{y}.png";
        let scheme = ["https://", "http://"].into_iter().find(|scheme| address.starts_with(scheme));
        let (Some(scheme), true) = (scheme, ["{z}", "{x}", "{y}"].iter().all(|part| address.contains(part)))
        else {
            return Err(format!(
                "an address of map tiles begins with https:// and has {{z}}, {{x}} and {{y}}: {EXAMPLE}"
            ));
        };
        let host = address[scheme.len()..].split(['/', '?', '#']).next().unwrap_or_default();
        let is_host = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | ':');
        let is_in_address = |c: char| c.is_ascii_graphic() && !matches!(c, '"' | '\'' | '<' | '>');
        if host.is_empty() || !host.chars().all(is_host) || !address.chars().all(is_in_address) {
            return Err(format!(
                "the address of map tiles has no plain host, or marks that an address cannot have: {EXAMPLE}"
            ));
        }
        Ok(Self { address: address.to_owned(), origin: format!("{scheme}{host}") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_named_server_is_in_the_policy_and_no_address_leaves_its_element() {
        let tiles: Tiles = "https://t.example.org:8443/{z}/{x}/{y}.png?key=1&style=2".parse().unwrap();
        assert_eq!(tiles.policy(), "img-src https://t.example.org:8443; ");
        assert!(
            tiles
                .element()
                .ends_with("content=\"https://t.example.org:8443/{z}/{x}/{y}.png?key=1&amp;style=2\">")
        );
        for address in [
            "t.example.org/{z}/{x}/{y}.png",
            "https://t.example.org/{z}/{x}.png",
            "https:///{z}/{x}/{y}.png",
            "https://a.example.org;script-src/{z}/{x}/{y}",
            "https://user@t.example.org/{z}/{x}/{y}",
            "https://t.example.org/{z}/{x}/{y}\">",
            "https://t.example.org/{z}/{x}/{y} a",
        ] {
            assert!(address.parse::<Tiles>().unwrap_err().contains("for example"), "{address}");
        }
    }
}
