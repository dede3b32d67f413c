//! The documents as a book that needs no network to read: `cargo xtask book`, by mdBook.
//!
//! The list of chapters is made from docs/README.md, so there is no second list that could rot: its headings are the
//! parts, the links in the first column of its tables the chapters. The sources are copied below `target/book`, with
//! the documents outside `docs/`, because mdBook reads and writes one folder only. Files that are linked go along.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::docs::link_targets;
use crate::{files, shell};

/// mdBook's version; another one may write other pages.
const VERSION: &str = "0.4.52";
/// The index of the documents.
const INDEX: &str = "docs/README.md";
/// The first page; at the root, because mdBook copies it to `index.html` with its links as they are.
const FRONT: &str = "README.md";

/// Builds the book into `target/book/html`.
pub(crate) fn run() -> Result<()> {
    let program = program()?;
    shell::step("the documents as a book");
    let folder = stage()?;
    shell::run(Command::new(program).arg("build").arg(&folder))?;
    shell::note(&format!("{}", folder.join("html").join("index.html").display()));
    Ok(())
}

/// mdBook, installed into the build folder if it is not there.
fn program() -> Result<PathBuf> {
    let folder = shell::target_dir().join("setup").join(format!("mdbook-{VERSION}"));
    let program = folder.join("bin").join("mdbook");
    if !program.is_file() {
        shell::step("set-up: mdBook is installed into the build folder, which takes minutes");
        let mut install = shell::cargo();
        install.args(["install", "mdbook", "--locked", "--version", VERSION, "--root"]).arg(&folder);
        shell::run(&mut install).context("cargo cannot install mdBook; is there a network?")?;
    }
    Ok(program)
}

/// Copies everything that the book needs into a fresh folder; gives that folder.
fn stage() -> Result<PathBuf> {
    let folder = shell::target_dir().join("book");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    let files = files::all(|path| path.ends_with(".md"))?;
    let text = |path: &str| files.iter().find(|(name, _)| name == path).map(|(_, text)| text.as_str());
    let index = text(INDEX).context("there is no index of the documents")?;
    let (mut wanted, mut open) = (BTreeSet::new(), vec![FRONT.to_owned(), INDEX.to_owned()]);
    open.extend(chapters(index).into_iter().map(|chapter| chapter.path));
    while let Some(document) = open.pop() {
        let text = text(&document).with_context(|| format!("{INDEX} lists {document}, which is not there"))?;
        // What is no Markdown has no text here, and so no links.
        let linked = link_targets(text).into_iter().map(|target| below_root(&document, &target));
        open.extend(linked.filter(|path| !wanted.contains(path) && files.iter().any(|(name, _)| name == path)));
        wanted.insert(document);
    }
    let source = folder.join("src");
    for path in &wanted {
        copy(&shell::root().join(path), &source.join(path))?;
    }
    copy(&shell::root().join("docs/book.toml"), &folder.join("book.toml"))?;
    let summary = source.join("SUMMARY.md");
    std::fs::write(&summary, chapter_list(index, &|path| title(text(path).unwrap_or_default())))
        .with_context(|| format!("cannot write {}", summary.display()))?;
    unlisted(&source, &wanted, index)?;
    Ok(folder)
}

/// Linked Markdown that is no chapter would be a dead link of the book: mdBook makes pages of chapters alone.
fn unlisted(source: &Path, wanted: &BTreeSet<String>, index: &str) -> Result<()> {
    let mut chapters: BTreeSet<String> = chapters(index).into_iter().map(|chapter| chapter.path).collect();
    chapters.extend([FRONT.to_owned(), INDEX.to_owned()]);
    let others: Vec<&String> =
        wanted.iter().filter(|path| path.ends_with(".md") && !chapters.contains(*path)).collect();
    if others.is_empty() {
        return Ok(());
    }
    let list = source.join("SUMMARY.md");
    let mut text = std::fs::read_to_string(&list).with_context(|| format!("cannot read {}", list.display()))?;
    text.push_str("\n# Linked from these\n\n");
    for path in others {
        let _ = writeln!(text, "- [{path}]({path})");
    }
    std::fs::write(&list, text).with_context(|| format!("cannot write {}", list.display()))
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    let Some(folder) = to.parent() else { bail!("{} has no folder", to.display()) };
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    std::fs::copy(from, to).with_context(|| format!("cannot copy {}", from.display()))?;
    Ok(())
}

/// A row of the index.
struct Chapter {
    /// Heading above its table, without what follows a colon.
    part: String,
    /// Path below the root of the repository.
    path: String,
}

/// The documents of the index, in its order.
fn chapters(index: &str) -> Vec<Chapter> {
    let mut part = "";
    let mut found = Vec::new();
    for line in index.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            part = heading.split(':').next().unwrap_or(heading);
        } else if let Some(cell) = line.strip_prefix("| [").and_then(|row| row.split(" |").next())
            && let Some((_, target)) = cell.split_once("](")
        {
            let path = below_root(INDEX, target.trim_end_matches(')'));
            found.push(Chapter { part: part.to_owned(), path });
        }
    }
    found
}

/// mdBook's list of chapters; `title_of` gives the title of a document.
fn chapter_list(index: &str, title_of: &dyn Fn(&str) -> String) -> String {
    let mut text = format!("# Summary\n\n[Tactus]({FRONT})\n[Documents]({INDEX})\n");
    let mut part = String::new();
    for chapter in chapters(index).into_iter().filter(|chapter| chapter.path != FRONT) {
        if chapter.part != part {
            part = chapter.part;
            let _ = write!(text, "\n# {part}\n\n");
        }
        let _ = writeln!(text, "- [{}]({})", title_of(&chapter.path), chapter.path);
    }
    text
}

/// First heading of a document, without marks that a title of a chapter cannot hold.
fn title(text: &str) -> String {
    let heading = text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or("without a title");
    heading.replace(['`', '[', ']'], "")
}

/// Path below the root of what a document links to, without the place in it.
fn below_root(document: &str, target: &str) -> String {
    let mut parts: Vec<&str> = document.split('/').collect();
    parts.pop();
    for part in target.split('#').next().unwrap_or_default().split('/') {
        match part {
            ".." => drop(parts.pop()),
            "." | "" => {}
            name => parts.push(name),
        }
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: &str = "# Documents\n\n## Guides: how to\n\n| document | in a line |\n|---|---|\n| [../README.md](../README.md) | what |\n\
        | [how-to/watch-a-run.md](how-to/watch-a-run.md) | see [b](b.md) |\n\n## Decisions\n\n| number | what |\n|---|---|\n| [0001](decisions/0001-device-crate.md) | A |\n";

    #[test]
    fn the_list_of_chapters_has_the_order_and_the_parts_of_the_index() {
        let list = chapter_list(ROWS, &|path| format!("title of {path}"));
        let expected = "# Summary\n\n[Tactus](README.md)\n[Documents](docs/README.md)\n\n# Guides\n\n\
            - [title of docs/how-to/watch-a-run.md](docs/how-to/watch-a-run.md)\n\n# Decisions\n\n\
            - [title of docs/decisions/0001-device-crate.md](docs/decisions/0001-device-crate.md)\n";
        assert_eq!(list, expected);
    }

    #[test]
    fn every_document_of_the_repository_s_folder_is_a_chapter_and_has_a_title() {
        let files = files::all(|path| path.ends_with(".md")).unwrap();
        let index = &files.iter().find(|(path, _)| path == INDEX).unwrap().1;
        let listed: BTreeSet<String> = chapters(index).into_iter().map(|chapter| chapter.path).collect();
        for (path, text) in files.iter().filter(|(path, _)| path.starts_with("docs/") && path.ends_with(".md")) {
            assert!(path == INDEX || listed.contains(path), "{path} is no row of {INDEX}");
            assert_ne!(title(text), "without a title", "{path}");
        }
        assert!(listed.iter().all(|path| files.iter().any(|(name, _)| name == path)), "{listed:?}");
    }

    #[test]
    fn a_link_is_resolved_from_the_document_s_own_folder() {
        assert_eq!(below_root("docs/how-to/watch-a-run.md", "../../README.md#two-commands"), "README.md");
        assert_eq!(below_root("docs/lab-guide.md", "images/lab-wiring.svg"), "docs/images/lab-wiring.svg");
    }
}
