//! A machine in the middle of an ordinary cut, and everything that can be wrong with it.

use adapters::clock::SECOND_NS;
use adapters::words::{execution, mode, operation};
use adapters::{Absence, ChannelId, Sample, Slot, Value};
use gateway::config::{self, BUILT_IN_TEXT, GateMode};
use gateway::gate::{AuditPath, Hold};
use rules::estimators::{Estimates, State};
use rules::script::OverrideRequest;
use std::path::Path;

pub(crate) const TICK_NS: i64 = SECOND_NS / 10;

pub(crate) fn id(name: &str) -> ChannelId {
    ChannelId::from_name(name).expect("a channel")
}

pub(crate) fn set_number(sample: &mut Sample, name: &str, number: f64) {
    sample.set_slot(id(name), Slot { value: Value::from_number(number), age_ns: 0 });
}

pub(crate) fn set_text(sample: &mut Sample, name: &str, text: &str) {
    sample.set_slot(id(name), Slot { value: Ok(Value::Text(text.into())), age_ns: 0 });
}

/// An audit that takes everything.
struct Stored;

impl AuditPath for Stored {
    fn is_live(&self) -> bool {
        true
    }
}

pub(crate) fn stored() -> Box<dyn AuditPath> {
    Box::new(Stored)
}

/// A machine in the middle of an ordinary cut.
pub(crate) fn cutting(at_ns: i64) -> (Sample, Estimates) {
    let mut sample = Sample::new_empty(at_ns);
    for (name, number) in [("feed_mm_min", 200.0), ("spindle_speed_rpm", 1000.0), ("spindle_power_w", 2000.0)] {
        set_number(&mut sample, name, number);
    }
    set_text(&mut sample, "mode", mode::AUTOMATIC);
    set_text(&mut sample, "execution", execution::ACTIVE);
    set_text(&mut sample, "alarm", "");
    let mut estimates = Estimates::without_samples(at_ns);
    estimates.state = State::Cutting;
    (sample, estimates)
}

pub(crate) fn limits(mode: GateMode) -> config::GateConfig {
    let config = config::parse("test", BUILT_IN_TEXT, Path::new(""), []).expect("it is accepted");
    config::GateConfig { mode, source: Some("test".to_owned()), ..config.gate }
}

pub(crate) fn asking(pct: f64) -> OverrideRequest {
    OverrideRequest { pct, reason: "test".into(), script: "test.rhai".into(), version: 1 }
}

/// One thing that is wrong in an otherwise ordinary cut, and why 100 % is held then.
pub(crate) type Case = (&'static str, fn(&mut Sample, &mut Estimates), Hold);

/// What stands in the way of an override and of an offset alike.
pub(crate) fn common_cases() -> Vec<Case> {
    let missing = |name: &str, why| Hold::Missing(id(name), why);
    vec![
        ("unknown state", |_, estimates| estimates.state = State::Unknown, Hold::StateUnknown),
        ("alarm", |it, _| set_text(it, "alarm", "PS0010"), Hold::Alarm),
        ("manual", |it, _| set_text(it, "mode", mode::MANUAL), Hold::Manual),
        ("MDI", |it, _| set_text(it, "mode", mode::MANUAL_DATA_INPUT), Hold::Mdi),
        ("single block", |it, _| set_text(it, "mode", mode::SEMI_AUTOMATIC), Hold::SingleBlock),
        ("edit", |it, _| set_text(it, "mode", mode::EDIT), Hold::NotAutomatic),
        ("a mode nobody knows", |it, _| set_text(it, "mode", "AUTO?"), Hold::UnknownWord(id("mode"))),
        ("an execution nobody knows", |it, _| set_text(it, "execution", "RUN"), Hold::UnknownWord(id("execution"))),
        ("feed hold", |it, _| set_text(it, "execution", execution::FEED_HOLD), Hold::FeedHold),
        (
            "no mode",
            |it, _| it.set_slot(id("mode"), Slot::from_absence(Absence::Timeout)),
            missing("mode", Absence::Timeout),
        ),
        (
            "an old mode",
            |it, _| it.set_slot(id("mode"), Slot::from_absence(Absence::Stale)),
            missing("mode", Absence::Stale),
        ),
        (
            "an old execution",
            |it, _| it.set_slot(id("execution"), Slot::from_absence(Absence::Stale)),
            missing("execution", Absence::Stale),
        ),
        (
            "a silent alarm",
            |it, _| it.set_slot(id("alarm"), Slot::from_absence(Absence::Stale)),
            missing("alarm", Absence::Stale),
        ),
    ]
}

/// What stands in the way of an override.
pub(crate) fn cases() -> Vec<Case> {
    let missing = |name: &str, why| Hold::Missing(id(name), why);
    let mut cases = common_cases();
    cases.extend::<[Case; 12]>([
        ("rapid flag", |it, _| set_number(it, "rapid", 1.0), Hold::Rapid),
        ("rapid state", |_, estimates| estimates.state = State::Rapid, Hold::Rapid),
        ("threading", |it, _| set_text(it, "operation", operation::THREADING), Hold::Threading),
        ("tapping", |it, _| set_text(it, "operation", operation::TAPPING), Hold::Tapping),
        ("single block switch", |it, _| set_number(it, "single_block", 1.0), Hold::SingleBlock),
        ("dry run", |it, _| set_number(it, "dry_run", 1.0), Hold::DryRun),
        ("stopped", |it, _| set_text(it, "execution", execution::STOPPED), Hold::NotRunning),
        ("interrupted", |it, _| set_text(it, "execution", execution::INTERRUPTED), Hold::NotRunning),
        ("ready", |it, _| set_text(it, "execution", execution::READY), Hold::NotRunning),
        (
            "no feed",
            |it, _| it.set_slot(id("feed_mm_min"), Slot::from_absence(Absence::Disconnected)),
            missing("feed_mm_min", Absence::Disconnected),
        ),
        (
            "old speed",
            |it, _| it.set_slot(id("spindle_speed_rpm"), Slot { value: Value::from_number(1000.0), age_ns: SECOND_NS }),
            missing("spindle_speed_rpm", Absence::Stale),
        ),
        (
            "no load",
            |it, _| it.set_slot(id("spindle_power_w"), Slot::from_absence(Absence::Stale)),
            Hold::OnlyEstimated,
        ),
    ]);
    cases
}

/// A generator of numbers for the random test: cheap, seeded, of no quality that matters here.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    pub(crate) fn request(&mut self) -> Option<OverrideRequest> {
        let special = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 300.0, 255.0, 254.0, 0.0, -0.0, 1e300, 49.999];
        match self.next() % 4 {
            0 => None,
            1 => Some(asking(special[(self.next() % special.len() as u64) as usize])),
            2 => Some(asking(f64::from_bits(self.next() << 33 | self.next()))),
            _ => Some(asking((self.next() % 2_000) as f64 / 10.0)),
        }
    }
}
