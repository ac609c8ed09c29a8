//! Where a simulated series lies beside a recording: by time, by its course, by position, by program block.

use adapter_core::bilingual::Bilingual;
use adapter_core::channel::quantity::{Quantity, without_unit};
use recording::Numbers;
use recording::Recording;
use rules::estimators::alignment::match_courses;
use rules::twin::text_report::format_short_number;

pub(super) type Aligned = (Vec<Option<f64>>, Bilingual);

pub(super) fn align_series(
    recording: &Recording,
    wanted: &Numbers,
    series: &Recording,
    numbers: &Numbers,
    by: AlignBy,
) -> Result<Aligned, Vec<Bilingual>> {
    let same_times = series.time_s == recording.time_s;
    match by {
        AlignBy::Position => by_position(recording, series, numbers),
        AlignBy::Block => by_block(recording, series, numbers),
        AlignBy::Time => Ok(by_time(recording, series, numbers)),
        AlignBy::Auto if same_times || recording.start_ns.is_some() && series.start_ns.is_some() => {
            Ok(by_time(recording, series, numbers))
        }
        AlignBy::Auto | AlignBy::Course => by_course(recording, wanted, series, numbers, by),
    }
}

/// Times as they stand, both since 1970 where both know the day.
fn by_time(recording: &Recording, series: &Recording, numbers: &Numbers) -> Aligned {
    #[expect(
        clippy::cast_precision_loss,
        reason = "a double counts nanoseconds exactly over 104 days, microseconds beyond"
    )]
    let shift_s = match (recording.start_ns, series.start_ns) {
        (Some(here), Some(there)) => (there - here) as f64 / 1e9,
        _ => 0.0,
    };
    let at = |time_s: f64| interpolate_at(&series.time_s, numbers, time_s - shift_s);
    (recording.time_s.iter().map(|time_s| at(*time_s)).collect(), Bilingual::new("laid beside by time", "按时间对齐"))
}

/// Where the course of the series lies on the clock of the recording.
fn by_course(
    recording: &Recording,
    wanted: &Numbers,
    series: &Recording,
    numbers: &Numbers,
    by: AlignBy,
) -> Result<Aligned, Vec<Bilingual>> {
    let course = |times: &[f64], numbers: &Numbers| -> Vec<(f64, f64)> {
        times.iter().zip(numbers.iter()).filter_map(|(time_s, value)| Some((*time_s, value?))).collect()
    };
    match match_courses(&course(&recording.time_s, wanted), &course(&series.time_s, numbers)) {
        Ok(matched) => {
            // The first clock less the second one: asked back from the recording.
            let back =
                |time_s: f64| (time_s - matched.lag_s + matched.drift * matched.middle_s) / (1.0 + matched.drift);
            let cells =
                recording.time_s.iter().map(|time_s| interpolate_at(&series.time_s, numbers, back(*time_s))).collect();
            let (lag, correlation) =
                (format_short_number(matched.lag_s.abs()), format_short_number(matched.correlation));
            let (way, way_zh) = if matched.lag_s < 0.0 { ("earlier", "提前") } else { ("later", "滞后") };
            Ok((
                cells,
                Bilingual::new(
                    format!(
                        "laid beside by its course: {lag} s {way} on the clock of the recording (correlation {correlation})"
                    ),
                    format!("按曲线对齐：在记录时钟上{way_zh}{lag} s（相关系数{correlation}）"),
                ),
            ))
        }
        Err(_) if by == AlignBy::Auto && clocks_overlap(recording, series) => {
            let (cells, how) = by_time(recording, series, numbers);
            Ok((
                cells,
                Bilingual::new(format!("{}; no lag agrees better", how.en), format!("{}；没有更合适的滞后", how.zh)),
            ))
        }
        Err(refusal) => Err(vec![Bilingual::new(
            format!(
                "the simulated series does not fit this recording: {refusal}. Is it of the same program? --align time, position or block lays it beside otherwise"
            ),
            format!("仿真序列与该记录不符：{refusal}。是否为同一程序？也可用--align time、position或block对齐"),
        )]),
    }
}

/// Do both clocks begin near one another and last about as long?
fn clocks_overlap(recording: &Recording, series: &Recording) -> bool {
    let span = |times: &[f64]| (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    let (here, there) = (span(&recording.time_s), span(&series.time_s));
    let common = here.1.min(there.1) - here.0.max(there.0);
    common > 0.8 * (here.1 - here.0)
}

fn by_position(recording: &Recording, series: &Recording, numbers: &Numbers) -> Result<Aligned, Vec<Bilingual>> {
    let name = series.columns().iter().map(|column| column.name.as_str()).find(|name| {
        Quantity::from_column_name(name) == Quantity::Position
            && recording.find_numbers(name).is_some()
            && series.find_numbers(name).is_some()
    });
    let Some(name) = name else {
        return Err(vec![Bilingual::new(
            "both need the same column of position, such as axis_position_mm, to be laid beside by it",
            "按位置对齐时，两者需有相同的位置列，例如axis_position_mm",
        )]);
    };
    let mut points: Vec<(f64, f64)> = series
        .find_numbers(name)
        .into_iter()
        .flat_map(Numbers::iter)
        .zip(numbers.iter())
        .filter_map(|(at, value)| Some((at?, value?)))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (places, values): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let values: Numbers = values.into_iter().map(Some).collect();
    let here = recording.find_numbers(name).into_iter().flat_map(Numbers::iter);
    let cells = here.map(|at| at.and_then(|at| interpolate_at(&places, &values, at))).collect();
    let quantity = without_unit(name);
    Ok((cells, Bilingual::new(format!("laid beside by {quantity}"), format!("按{quantity}对齐"))))
}

/// The mean of the series in each block of the program.
fn by_block(recording: &Recording, series: &Recording, numbers: &Numbers) -> Result<Aligned, Vec<Bilingual>> {
    let (Some(here), Some(there)) = (recording.find_words("block"), series.find_words("block")) else {
        return Err(vec![Bilingual::new(
            "both need a column block (the line of the NC program) to be laid beside by it",
            "按程序段对齐时，两者需有block列",
        )]);
    };
    let mut sums: std::collections::HashMap<&str, (f64, f64)> = std::collections::HashMap::new();
    for row in 0..series.count_rows() {
        if let (Some(block), Some(value)) = (there.get(row), numbers.get(row)) {
            let sum = sums.entry(block).or_default();
            *sum = (sum.0 + value, sum.1 + 1.0);
        }
    }
    let mean = |block: &str| sums.get(block).map(|(sum, count)| sum / count);
    let cells = (0..recording.count_rows()).map(|row| here.get(row).and_then(mean)).collect();
    Ok((cells, Bilingual::new("laid beside by program block, its mean in each", "按程序段对齐，取各段平均值")))
}

/// Between the neighbours; nothing outside of the series, nothing where a neighbour is absent.
fn interpolate_at(times: &[f64], numbers: &Numbers, at: f64) -> Option<f64> {
    let after = times.partition_point(|time| *time < at - 1e-9);
    if times.get(after).is_some_and(|time| (time - at).abs() < 1e-9) {
        return numbers.get(after);
    }
    let before = after.checked_sub(1)?;
    let (from, to) = (times[before], *times.get(after)?);
    let (low, high) = (numbers.get(before)?, numbers.get(after)?);
    Some(if to > from { low + (high - low) * (at - from) / (to - from) } else { low })
}

/// How a series is laid beside a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum AlignBy {
    /// Clock time where both know the day, else the same row where both have the same times, else the course.
    #[default]
    Auto,
    /// Times as they stand.
    Time,
    /// The lag at which both courses agree best.
    Course,
    /// The position of the axis.
    Position,
    /// The block of the NC program.
    Block,
}
