//! From the pipeline's figures to the status document.

use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{Axis, ChannelId, Sample, Slot, Value};
use gateway_config::GateMode;
use gateway_gate::{Gate, GateOutcome, Verdict};
use gateway_history::as_stored;
use gateway_http::ESTIMATES;
use gateway_pipeline::{Pipeline, round_as_stored};
use gateway_sources::sample_feed::SampleFeed;
use gateway_status::{
    AlarmStatus, AxisShift, ChannelStatus, DecisionStatus, EstimateStatus, GateStatus, NumberOrWord, OffsetStatus,
    ScriptStatus, StateStatus,
};
use rules::estimators::{Estimated, Estimates, NoEstimate};

/// Half the 95 % interval of a normal distribution, in standard deviations.
const HALF_INTERVAL: f64 = 1.96;

/// Time of the box in milliseconds since 1970, rounded down.
#[must_use]
pub fn to_milliseconds(at_ns: TimeNs) -> i64 {
    at_ns.div_euclid(1_000_000)
}

#[expect(clippy::cast_precision_loss, reason = "an age or a stay of less than a hundred days")]
fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}

/// Every channel that a source provides, with value, unit, age and source.
#[must_use]
pub fn list_channels(sample: &Sample, feed: &SampleFeed) -> Vec<ChannelStatus> {
    sample.provided_slots().map(|(id, slot)| build_channel_status(id, slot, feed.find_origin_name(id))).collect()
}

fn build_channel_status(id: ChannelId, slot: &Slot, origin: Option<&str>) -> ChannelStatus {
    let (value, missing) = match &slot.value {
        // The digits that the history keeps: every view shows one number.
        Ok(Value::Number(number)) => (Some(NumberOrWord::Number(as_stored(id, *number))), None),
        Ok(Value::Text(text)) => (Some(NumberOrWord::Text(text.to_string())), None),
        Err(absence) => (None, Some(absence.as_word())),
    };
    let age_s = value.is_some().then(|| to_seconds(slot.age_ns));
    let source = origin.filter(|_| value.is_some()).map(str::to_owned);
    ChannelStatus { name: id.name(), value, unit: id.channel().unit, age_s, missing, source }
}

/// Figures without a standard deviation that are shown: of the load, and the witnesses of the wear.
const FIGURES: [&str; 4] = ["tool_limit_parts", "tool_life_share", "feed_in_force_pct", "learned_power_w"];

/// Every quantity that the estimators infer, with its uncertainty.
#[must_use]
pub fn list_estimates(estimates: &Estimates) -> Vec<EstimateStatus> {
    let mut all: Vec<EstimateStatus> = estimates
        .list_quantities()
        .into_iter()
        .map(|(name, estimated)| build_estimate_status(name, estimated))
        .collect();
    let mut own = *estimates;
    let figure = |name: &'static str| {
        let figure = own.figure_mut(name).copied()?;
        let (value, missing) = (figure.ok(), figure.err());
        Some(EstimateStatus {
            name,
            value: value.map(|number| round_as_stored(name, unit_of(name), number)),
            uncertainty: None,
            unit: unit_of(name),
            missing: missing.map(NoEstimate::as_word),
            why: missing.map(|reason| reason.to_string()),
        })
    };
    all.extend(FIGURES.into_iter().filter_map(figure));
    all
}

fn unit_of(name: &str) -> &'static str {
    ESTIMATES.iter().find(|row| row.0 == name).map_or("", |row| row.1)
}

fn build_estimate_status(name: &'static str, estimated: Estimated) -> EstimateStatus {
    let (value, missing) = (estimated.ok(), estimated.err());
    let unit = unit_of(name);
    EstimateStatus {
        name,
        value: value.map(|estimate| round_as_stored(name, unit, estimate.value)),
        uncertainty: value.map(|estimate| HALF_INTERVAL * estimate.sd),
        unit,
        missing: missing.map(NoEstimate::as_word),
        why: missing.map(|reason| reason.to_string()),
    }
}

/// What the machine is doing.
#[must_use]
pub fn build_state_status(pipeline: &Pipeline) -> StateStatus {
    let estimates = pipeline.estimates();
    StateStatus {
        word: estimates.state.as_word(),
        since_ms: to_milliseconds(estimates.since_ns),
        seconds: to_seconds((estimates.at_ns - estimates.since_ns).max(0)),
        seconds_per_state: pipeline.tally().seconds_per_state(),
        why: estimates.unknown_because.map(|reason| reason.to_string()),
        basis: estimates.basis.as_word(),
        basis_text: estimates.basis.to_string(),
        visibility: estimates.visibility.as_word(),
        no_load_origin: estimates.no_load_origin.as_word(),
        load_loss_origin: estimates.load_loss_origin.as_word(),
    }
}

/// Alarms that stand: the controller's own, then those of the scripts.
#[must_use]
pub fn list_alarms(pipeline: &Pipeline) -> Vec<AlarmStatus> {
    let controller = pipeline.journal().standing_alarm().map(|(text, since_ns)| AlarmStatus {
        code: "controller".to_owned(),
        severity: "critical".to_owned(),
        text: text.to_owned(),
        zh: text.to_owned(),
        since_ms: to_milliseconds(since_ns),
    });
    let scripts = pipeline.scripts().alarms().iter().map(|alarm| AlarmStatus {
        code: format!("{} ({})", alarm.name, alarm.script),
        severity: alarm.level.as_word().to_owned(),
        text: alarm.en.to_string(),
        zh: alarm.zh.to_string(),
        since_ms: to_milliseconds(alarm.since_ns),
    });
    controller.into_iter().chain(scripts).collect()
}

/// The way of an override to the machine.
#[must_use]
pub fn build_gate_status(pipeline: &Pipeline, written_pct: Option<f64>) -> GateStatus {
    let request = pipeline.scripts().decision().request.as_ref();
    let verdict = pipeline.verdict();
    let changed = verdict.filter(|verdict| verdict.outcome != GateOutcome::Permitted);
    let recent = pipeline.decisions().recent_changes();
    let armed = pipeline.gate().current_arming();
    GateStatus {
        mode: name_gate_mode(pipeline.gate()),
        wanted_pct: request.map(|request| request.pct),
        reason: request.map(|request| format!("{} ({})", request.reason, request.script)),
        permitted_pct: verdict.map(|verdict| f64::from(verdict.permitted.percent())),
        held: changed.map(Verdict::reason),
        written_pct,
        armed_by: armed.ok().map(|armed| armed.by.clone()),
        armed_until_ms: armed.ok().map(|armed| to_milliseconds(armed.until_ns)),
        disarmed: armed.err().map(|why| why.to_string()),
        offset: build_offset_status(pipeline),
        recent: recent
            .map(|change| DecisionStatus { at_ms: to_milliseconds(change.at_ns), text: change.text.clone() })
            .collect(),
    }
}

fn build_offset_status(pipeline: &Pipeline) -> Option<OffsetStatus> {
    let gate = pipeline.gate();
    let mode = match (gate.limits().offset.mode, gate.current_arming()) {
        (GateMode::Off, _) => return None,
        (GateMode::Armed, Ok(_)) => "armed",
        _ => "shadow",
    };
    let proposed =
        |axis| pipeline.scripts().decision().offsets.iter().find(|it| it.axis == axis).map(|it| it.offset_um);
    let one = |(axis, shift_um): (Axis, f64)| {
        let wanted_um = proposed(axis).filter(|um| um.is_finite());
        AxisShift { axis: axis.as_word(), wanted_um, shift_um }
    };
    Some(OffsetStatus { mode, axes: gate.offsets().shifts().map(one).collect() })
}

/// Armed is what is armed on the box, not what the configuration allows.
fn name_gate_mode(gate: &Gate) -> &'static str {
    match (gate.limits().mode, gate.current_arming()) {
        (GateMode::Off, _) => "off",
        (GateMode::Armed, Ok(_)) => "armed",
        (GateMode::Shadow | GateMode::Armed, _) => "shadow",
    }
}

/// Scripts, each with why its newest text is not in charge.
#[must_use]
pub fn list_scripts(pipeline: &Pipeline) -> Vec<ScriptStatus> {
    let status = pipeline.scripts().status();
    let refused = |file: &str| status.refused.iter().find(|problem| problem.file == file).map(ToString::to_string);
    let known = status.scripts.iter().map(|script| ScriptStatus {
        file: script.file.to_string(),
        version: format!("{:016x}", script.version)[..8].to_owned(),
        condition: script.condition.as_word(),
        error: refused(&script.file).or_else(|| script.condition.problem().map(ToString::to_string)),
    });
    let new =
        status.refused.iter().filter(|problem| !status.scripts.iter().any(|script| *script.file == *problem.file));
    let never = new.map(|problem| ScriptStatus {
        file: problem.file.clone(),
        version: String::new(),
        condition: "refused",
        error: Some(problem.to_string()),
    });
    known.chain(never).collect()
}
