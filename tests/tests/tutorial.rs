//! The tutorial, command by command, as somebody would type it.
#![allow(clippy::unwrap_used)]

use jointrig_tests::command::jointrig;

const TUTORIAL: &str = include_str!("../../docs/tutorial.md");

/// A fenced block: its kind and its lines.
fn blocks(page: &str) -> Vec<(String, Vec<String>)> {
    let mut blocks = Vec::new();
    let mut open: Option<(String, Vec<String>)> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(kind), None) => open = Some((kind.into(), Vec::new())),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some((_, lines))) => lines.push(line.into()),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block is not closed");
    blocks
}

/// Whether a line is what the page says; `…` stands for anything.
fn is_like(line: &str, pattern: &str) -> bool {
    let mut rest = line;
    let mut parts = pattern.split('…').enumerate().peekable();
    while let Some((number, part)) = parts.next() {
        let Some(at) = rest.find(part) else { return false };
        if number == 0 && at > 0 || parts.peek().is_none() && !part.is_empty() && !rest.ends_with(part) {
            return false;
        }
        rest = &rest[at + part.len()..];
    }
    true
}

#[test]
fn every_command_does_what_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    let (mut said, mut commands) = (String::new(), 0);
    for (kind, lines) in blocks(TUTORIAL) {
        match kind.as_str() {
            "sh" => {
                for line in lines {
                    let mut words = shlex::split(&line).unwrap().into_iter();
                    assert_eq!(words.next().as_deref(), Some("jointrig"), "{line}");
                    let out = jointrig().args(words).current_dir(folder.path()).output().unwrap();
                    let errors = String::from_utf8_lossy(&out.stderr);
                    assert!(out.status.success(), "{line}: {errors}");
                    said = format!("{errors}{}", String::from_utf8(out.stdout).unwrap());
                    commands += 1;
                }
            }
            "text" => {
                let mut from = 0;
                let all: Vec<&str> = said.lines().collect();
                for pattern in lines {
                    let place = all[from..].iter().position(|line| is_like(line, &pattern));
                    let Some(place) = place else { panic!("`{pattern}` is not in:\n{said}") };
                    from += place + 1;
                }
            }
            other => panic!("a block of kind `{other}`"),
        }
    }
    assert!(commands >= 12, "{commands} commands");
    assert!(is_like("a 12 b", "a … b") && !is_like("a 12 c", "a … b") && !is_like("x a 1 b", "a … b"));
}
