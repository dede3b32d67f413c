//! The modules of a crate, and which module names which, read from its source with `syn`.
//!
//! A path is followed through imports and re-exports to the module that defines the item, so that `use crate::RATE` is
//! a reference to the module that `RATE` is re-exported from. Modules and items under `cfg(test)` are left out. An
//! inline module belongs to the module of its file.

use std::collections::BTreeMap;

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::Visit;

/// A module is named by its segments below the crate's root; the root has none.
pub(crate) type Path = Vec<String>;

/// One module: a file.
#[derive(Default)]
pub(crate) struct Module {
    /// The file, below the root of the repository.
    pub(crate) file: String,
    /// Names that a `use` brings in, with the path behind each; `use a::b as c` is `c` to `a::b`.
    imports: BTreeMap<String, Path>,
    /// Paths behind `use path::*`.
    globs: Vec<Path>,
    /// Names that the module defines itself.
    items: Vec<String>,
    /// Every path that stands in the module, with its line.
    paths: Vec<(Path, usize)>,
}

/// All modules of a crate by their path.
pub(crate) struct Modules(pub(crate) BTreeMap<Path, Module>);

/// One module names another.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Reference {
    /// The module that names.
    pub(crate) from: Path,
    /// The module that is named.
    pub(crate) to: Path,
    /// Line in the file of `from`.
    pub(crate) line: usize,
}

impl Modules {
    /// Reads the crate whose root file is `root`; files that do not parse are left to the compiler.
    pub(crate) fn of(root: &str, text_of: &impl Fn(&str) -> Option<String>) -> Self {
        let mut modules = Self(BTreeMap::new());
        modules.read(Vec::new(), root, text_of);
        modules
    }

    fn read(&mut self, path: Path, file: &str, text_of: &impl Fn(&str) -> Option<String>) {
        let Some(parsed) = text_of(file).and_then(|text| syn::parse_file(&text).ok()) else { return };
        let mut reader = Reader::default();
        reader.module.file = file.to_owned();
        parsed.items.iter().for_each(|item| reader.visit_item(item));
        let folder = if path.is_empty() || file.ends_with("/mod.rs") {
            file.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned()
        } else {
            file.trim_end_matches(".rs").to_owned()
        };
        let children = std::mem::take(&mut reader.children);
        self.0.insert(path.clone(), reader.module);
        for child in children {
            let below = [path.clone(), vec![child.clone()]].concat();
            for file in [format!("{folder}/{child}.rs"), format!("{folder}/{child}/mod.rs")] {
                self.read(below.clone(), &file, text_of);
            }
        }
    }

    /// Every reference from one module to another.
    pub(crate) fn references(&self) -> Vec<Reference> {
        let mut references = Vec::new();
        for (from, module) in &self.0 {
            for (path, line) in &module.paths {
                if let Some(to) = self.resolve(from, path, 0).filter(|to| to != from) {
                    references.push(Reference { from: from.clone(), to, line: *line });
                }
            }
        }
        references
    }

    /// The module that defines what `path`, standing in `from`, names; `None` for paths that lead out of the crate.
    fn resolve(&self, from: &Path, path: &[String], depth: usize) -> Option<Path> {
        // Imports that name each other would be followed for ever.
        if depth > 16 {
            return None;
        }
        let (first, rest) = path.split_first()?;
        let (mut at, mut rest) = match first.as_str() {
            "crate" => (Vec::new(), rest),
            "self" => (from.clone(), rest),
            "super" => (from.split_last()?.1.to_vec(), rest),
            _ => (from.clone(), path),
        };
        loop {
            let Some((name, after)) = rest.split_first() else { return Some(at) };
            let below = [at.clone(), vec![name.clone()]].concat();
            let module = self.0.get(&at)?;
            if name == "super" {
                at = at.split_last()?.1.to_vec();
            } else if self.0.contains_key(&below) {
                at = below;
            } else if let Some(meant) = module.imports.get(name) {
                // An import that begins with its own name, `use sim::sim`, leads out of the crate.
                if meant.first() == Some(name) {
                    return None;
                }
                return self.resolve(&at, &[meant, after].concat(), depth + 1);
            } else if module.items.contains(name) {
                return Some(at);
            } else {
                let behind = |glob: &Path| {
                    let to = self.resolve(&at, glob, depth + 1).filter(|to| *to != at)?;
                    self.resolve(&to, &[&["self".to_owned()], rest].concat(), depth + 1)
                };
                let found = module.globs.iter().find_map(behind);
                // What a macro defines is not seen; a path that begins at a module of the crate ends in it all the
                // same.
                return found.or_else(|| matches!(first.as_str(), "crate" | "self" | "super").then_some(at));
            }
            rest = after;
        }
    }
}

/// Collects imports, items, paths and child modules of one file.
#[derive(Default)]
struct Reader {
    module: Module,
    children: Vec<String>,
    /// Number of inline modules around the present place.
    depth: usize,
}

impl Reader {
    /// A path as the file would write it: `super` in an inline module leads to the file. `None` for a path that stays
    /// in the inline modules.
    fn outside(&self, path: &[String]) -> Option<Path> {
        let up = path.iter().take_while(|name| *name == "super").count();
        let rest = path.get(up..)?;
        match (path.first()?.as_str(), up.checked_sub(self.depth)) {
            ("self", _) if self.depth > 0 => None,
            ("super", None) => None,
            ("super", Some(0)) => Some([&["self".to_owned()], rest].concat()),
            ("super", Some(up)) => Some([&vec!["super".to_owned(); up], rest].concat()),
            _ => Some(path.to_vec()),
        }
    }

    fn note(&mut self, path: &[String], line: usize) {
        let path = self.outside(path);
        self.module.paths.extend(path.map(|path| (path, line)));
    }

    fn import(&mut self, before: &Path, tree: &syn::UseTree) {
        let with = |name: &syn::Ident| [before.clone(), vec![name.to_string()]].concat();
        match tree {
            syn::UseTree::Path(path) => self.import(&with(&path.ident), &path.tree),
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.import(before, tree)),
            syn::UseTree::Name(name) => {
                let path = if name.ident == "self" { before.clone() } else { with(&name.ident) };
                self.name(path.last().cloned().unwrap_or_default(), path, name.ident.span());
            }
            syn::UseTree::Rename(name) => self.name(name.rename.to_string(), with(&name.ident), name.ident.span()),
            syn::UseTree::Glob(glob) => {
                self.note(before, glob.star_token.spans[0].start().line);
                self.module.globs.extend(self.outside(before));
            }
        }
    }

    fn name(&mut self, name: String, path: Path, span: proc_macro2::Span) {
        self.note(&path, span.start().line);
        self.module.imports.extend(self.outside(&path).map(|path| (name, path)));
    }

    /// Paths in the arguments of a macro, which `syn` leaves as words.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path: Path = Vec::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(ident) => {
                    if colons != 2 {
                        path.clear();
                    }
                    path.push(ident.to_string());
                    colons = 0;
                    if path.len() > 1 {
                        self.note(&path, ident.span().start().line);
                    }
                }
                TokenTree::Punct(mark) if mark.as_char() == ':' => colons += 1,
                TokenTree::Group(group) => {
                    path.clear();
                    self.tokens(group.stream());
                }
                _ => path.clear(),
            }
        }
    }
}

/// True for `#[cfg(test)]` and conditions that contain the bare word `test`.
pub(crate) fn is_for_tests(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().filter(|attribute| attribute.path().is_ident("cfg")).any(|attribute| {
        let condition = attribute.meta.require_list().map(|list| list.tokens.to_string()).unwrap_or_default();
        !condition.contains("not")
            && condition.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == "test")
    })
}

/// Attributes and name of an item, where it has one.
fn head(item: &syn::Item) -> (&[syn::Attribute], Option<&syn::Ident>) {
    match item {
        syn::Item::Const(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Enum(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Fn(item) => (&item.attrs, Some(&item.sig.ident)),
        syn::Item::Impl(item) => (&item.attrs, None),
        syn::Item::Macro(item) => (&item.attrs, item.ident.as_ref()),
        syn::Item::Mod(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Static(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Struct(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Trait(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Type(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Union(item) => (&item.attrs, Some(&item.ident)),
        syn::Item::Use(item) => (&item.attrs, None),
        _ => (&[], None),
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        let (attributes, name) = head(item);
        if is_for_tests(attributes) {
            return;
        }
        match item {
            syn::Item::Mod(module) if module.content.is_none() => self.children.push(module.ident.to_string()),
            _ => {
                self.module.items.extend(name.map(ToString::to_string));
                let inner = usize::from(matches!(item, syn::Item::Mod(_)));
                self.depth += inner;
                syn::visit::visit_item(self, item);
                self.depth -= inner;
            }
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if !is_for_tests(&function.attrs) {
            syn::visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.import(&Vec::new(), &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Path = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        // A single name is an item of this file or came by a `use`, which is a reference of its own.
        if let Some(first) = path.segments.first().filter(|_| names.len() > 1 && path.leading_colon.is_none()) {
            self.note(&names, first.ident.span().start().line);
        }
        syn::visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.tokens(call.tokens.clone());
        self.visit_path(&call.path);
    }

    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {
        // `pub(in crate::x)` names no item.
    }
}
