//! Each equation of the paper is evaluated by one function.
//!
//! A line in that function's documentation begins with `Implements Eq. (A.1)` (or `Implements Eqs.
//! (A.3) and (A.4)`). The text after the numbers, up to the full stop, distinguishes forms of one
//! equation: `Implements Eq. (3), as printed.` Other comments may mention "Eq. (3)" freely, and
//! other code calls that function.

use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Start of a tag; for several equations an s follows.
const TAG: &str = "Implements Eq";

/// Where an equation is implemented: the file from the repository's root, the line, the function.
type Places = BTreeMap<Equation, Vec<String>>;

/// An equation's number, and the form of the equation.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Equation {
    number: String,
    form: String,
}

/// Searches all production code of the workspace; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let roots = project.packages.iter().flat_map(|package| &package.roots);
    let folders: BTreeSet<&Path> = roots.filter_map(|root| root.parent()).collect();
    let mut places = Places::new();
    for folder in folders {
        for file in sources(folder)? {
            let text = std::fs::read_to_string(&file)
                .with_context(|| format!("could not read {}", file.display()))?;
            let shown = file.strip_prefix(&project.root).unwrap_or(&file).to_path_buf();
            collect(&shown, &text, &mut places)?;
        }
    }
    judge(&places)
}

/// All Rust files of a folder and those below it.
fn sources(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let entries =
        std::fs::read_dir(folder).with_context(|| format!("could not read {}", folder.display()))?;
    for entry in entries {
        let path = entry.with_context(|| format!("could not read {}", folder.display()))?.path();
        if path.is_dir() {
            files.extend(sources(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(files)
}

/// Adds the tags of one file.
fn collect(file: &Path, text: &str, places: &mut Places) -> Result<()> {
    let mut open: Vec<(usize, Equation)> = Vec::new();
    for (number, line) in (1..).zip(text.lines().map(str::trim)) {
        if let Some(said) = line.strip_prefix("///") {
            let equations = equations(said.trim());
            if equations.is_empty() && said.trim().starts_with(TAG) {
                bail!(
                    "{}:{number}: `{}` names no equation: write `{TAG}. (A.1).`",
                    file.display(),
                    said.trim()
                );
            }
            open.extend(equations.into_iter().map(|equation| (number, equation)));
        } else if let Some((first, _)) = open.first()
            && !line.starts_with("#[")
            && !line.is_empty()
        {
            let Some(function) = function(line) else {
                bail!(
                    "{}:{first}: a line `{TAG}. (…)` stands on a function, not on `{line}`",
                    file.display()
                );
            };
            for (number, equation) in open.drain(..) {
                let place = format!("{} ({}:{number})", function, file.display());
                places.entry(equation).or_default().push(place);
            }
        }
    }
    Ok(())
}

/// The equations tagged in a line of documentation: `Implements Eq. (3), as printed.`
fn equations(said: &str) -> Vec<Equation> {
    let Some(rest) = said.strip_prefix(TAG) else { return Vec::new() };
    let Some(mut rest) = rest.strip_prefix("s. ").or_else(|| rest.strip_prefix(". ")) else {
        return Vec::new();
    };
    let mut numbers = Vec::new();
    while let Some((number, after)) = rest.strip_prefix('(').and_then(|rest| rest.split_once(')')) {
        numbers.push(number.to_owned());
        rest = [", ", " and "]
            .iter()
            .find_map(|joint| after.strip_prefix(joint).filter(|rest| rest.starts_with('(')))
            .unwrap_or(after);
    }
    // A full stop inside a word ("A.1") does not end the sentence.
    let form = rest.split(". ").next().unwrap_or(rest).trim_end_matches('.').trim_start_matches(',').trim();
    numbers.into_iter().map(|number| Equation { number, form: form.to_owned() }).collect()
}

/// The name of the function that begins on this line, if one does.
fn function(line: &str) -> Option<&str> {
    let (before, after) = line.split_once("fn ")?;
    let keyword = |word: &str| {
        ["const", "async", "unsafe", "extern"].contains(&word)
            || word.starts_with("pub")
            || word.ends_with(')')
    };
    before.split_whitespace().all(keyword).then(|| after.split(['(', '<']).next().unwrap_or(after))
}

fn judge(places: &Places) -> Result<String> {
    if places.is_empty() {
        bail!("no function says which equation it implements: a line `/// {TAG}. (A.1).` does");
    }
    let twice: Vec<String> = places
        .iter()
        .filter(|(_, places)| places.len() > 1)
        .map(|(equation, places)| {
            format!("Eq. ({}) is implemented by {}", equation.number, places.join(" and by "))
        })
        .collect();
    if twice.is_empty() {
        return Ok(format!("{} equations, each in one function", places.len()));
    }
    bail!("{}. Let one call the other, or say which form of the equation each one is", twice.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(files: &[(&str, &str)]) -> Result<Places> {
        let mut places = Places::new();
        for (file, text) in files {
            collect(Path::new(file), text, &mut places)?;
        }
        Ok(places)
    }

    #[test]
    fn a_tag_belongs_to_the_function_below_it() {
        let text = "//! Eq. (3) in general.\n\n/// The joint.\n///\n/// Implements Eq. (A.1).\n#[must_use]\npub(crate) fn joint<T>(y: T) {}\n";
        let places = places(&[("a.rs", text)]).expect("well formed");
        let expected = Equation { number: "A.1".into(), form: String::new() };
        assert_eq!(places.into_iter().collect::<Vec<_>>(), [(expected, vec!["joint (a.rs:5)".to_owned()])]);
    }

    #[test]
    fn one_equation_in_two_functions_fails_and_names_both() {
        let files = [
            ("a.rs", "/// Implements Eq. (A.1).\nfn one() {}"),
            ("b.rs", "    /// Implements Eqs. (A.1) and (A.3).\n    const fn other() {}"),
        ];
        let message = judge(&places(&files).expect("well formed")).expect_err("twice").to_string();
        assert!(
            message.starts_with("Eq. (A.1) is implemented by one (a.rs:1) and by other (b.rs:1)."),
            "{message}"
        );
    }

    #[test]
    fn forms_of_an_equation_and_mentions_of_it_are_no_second_implementation() {
        let files = [
            (
                "a.rs",
                "/// Implements Eq. (3), as printed.\nfn one() {}\n/// Implements Eq. (3), in least squares. More.\nfn two() {}",
            ),
            ("b.rs", "/// By Eq. (3), as [`one`] says.\nfn three() {}"),
        ];
        let remark = judge(&places(&files).expect("well formed")).expect("two forms");
        assert_eq!(remark, "2 equations, each in one function");
    }

    #[test]
    fn a_tag_without_a_number_or_on_no_function_is_an_error_and_so_is_none() {
        let message =
            places(&[("a.rs", "/// Implements Eq. A.1.\nfn one() {}")]).expect_err("no number").to_string();
        assert!(message.starts_with("a.rs:1: `Implements Eq. A.1.` names no equation"), "{message}");
        let message =
            places(&[("a.rs", "/// Implements Eq. (1).\nstruct S;")]).expect_err("a struct").to_string();
        assert!(message.contains("stands on a function, not on `struct S;`"), "{message}");
        assert!(judge(&Places::new()).is_err());
    }
}
