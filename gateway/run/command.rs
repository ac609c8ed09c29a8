//! From the gate's verdict to the machine, and from the machine's answer to the history: orders of a person, the audit, the
//! worker that writes, the alarm when it has to let go.

use super::acknowledged_alarms::AcknowledgedAlarms;
use super::actuator_worker::{ActuatorReport, ActuatorWorker};
use super::facts::FactMarks;
use super::health::Health;
use super::network_requests::{ControlState, NetworkRequests};
use super::offset_commands::{self, OffsetCommands};
use super::report::to_milliseconds;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{ChannelId, Sample};
use gateway_base::log::{Notice, Severity};
use gateway_config::{self as config, GateMode};
use gateway_control::{self as control, OrderReceiver, PostedRow, QueuedOrder, Reply};
use gateway_gate::offset::{Moved, OffsetOrder};
use gateway_gate::{ArmError, Armed, AskOutcome, Disarmed, Fault, Gate, Occasion, ScriptRequest, Verdict, audit};
use gateway_history::{Alarm, AlarmClear, Audit, ReactionTime};
use gateway_pipeline::Pipeline;
use gateway_status::{Acknowledged, AlarmStatus, StatusProblem};
use rules::estimators::StateBasis;
use std::time::Duration;

/// Who raises the alarm.
const SOURCE: &str = "gate";
const CODE: &str = "gate_disarmed";
/// Rows of the page that are accounted for at a time, and requests of the network.
pub(super) const ROWS_AT_ONCE_MAX: usize = 32;

/// The way from the gate's verdict to the machine, and back into history and audit.
pub struct Commands {
    actuator_worker: ActuatorWorker,
    offset_commands: OffsetCommands,
    /// Name of the source that is written to.
    target: String,
    pub(super) orders: OrderReceiver,
    acknowledged_alarms: AcknowledgedAlarms,
    pub(super) network: NetworkRequests,
    /// The override at the control.
    pub(super) control: ControlState,
    pub(super) fact_marks: FactMarks,
    trail: audit::Trail,
    /// Who armed it last.
    by: String,
    was_armed: bool,
    /// Since when, English, Chinese.
    alarm: Option<(TimeNs, String, String)>,
    written: Option<f64>,
    begun: bool,
    place: [Option<ChannelId>; 3],
}

impl Commands {
    /// Commands that this worker writes to the source of this name; `fact_marks` are those of the facts that are stored already.
    #[must_use]
    pub fn new(
        actuator_worker: ActuatorWorker,
        shifting: OffsetCommands,
        target: String,
        (inbox, fact_marks): (OrderReceiver, FactMarks),
    ) -> Self {
        Self {
            actuator_worker,
            offset_commands: shifting,
            target,
            orders: inbox,
            acknowledged_alarms: AcknowledgedAlarms::default(),
            network: NetworkRequests::default(),
            control: ControlState::default(),
            fact_marks,
            trail: audit::Trail::default(),
            by: String::new(),
            was_armed: false,
            alarm: None,
            written: None,
            begun: false,
            place: ["program", "block", "tool"].map(ChannelId::from_name),
        }
    }

    /// What the page has to account for: who signed in, what was refused, what was changed.
    fn store_posted_rows(&mut self, at_ns: TimeNs, health: &mut Health) {
        for PostedRow { row, stored } in self.orders.rows.try_iter().take(ROWS_AT_ONCE_MAX) {
            let kept = health.is_storing() && health.append_audit(Audit { at_ns, ..row });
            let _gone = stored.send(kept);
        }
    }

    /// Between two ticks: an arming that an order has ended is at once seen by the hand, which gives the machine back.
    pub fn let_go(&mut self, pipeline: &mut Pipeline, sample: &Sample, now_ns: TimeNs, health: &mut Health) {
        if !self.was_armed || pipeline.gate().current_arming().is_ok() {
            return;
        }
        if let Some(verdict) = pipeline.verdict().copied() {
            let mut said = Vec::new();
            self.actuator_worker.submit_verdict(&Verdict { armed: false, ..verdict }, &[], now_ns, |it| said.push(it));
            self.accept_reports(said, sample, pipeline.gate_mut(), health);
        }
        self.follow_arming(pipeline.gate_mut(), sample.at_ns, health);
    }

    /// Before the tick is decided: what persons at the box have ordered meanwhile.
    pub fn run_orders(&mut self, gate: &mut Gate, sample: &Sample, health: &mut Health) {
        if !std::mem::replace(&mut self.begun, true) {
            self.record_audit(audit::audit_start(gate.limits(), sample.at_ns), gate, health);
        }
        while let Ok(QueuedOrder { order, reply }) = self.orders.orders.try_recv() {
            let answer = self.run_order(&order, gate, sample, health);
            // Whoever has gone meanwhile finds it in the audit.
            let _gone = reply.send(answer);
        }
        self.store_posted_rows(sample.at_ns, health);
        self.store_facts(sample.at_ns, health);
        self.hear_network(gate, sample.at_ns, health);
        if !health.is_storing() {
            gate.disarm(Disarmed::NoAudit);
        }
    }

    pub(super) fn acknowledge_alarm(&mut self, code: &str, by: &str, at_ns: TimeNs) -> Reply {
        match self.acknowledged_alarms.acknowledge_alarm(code, by, at_ns) {
            true => Reply::from_success(format!("the alarm {code} was seen; it stands until its reason has gone")),
            false => Reply::from_refusal(format!("no alarm {code:?} stands")),
        }
    }

    fn run_order(&mut self, order: &control::Order, gate: &mut Gate, sample: &Sample, health: &mut Health) -> Reply {
        let at_ns = sample.at_ns;
        match order {
            control::Order::Arm { by, for_s } => self.arm(by, *for_s, gate, sample, health),
            control::Order::Disarm { by } => {
                let was = gate.current_arming().is_ok();
                gate.disarm(Disarmed::Person);
                self.by.clone_from(by);
                if !was {
                    self.record_audit(audit::audit_order("disarmed", "was_not_armed", "", by, at_ns), gate, health);
                }
                let text = if was { "disarmed; the machine is given back to its dial" } else { "it was not armed" };
                Reply::from_success(text)
            }
            control::Order::Acknowledge { by } => {
                gate.acknowledge_requests();
                self.record_audit(
                    audit::audit_order("acknowledged", "done", "a feed hold or stop was seen to", by, at_ns),
                    gate,
                    health,
                );
                Reply::from_success("the next feed hold or stop may pass")
            }
            control::Order::AcknowledgeAlarm { by, code } => {
                let reply = self.acknowledge_alarm(code, by, at_ns);
                let outcome = if reply.done { "done" } else { "refused" };
                let row = audit::audit_order("acknowledged", outcome, &format!("alarm {code}"), by, at_ns);
                self.record_audit(row, gate, health);
                reply
            }
        }
    }

    fn arm(&mut self, by: &str, for_s: Option<f64>, gate: &mut Gate, sample: &Sample, health: &mut Health) -> Reply {
        let at_ns = sample.at_ns;
        let lasts = for_s.map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::ZERO));
        self.end_unarmed_requests(gate, at_ns, health);
        let armed = match health.is_storing() {
            true => gate.arm(by, lasts, at_ns).cloned(),
            false => Err(ArmError::NoAudit),
        };
        match armed {
            Ok(armed) => {
                self.by = by.to_owned();
                // Whoever disarms before the next tick ends an arming too.
                self.was_armed = true;
                self.record_audit(audit::audit_arming(&armed), gate, health);
                self.clear_alarm(at_ns, health);
                let arming = describe_arming(&armed, &self.target, gate.limits());
                let text = format!("{arming}; {}", StateBasis::from_sample(sample));
                health.record_event(at_ns, SOURCE, &Notice::new(Severity::Warning, "gate_armed", text.clone()));
                Reply::from_success(text)
            }
            Err(why) => {
                self.record_audit(audit::audit_order("armed", "refused", &why.to_string(), by, at_ns), gate, health);
                Reply::from_refusal(why.to_string())
            }
        }
    }

    /// What cannot be accounted for is not written.
    pub(super) fn record_audit(&self, row: Audit, gate: &mut Gate, health: &mut Health) {
        if !health.append_audit(row) {
            gate.disarm(Disarmed::NoAudit);
        }
    }

    /// After the tick was decided: into the audit first, then to the machine.
    pub fn apply_verdict(
        &mut self,
        pipeline: &mut Pipeline,
        asks: &[ScriptRequest],
        sample: &Sample,
        now_ns: TimeNs,
        health: &mut Health,
    ) {
        let Some(mut verdict) = pipeline.verdict().copied() else { return };
        let row = self.trail.audit_override(pipeline.scripts().decision().request.as_ref(), &verdict);
        let gate = pipeline.gate_mut();
        let judged = gate.judge_requests(asks, sample);
        row.into_iter().for_each(|row| self.record_audit(row, gate, health));
        let mut sent = Vec::new();
        for (ask, outcome) in judged {
            match outcome {
                AskOutcome::Sent => sent.push(ask),
                _ => self.record_audit(audit::audit_ladder_request(&ask, outcome, None, sample.at_ns), gate, health),
            }
        }
        verdict.armed &= gate.current_arming().is_ok();
        let mut said = Vec::new();
        self.actuator_worker.submit_verdict(&verdict, &sent, now_ns, |it| said.push(it));
        self.actuator_worker.receive_reports(|it| said.push(it));
        self.accept_reports(said, sample, gate, health);
        self.apply_offsets(pipeline, sample, now_ns, health);
        self.follow_arming(pipeline.gate_mut(), sample.at_ns, health);
        self.settle_requests(pipeline, &verdict, health);
    }

    /// Offsets: into the audit first, then to the machine.
    fn apply_offsets(&mut self, pipeline: &mut Pipeline, sample: &Sample, now_ns: TimeNs, health: &mut Health) {
        let verdicts = pipeline.judge_offsets(sample);
        let rows =
            self.offset_commands.build_audit_rows(&pipeline.scripts().decision().offsets, &verdicts, pipeline.gate());
        let looks = pipeline.list_readbacks(sample);
        let gate = pipeline.gate_mut();
        rows.into_iter().for_each(|row| self.record_audit(row, gate, health));
        let orders: Vec<OffsetOrder> = verdicts.iter().filter_map(|verdict| verdict.order).chain(looks).collect();
        let mut said = Vec::new();
        self.actuator_worker.order_shifts(&orders, gate.writes_offsets(), now_ns, |it| said.push(it));
        self.accept_reports(said, sample, gate, health);
    }

    fn record_offset_result(&mut self, moved: &Moved, sample: &Sample, gate: &mut Gate, health: &mut Health) {
        if let Some(row) = self.offset_commands.build_audit_row(moved) {
            let command = offset_commands::build_command(moved, &row, &self.target_of_offsets(gate));
            self.record_audit(row, gate, health);
            command.into_iter().for_each(|row| health.keep_record(row.into()));
        }
        self.offset_commands.accept_answer(moved, gate, health);
        moved.fault().into_iter().for_each(|fault| self.raise_fault(&fault, sample.at_ns, gate, health));
    }

    fn target_of_offsets(&self, gate: &Gate) -> String {
        gate.limits().offset.source.clone().unwrap_or_else(|| self.target.clone())
    }

    fn accept_reports(&mut self, said: Vec<ActuatorReport>, sample: &Sample, gate: &mut Gate, health: &mut Health) {
        said.into_iter().for_each(|it| self.accept_report(it, sample, gate, health));
    }

    fn accept_report(&mut self, said: ActuatorReport, sample: &Sample, gate: &mut Gate, health: &mut Health) {
        match said {
            ActuatorReport::Written(written) => {
                self.control = self.control.after_write(&written);
                let asks = matches!(written.occasion, Occasion::Change | Occasion::SignOfLife);
                self.written = asks.then(|| f64::from(written.asked.percent()));
                self.trail.write(&written).into_iter().for_each(|row| self.record_audit(row, gate, health));
                let command = self.trail.command_from_write(&written, &self.target);
                command.into_iter().for_each(|row| health.keep_record(row.into()));
                written.fault.into_iter().for_each(|fault| self.raise_fault(&fault, sample.at_ns, gate, health));
            }
            ActuatorReport::Seen(reaction) => {
                self.control = ControlState::Shows(reaction);
                self.record_audit(audit::audit_reaction(&reaction), gate, health);
                let [program, block, tool] =
                    self.place.map(|id| id.and_then(|id| sample.text(id)).unwrap_or_default().to_owned());
                health.keep_record(ReactionTime { program, block, tool, ..audit::reaction_times(&reaction) }.into());
            }
            ActuatorReport::Fault(fault) => self.raise_fault(&fault, sample.at_ns, gate, health),
            ActuatorReport::Moved(moved) => self.record_offset_result(&moved, sample, gate, health),
            ActuatorReport::Withdrawn(order) => gate.offsets_mut().withdraw_order(order),
            ActuatorReport::Asked(ask, failed) => {
                let row = audit::audit_ladder_request(&ask, AskOutcome::Sent, failed.as_deref(), sample.at_ns);
                self.record_audit(row, gate, health);
                if let Some(failed) = failed {
                    health.record_event(sample.at_ns, SOURCE, &Notice::new(Severity::Error, "ask_failed", failed));
                }
            }
        }
    }

    fn raise_fault(&mut self, fault: &Fault, at_ns: TimeNs, gate: &mut Gate, health: &mut Health) {
        gate.disarm(fault.disarm_reason());
        let en = fault.to_string();
        if self.alarm.is_none() {
            let (code, source, severity) = (CODE.to_owned(), SOURCE.to_owned(), "critical".to_owned());
            let zh = fault.describe_in_chinese().to_owned();
            self.alarm = Some((at_ns, en.clone(), zh.clone()));
            health.keep_record(Alarm { at_ns, code, source, severity, en: en.clone(), zh }.into());
            Notice::new(Severity::Error, CODE, en).write_to_logs();
        } else {
            // What follows from the first fault is told, and raises no alarm of its own.
            health.record_event(at_ns, SOURCE, &Notice::new(Severity::Error, "gate_fault", en));
        }
    }

    fn clear_alarm(&mut self, at_ns: TimeNs, health: &mut Health) {
        if self.alarm.take().is_some() {
            health.keep_record(AlarmClear { at_ns, code: CODE.to_owned(), source: SOURCE.to_owned() }.into());
        }
    }

    fn follow_arming(&mut self, gate: &mut Gate, at_ns: TimeNs, health: &mut Health) {
        let armed = gate.current_arming().is_ok();
        if std::mem::replace(&mut self.was_armed, armed) && !armed {
            let why = gate.current_arming().err().unwrap_or(Disarmed::Person);
            let by = if why == Disarmed::Person { self.by.clone() } else { String::new() };
            self.record_audit(audit::audit_disarming(why, &by, at_ns), gate, health);
            let text = format!("the gate is disarmed: {why}");
            health.record_event(at_ns, SOURCE, &Notice::new(Severity::Warning, CODE, text));
        }
    }

    /// Ends an arming, and accounts for it.
    pub fn end_arming(&mut self, why: Disarmed, sample: &Sample, gate: &mut Gate, health: &mut Health) {
        gate.disarm(why);
        self.follow_arming(gate, sample.at_ns, health);
    }

    /// Gives the machine back and ends.
    pub fn close(&mut self, sample: &Sample, gate: &mut Gate, health: &mut Health) {
        let mut said = Vec::new();
        let orders = gate.offsets().list_restore_orders();
        self.actuator_worker.order_shifts(&orders, false, sample.at_ns, |it| said.push(it));
        self.actuator_worker.close(|it| said.push(it));
        self.accept_reports(said, sample, gate, health);
        self.close_requests(sample.at_ns, gate, health);
        // What the page has asked to be noted just before the end is noted too.
        self.store_posted_rows(sample.at_ns, health);
    }

    /// Which alarms have been seen; told which ones stand.
    pub fn update_acknowledged(&mut self, standing: &[AlarmStatus]) -> Vec<Acknowledged> {
        self.acknowledged_alarms.update_standing(standing);
        self.acknowledged_alarms.list_alarms()
    }

    /// What stands in the machine's mailbox, percent.
    #[must_use]
    pub fn written_pct(&self) -> Option<f64> {
        self.written
    }

    /// The alarm that stands.
    pub fn standing_alarm(&self) -> Option<AlarmStatus> {
        self.alarm.as_ref().map(|(since_ns, text, zh)| AlarmStatus {
            code: CODE.to_owned(),
            severity: "critical".to_owned(),
            text: text.clone(),
            zh: zh.clone(),
            since_ms: to_milliseconds(*since_ns),
        })
    }

    /// What is wrong with the way to the machine.
    pub fn list_problems(&self, gate: &Gate) -> impl Iterator<Item = StatusProblem> {
        let next = "find the reason, then arm again with `cnc-gateway arm`".to_owned();
        let alarm = self.alarm.as_ref().map(|(_, text, _)| StatusProblem { what: text.clone(), next });
        alarm.into_iter().chain(self.offset_commands.list_problems(gate))
    }
}

fn describe_arming(armed: &Armed, target: &str, limits: &config::GateConfig) -> String {
    let what = match (limits.mode, limits.offset.mode) {
        (GateMode::Armed, GateMode::Armed) => "overrides and offsets are",
        (_, GateMode::Armed) => "offsets are",
        _ => "overrides are",
    };
    let seconds = (armed.until_ns - armed.since_ns) / SECOND_NS;
    format!("the gate is armed by {} for {seconds} s: {what} written to {target}", armed.by)
}
