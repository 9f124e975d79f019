//! How writing to the database goes.

use serde::Serialize;

/// Counts of the points by their fate.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Figures {
    /// The database has them.
    pub written: u64,
    /// They wait.
    pub waiting: u64,
    /// Invalid points that the database refused.
    pub rejected: u64,
    /// Its last reason for a refusal.
    pub refusal: String,
    /// The part of a recording without points, because the user stopped the program; empty if there is none.
    pub left_out: String,
    /// Points dropped in favour of newer ones while the database took none.
    pub lost: u64,
    /// Its last reason for not taking a batch; empty while all is well.
    pub trouble: String,
}
