//! The simulated machine behind a control.

use super::controller::{Controller, Data};
use super::encode::saturate_counter;
use super::ladder::{PmcLadder, SCAN_NS};
use super::listen::ServedControl;
use super::panel_status::{build_status, round_to_number};
use super::{screen, second_path};
use adapter_core::clock::{Clock, TimeNs};
use adapter_core::driver::{Actuator, LadderRequest, LadderRule};
use adapter_core::override_pct::OverridePct;
use adapter_core::words::{execution, mode, operation};
use fanuc::answer::Alarm;
use fanuc::item::{Area, BlockWord};
use fanuc::wire::Number;
use simulated::address::SimulatedMachine;
use simulated::{Moment, Panel, Simulated};
use std::sync::Arc;

/// After a pause without questions the ladder makes up for at most so many scans.
const SCANS_MAX: i64 = 1000;

/// A control with its ladder, and the simulated machine under it.
pub struct SimulatedControl {
    machine: Simulated,
    clock: Arc<dyn Clock>,
    controller: Controller,
    ladder: PmcLadder,
    /// The rungs of the further paths.
    further: Vec<PmcLadder>,
    scanned_ns: TimeNs,
    written: OverridePct,
    requests: [Requested; 2],
}

/// A request on its way through the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Requested {
    request: LadderRequest,
    /// Was the machine told?
    told: bool,
    /// Has the machine been seen to stand because of it?
    stood: bool,
}

impl SimulatedControl {
    /// The machine as a control of the generation with this version word. `clock` is the machine's time.
    #[must_use]
    pub fn new(machine: Simulated, clock: Arc<dyn Clock>, version: u16) -> Self {
        let lathe = machine.settings().machine == SimulatedMachine::Lathe;
        let axes: &[char] = if lathe { &['X', 'Z'] } else { &['X', 'Y', 'Z'] };
        let mut controller = Controller::new(version, axes);
        controller.system.machine = if lathe { "T" } else { "M" }.to_owned();
        controller.offsets_only_at_rest = true;
        controller.measure_in_inches(false);
        // What the vendor's library asks older controls for besides the feed.
        [3106, 9936].into_iter().for_each(|number| controller.set_parameter(number, 3, Number::from_decimal(0, 0)));
        controller.parameters.insert(3115, Data { kind: 0, values: vec![Number::from_decimal(0, 0); axes.len()] });
        screen::set_fixed_parameters(&mut controller);
        let scanned_ns = clock.now_ns();
        let (ladder, written) = (PmcLadder::default(), OverridePct::FULL);
        let requests = LadderRequest::ALL.map(|request| Requested { request, told: false, stood: false });
        let further = Vec::new();
        Self { machine, clock, controller, ladder, further, scanned_ns, written, requests }
    }

    /// The same machine with a second turret, which works at the back of the part on a path of its own.
    #[must_use]
    pub fn with_path(mut self) -> Self {
        self.controller = self.controller.with_path(&['X', 'Z']);
        for control in &mut self.controller.further {
            control.offsets_only_at_rest = true;
            control.measure_in_inches(false);
            screen::set_fixed_parameters(control);
        }
        let mut ladder = PmcLadder::of_path(2);
        (ladder.dial, ladder.rule) = (self.ladder.dial, self.ladder.rule);
        self.further = vec![ladder];
        self
    }

    /// How the ladder combines the operator's dial and the mailbox.
    #[must_use]
    pub fn with_rule(mut self, rule: LadderRule) -> Self {
        self.iter_ladders().for_each(|ladder| ladder.rule = rule);
        self
    }

    /// The rungs of every path.
    fn iter_ladders(&mut self) -> impl Iterator<Item = &mut PmcLadder> {
        std::iter::once(&mut self.ladder).chain(&mut self.further)
    }

    /// The operator turns the dial of the feed override.
    pub fn turn_dial(&mut self, dial: OverridePct) {
        self.iter_ladders().for_each(|ladder| ladder.dial = dial);
    }

    /// Every scan since the last look, and what they mean for the machine.
    fn run_scans(&mut self, now_ns: TimeNs) {
        self.scanned_ns = self.scanned_ns.max(now_ns - SCANS_MAX * SCAN_NS);
        while self.scanned_ns + SCAN_NS <= now_ns {
            self.scanned_ns += SCAN_NS;
            let ladders = std::iter::once(&mut self.ladder).chain(&mut self.further);
            ladders.for_each(|ladder| ladder.scan_memory(&mut self.controller.memory, self.scanned_ns));
        }
        let wanted = self.ladder.compute_override(&self.controller.memory);
        // What this control's ladder has made of dial and mailbox is all that the machine below sees.
        if wanted != self.written {
            self.machine.turn_dial(now_ns, wanted);
            self.written = wanted;
        }
    }

    /// Tells the machine what the ladder has latched; the operator acknowledges at the machine.
    fn forward_requests(&mut self, panel: &Panel) {
        for asked in &mut self.requests {
            let stands = match asked.request {
                LadderRequest::FeedHold => panel.execution == execution::FEED_HOLD,
                LadderRequest::Stop => panel.execution == execution::STOPPED && panel.alarm.is_empty(),
            };
            if !self.ladder.is_latched(asked.request) {
                (asked.told, asked.stood) = (false, false);
            } else if !asked.told {
                // A machine that is off at this moment is told at the next look.
                asked.told = self.machine.feed_override().ask_ladder(&*self.clock, asked.request).is_ok();
            } else if asked.stood && !stands {
                self.ladder.acknowledge_request(asked.request);
            }
            asked.stood |= asked.told && stands;
        }
    }
}

impl ServedControl for SimulatedControl {
    fn update_controller(&mut self) -> Option<&mut Controller> {
        let now_ns = self.clock.now_ns();
        let moment = self.machine.moment(now_ns);
        if !moment.panel.booted {
            self.controller.memory.power_off();
            self.iter_ladders().for_each(PmcLadder::power_off);
            self.scanned_ns = now_ns;
            return None;
        }
        self.run_scans(now_ns);
        self.forward_requests(&moment.panel);
        show_moment(&mut self.controller, &moment);
        screen::show_pages(&mut self.controller, &moment, now_ns);
        for (ladder, control) in self.further.iter_mut().zip(&mut self.controller.further) {
            second_path::show_path(control, &mut self.controller.memory, ladder, &moment);
        }
        Some(&mut self.controller)
    }
}

/// The moment on the control's screen.
fn show_moment(control: &mut Controller, moment: &Moment) {
    let panel = &moment.panel;
    control.status = build_status(panel);
    control.feed = round_to_number(panel.feed_mm_min);
    let load = round_to_number(moment.electric.spindle_load_pct);
    let speed = round_to_number(panel.spindle_speed_rpm.abs());
    let gear = Number::from_decimal(i32::from(panel.gear_stage), 0);
    control.spindles[0].quantities = [load, round_to_number(6000.0), gear, speed, load, speed];
    show_axes(control, panel);
    control.program = (i32::from(panel.program), i32::from(panel.program));
    control.program_path = format!("//CNC_MEM/USER/PATH1/O{:04}", panel.program);
    control.sequence = i32::from(panel.block);
    control.executed = (i32::from(panel.block), format!("N{} F{:.0}\n%", panel.block, panel.feed_programmed_mm_min));
    let modal = [(BlockWord::F, panel.feed_programmed_mm_min), (BlockWord::S, panel.spindle_programmed_rpm.abs())];
    control.modal_words.extend(modal.map(|(word, value)| (word, round_to_number(value))));
    control.set_modal_words([(BlockWord::T, i32::from(panel.tool))]);
    let parts = saturate_counter(i64::from(panel.part_count));
    control.parameters.insert(6711, Data { kind: 3, values: vec![Number::from_decimal(parts, 0)] });
    control.set_diagnosis(403, 1, round_to_number(moment.electric.motor_temperature_c));
    // What the drive shows of itself, in steps of ten watts.
    let power =
        Number::from_decimal(round_to_number(moment.truth.spindle_power_w / 10.0).mantissa.saturating_mul(10), 0);
    control.set_diagnosis(4902, 2, power);
    show_alarms(control, panel);
    show_signals(control, panel);
}

/// Positions in micrometres. The load of an axis is what its friction takes: 3 % and 1 % more per 200 mm/min.
fn show_axes(control: &mut Controller, panel: &Panel) {
    for axis in &mut control.axes {
        let index = match axis.name.as_str() {
            "X" => 0,
            "Y" => 1,
            _ => 2,
        };
        let position = Number { exponent: 3, ..round_to_number(panel.position_mm[index] * 1000.0) };
        axis.positions = [position, position, position, Number::from_decimal(0, 3)];
        let velocity = panel.velocity_mm_min[index];
        let load = if panel.drives_on { 3.0 + velocity.abs() / 200.0 } else { 0.0 };
        axis.load = round_to_number(load.min(150.0).copysign(velocity));
        axis.current = Number { exponent: 1, ..round_to_number(load.min(150.0)) };
    }
}

fn show_alarms(control: &mut Controller, panel: &Panel) {
    control.alarm_bits = i32::from(!panel.alarm.is_empty()) << 15;
    control.alarms.clear();
    if !panel.alarm.is_empty() {
        control.alarms.push(Alarm { number: 2001, kind: 15, axis: 0, text: panel.alarm.to_owned() });
    }
}

fn show_signals(control: &mut Controller, panel: &Panel) {
    let active = panel.execution == execution::ACTIVE;
    let thread = |word| active && panel.override_locked && panel.operation.contains(word);
    let tapping = thread(operation::TAPPING);
    let threading = active && panel.override_locked && !tapping;
    let cutting = active && !panel.rapid && panel.feed_mm_min > 0.0;
    let bits = [
        (0, 4, panel.execution == execution::FEED_HOLD),
        (0, 5, active),
        (0, 6, panel.drives_on),
        (0, 7, active),
        (1, 0, !panel.alarm.is_empty()),
        (1, 5, tapping),
        (1, 7, true),
        (2, 1, panel.rapid),
        (2, 3, threading),
        (2, 6, cutting),
        (4, 3, panel.mode == mode::SEMI_AUTOMATIC),
    ];
    bits.into_iter().for_each(|(byte, bit, on)| control.memory.set_bit(Area::F, byte, bit, on));
    control.memory.set_byte(Area::G, 30, 100);
}
