//! No two production files of a crate import each other, directly or indirectly.
//!
//! A file imports another if its code names something that the other defines, in a `use` line or in
//! a path; a re-export in a `mod.rs` counts for the file that defines the item. A file and the
//! files below it (`store/mod.rs` and `store/seal.rs`) form one unit: between them, imports in both
//! directions are allowed. Tests are ignored, and so are methods, because their types are not
//! written at the call.

use super::modules::{Found, Tree};
use crate::project::Project;
use anyhow::{Result, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A circle that is allowed.
struct Allowed {
    /// Its files, relative to the repository's root.
    files: &'static [&'static str],
    /// Why these files belong together.
    reason: &'static str,
}

/// The allowed circles: parts of one type, for which a common file would be no improvement.
const ALLOWED: [Allowed; 0] = [];

/// For each file, the files it imports, and for each of these the names with the line of their
/// first use.
type Imports = BTreeMap<PathBuf, BTreeMap<PathBuf, BTreeMap<String, usize>>>;

/// Looks for circles in every crate of the workspace; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let (mut found, mut files) = (Vec::new(), 0);
    for root in project.packages.iter().flat_map(|package| &package.roots) {
        let tree = Tree::read(root)?;
        files += tree.modules.iter().map(|module| &module.file).collect::<BTreeSet<_>>().len();
        found.extend(circles(&imports(&tree, &project.root)));
    }
    judge(&found, &ALLOWED)?;
    Ok(format!("{files} files without circles"))
}

/// The imports of each file from others that are neither above nor below it.
fn imports(tree: &Tree, root: &Path) -> Imports {
    let shown = |file: &Path| file.strip_prefix(root).unwrap_or(file).to_path_buf();
    let mut imports = Imports::new();
    for (number, module) in tree.modules.iter().enumerate() {
        for named in &module.named {
            let Some(Found::Item(other, name)) = tree.find(number, &named.path) else { continue };
            let other = &tree.modules[other];
            let related = module.path.starts_with(&other.path) || other.path.starts_with(&module.path);
            if !related && other.file != module.file {
                let names =
                    imports.entry(shown(&module.file)).or_default().entry(shown(&other.file)).or_default();
                names.entry(name.to_owned()).or_insert(named.line);
            }
        }
    }
    imports
}

/// One circle: its files, and the imports among them.
#[derive(Debug)]
struct Circle {
    files: BTreeSet<PathBuf>,
    told: String,
}

/// The largest sets of files in which each reaches every other.
fn circles(imports: &Imports) -> Vec<Circle> {
    let reached: BTreeMap<&PathBuf, BTreeSet<&PathBuf>> =
        imports.keys().map(|file| (file, reachable(imports, file))).collect();
    let (mut seen, mut circles) = (BTreeSet::new(), Vec::new());
    for (file, others) in &reached {
        if !others.contains(file) || !seen.insert(*file) {
            continue;
        }
        let mutual = |other: &&&PathBuf| reached.get(**other).is_some_and(|back| back.contains(file));
        let files: BTreeSet<PathBuf> = others.iter().filter(mutual).map(|file| (*file).clone()).collect();
        seen.extend(reached.keys().filter(|file| files.contains(**file)));
        circles.push(Circle { told: told(imports, &files), files });
    }
    circles
}

/// Every file that is reachable in one or more steps.
fn reachable<'a>(imports: &'a Imports, from: &PathBuf) -> BTreeSet<&'a PathBuf> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
    while let Some(file) = open.pop() {
        for next in imports.get(file).into_iter().flat_map(BTreeMap::keys) {
            if reached.insert(next) {
                open.push(next);
            }
        }
    }
    reached
}

fn told(imports: &Imports, files: &BTreeSet<PathBuf>) -> String {
    let mut told = String::new();
    for (file, others) in imports.iter().filter(|(file, _)| files.contains(*file)) {
        for (other, names) in others.iter().filter(|(other, _)| files.contains(*other)) {
            let mut names: Vec<_> = names.iter().map(|(name, line)| (line, name)).collect();
            names.sort_unstable();
            let names: Vec<_> =
                names.into_iter().map(|(line, name)| format!("{name} (line {line})")).collect();
            // Writing into a String cannot fail.
            let _ =
                write!(told, "\n    {} names {} of {}", file.display(), names.join(", "), other.display());
        }
    }
    told
}

/// Fails for circles that are not allowed, and for allowances that are no longer needed.
fn judge(found: &[Circle], allowed: &[Allowed]) -> Result<()> {
    let files = |allowed: &Allowed| allowed.files.iter().map(PathBuf::from).collect::<BTreeSet<_>>();
    let mut faults = Vec::new();
    for circle in found.iter().filter(|circle| !allowed.iter().any(|allowed| files(allowed) == circle.files))
    {
        faults.push(format!("{} files import each other:{}", circle.files.len(), circle.told));
    }
    for allowed in allowed.iter().filter(|allowed| !found.iter().any(|circle| circle.files == files(allowed)))
    {
        faults.push(format!(
            "no circle is made of exactly {} any more ({}): take it off the list",
            allowed.files.join(", "),
            allowed.reason
        ));
    }
    if faults.is_empty() {
        return Ok(());
    }
    bail!(
        "{}\n  Move what both need into a file of its own, or hand it over as an argument. Parts of one type may stay: \
         ALLOWED in xtask/src/house/circles.rs, with the reason",
        faults.join("\n  ")
    )
}

#[cfg(test)]
mod tests {
    use super::super::modules::tests::crate_of;
    use super::*;

    fn found(files: &[(&str, &str)]) -> Vec<Circle> {
        let (folder, tree) = crate_of(files);
        circles(&imports(&tree, folder.path()))
    }

    fn names(circle: &Circle) -> Vec<String> {
        circle.files.iter().map(|file| file.display().to_string()).collect()
    }

    #[test]
    fn two_files_that_import_each_other_are_a_circle_with_its_lines() {
        let found = found(&[
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "\nuse super::b::B; pub struct A;"),
            ("b.rs", "pub struct B; fn f() { crate::a::A; }"),
            ("c.rs", "use super::a::A;"),
        ]);
        assert_eq!(found.iter().map(names).collect::<Vec<_>>(), [["a.rs", "b.rs"]]);
        assert!(found[0].told.contains("\n    a.rs names B (line 2) of b.rs"), "{}", found[0].told);
        assert!(found[0].told.contains("\n    b.rs names A (line 1) of a.rs"), "{}", found[0].told);
    }

    #[test]
    fn a_circle_around_a_corner_and_through_a_room_is_seen() {
        let found = found(&[
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "use crate::b::Deep; pub fn a() {}"),
            ("b/mod.rs", "mod d; pub use d::Deep;"),
            ("b/d.rs", "use crate::c; pub struct Deep; fn f() { c::c() }"),
            ("c.rs", "use crate::a::a; pub fn c() {}"),
        ]);
        assert_eq!(found.iter().map(names).collect::<Vec<_>>(), [["a.rs", "b/d.rs", "c.rs"]]);
    }

    #[test]
    fn a_room_and_its_closets_are_no_circle_and_tests_do_not_count() {
        let found = found(&[
            ("lib.rs", "mod a; mod b; pub struct Error;"),
            ("a/mod.rs", "mod c; use c::C; pub struct Own; #[cfg(test)] mod tests { use crate::b::B; }"),
            ("a/c.rs", "use super::Own; pub struct C;"),
            ("b.rs", "use crate::{a::Own, Error}; pub struct B;"),
        ]);
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn an_allowed_circle_passes_and_a_stale_allowance_does_not() {
        let found = found(&[
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", "use super::b::B; pub struct A;"),
            ("b.rs", "use super::a::A; pub struct B;"),
        ]);
        let allowed = |files| [Allowed { files, reason: "one type" }];
        assert!(judge(&found, &allowed(&["a.rs", "b.rs"])).is_ok());
        let message = judge(&found, &[]).expect_err("not allowed").to_string();
        assert!(message.starts_with("2 files import each other:"), "{message}");
        let message = judge(&[], &allowed(&["a.rs", "b.rs"])).expect_err("stale").to_string();
        assert!(
            message.starts_with("no circle is made of exactly a.rs, b.rs any more (one type)"),
            "{message}"
        );
    }
}
