//! Inside the host, dependencies between top-level modules are layered: a module only uses modules
//! of lower layers.

use super::modules::{Found, Tree};
use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::collections::BTreeSet;

/// The package whose modules are checked.
const PACKAGE: &str = "jointrig";
/// Its layers, the lowest first. Modules of one layer do not use each other.
const FLOORS: [&[&str]; 8] = [
    &["device", "exchange"],
    &["campaign"],
    &["results"],
    &["analyse"],
    &["report"],
    &["live"],
    &["dashboard"],
    &["cli"],
];

/// Searches for dependencies on the same or a higher layer; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let package = project.package(PACKAGE).with_context(|| format!("there is no package {PACKAGE}"))?;
    let root = package.roots.first().with_context(|| format!("{PACKAGE} has no source"))?;
    let arrows = upwards(&Tree::read(root)?, &FLOORS);
    if arrows.is_empty() {
        return Ok(format!("{} floors, every arrow runs down", FLOORS.len()));
    }
    bail!("{}. The floors are the table of xtask/src/house/rooms.rs", arrows.join("\n    "))
}

/// Uses of a module that is not in a lower layer, each file and item once.
fn upwards(tree: &Tree, floors: &[&[&str]]) -> Vec<String> {
    let mut arrows = BTreeSet::new();
    for (number, module) in tree.modules.iter().enumerate() {
        for named in &module.named {
            let Some(Found::Item(other, item)) = tree.find(number, &named.path) else { continue };
            let rooms = [&module.path, &tree.modules[other].path].map(|path| path.first());
            let [Some(from), Some(to)] = rooms else { continue };
            let [Some(own), Some(named_one)] = [from, to].map(|room| floor(room, floors)) else { continue };
            if from != to && named_one >= own {
                arrows.insert(format!("{from} names {item} of {to} ({})", module.path.join("::")));
            }
        }
    }
    arrows.into_iter().collect()
}

fn floor(room: &str, floors: &[&[&str]]) -> Option<usize> {
    floors.iter().position(|rooms| rooms.contains(&room))
}

#[cfg(test)]
mod tests {
    use super::super::modules::tests::crate_of;
    use super::*;

    #[test]
    fn arrows_up_and_across_are_named() {
        let (_folder, tree) = crate_of(&[
            ("lib.rs", "pub mod low; pub mod beside; pub mod high; mod nowhere;"),
            ("low.rs", "use crate::high::High; pub struct Low;"),
            ("beside.rs", "use crate::low::Low; use crate::nowhere::Free;"),
            ("high.rs", "use crate::low::Low; pub struct High;"),
            ("nowhere.rs", "use crate::high::High; pub struct Free;"),
        ]);
        let expected = ["beside names Low of low (beside)", "low names High of high (low)"];
        assert_eq!(upwards(&tree, &[&["low", "beside"], &["high"]]), expected);
    }
}
