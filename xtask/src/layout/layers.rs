//! Inside the host, top-level modules are layered: a module only uses modules of lower layers.

use super::modules::{Found, Tree};
use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::collections::BTreeSet;

/// The package whose modules are checked.
const PACKAGE: &str = "jointrig";
/// Its layers, the lowest first. Modules of one layer do not use each other.
const LAYERS: [&[&str]; 8] = [
    &["device", "exchange"],
    &["campaign"],
    &["results"],
    &["analyse"],
    &["report"],
    &["live"],
    &["dashboard"],
    &["cli"],
];

/// Searches for uses of the same or a higher layer; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let package = project.package(PACKAGE).with_context(|| format!("there is no package {PACKAGE}"))?;
    let root = package.roots.first().with_context(|| format!("{PACKAGE} has no source"))?;
    let faults = upwards(&Tree::read(root)?, &LAYERS);
    if faults.is_empty() {
        return Ok(format!("{} layers, each uses only lower ones", LAYERS.len()));
    }
    bail!("{}. The layers are listed in xtask/src/layout/layers.rs", faults.join("\n    "))
}

/// Uses of a module that is not in a lower layer, each file and item once.
fn upwards(tree: &Tree, layers: &[&[&str]]) -> Vec<String> {
    let layer = |module: &str| layers.iter().position(|modules| modules.contains(&module));
    let mut faults = BTreeSet::new();
    for (number, module) in tree.modules.iter().enumerate() {
        for path in &module.paths {
            let Some(Found::Item(other, item)) = tree.find(number, &path.names) else { continue };
            let (Some(from), Some(to)) = (module.path.first(), tree.modules[other].path.first()) else {
                continue;
            };
            let (Some(own), Some(used)) = (layer(from), layer(to)) else { continue };
            if from != to && used >= own {
                faults.insert(format!("{} must not use {item} of {to}", module.path.join("::")));
            }
        }
    }
    faults.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::super::modules::tests::crate_of;
    use super::*;

    #[test]
    fn uses_of_a_higher_layer_and_of_the_same_one_are_named() {
        let (_folder, tree) = crate_of(&[
            ("lib.rs", "pub mod low; pub mod beside; pub mod high; mod nowhere;"),
            ("low.rs", "use crate::high::High; pub struct Low;"),
            ("beside.rs", "use crate::low::Low; use crate::nowhere::Free;"),
            ("high.rs", "use crate::low::Low; pub struct High;"),
            ("nowhere.rs", "use crate::high::High; pub struct Free;"),
        ]);
        let expected = ["beside must not use Low of low", "low must not use High of high"];
        assert_eq!(upwards(&tree, &[&["low", "beside"], &["high"]]), expected);
    }
}
