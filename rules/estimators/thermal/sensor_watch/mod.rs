//! Which temperatures are believed, and what stands in for one that is not.
//!
//! A sensor is lost, jumps, freezes, or says something that the others contradict. An offset that follows it then is worse than one
//! without it, and one that is withdrawn is worse than one that goes on with the others. So every sensor of a law is judged by three
//! marks: the rate (heat does not jump), flatness (a sensor that has always varied stands still while the others say that it must have
//! moved; or one whose noise was always there shows none) and agreement with the others ([`SensorModel`]). In the place of one that is not believed stands what the others say, beginning
//! with what it said last; the deviation of the prediction grows by what that costs.

use super::sensor_model::SensorModel;
use crate::estimate::Estimate;
use adapter_core::Absence;
use adapter_core::clock::{SECOND_NS, TimeNs};

/// A change beyond this plus the rate times the time is no heat: spindle noses and motors warm by .05 K/s at most, and coolant on a
/// sensor makes steps of some kelvin. Narrower calls a splash a fault; wider believes a fault of some micrometres.
const JUMP_K: f64 = 5.0;
const RATE_K_PER_S: f64 = 0.2;
/// After a longer time without a believed value the rate says nothing, ns.
const RATE_WITHIN_NS: i64 = 600 * SECOND_NS;
/// A sensor that varied is frozen where standing still for so long by chance is rarer than this,
const FLAT_CHANCE: f64 = 1e-9;
/// and for four times as long as it ever did while it was believed,
const FLAT_TIMES: f64 = 4.0;
/// and for so long, s,
const FLAT_S: f64 = 120.0;
/// while the others say that it has moved by this much at least, K, or by this share of what they can tell.
const FLAT_MOVED_K: f64 = 1.0;
const FLAT_MOVED_SD: f64 = 0.25;
/// A sensor that shows noise goes up and down by turns. One that has always done so and shows no noise for so long is frozen, whatever the
/// others say, and also where there are none, s. A slow sensor, or one with coarse steps, that stands still at night has no turns.
const SILENT_S: f64 = 600.0;
/// It shows noise where more than this share of its looks are turns: noise of half a step gives 0.44, of a step 0.56. One with less noise turns near the
/// ends of its steps alone, and may stand still for hours in between; with half a step, no turn in 60 looks has a chance of 1e-10.
const TURNS_LEAST: f64 = 0.45;
/// How often a sensor varies is known after so many looks.
const LOOKS_LEAST: f64 = 200.0;
/// A sensor contradicts the others at so many deviations, and by so many kelvin at least: a machine that begins a hot day with all its parts
/// alike is 9 K off what those parts did together during identification.
const CONTRADICTS_SD: f64 = 5.0;
const CONTRADICTS_K: f64 = 15.0;
/// The others agree with each other within so many deviations.
const AGREES_SD: f64 = 3.0;
/// It is believed again after it has been this near to what stands in for it, K,
const NEAR_K: f64 = 2.0;
/// for so long, ns;
const NEAR_NS: i64 = 60 * SECOND_NS;
/// or within so many deviations of the others for so long, ns: then a machine has changed and not a sensor.
const SETTLED_SD: f64 = 2.0;
const SETTLED_NS: i64 = 4 * 3600 * SECOND_NS;
/// What was last said of a sensor and the others do not explain is forgotten with this time constant, s: that of a spindle motor.
const FORGET_S: f64 = 1800.0;

/// What is wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorFault {
    /// It gives no value at this moment.
    Lost,
    /// It has changed faster than heat can.
    Jumped,
    /// It stands still while the others have moved.
    Frozen,
    /// The others, which agree with each other, contradict it.
    Contradicted,
}

/// A sensor that is not believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubtedSensor {
    /// Position among the sensors.
    pub sensor: usize,
    /// What is wrong with it.
    pub fault: SensorFault,
    /// When it was first not believed, ns since 1970.
    pub since_ns: TimeNs,
    /// What stands in for it, °C, with its deviation; `None` where the law does not tell.
    pub stand_in_c: Option<Estimate>,
}

/// What is known of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct WatchedSensor {
    /// The last value that was believed, what the others said then, and when.
    last_believed: Option<Believed>,
    fault: Option<(SensorFault, TimeNs)>,
    near_since_ns: Option<TimeNs>,
    settled_since_ns: Option<TimeNs>,
    flat: Option<Flat>,
    /// Looks while it was believed, and how many of them brought another value.
    looks: f64,
    changes: f64,
    /// Changes that went the other way than the one before, and which way the last one went.
    turns: f64,
    last_change_k: f64,
    /// The longest time that it stood still while it was believed, s.
    longest_flat_s: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Believed {
    at_ns: TimeNs,
    value_c: f64,
    expected_c: Option<f64>,
}

/// Since when a sensor has shown this value, after so many looks, and what the others said of it when that began.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Flat {
    since_ns: TimeNs,
    value_c: f64,
    expected_c: Option<f64>,
    looks: f64,
}

/// Judges the sensors of a law.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorWatch {
    model: Option<SensorModel>,
    sensors: Vec<WatchedSensor>,
    doubted_sensors: Vec<DoubtedSensor>,
}

impl SensorWatch {
    /// For so many sensors; without a model nothing can stand in, and only rate and absence are judged.
    #[must_use]
    pub fn new(model: Option<SensorModel>, sensors: usize) -> Self {
        Self { model, sensors: vec![WatchedSensor::default(); sensors], doubted_sensors: Vec::new() }
    }

    /// The sensors that are not believed now.
    #[must_use]
    pub fn list_doubted(&self) -> &[DoubtedSensor] {
        &self.doubted_sensors
    }

    /// Takes the temperatures of a moment and puts what stands in for them in the place of those that are not believed; where nothing
    /// can, they have no value. Gives the standard deviation that this adds to a predicted error, um.
    pub fn replace_doubted(&mut self, at_ns: TimeNs, temperatures_c: &mut [Result<f64, Absence>]) -> f64 {
        let seen: Vec<Option<f64>> =
            temperatures_c.iter().map(|it| it.as_ref().ok().copied().filter(|value| value.is_finite())).collect();
        let believed: Vec<Option<f64>> =
            seen.iter().zip(&self.sensors).map(|(value, it)| value.filter(|_| it.fault.is_none())).collect();
        let expected: Vec<Option<Estimate>> = (0..seen.len())
            .map(|sensor| self.model.as_ref().map(|model| model.predict_sensor(sensor, &believed)))
            .collect();
        let worst = self.model.as_ref().and_then(|model| find_contradicted(model, &seen, &expected));
        for (at, sensor) in self.sensors.iter_mut().enumerate() {
            let others = believed.iter().enumerate().any(|(other, value)| other != at && value.is_some());
            let look = SensorLook { expectation: expected[at], has_others: others, is_worst: worst == Some(at) };
            sensor.judge_value(at_ns, seen[at], look);
        }
        self.doubted_sensors.clear();
        let mut variance = 0.0;
        for (at, sensor) in self.sensors.iter().enumerate() {
            let Some((fault, since_ns)) = sensor.fault else { continue };
            // Nothing was ever read of it: the others are all there is. Without them nothing is known of this day.
            let is_told = sensor.last_believed.is_some() || believed.iter().any(Option::is_some);
            let stand_in_c = expected[at].filter(|_| is_told).map(|expected| sensor.compute_stand_in(at_ns, expected));
            self.doubted_sensors.push(DoubtedSensor { sensor: at, fault, since_ns, stand_in_c });
            let slope = self.model.as_ref().map_or(0.0, |model| model.slope_um_per_k(at));
            variance += stand_in_c.map_or(0.0, |stand_in| (slope * stand_in.sd).powi(2));
            temperatures_c[at] = match (stand_in_c, temperatures_c[at]) {
                (Some(stand_in), _) => Ok(stand_in.value),
                (None, Ok(_)) => Err(Absence::OutOfRange),
                (None, absent) => absent,
            };
        }
        variance.sqrt()
    }
}

/// The sensor that the others contradict most, where those agree with each other and are as they were during identification: on a day
/// that is colder than any of those, how the temperatures go together is an extrapolation.
fn find_contradicted(model: &SensorModel, seen: &[Option<f64>], expected: &[Option<Estimate>]) -> Option<usize> {
    let off = |at: usize| Some((seen[at]? - expected[at]?.value, expected[at]?.sd));
    let shares = (0..seen.len()).filter_map(|at| off(at).map(|(off, sd)| (at, off.abs() / sd, off.abs())));
    let worst = shares.clone().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let usual = |at: usize| seen[at].is_some_and(|value| model.distance_sd(at, value) < AGREES_SD);
    let mut others = shares.clone().filter(|it| it.0 != worst.0);
    let others_agree = others.all(|it| it.1 < AGREES_SD && usual(it.0)) && shares.count() > 2;
    (others_agree && worst.1 > CONTRADICTS_SD && worst.2 > CONTRADICTS_K).then_some(worst.0)
}

/// What is told of a sensor at one moment.
#[derive(Debug, Clone, Copy)]
struct SensorLook {
    /// What it should show by the model, with what of the others is believed.
    expectation: Option<Estimate>,
    /// Is another one believed? Otherwise `expectation` is no more than the mean of the days of identification: a machine that was
    /// switched on cold is far from it.
    has_others: bool,
    /// Is it the one that the others contradict?
    is_worst: bool,
}

impl WatchedSensor {
    fn judge_value(&mut self, at_ns: TimeNs, seen_c: Option<f64>, look: SensorLook) {
        let expected = look.expectation;
        let Some(value_c) = seen_c else {
            (self.near_since_ns, self.settled_since_ns, self.flat) = (None, None, None);
            self.fault.get_or_insert((SensorFault::Lost, at_ns));
            return;
        };
        if self.begins_anew(at_ns) {
            self.fault = None;
        }
        self.follow_flatness(at_ns, value_c, expected);
        if self.fault.is_some() {
            self.judge_return(at_ns, value_c, look);
            return;
        }
        let fault = match () {
            () if self.has_jumped(at_ns, value_c) => Some(SensorFault::Jumped),
            () if look.is_worst => Some(SensorFault::Contradicted),
            () if self.is_silent(at_ns) || self.is_frozen(at_ns, expected) => Some(SensorFault::Frozen),
            () => None,
        };
        match fault {
            Some(fault) => self.doubt_sensor(fault, at_ns),
            None => self.last_believed = Some(Believed { at_ns, value_c, expected_c: expected.map(|it| it.value) }),
        }
    }

    /// A sensor that was only away, and of which nothing was believed so far or for so long that the rate says nothing, is judged as at its
    /// first value: its source may answer a tick after the others, and a machine that was off overnight is cold in all of its parts.
    fn begins_anew(&self, at_ns: TimeNs) -> bool {
        let lost = matches!(self.fault, Some((SensorFault::Lost, _)));
        lost && self.last_believed.is_none_or(|before| at_ns - before.at_ns > RATE_WITHIN_NS)
    }

    fn doubt_sensor(&mut self, fault: SensorFault, at_ns: TimeNs) {
        self.fault = Some((fault, at_ns));
        // What stood still was right when that began.
        if let (SensorFault::Frozen, Some(flat)) = (fault, self.flat) {
            self.last_believed =
                Some(Believed { at_ns: flat.since_ns, value_c: flat.value_c, expected_c: flat.expected_c });
        }
        (self.near_since_ns, self.settled_since_ns) = (None, None);
    }

    fn has_jumped(&self, at_ns: TimeNs, value_c: f64) -> bool {
        self.last_believed.is_some_and(|before| {
            let elapsed_ns = at_ns - before.at_ns;
            let most_k = JUMP_K + RATE_K_PER_S * to_seconds(elapsed_ns);
            (0..=RATE_WITHIN_NS).contains(&elapsed_ns) && (value_c - before.value_c).abs() > most_k
        })
    }

    /// Counts how long the value has stood still; how long that is usual is learned while it is believed.
    fn follow_flatness(&mut self, at_ns: TimeNs, value_c: f64, expected: Option<Estimate>) {
        let stands = self.flat.filter(|flat| flat.value_c == value_c && flat.since_ns <= at_ns);
        if self.fault.is_none() {
            self.looks += 1.0;
            if let (None, Some(flat)) = (stands, self.flat) {
                self.changes += 1.0;
                let change_k = value_c - flat.value_c;
                self.turns += f64::from(u8::from(change_k * self.last_change_k < 0.0));
                self.last_change_k = change_k;
                self.longest_flat_s = self.longest_flat_s.max(to_seconds(at_ns - flat.since_ns));
            }
        }
        let begun = Flat { since_ns: at_ns, value_c, expected_c: expected.map(|it| it.value), looks: 0.0 };
        let mut flat = stands.unwrap_or(begun);
        flat.looks += 1.0;
        self.flat = Some(flat);
    }

    fn is_frozen(&self, at_ns: TimeNs, expected: Option<Estimate>) -> bool {
        let (Some(flat), Some(expected)) = (self.flat, expected) else { return false };
        let Some(began_c) = flat.expected_c.filter(|_| self.looks >= LOOKS_LEAST) else { return false };
        let stood_s = to_seconds(at_ns - flat.since_ns);
        let varies = (self.changes / self.looks).clamp(0.0, 0.999);
        let chance = (1.0 - varies).powf(flat.looks);
        let moved_k = (expected.value - began_c).abs();
        chance < FLAT_CHANCE
            && stood_s > FLAT_S.max(FLAT_TIMES * self.longest_flat_s)
            && moved_k > FLAT_MOVED_K.max(FLAT_MOVED_SD * expected.sd)
    }

    /// Has it lost the noise that it always showed?
    fn is_silent(&self, at_ns: TimeNs) -> bool {
        let Some(flat) = self.flat.filter(|_| self.looks >= LOOKS_LEAST) else { return false };
        let stood_s = to_seconds(at_ns - flat.since_ns);
        let turns = (self.turns / self.looks).clamp(0.0, 0.999);
        turns > TURNS_LEAST
            && (1.0 - turns).powf(flat.looks) < FLAT_CHANCE
            && stood_s > SILENT_S.max(FLAT_TIMES * self.longest_flat_s)
    }

    /// What stands in for it: what the others say, beginning with what it said last.
    fn compute_stand_in(&self, at_ns: TimeNs, expected: Estimate) -> Estimate {
        let Some(Believed { at_ns: then_ns, value_c, expected_c: Some(then_c) }) = self.last_believed else {
            return expected;
        };
        let left = (-to_seconds((at_ns - then_ns).max(0)) / FORGET_S).exp();
        Estimate {
            value: expected.value + (value_c - then_c) * left,
            sd: expected.sd * (1.0 - left * left).max(0.0).sqrt(),
        }
    }

    fn judge_return(&mut self, at_ns: TimeNs, value_c: f64, look: SensorLook) {
        let Some((fault, _)) = self.fault else { return };
        let expected = look.expectation;
        // Where all were lost for a while there is only what heat can do since then.
        let against = expected.filter(|_| look.has_others || fault != SensorFault::Lost);
        let stand_in = against.map(|expected| self.compute_stand_in(at_ns, expected));
        let moves = fault != SensorFault::Frozen
            || self.flat.is_some_and(|flat| flat.looks <= 1.0)
            || self.near_since_ns.is_some();
        let tolerance_k = |stand_in: Estimate| NEAR_K.max(stand_in.sd);
        let near = moves
            && match (stand_in, self.last_believed) {
                (Some(stand_in), _) => (value_c - stand_in.value).abs() <= tolerance_k(stand_in),
                (None, Some(_)) => !self.has_jumped(at_ns, value_c),
                (None, None) => true,
            };
        let settled = expected.is_some_and(|it| (value_c - it.value).abs() <= SETTLED_SD * it.sd);
        let near_since_ns = near.then(|| self.near_since_ns.unwrap_or(at_ns));
        let settled_since_ns = settled.then(|| self.settled_since_ns.unwrap_or(at_ns));
        (self.near_since_ns, self.settled_since_ns) = (near_since_ns, settled_since_ns);
        // A sensor that was lost and comes back as what is expected needs no time to prove itself.
        let at_once = fault == SensorFault::Lost && near;
        let lasts =
            |since_ns: Option<TimeNs>, least_ns: i64| since_ns.is_some_and(|since_ns| at_ns - since_ns >= least_ns);
        if at_once || lasts(near_since_ns, NEAR_NS) || (moves && lasts(settled_since_ns, SETTLED_NS)) {
            (self.fault, self.near_since_ns, self.settled_since_ns) = (None, None, None);
            self.last_believed = Some(Believed { at_ns, value_c, expected_c: expected.map(|it| it.value) });
        }
    }
}

fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}

#[cfg(test)]
mod tests;
