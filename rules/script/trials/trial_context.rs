//! What a trial is played on: one script, what it sees, and a clock of its own.

use crate::decision::{Alarm, Axis, Decision, Stop};
use crate::problem::ScriptProblem;
use crate::quantities::QUANTITIES;
use crate::script_set::{Script, ScriptSet};
use crate::settings::merge_settings;
use crate::status::ScriptCondition;
use crate::vocabulary::{find_word, list_words};
use crate::{Host, WordKind};
use adapter_core::channel::find_nearest_name;
use adapter_core::channel::quantity::space_unit;
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::{Absence, ChannelId, Sample, Slot, Value};
use estimators::loads::{Figure, LoadEstimator};
use estimators::{Estimate, Estimated, Estimates, NoEstimate, NoLoadOrigin, State};
use rhai::{Dynamic, ImmutableString};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A word for an inferred text that a trial does not take.
#[derive(Debug)]
struct UnknownWord {
    name: &'static str,
    word: String,
    /// Those that it takes.
    words: Vec<&'static str>,
}

impl std::error::Error for UnknownWord {}

impl fmt::Display for UnknownWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = \"{}\": in a trial it is one of {}", self.name, self.word, self.words.join(", "))
    }
}

/// The one of `known` that has this word.
fn find_by_word<T: Copy>(
    name: &'static str,
    value: &Dynamic,
    known: &[T],
    as_word: fn(T) -> &'static str,
) -> Result<T, UnknownWord> {
    let word = value.clone().into_immutable_string().unwrap_or_default();
    let found = known.iter().copied().find(|it| as_word(*it) == word.as_str());
    found.ok_or_else(|| UnknownWord {
        name,
        word: word.to_string(),
        words: known.iter().copied().map(as_word).collect(),
    })
}

/// When every trial begins.
const BEGIN_NS: TimeNs = 1_800_000_000 * SECOND_NS;
/// 10 Hz, as the box ticks unless configured.
const STEP_NS: i64 = SECOND_NS / 10;
/// Most ticks of one trial.
const TICKS_MAX: u64 = 100_000;
/// Standard deviation of an estimate that a trial gives without one.
const SD_SHARE: f64 = 0.02;

/// Where the functions of a trial find the stage.
#[derive(Clone, Default)]
pub(super) struct Theatre(Arc<Mutex<TrialContext>>);

impl Theatre {
    pub(super) fn lock(&self) -> MutexGuard<'_, TrialContext> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn open_stage(&self, stage: TrialContext) {
        *self.lock() = stage;
    }

    pub(super) fn close_stage(&self) -> TrialContext {
        std::mem::take(&mut *self.lock())
    }
}

pub(super) struct TrialContext {
    host: Host,
    sample: Sample,
    estimates: Estimates,
    loads: LoadEstimator,
    /// Figures that the trial gives, in the place of those that the estimators would find.
    given: Vec<(&'static str, Figure)>,
    now_ns: TimeNs,
    step_ns: i64,
    ticks: u64,
    /// Stops asked for since time last began to pass.
    stops: Vec<Stop>,
    notes: Vec<Arc<str>>,
    pub(super) met: usize,
    /// The script failed; where and why.
    pub(super) failure: Option<ScriptProblem>,
}

impl Default for TrialContext {
    fn default() -> Self {
        Self {
            host: Host::new(),
            sample: Sample::new_empty(BEGIN_NS),
            estimates: Estimates::without_samples(BEGIN_NS),
            loads: LoadEstimator::default(),
            given: Vec::new(),
            now_ns: BEGIN_NS,
            step_ns: STEP_NS,
            ticks: 0,
            stops: Vec::new(),
            notes: Vec::new(),
            met: 0,
            failure: None,
        }
    }
}

impl TrialContext {
    /// The script alone, with empty memory.
    pub(super) fn new(script: &Arc<Script>) -> Self {
        let mut stage = Self::default();
        let scripts = vec![script.clone()];
        let settings = merge_settings(&scripts, &mut Vec::new());
        stage.host.install_set(ScriptSet { scripts, settings, ..ScriptSet::default() });
        stage
    }

    /// Time since the beginning.
    pub(super) fn passed_s(&self) -> f64 {
        (self.now_ns - BEGIN_NS) as f64 / SECOND_NS as f64
    }

    /// From now on the script sees this.
    pub(super) fn give_value(&mut self, name: &str, value: &Dynamic) -> Result<(), String> {
        if name == "state" {
            return self.give_state(value);
        }
        if matches!(name, "unknown_because" | "no_load_origin") {
            return self.give_inferred_word(name, value).map_err(|refusal| refusal.to_string());
        }
        if let Some(id) = ChannelId::from_name(name) {
            return self.give_channel(id, value);
        }
        if let Some(word) = find_word(name).filter(|word| word.is_figure()) {
            return self.give_figure(word.name, value);
        }
        match QUANTITIES.iter().find(|row| row.1 == name).map(|row| row.0) {
            Some(quantity) => {
                let sd = read_number(value)
                    .filter(|sd| *sd >= 0.0)
                    .ok_or_else(|| format!("{name} needs a number from 0 on"))?;
                let place = quantity_of(&mut self.estimates, quantity).ok_or_else(|| describe_unknown(name))?;
                if let Ok(estimate) = place {
                    estimate.sd = sd;
                }
            }
            None => {
                if self.host.set_channel_value(name, read_number(value)) {
                    return Ok(());
                }
                let place = quantity_of(&mut self.estimates, name).ok_or_else(|| describe_unknown(name))?;
                *place = match read_number(value) {
                    Some(value) => Ok(Estimate { value, sd: SD_SHARE * value.abs() }),
                    None if value.is_unit() => Err(NoEstimate::NotSettled),
                    None => return Err(format!("{name} needs a number, or () for no value")),
                };
            }
        }
        Ok(())
    }

    fn give_figure(&mut self, name: &'static str, value: &Dynamic) -> Result<(), String> {
        let figure = match read_number(value) {
            Some(number) => Ok(number),
            None if value.is_unit() => Err(NoEstimate::NotCutting),
            None => return Err(format!("{name} needs a number, or () for no value")),
        };
        self.given.retain(|(known, _)| *known != name);
        self.given.push((name, figure));
        Ok(())
    }

    fn give_state(&mut self, value: &Dynamic) -> Result<(), String> {
        let word = value.clone().into_immutable_string().unwrap_or_default();
        let Some(state) = State::ALL.into_iter().find(|state| state.as_word() == word.as_str()) else {
            let words = State::ALL.map(State::as_word);
            let near =
                find_nearest_name(&word, words).map(|near| format!("; did you mean \"{near}\"?")).unwrap_or_default();
            return Err(format!("there is no state \"{word}\": it is one of {}{near}", words.join(", ")));
        };
        if state != self.estimates.state {
            (self.estimates.state, self.estimates.since_ns) = (state, self.now_ns);
        }
        self.estimates.unknown_because = (state == State::Unknown).then_some(NoEstimate::NotYet);
        Ok(())
    }

    /// Of the reasons with a number of their own the number is that of the channel; a trial needs none.
    fn give_inferred_word(&mut self, name: &str, value: &Dynamic) -> Result<(), UnknownWord> {
        if name == "no_load_origin" {
            let found = find_by_word("no_load_origin", value, &NoLoadOrigin::ALL, NoLoadOrigin::as_word)?;
            self.estimates.no_load_origin = found;
            return Ok(());
        }
        let known = [
            NoEstimate::NotYet,
            NoEstimate::Contradiction,
            NoEstimate::ControlSilent { power_w: 0.0 },
            NoEstimate::NotLearned,
            NoEstimate::Extrapolated { noise_gain: 10.0 },
        ];
        let found = find_by_word("unknown_because", value, &known, NoEstimate::as_word)?;
        self.estimates.unknown_because = Some(found);
        Ok(())
    }

    fn give_channel(&mut self, id: ChannelId, value: &Dynamic) -> Result<(), String> {
        let channel = id.channel();
        let text = value.read_lock::<ImmutableString>().map(|text| text.to_string());
        let value = match (read_number(value), text, channel.kind == adapter_core::channel::Kind::Text) {
            _ if value.is_unit() => Err(Absence::Timeout),
            (Some(number), _, false) if channel.accepts_number(number) => Ok(Value::Number(number)),
            (Some(number), _, false) => {
                let (least, greatest) = channel.range;
                return Err(format!("{id} = {number} is outside {least} to {greatest}{}", space_unit(channel.unit)));
            }
            (_, Some(text), true) => Ok(Value::Text(text.into())),
            (_, _, true) => return Err(format!("{id} needs a text, or () for no value")),
            (_, _, false) => return Err(format!("{id} needs a number, or () for no value")),
        };
        self.sample.set_slot(id, Slot { value, age_ns: 0 });
        Ok(())
    }

    /// Ticks come this far apart from now on.
    pub(super) fn set_pace(&mut self, seconds: f64) -> Result<(), String> {
        self.step_ns =
            to_span_ns(seconds).filter(|step_ns| *step_ns > 0).ok_or("pace_s needs seconds from 0.001 to 3600")?;
        Ok(())
    }

    /// Lets time pass, tick by tick.
    pub(super) fn pass_time(&mut self, seconds: f64) -> Result<(), String> {
        let span_ns = to_span_ns(seconds).ok_or("after_s needs seconds, from 0.001 on")?;
        let end_ns = self.now_ns.saturating_add(span_ns);
        self.stops.clear();
        while self.now_ns < end_ns {
            self.ticks += 1;
            if self.ticks > TICKS_MAX {
                return Err(format!("more than {TICKS_MAX} ticks in one trial; pace_s(1.0) makes them longer"));
            }
            self.run_tick()?;
            self.now_ns += self.step_ns;
        }
        Ok(())
    }

    fn run_tick(&mut self) -> Result<(), String> {
        (self.sample.at_ns, self.estimates.at_ns) = (self.now_ns, self.now_ns);
        self.loads.step(&self.sample, &mut self.estimates, self.host.settings());
        for (name, given) in &self.given {
            self.estimates.figure_mut(name).into_iter().for_each(|figure| *figure = *given);
        }
        let decision = self.host.run_due_scripts(&self.sample, &self.estimates);
        self.stops.extend(decision.stops.iter().map(|request| request.stop));
        self.notes.extend(decision.notes.iter().map(|note| note.text.clone()));
        self.failure = decision.problems.first().cloned();
        if self.failure.is_some() { Err("the script failed".to_owned()) } else { Ok(()) }
    }

    /// What the script wants now.
    pub(super) fn decision(&self) -> &Decision {
        self.host.decision()
    }

    /// The alarms that stand.
    pub(super) fn alarms(&self) -> &[Alarm] {
        self.host.alarms()
    }

    /// Was this asked for since time last began to pass?
    pub(super) fn is_stop_requested(&self, stop: Stop) -> bool {
        self.stops.contains(&stop)
    }

    /// The offset proposed for an axis.
    pub(super) fn offset_um(&self, axis: Axis) -> Option<f64> {
        self.decision().offsets.iter().find(|proposal| proposal.axis == axis).map(|proposal| proposal.offset_um)
    }

    /// From now on the script sees a plain value of everything that it reads: the middle of the range of a channel, 100 of an
    /// estimate and of another script's channel.
    pub(super) fn give_all(&mut self, script: &Script) {
        let text = |name: &str| Dynamic::from(ImmutableString::from(if name == "program" { "O1" } else { "T1" }));
        let words = script.reads.iter().copied().chain(script.fields.iter().map(|field| field.word));
        for word in words.filter(|word| !word.is_writable()) {
            let value = match (ChannelId::from_name(word.name).map(ChannelId::channel), word.kind) {
                (Some(channel), WordKind::Number) => {
                    let (least, greatest) = channel.range;
                    Dynamic::from_float(100.0_f64.clamp(least, greatest))
                }
                (Some(_), _) => text(word.name),
                (None, _) => Dynamic::from_float(100.0),
            };
            // What cannot be given, such as the time, is there anyway.
            let _given = self.give_value(word.name, &value);
        }
        for name in &script.foreign {
            self.host.set_channel_value(name, Some(100.0));
        }
    }

    /// The newest value of a channel of the script's own; `Err` where it has none of this name.
    pub(super) fn find_published(&self, name: &str) -> Result<Option<f64>, String> {
        let found = self.host.published_channels().find(|it| it.name == name).map(|it| it.value);
        let names = || self.host.published_channels().map(|it| it.name.to_owned()).collect::<Vec<_>>().join(", ");
        found.ok_or_else(|| format!("the script publishes no `{name}`; it publishes: {}", names()))
    }

    /// A setting of the estimators, as this script alone leaves it.
    pub(super) fn find_setting(&self, name: &str) -> Option<f64> {
        self.host.settings().get(name)
    }

    /// Everything noted since the beginning.
    pub(super) fn notes(&self) -> &[Arc<str>] {
        &self.notes
    }

    /// Why the script asks for nothing, where it waits for a value.
    pub(super) fn explain_waiting(&self) -> String {
        let status = self.host.status();
        match status.scripts.first().map(|script| &script.condition) {
            Some(ScriptCondition::Waiting(problem)) => format!("; the script waits: {}", problem.what),
            _ => String::new(),
        }
    }
}

fn read_number(value: &Dynamic) -> Option<f64> {
    value.as_float().ok().or_else(|| value.as_int().ok().map(|whole| whole as f64))
}

/// At most 10 days at once.
fn to_span_ns(seconds: f64) -> Option<i64> {
    (0.001..=864_000.0).contains(&seconds).then_some((seconds * SECOND_NS as f64).round() as i64)
}

fn quantity_of<'a>(estimates: &'a mut Estimates, name: &str) -> Option<&'a mut Estimated> {
    match name {
        "filtered_power_w" => Some(&mut estimates.filtered_power_w),
        "no_load_power_w" => Some(&mut estimates.no_load_power_w),
        "cutting_power_w" => Some(&mut estimates.cutting_power_w),
        "load_loss_w" => Some(&mut estimates.load_loss_w),
        "visible_cutting_power_w" => Some(&mut estimates.visible_cutting_power_w),
        "wear_limit_w" => Some(&mut estimates.wear_limit_w),
        "tool_wear_mm" => Some(&mut estimates.tool_wear_mm),
        "tool_growth_pct" => Some(&mut estimates.tool_growth_pct),
        "tool_worn_probability" => Some(&mut estimates.tool_worn_probability),
        "tool_parts_left" => Some(&mut estimates.tool_parts_left),
        "material_level_pct" => Some(&mut estimates.material_level_pct),
        _ => None,
    }
}

fn describe_unknown(name: &str) -> String {
    let given = list_words().iter().filter(|word| word.kind != WordKind::Map).map(|word| word.name);
    let near = find_nearest_name(name, given).map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
    format!("`{name}` is nothing that a trial can give{near}")
}
