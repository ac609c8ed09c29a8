//! A shorter scene of the same recording: blocks of neighbouring rows become one row each.
//!
//! Everything that needs every row - derived quantities, passes, how worn a tool is - is taken from the whole scene, so
//! an excerpt differs from it only in how finely time is resolved.

use super::Scene;
use crate::statistics::{mean, median};
use std::ops::Range;

/// Neighbouring rows of the whole that are one row of the excerpt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// The rows, at least one.
    pub rows: Range<usize>,
    /// Does it take part in the comparison?
    pub compared: bool,
}

impl Scene {
    /// The scene with one row per block: quantities are means, words and times those of the first row. `blocks` must
    /// follow each other without gaps from the first row to the last, and each must lie within one run and one pass.
    #[must_use]
    pub fn excerpt(&self, blocks: &[Block]) -> Self {
        let mean =
            |values: &[f64]| -> Vec<f64> { blocks.iter().map(|block| mean(&values[block.rows.clone()])).collect() };
        let first = |values: &[f64]| -> Vec<f64> { blocks.iter().map(|block| values[block.rows.start]).collect() };
        let all = |flags: &[bool]| -> Vec<bool> {
            blocks.iter().map(|block| flags[block.rows.clone()].iter().all(|flag| *flag)).collect()
        };
        let usable = all(&self.usable);
        let _ = self.usual_cut();
        let growth = self.feed_load_growth().map(mean);
        Self {
            rows: blocks.len(),
            time_s: first(&self.time_s),
            clock_s: first(&self.clock_s),
            driven_s: Some(self.driven_between(blocks)),
            runs: self.runs.iter().map(|rows| blocks_of(blocks, rows)).collect(),
            run_names: self.run_names.clone(),
            latent: self.latent.iter().map(|(kind, state)| (*kind, mean(state))).collect(),
            period_s: self.period_between(blocks),
            columns: self.columns.iter().map(|(name, values)| (name.clone(), mean(values))).collect(),
            absent: self.absent.iter().map(|(name, absent)| (name.clone(), all(absent))).collect(),
            words: self
                .words
                .iter()
                .map(|(name, words)| (name.clone(), words.at_rows(blocks.iter().map(|block| block.rows.start))))
                .collect(),
            roles: self.roles.clone(),
            output: self.output.clone(),
            recorded: mean(&self.recorded),
            usable: usable.iter().zip(blocks).map(|(usable, block)| *usable && block.compared).collect(),
            passes: self.passes.iter().map(|rows| blocks_of(blocks, rows)).collect(),
            load: self.load.as_deref().map(mean),
            load_at_output: self.load_at_output.as_deref().map(mean),
            simulated: self.simulated.as_deref().map(mean),
            laws: std::cell::RefCell::default(),
            feed_load_growth: std::sync::OnceLock::from(growth),
            usual_cut: self.usual_cut.clone(),
        }
    }

    /// Median time from one compared block to the next.
    fn period_between(&self, blocks: &[Block]) -> f64 {
        let compared = blocks.windows(2).filter(|pair| pair[0].compared && pair[1].compared);
        let steps = compared.map(|pair| self.clock_s[pair[1].rows.start] - self.clock_s[pair[0].rows.start]);
        median(steps.collect()).unwrap_or(self.period_s)
    }

    /// For each block, how long the rows since the block before drove a state.
    fn driven_between(&self, blocks: &[Block]) -> Vec<f64> {
        let between =
            |pair: &[Block]| (pair[0].rows.start + 1..=pair[1].rows.start).map(|row| self.driven_s(row)).sum();
        std::iter::once(0.0).chain(blocks.windows(2).map(between)).collect()
    }
}

/// The blocks that begin within these rows.
#[must_use]
pub fn blocks_of(blocks: &[Block], rows: &Range<usize>) -> Range<usize> {
    let from = |row: usize| blocks.partition_point(|block| block.rows.start < row);
    from(rows.start)..from(rows.end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::state::first_order;
    use adapters::Recording;
    use adapters::recording::{Cells, Numbers};

    /// A spindle that changes speed every 40 s, with a pause of ten minutes in the middle.
    fn scene() -> Scene {
        let time_s: Vec<f64> =
            (0..4000).map(|row| 0.5 * f64::from(row) + if row < 2000 { 0.0 } else { 600.0 }).collect();
        let speed: Vec<f64> = (0..4000).map(|row| 1000.0 * f64::from(1 + (row / 80) % 3)).collect();
        let mut recording = Recording::new("test", time_s, None);
        recording.set_column("spindle_speed_rpm", Cells::Numbers(Numbers::full(speed.clone())));
        recording.set_column("spindle_power_w", Cells::Numbers(Numbers::full(speed)));
        Scene::new(&recording, "spindle_power_w", &Default::default()).expect("a scene")
    }

    /// Single rows up to 400 and from 3000 on, tens between, cut at the pause.
    fn blocks() -> Vec<Block> {
        let size = |row: usize| if (400..3000).contains(&row) { 10 } else { 1 };
        let mut blocks: Vec<Block> = Vec::new();
        let mut row = 0;
        while row < 4000 {
            blocks.push(Block { rows: row..row + size(row), compared: size(row) == 1 });
            row += size(row);
        }
        blocks
    }

    #[test]
    fn a_state_is_carried_through_coarse_rows_and_pauses() {
        let (whole, blocks) = (scene(), blocks());
        let short = whole.excerpt(&blocks);
        let speed = |scene: &Scene| scene.column("spindle_speed_rpm").expect("recorded").to_vec();
        let of_whole = first_order(&whole, &speed(&whole), 120.0);
        let of_short = first_order(&short, &speed(&short), 120.0);
        for (block, state) in blocks.iter().zip(&of_short) {
            let exact = of_whole[block.rows.start];
            assert!((state - exact).abs() < 1.0, "row {}: {state} instead of {exact} rpm", block.rows.start);
        }
    }

    #[test]
    fn only_compared_rows_are_usable_and_runs_keep_their_rows() {
        let (whole, blocks) = (scene(), blocks());
        let short = whole.excerpt(&blocks);
        assert_eq!(short.rows(), 400 + 260 + 1000);
        assert_eq!(short.usable().iter().filter(|usable| **usable).count(), 1400);
        assert!(short.runs().len() == 1 && short.runs()[0] == (0..short.rows()));
        assert!((short.period_s() - 0.5).abs() < 1e-12);
    }
}
