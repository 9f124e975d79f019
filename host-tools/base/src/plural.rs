//! Counted things in sentences: `1 gap`, `2 gaps`.

/// A count with its thing: `count(1, "damaged sector")` is `1 damaged sector`, of two it is `2 damaged sectors`.
pub fn count(number: impl TryInto<u64>, thing: &str) -> String {
    // A number beyond 64 bits is plural.
    let number = number.try_into().unwrap_or(u64::MAX);
    format!("{number} {}", noun(number, thing))
}

/// A count with its thing and the verb: `1 point is`, `2 points are`.
pub fn are(number: u64, thing: &str) -> String {
    format!("{} {}", count(number, thing), if number == 1 { "is" } else { "are" })
}

/// The thing alone, in the form that the number asks for.
pub fn noun(number: u64, thing: &str) -> String {
    if number == 1 {
        return thing.to_owned();
    }
    let ends = |endings: &[&str]| endings.iter().any(|ending| thing.ends_with(ending));
    match thing.strip_suffix('y') {
        Some(stem) if !ends(&["ay", "ey", "oy", "uy"]) => format!("{stem}ies"),
        _ if ends(&["s", "x", "ch", "sh"]) => format!("{thing}es"),
        _ => format!("{thing}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular_and_all_else_is_plural() {
        for (said, number, thing) in [
            ("1 gap", 1, "gap"),
            ("0 gaps", 0, "gap"),
            ("2 damaged sectors", 2, "damaged sector"),
            ("1 loss", 1, "loss"),
            ("3 losses", 3, "loss"),
            ("2 directory entries", 2, "directory entry"),
            ("4 days", 4, "day"),
        ] {
            assert_eq!(count(number, thing), said);
        }
    }
}
