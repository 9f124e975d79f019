//! The files of the live page.

use std::borrow::Cow;
use std::sync::OnceLock;

use crate::page::program::{ICON, LIVE, STYLE, UPLOT, program};

/// A file's type and text.
pub fn find(name: &str) -> Option<(&'static str, Cow<'static, str>)> {
    const SCRIPT: &str = "text/javascript; charset=utf-8";
    static PROGRAM: OnceLock<String> = OnceLock::new();
    Some(match name {
        "index.html" => ("text/html; charset=utf-8", LIVE.into()),
        "icon.svg" => ("image/svg+xml", ICON.into()),
        "page.css" => ("text/css; charset=utf-8", STYLE.concat().into()),
        "uPlot.js" => (SCRIPT, UPLOT.into()),
        "page.js" => (SCRIPT, PROGRAM.get_or_init(|| program("live")).as_str().into()),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_runs_under_its_own_policy_and_whatever_it_asks_for_is_there() {
        let (_, page) = find("index.html").expect("it is there");
        assert!(!page.contains("<script>") && !page.contains("style=") && !page.contains(" on"));
        let asked: Vec<&str> = page
            .split(['"', '>'])
            .filter(|word| [".js", ".css", ".svg"].iter().any(|end| word.ends_with(end)))
            .collect();
        assert_eq!(asked.len(), 4, "{asked:?}");
        for name in asked {
            assert!(find(name).is_some(), "{name}");
        }
    }
}
