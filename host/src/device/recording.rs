//! A record: every channel around one impact, as raw codes.

use std::ops::Range;

use jointrig_protocol::shot::Shot;

/// One impact as it was measured: raw codes, never changed afterwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The stream that it was cut from.
    pub epoch: u32,
    /// Scan index of the first sample in that stream.
    pub first_scan: u64,
    /// Samples before the trigger: the trigger is at this index.
    pub trigger_index: usize,
    /// Channels.
    pub channels: usize,
    /// Raw codes, channel after channel (the link brings them scan after scan).
    pub codes: Vec<i16>,
    /// Samples that were lost for good, as index ranges; their codes are 0 and mean nothing.
    pub gaps: Vec<Range<usize>>,
    /// What the device says about the shot.
    pub shot: Shot,
}

impl Recording {
    /// Samples per channel.
    pub fn scans(&self) -> usize {
        self.codes.len().checked_div(self.channels).unwrap_or(0)
    }

    /// Its samples, to look at.
    pub fn view(&self) -> Codes<'_> {
        Codes { codes: &self.codes, channels: self.channels }
    }

    /// The raw codes of one channel; empty outside the map.
    pub fn channel(&self, place: usize) -> &[i16] {
        self.view().channel(place)
    }
}

/// A look at the samples of a record, wherever they are kept.
#[derive(Clone, Copy, Debug)]
pub struct Codes<'a> {
    /// Raw codes, channel after channel.
    pub codes: &'a [i16],
    /// Channels.
    pub channels: usize,
}

impl<'a> Codes<'a> {
    /// The raw codes of one channel; empty outside the map.
    pub fn channel(self, place: usize) -> &'a [i16] {
        let scans = self.codes.len().checked_div(self.channels).unwrap_or(0);
        self.codes.get(place * scans..(place + 1) * scans).unwrap_or(&[])
    }
}

/// Turns codes from scan after scan into channel after channel.
pub fn by_channel(scan_major: &[i16], channels: usize) -> Vec<i16> {
    let mut out = Vec::with_capacity(scan_major.len());
    for place in 0..channels {
        out.extend(scan_major.iter().skip(place).step_by(channels));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_are_turned_into_channels() {
        assert_eq!(by_channel(&[1, 10, 2, 20, 3, 30], 2), [1, 2, 3, 10, 20, 30]);
        assert!(by_channel(&[], 4).is_empty());
    }
}
