//! Finished parts, from what the controller says: its part counter, or the name of the part where it has no counter.

use super::channels::Channels;
use super::part_detail::{Gathering, name_of};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::{Sample, is_same_text};
use gateway_history::Part;
use rules::estimators::{Estimates, NoEstimate, PartFigures, State};
use std::sync::Arc;

/// Longer steps between two ticks are pauses in which nothing is integrated.
const STEP_MAX_NS: i64 = 2 * SECOND_NS;

/// A meter that is silent for no longer is bridged in the energy by a straight line, s.
const BRIDGED_MAX_S: f64 = 10.0;

/// Follows the cycle in progress.
#[derive(Debug, Clone, Default)]
pub struct CycleFollower {
    count: Option<f64>,
    part: Option<Arc<str>>,
    began_ns: Option<TimeNs>,
    last_ns: Option<TimeNs>,
    cutting_s: f64,
    energy_j: f64,
    energy_known: bool,
    cutting_energy_j: f64,
    idle_s: f64,
    /// The last power, W, and for how long there has been none since, s.
    last_power_w: Option<f64>,
    silent_s: f64,
    /// The program that ran when something was last cut: a controller has often left it when it counts the part.
    program: Option<Arc<str>>,
    gathering: Gathering,
    finished: u64,
    last: Option<PartFigures>,
}

impl CycleFollower {
    /// Parts finished since the start.
    #[must_use]
    pub fn finished_count(&self) -> u64 {
        self.finished
    }

    /// Of the part that was finished last.
    #[must_use]
    pub fn last_figures(&self) -> PartFigures {
        self.last.unwrap_or(PartFigures::without_parts())
    }

    /// Takes one tick; gives the part that it finishes.
    pub fn follow_tick(&mut self, channels: &Channels, sample: &Sample, estimates: &Estimates) -> Option<Part> {
        self.integrate_step(channels, sample, estimates);
        let parts = self.parts_by_count(channels, sample).or_else(|| self.part_by_name(channels, sample));
        self.last_ns = Some(sample.at_ns);
        let began_ns = *self.began_ns.get_or_insert(sample.at_ns);
        let (count, name) = parts?;
        let part = self.close_part(channels, sample, began_ns, count, name);
        Some(part)
    }

    /// The counter rose. A counter that falls was reset and finishes nothing.
    fn parts_by_count(&mut self, channels: &Channels, sample: &Sample) -> Option<(i64, String)> {
        let count = sample.number(channels.part_count).ok()?;
        let before = self.count.replace(count)?;
        let name = sample.text(channels.part).unwrap_or_default().to_owned();
        #[expect(clippy::cast_possible_truncation, reason = "the channel holds at most 1e9")]
        (count > before).then(|| ((count - before).round() as i64, name))
    }

    /// Without a counter, another name of the part means that the one before is finished.
    fn part_by_name(&mut self, channels: &Channels, sample: &Sample) -> Option<(i64, String)> {
        let name = sample.text(channels.part)?;
        if self.part.as_deref() == Some(name) {
            return None;
        }
        let before = self.part.replace(Arc::from(name))?;
        let counted = sample.number(channels.part_count).is_ok();
        (!counted && !before.is_empty()).then(|| (1, before.to_string()))
    }

    fn integrate_step(&mut self, channels: &Channels, sample: &Sample, estimates: &Estimates) {
        let step_ns = self.last_ns.map_or(0, |last_ns| sample.at_ns - last_ns);
        if !(1..=STEP_MAX_NS).contains(&step_ns) {
            return;
        }
        #[expect(clippy::cast_precision_loss, reason = "at most two seconds in ns")]
        let step_s = step_ns as f64 / SECOND_NS as f64;
        if estimates.state == State::Cutting {
            self.cutting_s += step_s;
            let now = name_of(sample, channels.program);
            if now.is_some() && !is_same_text(now, self.program.as_ref()) {
                self.program = now.cloned();
            }
        }
        self.cutting_energy_j += estimates.cutting_power_w.map_or(0.0, |power| power.value * step_s);
        self.idle_s += if estimates.state == State::Idle { step_s } else { 0.0 };
        let power = sample.number(channels.total_power).or_else(|_| sample.number(channels.spindle_power));
        let (tool, operation) = (name_of(sample, channels.tool), name_of(sample, channels.operation));
        self.gathering.add_step(estimates, (tool, operation), power.ok(), step_s);
        match power {
            Ok(power_w) => {
                let bridged_j = self.bridged_j(power_w);
                self.gathering.bridge_energy_gap(operation, (bridged_j, self.silent_s));
                self.energy_j += power_w * step_s + bridged_j;
                (self.energy_known, self.last_power_w, self.silent_s) = (true, Some(power_w), 0.0);
            }
            Err(_) => self.silent_s += step_s,
        }
    }

    /// Energy of the silence that ends with this power, J.
    fn bridged_j(&self, power_w: f64) -> f64 {
        let short = self.silent_s > 0.0 && self.silent_s <= BRIDGED_MAX_S;
        self.last_power_w.filter(|_| short).map_or(0.0, |before_w| 0.5 * (before_w + power_w) * self.silent_s)
    }

    fn close_part(&mut self, channels: &Channels, sample: &Sample, began_ns: TimeNs, count: i64, part: String) -> Part {
        let program = self.program.take().or_else(|| sample.text(channels.program).map(Arc::from));
        let finished = Part {
            began_ns,
            ended_ns: sample.at_ns,
            part,
            program: program.map(|name| name.to_string()).unwrap_or_default(),
            count,
            cutting_s: Some(self.cutting_s),
            energy_j: self.energy_known.then_some(self.energy_j),
            // Numbers and texts only: there is nothing in it that JSON could not hold.
            detail: serde_json::to_string(&self.gathering.finish_part()).unwrap_or_default(),
        };
        debug_assert!(count >= 0, "a part is closed when the counter has risen, or when another part begins");
        self.finished = self.finished.saturating_add(count.unsigned_abs());
        self.last = Some(PartFigures {
            energy_j: if self.energy_known { Ok(self.energy_j) } else { Err(NoEstimate::PowerUnknown) },
            cutting_energy_j: Ok(self.cutting_energy_j),
            idle_s: Ok(self.idle_s),
        });
        (self.began_ns, self.cutting_s, self.energy_j, self.energy_known) = (Some(sample.at_ns), 0.0, 0.0, false);
        (self.cutting_energy_j, self.idle_s) = (0.0, 0.0);
        finished
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::{Absence, ChannelId, Slot, Value};

    fn sample(at_s: i64, count: Result<f64, Absence>, part: &str) -> Sample {
        let mut sample = Sample::new_empty(at_s * SECOND_NS);
        let mut set =
            |name: &str, value| sample.set_slot(ChannelId::from_name(name).expect(name), Slot { value, age_ns: 0 });
        set("part_count", count.map(Value::Number));
        set("part", Ok(Value::Text(part.into())));
        set("total_power_w", Ok(Value::Number(100.0)));
        sample
    }

    fn in_state(state: State) -> Estimates {
        Estimates { state, ..Estimates::without_samples(0) }
    }

    #[test]
    fn the_counter_finishes_parts_and_a_reset_does_not() {
        let (channels, mut parts) = (Channels::new(), CycleFollower::default());
        let mut step =
            |at_s, count| parts.follow_tick(&channels, &sample(at_s, Ok(count), "A"), &in_state(State::Cutting));
        assert_eq!(step(0, 7.0), None);
        assert_eq!(step(1, 7.0), None);
        let part = step(2, 8.0).expect("finished");
        assert_eq!((part.count, part.cutting_s, part.energy_j), (1, Some(2.0), Some(200.0)));
        assert_eq!((part.began_ns, part.ended_ns), (0, 2 * SECOND_NS));
        assert_eq!(step(3, 0.0), None);
        assert_eq!(step(4, 2.0).expect("two at once").count, 2);
        assert_eq!(parts.finished_count(), 3);
    }

    #[test]
    fn without_a_counter_the_name_tells() {
        let (channels, mut parts) = (Channels::new(), CycleFollower::default());
        let mut step = |at_s, part| {
            parts.follow_tick(&channels, &sample(at_s, Err(Absence::NotProvided), part), &in_state(State::Idle))
        };
        assert_eq!(step(0, "A"), None);
        assert_eq!(step(1, "A"), None);
        assert_eq!(step(2, "B").expect("A is finished").part, "A");
    }
}
