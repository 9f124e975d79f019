//! A campaign's results.

use std::fmt::Write as _;

/// Labels of the figures. Tests compare `docs/proof.md` with them.
#[derive(Debug)]
pub struct Labels {
    /// Single figures, in printed order.
    pub facts: &'static [&'static str],
    /// The table's heading; empty without a table.
    pub columns: &'static [&'static str],
}

impl Labels {
    /// Constant lines: each fact up to its colon, and the table's heading.
    #[cfg(test)]
    pub(super) fn lines(&self) -> Vec<String> {
        let heading = (!self.columns.is_empty()).then(|| heading(self.columns));
        self.facts.iter().map(|what| format!("* {what}:")).chain(heading).collect()
    }
}

fn heading(columns: &[&str]) -> String {
    format!("| {} |", columns.join(" | "))
}

/// A campaign's results.
#[derive(Debug, Clone)]
pub struct Figures {
    labels: &'static Labels,
    facts: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Figures {
    pub(super) fn new(labels: &'static Labels) -> Self {
        Self { labels, facts: Vec::new(), rows: Vec::new() }
    }

    /// The next figure.
    ///
    /// # Panics
    /// The next label is another one.
    #[expect(clippy::needless_pass_by_value, reason = "numbers, and texts that are made for this")]
    pub(super) fn fact(&mut self, what: impl AsRef<str>, figure: impl ToString) {
        assert_eq!(self.labels.facts.get(self.facts.len()), Some(&what.as_ref()), "the campaign's labels");
        self.facts.push(figure.to_string());
    }

    /// The next row.
    ///
    /// # Panics
    /// Its cells are not as many as the columns.
    pub(super) fn row<const N: usize>(&mut self, row: [String; N]) {
        assert_eq!(self.labels.columns.len(), N, "the campaign's labels");
        self.rows.push(row.into());
    }

    /// Text and Markdown.
    ///
    /// # Panics
    /// A label has no figure.
    pub fn text(&self) -> String {
        assert_eq!(self.labels.facts.len(), self.facts.len(), "each label has a figure");
        let mut text = String::new();
        for (what, figure) in self.labels.facts.iter().zip(&self.facts) {
            let _ = writeln!(text, "* {what}: {figure}");
        }
        if !self.labels.columns.is_empty() {
            let _ = writeln!(text, "\n{}", heading(self.labels.columns));
            let _ = writeln!(text, "|{}", "---|".repeat(self.labels.columns.len()));
            for row in &self.rows {
                let _ = writeln!(text, "| {} |", row.join(" | "));
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABELS: Labels = Labels { facts: &["runs", "lost"], columns: &["flight", "frames"] };

    #[test]
    fn figures_are_printed_under_their_labels() {
        let mut figures = Figures::new(&LABELS);
        figures.fact("runs", 3);
        figures.fact("lost", 0);
        figures.row(["a.tlog".to_owned(), "7".to_owned()]);
        let text = figures.text();
        assert_eq!(text, "* runs: 3\n* lost: 0\n\n| flight | frames |\n|---|---|\n| a.tlog | 7 |\n");
        assert!(LABELS.lines().iter().all(|line| text.contains(line)), "{:?}", LABELS.lines());
    }

    #[test]
    #[should_panic(expected = "labels")]
    fn a_figure_that_has_no_label_is_refused() {
        Figures::new(&LABELS).fact("lost", 0);
    }
}
