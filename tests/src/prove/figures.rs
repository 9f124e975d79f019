//! What a campaign found.

use std::fmt::Write as _;

/// What a campaign found.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    facts: Vec<(String, String)>,
    /// The heading of its table; none without one.
    pub(super) head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Figures {
    #[expect(clippy::needless_pass_by_value, reason = "numbers, and texts that are made for this")]
    pub(super) fn fact(&mut self, what: impl Into<String>, figure: impl ToString) {
        self.facts.push((what.into(), figure.to_string()));
    }

    pub(super) fn row<const N: usize>(&mut self, row: [String; N]) {
        self.rows.push(row.into());
    }

    /// As text, which is Markdown too.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for (what, figure) in &self.facts {
            let _ = writeln!(text, "* {what}: {figure}");
        }
        if !self.head.is_empty() {
            let _ = writeln!(text, "\n| {} |", self.head.join(" | "));
            let _ = writeln!(text, "|{}", "---|".repeat(self.head.len()));
            for row in &self.rows {
                let _ = writeln!(text, "| {} |", row.join(" | "));
            }
        }
        text
    }
}
