//! Which Debian or Ubuntu this is, and how its package sources are extended to its backports.
//!
//! Everything here is text in, text out: the reading and writing of files is in [`crate::setup`].

/// What `/etc/os-release` says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Distribution {
    /// `debian`, `ubuntu`, or another's name.
    pub(crate) id: String,
    /// Such as `bookworm` or `jammy`; empty where there is none.
    pub(crate) codename: String,
}

impl Distribution {
    pub(crate) fn parse(os_release: &str) -> Self {
        let field = |name: &str| {
            let line = os_release.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix('='));
            line.unwrap_or_default().trim_matches('"').to_owned()
        };
        Self { id: field("ID"), codename: field("VERSION_CODENAME") }
    }

    pub(crate) fn is_debian(&self) -> bool {
        self.id == "debian"
    }
}

/// A file for `/etc/apt/sources.list.d`.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct SourceFile {
    pub(crate) name: &'static str,
    pub(crate) text: String,
}

/// The entry for `<codename>-backports`, derived from the machine's own entry for `codename`: the same archive (or
/// mirror), the same key and the same options. `files` are the names and texts of the machine's source files.
/// `None` if none of them has an entry for `codename`.
pub(crate) fn backports(files: &[(String, String)], codename: &str) -> Option<SourceFile> {
    files.iter().find_map(|(name, text)| {
        if has_extension(name, "sources") {
            let text = text.split("\n\n").find_map(|stanza| backports_deb822(stanza, codename))?;
            Some(SourceFile { name: "hums-backports.sources", text })
        } else if has_extension(name, "list") {
            let text = text.lines().find_map(|line| backports_line(line, codename))?;
            Some(SourceFile { name: "hums-backports.list", text })
        } else {
            None
        }
    })
}

fn has_extension(name: &str, extension: &str) -> bool {
    std::path::Path::new(name).extension().is_some_and(|found| found == extension)
}

/// One stanza of a `.sources` file.
fn backports_deb822(stanza: &str, codename: &str) -> Option<String> {
    let field = |wanted: &str| {
        stanza.lines().find_map(|line| {
            let (name, value) = line.split_once(':')?;
            name.trim().eq_ignore_ascii_case(wanted).then(|| value.trim())
        })
    };
    let lists = |name, wanted| field(name).is_some_and(|value| value.split_whitespace().any(|v| v == wanted));
    let disabled = field("Enabled").is_some_and(|value| matches!(value, "no" | "false" | "0"));
    if disabled || !lists("Types", "deb") || !lists("Suites", codename) || !lists("Components", "main") {
        return None;
    }
    let mut out = format!("Types: deb\nSuites: {codename}-backports\nComponents: main\n");
    // The rest as it stands: URIs, the key (a file's name, or the key itself over several lines), options.
    let mut keep = false;
    for line in stanza.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty()) {
        if !line.starts_with([' ', '\t']) {
            let name = line.split(':').next().unwrap_or_default().to_ascii_lowercase();
            keep = !matches!(name.as_str(), "types" | "suites" | "components" | "enabled");
        }
        if keep {
            out.push_str(line);
            out.push('\n');
        }
    }
    Some(out)
}

/// One line of a `.list` file: `deb [options] URI suite component...`.
fn backports_line(line: &str, codename: &str) -> Option<String> {
    let rest = line.trim().strip_prefix("deb")?.strip_prefix([' ', '\t'])?.trim_start();
    let (options, rest) = match rest.strip_prefix('[') {
        Some(inside) => {
            let (options, rest) = inside.split_once(']')?;
            (format!("[{}] ", options.trim()), rest)
        }
        None => (String::new(), rest),
    };
    let mut words = rest.split('#').next()?.split_whitespace();
    let (uri, suite) = (words.next()?, words.next()?);
    (suite == codename && words.any(|component| component == "main"))
        .then(|| format!("deb {options}{uri} {codename}-backports main\n"))
}

/// The major version in what `qemu-system-arm --version` prints, or in a package's version such as `1:10.0.2+ds-2`.
pub(crate) fn major_version(text: &str) -> Option<u32> {
    let text = text.trim();
    let text = match text.strip_prefix("QEMU emulator version ") {
        Some(version) => version,
        None => text.split_once(':').map_or(text, |(_epoch, version)| version),
    };
    text.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

/// The suite from which `apt-cache madison` offers a package of at least the major version `least`.
/// Its lines are `package | version | URI suite/component architecture Packages`.
pub(crate) fn suite_with(madison: &str, least: u32) -> Option<String> {
    madison.lines().find_map(|line| {
        let mut columns = line.split('|').map(str::trim);
        let (_package, version, place) = (columns.next()?, columns.next()?, columns.next()?);
        let suite = place.split_whitespace().nth(1)?.split('/').next()?;
        (place.ends_with("Packages") && major_version(version)? >= least).then(|| suite.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(name: &str, text: &str) -> Vec<(String, String)> {
        vec![(name.to_owned(), text.to_owned())]
    }

    #[test]
    fn distributions_are_told_apart() {
        let debian = Distribution::parse(
            "PRETTY_NAME=\"Debian GNU/Linux 12\"\nID=debian\nVERSION_CODENAME=bookworm\n",
        );
        assert_eq!((debian.is_debian(), debian.codename.as_str()), (true, "bookworm"));
        let ubuntu = Distribution::parse("ID=ubuntu\nID_LIKE=debian\nVERSION_CODENAME=\"jammy\"\n");
        assert_eq!(
            (ubuntu.is_debian(), ubuntu.id.as_str(), ubuntu.codename.as_str()),
            (false, "ubuntu", "jammy")
        );
    }

    #[test]
    fn a_deb822_entry_keeps_its_mirror_and_key() {
        let text = "Types: deb deb-src\n# snapshot\nURIs: http://mirror.example/debian\nSuites: bookworm bookworm-updates\n\
                    Components: main contrib\nSigned-By: /usr/share/keyrings/a.gpg\n\nTypes: deb\nURIs: http://other.example\n\
                    Suites: bookworm-security\nComponents: main\n";
        let made = backports(&files("debian.sources", text), "bookworm").unwrap();
        assert_eq!(made.name, "hums-backports.sources");
        assert_eq!(
            made.text,
            "Types: deb\nSuites: bookworm-backports\nComponents: main\n\
             URIs: http://mirror.example/debian\nSigned-By: /usr/share/keyrings/a.gpg\n"
        );
    }

    #[test]
    fn a_key_written_into_the_entry_comes_along_whole() {
        let text = "Types: deb\nURIs: http://m.example\nSuites: bookworm\nComponents: main\nSigned-By:\n -----BEGIN\n .\n abc\n -----END\n";
        let made = backports(&files("a.sources", text), "bookworm").unwrap();
        assert!(made.text.ends_with("Signed-By:\n -----BEGIN\n .\n abc\n -----END\n"), "{}", made.text);
    }

    #[test]
    fn a_one_line_entry_keeps_its_options() {
        let text = "# deb http://x bookworm main\ndeb-src http://m.example/debian bookworm main\n\
                    deb http://sec.example bookworm-security main\n\
                    deb [ arch=amd64 signed-by=/k.gpg ] http://m.example/debian bookworm main contrib # ours\n";
        let made = backports(&files("sources.list", text), "bookworm").unwrap();
        assert_eq!(made.name, "hums-backports.list");
        assert_eq!(
            made.text,
            "deb [arch=amd64 signed-by=/k.gpg] http://m.example/debian bookworm-backports main\n"
        );
    }

    #[test]
    fn disabled_foreign_and_commented_entries_are_no_source() {
        let disabled = "Enabled: no\nTypes: deb\nURIs: http://m\nSuites: bookworm\nComponents: main\n";
        assert_eq!(backports(&files("a.sources", disabled), "bookworm"), None);
        assert_eq!(backports(&files("a.sources.save", &disabled[12..]), "bookworm"), None);
        assert_eq!(
            backports(
                &files("a.list", "#deb http://m bookworm main\ndebian bookworm main\ndeb\n"),
                "bookworm"
            ),
            None
        );
        assert_eq!(backports(&files("a.list", "deb http://m trixie main"), "bookworm"), None);
    }

    #[test]
    fn versions_of_qemu_are_read_as_printed_and_as_packaged() {
        assert_eq!(major_version("QEMU emulator version 7.2.15 (Debian 1:7.2+dfsg-7)\nCopyright"), Some(7));
        assert_eq!(major_version("1:10.0.2+ds-2+deb13u1~bpo12+1"), Some(10));
        assert_eq!(major_version("8.2.2"), Some(8));
        assert_eq!(major_version("unknown"), None);
    }

    #[test]
    fn the_suite_with_a_new_enough_version_is_found() {
        let madison = " qemu-system-arm | 1:10.0.2+ds-2~bpo12+1 | http://m.example/debian bookworm-backports/main amd64 Packages\n \
                        qemu-system-arm | 1:7.2+dfsg-7 | http://m.example/debian bookworm/main amd64 Packages\n";
        assert_eq!(suite_with(madison, 8).as_deref(), Some("bookworm-backports"));
        assert_eq!(suite_with(madison, 11), None);
        assert_eq!(suite_with("", 8), None);
    }
}
