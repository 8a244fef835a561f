//! The modules of one crate's production code: `mod` lines lead from file to file, and `use` lines to what a name means.

use super::declarations::{self, Module};
use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// The modules of a crate; a module's number is its place.
#[derive(Debug, Default)]
pub struct Tree {
    /// The modules, the root first.
    pub modules: Vec<Module>,
    by_path: BTreeMap<Vec<String>, usize>,
}

/// What a path leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found<'a> {
    /// A module itself.
    Module(usize),
    /// Something that this module defines, by its name there.
    Item(usize, &'a str),
}

/// So many names lead from one to the next before it must be a circle of `use` lines.
const LONGEST_CHAIN: usize = 32;

impl Tree {
    /// Reads a crate from its root file.
    pub fn read(root: &Path) -> Result<Self> {
        let mut tree = Self::default();
        let folder = root.parent().context("a source file stands in a folder")?;
        tree.read_file(root, folder, &[])?;
        Ok(tree)
    }

    /// Reads a file; `folder` is where the files of its modules are.
    fn read_file(&mut self, file: &Path, folder: &Path, path: &[String]) -> Result<()> {
        let source =
            std::fs::read_to_string(file).with_context(|| format!("could not read {}", file.display()))?;
        let (modules, children) = declarations::of(&source, file, path);
        for module in modules {
            self.by_path.insert(module.path.clone(), self.modules.len());
            self.modules.push(module);
        }
        for child in children {
            let name = child.path.last().context("a module has a name")?.clone();
            if let Some(named) = child.file {
                // As cargo does: beside the file that says so, and its own modules beside it.
                let beside = file.with_file_name(named);
                self.read_file(&beside, beside.parent().unwrap_or(folder), &child.path)?;
                continue;
            }
            // Below a module written inside a file, its files have a folder of their own.
            let inner = folder.join(child.inside.join("/"));
            let beside = inner.join(format!("{name}.rs"));
            let below = inner.join(&name).join("mod.rs");
            let file = if beside.is_file() { beside } else { below };
            self.read_file(&file, &inner.join(&name), &child.path)?;
        }
        Ok(())
    }

    fn child(&self, module: usize, name: &str) -> Option<usize> {
        let mut path = self.modules[module].path.clone();
        path.push(name.to_owned());
        self.by_path.get(&path).copied()
    }

    fn parent(&self, module: usize) -> Option<usize> {
        let (_, path) = self.modules[module].path.split_last()?;
        self.by_path.get(path).copied()
    }

    /// Where `path`, written in `module`, leads: through `use` lines to the module that defines the thing. Nothing for
    /// what belongs to other crates.
    pub fn find(&self, module: usize, path: &[String]) -> Option<Found<'_>> {
        self.find_within(module, path, LONGEST_CHAIN)
    }

    fn find_within(&self, module: usize, path: &[String], left: usize) -> Option<Found<'_>> {
        let left = left.checked_sub(1)?;
        let (first, rest) = path.split_first()?;
        match &**first {
            "crate" => self.walk(0, rest, left),
            "self" => self.walk(module, rest, left),
            "super" if rest.first().is_some_and(|next| next == "super") => {
                self.find_within(self.parent(module)?, rest, left)
            }
            "super" => self.walk(self.parent(module)?, rest, left),
            _ => self.lookup(module, first, rest, left),
        }
    }

    fn walk(&self, module: usize, path: &[String], left: usize) -> Option<Found<'_>> {
        let Some((first, rest)) = path.split_first() else { return Some(Found::Module(module)) };
        // A name that is not found was made by a macro, or is another crate's that this module passes on.
        self.lookup(module, first, rest, left)
    }

    /// The thing called `name` in `module`, and on from there.
    fn lookup(&self, module: usize, name: &str, rest: &[String], left: usize) -> Option<Found<'_>> {
        let left = left.checked_sub(1)?;
        if let Some(child) = self.child(module, name) {
            return self.walk(child, rest, left);
        }
        let this = &self.modules[module];
        if let Some(item) = this.items.get(name) {
            return Some(Found::Item(module, item));
        }
        if let Some(used) = this.uses.get(name) {
            // `use thing::part as thing` names another crate.
            let itself = used.path.first().is_some_and(|first| first == name);
            return match (!itself).then(|| self.find_within(module, &used.path, left)).flatten()? {
                Found::Module(next) => self.walk(next, rest, left),
                item @ Found::Item(..) => Some(item),
            };
        }
        this.globs.iter().find_map(|glob| match self.find_within(module, &glob.path, left)? {
            Found::Module(next) if next != module => self.lookup(next, name, rest, left),
            _ => None,
        })
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use std::fs;

    /// A crate of these files.
    pub fn crate_of(files: &[(&str, &str)]) -> (tempfile::TempDir, Tree) {
        let folder = tempfile::tempdir().expect("a scratch folder");
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("it has one")).expect("a folder");
            fs::write(path, text).expect("a file");
        }
        let tree = Tree::read(&folder.path().join(files[0].0)).expect("it can be read");
        (folder, tree)
    }

    fn number(tree: &Tree, path: &[&str]) -> usize {
        tree.modules.iter().position(|module| module.path == path).expect("the module is there")
    }

    fn names(path: &str) -> Vec<String> {
        path.split("::").map(String::from).collect()
    }

    #[test]
    fn files_are_found_in_both_styles_and_tests_are_not_read() {
        let (_folder, tree) = crate_of(&[
            ("lib.rs", "mod a; mod b;\n#[cfg(test)] mod missing;\n#[cfg(test)]\nmod tests { use crate::a; }"),
            ("a.rs", "pub mod c;"),
            ("a/c.rs", ""),
            ("b/mod.rs", "#[path = \"other.rs\"] mod d; mod inside { mod e; }"),
            ("b/other.rs", ""),
            ("b/inside/e.rs", ""),
        ]);
        let paths: Vec<String> = tree.modules.iter().map(|module| module.path.join("::")).collect();
        assert_eq!(paths, ["", "a", "a::c", "b", "b::inside", "b::d", "b::inside::e"]);
        assert!(tree.modules.iter().all(|module| module.named.is_empty()));
    }

    #[test]
    fn a_name_leads_to_the_file_that_defines_it() {
        let (_folder, tree) = crate_of(&[
            ("lib.rs", "pub mod a; mod b;"),
            ("a/mod.rs", "mod c; mod d; pub use c::{self as see, Seal}; pub use d::*; pub struct Own;"),
            ("a/c.rs", "pub struct Seal;"),
            ("a/d.rs", "pub(crate) const fn last() {}"),
            ("b.rs", "use crate::a; use std::fmt;"),
        ]);
        let b = number(&tree, &["b"]);
        let found = |path: &str| tree.find(b, &names(path));
        assert_eq!(found("crate::a::Own"), Some(Found::Item(number(&tree, &["a"]), "Own")));
        let seal = Some(Found::Item(number(&tree, &["a", "c"]), "Seal"));
        assert_eq!(found("super::a::Seal"), seal);
        assert_eq!(found("a::see::Seal::new"), seal);
        assert_eq!(found("a"), Some(Found::Module(number(&tree, &["a"]))));
        assert_eq!(found("fmt::Display"), None);
        assert_eq!(found("Vec::new"), None);
    }

    #[test]
    fn what_everything_is_taken_of_is_searched() {
        let (_folder, tree) = crate_of(&[
            ("lib.rs", "mod a; mod d; pub use a::*; pub use d::*;"),
            ("a.rs", "use crate::*;"),
            ("d.rs", "pub(crate) static LAST: u8 = 1; pub const fn both() {}"),
        ]);
        let a = number(&tree, &["a"]);
        let d = number(&tree, &["d"]);
        assert_eq!(tree.find(a, &names("crate::LAST")), Some(Found::Item(d, "LAST")));
        assert_eq!(tree.find(a, &names("both::x")), Some(Found::Item(d, "both")));
        assert_eq!(tree.find(a, &names("crate::missing")), None);
    }
}
