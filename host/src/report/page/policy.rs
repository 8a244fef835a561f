//! Content security policy: the page may run its one script, use its one style sheet, and load
//! nothing else.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use sha2::{Digest, Sha256};

/// The policy as a meta element; the hashes are those of these texts.
pub fn meta(style: &str, script: &str) -> String {
    let hash = |text: &str| BASE64_STANDARD.encode(Sha256::digest(text.as_bytes()));
    format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'sha256-{}'; style-src 'sha256-{}'; img-src data: blob:\">",
        hash(script),
        hash(style)
    )
}
