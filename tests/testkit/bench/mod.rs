//! A spindle on a test bench: a known programme, known states, known no-load power, measured by two sources.
//!
//! Its laws are not those of the product: no-load power goes with n^1.5, the start-up surge decays exponentially, the
//! meter averages over a window of its own and adds noise, ripple and pulses, both sources have their own clocks.

mod course;
mod meters;

pub use course::{Course, Moment, STEP_S};
pub use meters::{Disturbance, sources};

/// What is wrong with the world in a scenario.
#[derive(Debug, Clone, Copy)]
pub struct Scenario {
    /// Name in the table.
    pub name: &'static str,
    /// Time constant of the start-up surge, s.
    pub tau_s: f64,
    /// Electrical power of a cut over no-load power.
    pub cut_share: f64,
    /// Does the spindle change its speed between cuts?
    pub speed_changes: bool,
    /// Do the meter and the controller fall silent now and then?
    pub dropouts: bool,
    /// Where the mains wander by 4 %: the exponent with which no-load power follows them.
    pub supply_exponent: Option<f64>,
}
