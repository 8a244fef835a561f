//! Splits Rust source into tokens, without comments.
//!
//! It covers only what is needed to find names: identifiers, `::`, single characters, and literals
//! as one token each.

/// One token and its line, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token<'a> {
    /// Its text; a string keeps its quotes.
    pub text: &'a str,
    /// Its line.
    pub line: usize,
}

impl Token<'_> {
    /// Whether this is a name or a keyword.
    pub fn is_word(&self) -> bool {
        self.text.starts_with(|first: char| first.is_alphabetic() || first == '_')
    }
}

/// Splits a source file.
pub fn of(source: &str) -> Vec<Token<'_>> {
    let mut reader = Reader { source, at: 0, line: 1 };
    let mut tokens = Vec::new();
    while let Some(next) = reader.peek() {
        let (begin, line) = (reader.at, reader.line);
        let is_code = reader.pass(next);
        if is_code {
            tokens.push(Token { text: &source[begin..reader.at], line });
        }
    }
    tokens
}

struct Reader<'a> {
    source: &'a str,
    at: usize,
    line: usize,
}

impl Reader<'_> {
    fn rest(&self) -> &str {
        &self.source[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn step(&mut self) {
        if let Some(next) = self.peek() {
            self.at += next.len_utf8();
            self.line += usize::from(next == '\n');
        }
    }

    fn step_while(&mut self, wanted: impl Fn(char) -> bool) {
        while self.peek().is_some_and(&wanted) {
            self.step();
        }
    }

    /// Steps over `end`, or to the end of the file.
    fn step_past(&mut self, end: &str) {
        while self.peek().is_some() && !self.rest().starts_with(end) {
            self.step();
        }
        end.chars().for_each(|_| self.step());
    }

    /// Skips the token that begins with `next`; returns whether it is code.
    fn pass(&mut self, next: char) -> bool {
        if next.is_whitespace() {
            self.step();
            return false;
        }
        if self.rest().starts_with("//") {
            self.step_while(|c| c != '\n');
            return false;
        }
        if self.rest().starts_with("/*") {
            self.pass_comment();
            return false;
        }
        match next {
            '"' => self.pass_string(),
            '\'' => self.pass_quote(),
            _ if next.is_alphanumeric() || next == '_' => self.pass_word(),
            _ if self.rest().starts_with("::") => self.step_past("::"),
            _ => self.step(),
        }
        true
    }

    /// Block comments are nested.
    fn pass_comment(&mut self) {
        let mut depth = 0;
        while self.peek().is_some() {
            if self.rest().starts_with("/*") {
                depth += 1;
                self.step_past("/*");
            } else if self.rest().starts_with("*/") {
                depth -= 1;
                self.step_past("*/");
            } else {
                self.step();
            }
            if depth == 0 {
                return;
            }
        }
    }

    fn pass_string(&mut self) {
        self.step();
        while let Some(next) = self.peek() {
            self.step();
            match next {
                '\\' => self.step(),
                '"' => return,
                _ => {}
            }
        }
    }

    /// A character, or the name of a lifetime.
    fn pass_quote(&mut self) {
        let mut after = self.rest().chars().skip(1);
        let (first, second) = (after.next(), after.next());
        self.step();
        if first == Some('\\') {
            self.step();
            self.step();
            self.step_past("'");
        } else if second == Some('\'') {
            self.step_past("'");
        } else {
            self.step_while(|c| c.is_alphanumeric() || c == '_');
        }
    }

    /// A name, a number, or a literal with a prefix (`b"…"`, `r#"…"#`).
    fn pass_word(&mut self) {
        let begin = self.at;
        self.step_while(|c| c.is_alphanumeric() || c == '_');
        let word = &self.source[begin..self.at];
        let hashes = self.rest().chars().take_while(|c| *c == '#').count();
        let quoted = self.rest()[hashes..].starts_with('"');
        match word {
            "r" | "br" | "cr" if quoted => {
                let end = format!("\"{}", "#".repeat(hashes));
                self.step_past("\"");
                self.step_past(&end);
            }
            "b" | "c" if self.rest().starts_with('"') => self.pass_string(),
            "b" if self.rest().starts_with('\'') => self.pass_quote(),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(source: &str) -> Vec<&str> {
        of(source).iter().map(|token| token.text).collect()
    }

    #[test]
    fn comments_go_and_lines_are_counted() {
        let source = "use a::b; // super::c\n/* /* crate::d */ */\n/// [`crate::e`]\nfn f() {}";
        let tokens = of(source);
        let words: Vec<&str> = tokens.iter().map(|token| token.text).collect();
        assert_eq!(words, ["use", "a", "::", "b", ";", "fn", "f", "(", ")", "{", "}"]);
        assert_eq!(tokens.last().map(|token| token.line), Some(4));
    }

    #[test]
    fn strings_and_characters_are_one_token_each() {
        assert_eq!(texts(r#"("super::x \" y", 'a', '\'', '\u{e9}', '"')"#).len(), 11);
        assert_eq!(texts("r#\"a \" b\"# b\"c\" b'd' r\"\\\" x").len(), 5);
    }

    #[test]
    fn a_lifetime_does_not_begin_a_character() {
        assert_eq!(texts("&'a str"), ["&", "'a", "str"]);
        assert_eq!(texts("x: 'static"), ["x", ":", "'static"]);
    }
}
