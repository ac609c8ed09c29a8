//! One tick, the same for a live machine and a replayed recording: sample in, estimates, decision and records out.
//!
//! Time is that of the sample; nothing here reads a clock. In steady state a tick allocates nothing: records are made
//! only where something changes.

mod channels;
mod decide;
mod extras;
mod journal;
mod part_detail;
mod parts;
mod tally;
mod wear_news;

pub use channels::Channels;
pub use decide::{Decisions, ShownChange};
use extras::{StoredEstimates, list_script_series, own_value};
pub use extras::{list_series as stored_series, round_as_stored};
pub use journal::Journal;
pub use part_detail::{OperationUse, PartDetail, ToolUse};
pub use parts::CycleFollower;
pub use tally::Tally;

use adapter_core::Sample;
use adapter_core::clock::TimeNs;
use gateway_base::log::Notice;
use gateway_gate::{Gate, OffsetVerdict, Verdict, offset};
use gateway_history::{Event, ExtraSeries, ExtraValue, Part, Record};
use rules::estimators::wear::WearEstimator;
use rules::estimators::{self, Estimates};
use rules::script::{Host, OffsetProposal, OverrideRequest};

/// Who writes the events about the wear.
const WEAR: &str = "wear";

/// Where a tick leaves what is to be remembered.
pub trait Store {
    /// A sample with what is stored beside its channels.
    fn store_sample(&mut self, sample: &Sample, extras: &[ExtraValue<'_>]);

    /// Something that happened at this tick; always after the tick's sample.
    fn store_record(&mut self, record: Record);

    /// Something to tell; a live box also writes it into its log.
    fn store_notice(&mut self, at_ns: TimeNs, source: &str, notice: &Notice) {
        self.store_record(event_of(at_ns, source, notice).into());
    }
}

/// A notice as a row of the history.
#[must_use]
pub fn event_of(at_ns: TimeNs, source: &str, notice: &Notice) -> Event {
    let detail = match serde_json::from_str::<serde_json::Value>(&notice.detail) {
        // What is JSON already stays as it is: put into quotes once more, nobody who reads it finds its fields.
        Ok(value) if value.is_object() || value.is_array() => notice.detail.clone(),
        _ if notice.detail.is_empty() => String::new(),
        _ => serde_json::json!(notice.detail).to_string(),
    };
    Event { at_ns, kind: notice.code.to_owned(), source: source.to_owned(), text: notice.operator.clone(), detail }
}

/// A store that drops everything, for the benchmark.
#[derive(Debug, Default)]
pub struct NoStore;

impl Store for NoStore {
    fn store_sample(&mut self, _: &Sample, _: &[ExtraValue<'_>]) {}

    fn store_record(&mut self, _: Record) {}
}

/// Everything between the merge and the store.
pub struct Pipeline {
    channels: Channels,
    estimators: estimators::Inference,
    wear: WearEstimator,
    estimates: Estimates,
    scripts: Host,
    /// Channels of the scripts' own that are stored.
    extra_series: Vec<ExtraSeries>,
    extras: Vec<ExtraValue<'static>>,
    stored: StoredEstimates,
    generation: u64,
    gate: Gate,
    verdict: Option<Verdict>,
    decisions: Decisions,
    journal: Journal,
    cycles: CycleFollower,
    /// The part that this tick has finished.
    finished: Option<Part>,
    tally: Tally,
    /// What the box itself proposes at this tick.
    proposal: Option<OffsetProposal>,
    /// What the network asks for at this tick.
    request: Option<OverrideRequest>,
}

impl Pipeline {
    /// A pipeline that has seen nothing. The settings of the estimators are those of the scripts.
    #[must_use]
    pub fn new(mut estimators: estimators::Inference, scripts: Host, gate: Gate) -> Self {
        estimators.apply_settings(scripts.settings().clone());
        Self {
            channels: Channels::new(),
            estimates: *estimators.estimates(),
            estimators,
            wear: WearEstimator::default(),
            extra_series: list_script_series(&scripts),
            extras: Vec::new(),
            stored: StoredEstimates::default(),
            generation: scripts.generation(),
            scripts,
            gate,
            verdict: None,
            decisions: Decisions::default(),
            journal: Journal::default(),
            cycles: CycleFollower::default(),
            finished: None,
            tally: Tally::default(),
            proposal: None,
            request: None,
        }
    }

    /// These series are stored by somebody else: a script's channel of the same name is not stored a second time. Before
    /// [`Pipeline::extra_series`].
    pub fn exclude_series(&mut self, names: &[ExtraSeries]) {
        self.extra_series.retain(|own| !names.iter().any(|known| known.name == own.name));
    }

    /// An offset that the box itself proposes at this tick, before [`Pipeline::decide_commands`].
    pub fn propose_offset(&mut self, proposal: Option<OffsetProposal>) {
        self.proposal = proposal;
    }

    /// A feed override that the network asks for at this tick, before [`Pipeline::decide_commands`].
    pub fn request_override(&mut self, request: Option<OverrideRequest>) {
        self.request = request;
    }

    /// What is stored beside the channels: estimates, then the channels of the scripts' own that were there at the start.
    #[must_use]
    pub fn extra_series(&self) -> Vec<ExtraSeries> {
        [stored_series(), self.extra_series.clone()].concat()
    }

    /// Takes one tick. Samples come in the order of time.
    pub fn run_tick(&mut self, sample: &Sample, store: &mut dyn Store) {
        self.infer_estimates(sample);
        self.decide_commands(sample);
        self.record_tick(sample, store);
    }

    /// The first half of a tick.
    pub fn infer_estimates(&mut self, sample: &Sample) -> &Estimates {
        self.follow_settings();
        self.estimates = *self.estimators.update_with_sample(sample);
        self.wear.update_estimates(sample, &mut self.estimates);
        &self.estimates
    }

    /// The second half of a tick: decides.
    pub fn decide_commands(&mut self, sample: &Sample) {
        self.finished = self.cycles.follow_tick(&self.channels, sample, &self.estimates);
        self.estimates.part = self.cycles.last_figures();
        let estimates = self.estimates;
        self.tally.count_tick(sample.at_ns, estimates.state);
        let decision = self.scripts.run_due_scripts(sample, &estimates);
        decision.learn_anew.iter().for_each(|program| self.estimators.learn_load_anew(program));
        if let Some(request) = self.request.take() {
            self.scripts.add_override_request(request);
        }
        self.verdict =
            Some(self.gate.decide_override(self.scripts.decision().request.as_ref(), sample, estimates.state));
        if let Some(proposal) = self.proposal.take() {
            self.scripts.add_offset_proposal(proposal);
        }
    }

    /// What can wait until the decision is on its way to the machine: stores and records, where something was decided.
    pub fn record_tick(&mut self, sample: &Sample, store: &mut dyn Store) {
        let Some(verdict) = self.verdict else { return };
        let estimates = self.estimates;
        self.extras.clear();
        self.extras.extend(self.stored.compute_values(&estimates));
        self.extras.extend(self.extra_series.iter().map(|series| own_value(&self.scripts, &series.name)));
        store.store_sample(sample, &self.extras);
        self.journal.record_tick(&self.channels, sample, &estimates, |record| store.store_record(record));
        self.decisions.record_decision(self.scripts.decision(), &verdict, |record| store.store_record(record));
        for news in self.wear.take_news() {
            store.store_notice(sample.at_ns, WEAR, &wear_news::describe_news(&news));
        }
        if let Some(part) = self.finished.take() {
            store.store_record(part.into());
        }
    }

    /// Other scripts may bring other settings.
    fn follow_settings(&mut self) {
        if self.generation != self.scripts.generation() {
            self.generation = self.scripts.generation();
            self.estimators.apply_settings(self.scripts.settings().clone());
        }
    }

    /// The wear of the edges.
    #[must_use]
    pub fn wear(&self) -> &WearEstimator {
        &self.wear
    }

    /// The wear of the edges, to give it models and what it remembered, and to fetch its news.
    pub fn wear_mut(&mut self) -> &mut WearEstimator {
        &mut self.wear
    }

    /// The scripts in charge, with their channels and problems.
    #[must_use]
    pub fn scripts(&self) -> &Host {
        &self.scripts
    }

    /// The scripts, to put others in charge.
    pub fn scripts_mut(&mut self) -> &mut Host {
        &mut self.scripts
    }

    /// The gate that judges what the scripts ask for.
    #[must_use]
    pub fn gate(&self) -> &Gate {
        &self.gate
    }

    /// The gate, for orders of a person and for what the machine says.
    pub fn gate_mut(&mut self) -> &mut Gate {
        &mut self.gate
    }

    /// What the gate makes of the offsets that were proposed at this tick; after [`Pipeline::decide_commands`].
    pub fn judge_offsets(&mut self, sample: &Sample) -> Vec<OffsetVerdict> {
        self.gate.judge_offsets(&self.scripts.decision().offsets, sample, self.estimates.state)
    }

    /// What is to be looked at in the control, because nobody knows for sure what is in force there; after
    /// [`Pipeline::decide_commands`].
    pub fn list_readbacks(&mut self, sample: &Sample) -> Vec<offset::OffsetOrder> {
        self.gate.collect_look_orders(sample, self.estimates.state)
    }

    /// What the gate made of the last request.
    #[must_use]
    pub fn verdict(&self) -> Option<&Verdict> {
        self.verdict.as_ref()
    }

    /// What the scripts asked for last.
    #[must_use]
    pub fn decisions(&self) -> &Decisions {
        &self.decisions
    }

    /// The estimates of the last tick.
    #[must_use]
    pub fn estimates(&self) -> &Estimates {
        &self.estimates
    }

    /// The estimators, for what they have learned.
    #[must_use]
    pub fn estimators(&self) -> &estimators::Inference {
        &self.estimators
    }

    /// Sums since the start.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// The cycle under way and the parts that were finished.
    #[must_use]
    pub fn parts(&self) -> &CycleFollower {
        &self.cycles
    }

    /// What was last recorded.
    #[must_use]
    pub fn journal(&self) -> &Journal {
        &self.journal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gateway_base::log::Severity;

    #[test]
    fn a_detail_that_is_json_is_stored_as_it_is_and_words_as_a_text() {
        for (detail, stored) in [
            (r#"{"by_ns":[1,1],"moves":[]}"#, r#"{"by_ns":[1,1],"moves":[]}"#),
            ("[1]", "[1]"),
            ("look at the cable", r#""look at the cable""#),
            ("17", r#""17""#),
            ("", ""),
        ] {
            let notice = Notice::new(Severity::Info, "kind", "text").with_detail(detail);
            assert_eq!(event_of(7, "gateway", &notice).detail, stored);
        }
    }
}
