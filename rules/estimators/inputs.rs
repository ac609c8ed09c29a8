//! What the estimators need of a sample.

use super::basis::StateBasis;
use super::settings::{STAGES, Settings};
use adapter_core::clock::TimeNs;
use adapter_core::{Absence, ChannelId, Sample};

/// The channels in use, looked up once.
#[derive(Debug, Clone, Copy)]
pub(super) struct InputChannels {
    pub(super) power: Option<ChannelId>,
    pub(super) total: Option<ChannelId>,
    pub(super) speed: Option<ChannelId>,
    pub(super) feed: Option<ChannelId>,
    rapid: Option<ChannelId>,
    stage: Option<ChannelId>,
    voltage: Option<ChannelId>,
}

/// A number, or the reason why there is none.
pub(super) type Input = Result<f64, Absence>;

/// The inputs of one tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct TickInputs {
    pub(super) at_ns: TimeNs,
    /// What stands for the spindle power in `power`.
    pub(super) basis: StateBasis,
    /// Spindle power, W; or what stands for it, in parts of [`StateBasis::stand_in`].
    pub(super) power: Input,
    /// Power of the whole machine, W.
    pub(super) total: Input,
    /// Spindle speed, rpm, signed.
    pub(super) speed: Input,
    /// Feed along the path, mm/min.
    pub(super) feed: Input,
    /// Rapid traverse by flag or by feed.
    pub(super) rapid: bool,
    /// Gear stage; 0 where the machine has none.
    pub(super) stage: Result<usize, Absence>,
    /// Voltage of the supply, V.
    pub(super) voltage: Input,
    /// Logarithm of that voltage over its reference; 0 where it is not known.
    pub(super) supply_log: f64,
    /// What was taken off the power because the voltage is not that of its reference, W.
    pub(super) by_voltage_w: f64,
}

impl InputChannels {
    pub(super) fn new() -> Self {
        Self {
            power: ChannelId::from_name("spindle_power_w"),
            total: ChannelId::from_name("total_power_w"),
            speed: ChannelId::from_name("spindle_speed_rpm"),
            feed: ChannelId::from_name("feed_mm_min"),
            rapid: ChannelId::from_name("rapid"),
            stage: ChannelId::from_name("gear_stage"),
            voltage: ChannelId::from_name("supply_voltage_v"),
        }
    }

    /// Reads the inputs. Without a channel for spindle power, total power above its standby level stands for it.
    pub(super) fn read(&self, sample: &Sample, standby_w: Option<f64>, settings: &Settings) -> TickInputs {
        let total = read_number(sample, self.total);
        let feed = read_number(sample, self.feed);
        let basis = StateBasis::from_sample(sample);
        let stand_in = basis.stand_in().map(|(name, parts)| (ChannelId::from_name(name), parts));
        let power = match (read_number(sample, self.power), total, standby_w, stand_in) {
            (_, _, _, Some((channel, parts))) => read_number(sample, channel).map(|value| value.abs() * parts),
            (Err(Absence::NotProvided), Ok(total), Some(standby_w), None) => Ok(total - standby_w),
            (power, ..) => power,
        };
        let flagged = read_number(sample, self.rapid).is_ok_and(|rapid| rapid > 0.5);
        let fast = settings.rapid_feed_mm_min > 0.0 && feed.is_ok_and(|feed| feed > settings.rapid_feed_mm_min);
        TickInputs {
            at_ns: sample.at_ns,
            basis,
            power,
            total,
            speed: read_number(sample, self.speed),
            feed,
            rapid: flagged || fast,
            stage: to_gear_stage(read_number(sample, self.stage)),
            voltage: read_number(sample, self.voltage),
            supply_log: 0.0,
            by_voltage_w: 0.0,
        }
    }
}

fn read_number(sample: &Sample, channel: Option<ChannelId>) -> Input {
    let channel = channel.ok_or(Absence::NotProvided)?;
    let number = sample.number(channel)?;
    if channel.channel().accepts_number(number) { Ok(number) } else { Err(Absence::OutOfRange) }
}

fn to_gear_stage(number: Input) -> Result<usize, Absence> {
    match number {
        Err(Absence::NotProvided) => Ok(0),
        Err(absence) => Err(absence),
        Ok(number) => (0..STAGES)
            .find(|stage| (number - numerics::statistics::count_to_f64(*stage)).abs() < 0.5)
            .ok_or(Absence::OutOfRange),
    }
}
