//! Wear beside the running machine: from samples and estimates to the state of the edge in use.
//!
//! It gathers the work of every edge until the part is finished, gives it to the filter, and holds what the filter says until the
//! next part. Beside it stands the limit `[Pc]` of the cut of the moment, where a model was learned.

use super::conditions::CutConditions;
use super::edge_state::WearNews;
use super::follow::WearFollower;
use super::model_selection::{choose_model, explain_no_model};
use super::outlook::Outlook;
use super::record::WearRecord;
use super::threshold::{Observability, PowerLimit, compute_power_limit};
use super::unseen_edges::UnseenEdges;
use super::work::{CutMoment, EdgeWork, ExpectedPower, WorkKey, WorkReference};
use crate::loads::Figure;
use crate::{Estimate, Estimated, Estimates, NoEstimate, State};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::model_library::WearKey;
use adapter_core::tool_name::tool_of;
use adapter_core::{ChannelId, Sample, is_same_text};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Flank wear at which an edge is worn where no model says otherwise, mm (ISO 3685: mean land of a uniformly worn flank).
const CRITERION_MM: f64 = 0.3;
/// The first moments of a cut are not counted, s: the filtered power has not settled, the edge is not fully in the work.
const SETTLE_NS: i64 = 3 * SECOND_NS / 2;
/// Longer steps between two samples are pauses.
const STEP_MAX_NS: i64 = 2 * SECOND_NS;
/// A part that cuts for longer is judged in pieces, s.
const PIECE_S: f64 = 1200.0;
/// A pause so long ends what was gathered.
const PAUSE_NS: i64 = 3600 * SECOND_NS;
/// Works of one part that are told apart.
const WORKS_MAX: usize = 64;
/// The limit of the moment is computed this often at most.
const LIMIT_EVERY_NS: i64 = SECOND_NS / 2;
/// Rise of the cutting power per millimetre of wear at a feed of 0.2 mm/rev, typical numbers (`work.rs`), 1/mm.
const TYPICAL_RISE_PER_MM: f64 = 0.59;
/// News that wait to be fetched.
const NEWS_MAX: usize = 32;

struct WearChannels {
    texts: [ChannelId; 4],
    part_count: ChannelId,
    numbers: [ChannelId; 6],
}

impl WearChannels {
    fn new() -> Self {
        let of = |name| ChannelId::from_name(name).expect("the name stands in the table, which a test checks");
        Self {
            texts: ["tool", "work_material", "operation", "program"].map(of),
            part_count: of("part_count"),
            numbers: ["spindle_speed_rpm", "feed_mm_min", "depth_of_cut_mm", "diameter_mm", "width_of_cut_mm", "teeth"]
                .map(of),
        }
    }
}

/// What is remembered when the box starts again.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedWear {
    follower: WearFollower,
    works: Vec<EdgeWork>,
    part_count: Option<f64>,
    /// The models to which what was learned of operations belongs.
    #[serde(default)]
    models: u64,
}

/// The model in use, and what spoke for it.
#[derive(Debug, Clone)]
pub struct ModelInUse {
    /// The model and what it is for.
    pub record: Arc<WearRecord>,
    /// What of its key spoke for it: see [`super::ChosenModel`].
    pub by: &'static str,
}

/// The wear of every edge, from samples and estimates. The numbers and the rules stand in `prior` and `follow`.
pub struct WearEstimator {
    machine: String,
    models: Vec<Arc<WearRecord>>,
    channels: WearChannels,
    /// Tool, material and operation.
    texts: [Option<Arc<str>>; 3],
    model: Option<ModelInUse>,
    memory: SavedWear,
    last_ns: Option<TimeNs>,
    limit: Option<Result<PowerLimit, String>>,
    limit_ns: Option<TimeNs>,
    news: Vec<WearNews>,
    /// Of the edge in use. They change when a part is finished or another edge is in use; until then they are not computed again.
    figures: Option<EdgeFigures>,
    unseen: UnseenEdges,
}

/// What is known of an edge after its last part.
#[derive(Debug, Clone, Copy)]
struct EdgeFigures {
    wear_mm: Estimated,
    growth_pct: Estimated,
    worn_probability: Estimated,
    parts_left: Estimated,
    limit_parts: Figure,
    life_share: Figure,
    material_level_pct: Estimated,
}

impl Default for WearEstimator {
    fn default() -> Self {
        Self {
            machine: String::new(),
            models: Vec::new(),
            channels: WearChannels::new(),
            texts: Default::default(),
            model: None,
            memory: SavedWear::default(),
            last_ns: None,
            limit: None,
            limit_ns: None,
            news: Vec::new(),
            figures: None,
            unseen: UnseenEdges::default(),
        }
    }
}

impl WearEstimator {
    fn edge_in_use(&self) -> &str {
        self.texts[0].as_deref().unwrap_or_default()
    }

    /// The models in force, the newest last, and the name of the machine for which they are looked up.
    pub fn set_models(&mut self, machine: &str, models: Vec<Arc<WearRecord>>) {
        machine.clone_into(&mut self.machine);
        self.memory.follower.keep_levels_of(&models, &mut self.memory.models);
        self.models = models;
        self.choose_model();
    }

    /// What was told since the last call.
    pub fn take_news(&mut self) -> Vec<WearNews> {
        std::mem::take(&mut self.news)
    }

    /// The model for the cut of the moment.
    #[must_use]
    pub fn model(&self) -> Option<&ModelInUse> {
        self.model.as_ref()
    }

    /// The limit of the last moment of cutting, or why there is none.
    #[must_use]
    pub fn limit(&self) -> Option<&Result<PowerLimit, String>> {
        self.limit.as_ref()
    }

    /// The same, where it is one that a power may be compared with: inside the cuts of the model, where wear can be seen.
    ///
    /// # Errors
    /// Why there is none.
    pub fn usable_limit(&self) -> Result<&PowerLimit, NoEstimate> {
        match &self.limit {
            None => Err(NoEstimate::NotCutting),
            Some(Err(_)) => Err(NoEstimate::CutUnknown),
            Some(Ok(limit)) if !limit.extrapolated.is_empty() => Err(NoEstimate::OutsideModel),
            Some(Ok(limit)) if limit.observability == Observability::NotObservableHere => {
                Err(NoEstimate::NotObservable)
            }
            Some(Ok(limit)) => Ok(limit),
        }
    }

    /// Why no model of the library is for the cut of the moment, in a sentence; `None` where one is.
    #[must_use]
    pub fn explain_missing_model(&self) -> Option<String> {
        self.model.is_none().then(|| explain_no_model(&self.models, &self.key_of_cut()))
    }

    /// How the edge in use stands after its last part.
    #[must_use]
    pub fn current_outlook(&self) -> Option<(WorkReference, Outlook)> {
        self.memory.follower.find_outlook(self.edge_in_use())
    }

    /// Everything remembered, for [`WearEstimator::restore_snapshot`].
    #[must_use]
    pub fn take_snapshot(&self) -> serde_json::Value {
        serde_json::to_value(&self.memory).unwrap_or(serde_json::Value::Null)
    }

    /// Goes on where a snapshot was taken; false when it is none of this version.
    pub fn restore_snapshot(&mut self, snapshot: serde_json::Value) -> bool {
        let memory = serde_json::from_value(snapshot).ok().filter(|memory: &SavedWear| memory.follower.is_sound());
        let known = memory.is_some();
        self.memory = memory.unwrap_or_default();
        self.figures = None;
        known
    }

    /// Takes one tick and fills in what it knows of the wear.
    pub fn update_estimates(&mut self, sample: &Sample, estimates: &mut Estimates) {
        let step_ns = self.last_ns.map_or(0, |last_ns| sample.at_ns - last_ns);
        self.last_ns = Some(sample.at_ns);
        self.follow_texts(sample);
        let count = sample.number(self.channels.part_count).ok();
        let counted = count.is_some() && self.memory.part_count.is_some() && count != self.memory.part_count;
        self.memory.part_count = count.or(self.memory.part_count);
        if counted || !(0..=PAUSE_NS).contains(&step_ns) {
            self.finish_part(sample.at_ns);
        }
        self.unseen.watch_edge(self.texts[0].as_deref().unwrap_or_default(), estimates);
        let moment = self.read_cut_moment(sample, estimates);
        if let (Some(moment), 1..=STEP_MAX_NS) = (&moment, step_ns) {
            self.gather_work(moment, sample, step_ns as f64 / SECOND_NS as f64);
        }
        self.fill_estimates(moment.as_ref(), estimates);
    }

    /// The cut of this moment, where its power is known.
    fn read_cut_moment(&self, sample: &Sample, estimates: &Estimates) -> Option<CutMoment> {
        let power = estimates.comparable_cutting_power().ok().filter(|_| estimates.state == State::Cutting)?;
        if sample.at_ns - estimates.since_ns < SETTLE_NS {
            return None;
        }
        let [speed, feed, depth, diameter, width, teeth] =
            self.channels.numbers.map(|channel| sample.number(channel).ok().filter(|number| number.abs() > 0.0));
        Some(CutMoment {
            power_w: (power.value, power.sd),
            speed_rpm: speed,
            feed_mm_min: feed,
            depth_mm: depth,
            diameter_mm: diameter,
            milling: width.zip(teeth),
        })
    }

    /// Another tool, material or operation may have another model.
    fn follow_texts(&mut self, sample: &Sample) {
        let [tool, material, operation, _] = self.channels.texts;
        let now = [tool, material, operation].map(|channel| sample.shared_text(channel));
        if self.texts.iter().zip(now).any(|(before, now)| !is_same_text(before.as_ref(), now)) {
            self.texts = now.map(Option::<&Arc<str>>::cloned);
            self.figures = None;
            self.choose_model();
        }
    }

    fn key_of_cut(&self) -> WearKey {
        let [tool, work_material, operation] =
            self.texts.each_ref().map(|text| text.as_deref().unwrap_or_default().to_owned());
        WearKey { machine: self.machine.clone(), tool, work_material, operation }
    }

    fn choose_model(&mut self) {
        let found = choose_model(&self.models, &self.key_of_cut(), |model| model);
        let model = found.map(|choice| ModelInUse { record: choice.record.clone(), by: choice.by });
        let same = self.model.as_ref().map(|it| &it.record) == model.as_ref().map(|it| &it.record);
        self.model = model;
        if !same {
            (self.limit, self.limit_ns) = (None, None);
        }
    }

    fn gather_work(&mut self, moment: &CutMoment, sample: &Sample, step_s: f64) {
        let program = sample.text(self.channels.texts[3]).unwrap_or_default();
        let seconds: f64 = self.memory.works.iter().map(|work| work.seconds).sum();
        if seconds > PIECE_S || self.memory.works.first().is_some_and(|work| work.key.program != program) {
            self.finish_part(sample.at_ns);
        }
        let record = self.model.as_ref().map(|model| &*model.record);
        let expected = moment.estimate_expected_power(record);
        let criterion_mm = record.map_or(CRITERION_MM, |record| record.criterion_mm);
        if let Some(work) = self.find_or_add_work(expected, program, criterion_mm) {
            work.add(moment, &expected, step_s);
        }
    }

    fn find_or_add_work(&mut self, expected: ExpectedPower, program: &str, criterion_mm: f64) -> Option<&mut EdgeWork> {
        let [edge, material, operation] = self.texts.each_ref().map(|text| text.as_deref().unwrap_or_default());
        let same = |work: &EdgeWork| {
            let key = &work.key;
            key.reference == expected.reference
                && work.edge == edge
                && key.operation == operation
                && key.program == program
                && key.work_material == material
        };
        let works = &mut self.memory.works;
        let at = works.iter().position(same).or_else(|| {
            let key = WorkKey {
                reference: expected.reference,
                tool: tool_of(edge).to_owned(),
                program: program.to_owned(),
                operation: operation.to_owned(),
                work_material: material.to_owned(),
            };
            (works.len() < WORKS_MAX).then(|| {
                works.push(EdgeWork::new(key, edge.to_owned(), criterion_mm));
                works.len() - 1
            })
        })?;
        works.get_mut(at)
    }

    /// The part is finished, or what can be judged of it.
    fn finish_part(&mut self, at_ns: TimeNs) {
        let works = std::mem::take(&mut self.memory.works);
        let news = self.memory.follower.record_part(&works, at_ns as f64 / SECOND_NS as f64);
        self.news.extend(news);
        self.news.truncate(NEWS_MAX);
        self.figures = None;
    }

    fn fill_estimates(&mut self, moment: Option<&CutMoment>, estimates: &mut Estimates) {
        estimates.wear_limit_w = self.limit_of(moment, estimates.at_ns);
        let figures = match self.figures {
            Some(known) => known,
            None => self.compute_figures(),
        };
        // Why an edge was never seen changes from tick to tick.
        self.figures = Some(figures).filter(|_| self.current_outlook().is_some());
        (estimates.tool_wear_mm, estimates.tool_growth_pct) = (figures.wear_mm, figures.growth_pct);
        (estimates.tool_worn_probability, estimates.tool_parts_left) = (figures.worn_probability, figures.parts_left);
        (estimates.tool_limit_parts, estimates.tool_life_share) = (figures.limit_parts, figures.life_share);
        estimates.material_level_pct = figures.material_level_pct;
    }

    fn compute_figures(&self) -> EdgeFigures {
        let follower = &self.memory.follower;
        let (limit_parts, life_share) = follower.read_witnesses(self.edge_in_use());
        let material = follower.material_level().ok_or(NoEstimate::NoPartYet);
        let no_limit = if self.model.is_some() { NoEstimate::NoLimit } else { NoEstimate::NoModel };
        let without = |reason: NoEstimate| EdgeFigures {
            wear_mm: Err(reason),
            growth_pct: Err(reason),
            worn_probability: Err(reason),
            parts_left: Err(reason),
            limit_parts: limit_parts.map(f64::from).ok_or(no_limit),
            life_share: life_share.ok_or(NoEstimate::NoLivesYet),
            material_level_pct: material.map(|(share, sd)| Estimate { value: 100.0 * share, sd: 100.0 * sd }),
        };
        match self.current_outlook() {
            None => without(self.unseen.find_reason(self.edge_in_use()).unwrap_or(NoEstimate::NoPartYet)),
            Some((_, outlook)) if !outlook.observed => without(NoEstimate::NotObservable),
            Some((reference, outlook)) => fill_outlook(without(NoEstimate::NoModel), reference, &outlook),
        }
    }

    fn limit_of(&mut self, moment: Option<&CutMoment>, at_ns: TimeNs) -> Estimated {
        let record = self.model.as_ref().map(|model| model.record.clone()).ok_or(NoEstimate::NoModel)?;
        let moment = moment.ok_or(NoEstimate::NotCutting)?;
        let soon = self.limit_ns.is_some_and(|then_ns| (0..LIMIT_EVERY_NS).contains(&(at_ns - then_ns)));
        if !soon || self.limit.is_none() {
            self.limit_ns = Some(at_ns);
            let found = moment.to_conditions().ok_or_else(|| NoEstimate::CutUnknown.to_string());
            let texts = self.texts.each_ref().map(|text| text.as_deref().unwrap_or_default());
            let beside = self.memory.follower.find_level_of_cut(&self.memory.works, texts);
            self.limit = Some(found.and_then(|cut: CutConditions| {
                let limit = compute_power_limit(&record.model, &cut, record.criterion_mm);
                limit.map(|limit| limit.move_by(beside)).map_err(|refusal| refusal.to_string())
            }));
        }
        self.usable_limit().map(|limit| Estimate { value: limit.power_w, sd: limit.sd_w })
    }
}

/// The figures of an edge whose wear is observed; in millimetres only where a model was learned.
fn fill_outlook(figures: EdgeFigures, reference: WorkReference, outlook: &Outlook) -> EdgeFigures {
    let wear = Estimate { value: outlook.wear_mm, sd: outlook.wear_sd_mm };
    let growth = Estimate {
        value: 100.0 * TYPICAL_RISE_PER_MM * outlook.wear_mm,
        sd: 100.0 * TYPICAL_RISE_PER_MM * outlook.wear_sd_mm,
    };
    let [middle, least, most] = outlook.parts_left;
    // Half of an 80 % interval is 1.2816 standard deviations of a normal one.
    let parts = Estimate { value: middle, sd: (most - least) / (2.0 * 1.2816) };
    EdgeFigures {
        wear_mm: if reference == WorkReference::Model { Ok(wear) } else { Err(NoEstimate::NoModel) },
        growth_pct: Ok(growth),
        worn_probability: Ok(Estimate { value: outlook.worn_probability, sd: 0.0 }),
        parts_left: Ok(parts),
        ..figures
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_channel_stands_in_the_table() {
        let _found = super::WearChannels::new();
    }
}
