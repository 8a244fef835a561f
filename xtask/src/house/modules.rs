//! The modules of one crate's production code, as its sources declare them: what each defines, imports and names.
//!
//! Read from the text, so it costs no compiler: `mod` lines lead from file to file; what stands under `#[cfg(test)]` is
//! passed over, whatever else a `cfg` says is read. Names that macros make are not seen.

use super::tokens::{self, Token};
use anyhow::{Context, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A path as it is written (`super::seal::Seal`), and its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// The names between the `::`.
    pub path: Vec<String>,
    /// The line, counted from 1.
    pub line: usize,
}

/// One module. Modules written inside a file have the file's path.
#[derive(Debug, Default)]
pub struct Module {
    /// The names that lead to it from the crate's root, which is the empty list.
    pub path: Vec<String>,
    /// The file it stands in.
    pub file: PathBuf,
    /// What it defines itself.
    pub items: BTreeSet<String>,
    /// What its `use` lines bring in, by the name they give it.
    pub uses: BTreeMap<String, Named>,
    /// The modules of which it takes everything (`use x::*`).
    pub globs: Vec<Named>,
    /// Every path of two names or more in its code, `use` lines included.
    pub named: Vec<Named>,
}

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
        let tokens = tokens::of(&source);
        let mut parser = Parser { tree: self, tokens: &tokens, at: 0, file, children: Vec::new() };
        parser.module(path);
        for child in parser.children {
            let name = child.path.last().context("a module has a name")?.clone();
            if let Some(named) = child.file {
                // As cargo does: beside the file that says so, and its own modules beside it.
                let beside = file.with_file_name(named.trim_matches('"'));
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

    fn add(&mut self, path: Vec<String>, file: &Path) -> usize {
        self.by_path.insert(path.clone(), self.modules.len());
        self.modules.push(Module { path, file: file.to_path_buf(), ..Module::default() });
        self.modules.len() - 1
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

/// A module whose file is still to be read.
struct Child {
    path: Vec<String>,
    /// The modules inside the file that it stands in.
    inside: Vec<String>,
    /// What `#[path = "…"]` says, quotes included.
    file: Option<String>,
}

struct Parser<'a> {
    tree: &'a mut Tree,
    tokens: &'a [Token<'a>],
    at: usize,
    file: &'a Path,
    children: Vec<Child>,
}

impl<'a> Parser<'a> {
    fn text(&self, ahead: usize) -> &'a str {
        self.tokens.get(self.at + ahead).map_or("", |token| token.text)
    }

    fn word(&self, ahead: usize) -> Option<&'a str> {
        self.tokens.get(self.at + ahead).filter(|token| token.is_word()).map(|token| token.text)
    }

    /// Reads a module's body: the file, or up to the brace that closes it.
    fn module(&mut self, path: &[String]) {
        let outermost = self.file_path_length(path);
        let (number, mut depth, mut file) = (self.tree.add(path.to_vec(), self.file), 0_usize, None);
        while self.at < self.tokens.len() {
            match self.text(0) {
                "}" if depth == 0 => break,
                "{" => depth += 1,
                "}" => depth -= 1,
                "#" if self.text(1) == "[" => {
                    let attribute = self.attribute();
                    if for_tests(&attribute) {
                        self.skip_item();
                    } else if attribute.first() == Some(&"path") {
                        file = attribute.last().map(|path| (*path).to_owned());
                    }
                    continue;
                }
                "mod" if self.word(1).is_some() => {
                    let mut path = path.to_vec();
                    path.extend(self.word(1).map(String::from));
                    self.at += 2;
                    if self.text(0) == "{" {
                        self.at += 1;
                        self.module(&path);
                    } else {
                        let inside = path[outermost..path.len() - 1].to_vec();
                        self.children.push(Child { path, inside, file: file.take() });
                    }
                }
                "use" => {
                    self.at += 1;
                    self.use_tree(number, &[]);
                    continue;
                }
                "struct" | "enum" | "union" | "trait" | "fn" | "const" | "static" | "type" if depth == 0 => {
                    let items = &mut self.tree.modules[number].items;
                    let name = self.tokens.get(self.at + 1).filter(|token| token.is_word());
                    // `const fn` and `static mut` are followed by one more keyword.
                    items.extend(
                        name.filter(|name| !["fn", "mut", "unsafe"].contains(&name.text))
                            .map(|name| name.text.to_owned()),
                    );
                }
                "macro_rules" => {
                    let name = self.word(2).map(String::from);
                    self.tree.modules[number].items.extend(name);
                }
                "in" if self.at >= 2 && self.tokens[self.at - 2].text == "pub" => {
                    // `pub(in crate::x)` says who may look, and needs nothing of x.
                    while ![")", ""].contains(&self.text(0)) {
                        self.at += 1;
                    }
                }
                _ if self.word(0).is_some() && self.text(1) == "::" => {
                    self.path(number);
                    continue;
                }
                _ => {}
            }
            self.at += 1;
        }
    }

    /// How many names lead to the module of the file itself.
    fn file_path_length(&self, path: &[String]) -> usize {
        let first = self.tree.modules.iter().find(|module| module.file == self.file);
        first.map_or(path.len(), |module| module.path.len())
    }

    /// A path in code: `super::seal::check(…)`.
    fn path(&mut self, module: usize) {
        let mut named = Named { path: Vec::new(), line: self.tokens[self.at].line };
        while let Some(word) = self.word(0) {
            named.path.push(word.to_owned());
            self.at += 1;
            if self.text(0) != "::" {
                break;
            }
            self.at += 1;
        }
        self.tree.modules[module].named.push(named);
    }

    /// One branch of a `use`, up to and without what ends it.
    fn use_tree(&mut self, module: usize, before: &[String]) {
        let mut path = before.to_vec();
        let line = self.tokens.get(self.at).map_or(0, |token| token.line);
        loop {
            match self.text(0) {
                "{" => {
                    while !["}", ""].contains(&self.text(0)) {
                        self.at += 1;
                        if self.text(0) != "}" {
                            self.use_tree(module, &path);
                        }
                    }
                    self.at += 1;
                    return;
                }
                "*" => {
                    self.at += 1;
                    self.tree.modules[module].globs.push(Named { path, line });
                    return;
                }
                "::" => self.at += 1,
                "as" => break,
                _ => match self.word(0) {
                    Some(word) => {
                        path.push(word.to_owned());
                        self.at += 1;
                    }
                    None => break,
                },
            }
        }
        // `use a::{self}` is `use a`.
        if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let mut name = path.last().cloned();
        if self.text(0) == "as" {
            name = self.word(1).map(String::from);
            self.at += 2;
        }
        let (Some(name), false) = (name, path.is_empty()) else { return };
        let (named, module) = (Named { path, line }, &mut self.tree.modules[module]);
        module.named.push(named.clone());
        if name != "_" {
            module.uses.insert(name, named);
        }
    }

    /// The words and signs between the brackets of an attribute.
    fn attribute(&mut self) -> Vec<&'a str> {
        self.at += 1;
        let begin = self.at + 1;
        self.skip_brackets();
        self.tokens[begin.min(self.at)..self.at.saturating_sub(1)].iter().map(|token| token.text).collect()
    }

    /// From an opening bracket past its closing one.
    fn skip_brackets(&mut self) {
        let mut depth = 0_usize;
        while self.at < self.tokens.len() {
            match self.text(0) {
                "(" | "[" | "{" => depth += 1,
                ")" | "]" | "}" => depth = depth.saturating_sub(1),
                _ => {}
            }
            self.at += 1;
            if depth == 0 {
                return;
            }
        }
    }

    /// Past an item: to its semicolon, or past its braces.
    fn skip_item(&mut self) {
        while self.at < self.tokens.len() {
            match self.text(0) {
                ";" => {
                    self.at += 1;
                    return;
                }
                "{" => return self.skip_brackets(),
                "(" | "[" => self.skip_brackets(),
                // the end of what the item stands in: a field or an argument without a comma
                "}" | ")" => return,
                _ => self.at += 1,
            }
        }
    }
}

/// Whether an attribute keeps its item for tests: `cfg(test)` or `cfg(all(test, …))`.
fn for_tests(attribute: &[&str]) -> bool {
    attribute.starts_with(&["cfg", "(", "test", ")"])
        || attribute.starts_with(&["cfg", "(", "all", "(", "test"])
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

    #[test]
    fn paths_in_code_and_in_use_lines_are_listed_with_their_lines() {
        let (_folder, tree) = crate_of(&[(
            "lib.rs",
            "use a::{\n    b::C,\n    d::{self, E as F},\n};\npub(in crate::x) fn f() -> u8 {\n    super::g::<u8>(\"crate::h\")\n}",
        )]);
        let named: Vec<String> = tree.modules[0]
            .named
            .iter()
            .map(|named| format!("{}:{}", named.line, named.path.join("::")))
            .collect();
        assert_eq!(named, ["2:a::b::C", "3:a::d", "3:a::d::E", "6:super::g"]);
        assert!(tree.modules[0].uses.contains_key("F"));
    }
}
