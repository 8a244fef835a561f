//! The decoder, based on defmt's.

use std::panic::{AssertUnwindSafe, catch_unwind};

use log::Level;

use crate::line::Line;

/// The strings of one image.
pub struct Strings(defmt_decoder::Table);

impl Strings {
    pub fn of_image(image: &[u8]) -> Result<Self, String> {
        let table = defmt_decoder::Table::parse(image).map_err(|error| error.to_string())?;
        let table = table.ok_or("it logs nothing")?;
        // for such a slice, defmt's decoder reserves as many elements as a four-byte count
        // specifies, even in damaged data
        if let Some(symbol) = table.raw_symbols().find(|symbol| symbol.contains("=[?]")) {
            return Err(format!(
                "it logs slices of values, which damaged bytes would make endless: {symbol}"
            ));
        }
        Ok(Self(table))
    }

    /// Decodes one line; the bytes include the terminating zero.
    pub fn line(&self, encoded: &[u8]) -> Option<Line> {
        // a panic of the third-party decoder on damaged bytes must not end a campaign
        let decoded = catch_unwind(AssertUnwindSafe(|| {
            let mut decoder = self.0.new_stream_decoder();
            decoder.received(encoded);
            let frame = decoder.decode().ok()?;
            let at = frame.display_timestamp().map(|at| format!("{at} ")).unwrap_or_default();
            let level = frame.level().and_then(|level| level.as_str().parse().ok()).unwrap_or(Level::Info);
            Some(Line { level, text: format!("{at}{}", frame.display_message()) })
        }));
        decoded.ok().flatten()
    }
}
