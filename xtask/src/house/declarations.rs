//! What one source file declares: its modules, and what each defines, imports and names.
//!
//! Read from the text, so it costs no compiler. What stands under `#[cfg(test)]` is passed over, whatever else a `cfg` says is
//! read. Names that macros make are not seen.

use super::tokens::{self, Token};
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

/// A module whose file is still to be read.
#[derive(Debug, PartialEq, Eq)]
pub struct Child {
    /// The names that lead to it from the crate's root, its own last.
    pub path: Vec<String>,
    /// The modules inside the file that it stands in.
    pub inside: Vec<String>,
    /// What `#[path = "…"]` says.
    pub file: Option<String>,
}

/// Reads the modules of one file, its own first, and says which files follow; `path` leads to the file's own.
pub fn of(source: &str, file: &Path, path: &[String]) -> (Vec<Module>, Vec<Child>) {
    let tokens = tokens::of(source);
    let (modules, children) = (Vec::new(), Vec::new());
    let mut parser = Parser { tokens: &tokens, at: 0, file, outermost: path.len(), modules, children };
    parser.module(path);
    (parser.modules, parser.children)
}

struct Parser<'a> {
    tokens: &'a [Token<'a>],
    at: usize,
    file: &'a Path,
    /// How many names lead to the module of the file itself.
    outermost: usize,
    modules: Vec<Module>,
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
        let (number, mut depth, mut file) = (self.modules.len(), 0_usize, None);
        self.modules.push(Module { path: path.to_vec(), file: self.file.to_path_buf(), ..Module::default() });
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
                        file = attribute.last().map(|path| path.trim_matches('"').to_owned());
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
                        let inside = path[self.outermost..path.len() - 1].to_vec();
                        self.children.push(Child { path, inside, file: file.take() });
                    }
                }
                "use" => {
                    self.at += 1;
                    self.use_tree(number, &[]);
                    continue;
                }
                "struct" | "enum" | "union" | "trait" | "fn" | "const" | "static" | "type" if depth == 0 => {
                    let items = &mut self.modules[number].items;
                    let name = self.tokens.get(self.at + 1).filter(|token| token.is_word());
                    // `const fn` and `static mut` are followed by one more keyword.
                    items.extend(
                        name.filter(|name| !["fn", "mut", "unsafe"].contains(&name.text))
                            .map(|name| name.text.to_owned()),
                    );
                }
                "macro_rules" => {
                    let name = self.word(2).map(String::from);
                    self.modules[number].items.extend(name);
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
        self.modules[module].named.push(named);
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
                    self.modules[module].globs.push(Named { path, line });
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
        let (named, module) = (Named { path, line }, &mut self.modules[module]);
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
mod tests {
    use super::*;

    #[test]
    fn paths_in_code_and_in_use_lines_are_listed_with_their_lines() {
        let source = "use a::{\n    b::C,\n    d::{self, E as F},\n};\npub(in crate::x) fn f() -> u8 {\n    super::g::<u8>(\"crate::h\")\n}";
        let (modules, _) = of(source, Path::new("lib.rs"), &[]);
        let named: Vec<String> = modules[0]
            .named
            .iter()
            .map(|named| format!("{}:{}", named.line, named.path.join("::")))
            .collect();
        assert_eq!(named, ["2:a::b::C", "3:a::d", "3:a::d::E", "6:super::g"]);
        assert!(modules[0].uses.contains_key("F"));
        assert!(modules[0].items.contains("f"));
    }

    #[test]
    fn files_that_follow_are_told_with_the_modules_around_them() {
        let source = "mod a { #[path = \"c.rs\"] mod b; } #[cfg(all(test, unix))] mod d; #[cfg(unix)] mod e;";
        let (modules, children) = of(source, Path::new("x.rs"), &["x".to_owned()]);
        assert_eq!(modules.len(), 2);
        let child = |path: &[&str], inside: &[&str], file: Option<&str>| Child {
            path: path.iter().map(|name| (*name).to_owned()).collect(),
            inside: inside.iter().map(|name| (*name).to_owned()).collect(),
            file: file.map(String::from),
        };
        assert_eq!(children, [child(&["x", "a", "b"], &["a"], Some("c.rs")), child(&["x", "e"], &[], None)]);
    }
}
