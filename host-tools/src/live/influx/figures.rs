//! How writing to the database goes.

use serde::Serialize;

/// What became of the points.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Figures {
    /// The database has them.
    pub written: u64,
    /// They wait, in the file or in memory.
    pub waiting: u64,
    /// Of them, those that are in the file, for the next program too.
    pub stored: u64,
    /// Bytes of those.
    pub spilled_bytes: u64,
    /// The database refuses them for what they are.
    pub rejected: u64,
    /// What it said of those last.
    pub refusal: String,
    /// What of a recording no points were made of, because the user ended it; empty where there is nothing such.
    pub left_out: String,
    /// They made room in a full file, or neither it nor memory took them.
    pub lost: u64,
    /// Why points did not go into the file at some time; empty where all did.
    pub disk: String,
    /// What the database said last when it did not take a batch; empty while all is well.
    pub trouble: String,
}
