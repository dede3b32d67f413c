//! No circle of modules inside a crate.
//!
//! Modules of one folder must have an order: none may be reached from itself along "names something in". What happens
//! below a module counts as its own, so `cycle/laws.rs` and `cycle/record.rs` are both `cycle` to the modules beside
//! `cycle`, and are told apart where the folder `cycle` is checked. A folder is one room: its `mod.rs` (or the file of
//! the same name) and the files in it may name each other, because splitting a noun over files is what the folder is
//! for.

use std::collections::{BTreeMap, BTreeSet};

use super::Finding;
use super::modules::{Modules, Path, Reference};

/// From one child of a folder to another, with one reference that says so.
type Graph<'a> = BTreeMap<&'a str, BTreeMap<&'a str, &'a Reference>>;

/// Checks every crate: a folder `src` with `lib.rs` or `main.rs`, and each file of `src/bin`.
pub(super) fn check(files: &[(String, String)]) -> Vec<Finding> {
    let text_of = |path: &str| files.iter().find(|(known, _)| known == path).map(|(_, text)| text.clone());
    let is_root = |path: &&String| {
        path.ends_with("/src/lib.rs")
            || path.ends_with("/src/main.rs")
            || path.rsplit_once('/').is_some_and(|(folder, name)| folder.ends_with("/src/bin") && name.ends_with(".rs"))
    };
    let mut found = Vec::new();
    for root in files.iter().map(|(path, _)| path).filter(is_root) {
        let modules = Modules::of(root, &text_of);
        let references = modules.references();
        for folder in modules.0.keys() {
            let circles = circles_of(folder, &references);
            found.extend(circles.iter().map(|circle| describe(folder, circle, &modules)));
        }
    }
    found
}

/// The circles among the children of one folder: the shortest through each group of children that reach each other.
fn circles_of<'a>(folder: &Path, references: &'a [Reference]) -> Vec<Vec<&'a Reference>> {
    let child = |path: &'a Path| path.strip_prefix(folder.as_slice()).and_then(<[String]>::first).map(String::as_str);
    let mut graph = Graph::new();
    for reference in references {
        if let (Some(from), Some(to)) = (child(&reference.from), child(&reference.to))
            && from != to
        {
            graph.entry(from).or_default().entry(to).or_insert(reference);
        }
    }
    let mut told: BTreeSet<BTreeSet<&str>> = BTreeSet::new();
    let mut circles: Vec<_> = graph.keys().filter_map(|start| shortest_circle(&graph, start)).collect();
    circles.sort_by_key(Vec::len);
    circles.retain(|circle| told.insert(circle.iter().filter_map(|step| child(&step.from)).collect()));
    circles
}

/// The shortest way from `start` back to itself.
fn shortest_circle<'a>(graph: &Graph<'a>, start: &'a str) -> Option<Vec<&'a Reference>> {
    let mut came: BTreeMap<&str, (&str, &Reference)> = BTreeMap::new();
    let mut front = vec![start];
    while !front.is_empty() && !came.contains_key(start) {
        let mut next = Vec::new();
        for from in front {
            for (to, reference) in graph.get(from).into_iter().flatten() {
                came.entry(to).or_insert_with(|| {
                    next.push(*to);
                    (from, *reference)
                });
            }
        }
        front = next;
    }
    let mut circle = Vec::new();
    let mut at = start;
    loop {
        let (from, reference) = came.get(at)?;
        circle.insert(0, *reference);
        at = from;
        if at == start {
            return Some(circle);
        }
    }
}

fn describe(folder: &Path, circle: &[&Reference], modules: &Modules) -> Finding {
    let file = |path: &Path| modules.0.get(path).map_or("", |module| &module.file);
    let step =
        |reference: &&Reference| format!("{}:{} names {}", file(&reference.from), reference.line, file(&reference.to));
    let steps: Vec<String> = circle.iter().map(step).collect();
    Finding::new(file(folder), format!("module circle: {}", steps.join(", ")))
}
