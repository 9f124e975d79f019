//! Numbers for people.

/// To three decimals at most; a value too large for any sensor or counter is not written out.
pub(super) fn short(value: f64) -> String {
    if value.abs() >= 1e15 {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
