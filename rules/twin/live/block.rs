//! Seconds of settled work, gathered into blocks of one kind of work each.

use super::learn::WorkBlock;
use super::regime::Regime;
use numerics::statistics::count_to_f64;
use std::collections::BTreeMap;

/// Seconds in a block: the threshold of the chart is reckoned for blocks of half a minute.
pub const BLOCK_SECONDS: usize = 30;
/// Seconds older than this are no longer put together with new ones.
const OLDEST_S: f64 = 3600.0;
/// Seconds at each end of the sorted residuals that are left out of the mean: pulses and moments of transition.
const TRIMMED: usize = 3;

/// One second of settled work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettledSecond {
    /// Time of the second, s.
    pub at_s: f64,
    /// What the model gives, in the unit of the output.
    pub expected: f64,
    /// Recorded minus simulated, in the unit of the output.
    pub residual: f64,
}

/// Seconds that do not make a block yet, by regime and work.
#[derive(Debug, Clone, Default)]
pub struct Gathering {
    open_blocks: BTreeMap<(Regime, usize), Vec<SettledSecond>>,
}

impl Gathering {
    /// Takes a second; gives the block that it completes.
    pub fn add_second(&mut self, regime: Regime, work: usize, second: SettledSecond) -> Option<WorkBlock> {
        let open = self.open_blocks.entry((regime, work)).or_default();
        open.retain(|kept| second.at_s - kept.at_s <= OLDEST_S);
        open.push(second);
        if open.len() < BLOCK_SECONDS {
            return None;
        }
        let seconds = std::mem::take(open);
        let mut residuals: Vec<f64> = seconds.iter().map(|second| second.residual).collect();
        residuals.sort_by(f64::total_cmp);
        let inner = &residuals[TRIMMED..BLOCK_SECONDS - TRIMMED];
        let (first, last) = (seconds.first()?, seconds.last()?);
        Some(WorkBlock {
            from_s: first.at_s,
            to_s: last.at_s,
            residual: inner.iter().sum::<f64>() / count_to_f64(inner.len()),
            expected: seconds.iter().map(|second| second.expected).sum::<f64>() / count_to_f64(seconds.len()),
            work,
        })
    }
}
