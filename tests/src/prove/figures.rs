//! A campaign's results.

use std::fmt::{Display, Write as _};

/// A campaign's results. `docs/proof.md` has their labels, which a short run compares.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    facts: Vec<(&'static str, String)>,
    columns: &'static [&'static str],
    rows: Vec<Vec<String>>,
}

impl Figures {
    /// The table's heading.
    pub(super) fn with(columns: &'static [&'static str]) -> Self {
        Self { columns, ..Self::default() }
    }

    /// The next figure.
    pub(super) fn fact(&mut self, what: &'static str, figure: impl Display) {
        self.facts.push((what, figure.to_string()));
    }

    /// The next row.
    ///
    /// # Panics
    /// Its cells are not as many as the columns.
    pub(super) fn row(&mut self, cells: &[&dyn Display]) {
        assert_eq!(self.columns.len(), cells.len(), "cells for {:?}", self.columns);
        self.rows.push(cells.iter().map(ToString::to_string).collect());
    }

    /// Text and Markdown.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for (what, figure) in &self.facts {
            let _ = writeln!(text, "* {what}: {figure}");
        }
        if !self.columns.is_empty() {
            let _ = writeln!(text, "\n| {} |", self.columns.join(" | "));
            let _ = writeln!(text, "|{}", "---|".repeat(self.columns.len()));
            for row in &self.rows {
                let _ = writeln!(text, "| {} |", row.join(" | "));
            }
        }
        text
    }
}
