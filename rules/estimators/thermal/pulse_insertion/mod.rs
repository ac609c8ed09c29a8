//! Pulse insertion: extra pulses in the encoder lines between machine and controller, so that the controller moves the
//! axis by the thermal error.
//!
//! Source: thermal-error compensation by pulse insertion (13 temperature points): insertion begins only while A **and**
//! B are low, up is A before B, down is B before A. What the source leaves open is settled here: one transition at a
//! time; never two output edges closer than a minimum spacing; edges of the encoder that arrive meanwhile wait their
//! turn in order, so none is lost and none is made up; an inserted pulse is a whole period, so the lines that come out
//! stand where those that come in stand whenever nothing waits.
//!
//! A gateway does not do this electrically: this is the model of such a device and the reference its firmware is tested
//! against. Time is an argument, in nanoseconds of the caller's clock.

use super::quadrature::{Decoder, EDGES_PER_PULSE, IllegalTransition, Lines};

/// Encoder edges that may wait for their turn; more means that the encoder is too fast for the minimum spacing.
const WAITING_MAX: i64 = 64;

/// One edge that leaves the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SignalEdge {
    /// When it leaves, ns, on the clock of the edges that come in.
    pub at_ns: u64,
    /// The levels from then on.
    pub lines: Lines,
}

/// Why the device stops: the controller must be told that the position is lost, as with a broken encoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum InsertionFault {
    /// An edge of the encoder was lost.
    #[error(transparent)]
    Encoder(#[from] IllegalTransition),
    /// More edges arrive than may leave.
    #[error("{waiting} encoder edges wait at {at_ns} ns: the axis is too fast for edges {spacing_ns} ns apart")]
    TooFast {
        /// When it was noticed, ns, on the clock of the edges that come in.
        at_ns: u64,
        /// How many edges wait.
        waiting: i64,
        /// The least time between two edges.
        spacing_ns: u64,
    },
    /// A time earlier than one seen before.
    #[error("time went back from {before_ns} ns to {at_ns} ns")]
    TimeWentBack {
        /// The latest time seen.
        before_ns: u64,
        /// The time given, which is earlier, ns.
        at_ns: u64,
    },
}

/// The device: encoder lines in, encoder lines with inserted pulses out.
#[derive(Debug, Clone)]
pub struct PulseInserter {
    spacing_ns: u64,
    encoder: Decoder,
    out_edges: i64,
    inserted_pulses: i64,
    requested_pulses: i64,
    bypass: bool,
    now_ns: u64,
    last_edge_ns: Option<u64>,
}

impl PulseInserter {
    /// A device at rest whose encoder shows `lines` at `at_ns`; edges leave at least `spacing_ns` apart.
    #[must_use]
    pub fn new(lines: Lines, at_ns: u64, spacing_ns: u64) -> Self {
        let position = (0..EDGES_PER_PULSE).find(|position| Lines::from_position(*position) == lines).unwrap_or(0);
        Self {
            spacing_ns,
            encoder: Decoder::new(lines, position),
            out_edges: position,
            inserted_pulses: 0,
            requested_pulses: 0,
            bypass: false,
            now_ns: at_ns,
            last_edge_ns: None,
        }
    }

    /// Asks for more pulses, positive up. They are inserted one by one whenever both lines are low.
    pub fn request_pulses(&mut self, pulses: i64) {
        self.requested_pulses = self.requested_pulses.saturating_add(pulses);
    }

    /// With bypass on, encoder edges pass and no pulse is begun; what was asked for stays asked for.
    pub fn set_bypass(&mut self, on: bool) {
        self.bypass = on;
    }

    /// Lets time pass up to `at_ns`, where the encoder shows `lines`; every edge that leaves until then goes to `emit`.
    ///
    /// # Errors
    /// [`InsertionFault`]; nothing more leaves after one until a new device takes its place.
    pub fn advance_to(
        &mut self,
        at_ns: u64,
        lines: Lines,
        mut emit: impl FnMut(SignalEdge),
    ) -> Result<(), InsertionFault> {
        if at_ns < self.now_ns {
            return Err(InsertionFault::TimeWentBack { before_ns: self.now_ns, at_ns });
        }
        // Before `at_ns` with the old levels, at `at_ns` with the new ones.
        self.emit_before(at_ns, &mut emit);
        self.now_ns = at_ns;
        self.encoder.decode_lines(lines, at_ns)?;
        let waiting = (self.wanted_edges() - self.out_edges).abs();
        if waiting > WAITING_MAX {
            return Err(InsertionFault::TooFast { at_ns, waiting, spacing_ns: self.spacing_ns });
        }
        self.emit_before(at_ns.saturating_add(1), &mut emit);
        Ok(())
    }

    fn emit_before(&mut self, end_ns: u64, emit: &mut impl FnMut(SignalEdge)) {
        loop {
            let free_ns = self.last_edge_ns.map_or(0, |last| last.saturating_add(self.spacing_ns));
            let at_ns = self.now_ns.max(free_ns);
            if at_ns >= end_ns {
                return;
            }
            self.begin_pulse();
            let step = (self.wanted_edges() - self.out_edges).signum();
            if step == 0 {
                return;
            }
            self.out_edges += step;
            self.now_ns = at_ns;
            self.last_edge_ns = Some(at_ns);
            emit(SignalEdge { at_ns, lines: Lines::from_position(self.out_edges) });
        }
    }

    /// Takes one requested pulse up, if the lines that come in and those that go out are low and nothing waits.
    fn begin_pulse(&mut self) {
        let idle = self.wanted_edges() == self.out_edges;
        if self.bypass || self.requested_pulses == 0 || !idle || !self.encoder.lines().is_low() {
            return;
        }
        let pulse = self.requested_pulses.signum();
        self.requested_pulses -= pulse;
        self.inserted_pulses += pulse;
    }

    fn wanted_edges(&self) -> i64 {
        self.encoder.position_edges() + EDGES_PER_PULSE * self.inserted_pulses
    }

    /// Pulses taken up so far, down counted negative.
    #[must_use]
    pub fn inserted_pulses(&self) -> i64 {
        self.inserted_pulses
    }

    /// Pulses asked for and not yet taken up: the axis stands where a line is high, or bypass is on.
    #[must_use]
    pub fn requested_pulses(&self) -> i64 {
        self.requested_pulses
    }

    /// Edges taken up and not yet out.
    #[must_use]
    pub fn waiting_edges(&self) -> i64 {
        (self.wanted_edges() - self.out_edges).abs()
    }

    /// The levels that the controller sees now.
    #[must_use]
    pub fn lines(&self) -> Lines {
        Lines::from_position(self.out_edges)
    }
}

#[cfg(test)]
mod tests;
