//! The documents: every relative link and anchor leads somewhere, every folder and file named in
//! the overview pages exists, and the book has every page of `docs/` once.

use crate::project::Project;
use anyhow::{Context, Result, bail};
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// The pages in which paths between backticks are checked, too.
const OVERVIEWS: [&str; 3] = ["ARCHITECTURE.md", "CONTRIBUTING.md", "README.md"];
/// The folders with which such a path may begin. Other paths are abbreviations relative to one of
/// these, or belong to the user.
const TOP: [&str; 10] =
    ["protocol", "firmware", "hil-sim", "host", "tests", "benches", "xtask", "docs", ".cargo", ".github"];
/// The folder with the book's pages, and its table of contents.
pub const BOOK: &str = "docs";
const SUMMARY: &str = "docs/SUMMARY.md";

/// Checks all documents; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let pages = read(&project.root)?;
    let mut faults = broken(&project.root, &pages);
    faults.extend(unlisted(&pages));
    if faults.is_empty() {
        let links: usize = pages.values().map(|page| page.links.len()).sum();
        return Ok(format!("{} documents, {links} links", pages.len()));
    }
    bail!("{}", faults.join("\n    "))
}

/// One document.
#[derive(Default)]
pub struct Page {
    /// The targets of its links and images.
    pub links: Vec<String>,
    /// The texts between backticks.
    code: Vec<String>,
    anchors: BTreeSet<String>,
}

/// All Markdown files of the repository, by their path from its root.
pub fn read(root: &Path) -> Result<BTreeMap<PathBuf, Page>> {
    let (mut pages, mut folders) = (BTreeMap::new(), vec![root.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        let entries =
            std::fs::read_dir(&folder).with_context(|| format!("could not read {}", folder.display()))?;
        for entry in entries {
            let path = entry.with_context(|| format!("could not read {}", folder.display()))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path.is_dir() && name != "target" && !name.starts_with('.') {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                let text = std::fs::read_to_string(&path)
                    .with_context(|| format!("could not read {}", path.display()))?;
                pages.insert(path.strip_prefix(root).unwrap_or(&path).to_path_buf(), parse(&text));
            }
        }
    }
    Ok(pages)
}

fn parse(text: &str) -> Page {
    let mut page = Page::default();
    let mut heading: Option<String> = None;
    for event in Parser::new_ext(text, Options::ENABLE_TABLES | Options::ENABLE_FOOTNOTES) {
        if let (Some(heading), Event::Text(text) | Event::Code(text)) = (&mut heading, &event) {
            heading.push_str(text);
        }
        match event {
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::End(TagEnd::Heading(_)) => {
                let name = anchor(&heading.take().unwrap_or_default());
                let numbered = (1..).map(|number| format!("{name}-{number}"));
                let free = std::iter::once(name.clone()).chain(numbered);
                page.anchors.extend(free.into_iter().find(|name| !page.anchors.contains(name)));
            }
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                page.links.push(dest_url.into_string());
            }
            Event::Code(text) => page.code.push(text.into_string()),
            Event::Html(text) | Event::InlineHtml(text) => {
                let ids = text.split("id=\"").skip(1).filter_map(|rest| rest.split('"').next());
                page.anchors.extend(ids.map(String::from));
            }
            _ => {}
        }
    }
    page
}

/// The anchor that GitHub and mdBook give a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

/// The file to which a link leads, and its anchor; `None` for an address on the internet.
pub fn target<'l>(page: &Path, link: &'l str) -> Option<(PathBuf, Option<&'l str>)> {
    let (path, anchor) = link.split_once('#').map_or((link, None), |(path, anchor)| (path, Some(anchor)));
    if path.contains(':') {
        return None;
    }
    let mut target = if path.is_empty() { page.into() } else { page.parent()?.to_path_buf() };
    for part in Path::new(path).components() {
        match part {
            Component::ParentDir if target.pop() => {}
            // Outside the repository, or absolute: it is not found.
            Component::Normal(_) | Component::ParentDir | Component::RootDir => target.push(part),
            _ => {}
        }
    }
    Some((target, anchor))
}

/// The links and named paths that lead nowhere.
fn broken(root: &Path, pages: &BTreeMap<PathBuf, Page>) -> Vec<String> {
    let mut faults = Vec::new();
    for (path, page) in pages {
        for link in &page.links {
            let Some((target, anchor)) = target(path, link) else { continue };
            let outside = target.is_absolute() || target.starts_with("..");
            if outside || !root.join(&target).exists() {
                faults.push(format!("{}: the link {link} leads nowhere", path.display()));
            } else if let (Some(anchor), Some(other)) = (anchor, pages.get(&target))
                && !other.anchors.contains(anchor)
            {
                faults.push(format!("{}: {link} leads to no heading", path.display()));
            }
        }
        let named = page.code.iter().filter(|_| OVERVIEWS.iter().any(|overview| path == Path::new(overview)));
        for text in named.filter(|text| is_path(text) && !root.join(text).exists()) {
            faults.push(format!("{}: {text} does not exist", path.display()));
        }
    }
    faults
}

/// Whether a text between backticks is a path in the repository.
fn is_path(text: &str) -> bool {
    let top = text.split('/').next().unwrap_or_default();
    text.contains('/') && !text.contains([' ', '…', '*', '<']) && TOP.contains(&top)
}

/// The pages of the book that its table of contents does not have exactly once.
fn unlisted(pages: &BTreeMap<PathBuf, Page>) -> Vec<String> {
    let summary = Path::new(SUMMARY);
    let Some(contents) = pages.get(summary) else { return vec![format!("there is no {SUMMARY}")] };
    let listed: Vec<PathBuf> =
        contents.links.iter().filter_map(|link| Some(target(summary, link)?.0)).collect();
    let of_book = pages.keys().filter(|page| page.starts_with(BOOK) && *page != summary);
    of_book
        .map(|page| (page, listed.iter().filter(|listed| *listed == page).count()))
        .filter(|(_, count)| *count != 1)
        .map(|(page, count)| format!("{SUMMARY} lists {} {count} times, not once", page.display()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(files: &[(&str, &str)]) -> Vec<String> {
        let folder = tempfile::tempdir().expect("a scratch folder");
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("it has one")).expect("a folder");
            std::fs::write(path, text).expect("a file");
        }
        let pages = read(folder.path()).expect("they can be read");
        let mut faults = broken(folder.path(), &pages);
        faults.extend(unlisted(&pages));
        faults
    }

    const SUMMARY: (&str, &str) = ("docs/SUMMARY.md", "- [A](a.md)\n");

    #[test]
    fn links_that_lead_somewhere_pass() {
        let links = "# One `two`: three\n## Same\n## Same\n[a](#one-two-three) [b](../README.md#same-1) ![c](a.md)\n\
                     [d](https://example.org/x) [e](../docs) `[f](nowhere.md)`\n\n    [g](nowhere.md)\n";
        let readme = "# Same\n# Same\n<a id=\"x\"></a> [h](#x) [i](docs/a.md#same) `docs/a.md`, `cargo docs/x`, `and/or`";
        assert_eq!(faults(&[("docs/a.md", links), ("README.md", readme), SUMMARY]), [""; 0]);
    }

    #[test]
    fn a_broken_link_anchor_or_path_is_named() {
        let links = "[a](b.md) [b](#gone) [c](../../x.md)";
        let expected = [
            "README.md: docs/gone.rs does not exist",
            "docs/a.md: the link b.md leads nowhere",
            "docs/a.md: #gone leads to no heading",
            "docs/a.md: the link ../../x.md leads nowhere",
        ];
        assert_eq!(faults(&[("docs/a.md", links), ("README.md", "`docs/gone.rs`"), SUMMARY]), expected);
    }

    #[test]
    fn a_page_that_the_book_lacks_or_has_twice_is_named() {
        let twice = ("docs/SUMMARY.md", "- [A](a.md)\n- [A again](a.md)\n");
        let expected = [
            "docs/SUMMARY.md lists docs/a.md 2 times, not once",
            "docs/SUMMARY.md lists docs/b.md 0 times, not once",
        ];
        assert_eq!(faults(&[("docs/a.md", ""), ("docs/b.md", ""), twice]), expected);
        assert_eq!(faults(&[("docs/a.md", "")]), ["there is no docs/SUMMARY.md"]);
    }
}
