//! Numbers for people.

/// Three decimals at most.
pub(super) fn short(value: f64) -> String {
    if value.abs() >= 1e15 {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
