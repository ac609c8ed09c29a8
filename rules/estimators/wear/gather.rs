//! From a recording or a table to cuts: one row per cut, its conditions and its mean cutting power.

use super::conditions::{CUTTING_POWER, Cut, CutConditions, FACTORS};
use crate::LoadLossLaw;
use crate::regression::{Refusal, RefusalKind};
use recording::Recording;
use recording::{Numbers, with_derived};

/// Speed and feed within this share are those of one cut.
const SAME_SHARE: f64 = 0.02;
/// Depths within this are those of one cut, mm.
const SAME_MM: f64 = 1e-6;
/// Wears within this are those of one cut, mm: a shop's microscope tells no less apart, and a wear that is taken in a straight line
/// between two readings grows within the cut. Too small, a cut falls apart into its rows, each with the noise of one row.
const SAME_WEAR_MM: f64 = 0.005;
/// A stretch of rows this many times shorter than is usual is a transition and no cut.
const TRANSITION: usize = 5;
/// Columns whose change begins a new cut.
const GROUPS: [&str; 5] = ["run", "pass", "part", "tool", "operation"];

/// Where the numbers stand in the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct CutColumns {
    /// Columns of VB, vc, f, ap, in the order of [`FACTORS`].
    pub conditions: [String; 4],
    /// Column of the cutting power.
    pub power: String,
    /// Load loss, to separate the cutting power where it has no column: from `spindle_power_w` and `no_load_power_w`, and
    /// `spindle_speed_rpm` where the loss goes with the speed.
    pub load_loss: Option<LoadLossLaw>,
    /// Every row is a cut of its own; otherwise consecutive rows of one cut are averaged.
    pub each_row: bool,
}

impl Default for CutColumns {
    fn default() -> Self {
        Self {
            conditions: FACTORS.map(|factor| factor.name.to_owned()),
            power: CUTTING_POWER.to_owned(),
            load_loss: None,
            each_row: false,
        }
    }
}

/// The cuts of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct GatheredCuts {
    /// The cuts, in the order of the recording.
    pub cuts: Vec<Cut>,
    /// Rows of the recording behind them.
    pub rows: usize,
    /// Rows left out: not cutting, or without one of the values.
    pub left_out: usize,
}

/// The cuts of a recording. Speed and feed per revolution are derived where they have no column of their own.
///
/// # Errors
/// Which columns are missing and where they come from; no row with a value in all of them.
pub fn gather_cuts(recording: &Recording, columns: &CutColumns) -> Result<GatheredCuts, Refusal> {
    let recording = with_derived(recording.clone());
    let missing: Vec<String> = columns
        .conditions
        .iter()
        .filter(|name| recording.find_numbers(name).is_none())
        .map(|name| describe_missing_column(name))
        .collect();
    let power = cutting_power(&recording, columns);
    if let Some(what) =
        missing.into_iter().chain(power.as_ref().err().cloned()).reduce(|all, one| format!("{all}; {one}"))
    {
        let next = "a table needs the columns flank_wear_mm, cutting_speed_m_min, feed_per_rev_mm, depth_of_cut_mm, \
                    cutting_power_w, one row per cut";
        return Err(Refusal::new(RefusalKind::Missing, what, next));
    }
    let factors: Vec<&Numbers> = columns.conditions.iter().filter_map(|name| recording.find_numbers(name)).collect();
    let rows = RecordingRows { recording: &recording, factors, power: power.unwrap_or_default() };
    rows.collect_cuts(columns.each_row)
}

/// Where a missing column comes from.
fn describe_missing_column(name: &str) -> String {
    let source = match name {
        "flank_wear_mm" => "read under the microscope, entered with each cut",
        "cutting_speed_m_min" => "or spindle_speed_rpm and diameter_mm (--operations gives the diameter)",
        "feed_per_rev_mm" => "or feed_mm_min and spindle_speed_rpm",
        "depth_of_cut_mm" => "no controller knows it: --operations FILE gives it by program and block",
        _ => "name another column with --column",
    };
    format!("there is no column {name} ({source})")
}

fn cutting_power(recording: &Recording, columns: &CutColumns) -> Result<Numbers, String> {
    if let Some(power) = recording.find_numbers(&columns.power) {
        return Ok(power.clone());
    }
    let kilowatts = columns.power.strip_suffix("_w").map(|stem| format!("{stem}_kw"));
    if let Some(name) = kilowatts.filter(|name| recording.find_numbers(name).is_some()) {
        return Err(format!("{name} is in kW; the column must be {} in W", columns.power));
    }
    let (total, idle) = (recording.find_numbers("spindle_power_w"), recording.find_numbers("no_load_power_w"));
    match (total, idle, columns.load_loss) {
        (Some(total), Some(idle), Some(load_loss)) => {
            let speed = recording.find_numbers("spindle_speed_rpm");
            if load_loss.speed_rpm.is_some() && speed.is_none() {
                return Err("there is no column spindle_speed_rpm, with which the load loss goes".to_owned());
            }
            let at = |row: usize| match load_loss.speed_rpm {
                Some(_) => speed.and_then(|speed| speed.get(row)),
                None => Some(0.0),
            };
            let split = |row: usize| load_loss.split_excess_power(total.get(row)? - idle.get(row)?, at(row)?);
            Ok((0..recording.count_rows()).map(|row| split(row).map(|it| it.cutting_power_w)).collect())
        }
        (Some(_), _, _) => Err(format!(
            "there is no column {}; spindle_power_w alone holds the no-load power: add no_load_power_w (an export of the \
             history has it) and --load-loss A0 A1 RPM (identify load-loss)",
            columns.power
        )),
        _ => Err(format!("there is no column {}", columns.power)),
    }
}

struct RecordingRows<'a> {
    recording: &'a Recording,
    factors: Vec<&'a Numbers>,
    power: Numbers,
}

impl RecordingRows<'_> {
    fn read_cut(&self, row: usize) -> Option<Cut> {
        let engaged = self.recording.find_numbers("engaged").and_then(|engaged| engaged.get(row));
        if engaged.is_some_and(|engaged| engaged < 0.5) {
            return None;
        }
        let mut values = [0.0; 4];
        for (value, column) in values.iter_mut().zip(&self.factors) {
            *value = column.get(row)?;
        }
        // Without speed or feed nothing is removed, whatever the recording says of the engagement.
        let removes = values[1] > 0.0 && values[2] > 0.0;
        removes.then_some(Cut { conditions: CutConditions::from_vector(values), cutting_power_w: self.power.get(row)? })
    }

    fn same_group(&self, a: usize, b: usize) -> bool {
        let same =
            |name: &&str| self.recording.find_words(name).is_none_or(|words| words.find_code(a) == words.find_code(b));
        GROUPS.iter().all(same)
    }

    fn collect_cuts(&self, each_row: bool) -> Result<GatheredCuts, Refusal> {
        let groups = drop_transitions(self.group_rows(each_row));
        let rows: usize = groups.iter().map(|group| group.members.len()).sum();
        if groups.is_empty() {
            return Err(self.no_row());
        }
        let cuts = self.merge_neighbours(groups, each_row).iter().map(|group| average_cuts(&group.members)).collect();
        Ok(GatheredCuts { cuts, rows, left_out: self.recording.count_rows() - rows })
    }

    /// Why there is no cut: how many rows have a value in each column, and which column is absent where the others are there.
    fn no_row(&self) -> Refusal {
        let power = (&self.power, "cutting power");
        let names = FACTORS.iter().map(|factor| factor.name);
        let columns: Vec<(&Numbers, &str)> = self.factors.iter().copied().zip(names).chain([power]).collect();
        let has = |column: &Numbers, row: usize| column.get(row).is_some_and(|value| value.is_finite());
        let rows = self.recording.count_rows();
        let each = columns.iter().map(|(column, name)| {
            let present = (0..rows).filter(|row| has(column, *row)).count();
            format!("{name} in {present}")
        });
        let each = each.collect::<Vec<String>>().join(", ");
        let others = |at: usize| {
            let all = |row: &usize| columns.iter().enumerate().all(|(other, it)| other == at || has(it.0, *row));
            (0..rows).filter(all).count()
        };
        let lacking = (0..columns.len()).map(|at| (others(at), columns[at].1)).filter(|(count, _)| *count > 0);
        let lacking = lacking.max_by_key(|(count, _)| *count).map_or_else(String::new, |(count, name)| {
            format!("; {count} rows lack {name} alone, or the spindle or the feed stands still in them")
        });
        let what = format!(
            "no row has wear, speed, feed, depth and cutting power at once, with the tool in the work: of {rows} rows there is {each}{lacking}"
        );
        let next = "give what is missing in the rows of the cuts: wear with `annotate flank-wear` before and after them, depth and \
                    diameter by an operations file";
        Refusal::new(RefusalKind::TooFew, what, next)
    }

    /// Consecutive rows of the same conditions.
    fn group_rows(&self, each_row: bool) -> Vec<CutRows> {
        let mut groups: Vec<CutRows> = Vec::new();
        for row in 0..self.recording.count_rows() {
            let Some(cut) = self.read_cut(row) else { continue };
            match groups.last_mut() {
                Some(group) if !each_row && self.same_group(group.last_row, row) && group.accepts_cut(&cut) => {
                    group.last_row = row;
                    group.members.push(cut);
                }
                _ => groups.push(CutRows { last_row: row, members: vec![cut] }),
            }
        }
        groups
    }

    /// Neighbours that only a transition stood between are one cut.
    fn merge_neighbours(&self, groups: Vec<CutRows>, each_row: bool) -> Vec<CutRows> {
        let mut merged: Vec<CutRows> = Vec::new();
        for group in groups {
            match merged.last_mut() {
                Some(before)
                    if !each_row
                        && self.same_group(before.last_row, group.last_row)
                        && before.accepts_cut(&average_cuts(&group.members)) =>
                {
                    before.last_row = group.last_row;
                    before.members.extend(group.members);
                }
                _ => merged.push(group),
            }
        }
        merged
    }
}

/// Consecutive rows of one cut.
struct CutRows {
    last_row: usize,
    members: Vec<Cut>,
}

impl CutRows {
    fn accepts_cut(&self, cut: &Cut) -> bool {
        self.members.first().is_some_and(|first| are_alike(&first.conditions, &cut.conditions))
    }
}

/// Without transitions: groups much shorter than is usual in this recording.
fn drop_transitions(mut groups: Vec<CutRows>) -> Vec<CutRows> {
    let mut lengths: Vec<usize> = groups.iter().map(|group| group.members.len()).collect();
    lengths.sort_unstable();
    let usual = lengths.get(lengths.len() * 3 / 4).copied().unwrap_or(0);
    groups.retain(|group| group.members.len() * TRANSITION >= usual);
    groups
}

fn are_alike(a: &CutConditions, b: &CutConditions) -> bool {
    let close = |x: f64, y: f64| (x - y).abs() <= SAME_SHARE * x.abs();
    (a.flank_wear_mm - b.flank_wear_mm).abs() <= SAME_WEAR_MM
        && (a.depth_of_cut_mm - b.depth_of_cut_mm).abs() <= SAME_MM
        && close(a.cutting_speed_m_min, b.cutting_speed_m_min)
        && close(a.feed_per_rev_mm, b.feed_per_rev_mm)
}

fn average_cuts(cuts: &[Cut]) -> Cut {
    let count = cuts.len() as f64;
    let mean = |read: &dyn Fn(&Cut) -> f64| cuts.iter().map(read).sum::<f64>() / count;
    let conditions = std::array::from_fn(|at| mean(&|cut: &Cut| cut.conditions.to_vector()[at]));
    Cut { conditions: CutConditions::from_vector(conditions), cutting_power_w: mean(&|cut| cut.cutting_power_w) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::{Cells, Words};

    fn recording(rows: usize, columns: &[(&str, f64)]) -> Recording {
        let mut recording = Recording::new("test", (0..rows).map(|row| row as f64).collect(), None);
        for (name, value) in columns {
            recording.set_column(name, Cells::Numbers(Numbers::from_values(vec![*value; rows])));
        }
        recording
    }

    const CONDITIONS: [(&str, f64); 5] = [
        ("flank_wear_mm", 0.1),
        ("diameter_mm", 79.0),
        ("spindle_speed_rpm", 800.0),
        ("feed_mm_min", 122.4),
        ("depth_of_cut_mm", 1.0),
    ];

    #[test]
    fn rows_of_one_cut_are_averaged_and_speed_and_feed_are_derived() {
        let mut recording = recording(6, &CONDITIONS);
        let power = Numbers::from_values(vec![780.0, 790.0, 800.0, 900.0, 910.0, 0.0]);
        recording.set_column("cutting_power_w", Cells::Numbers(power));
        recording.set_column("run", Cells::Words(Words::from_iter(["1", "1", "1", "2", "2", "2"])));
        recording.set_column("engaged", Cells::Numbers(Numbers::from_values(vec![1.0, 1.0, 1.0, 1.0, 1.0, 0.0])));
        let gathered = gather_cuts(&recording, &CutColumns::default()).expect("cuts");
        let powers: Vec<f64> = gathered.cuts.iter().map(|cut| cut.cutting_power_w).collect();
        assert_eq!((powers, gathered.rows, gathered.left_out), (vec![790.0, 905.0], 5, 1));
        assert!((gathered.cuts[0].conditions.cutting_speed_m_min - 198.5).abs() < 0.1);
        assert!((gathered.cuts[0].conditions.feed_per_rev_mm - 0.153).abs() < 1e-9);
        let each = gather_cuts(&recording, &CutColumns { each_row: true, ..CutColumns::default() }).expect("cuts");
        assert_eq!(each.cuts.len(), 5);
    }

    #[test]
    fn the_cutting_power_is_separated_where_it_has_no_column() {
        let columns = [&CONDITIONS[..], &[("spindle_power_w", 1460.0), ("no_load_power_w", 500.0)]].concat();
        let known = CutColumns {
            load_loss: Some(LoadLossLaw::with_constant_coefficients(0.1807, 4e-5)),
            ..CutColumns::default()
        };
        let gathered = gather_cuts(&recording(3, &columns), &known).expect("a cut");
        assert!((gathered.cuts[0].cutting_power_w - 791.84).abs() < 0.01, "the published cut");
        let told = gather_cuts(&recording(3, &columns), &CutColumns::default()).expect_err("refused").to_string();
        assert!(told.contains("--load-loss"), "{told}");
    }

    #[test]
    fn wear_that_grows_within_a_cut_does_not_break_it() {
        let mut recording = recording(100, &CONDITIONS);
        let wear = |row: usize| 0.1 + if row < 50 { 0.0 } else { 0.1 } + 5e-5 * row as f64;
        recording.set_column("flank_wear_mm", Cells::Numbers(Numbers::from_values((0..100).map(wear).collect())));
        recording.set_column("cutting_power_w", Cells::Numbers(Numbers::from_values(vec![800.0; 100])));
        let gathered = gather_cuts(&recording, &CutColumns::default()).expect("cuts");
        assert_eq!(gathered.cuts.len(), 2, "another edge is another cut: {gathered:?}");
    }

    #[test]
    fn where_no_row_has_everything_the_message_says_what_is_absent() {
        let mut recording = recording(4, &CONDITIONS);
        let power = [Some(800.0), None, None, None].into_iter().collect::<Numbers>();
        recording.set_column("cutting_power_w", Cells::Numbers(power));
        let wear = [None, Some(0.1), Some(0.1), Some(0.1)].into_iter().collect::<Numbers>();
        recording.set_column("flank_wear_mm", Cells::Numbers(wear));
        let told = gather_cuts(&recording, &CutColumns::default()).expect_err("refused").to_string();
        for part in ["of 4 rows", "flank_wear_mm in 3", "cutting power in 1", "3 rows lack cutting power alone"] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }

    #[test]
    fn missing_columns_are_told_at_once() {
        let told = gather_cuts(&recording(3, &[("cutting_power_kw", 0.8)]), &CutColumns::default())
            .expect_err("refused")
            .to_string();
        for part in ["flank_wear_mm (read under", "depth_of_cut_mm (no controller", "cutting_power_kw is in kW"] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
