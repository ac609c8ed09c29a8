//! The simulation that somebody already has, as a series: another program's output, a result of an FMU, the force or power of a CAM system.
//! It is laid beside the recording by clock time, by its course (the lag at which both agree best), by position, or by program block, and becomes a
//! column. A model of that column alone is that of `series_model`: gain and offset are refitted, and the error as given stands beside that.

use super::recordings::describe_reading;
use super::series_alignment::align_series;
use crate::series_alignment::AlignBy;
use adapter_core::bilingual::Bilingual;
use adapter_core::channel::quantity::{Quantity, unit_of};
use adapter_core::channel::unit::Unit;
use recording::Recording;
use recording::{Cells, Mapping, Numbers, read_path, read_path_as};
use rules::twin::text_report::format_short_number;
use rules::twin::{Model, format_toml_text, parse_model};
use std::path::Path;

/// A series that is asked for: `FILE` or `FILE:COLUMN`.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedSeries {
    /// Path of the recording that holds the series.
    pub file: String,
    /// Its column; without one, the only one of the output's quantity.
    pub column: Option<String>,
    /// How it is laid beside.
    pub by: AlignBy,
}

impl SimulatedSeries {
    /// From `FILE` or `FILE:COLUMN`.
    #[must_use]
    pub fn from_text(text: &str, by: AlignBy) -> Self {
        // A column may have a colon in its name: the file is what is there.
        let mut split = text.match_indices(':').map(|(at, _)| (&text[..at], &text[at + 1..]));
        let split = split.find(|(file, _)| Path::new(file).is_file()).or_else(|| text.rsplit_once(':'));
        match split {
            Some((file, column)) if !Path::new(text).exists() && !file.is_empty() => {
                Self { file: file.to_owned(), column: Some(column.to_owned()).filter(|column| !column.is_empty()), by }
            }
            _ => Self { file: text.to_owned(), column: None, by },
        }
    }
}

/// The recorded quantity of the same name as the series, else the first that is measured of a machine's drives.
#[must_use]
pub fn recorded_output(recording: &Recording, series: &SimulatedSeries) -> Option<String> {
    let has = |name: &str| recording.find_numbers(name).is_some_and(|numbers| numbers.count_present() > 0);
    let own = series.column.as_deref().filter(|name| has(name)).map(str::to_owned);
    let usual = [
        "spindle_power_w",
        "axis_current_a",
        "cutting_force_n",
        "total_power_w",
        "spindle_current_a",
        "thermal_error_um",
        "torque_nm",
        "force_n",
    ];
    own.or_else(|| usual.into_iter().find(|name| has(name)).map(str::to_owned))
}

/// The series beside the recording.
#[derive(Debug)]
pub struct AttachedSeries {
    /// The recording with the series as a column.
    pub recording: Recording,
    /// Name of that column.
    pub column: String,
    /// For the user: how it was read and laid beside.
    pub remarks: Vec<Bilingual>,
}

/// Share of the rows that must get a value.
const COVERED_MIN: f64 = 0.3;
/// Correlation of recorded and simulated below which they are of different work.
const ALIKE_MIN: f64 = 0.5;

/// Lays a series beside a recording.
///
/// # Errors
/// It cannot be read, has no such column, or does not belong to this recording.
pub fn attach_series(
    recording: &Recording,
    output: &str,
    asked: &SimulatedSeries,
    map: Option<&Mapping>,
) -> Result<AttachedSeries, Vec<Bilingual>> {
    let path = Path::new(&asked.file);
    let read = map.map_or_else(|| read_path(path), |map| read_path_as(path, map));
    let read = read.map_err(|error| vec![Bilingual::new(error.to_string(), error.describe_in_chinese())])?;
    let mut told = describe_reading(&asked.file, &read);
    let wanted = recording.find_numbers(output).ok_or_else(|| {
        vec![Bilingual::new(
            format!("{output} is not recorded: there is nothing to compare the simulation with"),
            format!("没有{output}的实测值，无法与仿真比较"),
        )]
    })?;
    let (name, factor) = find_column(&read.recording, output, asked)?;
    let numbers = read.recording.find_numbers(&name).cloned().unwrap_or_default();
    let (cells, how) = align_series(recording, wanted, &read.recording, &numbers, asked.by)?;
    let cells: Numbers = cells.iter().map(|value| value.map(|value| value * factor)).collect();
    if (factor - 1.0).abs() > 1e-12 {
        told.push(Bilingual::new(
            format!("  {name}: times {} for the unit of {output}", format_short_number(factor)),
            format!("  {name}：乘以{}换算为{output}的单位", format_short_number(factor)),
        ));
    }
    told.push(Bilingual::new(
        format!("  simulated series {name}: {}", how.en),
        format!("  仿真序列{name}：{}", how.zh),
    ));
    told.extend(check_match(wanted, &cells, &name)?);
    let column = series_column(output);
    let mut with = recording.clone();
    with.set_column(&column, Cells::Numbers(cells));
    Ok(AttachedSeries { recording: with, column, remarks: told })
}

/// The name of the series as a column of the recording: `spindle_power_w` -> `simulated_spindle_power_w`.
#[must_use]
pub fn series_column(output: &str) -> String {
    format!("simulated_{output}")
}

/// The model of a series alone.
///
/// # Errors
/// Never for an output that is a plain name.
pub fn series_model(output: &str) -> Result<Model, Vec<String>> {
    let text = series_model_text(output);
    parse_model(&text).map_err(|problems| problems.iter().map(ToString::to_string).collect())
}

/// The text of [`series_model`] (model/1), with gain 1 and offset 0.
#[must_use]
pub fn series_model_text(output: &str) -> String {
    let column = series_column(output);
    format!(
        "schema = \"model/1\"\nname = \"the simulated series\"\noutput = {}\n\n# gain and offset of the series; 1 and 0: as it was given\n\
         [[effect]]\nkind = \"linear\"\ncolumns = {{ {column} = 1.0, one = 0.0 }}\n",
        format_toml_text(output)
    )
}

/// The column that is meant, and what turns it into the unit of the output.
fn find_column(series: &Recording, output: &str, asked: &SimulatedSeries) -> Result<(String, f64), Vec<Bilingual>> {
    let names: Vec<&str> = series
        .columns()
        .iter()
        .map(|column| column.name.as_str())
        .filter(|name| series.find_numbers(name).is_some())
        .collect();
    let list = names.join(", ");
    if let Some(wanted) = &asked.column {
        let found = names.iter().find(|name| *name == wanted).ok_or_else(|| {
            vec![Bilingual::new(
                format!("{} has no column {wanted} of numbers; it has {list}", asked.file),
                format!("{}没有数值列{wanted}；现有：{list}", asked.file),
            )]
        })?;
        return Ok(((*found).to_owned(), unit_factor(found, output).unwrap_or(1.0)));
    }
    let same: Vec<&&str> = match names.len() {
        1 => names.iter().collect(),
        _ if names.contains(&output) => names.iter().filter(|name| **name == output).collect(),
        _ => names
            .iter()
            .filter(|name| {
                Quantity::from_column_name(name) == Quantity::from_column_name(output)
                    && Quantity::from_column_name(output) != Quantity::Other
            })
            .collect(),
    };
    match same[..] {
        [name] => Ok(((*name).to_owned(), unit_factor(name, output).unwrap_or(1.0))),
        _ => Err(vec![Bilingual::new(
            format!(
                "which column of {} is the simulated {output}? Write {}:COLUMN; it has {list}",
                asked.file, asked.file
            ),
            format!("{}中哪一列是仿真的{output}？请写作{}:列名；现有：{list}", asked.file, asked.file),
        )]),
    }
}

/// What turns a column into the unit of the output, where its name says its unit.
fn unit_factor(name: &str, output: &str) -> Option<f64> {
    let inner = name.rsplit_once(['[', '(']).map(|(_, unit)| unit.trim_end_matches([']', ')']));
    let unit = inner.and_then(Unit::from_symbol).or_else(|| unit_of(name).and_then(Unit::from_symbol))?;
    let (factor, _) = unit.compute_conversion(unit_of(output).and_then(Unit::from_symbol)?)?;
    Some(factor)
}

/// Enough of the rows have a value, and both go up and down together.
#[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
fn check_match(recorded: &Numbers, simulated: &Numbers, name: &str) -> Result<Vec<Bilingual>, Vec<Bilingual>> {
    let pairs: Vec<(f64, f64)> = recorded.iter().zip(simulated.iter()).filter_map(|(a, b)| Some((a?, b?))).collect();
    let share = pairs.len() as f64 / recorded.count_present().max(1) as f64;
    if share < COVERED_MIN {
        let percent = format_short_number(100.0 * share);
        return Err(vec![Bilingual::new(
            format!(
                "{name} covers {percent} % of the recorded rows only: is it of the same run? --align course looks for where it fits"
            ),
            format!("{name}只覆盖{percent} %的记录行：是否为同一次运行？可用--align course查找位置"),
        )]);
    }
    let n = pairs.len() as f64;
    let mean = pairs.iter().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0 / n, sum.1 + pair.1 / n));
    let moments = pairs.iter().fold((0.0, 0.0, 0.0), |sum, pair| {
        let (a, b) = (pair.0 - mean.0, pair.1 - mean.1);
        (sum.0 + a * a, sum.1 + b * b, sum.2 + a * b)
    });
    let correlation = moments.2 / (moments.0 * moments.1).sqrt().max(f64::MIN_POSITIVE);
    if correlation < ALIKE_MIN {
        let text = format_short_number(correlation);
        return Ok(vec![Bilingual::new(
            format!(
                "unsure: {name} and the recording hardly go together (correlation {text}): is it of the same program, tool and output?"
            ),
            format!("存疑：{name}与记录的相关系数仅为{text}：程序、刀具和物理量是否相同？"),
        )]);
    }
    Ok(Vec::new())
}

/// Root mean square of recorded minus the series as it was given, and over how many rows.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
pub fn error_as_given(recording: &Recording, output: &str) -> Option<(f64, usize)> {
    let (recorded, simulated) = (recording.find_numbers(output)?, recording.find_numbers(&series_column(output))?);
    let squares: Vec<f64> =
        recorded.iter().zip(simulated.iter()).filter_map(|(a, b)| Some((a? - b?).powi(2))).collect();
    (!squares.is_empty()).then(|| ((squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), squares.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::read_csv;

    fn recording(text: &str) -> Recording {
        read_csv(text.as_bytes(), "r.csv").expect("readable").recording
    }

    fn file(text: &str) -> (tempfile::TempDir, SimulatedSeries) {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("cam.csv");
        std::fs::write(&path, text).expect("written");
        let asked = SimulatedSeries::from_text(&path.display().to_string(), AlignBy::Auto);
        (directory, asked)
    }

    #[test]
    fn a_series_is_laid_beside_by_time_in_the_unit_of_the_output() {
        let here = recording("time_s,spindle_power_w\n0,100\n1,200\n2,300\n3,400\n");
        let (_kept, asked) = file("time_s,force,power [kW]\n0,1,0.1\n1,1,0.2\n2,1,0.3\n3,1,0.4\n");
        let found = attach_series(
            &here,
            "spindle_power_w",
            &SimulatedSeries { column: Some("power [kW]".to_owned()), ..asked },
            None,
        )
        .expect("fits");
        assert_eq!(found.recording.find_numbers("simulated_spindle_power_w").and_then(|n| n.get(2)), Some(300.0));
        assert_eq!(error_as_given(&found.recording, "spindle_power_w").map(|(error, _)| error < 1e-9), Some(true));
        assert!(series_model("spindle_power_w").is_ok());
    }

    #[test]
    fn a_series_is_laid_beside_by_block_and_by_position() {
        let here = recording("time_s,block,axis_position_mm,spindle_power_w\n0,N10,0,100\n1,N20,5,200\n2,N20,10,200\n");
        let (_kept, asked) = file("time_s,block,axis_position_mm,spindle_power_w\n0,N10,0,110\n1,N20,10,210\n");
        let by = |by| {
            attach_series(&here, "spindle_power_w", &SimulatedSeries { by, ..asked.clone() }, None)
                .expect("fits")
                .recording
        };
        let series = |recording: &Recording| {
            recording.find_numbers("simulated_spindle_power_w").map(|n| n.iter().collect::<Vec<_>>())
        };
        assert_eq!(series(&by(AlignBy::Block)), Some(vec![Some(110.0), Some(210.0), Some(210.0)]));
        assert_eq!(series(&by(AlignBy::Position)), Some(vec![Some(110.0), Some(160.0), Some(210.0)]));
    }

    #[test]
    fn which_column_is_asked_where_several_could_be_it() {
        let here = recording("time_s,spindle_power_w\n0,100\n1,200\n");
        let (_kept, asked) = file("time_s,a_w,b_w\n0,1,0.1\n1,1,0.2\n");
        let wrong = attach_series(&here, "spindle_power_w", &asked, None).expect_err("two");
        assert!(wrong[0].en.contains(":COLUMN") && wrong[0].en.contains("a_w, b_w"), "{}", wrong[0]);
    }
}
