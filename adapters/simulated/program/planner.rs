//! What the day holds: power-up, warm-up, parts in lots, pauses, small trouble, worn edges, the night.

use super::super::settings::SimulatedSettings;
use super::experiment::{self, ExperimentStep};
use super::short_day;
use super::{Action, NcBlock, ProgramWriter, lathe, mill};
use crate::address::SimulatedMachine;
use adapter_core::integer::widen_to_usize;
use adapter_core::words::{execution, mode};
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use std::collections::VecDeque;

/// An edge with more wear than this is changed before the next part.
const WORN_MM: f64 = 0.30;

/// Writes the next piece of the day whenever the control has nothing left to do.
pub(in super::super) struct Planner {
    settings: SimulatedSettings,
    rng: Pcg64Mcg,
    parts: u32,
    day: u32,
    up_since_s: Option<f64>,
    lunch_taken: bool,
    /// In place of the day: an experiment, and then nothing any more.
    experiment: Option<Vec<ExperimentStep>>,
}

impl Planner {
    pub(in super::super) fn new(settings: SimulatedSettings, rng: Pcg64Mcg) -> Self {
        Self { settings, rng, parts: 0, day: 0, up_since_s: None, lunch_taken: false, experiment: None }
    }

    /// Runs these steps once in place of the day.
    pub(in super::super) fn of_experiment(self, steps: Vec<ExperimentStep>) -> Self {
        Self { experiment: Some(steps), ..self }
    }

    /// Appends the next piece of the day. `wear_mm` is that of the worst edge, with its tool.
    pub(in super::super) fn refill_blocks(
        &mut self,
        blocks: &mut VecDeque<NcBlock>,
        since_s: f64,
        worst: Option<(u8, f64)>,
    ) {
        let mut out = ProgramWriter::new(blocks, 0);
        if let Some(steps) = &mut self.experiment {
            return experiment::write(&mut out, &std::mem::take(steps));
        }
        let Some(up_since_s) = self.up_since_s else {
            self.up_since_s = Some(since_s);
            match self.settings.day.rhythm_s {
                Some(_) => short_day::write_morning(&mut out),
                None => self.write_morning(&mut out),
            }
            return;
        };
        let worked_s = since_s - up_since_s;
        if worked_s > self.settings.day.shift_s {
            let Some(rhythm_s) = self.settings.day.rhythm_s else { return self.write_night(&mut out) };
            self.up_since_s = None;
            return short_day::write_night(&mut out, since_s, rhythm_s);
        }
        if worked_s > self.settings.day.shift_s / 2.0 && !self.lunch_taken && self.settings.day.lunch_s > 0.0 {
            self.lunch_taken = true;
            return write_pause(&mut out, self.settings.day.lunch_s);
        }
        if self.settings.day.rhythm_s.is_some() {
            return self.short_part(&mut out, worst);
        }
        if let Some((tool, _)) = worst.filter(|(_, wear_mm)| *wear_mm > WORN_MM) {
            return self.new_edge(&mut out, tool);
        }
        if self.parts > 0 && self.parts.is_multiple_of(self.settings.day.parts_per_pause) {
            write_pause(&mut out, self.settings.day.pause_s);
        }
        self.write_part(&mut out);
    }

    fn write_morning(&mut self, out: &mut ProgramWriter<'_>) {
        let first = self.day == 0;
        self.day += 1;
        self.lunch_taken = false;
        (out.mode, out.execution) = (mode::MANUAL, execution::READY);
        out.append_action(Action::Wait(if first { 8.0 } else { 0.5 })).append_action(Action::Mains(true));
        out.append_action(Action::Wait(if first { 26.0 } else { 90.0 }));
        out.append_action(Action::Hydraulics(true))
            .append_action(Action::Drives(true))
            .append_action(Action::Wait(4.0));
        out.append_action(Action::Rapid([200.0, 0.0, 160.0]));
        (out.mode, out.execution, out.program) = (mode::AUTOMATIC, execution::ACTIVE, 9000);
        out.operation = "warm-up";
        self.warm_up(out, if first { 11.0 } else { 150.0 });
        out.operation = "";
        out.append_action(Action::Stop);
        out.append_aside(mode::AUTOMATIC, execution::PROGRAM_COMPLETED, Action::Wait(6.0));
    }

    fn warm_up(&self, out: &mut ProgramWriter<'_>, dwell_s: f64) {
        let lathe = self.settings.machine == SimulatedMachine::Lathe;
        let speeds: &[(f64, u8)] = if lathe {
            &[(300.0, 1), (600.0, 1), (900.0, 1), (1200.0, 2), (1600.0, 2)]
        } else {
            &[(500.0, 1), (1200.0, 1), (2500.0, 1), (4000.0, 1), (6000.0, 1)]
        };
        let mut last = speeds[0].1;
        for &(speed_rpm, stage) in speeds {
            if stage != last {
                out.append_action(Action::Stop);
            }
            last = stage;
            out.append_action(Action::Spindle(speed_rpm, stage)).append_action(Action::Wait(dwell_s));
        }
    }

    /// Unloading and loading, then the program, sometimes with trouble.
    fn write_part(&mut self, out: &mut ProgramWriter<'_>) {
        let lot = self.parts / self.settings.day.parts_per_lot.max(1);
        if self.parts.is_multiple_of(self.settings.day.parts_per_lot.max(1)) {
            let hardness = if lot == 0 { 1.0 } else { self.rng.random_range(0.93..1.08) };
            out.append_action(Action::Hardness(hardness));
        }
        let load_s = self.rng.random_range(9.0..18.0);
        out.append_aside(mode::AUTOMATIC, execution::PROGRAM_COMPLETED, Action::Wait(load_s));
        if self.parts > 2 && self.rng.random_bool(0.05) {
            write_alarm(out);
        }
        let rng = &mut self.rng;
        let changes = self.settings.speed_changes;
        let mut vary = || if changes { rng.random_range(0.8..1.2) } else { 1.0 };
        let lot = widen_to_usize(lot);
        match self.settings.machine {
            SimulatedMachine::Lathe => lathe::write_part(out, lot, &mut vary),
            SimulatedMachine::Mill => mill::write_part(out, lot, &mut vary),
        }
        out.append_action(Action::PartDone);
        self.parts += 1;
    }

    /// The second part of a short day has an alarm before it; a pause follows; a worn edge is changed quickly.
    fn short_part(&mut self, out: &mut ProgramWriter<'_>, worst: Option<(u8, f64)>) {
        let of_day = self.parts % short_day::PARTS;
        self.parts += 1;
        short_day::write_part(
            out,
            of_day,
            worst.filter(|(_, wear_mm)| *wear_mm > WORN_MM).map(|(tool, _)| tool),
            self.settings.day.pause_s,
        );
    }

    fn new_edge(&mut self, out: &mut ProgramWriter<'_>, tool: u8) {
        let fetch_s = self.rng.random_range(60.0..120.0);
        (out.mode, out.execution) = (mode::MANUAL, execution::READY);
        out.append_action(Action::ToolChange(tool)).append_action(Action::Wait(fetch_s)).append_action(Action::NewEdge);
    }

    fn write_night(&mut self, out: &mut ProgramWriter<'_>) {
        self.up_since_s = None;
        (out.mode, out.execution) = (mode::MANUAL_DATA_INPUT, execution::ACTIVE);
        // Chips are spun off and the coolant is drained.
        out.append_action(Action::Spindle(500.0, 1)).append_action(Action::Wait(20.0)).append_action(Action::Stop);
        (out.mode, out.execution) = (mode::MANUAL, execution::READY);
        out.append_action(Action::Wait(120.0))
            .append_action(Action::Drives(false))
            .append_action(Action::Hydraulics(false));
        out.append_action(Action::Wait(15.0))
            .append_action(Action::Mains(false))
            .append_action(Action::Wait(self.settings.day.night_s));
    }
}

fn write_pause(out: &mut ProgramWriter<'_>, seconds: f64) {
    out.append_aside(mode::AUTOMATIC, execution::READY, Action::Hydraulics(false));
    out.append_aside(mode::AUTOMATIC, execution::READY, Action::Wait(seconds));
    out.append_aside(mode::AUTOMATIC, execution::READY, Action::Hydraulics(true));
}

fn write_alarm(out: &mut ProgramWriter<'_>) {
    out.append_aside(mode::AUTOMATIC, execution::STOPPED, Action::Alarm("1005 CHUCK PRESSURE LOW"));
    out.append_aside(mode::AUTOMATIC, execution::STOPPED, Action::Wait(25.0));
    out.append_aside(mode::AUTOMATIC, execution::READY, Action::Alarm(""));
}
