//! A table of Markdown under its heading.

use std::fmt::Write as _;

/// A test compares the document with this constant part.
#[derive(Debug)]
pub(super) struct Form {
    /// The section's heading.
    pub(super) title: &'static str,
    pub(super) about: &'static str,
    pub(super) columns: &'static [&'static str],
}

impl Form {
    pub(super) fn lines(&self) -> [String; 2] {
        [format!("## {}", self.title), row(self.columns)]
    }

    /// The whole section.
    ///
    /// # Panics
    /// A row's cells are not as many as the columns.
    pub(super) fn section(&self, rows: &[Vec<String>]) -> String {
        let [heading, columns] = self.lines();
        let mut text = format!("{heading}\n\n{}\n\n{columns}\n|", self.about);
        text.push_str(&"---|".repeat(self.columns.len()));
        text.push('\n');
        for cells in rows {
            assert_eq!(cells.len(), self.columns.len(), "{}", self.title);
            let _ = writeln!(text, "{}", row(cells));
        }
        text
    }
}

fn row(cells: &[impl AsRef<str>]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| cell.as_ref().replace('|', "/")).collect();
    format!("| {} |", cells.join(" | "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_has_its_heading_its_words_and_its_rows() {
        let form = Form { title: "Rates", about: "How often.", columns: &["what", "times"] };
        let text = form.section(&[vec!["a | b".into(), "3".into()]]);
        assert_eq!(text, "## Rates\n\nHow often.\n\n| what | times |\n|---|---|\n| a / b | 3 |\n");
    }
}
