//! Size and sameness: a recording of a million rows, and the same question asked twice.

use crate::concealed::case::{Case, Column, Table};
use crate::concealed::groups;
use crate::concealed::score::outcome::Outcome;
use crate::concealed::score::tool;

/// A case with a single effect whose clock runs through the whole day.
fn template() -> Option<Case> {
    let orders = groups::orders(1);
    let cases = orders.iter().filter(|o| o.group() == "single-rich-rho1").filter_map(groups::Order::build);
    let mut running = cases.filter(|case| case.table.columns[0].0 == "time_s" && rises(&case.table.columns[0].1));
    running.next()
}

fn rises(column: &Column) -> bool {
    let Column::Number(times, _) = column else { return false };
    times.windows(2).all(|pair| pair[0] < pair[1])
}

/// The day of `case` again and again, with other run and tool names and a later clock, until there are `rows`.
fn repeated(case: &Case, rows: usize) -> Case {
    let days = rows.div_ceil(case.clean.len());
    let again = |name: &str, column: &Column| match column {
        Column::Text(cells) => {
            let own = name == "run" || name == "tool";
            let day = |d: usize| cells.iter().map(move |c| if own { format!("{d}-{c}") } else { c.clone() });
            Column::Text((0..days).flat_map(day).collect())
        }
        Column::Number(values, decimals) => {
            let later = if name == "time_s" { values.last().copied().flatten().unwrap_or(0.0) + 60.0 } else { 0.0 };
            let day = |d: usize| values.iter().map(move |v| v.map(|v| v + d as f64 * later));
            Column::Number((0..days).flat_map(day).collect(), *decimals)
        }
    };
    let columns = case.table.columns.iter().map(|(name, column)| (name.clone(), again(name, column))).collect();
    let mut long = case.clone();
    (long.table, long.group, long.clean) = (Table { columns }, "endurance".into(), case.clean.repeat(days));
    for hidden in &mut long.hidden {
        hidden.contribution = hidden.contribution.repeat(days);
        hidden.remainder = hidden.remainder.repeat(days);
    }
    long.tangent.iter_mut().for_each(|column| *column = column.repeat(days));
    long
}

/// Lines of rows, seconds and what was said; a million rows only when a tenth of them took less than a tenth of a minute.
pub(crate) fn long_recordings() -> String {
    let Some(case) = template() else { return "no template for the long recording".into() };
    let (tenth, seconds) = timed(&case, 100_000);
    if seconds > 6.0 {
        return format!("{tenth}\n1000000 rows: not tried, a tenth of them took {seconds:.1} s");
    }
    format!("{tenth}\n{}", timed(&case, 1_000_000).0)
}

fn timed(case: &Case, rows: usize) -> (String, f64) {
    let long = repeated(case, rows);
    let outcome = Outcome::of(&long, &tool::ask(&long));
    tool::discard(&long);
    let line = format!("{} rows in {:.1} s: {} -> {}", long.clean.len(), outcome.seconds, outcome.truth, outcome.said);
    (line, if outcome.broken { f64::INFINITY } else { outcome.seconds })
}

/// Whether the same question asked twice gives the same bytes; the reason when it does not.
pub(crate) fn same_twice() -> Result<(), String> {
    let case = template().ok_or("no template")?;
    let folder = tool::workshop().0.join(&case.group).join(&case.name);
    let mut seen: Vec<(Vec<u8>, Vec<u8>)> = Vec::new();
    for _ in 0..2 {
        tool::ask(&case)?;
        let read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| format!("{name}: {e}"));
        seen.push((read("diagnosis.json")?, read("rows.csv")?));
    }
    tool::discard(&case);
    if seen[0] == seen[1] { Ok(()) } else { Err("the second answer differs from the first".into()) }
}

/// A repeated day keeps its length, its clock rises, and runs of different days differ.
#[test]
fn a_repeated_day_is_a_longer_recording() {
    let case = template().expect("a template exists");
    let long = repeated(&case, 3 * case.clean.len());
    assert!(rises(&long.table.columns[0].1));
    let names = |case: &Case| match case.table.columns.iter().find(|(n, _)| n == "run") {
        Some((_, Column::Text(runs))) => runs.iter().cloned().collect::<std::collections::BTreeSet<_>>().len(),
        _ => 0,
    };
    assert_eq!(names(&long), 3 * names(&case));
}
