//! `cargo xtask book`: the documents as a book, with the documentation of the code beside it, in
//! `target/book`.

use crate::command;
use crate::layout::pages;
use crate::packages::Consent;
use crate::project::Project;
use anyhow::{Context, Result};
use pulldown_cmark::{Event, Options, Parser, Tag, html};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Checks the documents, and builds both parts.
pub fn run(project: &Project, consent: Consent) -> Result<()> {
    println!("  documents: {}", pages::check(project)?);
    let book = project.target.join("book");
    let mut mdbook = Command::new(mdbook(project, consent)?);
    command::run(mdbook.arg("build").arg("--dest-dir").arg(book.join(pages::BOOK)).arg(&project.root))?;
    linked(project, &book)?;
    code(project)?;
    copy(&project.target.join("doc"), &book.join("api"))?;
    let libraries = project.packages.iter().map(|package| package.name.replace('-', "_"));
    let mut index = format!("- [Documents]({}/index.html)\n", pages::BOOK);
    for name in libraries.filter(|name| book.join("api").join(name).is_dir()) {
        index.push_str(&["- [", &name, "](api/", &name, "/index.html)\n"].concat());
    }
    write(&book.join("index.html"), &page(&format!("# jointrig\n\n{index}")))?;
    println!("written: {}", book.join("index.html").display());
    Ok(())
}

/// Builds the documentation of the code; warnings are errors.
pub fn code(project: &Project) -> Result<()> {
    let mut cargo = command::cargo(&project.root);
    // In release, like clippy, so that the dependencies' metadata is already available.
    cargo.env("RUSTDOCFLAGS", "-Dwarnings").args(["doc", "--workspace", "--no-deps", "--release"]);
    command::run(&mut cargo).context("the documentation has faults: each one above names its file")
}

/// The program, installed below the target directory if it is not there.
fn mdbook(project: &Project, consent: Consent) -> Result<PathBuf> {
    let tools = project.target.join("tools");
    let own = tools.join("bin").join(format!("mdbook{}", std::env::consts::EXE_SUFFIX));
    if let Some(found) = command::find_program("mdbook") {
        return Ok(found);
    }
    if !command::is_executable(&own) {
        consent.require(&format!("Install mdbook into {}, which takes some minutes", tools.display()))?;
        let mut cargo = command::cargo(&project.root);
        command::run(cargo.args(["install", "mdbook", "--locked", "--root"]).arg(&tools))
            .context("mdbook could not be installed: check the network, or install it and put it on PATH")?;
    }
    Ok(own)
}

/// Writes the files outside `docs/` to which the book's pages link, directly or indirectly:
/// Markdown as HTML, because mdBook changes the ending of links to it.
fn linked(project: &Project, book: &Path) -> Result<()> {
    let pages = pages::read(&project.root)?;
    let mut open: Vec<PathBuf> = pages.keys().filter(|page| page.starts_with(pages::BOOK)).cloned().collect();
    let mut seen = BTreeSet::new();
    while let Some(path) = open.pop() {
        for link in pages.get(&path).into_iter().flat_map(|page| &page.links) {
            let Some((target, _)) = pages::target(&path, link) else { continue };
            let (from, to) = (project.root.join(&target), book.join(&target));
            if target.starts_with(pages::BOOK) || !from.is_file() || !seen.insert(target.clone()) {
                continue;
            }
            if pages.contains_key(&target) {
                let text = fs::read_to_string(&from)
                    .with_context(|| format!("could not read {}", from.display()))?;
                write(&to.with_extension("html"), &page(&text))?;
                open.push(target);
            } else {
                copy(&from, &to)?;
            }
        }
    }
    Ok(())
}

/// A page of HTML. Links to Markdown lead to the HTML that is made of it.
fn page(markdown: &str) -> String {
    let events = Parser::new_ext(markdown, Options::ENABLE_TABLES).map(|event| match event {
        Event::Start(Tag::Link { link_type, dest_url, title, id }) => {
            let dest_url = match dest_url.split_once(".md") {
                Some((path, anchor)) if !path.contains(':') => format!("{path}.html{anchor}").into(),
                _ => dest_url,
            };
            Event::Start(Tag::Link { link_type, dest_url, title, id })
        }
        other => other,
    });
    let mut text = "<!DOCTYPE html>\n<meta charset=\"utf-8\">\n<title>jointrig</title>\n".to_owned();
    html::push_html(&mut text, events);
    text
}

fn write(path: &Path, text: &str) -> Result<()> {
    let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(path, text));
    written.with_context(|| format!("could not write {}", path.display()))
}

/// Copies a file, or a folder with everything in it.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let context = || format!("could not copy {} to {}", from.display(), to.display());
    if from.is_dir() {
        for entry in fs::read_dir(from).with_context(context)? {
            let entry = entry.with_context(context)?;
            copy(&entry.path(), &to.join(entry.file_name()))?;
        }
        return Ok(());
    }
    let copied = to.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::copy(from, to).map(drop));
    copied.with_context(context)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_links_to_pages_and_a_folder_is_copied_with_what_is_below_it() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        write(&folder.path().join("a/b/c.html"), &page("[One](x.md#y) [two](z.rs)")).expect("written");
        copy(&folder.path().join("a"), &folder.path().join("d")).expect("copied");
        let text = fs::read_to_string(folder.path().join("d/b/c.html")).expect("it is there");
        assert!(text.ends_with("<a href=\"x.html#y\">One</a> <a href=\"z.rs\">two</a></p>\n"), "{text}");
        assert!(copy(&folder.path().join("nowhere"), &folder.path().join("e")).is_err());
    }
}
