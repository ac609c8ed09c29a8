//! Notices when machine and simulation begin to differ: learns what is usual, then holds every block against it.

use super::block::{Gathering, SettledSecond};
use super::control_chart::{Chart, LevelChange};
use super::learn::{Learned, Usual, WORK_BLOCKS, WorkBlock, learn_regime};
use super::regime::{Regime, Settling};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Blocks from which a regime is learned, at least.
const LEARN_BLOCKS: usize = 100;
/// Compared seconds before anything is learned: parts, lots and the warm-up must have been seen.
const LEARN_S: f64 = 6.0 * 3600.0;
/// Blocks kept while learning; beyond, what there is must do.
const BLOCKS_MAX: usize = 4000;
/// Kinds of work told apart; the rest is one.
const WORKS_MAX: usize = 128;
/// A mean difference beyond this share of the output is a difference from the beginning.
const BIAS_SHARE: f64 = 0.05;

/// Something that has been noticed.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// What is usual has been learned; from now on it is watched.
    Learned(Regime),
    /// Machine and simulation begin to differ.
    Begins(Mismatch),
    /// Machine and simulation agree again.
    Ends(Regime),
}

/// A difference between machine and simulation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Mismatch {
    /// The kind of work in which they differ.
    pub regime: Regime,
    /// Since when; `None`: ever since the comparison began.
    pub onset: Option<LevelChange>,
    /// Mean difference in the unit of the output.
    pub mean: f64,
    /// Mean simulated output in this regime.
    pub expected: f64,
}

impl Mismatch {
    /// Difference over simulated output, %; `None` where nothing is simulated.
    #[must_use]
    pub fn difference_percent(&self) -> Option<f64> {
        (self.expected.abs() > 1e-9).then(|| 100.0 * self.mean / self.expected.abs())
    }
}

/// What a regime is at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RegimeStage {
    /// Learning: blocks so far, and blocks that are needed.
    Learning(usize, usize),
    /// Watching: differences up to this size, in the unit of the output, are usual.
    Watching(f64),
    /// Machine and simulation differ, as told.
    Differing(Mismatch),
}

/// What is remembered across a restart.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WatchState {
    works: Vec<String>,
    compared_s: f64,
    regimes: Vec<(Regime, RegimeMemory)>,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct RegimeMemory {
    blocks: Vec<WorkBlock>,
    learned: Option<Learned>,
    differing: Option<Mismatch>,
}

#[derive(Debug, Clone, Default)]
struct Watched {
    /// While learning; afterwards blocks of work that is new.
    blocks: Vec<WorkBlock>,
    learned: Option<Learned>,
    chart: Option<Chart>,
    mismatch: Option<Mismatch>,
}

/// Learns what is usual in each regime, then watches it.
#[derive(Debug, Clone)]
pub struct Watch {
    settling: Settling<SettledSecond>,
    gathering: Gathering,
    works: Vec<String>,
    compared_s: f64,
    regimes: BTreeMap<Regime, Watched>,
}

impl Default for Watch {
    fn default() -> Self {
        Self::new(WatchState::default())
    }
}

impl Watch {
    /// Goes on from what was learned before.
    #[must_use]
    pub fn new(memory: WatchState) -> Self {
        let regimes = memory.regimes.into_iter().map(|(regime, before)| (regime, Watched::from_memory(before)));
        Self {
            settling: Settling::new(),
            gathering: Gathering::default(),
            works: memory.works,
            compared_s: memory.compared_s,
            regimes: regimes.collect(),
        }
    }

    /// What to remember across a restart.
    #[must_use]
    pub fn to_state(&self) -> WatchState {
        let of = |(regime, watched): (&Regime, &Watched)| {
            let Watched { blocks, learned, mismatch: differing, .. } = watched.clone();
            (*regime, RegimeMemory { blocks, learned, differing })
        };
        WatchState {
            works: self.works.clone(),
            compared_s: self.compared_s,
            regimes: self.regimes.iter().map(of).collect(),
        }
    }

    /// Every regime that has been seen, with its stage.
    pub fn list_stages(&self) -> impl Iterator<Item = (Regime, RegimeStage)> {
        self.regimes.iter().map(|(regime, watched)| (*regime, watched.stage()))
    }

    /// Takes a second without a comparison: absent inputs, machine off.
    pub fn skip_second(&mut self) {
        self.settling.reset_stretch();
    }

    /// Takes a second with what the machine does and its speed.
    pub fn update_with_second(
        &mut self,
        what: Option<(Regime, String)>,
        speed: f64,
        second: SettledSecond,
    ) -> Option<Notice> {
        self.compared_s += 1.0;
        let (regime, work, second) = self.settling.add_second(what, speed, second)?;
        let work = self.find_work_number(work);
        let block = self.gathering.add_second(regime, work, second)?;
        let may_learn = self.compared_s >= LEARN_S;
        self.regimes.entry(regime).or_default().update_with_block(regime, block, may_learn)
    }

    fn find_work_number(&mut self, work: String) -> usize {
        if let Some(number) = self.works.iter().position(|known| *known == work) {
            return number;
        }
        if self.works.len() < WORKS_MAX {
            self.works.push(work);
        }
        self.works.len() - 1
    }
}

impl Watched {
    fn from_memory(memory: RegimeMemory) -> Self {
        let chart = memory.learned.as_ref().map(|learned| Chart::new(learned.healthy));
        Self { blocks: memory.blocks, learned: memory.learned, chart, mismatch: memory.differing }
    }

    fn stage(&self) -> RegimeStage {
        match (&self.mismatch, &self.learned) {
            (Some(mismatch), _) => RegimeStage::Differing(*mismatch),
            (None, Some(learned)) => RegimeStage::Watching(learned.healthy.band),
            (None, None) => RegimeStage::Learning(self.blocks.len(), LEARN_BLOCKS),
        }
    }

    fn update_with_block(&mut self, regime: Regime, block: WorkBlock, may_learn: bool) -> Option<Notice> {
        if self.learned.is_none() {
            self.blocks.push(block);
            let enough = self.blocks.len() >= LEARN_BLOCKS && may_learn || self.blocks.len() >= BLOCKS_MAX;
            let surplus = self.blocks.len().saturating_sub(BLOCKS_MAX);
            self.blocks.drain(..surplus);
            return if enough { self.finish_learning(regime) } else { None };
        }
        let point = match self.learned.as_ref().and_then(|learned| learned.standardise_block(&block)) {
            Some(point) => point,
            None => return self.learn_work(block),
        };
        let chart = self.chart.as_mut()?;
        let found = chart.update_with_point(point);
        match (&self.mismatch, found) {
            (None, Some(onset)) => Some(self.begin_mismatch(regime, onset)),
            (Some(Mismatch { onset: Some(_), .. }), _) if chart.has_recovered() => self.end_mismatch(regime),
            _ => None,
        }
    }

    fn finish_learning(&mut self, regime: Regime) -> Option<Notice> {
        let learned = learn_regime(&self.blocks)?;
        self.blocks.clear();
        self.chart = Some(Chart::new(learned.healthy));
        let (bias, expected) = (learned.bias, learned.expected);
        let apart = bias.abs() > (BIAS_SHARE * expected.abs()).max(learned.healthy.band);
        self.learned = Some(learned);
        if !apart {
            return Some(Notice::Learned(regime));
        }
        let mismatch = Mismatch { regime, onset: None, mean: bias, expected };
        self.mismatch = Some(mismatch);
        Some(Notice::Begins(mismatch))
    }

    /// New work first shows what is usual for it, less what differs at the time.
    fn learn_work(&mut self, block: WorkBlock) -> Option<Notice> {
        let work = block.work;
        self.blocks.push(block);
        let of_work = || self.blocks.iter().filter(|block| block.work == work);
        if of_work().count() < 2 * WORK_BLOCKS {
            return None;
        }
        let differs = self.mismatch.filter(|mismatch| mismatch.onset.is_some()).map_or(0.0, |mismatch| mismatch.mean);
        let mean =
            of_work().map(|block| block.residual).sum::<f64>() / numerics::statistics::count_to_f64(2 * WORK_BLOCKS);
        self.blocks.retain(|block| block.work != work);
        if let Some(learned) = &mut self.learned {
            let sd = learned.shared;
            learned.usual.insert(work, Usual { mean: mean - differs, sd });
        }
        None
    }

    fn begin_mismatch(&mut self, regime: Regime, onset: LevelChange) -> Notice {
        let mismatch = Mismatch { regime, onset: Some(onset), mean: onset.mean, expected: onset.expected };
        self.mismatch = Some(mismatch);
        Notice::Begins(mismatch)
    }

    fn end_mismatch(&mut self, regime: Regime) -> Option<Notice> {
        self.mismatch = None;
        self.chart = self.learned.as_ref().map(|learned| Chart::new(learned.healthy));
        Some(Notice::Ends(regime))
    }
}
