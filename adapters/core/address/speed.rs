//! How fast something runs against the clock.

use super::keys::Keys;

/// How fast a replay or a simulated machine runs against the clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// So many times real time.
    Times(f64),
    /// As fast as the pipeline takes it.
    Max,
}

/// The key `speed`: `max`, or a factor from 0.001 to 100000; 1 where it is not given.
pub fn parse_speed(keys: &mut Keys) -> Speed {
    let Some(text) = keys.take_text("speed") else { return Speed::Times(1.0) };
    if text == "max" {
        return Speed::Max;
    }
    match text.parse::<f64>() {
        Ok(times) if (0.001..=100_000.0).contains(&times) => Speed::Times(times),
        _ => {
            keys.add_problem(format!("speed={text}: give max or a factor from 0.001 to 100000"));
            Speed::Times(1.0)
        }
    }
}
