//! A table for a terminal or for a Markdown page.

/// Rows of text under a head.
#[derive(Debug, Default)]
pub struct Table {
    /// What the table shows.
    pub title: String,
    /// How to read it, printed under the table.
    pub note: String,
    /// Column names.
    pub head: Vec<String>,
    /// Cells, row by row, as many as there are column names.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new<S: Into<String>>(title: &str, head: impl IntoIterator<Item = S>, note: &str) -> Self {
        let head = head.into_iter().map(Into::into).collect();
        Self { title: title.into(), note: note.into(), head, rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        let mut cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        cells.resize(self.head.len(), String::new());
        self.rows.push(cells);
    }

    /// Characters that each column needs.
    fn widths(&self) -> Vec<usize> {
        let all = || std::iter::once(&self.head).chain(&self.rows);
        (0..self.head.len()).map(|c| all().map(|r| r[c].chars().count()).max().unwrap_or(0)).collect()
    }

    /// Aligned columns.
    pub fn to_text(&self) -> String {
        let widths = self.widths();
        let line = |cells: &[String]| {
            let cells: Vec<String> = cells.iter().zip(&widths).map(|(c, &w)| format!("{c:<w$}")).collect();
            cells.join("   ").trim_end().to_string() + "\n"
        };
        let rule = "-".repeat(widths.iter().sum::<usize>() + 3 * widths.len().saturating_sub(1));
        let rows: String = self.rows.iter().map(|r| line(r)).collect();
        format!("{}\n{}{rule}\n{rows}{}\n", self.title, line(&self.head), self.note_line(""))
    }

    /// A Markdown table under a heading.
    pub fn to_markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = "|---".repeat(self.head.len()) + "|\n";
        let rows: String = self.rows.iter().map(|r| line(r)).collect();
        format!("### {}\n\n{}{rule}{rows}{}\n", self.title, line(&self.head), self.note_line("\n"))
    }

    fn note_line(&self, before: &str) -> String {
        if self.note.is_empty() { String::new() } else { format!("{before}{}\n", self.note) }
    }
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn columns_line_up_and_markdown_has_one_cell_a_column() {
        let mut table = Table::new("Distances", ["z", "ours (tilt)"], "cm");
        table.row(["80", "79.2 (4.7°)"]);
        table.row(["120"]);
        assert_eq!(table.to_text(), "Distances\nz     ours (tilt)\n-----------------\n80    79.2 (4.7°)\n120\ncm\n\n");
        assert_eq!(
            table.to_markdown(),
            "### Distances\n\n| z | ours (tilt) |\n|---|---|\n| 80 | 79.2 (4.7°) |\n| 120 |  |\n\ncm\n\n"
        );
    }
}
