//! Hypotheses whose state nobody records: it is read from what the baseline leaves where rows are fitted, and followed
//! from earlier rows in held-out runs.

use super::designs::{AT_EDGES, Design};
use super::diagnose::Case;
use super::fit::{Fit, residual};
use super::frame::Frame;
use super::latent::{self, Switching};
use super::linear::dot;
use super::model::simulate;
use super::noise::Arma;
use super::rhythm::{self, OnOffSpell};
use super::ripple;
use super::search::Hypothesis;
use super::wave::{self, Wave};
use crate::physics::drive::is_axis_output;
use crate::physics::{Form, OutputKind, Role};
use crate::statistics::{count, median};
use std::ops::Range;

/// A switching so near to a change of pace is at it, s and in fitted rows: a spindle takes its time, and so does a meter.
const AT_A_CHANGE_S: f64 = 3.0;
/// See [`AT_A_CHANGE_S`].
const AT_A_CHANGE_GROUPS: usize = 2;
/// Rows of a spell in the cut from which a frequency can be read.
const SPELL_ROWS_MIN: usize = 8;

/// Standard errors by which a followed wave must leave less of held-out runs.
const CARRIED: f64 = 1.0;

/// Finds a switch in a residual of this noise.
type Finder = fn(&[f64], &Frame, Arma) -> Option<Switching>;

/// A wave whose size and phase nobody records.
pub(super) struct FollowedWave {
    /// The kind of effect.
    pub(super) kind: &'static str,
    /// Its value in every row: as found where the rows were fitted, expected from earlier rows in those held out.
    pub(super) values: Vec<f64>,
    /// Logarithm of the choices that it seems to have had ([`Case::seeming_choices`]).
    pub(super) ln_choices: f64,
}

impl Case<'_> {
    /// A consumer that goes on and off unseen, as a hypothesis, where what the baseline leaves has two levels.
    pub(super) fn hidden_switch(&mut self, base: &Fit) -> Option<Design> {
        self.hidden_consumer(base, latent::find_alone)
    }

    /// A consumer as this finds it in what a fit leaves, if it goes on and off by itself.
    fn hidden_consumer(&mut self, base: &Fit, find: Finder) -> Option<Design> {
        let effect = crate::physics::effect("auxiliary_switch")?;
        if !self.electric() || !super::designs::wanted(effect, self.model) {
            return None;
        }
        let found = find(&base.residual, &self.frame, base.noise)?;
        let (since_change, cut) = self.pace_of_groups();
        let by_itself = found.by_itself(&since_change, &cut)
            && self.repeated_of_groups(&cut).iter().all(|channel| !found.follows(channel));
        let acts = found.stays()
            && by_itself
            && found.steps(&base.residual, &self.frame)
            && found.is_flat(&base.residual, &self.frame);
        if !acts {
            return None;
        }
        let state = self.switch_per_row(&found);
        self.scene.set_latent("auxiliary_switch", state);
        self.switching = Some(found.clone());
        let form = Form { name: "latent", ln_choices: 0.5 * found.price, ..Form::default() };
        let design = super::designs::design(effect, &form, &self.scene, &self.frame)?;
        Some(Design { noise: Some(found.noise), ..design })
    }

    /// Looks for the switch again beside what was found, which may have covered it; says whether there is one, and then
    /// puts it into the place of one that showed before. Not for the ripple: a wave that is followed row by row explains
    /// a little of everything, and what it seems to gain beside others is no gain. Not beside what acts at edges either:
    /// what a late clock leaves of every edge goes on and off with it.
    pub(super) fn shows_switch_beside(&mut self, best: &Hypothesis, designs: &mut Vec<Design>) -> bool {
        let covered = |kind: &str| kind == "auxiliary_switch" || AT_EDGES.contains(&kind);
        let named = best.members.iter().any(|member| covered(&designs[*member].kind));
        if named || best.members.is_empty() || simulate(&best.fit.parts, &mut self.scene).is_none() {
            return false;
        }
        let Some(switch) = self.hidden_consumer(&best.fit, latent::find) else { return false };
        designs.retain(|other| !(other.kind == switch.kind && is_latent(other)));
        designs.push(switch);
        true
    }

    /// Is every row fitted by itself? Averaged rows have neither phase nor edge any more.
    pub(super) fn is_row_by_row(&self) -> bool {
        (0..self.frame.len()).all(|group| self.frame.rows(group).len() == 1)
    }

    /// Is the output what a meter in the supply shows? Consumers and the mains' ripple are nowhere else, and not in the
    /// current of a feed drive.
    pub(super) fn electric(&self) -> bool {
        let metered = self.scene.output_kind() == OutputKind::Power || self.scene.output().ends_with("_a");
        metered && !is_axis_output(&self.scene)
    }

    /// Of each group that is fitted: how many groups after (or, less than none, before) a change of pace nearby it is, and
    /// does the machine cut there?
    fn pace_of_groups(&self) -> (Vec<Option<isize>>, Vec<bool>) {
        let row = |group: usize| self.frame.rows(group).start;
        let paces = [self.scene.role(Role::Speed), self.scene.column("feed_mm_min"), self.scene.role(Role::Engaged)];
        let paces: Vec<&[f64]> = paces.into_iter().flatten().collect();
        let differ = |a: f64, b: f64| (a - b).abs() > 0.02 * a.abs().max(b.abs());
        let group_s = self.scene.period_s() * count(self.frame.rows(0).len());
        let nearby = AT_A_CHANGE_GROUPS.max((AT_A_CHANGE_S / group_s).ceil().min(1e6) as usize) as isize;
        let changes = |group: &usize| paces.iter().any(|pace| differ(pace[row(group - 1)], pace[row(*group)]));
        let changes: Vec<isize> = (1..self.frame.len()).filter(changes).map(|group| group as isize).collect();
        let since_change = |group: usize| {
            let group = group as isize;
            let next = changes.partition_point(|change| *change <= group);
            let beside = changes[next.saturating_sub(1)..(next + 1).min(changes.len())].iter();
            beside.map(|change| group - change).min_by_key(|rows| rows.abs()).filter(|rows| rows.abs() <= nearby)
        };
        let engaged = self.scene.role(Role::Engaged);
        let cut = |group: usize| engaged.is_some_and(|engaged| engaged[row(group)] > 0.5);
        let groups = 0..self.frame.len();
        (groups.clone().map(since_change).collect(), groups.map(cut).collect())
    }

    /// Of each group in the cut: what the process goes through again and again.
    fn repeated_of_groups(&self, cut: &[bool]) -> Vec<Vec<Option<f64>>> {
        let in_cut = |values: &[f64]| {
            let of = |(group, cut): (usize, &bool)| cut.then(|| values[self.frame.rows(group).start]);
            cut.iter().enumerate().map(of).collect()
        };
        let time_in_cut = super::channel::channel_values(&self.scene, super::channel::TIME_IN_CUT);
        let position = self.scene.role(Role::Position).map(std::borrow::Cow::Borrowed);
        [position, time_in_cut].into_iter().flatten().map(|values| in_cut(&values)).collect()
    }

    /// The ripple of the mains folded by sampling, as a hypothesis, where what the baseline leaves has a wandering line.
    pub(super) fn hidden_ripple(&mut self, base: &Fit) -> Option<Design> {
        let effect = crate::physics::effect("ripple_alias")?;
        if !self.electric() || !self.is_row_by_row() || !super::designs::wanted(effect, self.model) {
            return None;
        }
        let found = ripple::find(&base.residual, &self.frame.stretches, base.noise)?;
        if !self.flows_through(&base.residual, &found.wave) {
            return None;
        }
        let runs_through = self.in_step_with_the_cut(&found.values) < ripple::IN_STEP;
        if !runs_through || !self.keeps_its_frequency(&base.residual, &found.wave) {
            return None;
        }
        let wave = self.state_per_row(&found.values, |_, left| wave::follow(left, &found.wave));
        if !self.carries_over(&wave) {
            return None;
        }
        self.scene.set_latent("ripple_alias", wave);
        let information = found.gain - ripple::price(self.frame.len());
        let (ln_choices, noise) = self.seeming_choices(base, &found.values, found.wave.noise, information);
        let shape = vec![("frequency_hz", found.wave.frequency / self.scene.period_s())];
        let form = Form { name: "latent", ln_choices, shape, ..Form::default() };
        let mut design = super::designs::design(effect, &form, &self.scene, &self.frame)?;
        design.freedom = 1;
        design.noise = Some(noise);
        for parameter in design.part.parameters.iter_mut().filter(|parameter| parameter.name == "frequency_hz") {
            parameter.fixed = true;
        }
        self.ripple = Some(found);
        Some(design)
    }

    /// Waves that the baseline leaves: the ripple of the mains and run-out, followed over every row.
    pub(super) fn followed_waves(&mut self) -> Vec<FollowedWave> {
        let Some(base) = self.fit_baseline() else { return Vec::new() };
        self.simulate_baseline(&base);
        let designs = [self.hidden_ripple(&base), self.hidden_tone(&base)].into_iter().flatten();
        let wave = |design: Design| {
            let kind = crate::physics::effect(&design.kind)?.doc().kind;
            Some(FollowedWave { kind, values: self.scene.latent(kind)?.to_vec(), ln_choices: design.ln_choices })
        };
        designs.filter_map(wave).collect()
    }

    /// Logarithm of the choices that a state seems to have had, which is read from the residual that it explains: what it
    /// gains there beyond the information of its likelihood is no gain. And the noise beside it, looked for from `start`.
    pub(super) fn seeming_choices(&self, base: &Fit, state: &[f64], start: Arma, information: f64) -> (f64, Arma) {
        let left: Vec<f64> = base.residual.iter().zip(state).map(|(x, state)| x - state).collect();
        let (likelihood, noise) = super::noise::fit_near(&left, &self.frame, start);
        ((likelihood - base.log_likelihood - 0.5 * information).max(0.0), noise)
    }

    /// Follows what an excerpt has shown of hidden states through the whole recording.
    pub(super) fn show_hidden(&mut self, base: &Fit) {
        let Some(whole) = &mut self.whole else { return };
        if self.ripple.is_none() && self.switching.is_none() && self.tone.is_none() {
            return;
        }
        let Some(residual) = whole.with_data(|data| residual(data, &base.parts)) else { return };
        if let Some(found) = &self.switching {
            let found = latent::again(&residual, &whole.frame, found);
            let state = whole.switch_per_row(&found);
            whole.scene.set_latent("auxiliary_switch", state);
        }
        if let Some(found) = &self.ripple {
            let values = wave::smoothed(&residual, &whole.frame.stretches, &found.wave);
            let state = whole.state_per_row(&values, |_, left| wave::follow(left, &found.wave));
            whole.scene.set_latent("ripple_alias", state);
        }
        if let Some(found) = &self.tone {
            whole.show_tone(&residual, found);
        }
    }

    /// Does a wave that is followed from earlier rows leave less of the held-out runs than there was, by more than chance?
    pub(super) fn carries_over(&self, wave: &[f64]) -> bool {
        let simulated = self.scene.simulated().unwrap_or_default();
        let held = self.held_frame.stretches.iter().flat_map(Clone::clone);
        let less = |row: usize| {
            let left = self.scene.recorded()[row] - simulated[row];
            left * left - (left - wave[row]) * (left - wave[row])
        };
        let less: Vec<f64> = held.flat_map(|group| self.held_frame.rows(group)).map(less).collect();
        less.is_empty() || less.iter().sum::<f64>() > CARRIED * dot(&less, &less).sqrt()
    }

    /// Is the frequency the same at slow and at fast feed, and at slow and at fast speed? The clock's is; that of a
    /// screw, an insert or the work is not.
    fn keeps_its_frequency(&self, residual: &[f64], wave: &Wave) -> bool {
        let paces = [self.scene.column("feed_mm_min"), self.scene.role(Role::Speed)];
        paces.into_iter().flatten().all(|pace| {
            let spells = self.spells_in_the_cut(pace);
            let paces: Vec<f64> = spells.iter().map(|(_, pace)| *pace).collect();
            let Some(middle) = median(paces) else { return true };
            let part = |fast: bool| -> Vec<Range<usize>> {
                let wanted = |(_, pace): &&(Range<usize>, f64)| {
                    if fast { *pace > 1.1 * middle } else { *pace <= 0.9 * middle }
                };
                spells.iter().filter(wanted).map(|(groups, _)| groups.clone()).collect()
            };
            let (slow, fast) = (part(false), part(true));
            ripple::same_frequency(residual, &slow, &fast, wave)
        })
    }

    /// See [`ripple::in_step`]: of the passes of each tool.
    fn in_step_with_the_cut(&self, values: &[f64]) -> f64 {
        let mut wave = vec![None; self.scene.rows()];
        values.iter().enumerate().for_each(|(group, value)| wave[self.frame.rows(group).start] = Some(*value));
        let tools = self.scene.words("tool");
        let tool = |row: usize| tools.and_then(|tools| tools.get(row)).unwrap_or_default();
        ripple::in_step(self.scene.passes().iter().map(|pass| (tool(pass.start), &wave[pass.clone()])))
    }

    /// Is it there whether coolant flows or not? The mains do not know; what churns with the pump is gone without it.
    fn flows_through(&self, residual: &[f64], wave: &Wave) -> bool {
        let Some(coolant) = self.scene.column("coolant_on") else { return true };
        let on: Vec<f64> = (0..self.frame.len()).map(|group| coolant[self.frame.rows(group).start].round()).collect();
        let spells = self.frame.stretches.iter().flat_map(|stretch| rhythm::spells(&on, stretch));
        let (on, off): (Vec<OnOffSpell>, Vec<OnOffSpell>) = spells.partition(|spell| spell.on);
        [on, off].into_iter().all(|spells| {
            let spells: Vec<Range<usize>> = spells.into_iter().map(|spell| spell.rows).collect();
            !ripple::is_absent(residual, &spells, wave)
        })
    }

    /// Stretches of the cut at one pace, with that pace.
    fn spells_in_the_cut(&self, pace: &[f64]) -> Vec<(Range<usize>, f64)> {
        let engaged = self.scene.role(Role::Engaged);
        let cutting = |group: usize| self.frame.rows(group).all(|row| engaged.is_none_or(|e| e[row] > 0.5));
        let of = |group: usize| pace[self.frame.rows(group).start];
        let mut spells: Vec<(Range<usize>, f64)> = Vec::new();
        for stretch in &self.frame.stretches {
            for group in stretch.clone().filter(|group| cutting(*group)) {
                match spells.last_mut() {
                    Some((rows, pace))
                        if rows.end == group
                            && group > stretch.start
                            && (of(group) - *pace).abs() < 0.05 * pace.abs() =>
                    {
                        rows.end = group + 1;
                    }
                    _ => spells.push((group..group + 1, of(group))),
                }
            }
        }
        spells.retain(|(rows, _)| rows.len() >= SPELL_ROWS_MIN);
        spells
    }

    /// A hidden state in every row: as found where the rows were fitted; followed group by group, from earlier ones only,
    /// in held-out runs, of which `follow` is given the groups of a stretch and what the model leaves in each.
    pub(super) fn state_per_row(&self, found: &[f64], follow: impl Fn(&Range<usize>, &[f64]) -> Vec<f64>) -> Vec<f64> {
        let mut state = self.frame.spread(found, self.scene.rows());
        let simulated = self.scene.simulated().unwrap_or_default();
        let left: Vec<f64> = self.scene.recorded().iter().zip(simulated).map(|(x, simulated)| x - simulated).collect();
        let left = self.held_frame.reduce(&left);
        for groups in &self.held_frame.stretches {
            let followed = follow(groups, &left[groups.clone()]);
            groups.clone().zip(followed).for_each(|(group, value)| state[self.held_frame.rows(group)].fill(value));
        }
        state
    }

    /// The state of a hidden switch in every row.
    fn switch_per_row(&self, found: &Switching) -> Vec<f64> {
        let share_on = found.state.iter().sum::<f64>() / count(found.state.len());
        self.state_per_row(&found.state, |_, left| latent::follow(left, found, share_on))
    }
}

/// Is its state read from a residual?
fn is_latent(design: &Design) -> bool {
    design.part.has_form("latent")
}
