//! From a path in the code to the file that defines what it names.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::algo::tarjan_scc;
use petgraph::graphmap::DiGraphMap;

use super::source::{Crate, Module};

/// A module: the crate's index and the module's in it.
pub(super) type Place = (usize, usize);

/// That one file needs another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Import {
    pub(super) from: Place,
    pub(super) to: Place,
}

/// Re-exports of re-exports end somewhere; a circle of them would not compile.
const HOPS_MAX: usize = 16;

/// All imports between files, each once. That a file passes on what a child defines (`pub use child::Item`) is a door
/// and no import: nobody in the file uses it.
pub(super) fn imports(crates: &[Crate]) -> Vec<Import> {
    let resolver = Resolver::new(crates);
    let mut imports = BTreeSet::new();
    for (krate, modules) in crates.iter().map(|krate| &krate.modules).enumerate() {
        for (index, module) in modules.iter().enumerate() {
            let from = (krate, module.owner);
            let mut import = |to: Place, is_door: bool| {
                let to = (to.0, crates[to.0].modules[to.1].owner);
                if to != from && !(is_door && is_below(crates, to, from)) {
                    imports.insert(Import { from, to });
                }
            };
            for (path, passed_on) in module.aliases.values() {
                if let Some(to) = resolver.definer((krate, index), path, HOPS_MAX) {
                    import(to, *passed_on);
                }
            }
            for path in &module.globs {
                if let Some(to) = resolver.definer((krate, index), path, HOPS_MAX) {
                    import(to, true);
                }
            }
            for path in &module.names {
                if let Some(to) = resolver.definer((krate, index), path, HOPS_MAX) {
                    import(to, false);
                }
            }
        }
    }
    imports.into_iter().collect()
}

fn is_below(crates: &[Crate], place: Place, above: Place) -> bool {
    let path = |place: Place| &crates[place.0].modules[place.1].path;
    place.0 == above.0 && path(place).starts_with(path(above))
}

/// Files that need each other, and a crate's folders that do, a paragraph each.
pub(super) fn circles(crates: &[Crate], imports: &[Import]) -> Vec<String> {
    let file = |place: Place| crates[place.0].modules[place.1].file.clone();
    let mut circles = circles_of(imports, file);
    if circles.is_empty() {
        let within = imports.iter().filter(|import| import.from.0 == import.to.0).copied();
        circles = circles_of(&within.collect::<Vec<_>>(), |place| room(crates, place));
    }
    let lines = |circle: &BTreeSet<Import>| {
        let arrows: Vec<String> =
            circle.iter().map(|import| format!("{} -> {}", file(import.from), file(import.to))).collect();
        arrows.join("\n  ")
    };
    circles.iter().map(lines).collect()
}

/// The imports that go in a circle, once places with the same key are one.
fn circles_of(imports: &[Import], key: impl Fn(Place) -> String) -> Vec<BTreeSet<Import>> {
    let keys: Vec<(String, String)> = imports.iter().map(|i| (key(i.from), key(i.to))).collect();
    let mut graph = DiGraphMap::<&str, ()>::new();
    for (from, to) in keys.iter().filter(|(from, to)| from != to) {
        graph.add_edge(from, to, ());
    }
    let inside = |circle: &[&str]| {
        let is_in = |(from, to): &(String, String)| {
            from != to && circle.contains(&from.as_str()) && circle.contains(&to.as_str())
        };
        imports.iter().zip(&keys).filter(|(_, key)| is_in(key)).map(|(import, _)| *import).collect()
    };
    let mut circles: Vec<BTreeSet<Import>> =
        tarjan_scc(&graph).iter().filter(|circle| circle.len() > 1).map(|circle| inside(circle)).collect();
    circles.sort();
    circles
}

/// What the picture draws as one box: the crate's root, or a module of it with all below.
pub(super) fn room(crates: &[Crate], place: Place) -> String {
    let krate = &crates[place.0];
    match krate.modules[place.1].path.first() {
        Some(module) => format!("{}::{module}", krate.name),
        None => krate.name.clone(),
    }
}

struct Resolver<'a> {
    crates: &'a [Crate],
    libraries: BTreeMap<&'a str, usize>,
}

impl<'a> Resolver<'a> {
    fn new(crates: &'a [Crate]) -> Self {
        let libraries = crates.iter().enumerate().filter(|(_, krate)| krate.is_library);
        Self { crates, libraries: libraries.map(|(index, krate)| (krate.name.as_str(), index)).collect() }
    }

    fn module(&self, place: Place) -> &'a Module {
        &self.crates[place.0].modules[place.1]
    }

    /// The module that defines what `path`, written in `from`, names; `None` for what is not of this workspace.
    fn definer(&self, from: Place, path: &[String], hops: usize) -> Option<Place> {
        let hops = hops.checked_sub(1)?;
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => self.descend((from.0, 0), rest, hops),
            "self" => self.descend(from, rest, hops),
            "super" => self.descend(self.parent(from)?, rest, hops),
            name => {
                let module = self.module(from);
                if let Some(child) = module.children.get(name) {
                    return self.descend((from.0, *child), rest, hops);
                }
                if let Some((target, _)) = module.aliases.get(name)
                    && target != path
                {
                    let whole: Vec<String> = target.iter().chain(rest).cloned().collect();
                    return self.definer(from, &whole, hops);
                }
                if module.items.contains(name) {
                    return Some(from);
                }
                if let Some(library) = self.libraries.get(name)
                    && *library != from.0
                {
                    return self.descend((*library, 0), rest, hops);
                }
                self.through_globs(from, path, hops)
            }
        }
    }

    /// Follows `path` downwards from a module.
    fn descend(&self, place: Place, path: &[String], hops: usize) -> Option<Place> {
        let Some((first, rest)) = path.split_first() else { return Some(place) };
        let module = self.module(place);
        if first == "super" {
            return self.descend(self.parent(place)?, rest, hops);
        }
        if first == "self" {
            return self.descend(place, rest, hops);
        }
        if let Some(child) = module.children.get(first) {
            return self.descend((place.0, *child), rest, hops);
        }
        if module.items.contains(first) {
            return Some(place);
        }
        if let Some((target, _)) = module.aliases.get(first) {
            let whole: Vec<String> = target.iter().chain(rest).cloned().collect();
            return self.definer(place, &whole, hops.checked_sub(1)?);
        }
        // What a build script or a macro makes has no definition to be found: it is the module's.
        self.through_globs(place, path, hops).or(Some(place))
    }

    fn through_globs(&self, place: Place, path: &[String], hops: usize) -> Option<Place> {
        let hops = hops.checked_sub(1)?;
        self.module(place).globs.iter().find_map(|glob| {
            let source = self.definer(place, glob, hops)?;
            let module = self.module(source);
            let first = path.first()?;
            let has = module.items.contains(first)
                || module.children.contains_key(first)
                || module.aliases.contains_key(first);
            if has { self.descend(source, path, hops) } else { None }
        })
    }

    fn parent(&self, place: Place) -> Option<Place> {
        let path = &self.module(place).path;
        let above = &path[..path.len().checked_sub(1)?];
        let index = self.crates[place.0].modules.iter().position(|module| module.path == above)?;
        Some((place.0, index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(path: &str) -> Vec<String> {
        path.split("::").map(str::to_owned).collect()
    }

    /// A crate with a root and modules `a` and `b`: each with an item, a name that it writes, and maybe a re-export.
    fn krate(a_names: &str, b_names: &str) -> Crate {
        let module = |index: usize, path: &str, item: &str, names: &str| Module {
            path: if path.is_empty() { Vec::new() } else { words(path) },
            owner: index,
            file: format!("{path}.rs"),
            items: BTreeSet::from([item.to_owned()]),
            names: names.split_whitespace().map(words).collect(),
            ..Module::default()
        };
        let mut root = module(0, "", "Root", "");
        root.children = BTreeMap::from([("a".to_owned(), 1), ("b".to_owned(), 2)]);
        root.aliases = BTreeMap::from([("Bee".to_owned(), (words("b::Bee"), true))]);
        let modules = vec![root, module(1, "a", "Aye", a_names), module(2, "b", "Bee", b_names)];
        Crate { name: "x".to_owned(), modules, is_library: true }
    }

    #[test]
    fn a_name_that_the_root_passes_on_leads_to_the_file_that_defines_it() {
        let crates = [krate("crate::Bee::new", "")];
        assert_eq!(imports(&crates), [Import { from: (0, 1), to: (0, 2) }]);
        assert!(circles(&crates, &imports(&crates)).is_empty());
    }

    #[test]
    fn two_files_that_need_each_other_are_a_circle() {
        let crates = [krate("super::b::Bee", "crate::a::Aye")];
        let found = circles(&crates, &imports(&crates));
        assert_eq!(found, ["a.rs -> b.rs\n  b.rs -> a.rs"]);
    }

    #[test]
    fn what_is_not_of_this_workspace_is_no_import() {
        assert!(imports(&[krate("core::fmt::Debug Vec::new", "Self::Bee")]).is_empty());
    }
}
