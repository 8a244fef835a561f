//! Access checks. The page is on the loopback address, which every program on this computer and
//! every web page open in its browser can reach. A foreign host name that resolves to it (DNS
//! rebinding) is detected by `Host`, a foreign page by `Origin`, another user by the token.

use std::io;

use axum::http::{HeaderMap, StatusCode, header};

/// 128 random bits, known only to those who were given the address.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// A new random token.
    ///
    /// # Errors
    /// The operating system provides no random numbers.
    pub fn random() -> io::Result<Self> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes).map_err(io::Error::other)?;
        Ok(Self(format!("{:032x}", u128::from_le_bytes(bytes))))
    }

    /// The token as text, as in the address.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Compares tokens in a time that depends only on the length.
    pub fn is(&self, other: &str) -> bool {
        let differ = self.0.bytes().zip(other.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b));
        self.0.len() == other.len() && differ == 0
    }
}

/// Why a request is rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The request is for another host.
    Host,
    /// The request comes from another page.
    Origin,
    /// The token is missing or wrong.
    Token,
    /// The token only permits viewing.
    LooksOnly,
}

impl Refusal {
    /// Its HTTP status.
    pub fn status(self) -> StatusCode {
        match self {
            Self::Host => StatusCode::MISDIRECTED_REQUEST,
            Self::Origin | Self::LooksOnly => StatusCode::FORBIDDEN,
            Self::Token => StatusCode::UNAUTHORIZED,
        }
    }

    /// What is wrong, and what to do.
    pub fn words(self) -> [&'static str; 2] {
        match self {
            Self::Host => ["the address names another server", "open the address that jointrig printed"],
            Self::Origin => ["the request comes from another page", "open the address that jointrig printed"],
            Self::Token => [
                "the token is missing or wrong",
                "open the whole address that jointrig printed, including the part after the #",
            ],
            Self::LooksOnly => [
                "this address allows only looking",
                "open the address to edit, which the measuring process printed",
            ],
        }
    }
}

/// Checks that a request is addressed to this server and comes from its own page or from no page.
///
/// # Errors
/// The reason for a rejection.
pub fn from_here(headers: &HeaderMap, port: u16) -> Result<(), Refusal> {
    let ours = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}"));
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or_default());
    if !text(header::HOST).is_some_and(|host| ours.iter().any(|own| own == host)) {
        return Err(Refusal::Host);
    }
    match text(header::ORIGIN) {
        Some(origin) if !ours.iter().any(|own| origin.strip_prefix("http://") == Some(own)) => {
            Err(Refusal::Origin)
        }
        _ => Ok(()),
    }
}

/// The token of a request.
///
/// # Errors
/// There is none.
pub fn token(headers: &HeaderMap) -> Result<&str, Refusal> {
    headers
        .get(header::AUTHORIZATION)
        .and_then(|value| value.to_str().ok()?.strip_prefix("Bearer "))
        .ok_or(Refusal::Token)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(header::HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), value.parse().expect("a header"))).collect()
    }

    #[test]
    fn names_and_pages_of_others_are_turned_away() {
        let asked = |host: &str, origin: Option<&str>| {
            let mut pairs = vec![(header::HOST, host)];
            pairs.extend(origin.map(|origin| (header::ORIGIN, origin)));
            from_here(&headers(&pairs), 4321)
        };
        assert_eq!(asked("127.0.0.1:4321", None), Ok(()));
        assert_eq!(asked("localhost:4321", Some("http://localhost:4321")), Ok(()));
        for host in ["rig.example:4321", "127.0.0.1", "127.0.0.1:4322", "127.0.0.1:43210", ""] {
            assert_eq!(asked(host, None), Err(Refusal::Host), "{host}");
        }
        for origin in
            ["http://rig.example", "https://localhost:4321", "null", "http://localhost:4321.example", ""]
        {
            assert_eq!(asked("localhost:4321", Some(origin)), Err(Refusal::Origin), "{origin}");
        }
        assert_eq!(from_here(&HeaderMap::new(), 4321), Err(Refusal::Host));
    }

    #[test]
    fn only_the_whole_token_opens() {
        let token = Token::random().expect("random numbers");
        assert_eq!(token.as_str().len(), 32);
        assert!(token.is(token.as_str()) && Token::random().expect("random numbers") != token);
        let with = |value: &str| {
            let headers = headers(&[(header::AUTHORIZATION, value)]);
            super::token(&headers).is_ok_and(|given| token.is(given))
        };
        assert!(with(&format!("Bearer {}", token.as_str())));
        for wrong in ["", "Bearer ", token.as_str(), &format!("Bearer {}0", token.as_str()), "Bearer 0"] {
            assert!(!with(wrong), "{wrong}");
        }
        assert_eq!(super::token(&HeaderMap::new()), Err(Refusal::Token));
    }
}
