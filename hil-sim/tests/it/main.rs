//! Integration tests of the simulator, one program so that it is linked once.

mod board;
mod broken_assumptions;
mod clamp_b;
mod config;
mod console;
mod contact;
mod elastic;
mod fixed;
mod flaws;
mod frf;
mod hammer;
mod impact_record;
mod known_mass;
mod open_joint;
mod own_structure;
mod records;
mod reference;
mod rigs_page;
mod sensors;
mod serve;
mod shaker;
mod stepping;
mod supplies;
mod support;
mod sync;
mod wear;
