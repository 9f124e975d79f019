//! Points on their way to the database.

/// Lines and their number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Batch {
    /// Line protocol.
    pub text: Vec<u8>,
    /// Its lines.
    pub points: u64,
}
