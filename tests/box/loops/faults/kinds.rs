//! The faults that come to a machine at work, and the alarms that may tell each.

use super::super::bench::{Bench, LineFault};
use adapters::simulated::Simulated;

/// A machine to which faults come.
pub(super) trait Breakable {
    /// Its cuts take so many times the power.
    fn change_cut(&mut self, factor: f64);
    fn break_insert(&mut self, tool: u8);
    fn change_edge(&mut self, tool: u8);
}

impl Breakable for Simulated {
    fn change_cut(&mut self, factor: f64) {
        self.change_machine(factor, 1.0);
    }

    fn break_insert(&mut self, tool: u8) {
        Self::break_insert(self, tool);
    }

    fn change_edge(&mut self, tool: u8) {
        Self::change_edge(self, tool);
    }
}

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// The cuts take so many times the power.
    Cut(f64),
    /// The tool in use loses an insert.
    Insert,
    /// The machine is well, and what arrives of it is not.
    Line(LineFault),
}

/// A fault.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fault {
    pub(super) name: &'static str,
    kind: Kind,
    /// It comes while one tool cuts.
    pub(super) of_tool: bool,
    /// Beginnings of the names of alarms that tell it.
    told_by: &'static [&'static str],
}

const fn of(name: &'static str, kind: Kind, told_by: &'static [&'static str]) -> Fault {
    Fault { name, kind, of_tool: matches!(kind, Kind::Insert), told_by }
}

pub(super) const FAULTS: [Fault; 9] = [
    of("no work in the chuck or vice", Kind::Cut(0.0), &["undercut"]),
    of("six times the power", Kind::Cut(6.0), &["power_multiple"]),
    of("an insert is missing", Kind::Insert, &["insert_missing", "undercut"]),
    of("no coolant", Kind::Line(LineFault::CoolantOff), &["coolant_missing"]),
    of("an edge breaks out, an eighth of the power is left", Kind::Cut(0.125), &["undercut"]),
    of("the control is silent", Kind::Line(LineFault::ControlSilent), &["control_silent", "state_unknown"]),
    of("the meter is silent", Kind::Line(LineFault::MeterSilent), &["state_unknown"]),
    of("the bearing is hot", Kind::Line(LineFault::BearingWarmer(50.0)), &["bearing_hot"]),
    of("the supply is low", Kind::Line(LineFault::SupplyLower(70.0)), &["supply_low"]),
];

impl Fault {
    pub(super) fn is_told_by(&self, alarm: &str) -> bool {
        self.told_by.iter().any(|beginning| alarm.starts_with(beginning))
    }

    pub(super) fn begin(&self, bench: &mut Bench, tool: u8) {
        bench.line_fault = self.begin_on(&mut bench.machine, tool);
    }

    pub(super) fn end(&self, bench: &mut Bench, tool: u8) {
        bench.line_fault = None;
        self.end_on(&mut bench.machine, tool);
    }

    /// Begins on the machine; gives what goes wrong behind it.
    pub(super) fn begin_on(&self, machine: &mut impl Breakable, tool: u8) -> Option<LineFault> {
        match self.kind {
            Kind::Cut(factor) => machine.change_cut(factor),
            Kind::Insert => machine.break_insert(tool),
            Kind::Line(fault) => return Some(fault),
        }
        None
    }

    pub(super) fn end_on(&self, machine: &mut impl Breakable, tool: u8) {
        match self.kind {
            Kind::Cut(_) => machine.change_cut(1.0),
            Kind::Insert => machine.change_edge(tool),
            Kind::Line(_) => {}
        }
    }
}
