//! The shape of a hidden law: something that changes the cut, the machine, the meter or the record.

use crate::concealed::baseline::Baseline;
use crate::concealed::dice::Dice;
use crate::concealed::schedule::{Needs, Plan};
use crate::concealed::tick::Tick;

/// What a law sees of one instant.
pub(crate) struct Scene<'a> {
    pub(crate) tick: &'a Tick,
    pub(crate) baseline: &'a Baseline,
    /// Cutting power with the gains of the laws of the cut, W; what the motor really delivers.
    pub(crate) cutting_w: f64,
    /// Cutting power of the nominal law, W.
    pub(crate) nominal_w: f64,
    pub(crate) no_load_w: f64,
}

impl Scene<'_> {
    /// Spindle torque of cutting and half the no-load power, Nm; bounded at creep speeds.
    pub(crate) fn torque_nm(&self) -> f64 {
        (self.cutting_w + 0.5 * self.no_load_w) / self.tick.omega().max(4.0)
    }
}

/// What a law adds at one instant.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Terms {
    /// Added to the factor of the nominal cutting power.
    pub(crate) gain: f64,
    pub(crate) power_w: f64,
    /// Standard deviation of noise that comes on top, W; not part of the contribution.
    pub(crate) jitter_w: f64,
}

impl Terms {
    pub(crate) fn gain(gain: f64) -> Self {
        Self { gain, ..Self::default() }
    }

    pub(crate) fn power(power_w: f64) -> Self {
        Self { power_w, ..Self::default() }
    }
}

/// A law of the cut or of the machine, with its hidden state.
pub(crate) type Law = Box<dyn FnMut(&Scene) -> Terms>;
/// What the meter makes of the true power.
pub(crate) type Meter = Box<dyn FnMut(&[Tick], &[f64]) -> Vec<f64>>;
/// What differs between the world (first) and the record (second).
pub(crate) type Clerk = Box<dyn FnMut(&mut [Tick], &mut [Tick])>;

/// Where in the chain a law acts.
pub(crate) enum Hidden {
    Cut(Law),
    Machine(Law),
    Meter(Meter),
    Clerk(Clerk),
}

/// A law with drawn parameters, and those of them that a true value is defined for (name with unit).
pub(crate) struct Planted {
    pub(crate) hidden: Hidden,
    pub(crate) parameters: Vec<(&'static str, f64)>,
}

impl Planted {
    pub(crate) fn cut(law: impl FnMut(&Scene) -> Terms + 'static) -> Self {
        Self { hidden: Hidden::Cut(Box::new(law)), parameters: Vec::new() }
    }

    pub(crate) fn machine(law: impl FnMut(&Scene) -> Terms + 'static) -> Self {
        Self { hidden: Hidden::Machine(Box::new(law)), parameters: Vec::new() }
    }

    pub(crate) fn meter(meter: impl FnMut(&[Tick], &[f64]) -> Vec<f64> + 'static) -> Self {
        Self { hidden: Hidden::Meter(Box::new(meter)), parameters: Vec::new() }
    }

    pub(crate) fn clerk(clerk: impl FnMut(&mut [Tick], &mut [Tick]) + 'static) -> Self {
        Self { hidden: Hidden::Clerk(Box::new(clerk)), parameters: Vec::new() }
    }

    pub(crate) fn with(mut self, name: &'static str, value: f64) -> Self {
        self.parameters.push((name, value));
        self
    }
}

/// Draws a law: the plan it acts in, and a factor on its strength.
pub(crate) type Make = fn(&mut Dice, &Plan, f64) -> Planted;

/// One form of one effect.
#[derive(Clone)]
pub(crate) struct Entry {
    /// Public name of the catalogue, or `unlisted`.
    pub(crate) name: &'static str,
    /// Other names that are right as well.
    pub(crate) also: &'static [&'static str],
    pub(crate) form: &'static str,
    pub(crate) needs: Needs,
    /// Least and greatest plausible factor on the strength.
    pub(crate) reach: (f64, f64),
    /// Columns that must be recorded for the effect to be nameable.
    pub(crate) columns: &'static [&'static str],
    pub(crate) make: Make,
}

impl Entry {
    pub(crate) fn new(name: &'static str, form: &'static str, make: Make) -> Self {
        Self { name, also: &[], form, needs: Needs::default(), reach: (0.3, 2.5), columns: &[], make }
    }

    pub(crate) fn also(mut self, names: &'static [&'static str]) -> Self {
        self.also = names;
        self
    }

    pub(crate) fn needs(mut self, needs: Needs) -> Self {
        self.needs = needs;
        self
    }

    pub(crate) fn reach(mut self, low: f64, high: f64) -> Self {
        self.reach = (low, high);
        self
    }

    pub(crate) fn columns(mut self, columns: &'static [&'static str]) -> Self {
        self.columns = columns;
        self
    }
}
