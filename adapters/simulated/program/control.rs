//! The simulated control: works through blocks, moves the axes, obeys the feed override.

use super::super::frame::MachineSnapshot;
use super::super::plant::{Demand, Plant};
use super::super::settings::FRESH_EDGE_MM;
use super::{Action, Cut, NcBlock, Planner, Rate};
use adapter_core::words::{execution, mode};
use rand::Rng;
use rand_pcg::Pcg64Mcg;
use std::collections::VecDeque;

const TOOLS: usize = 8;

/// A control needs this long to start.
const BOOT_S: f64 = 12.0;

/// A tool change takes this long.
const TOOL_CHANGE_S: f64 = 2.6;

/// Whoever stands looks this often whether the operator has come.
const STAND_S: f64 = 1.0;

/// Which motion is going on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) enum Motion {
    None,
    Rapid,
    Feed { cut: Option<Cut>, locked: bool, programmed_mm_min: f64 },
}

/// A motion in progress.
#[derive(Debug, Clone, Copy)]
struct Path {
    from: [f64; 3],
    to: [f64; 3],
    length_mm: f64,
    done_mm: f64,
}

/// State of the control.
pub(in super::super) struct Control {
    planner: Planner,
    rng: Pcg64Mcg,
    lathe: bool,
    rapid_mm_min: f64,
    blocks: VecDeque<NcBlock>,
    pub(in super::super) block: Option<NcBlock>,
    path: Option<Path>,
    waited_s: f64,
    hold_at_mm: Option<f64>,
    hold_left_s: f64,
    pub(in super::super) since_boot_s: f64,
    pub(in super::super) demand: Demand,
    pub(in super::super) motion: Motion,
    pub(in super::super) feed_mm_min: f64,
    pub(in super::super) position_mm: [f64; 3],
    pub(in super::super) velocity_mm_min: [f64; 3],
    pub(in super::super) holding: bool,
    pub(in super::super) tool: u8,
    pub(in super::super) edges: [u16; TOOLS],
    pub(in super::super) wear_mm: [f64; TOOLS],
    pub(in super::super) part_count: u32,
    pub(in super::super) alarm: &'static str,
    /// The operator turned the dial to this.
    pub(in super::super) dial_request: Option<u8>,
    /// The ladder holds the axes.
    pub(in super::super) hold_asked: bool,
    /// The ladder wants the program to stand after this part.
    pub(in super::super) stop_asked: bool,
    /// How long it has stood for that reason.
    pub(in super::super) stood_s: Option<f64>,
    /// The operator has come.
    pub(in super::super) attended: bool,
    pub(in super::super) hardness: f64,
}

impl Control {
    pub(in super::super) fn new(planner: Planner, rng: Pcg64Mcg, frame: &MachineSnapshot, wear_mm: f64) -> Self {
        Self {
            planner,
            rng,
            lathe: frame.lathe,
            rapid_mm_min: frame.rapid_mm_min,
            blocks: VecDeque::new(),
            block: None,
            path: None,
            waited_s: 0.0,
            hold_at_mm: None,
            hold_left_s: 0.0,
            since_boot_s: 0.0,
            demand: Demand { gear_stage: 1, ..Demand::default() },
            motion: Motion::None,
            feed_mm_min: 0.0,
            position_mm: [200.0, 0.0, 160.0],
            velocity_mm_min: [0.0; 3],
            holding: false,
            tool: 1,
            edges: [0; TOOLS],
            wear_mm: [wear_mm; TOOLS],
            part_count: 0,
            alarm: "",
            dial_request: None,
            hold_asked: false,
            stop_asked: false,
            stood_s: None,
            attended: false,
            hardness: 1.0,
        }
    }

    /// Has the control finished starting?
    pub(in super::super) fn has_booted(&self) -> bool {
        self.demand.powered && self.since_boot_s >= BOOT_S
    }

    /// Index of the tool in use.
    pub(in super::super) fn tool_index(&self) -> usize {
        usize::from(self.tool).min(TOOLS - 1)
    }

    /// Moves on by `dt_s` with the override in force.
    pub(in super::super) fn run_step(&mut self, plant: &Plant, override_pct: u8, since_s: f64, dt_s: f64) {
        self.since_boot_s = if self.demand.powered { self.since_boot_s + dt_s } else { 0.0 };
        // Instant blocks follow each other at once; a limit guards against a plan without any duration.
        for _ in 0..64 {
            let block = self.fetch_block(since_s);
            if !self.execute_action(&block.action, plant, override_pct, dt_s) {
                break;
            }
            self.block = None;
        }
    }

    fn fetch_block(&mut self, since_s: f64) -> NcBlock {
        if let Some(block) = self.block {
            return block;
        }
        if let Some(block) = self.build_stop_block() {
            return block;
        }
        if self.blocks.is_empty() {
            let worst = self.worst_edge();
            self.planner.refill_blocks(&mut self.blocks, since_s, worst);
        }
        let idle = NcBlock {
            mode: mode::MANUAL,
            execution: execution::READY,
            program: 0,
            number: 0,
            operation: "",
            action: Action::Wait(1.0),
        };
        let block = self.blocks.pop_front().unwrap_or(idle);
        self.begin_action(&block.action);
        self.block = Some(block);
        block
    }

    /// Between two parts, when the ladder wants the program to stand: until the operator has changed the edge.
    fn build_stop_block(&mut self) -> Option<NcBlock> {
        if self.attended {
            (self.attended, self.stood_s) = (false, None);
            self.worst_edge().into_iter().for_each(|(tool, _)| self.fresh_edge(usize::from(tool)));
        }
        if !self.stop_asked || !self.blocks.is_empty() {
            return None;
        }
        let stood_s = self.stood_s.get_or_insert(0.0);
        *stood_s += STAND_S;
        let block = NcBlock {
            mode: mode::AUTOMATIC,
            execution: execution::STOPPED,
            program: 0,
            number: 0,
            operation: "",
            action: Action::Wait(STAND_S),
        };
        self.waited_s = 0.0;
        self.block = Some(block);
        Some(block)
    }

    fn worst_edge(&self) -> Option<(u8, f64)> {
        let edges = self.wear_mm.iter().enumerate().filter_map(|(tool, wear)| Some((u8::try_from(tool).ok()?, *wear)));
        edges.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn begin_action(&mut self, action: &Action) {
        self.waited_s = 0.0;
        self.path = None;
        self.hold_at_mm = None;
        match *action {
            Action::Rapid(to) => self.path = Some(self.path_to(to)),
            Action::Feed { to, cut, locked, .. } => {
                let path = self.path_to(to);
                let hold = cut.is_some() && !locked && self.rng.random_bool(0.01);
                self.hold_at_mm = hold.then(|| path.length_mm * self.rng.random_range(0.2..0.8));
                self.path = Some(path);
            }
            Action::Spindle(rpm, stage) => (self.demand.spindle_rpm, self.demand.gear_stage) = (rpm, stage),
            Action::Stop => self.demand.spindle_rpm = 0.0,
            _ => {}
        }
    }

    /// Half of X on the lathe, whose X is a diameter.
    fn path_to(&self, to: [f64; 3]) -> Path {
        let from = self.position_mm;
        let scale = if self.lathe { 0.5 } else { 1.0 };
        let [x, y, z] = [(to[0] - from[0]) * scale, to[1] - from[1], to[2] - from[2]];
        Path { from, to, length_mm: (x * x + y * y + z * z).sqrt(), done_mm: 0.0 }
    }

    /// Works on an action; true when it is finished.
    fn execute_action(&mut self, action: &Action, plant: &Plant, override_pct: u8, dt_s: f64) -> bool {
        self.motion = Motion::None;
        self.holding = false;
        self.stop_axes();
        match *action {
            Action::Mains(on) => self.demand.powered = on,
            Action::Drives(on) => self.demand.drives_on = on,
            Action::Hydraulics(on) => self.demand.hydraulics_on = on,
            Action::Coolant(on) => self.demand.coolant_on = on,
            Action::Wait(seconds) => return self.advance_wait(seconds, dt_s),
            // A fifth of a second passes between reaching the speed and going on.
            Action::Spindle(..) => return plant.at_speed() && self.advance_wait(0.2, dt_s),
            Action::Stop => return plant.speed_rpm == 0.0,
            Action::Rapid(_) => return self.advance_rapid(dt_s),
            Action::Feed { rate, cut, locked, .. } => {
                return self.advance_feed(rate, cut, locked, plant.speed_rpm, override_pct, dt_s);
            }
            Action::ToolChange(tool) => return self.change_tool(tool, dt_s),
            Action::NewEdge => self.new_edge(),
            Action::PartDone => self.part_count += 1,
            Action::Alarm(text) => self.alarm = text,
            Action::Override(percent) => self.dial_request = Some(percent),
            Action::Hardness(hardness) => self.hardness = hardness,
        }
        true
    }

    fn stop_axes(&mut self) {
        self.feed_mm_min = 0.0;
        self.velocity_mm_min = [0.0; 3];
        self.demand.axis_mm_min = 0.0;
    }

    fn advance_wait(&mut self, seconds: f64, dt_s: f64) -> bool {
        self.waited_s += dt_s;
        self.waited_s >= seconds
    }

    fn change_tool(&mut self, tool: u8, dt_s: f64) -> bool {
        if tool == self.tool {
            return true;
        }
        let done = self.advance_wait(TOOL_CHANGE_S, dt_s);
        if done {
            self.tool = tool;
        }
        done
    }

    fn new_edge(&mut self) {
        self.fresh_edge(self.tool_index());
    }

    pub(in super::super) fn fresh_edge(&mut self, index: usize) {
        let index = index.min(TOOLS - 1);
        self.edges[index] += 1;
        self.wear_mm[index] = FRESH_EDGE_MM;
    }

    fn advance_rapid(&mut self, dt_s: f64) -> bool {
        self.motion = Motion::Rapid;
        if self.hold_asked {
            self.holding = true;
            return false;
        }
        self.advance_path(self.rapid_mm_min, dt_s)
    }

    fn advance_feed(
        &mut self,
        rate: Rate,
        cut: Option<Cut>,
        locked: bool,
        speed_rpm: f64,
        override_pct: u8,
        dt_s: f64,
    ) -> bool {
        let (programmed, commanded) = match rate {
            Rate::PerMinute(feed) => (feed, feed),
            Rate::PerTurn(feed) => (feed * self.demand.spindle_rpm.abs(), feed * speed_rpm.abs()),
        };
        self.motion = Motion::Feed { cut, locked, programmed_mm_min: programmed };
        if self.update_feed_hold(dt_s) {
            return false;
        }
        let share = if locked { 1.0 } else { f64::from(override_pct) / 100.0 };
        self.advance_path(commanded * share, dt_s)
    }

    /// Somebody pressed feed hold, and later start.
    fn update_feed_hold(&mut self, dt_s: f64) -> bool {
        let done_mm = self.path.map_or(0.0, |path| path.done_mm);
        if self.hold_at_mm.is_some_and(|at_mm| done_mm >= at_mm) {
            self.hold_at_mm = None;
            self.hold_left_s = self.rng.random_range(4.0..15.0);
        }
        self.hold_left_s = (self.hold_left_s - dt_s).max(0.0);
        self.holding = self.hold_left_s > 0.0 || self.hold_asked;
        self.holding
    }

    fn advance_path(&mut self, feed_mm_min: f64, dt_s: f64) -> bool {
        let Some(path) = &mut self.path else { return true };
        path.done_mm = (path.done_mm + feed_mm_min / 60.0 * dt_s).min(path.length_mm);
        let share = if path.length_mm > 0.0 { path.done_mm / path.length_mm } else { 1.0 };
        let before = self.position_mm;
        for ((position, from), to) in self.position_mm.iter_mut().zip(path.from).zip(path.to) {
            *position = from + (to - from) * share;
        }
        let done = path.done_mm >= path.length_mm;
        for ((velocity, position), before) in self.velocity_mm_min.iter_mut().zip(self.position_mm).zip(before) {
            *velocity = (position - before) / dt_s * 60.0;
        }
        self.feed_mm_min = feed_mm_min;
        self.demand.axis_mm_min = feed_mm_min;
        done
    }

    /// The cut in progress with the share of its path that is done, where the tool is in the work.
    pub(in super::super) fn find_contact(&self) -> Option<(Cut, f64)> {
        let Motion::Feed { cut: Some(cut), .. } = self.motion else { return None };
        let path = self.path?;
        let inside = path.done_mm >= cut.air_mm && path.done_mm < path.length_mm;
        let work_mm = (path.length_mm - cut.air_mm).max(1e-6);
        inside.then_some((cut, ((path.done_mm - cut.air_mm) / work_mm).clamp(0.0, 1.0)))
    }
}
