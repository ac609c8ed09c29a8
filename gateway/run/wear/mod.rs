//! The wear of the edges beside the running machine: gives the pipeline the models of the library in the history (`identify
//! tool-wear --store`), tells what the follower of the wear has to say, and shows how the edge in use stands. The alarm is raised
//! by one rule, the script `tool_wear`.

mod library;

use super::health::Health;
use adapters::clock::TimeNs;
use gateway_base::log::Notice;
use gateway_config::Config;
use gateway_pipeline::Pipeline;
use gateway_status::WearStatus;
use library::Library;
use rules::estimators::NoEstimate;
use rules::estimators::wear::{Observability, WorkReference};

/// Who writes the events.
const SOURCE: &str = "wear";

/// The library of wear models beside the running machine, and what is told of the edge in use.
pub struct Wear {
    machine: String,
    model_library: Library,
    notice: Option<Notice>,
}

impl Wear {
    /// Watches the library of this history.
    #[must_use]
    pub fn from_config(config: &Config) -> Self {
        let (model_library, told) = Library::watch_history(&config.history.path);
        Self { machine: config.gateway.machine.name.clone(), model_library, notice: told }
    }

    /// Gives the pipeline what is new in the library; before the tick.
    pub fn supply_models(&mut self, pipeline: &mut Pipeline, at_ns: TimeNs, health: &mut Health) {
        if let Some(notice) = self.notice.take() {
            health.record_event(at_ns, SOURCE, &notice);
        }
        if self.model_library.take_newest() {
            pipeline.wear_mut().set_models(&self.machine, self.model_library.models().to_vec());
        }
        if let Some(problem) = self.model_library.take_problem() {
            health.record_event(at_ns, SOURCE, &problem);
        }
    }
}

/// What the page shows of the edge in use; `None` without a model for its cut. What is known without one stands with the estimates.
#[must_use]
pub fn build_status(pipeline: &Pipeline) -> Option<WearStatus> {
    let wear = pipeline.wear();
    let (model, outlook) = (wear.model(), wear.current_outlook());
    let model = model?;
    let computed = wear.limit().and_then(|limit| limit.as_ref().ok());
    // The limit that rules compare with, and no other one: outside of the cuts of the model there is none.
    let limit = wear.usable_limit().ok();
    let learned = outlook.filter(|(reference, _)| *reference == WorkReference::Model).map(|(_, outlook)| outlook);
    let outlook = outlook.map(|(_, outlook)| outlook);
    let why = match (wear.limit(), &outlook) {
        (Some(Err(why)), _) => Some(why.clone()),
        (_, None) => Some(explain_no_outlook(pipeline)),
        (_, Some(outlook)) if !outlook.observed => Some("the wear is not known well enough here".to_owned()),
        (None, _) => Some("no cut with this tool, material and operation yet".to_owned()),
        _ => None,
    };
    Some(WearStatus {
        form: model.record.model.form(),
        model_by: Some(model.by),
        criterion_mm: model.record.criterion_mm,
        limit_w: limit.map(|limit| limit.power_w),
        limit_uncertainty_w: limit.map(|limit| limit.interval_w.1 - limit.power_w),
        flank_wear_mm: learned.map(|outlook| outlook.wear_mm),
        flank_wear_uncertainty_mm: learned.map(|outlook| 1.96 * outlook.wear_sd_mm),
        worn_probability: outlook.filter(|it| it.observed).map(|it| it.worn_probability),
        parts_left: outlook.filter(|it| it.observed).map(|it| it.parts_left),
        observability: computed
            .map(|limit| limit.observability)
            .or(outlook.map(|it| match it.observed {
                true => Observability::Observable,
                false => Observability::NotObservableHere,
            }))
            .map(Observability::as_word),
        extrapolated: computed.map_or(Vec::new(), |limit| limit.extrapolated.clone()),
        why,
    })
}

/// No part of this edge was seen: none was finished, or its cuts were made at a speed whose no-load power is not known.
fn explain_no_outlook(pipeline: &Pipeline) -> String {
    match pipeline.estimates().tool_growth_pct {
        Err(reason) if reason != NoEstimate::NoPartYet => reason.to_string(),
        _ => "no part with this edge yet".to_owned(),
    }
}
