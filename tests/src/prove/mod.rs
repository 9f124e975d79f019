//! Campaigns: the promises about the record, tested in thousands of cases each.
//!
//! Each runs in this process, on the same tasks as `hums sim`. A campaign is one file here and one line in
//! [`CAMPAIGNS`].

mod card;
mod damage;
pub mod diagnosis;
mod endurance;
mod figures;
pub mod fleet;
mod hostile_gs;
mod memory;
mod mutations;
mod noise;
mod options;
mod pages;
mod power_cuts;
mod record;
mod report;
mod stalls;
pub mod storage;
mod stream;

use anyhow::Result;

pub use figures::Figures;
pub use memory::Counting;
pub use options::Options;
pub use report::{Part, Provenance, compare as compare_report, write as write_report};

/// One campaign.
#[derive(Debug)]
pub struct Campaign {
    /// Its name on the command line.
    pub name: &'static str,
    /// The promise, as a sentence.
    pub about: &'static str,
    /// An error is a broken promise.
    pub run: fn(&Options) -> Result<Figures>,
}

/// All campaigns.
pub const CAMPAIGNS: &[Campaign] = &[
    Campaign {
        name: "power-cuts",
        about: "power fails at a block write of a simulated card, in half of the cases in the middle of a block. The \
                card keeps acknowledged blocks in order. Promise: the file system and earlier logs stay intact, and the \
                log holds the flight up to 200 ms before the cut",
        run: power_cuts::run,
    },
    Campaign {
        name: "careless-cards",
        about: "power fails at a simulated card with one of three faults. The card loses some of its last blocks, \
                loses one acknowledged block, or spoils the page around the last block. Promise: earlier sessions lose \
                only spoiled groups, and each loss is reported. Sectors that the next power-on overwrites are counted",
        run: power_cuts::careless::run,
    },
    Campaign {
        name: "damage",
        about: "a log gets one damage: flipped bits, damaged pages, or a missing end. Promise: each damage is noticed \
                or reported, no wrong frame is decoded, and only the damaged groups are lost",
        run: damage::run,
    },
    Campaign {
        name: "stalls",
        about: "a simulated card does not answer for 2.5 s, once in a recording at 921,600 baud. Promise: an unsigned \
                recording loses no frame",
        run: stalls::run,
    },
    Campaign {
        name: "endurance",
        about: "24 simulated hours at 20 kB/s on a card of 64 MiB. Promise: the newest data is always on the card, and \
                memory does not grow",
        run: endurance::run,
    },
    Campaign {
        name: "hostile-gs",
        about: "for 24 simulated hours a ground station sends noise, floods, forged and malformed frames at full rate. \
                Promise: no panic, no lost frame of the vehicle, no second above the budget of a port, and readable \
                earlier logs. With a key also: no parameter changes, no log is marked as erased, the record has no gap. \
                The autopilot then receives only the box's own messages",
        run: hostile_gs::run,
    },
    Campaign {
        name: "noise",
        about: "single bytes on the line are damaged at random. Promise: each undamaged frame is recorded, unless noise \
                forms a false frame with a valid checksum over it",
        run: noise::run,
    },
    Campaign {
        name: "mutations",
        about: "each reader gets inputs of its corpus with one to eight changes, and noise. Promise: no reader panics, \
                and the rules of fuzz/src hold",
        run: mutations::run,
    },
];
