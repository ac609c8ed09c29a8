//! How well a detector sees: share of time right, delay at the edges, bias of the no-load power.
//!
//! Both detectors are judged in the five states of the source: rapid traverse counts as idle, a change of speed counts as
//! a start and is right as either. While an input is missing, unknown is right and so is the true state; off is not.

use rules::estimators::State;

/// One tick as the machine was and as a detector said.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    /// When.
    pub time_s: f64,
    /// As the machine was.
    pub truth: State,
    /// As the detector said.
    pub said: State,
    /// Was an input missing?
    pub missing: bool,
    /// No-load power of the machine.
    pub true_no_load_w: f64,
    /// No-load power that the detector believes.
    pub said_no_load_w: Option<f64>,
}

/// The figures of one or several traces.
#[derive(Debug, Clone, Default)]
pub struct Score {
    ticks: u64,
    right: u64,
    missing: u64,
    missing_right: u64,
    cut: u64,
    cut_right: u64,
    fed_false: u64,
    other: u64,
    delays_s: Vec<f64>,
    missed: u64,
    bias: Vec<f64>,
    no_reference: u64,
}

/// A state of the source.
fn five(state: State) -> State {
    match state {
        State::Rapid => State::Idle,
        State::SpeedChange => State::SpindleStart,
        other => other,
    }
}

impl Score {
    /// Adds a trace.
    pub fn add(&mut self, trace: &[Judged]) {
        trace.iter().for_each(|tick| self.add_tick(tick));
        self.add_edges(trace);
        self.add_bias(trace);
    }

    fn add_tick(&mut self, tick: &Judged) {
        let same = five(tick.truth) == five(tick.said);
        if tick.missing {
            self.missing += 1;
            self.missing_right += u64::from(same || tick.said == State::Unknown);
            return;
        }
        self.ticks += 1;
        self.right += u64::from(same);
        if tick.truth == State::Cutting {
            self.cut += 1;
            self.cut_right += u64::from(same);
        } else {
            self.other += 1;
            self.fed_false += u64::from(tick.said == State::Cutting);
        }
    }

    /// For every true edge: how long until the detector says the new state, or since when it has already said so.
    fn add_edges(&mut self, trace: &[Judged]) {
        for i in 1..trace.len() {
            let (before, now) = (five(trace[i - 1].truth), five(trace[i].truth));
            if before == now || trace[i].missing {
                continue;
            }
            let end = (i + 1..trace.len()).find(|j| five(trace[*j].truth) != now).unwrap_or(trace.len());
            if five(trace[i - 1].said) == now {
                let since = (0..i).rev().take_while(|j| five(trace[*j].said) == now).last().unwrap_or(i);
                self.delays_s.push(trace[i].time_s - trace[since].time_s);
            } else {
                match (i..end).find(|j| five(trace[*j].said) == now) {
                    Some(seen) => self.delays_s.push(trace[seen].time_s - trace[i].time_s),
                    None => self.missed += 1,
                }
            }
        }
    }

    /// The no-load power that a detector believes when a cut begins.
    fn add_bias(&mut self, trace: &[Judged]) {
        for pair in trace.windows(2) {
            let begins = pair[0].truth != State::Cutting && pair[1].truth == State::Cutting;
            if begins && !pair[0].missing && pair[0].true_no_load_w > 0.0 {
                match pair[0].said_no_load_w {
                    Some(said) => self.bias.push(said / pair[0].true_no_load_w - 1.0),
                    None => self.no_reference += 1,
                }
            }
        }
    }

    /// Share of time right while nothing was missing, 0 to 1.
    pub fn right(&self) -> f64 {
        share(self.right, self.ticks)
    }

    /// Share of time right while an input was missing.
    pub fn right_missing(&self) -> f64 {
        share(self.missing_right, self.missing)
    }

    /// Share of the cutting time seen.
    pub fn cut_seen(&self) -> f64 {
        share(self.cut_right, self.cut)
    }

    /// Share of the other time called cutting.
    pub fn false_cut(&self) -> f64 {
        share(self.fed_false, self.other)
    }

    /// Share of cutting seen minus share of other time called cutting: 1 is perfect, 0 is a guess (Youden).
    pub fn judgement(&self) -> f64 {
        self.cut_seen() - self.false_cut()
    }

    /// Time between a true edge and the same edge of the detector, late or early, at this quantile, s.
    pub fn delay_s(&self, quantile: f64) -> f64 {
        at_quantile(&self.delays_s, quantile)
    }

    /// Share of true edges that the detector never followed.
    pub fn missed(&self) -> f64 {
        share(self.missed, self.missed + self.delays_s.len() as u64)
    }

    /// Magnitude of the relative error of the believed no-load power at this quantile.
    pub fn bias(&self, quantile: f64) -> f64 {
        at_quantile(&self.bias.iter().map(|bias| bias.abs()).collect::<Vec<_>>(), quantile)
    }

    /// Share of cuts that began without any no-load power.
    pub fn no_reference(&self) -> f64 {
        share(self.no_reference, self.no_reference + self.bias.len() as u64)
    }
}

fn share(part: u64, whole: u64) -> f64 {
    if whole == 0 { 1.0 } else { part as f64 / whole as f64 }
}

fn at_quantile(values: &[f64], quantile: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    sorted.get((quantile * last as f64).round() as usize).copied().unwrap_or(0.0)
}
