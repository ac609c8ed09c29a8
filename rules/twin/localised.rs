//! Where an empirical form acts: what happens only beyond a value - an overflow, a stop, a drive at its limit - is a line
//! over one end of a channel, with nothing over the rest.
//!
//! A bent line trades its slope with the baseline and so lies everywhere. It gives way to a line over one end of its
//! channel where the recording does not tell the two apart; and further ends, of any channel, are described beside it
//! where something real happens there as well.

use super::channel::channel_values;
use super::designs::Design;
use super::diagnose::Case;
use super::empirical::{Empirical, Multiplier, Shape, as_design, factor_values};
use super::fit::{Fit, fit};
use super::frame::Frame;
use super::model::{Part, PartFunction};
use super::offered::empirical_channels;
use super::scan::{self, HypothesisBank, price};
use super::unknown::{FormFit, NOTHING_NAMED_INFORMATION};
use super::verdicts::CLASS_INFORMATION;
use crate::physics::Scene;
use crate::statistics::count;

/// Shares of the rows, over either end of the channel, at which a line may begin.
const BEGINNINGS: [f64; 10] = [0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5];
/// The same where every channel is tried.
const FEW_BEGINNINGS: [f64; 4] = [0.03, 0.05, 0.1, 0.2];
/// Groups that must lie where it acts.
const GROUPS_MIN: usize = 12;
/// Units of hold-out in which it must act: what was seen once is an event, not a condition.
const VISITS_MIN: usize = 2;
/// Lines over further ends, at most.
const FURTHER_MAX: usize = 2;

/// Lines over either end of every channel, as hypotheses.
pub(super) fn end_designs(scene: &Scene, frame: &Frame) -> Vec<Design> {
    let over = |channel: String| {
        let form =
            Empirical { channel, shape: Shape::Bent(Vec::new()), origin: 0.0, scale: 1.0, factor: Multiplier::Always };
        ends(&form, scene, frame, &FEW_BEGINNINGS)
    };
    empirical_channels(scene).into_iter().flat_map(over).filter_map(|end| as_design(end, scene, frame)).collect()
}

/// Lines over either end of a form's channel, where that was visited often enough.
fn ends(form: &Empirical, scene: &Scene, frame: &Frame, beginnings: &[f64]) -> Vec<Empirical> {
    let (Some(values), Some(factor)) = (channel_values(scene, &form.channel), factor_values(scene, form.factor)) else {
        return Vec::new();
    };
    let (values, factor) = (frame.reduce(&values), frame.reduce(&factor));
    let mut groups: Vec<usize> = (0..values.len()).filter(|group| factor[*group] != 0.0).collect();
    groups.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let (Some(first), Some(last)) = (groups.first(), groups.last()) else { return Vec::new() };
    let (origin, scale) = (values[*first], values[*last] - values[*first]);
    if scale <= 1e-9 * values[*last].abs().max(origin.abs()) {
        return Vec::new();
    }
    let both = beginnings.iter().flat_map(|share| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
        let size = (share * count(groups.len())) as usize;
        let (low, high) = (&groups[..size], &groups[groups.len() - size..]);
        let below = low.last().filter(|_| is_visited(low, frame)).map(|group| Shape::Below(values[*group]));
        let above = high.first().filter(|_| is_visited(high, frame)).map(|group| Shape::Above(values[*group]));
        [below, above]
    });
    let inside = |shape: &Shape| match shape {
        Shape::Below(knot) | Shape::Above(knot) => *knot > values[*first] && *knot < values[*last],
        _ => false,
    };
    both.flatten().filter(inside).map(|shape| Empirical { shape, origin, scale, ..form.clone() }).collect()
}

fn is_visited(groups: &[usize], frame: &Frame) -> bool {
    let mut units: Vec<usize> = groups.iter().map(|group| frame.unit[*group]).collect();
    units.sort_unstable();
    units.dedup();
    groups.len() >= GROUPS_MIN && units.len() >= VISITS_MIN
}

impl Case<'_> {
    /// The form over where it acts, and what happens at other ends beside it; `from` is what it was fitted on top of.
    pub(super) fn localised(&mut self, from: &Fit, whole: FormFit) -> FormFit {
        let form = self.over_one_end(from, whole);
        let form = self.with_further_ends(form);
        self.without_bent_line(from, form)
    }

    /// Ends alone, where the bent line has become superfluous beside them.
    fn without_bent_line(&mut self, from: &Fit, form: FormFit) -> FormFit {
        let first = from.parts.len();
        let bent =
            |part: &Part| matches!(&part.body, PartFunction::Empirical(form) if matches!(form.shape, Shape::Bent(_)));
        if form.fit.parts.len() < first + 2 || !bent(&form.fit.parts[first]) {
            return form;
        }
        let mut parts = form.fit.parts.clone();
        parts.remove(first);
        parts[first].name = None;
        let Some(fit) = self.with_data(|data| fit(data, &parts, form.fit.noise)) else { return form };
        let lost = 2.0 * (form.fit.log_likelihood - fit.log_likelihood) - price(&form.design, self.ln_rows(from));
        if lost > CLASS_INFORMATION {
            return form;
        }
        FormFit { information: form.information - lost, fit, ..form }
    }

    /// What is described, and lines over other ends on top of it that are as good as alarms of their own.
    fn with_further_ends(&mut self, mut form: FormFit) -> FormFit {
        let mut designs = end_designs(&self.scene, &self.frame);
        for number in 2..2 + FURTHER_MAX {
            let name = format!("unknown_{number}");
            designs.iter_mut().for_each(|design| design.part.name = Some(name.clone()));
            let Some(best) = self.likeliest(&form.fit, &designs) else { break };
            let more = self.with_form(&form.fit, &designs[best]);
            let Some(more) = more.filter(|more| more.information > NOTHING_NAMED_INFORMATION) else { break };
            form = FormFit { design: form.design, fit: more.fit, information: form.information + more.information };
        }
        form
    }

    /// A line over one end of the form's channel instead of a bent one, where it explains as much.
    fn over_one_end(&mut self, from: &Fit, whole: FormFit) -> FormFit {
        let PartFunction::Empirical(form) = &whole.design.part.body else { return whole };
        if !matches!(form.shape, Shape::Bent(_)) {
            return whole;
        }
        let ends = ends(form, &self.scene, &self.frame, &BEGINNINGS);
        let designs: Vec<Design> =
            ends.into_iter().filter_map(|end| as_design(end, &self.scene, &self.frame)).collect();
        let Some(best) = self.likeliest(from, &designs) else { return whole };
        let fitted = self.with_form(from, &designs[best]);
        fitted.filter(|end| end.information + CLASS_INFORMATION > whole.information).unwrap_or(whole)
    }

    /// The design that explains most on top of a fit.
    fn likeliest(&self, from: &Fit, designs: &[Design]) -> Option<usize> {
        let scores = HypothesisBank::new(designs, &self.frame).scan(from, self.ln_rows(from));
        scan::likeliest(&scores).map(|score| score.design)
    }
}

#[cfg(test)]
mod tests {
    use crate::twin::overflowing_tank;

    #[test]
    fn what_happens_beyond_a_level_is_located_there() {
        let level = |row: u32| 6.0 + 4.0 * (f64::from(row) / 61.0).sin();
        let (recording, found) = overflowing_tank::diagnosed(1500, level, |level| 4.0 * (level - 9.4).max(0.0));
        assert_eq!((found.verdict.word(), found.missing[0].effect.as_str()), ("unexplained", "unknown"));
        let level = found.rows.effects[0].1.iter().zip(recording.numbers("level_v").expect("recorded").iter());
        let acts: Vec<f64> = level.filter(|(effect, _)| effect.abs() > 0.02).filter_map(|(_, level)| level).collect();
        let low = acts.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(!acts.is_empty() && low > 9.0, "acts from {low}: {}", found.missing[0].equation);
    }
}
