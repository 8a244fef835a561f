//! Functions for GPDMA1 shared by the rings and the drive: stopping a channel, and links of a list.

use embassy_stm32::pac::GPDMA1;
use embassy_stm32::pac::gpdma::regs::ChLlr;

/// Stops a channel in any state and clears its flags.
pub fn stop(channel: usize) {
    let channel = GPDMA1.ch(channel);
    if channel.cr().read().en() {
        channel.cr().modify(|w| w.set_susp(true));
        // takes a few cycles (RM0456, "GPDMA channel suspend"): the current transfer is one word
        while !channel.sr().read().suspf() && channel.cr().read().en() {}
    }
    channel.cr().write(|w| w.set_reset(true));
    channel.fcr().write(|w| {
        w.set_tcf(true);
        w.set_htf(true);
        w.set_dtef(true);
        w.set_ulef(true);
        w.set_usef(true);
        w.set_suspf(true);
        w.set_tof(true);
    });
}

/// Whether a channel is running: enabled, and not stopped by an error.
pub fn works(channel: usize) -> bool {
    let channel = GPDMA1.ch(channel);
    let status = channel.sr().read();
    channel.cr().read().en() && !(status.dtef() || status.ulef() || status.usef())
}

/// The address that a list item contains in addition to its byte count.
#[derive(Clone, Copy)]
pub enum Carries {
    /// The source address.
    Source,
    /// The destination address.
    Destination,
}

/// A link to the item at `address`, which contains a byte count, an address and a link.
pub fn link(address: u32, carries: Carries) -> ChLlr {
    let mut link = ChLlr(0);
    link.set_ub1(true);
    match carries {
        Carries::Source => link.set_usa(true),
        Carries::Destination => link.set_uda(true),
    }
    link.set_ull(true);
    link.set_la((address as u16) >> 2);
    link
}
