//! Quadrature signals of an incremental encoder: two lines A and B, a quarter of a period apart.
//!
//! A leads B counts up: 00, 10, 11, 01, 00 (A first); B leads A counts down. One encoder period holds four edges; a
//! lawful edge changes one line only. Source: thermal-error compensation by pulse insertion (13 temperature points).

use serde::{Deserialize, Serialize};

/// Edges of one encoder period, and of one inserted pulse.
pub const EDGES_PER_PULSE: i64 = 4;

/// The levels of the two lines at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Lines {
    /// Line A is high.
    pub a: bool,
    /// Line B is high.
    pub b: bool,
}

impl Lines {
    /// Both lines low: the only levels at which pulses are inserted.
    pub const LOW: Self = Self { a: false, b: false };

    /// The levels at an encoder position in edges; position 0 is both low.
    #[must_use]
    pub fn from_position(position_edges: i64) -> Self {
        let phase = position_edges.rem_euclid(EDGES_PER_PULSE);
        Self { a: phase == 1 || phase == 2, b: phase == 2 || phase == 3 }
    }

    /// Are both lines low?
    #[must_use]
    pub fn is_low(self) -> bool {
        self == Self::LOW
    }
}

/// Both lines changed at once: an edge was lost, or there is noise on the cable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("both encoder lines changed at once at {at_ns} ns: an edge was lost; check cable, shield and counting rate")]
pub struct IllegalTransition {
    /// When, on the clock of the caller.
    pub at_ns: u64,
}

/// Counts the edges of two lines as a controller does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Decoder {
    lines: Lines,
    position_edges: i64,
}

impl Decoder {
    /// A decoder that sees these levels first and calls them position `position_edges`.
    #[must_use]
    pub fn new(lines: Lines, position_edges: i64) -> Self {
        Self { lines, position_edges }
    }

    /// Takes the levels at `at_ns` and tells the step: 1 up, -1 down, 0 for no change.
    ///
    /// # Errors
    /// [`IllegalTransition`] when both lines changed; the position is then no longer known to within two edges.
    pub fn decode_lines(&mut self, lines: Lines, at_ns: u64) -> Result<i64, IllegalTransition> {
        let before = std::mem::replace(&mut self.lines, lines);
        let step = match (before.a != lines.a, before.b != lines.b) {
            (false, false) => 0,
            (true, true) => return Err(IllegalTransition { at_ns }),
            // On the way up the new A is always the opposite of the old B.
            _ if before.b != lines.a => 1,
            _ => -1,
        };
        self.position_edges += step;
        Ok(step)
    }

    /// Position in edges, four to an encoder period.
    #[must_use]
    pub fn position_edges(&self) -> i64 {
        self.position_edges
    }

    /// The levels seen last.
    #[must_use]
    pub fn lines(&self) -> Lines {
        self.lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_before_b_counts_up_and_b_before_a_counts_down() {
        let mut decoder = Decoder::default();
        for position in (1..=9).chain((-6..9).rev()) {
            decoder.decode_lines(Lines::from_position(position), 0).expect("one line at a time");
            assert_eq!(decoder.position_edges(), position);
        }
        assert!(Lines::from_position(1).a && !Lines::from_position(1).b, "A rises first on the way up");
        assert!(Lines::from_position(-1).b && !Lines::from_position(-1).a, "B rises first on the way down");
    }

    #[test]
    fn two_lines_at_once_are_refused_with_the_time() {
        let mut decoder = Decoder::default();
        assert_eq!(decoder.decode_lines(Lines::from_position(2), 77), Err(IllegalTransition { at_ns: 77 }));
        assert_eq!(decoder.position_edges(), 0);
    }
}
