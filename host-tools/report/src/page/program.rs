//! The page's program: one script of many modules, because a self-contained page cannot import files.
//!
//! The files in `assets/` are ECMAScript modules, with two habits that make joining them simple. An `import`
//! is one line, and an export is a `const` at its definition. Each becomes a function that is called once and
//! returns its exports; an import takes from that. `live`, `report`, `index`, `compare`, `fleet`, `check` and `worker` are imported by no
//! other module: each with its imports is one program.

use std::fmt::Write as _;

macro_rules! modules {
    ($($name:literal)*) => {
        const MODULES: &[(&str, &str)] = &[$(($name, include_str!(concat!("assets/", $name, ".js"))),)*];
    };
}

modules! {
    // Any page.
    "badge" "canvas" "colours" "dom" "elements" "flight" "layout" "map" "notes" "parameters" "plot" "plots" "text" "tiles" "timeline" "view"
    "data" "recorder" "report" "spectrum" "summary" "trend" "usage"
    // The table of a folder's pages, the comparison of flights, and a fleet.
    "index" "compare" "fleet" "sorted"
    // The check in a browser, and its worker.
    "check" "worker"
    // The one that grows.
    "bar" "bench" "compass" "condition" "esc" "gauge" "general" "health" "horizon" "keys" "link" "live" "movement" "player" "sound" "spark"
}

/// uPlot 1.6.32, MIT (`assets/uPlot.LICENSE`).
pub const UPLOT: &str = include_str!("assets/uPlot.iife.min.js");
/// The style sheets, to be put together.
pub const STYLE: [&str; 2] = [include_str!("assets/uPlot.min.css"), include_str!("assets/page.css")];

/// The document of the live page.
pub const LIVE: &str = include_str!("assets/live.html");
/// Its icon.
pub const ICON: &str = include_str!("assets/icon.svg");

/// The program that begins with a module.
pub fn program(entry: &str) -> String {
    let mut program = String::from("\"use strict\";\n(() => {\n");
    for name in needed(entry) {
        push_module(&mut program, name, text(name));
    }
    program.push_str("})();\n");
    program
}

/// A module and its imports, each after those that it imports from.
fn needed(entry: &str) -> Vec<&str> {
    let mut order = Vec::new();
    add(entry, &mut order, &mut Vec::new());
    order
}

fn add<'a>(name: &'a str, order: &mut Vec<&'a str>, open: &mut Vec<&'a str>) {
    if order.contains(&name) || open.contains(&name) {
        return;
    }
    open.push(name);
    for (_, from) in text(name).lines().filter_map(import) {
        add(from, order, open);
    }
    open.pop();
    order.push(name);
}

fn text(name: &str) -> &'static str {
    MODULES.iter().find(|(known, _)| *known == name).map_or("", |(_, text)| text)
}

fn push_module(out: &mut String, name: &str, text: &str) {
    let _ = writeln!(out, "const module_{name} = (() => {{");
    let mut exports = Vec::new();
    for line in text.lines() {
        if let Some((names, from)) = import(line) {
            let _ = writeln!(out, "const {{{names}}} = module_{from};");
        } else if let Some(name) = export(line) {
            exports.push(name);
            out.push_str(line.trim_start_matches("export "));
            out.push('\n');
        } else {
            out.push_str(line);
            out.push('\n');
        }
    }
    let _ = writeln!(out, "return {{ {} }};\n}})();", exports.join(", "));
}

fn import(line: &str) -> Option<(&str, &str)> {
    let (names, from) = line.strip_prefix("import {")?.split_once("} from \"./")?;
    Some((names, from.strip_suffix(".js\";")?))
}

fn export(line: &str) -> Option<&str> {
    line.strip_prefix("export const ")?.split([' ', '=']).next()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn words(text: &str) -> impl Iterator<Item = &str> {
        text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '-' || c == '$'))
    }

    #[test]
    fn each_import_is_of_something_that_is_exported_and_is_used_and_no_module_is_in_a_circle() {
        for (name, text) in MODULES {
            let order = needed(name);
            for line in text.lines().filter(|line| line.starts_with("import")) {
                let (names, from) = import(line).expect("an import is one line");
                assert!(needed(from).iter().all(|other| other != name), "{name} and {from} need each other");
                assert!(order.contains(&from), "{name}: there is no {from}");
                let exports: Vec<&str> = super::text(from).lines().filter_map(export).collect();
                for wanted in names.split(',').map(str::trim) {
                    assert!(exports.contains(&wanted), "{name}: {from} has no {wanted}");
                    let body = text.lines().filter(|line| !line.starts_with("import"));
                    let uses = body.flat_map(words).any(|word| word == wanted);
                    assert!(uses, "{name}: {wanted} is not used");
                }
            }
        }
    }

    #[test]
    fn every_module_is_needed_and_what_it_exports_too() {
        let used: BTreeSet<&str> = ["live", "report", "index", "compare", "fleet", "check", "worker"]
            .into_iter()
            .flat_map(needed)
            .collect();
        for (name, text) in MODULES {
            assert!(used.contains(name), "nobody needs {name}");
            for line in text.lines().filter(|line| line.starts_with("export")) {
                let exported = export(line).expect("an export is a const");
                let of_it = |(names, from): (&str, &str)| {
                    from == *name && names.split(',').any(|wanted| wanted.trim() == exported)
                };
                let is_wanted = MODULES.iter().any(|(_, text)| text.lines().filter_map(import).any(of_it));
                assert!(is_wanted, "{name}: nobody wants {exported}");
            }
        }
    }

    #[test]
    fn each_module_says_what_it_is_for() {
        for (name, text) in MODULES {
            assert!(text.starts_with("// "), "{name}");
        }
    }

    #[test]
    fn the_style_sheet_has_no_class_that_nothing_has_and_lacks_no_colour() {
        let pages = [LIVE, include_str!("assets/report.html"), include_str!("assets/check.html")];
        let texts = MODULES.iter().map(|(_, text)| *text).chain(pages);
        let code: BTreeSet<&str> = texts.flat_map(words).collect();
        let style = STYLE[1];
        let defined: BTreeSet<&str> =
            words(style).filter(|word| style.contains(&format!("{word}:"))).collect();
        for used in style.split("var(").skip(1).filter_map(|rest| rest.split(')').next()) {
            assert!(defined.contains(used), "{used} is not defined");
        }
        let selectors =
            style.split('}').filter_map(|rule| rule.rsplit_once('{')).map(|(selector, _)| selector);
        for class in selectors.flat_map(|selector| selector.split('.').skip(1)) {
            let class = class.split(|c: char| !(c.is_alphanumeric() || c == '-')).next().unwrap_or_default();
            let named = code.contains(class) || class.starts_with("u-") || class == "uplot";
            // A level's colour on a frame: `is-${level}`.
            assert!(named || class.starts_with("is-"), "nothing is .{class}");
        }
    }

    #[test]
    fn a_module_gives_what_it_exports_and_takes_what_it_imports() {
        let mut out = String::new();
        push_module(
            &mut out,
            "b",
            "import { x, y } from \"./a.js\";\nexport const z = x + y;\nconst own = 1;\n",
        );
        let wanted = "const module_b = (() => {\nconst { x, y } = module_a;\nconst z = x + y;\nconst own = 1;\n\
                      return { z };\n})();\n";
        assert_eq!(out, wanted);
    }

    #[test]
    fn nothing_that_a_vehicle_sent_becomes_markup_and_nothing_is_loaded() {
        for program in ["live", "report", "index", "compare", "fleet", "check", "worker"].map(program) {
            for markup in ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("] {
                assert!(!program.contains(markup), "{markup}");
            }
            // The only address is a name: the namespace of SVG's elements, which the worker has not.
            assert_eq!(
                program.matches("http").count(),
                program.matches("http://www.w3.org/2000/svg").count()
            );
        }
    }
}
