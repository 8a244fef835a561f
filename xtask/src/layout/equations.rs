//! Each equation of the paper is evaluated by one function.
//!
//! A line in that function's documentation begins with `Implements Eq. (A.1)` (or `Implements Eqs.
//! (A.3) and (A.4)`). The text after the numbers, up to the full stop, distinguishes forms of one
//! equation: `Implements Eq. (3), as printed.` Other comments may mention "Eq. (3)" freely, and
//! other code calls that function.

use super::modules;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, ExprLit, Lit, Meta, Signature};

/// Start of a tag; for several equations an s follows.
const TAG: &str = "Implements Eq";

/// Where an equation, given by its number and its form, is implemented.
type Places = BTreeMap<(String, String), Vec<String>>;

/// Searches all production code; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let trees = modules::of_project(project)?;
    let files: BTreeSet<PathBuf> =
        trees.into_iter().flat_map(|tree| tree.modules).map(|module| module.file).collect();
    let mut places = Places::new();
    for file in files {
        let text =
            std::fs::read_to_string(&file).with_context(|| format!("could not read {}", file.display()))?;
        collect(file.strip_prefix(&project.root).unwrap_or(&file), &text, &mut places)?;
    }
    judge(&places)
}

/// The lines of documentation in one file, and to which function they belong.
#[derive(Default)]
struct Documentation {
    lines: Vec<(usize, String)>,
    functions: BTreeMap<usize, String>,
}

impl Documentation {
    fn function(&mut self, attributes: &[Attribute], signature: &Signature) {
        let lines = attributes.iter().map(|attribute| attribute.span().start().line);
        self.functions.extend(lines.map(|line| (line, signature.ident.to_string())));
    }
}

impl<'ast> Visit<'ast> for Documentation {
    fn visit_item_fn(&mut self, node: &'ast syn::ItemFn) {
        self.function(&node.attrs, &node.sig);
        visit::visit_item_fn(self, node);
    }

    fn visit_impl_item_fn(&mut self, node: &'ast syn::ImplItemFn) {
        self.function(&node.attrs, &node.sig);
        visit::visit_impl_item_fn(self, node);
    }

    fn visit_trait_item_fn(&mut self, node: &'ast syn::TraitItemFn) {
        self.function(&node.attrs, &node.sig);
        visit::visit_trait_item_fn(self, node);
    }

    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        let Meta::NameValue(pair) = &attribute.meta else { return };
        if let Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) = &pair.value
            && pair.path.is_ident("doc")
        {
            self.lines.push((attribute.span().start().line, text.value().trim().to_owned()));
        }
    }
}

/// Adds the tags of one file.
fn collect(file: &Path, text: &str, places: &mut Places) -> Result<()> {
    let mut documentation = Documentation::default();
    documentation
        .visit_file(&syn::parse_file(text).with_context(|| format!("{} is not Rust", file.display()))?);
    for (line, text) in documentation.lines.iter().filter(|(_, text)| text.starts_with(TAG)) {
        let place = format!("{}:{line}", file.display());
        let equations = equations(text);
        if equations.is_empty() {
            bail!("{place}: `{text}` names no equation: write `{TAG}. (A.1).`");
        }
        let Some(function) = documentation.functions.get(line) else {
            bail!("{place}: `{text}` must be in the documentation of a function");
        };
        for equation in equations {
            places.entry(equation).or_default().push(format!("{function} ({place})"));
        }
    }
    Ok(())
}

/// The equations tagged in a line of documentation, with their form: `Implements Eq. (3), as
/// printed.`
fn equations(line: &str) -> Vec<(String, String)> {
    let rest = line.strip_prefix(TAG).unwrap_or_default();
    let Some(mut rest) = rest.strip_prefix("s. ").or_else(|| rest.strip_prefix(". ")) else {
        return Vec::new();
    };
    let mut numbers = Vec::new();
    while let Some((number, after)) = rest.strip_prefix('(').and_then(|rest| rest.split_once(')')) {
        numbers.push(number.to_owned());
        let next = after.strip_prefix(", ").or_else(|| after.strip_prefix(" and "));
        rest = next.filter(|rest| rest.starts_with('(')).unwrap_or(after);
    }
    // A full stop inside a word ("A.1") does not end the sentence.
    let form = rest.split(". ").next().unwrap_or(rest).trim_end_matches('.').trim_start_matches(',').trim();
    numbers.into_iter().map(|number| (number, form.to_owned())).collect()
}

fn judge(places: &Places) -> Result<String> {
    if places.is_empty() {
        bail!("no function states which equation it implements, with a line `/// {TAG}. (A.1).`");
    }
    let twice: Vec<String> = places
        .iter()
        .filter(|(_, places)| places.len() > 1)
        .map(|((number, _), places)| format!("Eq. ({number}) is implemented by {}", places.join(" and by ")))
        .collect();
    if twice.is_empty() {
        return Ok(format!("{} equations, each in one function", places.len()));
    }
    bail!("{}. Let one call the other, or state which form of the equation each one is", twice.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(text: &str) -> Result<Places> {
        let mut places = Places::new();
        collect(Path::new("a.rs"), text, &mut places).map(|()| places)
    }

    #[test]
    fn a_tag_belongs_to_the_function_below_it() {
        let text = "//! Eq. (3) in general.\n\n/// The joint.\n///\n/// Implements Eq. (A.1).\n#[must_use]\npub(crate) fn joint<T>(y: T) {}\n";
        let expected = (("A.1".to_owned(), String::new()), vec!["joint (a.rs:5)".to_owned()]);
        assert_eq!(places(text).expect("well formed").into_iter().collect::<Vec<_>>(), [expected]);
    }

    #[test]
    fn one_equation_in_two_functions_fails_and_names_both() {
        let text = "/// Implements Eq. (A.1).\nfn one() {}\nimpl X {\n/// Implements Eqs. (A.1) and (A.3).\nconst fn other() {} }";
        let message = judge(&places(text).expect("well formed")).expect_err("twice").to_string();
        let expected = "Eq. (A.1) is implemented by one (a.rs:1) and by other (a.rs:4).";
        assert!(message.starts_with(expected), "{message}");
    }

    #[test]
    fn forms_of_an_equation_and_mentions_of_it_are_no_second_implementation() {
        let text = "/// Implements Eq. (3), as printed.\nfn one() {}\n/// Implements Eq. (3), in least squares. More.\n\
                    fn two() {}\n/// By Eq. (3), as [`one`] says.\nfn three() {}";
        let remark = judge(&places(text).expect("well formed")).expect("two forms");
        assert_eq!(remark, "2 equations, each in one function");
    }

    #[test]
    fn a_tag_without_a_number_or_on_no_function_is_an_error_and_so_is_none() {
        let message = places("/// Implements Eq. A.1.\nfn one() {}").expect_err("no number").to_string();
        assert!(message.starts_with("a.rs:1: `Implements Eq. A.1.` names no equation"), "{message}");
        let message = places("/// Implements Eq. (1).\nstruct S;").expect_err("a struct").to_string();
        assert!(message.ends_with("must be in the documentation of a function"), "{message}");
        assert!(judge(&Places::new()).is_err());
    }
}
