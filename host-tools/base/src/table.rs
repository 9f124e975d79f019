//! Tables of text for people: the only place that aligns columns.

use std::fmt::{self, Display, Formatter};

use crate::colour::is_mark;

/// A column: its least width in characters, and the side of its cells.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    width: usize,
    is_right: bool,
}

/// A column of words.
pub const fn left(width: usize) -> Column {
    Column { width, is_right: false }
}

/// A column of numbers.
pub const fn right(width: usize) -> Column {
    Column { width, is_right: true }
}

/// Rows of cells. A column is as wide as its widest cell.
#[derive(Clone, Debug)]
pub struct Table<const N: usize> {
    indent: usize,
    columns: [Column; N],
    rows: Vec<[String; N]>,
}

impl<const N: usize> Table<N> {
    /// Without rows. `indent`: spaces before each.
    pub const fn new(indent: usize, columns: [Column; N]) -> Self {
        Self { indent, columns, rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: [String; N]) {
        self.rows.push(cells);
    }

    /// Adds a row of headings.
    pub fn heading(&mut self, cells: [&str; N]) {
        self.row(cells.map(str::to_owned));
    }

    /// Its lines, without the last one's end.
    pub fn text(&self) -> String {
        self.to_string().trim_end_matches('\n').to_owned()
    }
}

impl<const N: usize> Display for Table<N> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut columns = self.columns;
        for (column, cell) in self.rows.iter().flat_map(|row| (0..N).zip(row)) {
            if let Some(column) = columns.get_mut(column) {
                column.width = column.width.max(shown_width(cell));
            }
        }
        for row in &self.rows {
            let mut line = " ".repeat(self.indent);
            for (column, cell) in columns.iter().zip(row) {
                let spaces = " ".repeat(column.width - shown_width(cell));
                line.extend(if column.is_right { [&spaces, cell, "  "] } else { [cell, &spaces, "  "] });
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// Characters on a terminal: marks of colours take no room.
fn shown_width(cell: &str) -> usize {
    cell.chars().filter(|c| !is_mark(*c)).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::{level, shown};

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_colours_take_no_room() {
        let mut table = Table::new(2, [left(8), right(3), left(0)]);
        table.heading(["", "of", "part"]);
        table.row([level("ok").to_string(), "12".to_owned(), "µ".to_owned()]);
        table.row([level("critical").to_string(), "12345".to_owned(), String::new()]);
        let text = shown(&table.text(), false).into_owned();
        assert_eq!(text, "               of  part\n  ok           12  µ\n  critical  12345");
        assert_eq!(Table::new(2, [left(3)]).text(), "");
    }
}
