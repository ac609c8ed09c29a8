//! A case: the recording and the model that the tool is given, and the truth that it is never given.

use serde_json::{Value, json};

use crate::concealed::nearest::Rival;

/// A column of a recording.
#[derive(Clone)]
pub(crate) enum Column {
    Text(Vec<String>),
    /// Numbers with their decimals.
    Number(Vec<Option<f64>>, usize),
}

/// A recording as a table.
#[derive(Clone, Default)]
pub(crate) struct Table {
    pub(crate) columns: Vec<(String, Column)>,
}

impl Table {
    pub(crate) fn text(&mut self, name: &str, values: impl Iterator<Item = String>) {
        self.columns.push((name.into(), Column::Text(values.collect())));
    }

    pub(crate) fn number(&mut self, name: &str, decimals: usize, values: impl Iterator<Item = f64>) {
        self.sparse(name, decimals, values.map(Some));
    }

    pub(crate) fn sparse(&mut self, name: &str, decimals: usize, values: impl Iterator<Item = Option<f64>>) {
        self.columns.push((name.into(), Column::Number(values.collect(), decimals)));
    }

    /// The table as CSV.
    pub(crate) fn csv(&self) -> String {
        let rows = self.columns.first().map_or(0, |(_, c)| c.len());
        let names: Vec<&str> = self.columns.iter().map(|(n, _)| n.as_str()).collect();
        let mut out = names.join(",") + "\n";
        for row in 0..rows {
            let cells: Vec<String> = self.columns.iter().map(|(_, c)| c.cell(row)).collect();
            out.push_str(&cells.join(","));
            out.push('\n');
        }
        out
    }
}

impl Column {
    fn len(&self) -> usize {
        match self {
            Self::Text(v) => v.len(),
            Self::Number(v, _) => v.len(),
        }
    }

    fn cell(&self, row: usize) -> String {
        match self {
            Self::Text(v) => v[row].clone(),
            Self::Number(v, decimals) => v[row].map_or(String::new(), |x| short(x, *decimals)),
        }
    }
}

/// A number with at most `decimals` places and no trailing zeros.
pub(crate) fn short(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if !text.contains('.') {
        return text;
    }
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

/// What the right answer is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Expect {
    /// Every hidden effect by its name.
    Named,
    /// Not to be told apart by construction: a class with the truth in it, or abstention.
    Class,
    /// Nothing is hidden, or nothing of it remains.
    Nothing,
    /// Real, and in no catalogue.
    Unknown,
    /// In no catalogue, but a listed law follows it as closely as the noise allows: that name is no mistake.
    Near,
}

impl Expect {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Named => "named",
            Self::Class => "class",
            Self::Nothing => "nothing",
            Self::Unknown => "unknown",
            Self::Near => "near",
        }
    }
}

/// One hidden effect as it really was.
#[derive(Clone)]
pub(crate) struct Hiding {
    pub(crate) name: String,
    pub(crate) also: Vec<String>,
    pub(crate) form: String,
    /// Remainder after the refit of the nominal baseline over the noise.
    pub(crate) rho: f64,
    /// Share of the effect's variance that the refit takes away.
    pub(crate) absorbed: f64,
    /// First row of the effect when it begins within the recording.
    pub(crate) onset_row: Option<usize>,
    pub(crate) parameters: Vec<(String, f64)>,
    /// True contribution of every row, in the output's unit.
    pub(crate) contribution: Vec<f64>,
    /// What of it remains after the refit.
    pub(crate) remainder: Vec<f64>,
}

/// Everything that is known about a case.
#[derive(Clone)]
pub(crate) struct Case {
    pub(crate) group: String,
    pub(crate) name: String,
    pub(crate) seed: u64,
    pub(crate) expect: Expect,
    pub(crate) noise: String,
    pub(crate) noise_sd: f64,
    pub(crate) table: Table,
    pub(crate) model: String,
    pub(crate) hidden: Vec<Hiding>,
    /// Output of every row without noise.
    pub(crate) clean: Vec<f64>,
    /// Rows with a spike or a dropout.
    pub(crate) faults: Vec<usize>,
    /// Columns that span what the nominal model can take away by changing its parameters a little.
    pub(crate) tangent: Vec<Vec<f64>>,
    /// Other laws that come closest to a hidden effect.
    pub(crate) rivals: Vec<Rival>,
}

impl Case {
    /// Planted in a real recording, which has missing physics of its own and no clean output.
    pub(crate) fn injected(&self) -> bool {
        self.clean.is_empty()
    }

    /// Recorded minus clean output of the rows that were neither spoilt nor missing.
    pub(crate) fn noise_of_rows(&self) -> Vec<f64> {
        let Some((_, Column::Number(output, _))) = self.table.columns.last() else { return Vec::new() };
        let rows = output.iter().zip(&self.clean).enumerate().filter(|(row, _)| !self.faults.contains(row));
        rows.filter_map(|(_, (recorded, clean))| recorded.map(|r| r - clean)).collect()
    }

    /// The truth as a document; rows are in the order of the recording.
    pub(crate) fn truth(&self) -> Value {
        let rounded = |v: &[f64]| v.iter().map(|x| json!((x * 1000.0).round() / 1000.0)).collect::<Vec<_>>();
        let hidden: Vec<Value> = self
            .hidden
            .iter()
            .map(|h| {
                let parameters: serde_json::Map<String, Value> =
                    h.parameters.iter().map(|(n, v)| (n.clone(), json!(v))).collect();
                json!({
                    "effect": h.name, "also_right": h.also, "form": h.form, "rho": h.rho, "absorbed": h.absorbed,
                    "onset_row": h.onset_row, "parameters": parameters,
                    "contribution": rounded(&h.contribution), "remainder": rounded(&h.remainder),
                })
            })
            .collect();
        let rivals: Vec<Value> = self
            .rivals
            .iter()
            .map(|r| json!({ "effect": r.name, "form": r.form, "share": r.share, "evidence": r.evidence }))
            .collect();
        json!({
            "schema": "truth/1", "rivals": rivals, "group": self.group, "case": self.name, "seed": self.seed,
            "expect": self.expect.name(), "noise": self.noise, "noise_sd": self.noise_sd,
            "faulty_rows": self.faults, "hidden": hidden, "clean": rounded(&self.clean),
        })
    }

    /// Writes what the tool may see below `given` and the truth below `sealed`.
    pub(crate) fn write(&self, given: &std::path::Path, sealed: &std::path::Path) -> std::io::Result<()> {
        let (open, shut) = (given.join(&self.group).join(&self.name), sealed.join(&self.group).join(&self.name));
        std::fs::create_dir_all(&open)?;
        std::fs::create_dir_all(&shut)?;
        std::fs::write(open.join("recording.csv"), self.table.csv())?;
        std::fs::write(open.join("model.toml"), &self.model)?;
        std::fs::write(shut.join("truth.json"), self.truth().to_string())
    }
}
