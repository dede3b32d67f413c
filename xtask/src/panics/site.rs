//! Where an image can give up: every branch to a panic function and every undefined instruction, with the source it
//! comes from.
//!
//! A panic function that is called through a pointer is not seen; the compiler does not do that.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;

use super::kind::Kind;
use crate::code::{Code, Function};
use crate::elf::Elf;
use crate::origin::{Frame, Origins};
use crate::thumb::Flow;

/// Rust's own library, and others that index and compute as they are told: not who asked for something that may panic.
const TOOLS: [&str; 6] = ["core", "alloc", "compiler_builtins", "nalgebra", "simba", "fixed"];

/// Whose assertions are about indices.
const MATRICES: &str = "nalgebra";

/// Most steps for which joined code is followed back.
const JOINS: usize = 4;

/// A place at which the image can give up.
pub(super) struct Site {
    /// The function of the image it lies in.
    pub(super) function: String,
    /// The panic function that is called.
    pub(super) target: String,
    /// Whose source it is, through all inlining. Several where the compiler joined equal ends.
    pub(super) origins: BTreeSet<Origin>,
}

/// The source of a site.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Origin {
    /// Path of the function.
    pub(super) function: String,
    /// File and line in it.
    pub(super) line: String,
    /// Why it gives up.
    pub(super) kind: Kind,
}

/// All sites of an image.
pub(super) fn find(file: &Elf<'_>) -> Result<Vec<Site>> {
    let code = Code::of(file)?;
    let origins = Origins::of(file, &code)?;
    let kinds: BTreeMap<u32, Kind> = code
        .functions()
        .filter_map(|(address, function)| Some((address, function.names().find_map(|name| Kind::of(&name))?)))
        .collect();
    let search = Search { code: &code, origins: &origins, kinds: &kinds };
    let panicking = |address: &u32| kinds.contains_key(address);
    Ok(code.functions().filter(|(address, _)| !panicking(address)).flat_map(|(_, f)| search.sites(f)).collect())
}

struct Search<'a> {
    code: &'a Code,
    origins: &'a Origins,
    kinds: &'a BTreeMap<u32, Kind>,
}

impl Search<'_> {
    fn sites(&self, function: &Function) -> Vec<Site> {
        let mut sites = Vec::new();
        for (index, instruction) in function.instructions.iter().enumerate() {
            let (kind, target) = match instruction.flow {
                Flow::Call(to) | Flow::Jump(to) | Flow::Branch(to) => match self.kinds.get(&to) {
                    Some(kind) => (*kind, self.code.at(to).map(Function::name).unwrap_or_default()),
                    None => continue,
                },
                Flow::Abort => (Kind::Abort, "udf".to_owned()),
                // What the compiler has proved unreachable is no decision of the source's to give up.
                Flow::Next | Flow::Elsewhere | Flow::Unreachable => continue,
            };
            sites.push(Site { function: function.name(), target, origins: self.askers(function, index, kind, JOINS) });
        }
        sites
    }

    /// Whose source asked for the instruction.
    ///
    /// Where the compiler joined equal ends of several functions, the debug information has no line for what is left
    /// and names only the function they all were inlined into; the branches that lead there still have theirs.
    fn askers(&self, function: &Function, index: usize, kind: Kind, joins: usize) -> BTreeSet<Origin> {
        let Some(instruction) = function.instructions.get(index) else { return BTreeSet::new() };
        let decides = matches!(instruction.flow, Flow::Branch(_));
        if joins > 0 && !decides && self.origins.is_joined(instruction.address) {
            let leading = self.leading_to(function, index).into_iter();
            let askers: BTreeSet<Origin> =
                leading.flat_map(|branch| self.askers(function, branch, kind, joins - 1)).collect();
            if !askers.is_empty() {
                return askers;
            }
        }
        let path = self.origins.path(instruction.address);
        let asker = path.iter().position(|frame| !TOOLS.contains(&crate_of(&frame.name)));
        let asker = asker.unwrap_or(path.len().saturating_sub(1));
        let is_matrix = path.iter().take(asker).any(|frame| crate_of(&frame.name) == MATRICES);
        let kind = if is_matrix && kind == Kind::Message { Kind::Index } else { kind };
        let origin = match path.into_iter().nth(asker) {
            Some(Frame { name, line }) => Origin { function: name, line, kind },
            None => Origin { function: function.name(), line: format!("{:#x}", instruction.address), kind },
        };
        BTreeSet::from([origin])
    }

    /// The branches by which one gets into the straight stretch of code that ends in this instruction.
    fn leading_to(&self, function: &Function, index: usize) -> Vec<usize> {
        let all = &function.instructions;
        let mut leading = Vec::new();
        let mut first = index;
        while let Some(before) = first.checked_sub(1) {
            let (last, next) = (&all[before], &all[first]);
            let is_apart = last.address + last.bytes != next.address;
            let ends = match last.flow {
                Flow::Jump(_) | Flow::Elsewhere | Flow::Abort | Flow::Unreachable => true,
                Flow::Call(to) => self.kinds.contains_key(&to),
                Flow::Branch(_) | Flow::Next => false,
            };
            if is_apart || ends {
                break;
            }
            if matches!(last.flow, Flow::Branch(_)) {
                leading.push(before);
                break;
            }
            first = before;
        }
        let stretch = all[first].address..=all[index].address;
        let leads = |flow: Flow| matches!(flow, Flow::Jump(to) | Flow::Branch(to) if stretch.contains(&to));
        leading
            .extend(all.iter().enumerate().filter(|(at, other)| *at != index && leads(other.flow)).map(|(at, _)| at));
        leading
    }
}

/// The first name of a path.
pub(super) fn crate_of(path: &str) -> &str {
    path.split("::").next().unwrap_or_default()
}
