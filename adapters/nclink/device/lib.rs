//! The simulated machine as an NC-Link device: for trying scripts and other people's clients without a machine.
//!
//! | file | what |
//! |---|---|
//! | `tree` | the model that a probe is answered with, laid out like Huazhong's default model |
//! | `values` | what each data item is worth at a moment |
//! | `registers` | R, W, D, B and P memory, F and G from the machine, and the mailboxes that the ladder reads |
//! | `answer` | one request in, one answer out |
//! | `sampling` | messages of the sample channels |
//!
//! The device dials a broker, registers, answers probe, query, set and ping, sends its two sample channels and an event
//! whenever the alarm changes. When the broker goes it dials again every second; what was sampled meanwhile is gone, as
//! with a real device, and the times of the samples show it. The machine is computed every 5 ms; the milliseconds between
//! hold the last step.

mod answer;
#[cfg(test)]
mod model_change_tests;
mod registers;
mod sampling;
mod tree;
mod values;

use adapter_core::clock::Clock;
use mqtt::{MqttClient, MqttError, MqttMessage, Options, Qos};
use nclink::model::Model;
use nclink::topic::Subject;
use registers::SimulatedRegisters;
use sampling::ChannelSampler;
use serde_json::{Value, json};
use simulated::Simulated;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Where the gateway posts its override: see the table in [`mailbox`](nclink::mailbox).
pub const MAILBOX: &str = "D100";

/// Where the gateway posts its shifts: see the table in [`offset_mailbox`](nclink::offset_mailbox).
pub const OFFSETS: &str = "D110";

/// Between two attempts to reach the broker.
const REDIAL: Duration = Duration::from_secs(1);
/// Longest wait for a message: so soon a stop is seen.
const LOOK: Duration = Duration::from_millis(50);

/// What a device tells the one who runs it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DeviceEvent {
    /// It is at the broker, and answers.
    Connected,
    /// The broker cannot be used; it goes on trying.
    Failed(MqttError),
}

/// The simulated machine behind a serial number.
pub struct NcLinkDevice {
    serial: String,
    machine: Simulated,
    clock: Arc<dyn Clock>,
    model: Model,
    tree: Value,
    registers: SimulatedRegisters,
    samplers: Vec<ChannelSampler>,
    alarm: &'static str,
}

impl NcLinkDevice {
    /// A device that lives by this clock.
    #[must_use]
    pub fn new(serial: &str, machine: &Simulated, clock: Arc<dyn Clock>) -> Self {
        let tree = tree::build_tree(machine.settings().machine, serial);
        let model = Model::parse(&tree).unwrap_or_default();
        let samplers = model.samples.iter().filter_map(|channel| ChannelSampler::new(channel, &model)).collect();
        let registers = SimulatedRegisters::new(machine);
        let serial = serial.to_owned();
        Self { serial, machine: machine.clone(), clock, model, tree, registers, samplers, alarm: "" }
    }

    /// Serves until `stop` is set. Tells when it comes to the broker and when it loses it.
    pub fn run(&mut self, broker: &Options, stop: &AtomicBool, mut tell: impl FnMut(DeviceEvent)) {
        let mut failing = false;
        while !stop.load(Ordering::SeqCst) {
            let outcome = self.serve_broker(broker, stop, || tell(DeviceEvent::Connected));
            let Err(error) = outcome else { return };
            // An attempt that fails like the one before is not told again.
            if !(failing && matches!(error, MqttError::Unreachable { .. })) {
                tell(DeviceEvent::Failed(error.clone()));
            }
            failing = matches!(error, MqttError::Unreachable { .. });
            pause_before_redial(stop);
        }
    }

    fn serve_broker(&mut self, broker: &Options, stop: &AtomicBool, mut up: impl FnMut()) -> Result<(), MqttError> {
        let client = MqttClient::connect(broker)?;
        let asked = [Subject::Probe, Subject::Query, Subject::Set, Subject::Ping];
        client.subscribe_filters(&asked.map(|subject| subject.build_filter(&self.serial)), Qos::AtMostOnce)?;
        let register =
            json!({"@id": adapter_core::unique_id::generate_unique_id(), "deviceid": self.serial}).to_string();
        client.publish_message(&Subject::Register.build_topic(&self.serial), register.as_bytes(), Qos::AtLeastOnce)?;
        let now_ns = self.clock.now_ns();
        self.samplers.iter_mut().for_each(|sampler| sampler.begin_sampling(now_ns));
        up();
        while !stop.load(Ordering::SeqCst) {
            if let Some(message) = client.receive_message(self.compute_wait())? {
                self.answer_message(&client, &message)?;
            }
            self.upload_samples(&client)?;
            self.publish_alarm_event(&client)?;
        }
        Ok(())
    }

    /// Until the next upload, at most [`LOOK`].
    fn compute_wait(&self) -> Duration {
        let due_ns = self.samplers.iter().map(ChannelSampler::due_ns).min().unwrap_or(i64::MAX);
        let left_ns = (due_ns - self.clock.now_ns()).max(0).unsigned_abs();
        Duration::from_nanos(left_ns).min(LOOK)
    }

    fn answer_message(&mut self, client: &MqttClient, message: &MqttMessage) -> Result<(), MqttError> {
        let Some((subject, tail)) = Subject::from_topic(&message.topic, &self.serial) else { return Ok(()) };
        // Nothing at all counts as an empty request, as in other implementations.
        let said = if message.payload.is_empty() { Ok(json!({})) } else { serde_json::from_slice(&message.payload) };
        let (Some(topic), Ok(said)) = (self.answers_to(subject, tail), said) else { return Ok(()) };
        let answer = self.answer_request(subject, &said);
        client.publish_message(&topic, answer.to_string().as_bytes(), Qos::AtMostOnce)
    }

    /// Where the answer goes: a client that put its name behind the serial number gets it there.
    fn answers_to(&self, subject: Subject, tail: &str) -> Option<String> {
        let answer = match subject {
            Subject::Probe => Subject::ProbeAnswer,
            Subject::Query => Subject::QueryAnswer,
            Subject::Set => Subject::SetAnswer,
            Subject::Ping => Subject::Pong,
            _ => return None,
        };
        let topic = answer.build_topic(&self.serial);
        Some(if tail.is_empty() { topic } else { format!("{topic}/{tail}") })
    }

    fn upload_samples(&mut self, client: &MqttClient) -> Result<(), MqttError> {
        let now_ns = self.clock.now_ns();
        for sampler in &mut self.samplers {
            while let Some(message) = sampler.next(now_ns, &self.machine) {
                let topic = format!("{}/{}", Subject::Sample.build_topic(&self.serial), sampler.name());
                client.publish_message(&topic, message.to_string().as_bytes(), Qos::AtMostOnce)?;
            }
        }
        Ok(())
    }

    /// An alarm that comes or goes is an event.
    fn publish_alarm_event(&mut self, client: &MqttClient) -> Result<(), MqttError> {
        let now_ns = self.clock.now_ns();
        let alarm = self.machine.moment(now_ns).panel.alarm;
        if alarm == self.alarm {
            return Ok(());
        }
        self.alarm = alarm;
        let event = json!({"number": "1", "text": alarm, "active": !alarm.is_empty()});
        let message = json!({"@id": adapter_core::unique_id::generate_unique_id(), "id": "WARNING", "time": to_milliseconds(now_ns).to_string(), "event": event});
        client.publish_message(
            &Subject::Event.build_topic(&self.serial),
            message.to_string().as_bytes(),
            Qos::AtLeastOnce,
        )
    }
}

/// Milliseconds since 1970.
fn to_milliseconds(at_ns: i64) -> i64 {
    at_ns.div_euclid(1_000_000)
}

fn pause_before_redial(stop: &AtomicBool) {
    let mut left = REDIAL;
    while !stop.load(Ordering::SeqCst) && !left.is_zero() {
        let part = left.min(LOOK);
        std::thread::sleep(part);
        left -= part;
    }
}
