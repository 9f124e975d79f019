//! How writing to the database goes.

use serde::Serialize;

/// What became of the points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Figures {
    /// The database has them.
    pub written: u64,
    /// They wait.
    pub waiting: u64,
    /// The database refuses them for what they are.
    pub rejected: u64,
    /// What it said of those last.
    pub refusal: String,
    /// What of a recording no points were made of, because the user ended it; empty where there is nothing such.
    pub left_out: String,
    /// They made room for newer ones while the database took none.
    pub lost: u64,
    /// What the database said last when it did not take a batch; empty while all is well.
    pub trouble: String,
}
