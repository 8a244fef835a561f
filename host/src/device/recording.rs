//! A record: the raw codes of every channel around one impact.

use std::ops::Range;

use jointrig_protocol::shot::Shot;

/// One impact as measured; the raw codes are never changed.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Epoch of the stream from which it was cut.
    pub epoch: u32,
    /// Scan index of its first sample in that stream.
    pub first_scan: u64,
    /// Number of samples before the trigger, which is also the trigger's index.
    pub trigger_index: usize,
    /// Number of channels.
    pub channels: usize,
    /// Raw codes, one channel after another (the link delivers one scan after another).
    pub codes: Vec<i16>,
    /// Index ranges of samples that were lost for good; their codes are 0 and invalid.
    pub gaps: Vec<Range<usize>>,
    /// The device's report on the shot.
    pub shot: Shot,
}

impl Recording {
    /// Samples per channel.
    pub fn scans(&self) -> usize {
        self.codes.len().checked_div(self.channels).unwrap_or(0)
    }

    /// A view of its samples.
    pub fn view(&self) -> Codes<'_> {
        Codes { codes: &self.codes, channels: self.channels }
    }

    /// The raw codes of one channel; empty outside the map.
    pub fn channel(&self, place: usize) -> &[i16] {
        self.view().channel(place)
    }
}

/// A view of the samples of a record.
#[derive(Clone, Copy, Debug)]
pub struct Codes<'a> {
    /// Raw codes, one channel after another.
    pub codes: &'a [i16],
    /// Number of channels.
    pub channels: usize,
}

impl<'a> Codes<'a> {
    /// The raw codes of one channel; empty outside the map.
    pub fn channel(self, place: usize) -> &'a [i16] {
        let scans = self.codes.len().checked_div(self.channels).unwrap_or(0);
        self.codes.get(place * scans..(place + 1) * scans).unwrap_or(&[])
    }
}

/// Reorders codes from one scan after another to one channel after another.
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
