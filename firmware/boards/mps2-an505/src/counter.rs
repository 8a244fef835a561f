//! Counting instructions: QEMU's timer, which under `-icount shift=10` moves with executed instructions.
