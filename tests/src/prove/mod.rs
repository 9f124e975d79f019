//! Campaigns: what the record promises, tried in thousands of cases each.
//!
//! Each campaign runs in this process, on the same bodies of tasks as `hums sim`, because ten thousand runs of a program
//! would take a day. What it finds is compared with the recording itself, the card with `fsck.vfat`. A campaign is one
//! file here and one line in [`CAMPAIGNS`]; `cargo xtask prove` runs them and writes `docs/proof.md`, whose labels are held
//! against those of the campaigns by a test.

mod card;
mod damage;
pub mod diagnosis;
mod endurance;
mod figures;
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
mod stream;

use anyhow::Result;

pub use figures::{Figures, Labels};
pub use memory::Counting;
pub use options::Options;
pub use report::{Part, Provenance, write as write_report};

/// One campaign.
#[derive(Debug)]
pub struct Campaign {
    /// What it is called on the command line.
    pub name: &'static str,
    /// What it tries, as a sentence.
    pub about: &'static str,
    /// What its figures are called.
    pub labels: Labels,
    /// Runs it; an error is a promise that was not kept.
    pub run: fn(&Options) -> Result<Figures>,
}

/// All campaigns.
pub const CAMPAIGNS: &[Campaign] = &[
    Campaign {
        name: "power-cuts",
        about: "power goes at any block write, half of them torn, on a simulated card that keeps what it acknowledged and \
                in its order: the file system stays in order, earlier logs stay as they are, and the log, once it has begun, \
                gives the flight up to 200 ms before",
        labels: power_cuts::LABELS,
        run: power_cuts::run,
    },
    Campaign {
        name: "careless-cards",
        about: "power goes at a simulated card that keeps its last blocks in no order, has lost one that it acknowledged, or \
                spoils the page around the last one, one of these at a time: earlier sessions lose nothing beyond the groups \
                that were spoiled, and each loss is told; what the next power-on writes over is counted",
        labels: power_cuts::careless::LABELS,
        run: power_cuts::careless::run,
    },
    Campaign {
        name: "damage",
        about: "bits flip anywhere in a log, pages of it go wrong, or its end goes missing, one damage at a time: each is \
                noticed or told for what it is, no wrong frame comes out, and at most the groups that were touched are lost",
        labels: damage::LABELS,
        run: damage::run,
    },
    Campaign {
        name: "stalls",
        about: "a simulated card answers nothing for 2.5 s, once in a recording at 921,600 baud: no frame of an unsigned \
                recording is lost",
        labels: stalls::LABELS,
        run: stalls::run,
    },
    Campaign {
        name: "endurance",
        about: "24 simulated hours at 20 kB/s on a card of 64 MiB: the newest data is always there, and memory stays as it is",
        labels: endurance::LABELS,
        run: endurance::run,
    },
    Campaign {
        name: "hostile-gs",
        about: "24 simulated hours of a ground station that sends noise, floods, forged and malformed frames at full rate: no \
                panic, no frame of the vehicle is lost, no second has more bytes than the budget at either port, earlier logs \
                stay readable; where a key is asked for, no parameter is changed, no log is marked as erased, the record has no \
                hole, and the autopilot gets nothing but what the box sends by itself",
        labels: hostile_gs::LABELS,
        run: hostile_gs::run,
    },
    Campaign {
        name: "noise",
        about: "bytes on the line are damaged, each at random and by itself: each frame that is not itself damaged is recorded, \
                unless the noise happens to make a false frame, with a checksum that fits, over it",
        labels: noise::LABELS,
        run: noise::run,
    },
    Campaign {
        name: "mutations",
        about: "each reader gets inputs of its corpus with one to eight changes, and noise: none panics, and what must hold for \
                any bytes (fuzz/src) holds",
        labels: mutations::LABELS,
        run: mutations::run,
    },
];
