//! The thermal law beside the running machine: predicted error, residual where a reading comes, the offset against it, and the
//! pulses that a pulse inserter has to insert.
//!
//! The law comes from `identify thermal --model`; readings of `thermal_error_um` (a probe, a gauge, a displacement sensor) correct
//! it by bounded steps, and what was learned is kept in `thermal.json` of the data directory. The offset is proposed to the gate
//! only where the configuration says so; the gate decides, as about every offset.

pub mod outside;
mod sensors;

use super::health::Health;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{Absence, ChannelId, Sample};
use gateway_base::cannot_run::CannotRun;
use gateway_base::log::{Notice, Severity};
use gateway_base::state_file;
use gateway_config::{self as config, Config};
use gateway_history::{ExtraSeries, ExtraValue};
use gateway_status::{AlarmStatus, StatusProblem};
use outside::OutsideWatch;
use rules::estimators::thermal::{
    AxisSituation, Compensator, Corrected, FollowSettings, HoldReason, SensorModel, SensorWatch, ThermalFollower,
    ThermalModel, ThermalPrediction,
};
use rules::script::OffsetProposal;
use sensors::{SOURCE, SensorAlarms};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What was learned from readings, in the data directory.
const MEMORY: &str = "thermal.json";
/// The law looks at the temperatures so often: heat is slow.
const EVERY_NS: i64 = SECOND_NS;
/// A sensor that reads all the time teaches so often at most: readings closer than this say the same.
const READING_EVERY_NS: i64 = 60 * SECOND_NS;
/// How many series there are.
const COUNT: usize = 6;

/// The thermal law beside the running machine: prediction, correction, offset and pulses.
pub struct Thermal {
    settings: config::ThermalConfig,
    follower: ThermalFollower,
    compensator: Compensator,
    sensors: Vec<ChannelId>,
    temperatures_c: Vec<Result<f64, Absence>>,
    error: ChannelId,
    memory: PathBuf,
    notices: Vec<Notice>,
    last_ns: Option<TimeNs>,
    read_ns: Option<TimeNs>,
    held: Option<HoldReason>,
    /// Since when the temperatures have been inside the range of identification, and what was told last.
    outside: OutsideWatch,
    /// Which temperatures are believed, and what was told of the others.
    sensor_watch: SensorWatch,
    sensor_alarms: SensorAlarms,
    pulses: i64,
    values: [ExtraValue<'static>; COUNT],
    reason: Arc<str>,
    script: Arc<str>,
}

/// The law of the configuration; one that cannot be read predicts nothing, which is told and stands as a problem. Polling, history and gate do
/// not need it.
pub fn open_law(config: &Config, told: &mut Vec<Notice>) -> (Option<Thermal>, Vec<StatusProblem>) {
    let refused = match Thermal::from_config(config) {
        Ok(thermal) => return (thermal, Vec::new()),
        Err(refused) => refused,
    };
    let problem = StatusProblem {
        what: format!("no thermal error is predicted and no offset proposed from it: {}", refused.what),
        next: format!("{}; then start the box again", refused.next),
    };
    told.push(
        Notice::new(Severity::Error, "thermal_law_refused", problem.what.clone()).with_detail(problem.next.as_str()),
    );
    (None, vec![problem])
}

impl Thermal {
    /// The law of the configuration, with what readings have taught it before; `None` where none is configured.
    ///
    /// # Errors
    /// A file that cannot be read, a law of another machine, a sensor that no channel is.
    pub fn from_config(config: &Config) -> Result<Option<Self>, CannotRun> {
        let Some(path) = &config.thermal.model else { return Ok(None) };
        let next = "write the model anew with `cnc-gateway identify thermal --model`";
        let refused = |what: String| CannotRun::new(format!("{} {what}", path.display()), next);
        let text = std::fs::read_to_string(path).map_err(|error| refused(format!("cannot be read: {error}")))?;
        let model = ThermalModel::read(&text, &config.gateway.machine.name).map_err(refused)?;
        let mut names: Vec<&str> = Vec::new();
        for term in &model.law.terms {
            if !names.contains(&term.sensor.as_str()) {
                names.push(&term.sensor);
            }
        }
        let channel = |name: &&str| {
            ChannelId::from_name(name).ok_or_else(|| refused(format!("names {name:?}, which no channel is")))
        };
        let sensors = names.iter().map(channel).collect::<Result<Vec<_>, _>>()?;
        let error =
            ChannelId::from_name("thermal_error_um").ok_or_else(|| refused("needs thermal_error_um".to_owned()))?;
        let memory = config.gateway.data_dir.join(MEMORY);
        let (corrected, told) = restore_corrections(&memory, &model);
        let bounds = FollowSettings { step_um: config.thermal.step_um, total_um: config.thermal.total_um };
        let follower =
            ThermalFollower::new(corrected, &names, bounds).map_err(|refusal| refused(refusal.to_string()))?;
        let compensator = Compensator::new(config.thermal.compensation)
            .map_err(|error| CannotRun::new(error.to_string(), "see [thermal]"))?;
        Ok(Some(Self {
            settings: config.thermal.clone(),
            follower,
            compensator,
            sensor_watch: SensorWatch::new(SensorModel::from_law(&model.law, &names), sensors.len()),
            sensor_alarms: SensorAlarms::new(config.thermal.compensation.hold_s),
            temperatures_c: Vec::with_capacity(sensors.len()),
            sensors,
            error,
            memory,
            notices: told,
            last_ns: None,
            read_ns: None,
            held: None,
            outside: OutsideWatch::default(),
            pulses: 0,
            values: [ExtraValue::Missing("not_yet"); COUNT],
            reason: "thermal law".into(),
            script: "[thermal]".into(),
        }))
    }

    /// What is stored beside the channels.
    #[must_use]
    pub fn extra_series(&self) -> Vec<ExtraSeries> {
        let um = |name, en, zh| ExtraSeries::new_number(name, "um", en, zh);
        vec![
            um("thermal_predicted_um", "Thermal error that the law predicts", "热误差预测值"),
            um("thermal_predicted_sd_um", "Standard deviation of the predicted thermal error", "热误差预测标准差"),
            um("thermal_residual_um", "Measured minus predicted thermal error", "热误差残差"),
            um("thermal_offset_um", "Offset against the predicted thermal error", "热误差补偿量"),
            ExtraSeries::new_number(
                "thermal_pulses",
                "1",
                "Pulses to insert since the last reference return",
                "应插入脉冲总数",
            ),
            ExtraSeries::new_number(
                "thermal_readings",
                "1",
                "Readings that have corrected the law",
                "修正模型的读数次数",
            ),
        ]
    }

    /// What is to be said at the start.
    pub fn report_notices(&mut self, health: &mut Health, at_ns: TimeNs) {
        for notice in self.notices.drain(..) {
            health.record_event(at_ns, SOURCE, &notice);
        }
        health.set_thermal_values(&self.values);
    }

    /// The alarms of sensors that are not believed.
    pub fn list_alarms(&self) -> impl Iterator<Item = AlarmStatus> {
        self.sensor_alarms.list_standing()
    }

    /// Takes one tick; the offset to propose, where that is configured.
    pub fn propose_offset(&mut self, sample: &Sample, health: &mut Health) -> Option<OffsetProposal> {
        let dt_ns = self.last_ns.map(|last_ns| sample.at_ns - last_ns);
        if dt_ns.is_none_or(|dt_ns| !(0..EVERY_NS).contains(&dt_ns)) {
            self.last_ns = Some(sample.at_ns);
            self.update_prediction(sample, dt_ns.unwrap_or(0).max(0), health);
            health.set_thermal_values(&self.values);
        }
        let ExtraValue::Number(offset_um) = self.values[3] else { return None };
        self.settings.propose.then(|| OffsetProposal {
            axis: self.settings.axis,
            offset_um,
            reason: self.reason.clone(),
            script: self.script.clone(),
            version: 0,
        })
    }

    fn update_prediction(&mut self, sample: &Sample, dt_ns: i64, health: &mut Health) {
        self.temperatures_c.clear();
        self.temperatures_c.extend(self.sensors.iter().map(|channel| sample.number(*channel)));
        let stand_in_sd_um = self.sensor_watch.replace_doubted(sample.at_ns, &mut self.temperatures_c);
        let mut predicted = self.follower.predictor_mut().predict_error(sample.at_ns, &self.temperatures_c);
        if let Ok(prediction) = &mut predicted {
            prediction.error_um.sd = prediction.error_um.sd.hypot(stand_in_sd_um);
        }
        let sd_um = predicted.as_ref().ok().map(|it| it.error_um.sd);
        self.sensor_alarms.follow_watch(sample.at_ns, &self.sensor_watch, &self.sensors, sd_um, health);
        let residual = match &predicted {
            Ok(prediction) => self.compare_with_reading(prediction, sample, health),
            Err(_) => ExtraValue::Missing("no_prediction"),
        };
        let dt_s = dt_ns as f64 / SECOND_NS as f64;
        let step = self.compensator.advance_compensation(dt_s, predicted.as_ref().ok(), AxisSituation::default());
        let names: Vec<&str> = self.sensors.iter().map(|channel| channel.name()).collect();
        if let Some(notice) = self.outside.watch_step(sample.at_ns, predicted.as_ref().ok(), &step, &names) {
            health.record_event(sample.at_ns, SOURCE, &notice);
        }
        self.pulses += step.increment_pulses;
        let of = |value: fn(&ThermalPrediction) -> f64| match &predicted {
            Ok(prediction) => ExtraValue::Number(value(prediction)),
            Err(reason) => ExtraValue::Missing(reason.as_word()),
        };
        #[expect(clippy::cast_precision_loss, reason = "pulses and readings are few")]
        let (pulses, readings) = (self.pulses as f64, self.follower.readings() as f64);
        self.values = [
            of(|it| it.error_um.value),
            of(|it| it.error_um.sd),
            residual,
            ExtraValue::Number(step.value_um),
            ExtraValue::Number(pulses),
            ExtraValue::Number(readings),
        ];
    }

    /// Measured less predicted at this moment; a reading corrects the law.
    fn compare_with_reading(
        &mut self,
        prediction: &ThermalPrediction,
        sample: &Sample,
        health: &mut Health,
    ) -> ExtraValue<'static> {
        let measured_um = sample.number(self.error);
        let residual = match prediction.compare_with_measured(measured_um).residual_um {
            Ok(residual) => ExtraValue::Number(residual.value),
            Err(_) => return ExtraValue::Missing("no_reading"),
        };
        let soon = self.read_ns.is_some_and(|then_ns| (0..READING_EVERY_NS).contains(&(sample.at_ns - then_ns)));
        if self.settings.learn && !soon && self.sensor_watch.list_doubted().is_empty() {
            self.read_ns = Some(sample.at_ns);
            let correction = self.follower.correct_with_reading(prediction, measured_um);
            if let Ok(text) = serde_json::to_string(&self.follower.to_corrected_law()) {
                health.put_learned(&self.memory, text);
            }
            if correction.held != self.held && correction.held == Some(HoldReason::Total) {
                let text = format!(
                    "readings have moved the thermal law by {} um, as far as they may: run `cnc-gateway identify thermal` again",
                    self.settings.total_um
                );
                health.record_event(
                    sample.at_ns,
                    SOURCE,
                    &Notice::new(Severity::Warning, "thermal_law_outdated", text),
                );
            }
            self.held = correction.held;
        }
        residual
    }
}

/// What readings have taught the law before, if it is still the same law.
fn restore_corrections(memory: &Path, model: &ThermalModel) -> (Corrected, Vec<Notice>) {
    let mut told = Vec::new();
    let fresh = || Corrected { identified: model.law.clone(), law: model.law.clone(), readings: 0 };
    let Some(state) = state_file::read(memory, |notice| told.push(notice)) else { return (fresh(), told) };
    match serde_json::from_str::<Corrected>(&state) {
        Ok(corrected) if corrected.identified == model.law => return (corrected, told),
        Ok(_) => {
            let text = "the thermal law is another one than before: corrections of the old one are dropped";
            told.push(Notice::new(Severity::Info, "thermal_law_new", text));
        }
        Err(error) => {
            let text =
                format!("{} cannot be read ({error}): the thermal law begins as it was identified", memory.display());
            told.push(Notice::new(Severity::Warning, "thermal_law_forgotten", text));
        }
    }
    (fresh(), told)
}
