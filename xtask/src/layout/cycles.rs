//! No two production files of a crate import each other, directly or indirectly.
//!
//! A file imports another if its code names something that the other defines, in a `use` line or in
//! a path; a re-export in a `mod.rs` counts for the file that defines the item. A file and the
//! files below it (`store/mod.rs` and `store/seal.rs`) form one unit: between them, imports in both
//! directions are allowed. Tests are ignored, and so are methods, because their types are not
//! written at the call.

use super::modules::{self, Found, Tree};
use crate::project::Project;
use anyhow::{Result, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// An import that may close a cycle: from a file, to a file, and what would have to move for the
/// cycle to end.
type Allowed = (&'static str, &'static str, &'static str);

/// The imports that may close a cycle: none at present. A row that closes none any more is
/// reported.
const ALLOWED: [Allowed; 0] = [];

/// For each file, the files it imports, and for each of these the names with the line of their
/// first use.
type Imports = BTreeMap<String, BTreeMap<String, BTreeMap<String, usize>>>;

/// Looks for cycles in every crate of both workspaces; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let (mut imports, mut files) = (Imports::new(), BTreeSet::new());
    for tree in modules::of_project(project)? {
        read(&tree, &project.root, &mut imports);
        files.extend(tree.modules.into_iter().map(|module| module.file));
    }
    judge(&imports, &ALLOWED)?;
    Ok(format!("{} files, {} imports are allowed to close a cycle", files.len(), ALLOWED.len()))
}

/// Adds the imports of each file from others that are neither above nor below it.
fn read(tree: &Tree, root: &Path, imports: &mut Imports) {
    let shown = |file: &Path| file.strip_prefix(root).unwrap_or(file).to_string_lossy().replace('\\', "/");
    for (number, module) in tree.modules.iter().enumerate() {
        for path in &module.paths {
            let Some(Found::Item(other, name)) = tree.find(number, &path.names) else { continue };
            let other = &tree.modules[other];
            let related = module.path.starts_with(&other.path) || other.path.starts_with(&module.path);
            if !related && other.file != module.file {
                let of_file = imports.entry(shown(&module.file)).or_default();
                let names = of_file.entry(shown(&other.file)).or_default();
                names.entry(name.to_owned()).or_insert(path.line);
            }
        }
    }
}

/// Every file that is reachable in one or more steps.
fn reachable<'a>(imports: &'a Imports, from: &'a str) -> BTreeSet<&'a str> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(file) = open.pop() {
        let next = imports.get(file).into_iter().flat_map(BTreeMap::keys);
        open.extend(next.map(String::as_str).filter(|next| reached.insert(*next)));
    }
    reached
}

/// The cycles, as the largest sets of files in which each reaches every other, with their imports.
fn cycles(imports: &Imports) -> Vec<String> {
    let reached: BTreeMap<&str, BTreeSet<&str>> =
        imports.keys().map(|file| (&**file, reachable(imports, file))).collect();
    let reaches = |one: &str, other: &str| reached.get(one).is_some_and(|files| files.contains(other));
    let (mut seen, mut cycles) = (BTreeSet::new(), Vec::new());
    for &file in reached.keys().filter(|file| reaches(file, file)) {
        if seen.contains(file) {
            continue;
        }
        let files: BTreeSet<&str> =
            reached.keys().copied().filter(|other| reaches(file, other) && reaches(other, file)).collect();
        let mut lines = vec![format!("{} files import each other:", files.len())];
        for one in &files {
            for (other, names) in imports[*one].iter().filter(|(other, _)| files.contains(other.as_str())) {
                let names: Vec<_> =
                    names.iter().map(|(name, line)| format!("{name} (line {line})")).collect();
                lines.push(format!("{one} uses {} of {other}", names.join(", ")));
            }
        }
        seen.extend(files);
        cycles.push(lines.join("\n    "));
    }
    cycles
}

/// Fails for cycles without an allowed import, and for allowed imports that close no cycle.
fn judge(imports: &Imports, allowed: &[Allowed]) -> Result<()> {
    let mut faults = Vec::new();
    let mut left = imports.clone();
    for (from, to, moves) in allowed {
        let there = left.get_mut(*from).is_some_and(|others| others.remove(*to).is_some());
        if !there || !reachable(imports, to).contains(from) {
            faults.push(format!(
                "the import from {from} to {to} closes no cycle any more ({moves}): remove its row from \
                 ALLOWED in xtask/src/layout/cycles.rs"
            ));
        }
    }
    faults.extend(cycles(&left));
    if faults.is_empty() {
        return Ok(());
    }
    bail!(
        "{}\n  Move what both files need into a separate file, or pass it as an argument",
        faults.join("\n  ")
    )
}

#[cfg(test)]
mod tests {
    use super::super::modules::tests::crate_of;
    use super::*;

    const TWO: [(&str, &str); 3] = [
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "\nuse super::b::B; pub struct A;"),
        ("b.rs", "pub struct B; fn f() { println!(\"{}\", crate::a::A); }"),
    ];

    fn judged(files: &[(&str, &str)], allowed: &[(&'static str, &'static str)]) -> Result<(), String> {
        let (folder, tree) = crate_of(files);
        let mut imports = Imports::new();
        read(&tree, folder.path(), &mut imports);
        let allowed: Vec<Allowed> = allowed.iter().map(|&(from, to)| (from, to, "B")).collect();
        judge(&imports, &allowed).map_err(|error| error.to_string())
    }

    #[test]
    fn two_files_that_import_each_other_are_named_with_their_lines() {
        let message = judged(&TWO, &[]).expect_err("a cycle");
        let expected = "2 files import each other:\n    a.rs uses B (line 2) of b.rs\n    b.rs uses A (line 1) of a.rs\n";
        assert!(message.starts_with(expected), "{message}");
    }

    #[test]
    fn an_indirect_cycle_through_a_re_export_is_found() {
        let files = [
            ("lib.rs", "mod a; mod b; mod c; mod e;"),
            ("a.rs", "use crate::b::Deep; pub fn a() {}"),
            ("b/mod.rs", "mod d; pub use d::Deep;"),
            ("b/d.rs", "use crate::c; pub struct Deep; fn f() { c::c() }"),
            ("c.rs", "use crate::a::a; pub fn c() {}"),
            ("e.rs", "use crate::a::a;"),
        ];
        let message = judged(&files, &[]).expect_err("a cycle");
        assert!(message.starts_with("3 files import each other:\n    a.rs uses Deep"), "{message}");
        assert!(judged(&files, &[("c.rs", "a.rs")]).is_ok());
    }

    #[test]
    fn a_module_and_its_children_are_no_cycle_and_tests_do_not_count() {
        let files = [
            ("lib.rs", "mod a; mod b; pub struct Error;"),
            ("a/mod.rs", "mod c; use c::C; pub struct Own; #[cfg(test)] mod tests { use crate::b::B; }"),
            ("a/c.rs", "use super::Own; pub struct C;"),
            ("b.rs", "use crate::{a::Own, Error}; pub struct B;"),
        ];
        assert_eq!(judged(&files, &[]), Ok(()));
    }

    #[test]
    fn an_allowed_import_passes_only_while_it_closes_a_cycle() {
        assert_eq!(judged(&TWO, &[("a.rs", "b.rs")]), Ok(()));
        let gone = judged(&TWO, &[("a.rs", "b.rs"), ("a.rs", "c.rs")]).expect_err("no such import");
        assert!(gone.starts_with("the import from a.rs to c.rs closes no cycle any more (B)"), "{gone}");
        let harmless = [TWO[0], TWO[1], ("b.rs", "pub struct B;")];
        let stale = judged(&harmless, &[("a.rs", "b.rs")]).expect_err("no cycle");
        assert!(stale.starts_with("the import from a.rs to b.rs closes no cycle any more"), "{stale}");
    }
}
