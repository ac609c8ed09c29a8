//! The wear model beside the running machine: the limit `[Pc]` of the cut at this moment, the wear that its power means, and an
//! alarm on repeated violation. The models come from the library in the history (`identify tool-wear --store`), the depth and
//! the diameter from the controller or the operations recipe.

mod library;

use super::health::Health;
use crate::config::Config;
use crate::history::{Alarm, AlarmClear};
use crate::log::Notice;
use crate::status::{AlarmStatus, WearStatus};
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{ChannelId, Sample};
use library::Library;
use rules::estimators::regression::Refusal;
use rules::estimators::wear::{
    AlarmRule, Change, Conditions, Key, Observability, Threshold, WearAlarm, WearEstimate, WearRecord,
    cutting_speed_m_min, estimate_wear, threshold,
};
use rules::estimators::{Estimate, Estimated, Estimates, NoEstimate, State};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Who raises the alarm and writes the events.
const SOURCE: &str = "wear";
const WORN: &str = "tool_worn";
/// A wear is inferred this often at most: it does not change from tick to tick.
const EVERY_NS: i64 = SECOND_NS / 2;
/// Tools whose past is remembered.
const EDGES_MAX: usize = 200;

/// The channels that are looked at.
struct Channels {
    diameter: ChannelId,
    speed: ChannelId,
    feed: ChannelId,
    feed_per_rev: ChannelId,
    depth: ChannelId,
    texts: [ChannelId; 3],
}

/// What the last moment of cutting said.
#[derive(Debug, Clone)]
struct Judged {
    threshold: Threshold,
    wear: Result<WearEstimate, String>,
}

/// One tool, as the controller or the recipe names it; a new edge may have a new name or take less power.
struct Edge {
    alarm: WearAlarm,
    raised: Option<(TimeNs, String, String)>,
}

/// See the [module](self).
pub struct Wear {
    machine: String,
    model_library: Library,
    channels: Channels,
    /// Tool, material and operation of the cut, and the model for them.
    texts: [Option<Arc<str>>; 3],
    model: Option<Arc<WearRecord>>,
    edges: BTreeMap<String, Edge>,
    last: Option<Result<Judged, String>>,
    judged_ns: Option<TimeNs>,
    told: Option<Notice>,
}

impl Wear {
    /// Watches the library of this history.
    ///
    /// # Panics
    /// Never: a test holds the names against the table of channels.
    #[must_use]
    pub fn of(config: &Config) -> Self {
        let of = |name| ChannelId::of(name).expect("the name stands in the table, which a test checks");
        let (library, told) = Library::watch(&config.history.path);
        Self {
            machine: config.gateway.name.clone(),
            model_library: library,
            channels: Channels {
                diameter: of("diameter_mm"),
                speed: of("spindle_speed_rpm"),
                feed: of("feed_mm_min"),
                feed_per_rev: of("feed_per_rev_mm"),
                depth: of("depth_of_cut_mm"),
                texts: ["tool", "work_material", "operation"].map(of),
            },
            texts: [const { None }; 3],
            model: None,
            edges: BTreeMap::new(),
            last: None,
            judged_ns: None,
            told,
        }
    }

    /// Takes one tick, between inferring and deciding: limit and wear of this cut, for the scripts and the history. Without
    /// models in the library it costs a look at an empty queue.
    pub fn step(&mut self, sample: &Sample, estimates: &Estimates, health: &mut Health) -> (Estimated, Estimated) {
        if let Some(notice) = self.told.take() {
            health.event(sample.at_ns, SOURCE, &notice);
        }
        let fresh = self.model_library.take();
        if let Some(problem) = self.model_library.problem() {
            health.event(sample.at_ns, SOURCE, &problem);
        }
        let none = |reason| (Err(reason), Err(reason));
        if self.model_library.is_empty() {
            return none(NoEstimate::NoModel);
        }
        self.follow(sample, fresh);
        let Some(model) = self.model.clone() else { return none(NoEstimate::NoModel) };
        if estimates.state != State::Cutting {
            return none(NoEstimate::NotCutting);
        }
        let power = match estimates.cutting_power_w {
            Ok(power) => power,
            Err(reason) => return none(reason),
        };
        let soon = self.judged_ns.is_some_and(|then_ns| (0..EVERY_NS).contains(&(sample.at_ns - then_ns)));
        if !soon {
            self.judged_ns = Some(sample.at_ns);
            let judged = self.judge(&model, sample, (power.value, power.sd)).map_err(|refusal| refusal.to_string());
            if let Ok(judged) = &judged {
                self.alarm_of(judged, power.value, sample.at_ns, health);
            }
            self.last = Some(judged);
        }
        self.last.as_ref().map_or(none(NoEstimate::NotYet), estimates_of)
    }

    /// Another tool, material or operation may have another model.
    fn follow(&mut self, sample: &Sample, fresh: bool) {
        let now = self.channels.texts.map(|channel| sample.text(channel));
        let same = self.texts.iter().zip(&now).all(|(before, now)| before.as_deref() == *now);
        if same && !fresh {
            return;
        }
        self.texts = now.map(|text| text.map(Arc::from));
        let text = |at: usize| now[at].unwrap_or_default().to_owned();
        let cut = Key { machine: self.machine.clone(), tool: text(0), work_material: text(1), operation: text(2) };
        let model = self.model_library.best(&cut);
        if model != self.model {
            (self.model, self.last) = (model, None);
        }
    }

    fn conditions(&self, sample: &Sample) -> Result<Conditions, Refusal> {
        let number = |channel: ChannelId| {
            sample.number(channel).map_err(|absence| missing(format!("{channel} is missing: {absence}")))
        };
        let speed_rpm = number(self.channels.speed)?;
        let feed = number(self.channels.feed_per_rev).or_else(|_| {
            let turns = speed_rpm.abs();
            number(self.channels.feed).and_then(|feed| match turns > 1.0 {
                true => Ok(feed / turns),
                false => Err(missing("the spindle stands still".to_owned())),
            })
        })?;
        let speed = cutting_speed_m_min(number(self.channels.diameter)?, speed_rpm).map_err(missing)?;
        Ok(Conditions::of([0.0, speed, feed, number(self.channels.depth)?]))
    }

    fn judge(&self, record: &WearRecord, sample: &Sample, power: (f64, f64)) -> Result<Judged, Refusal> {
        let cut = self.conditions(sample)?;
        let threshold = threshold(&record.model, &cut, record.criterion_mm)?;
        let wear =
            estimate_wear(&record.model, &cut, power, record.criterion_mm).map_err(|refusal| refusal.to_string());
        Ok(Judged { threshold, wear })
    }

    /// Judges the tool in use; its alarm stands until its power falls below the limit, also while other tools cut.
    fn alarm_of(&mut self, judged: &Judged, power_w: f64, at_ns: TimeNs, health: &mut Health) {
        let limit = &judged.threshold;
        if limit.observability != Observability::Observable || !limit.extrapolated.is_empty() {
            return;
        }
        let tool = self.texts[0].as_deref().unwrap_or_default();
        let (code, source) = (format!("{WORN} {tool}").trim_end().to_owned(), SOURCE.to_owned());
        let Some(edge) = edge_of(&mut self.edges, tool) else { return };
        match edge.alarm.judge(at_ns, power_w, (limit.power_w, limit.sd_w)) {
            None => {}
            Some(Change::Raised) => {
                let (en, zh) = texts(limit, power_w, tool);
                edge.raised = Some((at_ns, en.clone(), zh.clone()));
                health.keep(Alarm { at_ns, code, source, severity: "warning".to_owned(), en, zh }.into());
            }
            Some(Change::Cleared) => {
                edge.raised = None;
                health.keep(AlarmClear { at_ns, code, source }.into());
            }
        }
    }

    /// The alarms that stand.
    pub fn alarms(&self) -> impl Iterator<Item = AlarmStatus> {
        let raised = self.edges.iter().filter_map(|(tool, edge)| Some((tool, edge.raised.clone()?)));
        raised.map(|(tool, (since_ns, text, zh))| AlarmStatus {
            code: format!("{WORN} {tool}"),
            severity: "warning".to_owned(),
            text,
            zh,
            since_ms: super::report::milliseconds(since_ns),
        })
    }

    /// What the page shows; `None` without a model for this cut.
    #[must_use]
    pub fn status(&self) -> Option<WearStatus> {
        let record = self.model.as_ref()?;
        let judged = self.last.as_ref().and_then(|judged| judged.as_ref().ok());
        let wear = judged.and_then(|judged| judged.wear.as_ref().ok());
        let why = match &self.last {
            None => Some("no cut with this tool, material and operation yet".to_owned()),
            Some(Err(why)) => Some(why.clone()),
            Some(Ok(judged)) => judged.wear.as_ref().err().cloned(),
        };
        Some(WearStatus {
            form: record.model.form(),
            criterion_mm: record.criterion_mm,
            limit_w: judged.map(|judged| judged.threshold.power_w),
            limit_uncertainty_w: judged.map(|judged| judged.threshold.interval_w.1 - judged.threshold.power_w),
            flank_wear_mm: wear.map(|wear| wear.flank_wear_mm),
            flank_wear_uncertainty_mm: wear.map(|wear| wear.interval_mm.1 - wear.flank_wear_mm),
            observability: judged.map(|judged| judged.threshold.observability.word()),
            extrapolated: judged.map_or(Vec::new(), |judged| judged.threshold.extrapolated.clone()),
            why,
        })
    }
}

/// Limit and wear as estimates, where they can be stood behind.
fn estimates_of(judged: &Result<Judged, String>) -> (Estimated, Estimated) {
    let Ok(Judged { threshold, wear }) = judged else {
        return (Err(NoEstimate::CutUnknown), Err(NoEstimate::CutUnknown));
    };
    let reason = match (threshold.extrapolated.is_empty(), threshold.observability) {
        (false, _) => Some(NoEstimate::OutsideModel),
        (true, Observability::NotObservableHere) => Some(NoEstimate::NotObservable),
        (true, _) => None,
    };
    if let Some(reason) = reason {
        return (Err(reason), Err(reason));
    }
    let found = wear.as_ref().map(|wear| Estimate { value: wear.flank_wear_mm, sd: wear.sd_mm });
    let limit = Estimate { value: threshold.power_w, sd: threshold.sd_w };
    (Ok(limit), found.map_err(|_| NoEstimate::NotObservable))
}

/// The tool's own past; of too many tools, those without an alarm are forgotten.
fn edge_of<'a>(edges: &'a mut BTreeMap<String, Edge>, tool: &str) -> Option<&'a mut Edge> {
    if !edges.contains_key(tool) {
        if edges.len() >= EDGES_MAX {
            edges.retain(|_, edge| edge.raised.is_some());
        }
        if edges.len() >= EDGES_MAX {
            return None;
        }
        edges.insert(tool.to_owned(), Edge { alarm: WearAlarm::new(AlarmRule::default()), raised: None });
    }
    edges.get_mut(tool)
}

fn missing(what: String) -> Refusal {
    let next = "the operations recipe gives depth and diameter by program and block";
    Refusal::new(rules::estimators::regression::RefusalKind::Missing, what, next)
}

fn texts(limit: &Threshold, power_w: f64, tool: &str) -> (String, String) {
    let Threshold { criterion_mm, power_w: limit_w, .. } = limit;
    (
        format!(
            "tool {tool} is worn: the cutting power of {power_w:.0} W is above {limit_w:.0} W, the limit of this cut at \
             {criterion_mm} mm of flank wear, again and again; change the edge"
        ),
        format!(
            "刀具 {tool} 已磨损：切削功率 {power_w:.0} W 多次超过阈值 {limit_w:.0} W（后刀面磨损 {criterion_mm} mm），请换刀"
        ),
    )
}
