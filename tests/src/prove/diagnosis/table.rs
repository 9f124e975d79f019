//! A table of Markdown under its heading.

use std::fmt::Write as _;

use anyhow::{Context as _, Result, ensure};

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

/// The rows of a table of comma-separated values (RFC 4180).
///
/// # Errors
/// A quotation does not end.
pub(super) fn records(text: &str) -> Result<Vec<Vec<String>>> {
    let mut rows = vec![vec![String::new()]];
    let mut is_quoted = false;
    let mut characters = text.chars().filter(|character| *character != '\r').peekable();
    while let Some(character) = characters.next() {
        let cell = rows.last_mut().and_then(|row| row.last_mut()).context("a table has a cell")?;
        match character {
            '"' if is_quoted && characters.peek() == Some(&'"') => {
                cell.push('"');
                characters.next();
            }
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => rows.last_mut().context("a table has a row")?.push(String::new()),
            '\n' if !is_quoted => rows.push(vec![String::new()]),
            other => cell.push(other),
        }
    }
    ensure!(!is_quoted, "a quotation does not end");
    rows.retain(|row| row.iter().any(|cell| !cell.is_empty()));
    Ok(rows)
}

fn row(cells: &[impl AsRef<str>]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| cell.as_ref().replace('|', "/")).collect();
    format!("| {} |", cells.join(" | "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comma_separated_cells_may_have_commas_quotes_and_ends_of_lines() {
        let rows = records("a,b\r\n\"1, \"\"two\"\"\",\n\n,\"x\ny\"\n").unwrap();
        assert_eq!(rows, [["a", "b"], ["1, \"two\"", ""], ["", "x\ny"]]);
        assert!(records("a\n\"b").is_err());
    }

    #[test]
    fn a_section_has_its_heading_its_words_and_its_rows() {
        let form = Form { title: "Rates", about: "How often.", columns: &["what", "times"] };
        let text = form.section(&[vec!["a | b".into(), "3".into()]]);
        assert_eq!(text, "## Rates\n\nHow often.\n\n| what | times |\n|---|---|\n| a / b | 3 |\n");
    }
}
