//! The page's program: one script of many modules, because a page that is whole in itself has no files to import from.
//!
//! The files in `assets/` are ECMAScript modules as `hums live` serves them, with two habits that make putting them
//! together simple: an `import` is one line, and what is exported is a `const` where it is defined. Each becomes a
//! function that is called once and gives what it exports; an import takes from that.

use std::fmt::Write as _;

macro_rules! modules {
    ($($name:literal $path:literal;)*) => {
        const MODULES: &[(&str, &str)] = &[$(($name, include_str!($path)),)*];
    };
}

// Each after those that it imports from.
modules! {
    "elements" "../assets/elements.js";
    "text" "../assets/text.js";
    "lines" "../assets/lines.js";
    "data" "assets/data.js";
    "format" "assets/format.js";
    "layout" "assets/layout.js";
    "view" "assets/view.js";
    "canvas" "assets/canvas.js";
    "series" "assets/series.js";
    "charts" "assets/charts.js";
    "timeline" "assets/timeline.js";
    "map" "assets/map.js";
    "head" "assets/head.js";
    "summary" "assets/summary.js";
    "findings" "assets/findings.js";
    "usage" "assets/usage.js";
    "trend" "assets/trend.js";
    "recorder" "assets/recorder.js";
    "messages" "assets/messages.js";
    "page" "assets/page.js";
}

/// The program.
pub(super) fn program() -> String {
    let mut program = String::from("\"use strict\";\n(() => {\n");
    for (name, text) in MODULES {
        push_module(&mut program, name, text);
    }
    program.push_str("})();\n");
    program
}

fn push_module(out: &mut String, name: &str, text: &str) {
    // Writing to a String cannot fail.
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

/// What a line imports, and from which module.
fn import(line: &str) -> Option<(&str, &str)> {
    let (names, from) = line.strip_prefix("import {")?.split_once("} from \"./")?;
    Some((names, from.strip_suffix(".js\";")?))
}

/// What a line exports.
fn export(line: &str) -> Option<&str> {
    line.strip_prefix("export const ")?.split([' ', '=']).next()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn each_import_is_of_something_that_a_module_before_it_exports_and_is_used() {
        let mut exported: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (name, text) in MODULES {
            for line in text.lines().filter(|line| line.starts_with("import")) {
                let (names, from) = import(line).expect("an import is one line");
                let known = exported.get(from).unwrap_or_else(|| panic!("{name}: {from} is not before it"));
                for wanted in names.split(',').map(str::trim) {
                    assert!(known.contains(&wanted), "{name}: {from} has no {wanted}");
                    let body = text.lines().filter(|line| !line.starts_with("import"));
                    let is_letter = |c: char| c.is_alphanumeric() || c == '_';
                    let mut words = body.flat_map(|line| line.split(|c| !is_letter(c)));
                    assert!(words.any(|word| word == wanted), "{name}: {wanted} is not used");
                }
            }
            let exports = text.lines().filter(|line| line.starts_with("export"));
            exported.insert(name, exports.map(|line| export(line).expect("an export is a const")).collect());
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
    fn nothing_that_a_vehicle_sent_becomes_markup() {
        for markup in ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("] {
            assert!(!program().contains(markup), "{markup}");
        }
    }
}
