//! The workspace's source: each crate a tree of modules, each module with what it defines and what it names.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use cargo_metadata::{MetadataCommand, TargetKind};
use proc_macro2::{TokenStream, TokenTree};
use syn::spanned::Spanned as _;
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, UseTree};

use crate::repo;

/// A library or a program of the workspace.
#[derive(Debug)]
pub(super) struct Crate {
    /// As in code: `hums_core`; a program's ends in ` (program)`.
    pub(super) name: String,
    /// The root first.
    pub(super) modules: Vec<Module>,
    /// Whether other crates can name it.
    pub(super) is_library: bool,
}

/// A module: a file, or a part of one in braces.
#[derive(Debug, Default)]
pub(super) struct Module {
    /// Below the crate's root: `["record", "wear"]`; the root's is empty.
    pub(super) path: Vec<String>,
    /// The module that is the file this one stands in: itself, but for a module in braces.
    pub(super) owner: usize,
    /// From the repository's root.
    pub(super) file: String,
    /// Lines of the file, and of these the ones that are tests; 0 for a module in braces.
    pub(super) lines: usize,
    pub(super) test_lines: usize,
    /// What it defines.
    pub(super) items: BTreeSet<String>,
    /// Names that `use` brings in, with the path that they stand for, and whether they are passed on (`pub use`).
    pub(super) aliases: BTreeMap<String, (Vec<String>, bool)>,
    /// Paths of `use path::*`.
    pub(super) globs: Vec<Vec<String>>,
    /// Child modules.
    pub(super) children: BTreeMap<String, usize>,
    /// All other paths in its code, each once.
    pub(super) names: BTreeSet<Vec<String>>,
    /// Functions, with their length in lines.
    pub(super) functions: Vec<(String, usize)>,
    /// Lints that are allowed or expected here: `#[allow(...)]`, `#[expect(...)]`, each with how often.
    pub(super) allowances: BTreeMap<String, usize>,
}

/// Parses all libraries and programs of the workspace, tests and examples left out.
pub(super) fn read_workspace() -> Result<Vec<Crate>> {
    let metadata = MetadataCommand::new().current_dir(repo::root()).no_deps().exec()?;
    let mut crates = Vec::new();
    for package in metadata.workspace_packages() {
        for target in &package.targets {
            let is_library = target.kind.contains(&TargetKind::Lib);
            if !is_library && !target.kind.contains(&TargetKind::Bin) {
                continue;
            }
            let mut modules = Vec::new();
            let root = target.src_path.as_std_path();
            let folder = root.parent().context("a source file without a folder")?;
            read_file(&mut modules, Vec::new(), root, folder)?;
            let name = target.name.replace('-', "_");
            // A program may have the name of the library beside it.
            let name = if is_library { name } else { format!("{name} (program)") };
            crates.push(Crate { name, modules, is_library });
        }
    }
    Ok(crates)
}

/// Reads a module's file and those below it; returns its index.
fn read_file(modules: &mut Vec<Module>, path: Vec<String>, file: &Path, folder: &Path) -> Result<usize> {
    let text = fs::read_to_string(file).with_context(|| format!("{}", file.display()))?;
    let syntax = syn::parse_file(&text).with_context(|| format!("{}", file.display()))?;
    let index = modules.len();
    let shown = repo::shown(file);
    modules.push(Module {
        path,
        owner: index,
        file: shown,
        lines: text.lines().count(),
        test_lines: syntax.items.iter().filter(|item| is_test(attributes(item))).map(lines_of).sum(),
        ..Module::default()
    });
    count_allowances(&mut modules[index], &syntax.attrs);
    read_items(modules, index, &syntax.items, folder)?;
    Ok(index)
}

/// Takes up what a module's items define and name; `folder` is where its child modules' files are.
fn read_items(modules: &mut Vec<Module>, index: usize, items: &[Item], folder: &Path) -> Result<()> {
    for item in items.iter().filter(|item| !is_test(attributes(item))) {
        match item {
            Item::Mod(child) => {
                let name = child.ident.to_string();
                let path: Vec<String> = modules[index].path.iter().cloned().chain([name.clone()]).collect();
                let child_index = if let Some((_, items)) = &child.content {
                    let child_index = modules.len();
                    let owner = modules[index].owner;
                    let file = modules[index].file.clone();
                    modules.push(Module { path, owner, file, ..Module::default() });
                    read_items(modules, child_index, items, &folder.join(&name))?;
                    child_index
                } else {
                    let (file, below) = file_of(child, folder)?;
                    read_file(modules, path, &file, &below)?
                };
                modules[index].children.insert(name, child_index);
            }
            Item::Use(import) => {
                let passed_on = !matches!(import.vis, syn::Visibility::Inherited);
                read_use(&mut modules[index], &import.tree, Vec::new(), passed_on);
            }
            other => {
                if let Some(name) = defined(other) {
                    modules[index].items.insert(name);
                }
                Reader { module: &mut modules[index] }.visit_item(other);
            }
        }
    }
    Ok(())
}

/// Where the file of `mod name;` is, and the folder of its own children.
fn file_of(module: &ItemMod, folder: &Path) -> Result<(PathBuf, PathBuf)> {
    let name = module.ident.to_string();
    let below = folder.join(&name);
    let flat = folder.join(format!("{name}.rs"));
    let nested = below.join("mod.rs");
    let file = [flat, nested].into_iter().find(|file| file.is_file());
    Ok((file.with_context(|| format!("no file for `mod {name};` in {}", folder.display()))?, below))
}

fn read_use(module: &mut Module, tree: &UseTree, mut path: Vec<String>, passed_on: bool) {
    match tree {
        UseTree::Path(part) => {
            path.push(part.ident.to_string());
            read_use(module, &part.tree, path, passed_on);
        }
        UseTree::Name(name) => {
            let name = name.ident.to_string();
            if name == "self" {
                if let Some(last) = path.last().cloned() {
                    module.aliases.insert(last, (path, passed_on));
                }
            } else {
                path.push(name.clone());
                module.aliases.insert(name, (path, passed_on));
            }
        }
        UseTree::Rename(rename) => {
            if rename.ident != "self" {
                path.push(rename.ident.to_string());
            }
            // `as _` brings in no name, but is an import: several must not replace each other.
            let name = match rename.rename.to_string() {
                name if name == "_" => format!("_ {}", path.join("::")),
                name => name,
            };
            module.aliases.insert(name, (path, passed_on));
        }
        UseTree::Glob(_) => module.globs.push(path),
        UseTree::Group(group) => {
            for tree in &group.items {
                read_use(module, tree, path.clone(), passed_on);
            }
        }
    }
}

fn defined(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::TraitAlias(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

/// Whether it is there for tests alone.
fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("test")
            || attribute.path().is_ident("cfg")
                && attribute.parse_args::<syn::Ident>().is_ok_and(|name| name == "test")
    })
}

fn lines_of(item: &Item) -> usize {
    let span = item.span();
    span.end().line + 1 - span.start().line
}

/// What can be allowed is written `allow(lint, lint, reason = "...")`.
fn count_allowances(module: &mut Module, attributes: &[Attribute]) {
    for attribute in attributes {
        if !(attribute.path().is_ident("allow") || attribute.path().is_ident("expect")) {
            continue;
        }
        let Ok(list) = attribute.meta.require_list() else { continue };
        let text = list.tokens.to_string().replace(' ', "");
        for lint in text.split(',').take_while(|part| !part.starts_with("reason")) {
            if !lint.is_empty() {
                *module.allowances.entry(lint.to_owned()).or_default() += 1;
            }
        }
    }
}

/// Collects paths, functions and allowances of what is not a module.
struct Reader<'a> {
    module: &'a mut Module,
}

impl Reader<'_> {
    /// Paths in what a macro is given, which is not parsed: words joined by `::`.
    fn read_tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(word) => {
                    if colons != 2 {
                        self.end_path(&mut path);
                    }
                    path.push(word.to_string());
                    colons = 0;
                }
                TokenTree::Punct(mark) if mark.as_char() == ':' => colons += 1,
                TokenTree::Group(group) => {
                    self.end_path(&mut path);
                    self.read_tokens(group.stream());
                    colons = 0;
                }
                _ => {
                    self.end_path(&mut path);
                    colons = 0;
                }
            }
        }
        self.end_path(&mut path);
    }

    fn end_path(&mut self, path: &mut Vec<String>) {
        let path = std::mem::take(path);
        if path.len() > 1 {
            self.module.names.insert(path);
        }
    }

    fn function(&mut self, name: &syn::Ident, span: proc_macro2::Span) {
        self.module.functions.push((name.to_string(), span.end().line + 1 - span.start().line));
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.segments.len() > 1 {
            self.module.names.insert(path.segments.iter().map(|part| part.ident.to_string()).collect());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, invoked: &'ast syn::Macro) {
        self.visit_path(&invoked.path);
        self.read_tokens(invoked.tokens.clone());
    }

    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        count_allowances(self.module, std::slice::from_ref(attribute));
    }

    fn visit_item_use(&mut self, import: &'ast syn::ItemUse) {
        // Within a function: as good as one of the module's, since only files count.
        read_use(self.module, &import.tree, Vec::new(), false);
    }

    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.function(&item.sig.ident, item.block.span());
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !is_test(&item.attrs) {
            self.function(&item.sig.ident, item.block.span());
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        if let Some(body) = &item.default {
            self.function(&item.sig.ident, body.span());
        }
        visit::visit_trait_item_fn(self, item);
    }

    fn visit_item_macro(&mut self, item: &'ast syn::ItemMacro) {
        self.read_tokens(item.mac.tokens.clone());
    }
}
