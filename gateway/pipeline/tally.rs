//! Sums since the start: ticks, and machine time in each state.

use adapter_core::clock::{SECOND_NS, TimeNs};
use rules::estimators::State;

/// A longer step between two ticks is a pause that belongs to no state.
const STEP_MAX_NS: i64 = 10 * SECOND_NS;

/// Sums since the start.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    ticks: u64,
    last_ns: Option<TimeNs>,
    ns_per_state: [i64; State::ALL.len()],
}

impl Tally {
    /// Takes one tick: the time since the one before counts for the state it is in.
    pub fn count_tick(&mut self, at_ns: TimeNs, state: State) {
        self.ticks += 1;
        let step_ns = self.last_ns.replace(at_ns).map_or(0, |last_ns| at_ns - last_ns);
        if (0..=STEP_MAX_NS).contains(&step_ns) {
            self.ns_per_state[usize::from(state.to_code())] += step_ns;
        }
    }

    /// Ticks since the start.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Every state with its seconds.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "2^53 ns are a hundred days; beyond that microseconds suffice")]
    pub fn seconds_per_state(&self) -> Vec<(&'static str, f64)> {
        let seconds = |state: State| self.ns_per_state[usize::from(state.to_code())] as f64 / SECOND_NS as f64;
        State::ALL.into_iter().map(|state| (state.as_word(), seconds(state))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_to_the_state_that_the_tick_is_in_and_pauses_to_none() {
        let mut tally = Tally::default();
        for (at_s, state) in
            [(0, State::Off), (1, State::Idle), (3, State::Cutting), (100, State::Cutting), (101, State::Off)]
        {
            tally.count_tick(at_s * SECOND_NS, state);
        }
        let seconds = tally.seconds_per_state();
        assert_eq!(tally.ticks(), 5);
        assert_eq!(
            seconds.iter().filter(|(_, s)| *s > 0.0).collect::<Vec<_>>(),
            [&("off", 1.0), &("idle", 1.0), &("cutting", 2.0)]
        );
    }
}
