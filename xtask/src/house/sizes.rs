//! No Rust file over 600 lines, no function over 80, no comment beyond column 120.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::spanned::Spanned as _;
use syn::visit::Visit;

use super::Finding;

/// Most lines of a file.
const FILE_LINES: usize = 600;
/// Most lines of a function, from its `fn` to its closing brace.
const FUNCTION_LINES: usize = 80;
/// Most columns of a line of comment; `rustfmt` keeps code within the same and leaves comments alone.
const COLUMNS: usize = 120;

/// Files that may be longer, each with its reason.
const LONG_FILES: [(&str, &str); 0] = [];
/// Functions that may be longer, as file and name, each with its reason.
const LONG_FUNCTIONS: [(&str, &str, &str); 2] = [
    ("crates/link/tests/link/samples.rs", "replies", "a list: one sample of every reply"),
    (
        "crates/control/tests/state_machine.rs",
        "e1_the_whole_table_is_as_documented",
        "a list: every transition, pinned",
    ),
];

/// Checks every Rust file.
pub(super) fn check(files: &[(String, String)]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (path, text) in files.iter().filter(|(path, _)| path.ends_with(".rs")) {
        let lines = text.lines().count();
        if lines > FILE_LINES && LONG_FILES.iter().all(|(known, _)| known != path) {
            found.push(Finding::new(path, format!("{lines} lines; at most {FILE_LINES}")));
        }
        for (index, line) in text.lines().enumerate() {
            let columns = line.chars().count();
            if columns > COLUMNS && line.contains("//") {
                found.push(Finding::at(path, index + 1, format!("comment of {columns} columns; at most {COLUMNS}")));
            }
        }
        if let Ok(parsed) = syn::parse_file(text) {
            Functions { path, found: &mut found }.visit_file(&parsed);
        }
    }
    found
}

struct Functions<'a> {
    path: &'a str,
    found: &'a mut Vec<Finding>,
}

impl Functions<'_> {
    fn measure(&mut self, signature: &syn::Signature, block: &syn::Block) {
        self.judge(&signature.ident.to_string(), signature.span().start().line, block.span().end().line);
    }

    /// Functions in the arguments of a macro, as `proptest!` has them, which `syn` leaves as words.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut begun: Option<(usize, Option<String>)> = None;
        for token in tokens {
            match token {
                TokenTree::Ident(word) if word == "fn" => begun = Some((word.span().start().line, None)),
                TokenTree::Ident(word) => {
                    if let Some((_, name @ None)) = &mut begun {
                        *name = Some(word.to_string());
                    }
                }
                TokenTree::Group(group) => {
                    if group.delimiter() == Delimiter::Brace
                        && let Some((first, Some(name))) = begun.take()
                    {
                        self.judge(&name, first, group.span_close().end().line);
                    }
                    self.tokens(group.stream());
                }
                TokenTree::Punct(mark) if mark.as_char() == ';' => begun = None,
                _ => {}
            }
        }
    }

    fn judge(&mut self, name: &str, first: usize, last: usize) {
        let lines = last + 1 - first;
        let is_listed = LONG_FUNCTIONS.iter().any(|(file, known, _)| *file == self.path && *known == name);
        if lines > FUNCTION_LINES && !is_listed {
            let text = format!("function '{name}' of {lines} lines; at most {FUNCTION_LINES}");
            self.found.push(Finding::at(self.path, first, text));
        }
    }
}

impl<'ast> Visit<'ast> for Functions<'_> {
    fn visit_item_fn(&mut self, function: &'ast syn::ItemFn) {
        self.measure(&function.sig, &function.block);
        syn::visit::visit_item_fn(self, function);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.tokens(call.tokens.clone());
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        self.measure(&function.sig, &function.block);
        syn::visit::visit_impl_item_fn(self, function);
    }

    fn visit_trait_item_fn(&mut self, function: &'ast syn::TraitItemFn) {
        if let Some(block) = &function.default {
            self.measure(&function.sig, block);
        }
        syn::visit::visit_trait_item_fn(self, function);
    }
}
