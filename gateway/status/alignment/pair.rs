//! A controller and a meter: what is gathered, what is known, what is in force.

use super::background::LagResult;
use super::delay_status::{AlignmentStatus, SERIES};
use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::merge::SourceId;
use adapter_core::{ChannelId, Reading};
use gateway_config::AlignmentUse;
use gateway_history::ExtraValue;
use rules::estimators::alignment::{Collector, Lag, LagFollower, LagWatch, NotIdentifiable, PowerPoint, SpeedPoint};

/// Half a 95 % interval in standard deviations.
const Z95: f64 = 1.96;
/// Pause between two estimates: at first, and at most.
const PAUSE_NS: (i64, i64) = (60 * SECOND_NS, 600 * SECOND_NS);

pub(super) struct Pair {
    controller: SourceId,
    pub(super) meter: SourceId,
    speed: ChannelId,
    power: ChannelId,
    names: [String; 2],
    purpose: AlignmentUse,
    pub(super) collector: Collector,
    pub(super) follower: LagFollower,
    watch: LagWatch,
    found: Option<LagResult>,
    /// What was measured before this says nothing of the lag now, s.
    valid_since_s: f64,
    pause_ns: i64,
    due_ns: TimeNs,
}

impl Pair {
    /// Controller and meter, their channels, and their names.
    pub(super) fn new(
        [controller, meter]: [SourceId; 2],
        [speed, power]: [ChannelId; 2],
        names: [String; 2],
        purpose: AlignmentUse,
    ) -> Self {
        Self {
            controller,
            meter,
            speed,
            power,
            names,
            purpose,
            collector: Collector::new(),
            follower: LagFollower::default(),
            watch: LagWatch::default(),
            found: None,
            valid_since_s: f64::NEG_INFINITY,
            pause_ns: PAUSE_NS.0,
            due_ns: TimeNs::MIN,
        }
    }

    pub(super) fn observe_readings(
        &mut self,
        source: SourceId,
        readings: Option<&[Reading]>,
        mut seconds: impl FnMut(TimeNs) -> f64,
    ) {
        if source != self.controller && source != self.meter {
            return;
        }
        let Some(readings) = readings else { return self.collector.discard_collected() };
        let wanted = if source == self.controller { self.speed } else { self.power };
        for reading in readings.iter().filter(|reading| reading.channel == wanted) {
            let Some(number) = reading.value.as_ref().ok().and_then(|value| value.as_number()) else { continue };
            let time_s = seconds(reading.stamp.mid_ns);
            if source == self.controller {
                self.collector.record_speed(SpeedPoint { time_s, speed_rpm: number });
            } else {
                self.collector.record_power(PowerPoint { time_s, power_w: number });
            }
        }
    }

    pub(super) fn is_for_merge(&self) -> bool {
        self.purpose == AlignmentUse::Merge
    }

    pub(super) fn is_due(&self, now_ns: TimeNs) -> bool {
        now_ns >= self.due_ns
    }

    /// Looks whether the newest change of speed has the lag that is known. When it does not, nothing is known until the next estimate:
    /// the kind and the text of an event.
    pub(super) fn check_newest_change(&mut self, now_ns: TimeNs) -> Option<(&'static str, String)> {
        let transient = self.collector.take_newest_transient()?;
        let Some(Ok(known)) = &self.found else { return None };
        let change = self.watch.observe_transient(transient, known)?;
        self.collector.keep_newest(LagWatch::TRANSIENTS);
        self.follower.forget_aim();
        self.valid_since_s = change.since_s;
        (self.pause_ns, self.due_ns) = (PAUSE_NS.0, now_ns);
        let reason = NotIdentifiable::Changed { from_s: change.from_s, to_s: change.to_s };
        self.found = Some(Err(reason));
        Some(("lag_unknown", format!("{}: {reason}", self.names[1])))
    }

    /// Takes an answer. The kind and the text of an event when there is something to tell.
    pub(super) fn accept_estimate(
        &mut self,
        found: LagResult,
        now_ns: TimeNs,
        now_s: f64,
    ) -> Option<(&'static str, String)> {
        // It was asked for before the lag changed.
        if found.as_ref().is_ok_and(|lag| lag.at_s < self.valid_since_s) {
            return None;
        }
        self.pause_ns = match &found {
            Ok(_) => PAUSE_NS.1,
            // That costs nothing, and the next change of speed may be the one that was missing.
            Err(NotIdentifiable::TooFewTransients { .. }) => PAUSE_NS.0,
            Err(_) => (2 * self.pause_ns).min(PAUSE_NS.1),
        };
        self.due_ns = now_ns + self.pause_ns;
        let aim_s = found.as_ref().ok().and_then(|lag| self.follower.aim_at_estimate(lag, now_s));
        let event = match (&self.found, &found) {
            (_, Ok(lag)) => aim_s.map(|aim_s| self.describe_lag(lag, aim_s)),
            (Some(Ok(_)), Err(reason)) => Some(("lag_unknown", format!("{}: {reason}", self.names[1]))),
            _ => None,
        };
        // A change that was seen says more than that there are too few transients since then.
        let keeps = matches!(
            (&self.found, &found),
            (Some(Err(NotIdentifiable::Changed { .. })), Err(NotIdentifiable::TooFewTransients { .. }))
        );
        if !keeps {
            self.found = Some(found);
        }
        event
    }

    fn describe_lag(&self, lag: &Lag, aim_s: f64) -> (&'static str, String) {
        let [controller, meter] = &self.names;
        let (lag_ms, width_ms) = (1e3 * lag.lag_s, 1e3 * lag.uncertainty_s);
        let text = format!("{meter} is {lag_ms:.0} ms (95 %: +-{width_ms:.0} ms) later than {controller}");
        let used = match self.purpose {
            AlignmentUse::Merge => format!("; its readings will be put back by {:.0} ms", 1e3 * aim_s),
            _ => "; it is shown only".to_owned(),
        };
        ("lag_known", format!("{text}{used}"))
    }

    pub(super) fn power_name(&self) -> &'static str {
        self.power.name()
    }

    /// The lag, or a word for why there is none.
    pub(super) fn lag(&self) -> Result<Lag, &'static str> {
        match &self.found {
            Some(found) => found.as_ref().copied().map_err(NotIdentifiable::as_word),
            None => Err("not_yet"),
        }
    }

    pub(super) fn build_status(&self) -> AlignmentStatus {
        let (lag, missing) = (self.lag().ok(), self.lag().err());
        let why = match &self.found {
            Some(Err(reason)) => Some(reason.to_string()),
            Some(Ok(_)) => None,
            None => Some("no change of spindle speed without cutting has been seen yet".to_owned()),
        };
        let drift = lag.and_then(|lag| lag.drift);
        AlignmentStatus {
            controller: self.names[0].clone(),
            meter: self.names[1].clone(),
            power: self.power.name(),
            purpose: self.purpose.as_word(),
            lag_s: lag.map(|lag| lag.lag_s),
            uncertainty_s: lag.map(|lag| lag.uncertainty_s),
            window_s: lag.map(|lag| lag.window_s),
            drift_ppm: drift.map(|drift| drift.ppm),
            drift_uncertainty_ppm: drift.map(|drift| drift.uncertainty_ppm),
            transients: lag.map(|lag| lag.transients),
            applied_s: if self.is_for_merge() { self.follower.applied_s() } else { 0.0 },
            missing,
            why,
        }
    }
}

/// The values of one tick, in the order of [`list_series`](super::delay_status::list_series).
pub(super) fn collect_values(pairs: [Option<&Pair>; 2]) -> [ExtraValue<'static>; SERIES] {
    let [spindle, total] = pairs.map(|pair| {
        let Some(pair) = pair else { return [ExtraValue::Missing("not_provided"); 3] };
        let lag = pair.lag();
        let applied = if pair.is_for_merge() { Ok(pair.follower.applied_s()) } else { Err("shown_only") };
        [lag.map(|lag| lag.lag_s), lag.map(|lag| lag.uncertainty_s / Z95), applied].map(ExtraValue::from)
    });
    let [a, b, c] = spindle;
    let [d, e, f] = total;
    [a, b, c, d, e, f]
}
