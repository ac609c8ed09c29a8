//! What the tool said: the document of contract diagnosis/1 and its rows.

use std::collections::HashMap;

use serde_json::Value;

/// A fitted parameter with its interval.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// An effect that the tool reports as missing.
#[derive(Clone, Debug)]
pub(crate) struct Reported {
    pub(crate) effect: String,
    pub(crate) parameters: Vec<Estimate>,
}

/// The moment at which a mismatch begins.
#[derive(Clone, Debug)]
pub(crate) struct Onset {
    pub(crate) run: String,
    pub(crate) time_s: f64,
    pub(crate) low_s: f64,
    pub(crate) high_s: f64,
}

/// A diagnosis as far as it is scored.
#[derive(Clone, Debug, Default)]
pub(crate) struct Answer {
    pub(crate) verdict: String,
    pub(crate) missing: Vec<Reported>,
    pub(crate) alternatives: Vec<String>,
    pub(crate) held_out_runs: Vec<String>,
    pub(crate) onsets: Vec<Onset>,
    /// Held-out error before and after, and the floor, as the tool itself states them.
    pub(crate) held_out: Option<[f64; 3]>,
    pub(crate) seconds: f64,
    pub(crate) rows: Rows,
}

/// The columns of `--rows`; empty cells are absent.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    pub(crate) run: Vec<String>,
    pub(crate) time_s: Vec<f64>,
    pub(crate) columns: HashMap<String, Vec<Option<f64>>>,
}

impl Answer {
    /// Reads the document; what the contract requires and is not there is an error.
    pub(crate) fn read(document: &str, rows: &str, seconds: f64) -> Result<Self, String> {
        let json: Value = serde_json::from_str(document).map_err(|e| format!("diagnosis is no JSON: {e}"))?;
        if json["schema"] != "diagnosis/1" {
            return Err(format!("schema is {}, not diagnosis/1", json["schema"]));
        }
        let verdict = json["verdict"].as_str().ok_or("no verdict")?.to_string();
        let known = ["explained", "ambiguous", "unexplained", "no_mismatch", "cannot_tell"];
        if !known.contains(&verdict.as_str()) {
            return Err(format!("verdict {verdict} is not in the contract"));
        }
        let list = |key: &str| json[key].as_array().cloned().unwrap_or_default();
        let missing = list("missing").iter().map(reported).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            verdict,
            missing,
            alternatives: list("alternatives").iter().filter_map(|a| text(a, "effect")).collect(),
            held_out_runs: json["fit"]["held_out_runs"]
                .as_array()
                .map(|r| r.iter().map(plain).collect())
                .unwrap_or_default(),
            onsets: list("mismatch").iter().filter_map(|m| onset(&m["onset"])).collect(),
            held_out: held_out(&json["fit"]),
            seconds,
            rows: Rows::read(rows)?,
        })
    }

    /// Whether the tool says that something is missing.
    pub(crate) fn reports(&self) -> bool {
        matches!(self.verdict.as_str(), "explained" | "ambiguous" | "unexplained")
    }

    /// Whether it names something.
    pub(crate) fn names(&self) -> bool {
        matches!(self.verdict.as_str(), "explained" | "ambiguous")
    }

    /// Verdict and names in one line.
    pub(crate) fn summary(&self) -> String {
        let names: Vec<&str> = self.missing.iter().map(|m| m.effect.as_str()).collect();
        let others = if self.alternatives.is_empty() {
            String::new()
        } else {
            format!(" (or {})", self.alternatives.join(", "))
        };
        format!("{} {}{others}", self.verdict, names.join("+"))
    }
}

fn reported(json: &Value) -> Result<Reported, String> {
    let effect = text(json, "effect").ok_or("an entry of `missing` has no effect")?;
    let estimates = json["parameters"].as_array().cloned().unwrap_or_default();
    Ok(Reported { effect, parameters: estimates.iter().filter_map(estimate).collect() })
}

fn estimate(json: &Value) -> Option<Estimate> {
    Some(Estimate {
        name: text(json, "name")?,
        unit: text(json, "unit").unwrap_or_default(),
        value: json["value"].as_f64()?,
        low: json["low"].as_f64()?,
        high: json["high"].as_f64()?,
    })
}

fn onset(json: &Value) -> Option<Onset> {
    let time_s = json["time_s"].as_f64()?;
    let bound = |key: &str| json[key].as_f64().unwrap_or(time_s);
    Some(Onset { run: plain(&json["run"]), time_s, low_s: bound("low_s"), high_s: bound("high_s") })
}

fn held_out(fit: &Value) -> Option<[f64; 3]> {
    let rmse = |side: &str| fit[side]["held_out_rmse"].as_f64();
    Some([rmse("before")?, rmse("after")?, fit["noise_floor"].as_f64()?])
}

fn text(json: &Value, key: &str) -> Option<String> {
    json[key].as_str().map(ToString::to_string)
}

/// A run may be written as a number or as text.
fn plain(json: &Value) -> String {
    json.as_str().map_or_else(|| json.to_string(), ToString::to_string)
}

impl Rows {
    fn read(csv: &str) -> Result<Self, String> {
        let mut lines = csv.lines();
        let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let mut rows = Self::default();
        let mut columns: Vec<Vec<Option<f64>>> = vec![Vec::new(); header.len()];
        for (number, line) in lines.enumerate() {
            let cells: Vec<&str> = line.split(',').collect();
            if cells.len() != header.len() {
                return Err(format!("--rows line {}: {} cells, header has {}", number + 2, cells.len(), header.len()));
            }
            for ((name, cell), column) in header.iter().zip(&cells).zip(&mut columns) {
                if *name == "run" {
                    rows.run.push(cell.trim_matches('"').to_string());
                }
                column.push(cell.parse().ok());
            }
        }
        for (name, column) in header.iter().zip(columns) {
            if *name == "time_s" {
                rows.time_s = column.iter().map(|t| t.unwrap_or(f64::NAN)).collect();
            }
            rows.columns.insert((*name).to_string(), column);
        }
        Ok(rows)
    }

    /// A column, absent cells as zero.
    pub(crate) fn filled(&self, name: &str) -> Option<Vec<f64>> {
        self.columns.get(name).map(|c| c.iter().map(|v| v.unwrap_or(0.0)).collect())
    }

    /// The sum of all added effects.
    pub(crate) fn effects(&self) -> Vec<f64> {
        let mut sum = vec![0.0; self.run.len()];
        for (_, column) in self.columns.iter().filter(|(name, _)| name.starts_with("effect_")) {
            sum.iter_mut().zip(column).for_each(|(s, c)| *s += c.unwrap_or(0.0));
        }
        sum
    }
}
