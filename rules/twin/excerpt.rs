//! What a long recording is diagnosed from: pieces of it at full rate, drawn evenly over its whole length, with what
//! lies between them in coarse rows that only carry states on; and where they show nothing, means over all of it. The
//! answer is then told over every row.

use super::frame::{ROWS_MAX, Unit};
use crate::physics::{Block, PAUSE_PERIODS, Role, Scene};
use std::ops::Range;

/// Rows of all pieces together, about.
const FITTED_ROWS: usize = 8_000;
/// Rows of a piece, about.
const PIECE_ROWS: usize = 240;
/// Rows before a piece that are simulated at full rate but not fitted: what lags looks back on them.
const LEAD_ROWS: usize = 20;
/// Coarse rows between the pieces, at most, where nothing changes.
const COARSE_ROWS: usize = 8_000;
/// Time within which neighbouring rows of a fast recording may be averaged instead: no law here is faster.
const AVERAGED_S: f64 = 0.02;
/// Relative change of a pace within a mean that is still compared.
const STEADY: f64 = 0.02;
/// What a coarse row must not mix.
const WORDS: [&str; 6] = ["pass", "part", "tool", "lot", "operation", "program"];

/// Is the recording longer than can be fitted row by row, and not so fast that averaging does no harm?
pub(super) fn is_long(scene: &Scene) -> bool {
    let averaged_s = (scene.rows() as f64) / (ROWS_MAX as f64) * scene.period_s();
    scene.rows() > ROWS_MAX && averaged_s > AVERAGED_S
}

/// Pieces at full rate, for whatever acts from row to row.
pub(super) fn close(scene: &Scene, units: &[Unit]) -> Vec<Block> {
    let (fine, edges) = (fine_rows(scene, units), edges(scene, units));
    let coarse = |row: usize| fine[row] == Resolution::Coarse && fine[row - 1] == Resolution::Coarse;
    let mut blocks = joined(scene.rows(), |row| coarse(row) && !edges[row]);
    blocks.iter_mut().for_each(|block| block.compared = fine[block.rows.start] == Resolution::Fitted);
    blocks
}

/// Means over all of it, for what is slow and so small that every row is needed. Means in which the machine changes its
/// pace are not compared: a law of means is no mean of a law.
pub(super) fn from_afar(scene: &Scene, units: &[Unit]) -> Vec<Block> {
    let edges = edges(scene, units);
    let paces = [scene.role(Role::Speed), scene.column("feed_mm_min"), scene.role(Role::Engaged)];
    let paces: Vec<&[f64]> = paces.into_iter().flatten().collect();
    let steady = |rows: &Range<usize>| {
        let first = rows.start;
        paces.iter().all(|pace| rows.clone().all(|row| (pace[row] - pace[first]).abs() <= STEADY * pace[first].abs()))
    };
    let mut blocks = joined(scene.rows(), |row| !edges[row]);
    for block in &mut blocks {
        block.compared = 2 * block.rows.len() > longest(scene.rows()) && steady(&block.rows);
    }
    blocks
}

/// Rows of a coarse row at most.
fn longest(rows: usize) -> usize {
    rows.div_ceil(COARSE_ROWS)
}

/// Blocks of at most the longest coarse row; a row begins a new one where it must not `join` the row before.
fn joined(rows: usize, join: impl Fn(usize) -> bool) -> Vec<Block> {
    let longest = longest(rows);
    let mut blocks: Vec<Block> = Vec::new();
    for row in 0..rows {
        match blocks.last_mut() {
            Some(last) if join(row) && last.rows.len() < longest => last.rows.end = row + 1,
            _ => blocks.push(Block { rows: row..row + 1, compared: false }),
        }
    }
    blocks
}

/// How a row enters an excerpt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Resolution {
    /// As part of a coarse row.
    Coarse,
    /// By itself, not fitted.
    Lead,
    /// By itself, fitted.
    Fitted,
}

/// One piece of every so many, drawn evenly: where in each group of neighbours it lies follows no period.
fn fine_rows(scene: &Scene, units: &[Unit]) -> Vec<Resolution> {
    let pieces: Vec<Range<usize>> = units.iter().flat_map(|unit| pieces(scene, &unit.rows)).collect();
    let every = ((scene.rows() + FITTED_ROWS / 2) / FITTED_ROWS).max(1);
    let mut fine = vec![Resolution::Coarse; scene.rows()];
    for (index, group) in pieces.chunks(every).enumerate() {
        let chosen = &group[scattered(index) % group.len()];
        let unit =
            units.iter().find(|unit| unit.rows.contains(&chosen.start)).map_or(chosen.start, |unit| unit.rows.start);
        let lead = chosen.start.saturating_sub(LEAD_ROWS).max(unit)..chosen.start;
        fine[lead].iter_mut().filter(|row| **row == Resolution::Coarse).for_each(|row| *row = Resolution::Lead);
        fine[chosen.clone()].fill(Resolution::Fitted);
    }
    fine
}

/// A unit cut into pieces, out of the cut where that is near.
fn pieces(scene: &Scene, rows: &Range<usize>) -> Vec<Range<usize>> {
    let engaged = scene.role(Role::Engaged);
    let idle = |row: usize| engaged.is_none_or(|engaged| engaged[row] <= 0.0);
    let mut pieces: Vec<Range<usize>> = Vec::new();
    let mut start = rows.start;
    for row in rows.clone() {
        let long = row - start;
        let enough = long >= PIECE_ROWS && idle(row) || long >= 2 * PIECE_ROWS;
        if enough {
            pieces.push(start..row);
            start = row;
        }
    }
    match pieces.last_mut() {
        Some(last) if rows.end - start < PIECE_ROWS / 2 => last.end = rows.end,
        _ => pieces.push(start..rows.end),
    }
    pieces
}

/// Rows at which a coarse row must not go on.
fn edges(scene: &Scene, units: &[Unit]) -> Vec<bool> {
    let mut edges = vec![false; scene.rows()];
    let starts = units.iter().map(|unit| unit.rows.start);
    let passes = scene.passes().iter().flat_map(|pass| [pass.start, pass.end]);
    starts.chain(passes).filter(|row| *row < scene.rows()).for_each(|row| edges[row] = true);
    let clock_s = scene.clock_s();
    let words: Vec<_> = WORDS.iter().filter_map(|name| scene.words(name)).collect();
    for row in 1..scene.rows() {
        let paused = clock_s[row] - clock_s[row - 1] > PAUSE_PERIODS * scene.period_s();
        edges[row] |= paused || words.iter().any(|words| words.code(row) != words.code(row - 1));
    }
    edges
}

/// A number that follows no period (the finaliser of splitmix64).
fn scattered(index: usize) -> usize {
    let mut x = (index as u64).wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    usize::try_from((x ^ (x >> 31)) >> 1).unwrap_or(index)
}

#[cfg(test)]
mod tests {
    use super::super::frame::units;
    use super::*;
    use adapters::Recording;
    use adapters::recording::{Cells, Numbers, Words};

    /// 100,000 rows at 10 Hz: a cut of 30 s in every 40, a new run every 20 minutes.
    fn scene() -> Scene {
        let rows = 100_000;
        let mut recording = Recording::new("test", (0..rows).map(|row| 0.1 * row as f64).collect(), None);
        let engaged: Vec<f64> = (0..rows).map(|row| f64::from(u8::from(row % 400 < 300))).collect();
        let power: Vec<f64> = engaged.iter().map(|engaged| 500.0 + 800.0 * engaged).collect();
        let runs: Vec<String> = (0..rows).map(|row| (row / 12_000).to_string()).collect();
        recording.set_column("run", Cells::Words(runs.iter().map(String::as_str).collect::<Words>()));
        recording.set_column("engaged", Cells::Numbers(Numbers::full(engaged)));
        recording.set_column("spindle_power_w", Cells::Numbers(Numbers::full(power)));
        Scene::new(&recording, "spindle_power_w", &Default::default()).expect("a scene")
    }

    #[test]
    fn both_ways_cover_every_row_once_and_mix_no_pass() {
        let scene = scene();
        assert!(is_long(&scene));
        for blocks in [close(&scene, &units(&scene)), from_afar(&scene, &units(&scene))] {
            let mut next = 0;
            for block in &blocks {
                assert_eq!(block.rows.start, next);
                next = block.rows.end;
                let cut = |row: usize| row % 400 < 300;
                assert!(block.rows.clone().all(|row| cut(row) == cut(block.rows.start)), "{block:?}");
            }
            assert_eq!(next, scene.rows());
        }
    }

    #[test]
    fn pieces_are_spread_over_the_whole_length() {
        let scene = scene();
        let (close, afar) = (close(&scene, &units(&scene)), from_afar(&scene, &units(&scene)));
        let compared = |blocks: &[Block], from: usize| {
            blocks.iter().filter(|block| block.compared && (from..from + 10_000).contains(&block.rows.start)).count()
        };
        for tenth in 0..10 {
            assert!(compared(&close, 10_000 * tenth) > 300, "tenth {tenth}");
            assert!(compared(&afar, 10_000 * tenth) > 300, "tenth {tenth}");
        }
        let all: usize = close.iter().filter(|block| block.compared).count();
        assert!((4_000..12_000).contains(&all), "{all}");
    }
}
