//! Real recordings, which are not part of the project: where they are, and reading them.

use std::io::Read;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;

/// The folder of the real recordings: below `CNC_GATEWAY_SHARED`, or `../shared/data` beside the checkout.
pub(crate) fn folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let shared = std::env::var_os("CNC_GATEWAY_SHARED").map_or(beside, PathBuf::from);
    [shared.join("data"), shared].into_iter().find(|path| path.join("feed-axis").is_dir())
}

/// A table of text cells, column by column.
#[derive(Clone, Default)]
pub(crate) struct Sheet {
    pub(crate) names: Vec<String>,
    pub(crate) columns: Vec<Vec<String>>,
}

impl Sheet {
    /// Reads `.csv` or `.csv.gz`.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let fail = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
        let bytes = std::fs::read(path).map_err(|e| fail(&e))?;
        let mut text = String::new();
        if path.extension().is_some_and(|e| e == "gz") {
            GzDecoder::new(bytes.as_slice()).read_to_string(&mut text).map_err(|e| fail(&e))?;
        } else {
            text = String::from_utf8(bytes).map_err(|e| fail(&e))?;
        }
        let mut lines = text.lines();
        let names: Vec<String> = lines.next().unwrap_or_default().split(',').map(String::from).collect();
        let mut columns = vec![Vec::new(); names.len()];
        for line in lines {
            columns.iter_mut().zip(line.split(',')).for_each(|(column, cell)| column.push(cell.to_string()));
        }
        Ok(Self { names, columns })
    }

    pub(crate) fn rows(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    fn position(&self, name: &str) -> usize {
        self.names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no column {name} in {:?}", self.names))
    }

    pub(crate) fn text(&self, name: &str) -> &[String] {
        &self.columns[self.position(name)]
    }

    /// A column as numbers; an empty cell is NaN.
    pub(crate) fn numbers(&self, name: &str) -> Vec<f64> {
        self.text(name).iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
    }

    /// Sets or adds a column.
    pub(crate) fn set(&mut self, name: &str, cells: impl Iterator<Item = String>) {
        let cells = cells.collect();
        match self.names.iter().position(|n| n == name) {
            Some(at) => self.columns[at] = cells,
            None => {
                self.names.push(name.into());
                self.columns.push(cells);
            }
        }
    }

    pub(crate) fn set_numbers(&mut self, name: &str, values: &[f64]) {
        self.set(name, values.iter().map(|v| crate::concealed::case::short(*v, 6)));
    }

    /// The rows for which `keep` holds.
    pub(crate) fn filter(&self, keep: impl Fn(usize) -> bool) -> Self {
        let pick = |column: &Vec<String>| {
            let rows = column.iter().enumerate().filter(|(row, _)| keep(*row));
            rows.map(|(_, cell)| cell.clone()).collect()
        };
        Self { names: self.names.clone(), columns: self.columns.iter().map(pick).collect() }
    }

    pub(crate) fn csv(&self) -> String {
        let mut out = self.names.join(",") + "\n";
        for row in 0..self.rows() {
            let cells: Vec<&str> = self.columns.iter().map(|c| c[row].as_str()).collect();
            out += &cells.join(",");
            out.push('\n');
        }
        out
    }
}
