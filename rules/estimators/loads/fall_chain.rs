//! The level of one tool in one part, half a second after the other, and the step that explains it best.

/// Moments within this time share their noise, because the power is filtered: they make one entry, s.
const ENTRY_S: f64 = 0.5;
/// Both sides of a step are at least so long, s.
const SIDE_S: f64 = 2.0;
/// Entries that are kept; beyond, two become one.
const ENTRIES_MAX: usize = 512;

/// A mean over some time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Mean {
    pub(super) value: f64,
    pub(super) seconds: f64,
}

impl Mean {
    pub(super) fn add(&mut self, value: f64, seconds: f64) {
        self.seconds += seconds;
        self.value += (value - self.value) * seconds / self.seconds;
    }
}

/// A step from one level to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LevelStep {
    pub(super) before: f64,
    pub(super) after: f64,
    /// Its size times `sqrt(n1 n2 / (n1 + n2))`, with times in seconds.
    pub(super) statistic: f64,
}

impl LevelStep {
    pub(super) fn size(&self) -> f64 {
        (self.before - self.after).abs()
    }

    /// Does the lower side lie below zero, rather than the upper one above it?
    fn is_fall(&self) -> bool {
        self.before.min(self.after) <= -0.5 * self.size()
    }
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct ChangeChain {
    entries: Vec<Mean>,
    /// The entry that gathers, and the one before it, which counts once this one is whole: the end of a cut is not one of the cut.
    gathering: Mean,
    waiting: Option<Mean>,
}

impl ChangeChain {
    /// Takes a moment; true when another entry counts.
    pub(super) fn add_moment(&mut self, value: f64, seconds: f64) -> bool {
        self.gathering.add(value, seconds);
        if self.gathering.seconds < ENTRY_S - 1e-9 {
            return false;
        }
        let Some(counts) = self.waiting.replace(std::mem::take(&mut self.gathering)) else { return false };
        if self.entries.len() >= ENTRIES_MAX {
            self.join_pairs();
        }
        self.entries.push(counts);
        true
    }

    pub(super) fn drop_newest(&mut self) {
        (self.gathering, self.waiting) = (Mean::default(), None);
    }

    /// The mean of all entries.
    pub(super) fn level(&self) -> Mean {
        self.entries.iter().fold(Mean::default(), |mut mean, entry| {
            mean.add(entry.value, entry.seconds);
            mean
        })
    }

    /// The step that explains the entries best, of those whose one side has fallen; `None` where they are too few.
    pub(super) fn greatest_fall(&self) -> Option<LevelStep> {
        self.steps().filter(LevelStep::is_fall).max_by(|a, b| a.statistic.total_cmp(&b.statistic))
    }

    /// The greatest statistic of any step; `None` where the entries are too few.
    pub(super) fn greatest_step(&self) -> Option<f64> {
        self.steps().map(|step| step.statistic).reduce(f64::max)
    }

    fn steps(&self) -> impl Iterator<Item = LevelStep> + '_ {
        let whole = self.level();
        let mut before = Mean::default();
        self.entries.iter().filter_map(move |entry| {
            before.add(entry.value, entry.seconds);
            let after_s = whole.seconds - before.seconds;
            if before.seconds < SIDE_S - 1e-9 || after_s < SIDE_S - 1e-9 {
                return None;
            }
            let after = (whole.value * whole.seconds - before.value * before.seconds) / after_s;
            let weight = (before.seconds * after_s / whole.seconds).sqrt();
            Some(LevelStep { before: before.value, after, statistic: (before.value - after).abs() * weight })
        })
    }

    fn join_pairs(&mut self) {
        self.entries = self
            .entries
            .chunks(2)
            .map(|pair| {
                let mut joint = Mean::default();
                pair.iter().for_each(|entry| joint.add(entry.value, entry.seconds));
                joint
            })
            .collect();
    }
}
