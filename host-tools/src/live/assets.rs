//! The page's files, inside the program.

const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const IMAGE: &str = "image/svg+xml";

macro_rules! assets {
    ($($name:literal $kind:ident;)*) => {
        const ASSETS: &[(&str, &str, &str)] = &[
            $(($name, $kind, include_str!(concat!("assets/", $name))),)*
            // What the report's page is made of too; uPlot 1.6.32, MIT (`src/assets/uPlot.LICENSE`).
            ("elements.js", SCRIPT, include_str!("../assets/elements.js")),
            ("text.js", SCRIPT, include_str!("../assets/text.js")),
            ("lines.js", SCRIPT, include_str!("../assets/lines.js")),
            ("uPlot.iife.min.js", SCRIPT, include_str!("../assets/uPlot.iife.min.js")),
            ("uPlot.min.css", STYLE, include_str!("../assets/uPlot.min.css")),
        ];
    };
}

assets! {
    "index.html" HTML;
    "icon.svg" IMAGE;
    "page.css" STYLE;
    "instruments.css" STYLE;
    "main.js" SCRIPT;
    "dom.js" SCRIPT;
    "shown.js" SCRIPT;
    "badge.js" SCRIPT;
    "link.js" SCRIPT;
    "store.js" SCRIPT;
    "colours.js" SCRIPT;
    "gauge.js" SCRIPT;
    "bar.js" SCRIPT;
    "horizon.js" SCRIPT;
    "compass.js" SCRIPT;
    "plot.js" SCRIPT;
    "spark.js" SCRIPT;
    "map.js" SCRIPT;
    "general.js" SCRIPT;
    "esc.js" SCRIPT;
    "movement.js" SCRIPT;
    "health.js" SCRIPT;
    "condition.js" SCRIPT;
    "notes.js" SCRIPT;
    "player.js" SCRIPT;
    "sound.js" SCRIPT;
    "keys.js" SCRIPT;
}

/// A file's type and text.
pub fn find(name: &str) -> Option<(&'static str, &'static str)> {
    ASSETS.iter().find(|(known, ..)| *known == name).map(|(_, kind, text)| (*kind, *text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_runs_under_its_own_policy() {
        let (_, page) = find("index.html").expect("it is there");
        assert!(!page.contains("<script>") && !page.contains("style=") && !page.contains(" on"));
        for (name, kind, text) in ASSETS.iter().filter(|(name, ..)| !name.starts_with("uPlot")) {
            for markup in ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("] {
                assert!(!text.contains(markup), "{name}: {markup}");
            }
            assert!(
                *kind != SCRIPT || !text.contains("http://") || *name == "elements.js",
                "{name} names an address"
            );
        }
    }

    #[test]
    fn whatever_the_page_asks_for_is_there() {
        for (name, kind, text) in ASSETS {
            for line in text.lines().filter(|line| *kind == SCRIPT && line.starts_with("import ")) {
                let (names, from) = line.split_once(" from \"./").expect("an import is one line");
                let from = from.trim_end_matches("\";");
                let (_, exporter) = find(from).unwrap_or_else(|| panic!("{name} asks for {from}"));
                let names = names.trim_start_matches("import {").trim_end_matches('}').split(',');
                for wanted in names.filter_map(|name| name.split_whitespace().next()) {
                    let exports = format!("export const {wanted} ");
                    assert!(exporter.contains(&exports), "{name}: {from} has no {wanted}");
                }
            }
        }
        let (_, page) = find("index.html").expect("it is there");
        for (name, ..) in ASSETS.iter().filter(|(_, kind, _)| *kind == STYLE) {
            assert!(page.contains(name), "nobody asks for {name}");
        }
    }
}
