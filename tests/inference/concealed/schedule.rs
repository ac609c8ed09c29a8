//! What the shop does that day: parts, passes, edges and lots, by kind of production.

use crate::concealed::baseline::Process;
use crate::concealed::dice::Dice;
use crate::concealed::passes;

/// How varied the production is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Mode {
    /// Every pass another speed, feed, depth and diameter.
    Rich,
    /// Four recipes, repeated part after part.
    Production,
    /// One recipe.
    Mono,
    /// Varied passes under a controller that changes the feed to hold the cutting power.
    ClosedLoop,
}

impl Mode {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Rich => "rich",
            Self::Production => "prod",
            Self::Mono => "mono",
            Self::ClosedLoop => "closed",
        }
    }
}

/// Labels of the operations; `Pass::operation` indexes them.
pub(crate) const OPERATIONS: [&str; 5] = ["face", "rough", "semi", "finish", "creep"];

/// One pass as programmed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pass {
    pub(crate) operation: usize,
    pub(crate) speed_rpm: f64,
    pub(crate) feed_mm_rev: f64,
    pub(crate) depth_mm: f64,
    pub(crate) width_mm: f64,
    pub(crate) diameter_mm: f64,
    /// Diameter at the end: smaller in facing, the same otherwise.
    pub(crate) end_diameter_mm: f64,
    pub(crate) teeth: f64,
    /// Seconds in the cut; 0 is a pass in air.
    pub(crate) cut_s: f64,
    pub(crate) air_s: f64,
    pub(crate) coolant: bool,
    pub(crate) tool: usize,
    /// Moment and new value of an override change within the cut; the value is 1 when there is none.
    pub(crate) override_at_s: f64,
    pub(crate) override_to: f64,
}

/// One part: a run of the recording.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) lot: usize,
    /// Unrecorded standstill before the part, s.
    pub(crate) pause_s: f64,
    pub(crate) door_s: f64,
    pub(crate) passes: Vec<Pass>,
}

/// A day's work.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) mode: Mode,
    pub(crate) parts: Vec<Part>,
    /// One label per edge.
    pub(crate) tools: Vec<String>,
    pub(crate) lots: usize,
    /// Speed at which the gear changes; the stage is 1 below.
    pub(crate) gear_rpm: f64,
    pub(crate) ramp_rpm_s: f64,
    pub(crate) start_ambient_c: f64,
}

/// What an effect needs to be visited at all.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Needs {
    pub(crate) creep: bool,
    pub(crate) low_cutting_speed: bool,
    pub(crate) shallow: bool,
    pub(crate) overrides: bool,
    pub(crate) one_speed: bool,
    pub(crate) one_feed: bool,
    /// Lots begin exactly when an edge is changed.
    pub(crate) lots_with_tools: bool,
    /// Thermal growth and the like need a cold start.
    pub(crate) idle_ladder: bool,
}

impl Plan {
    /// A day of about `seconds` recorded seconds.
    pub(crate) fn draw(mode: Mode, process: Process, needs: Needs, seconds: f64, dice: &mut Dice) -> Self {
        let mut shop = Shop::open(mode, process, needs, dice);
        let mut parts = Vec::new();
        let mut recorded = 0.0;
        while recorded < seconds || parts.len() < 8 {
            let part = shop.part(parts.len(), dice);
            recorded += part.passes.iter().map(|p| p.cut_s + p.air_s + 7.0).sum::<f64>() + 8.0;
            parts.push(part);
        }
        Self {
            mode,
            parts,
            tools: shop.tools,
            lots: shop.lot + 1,
            gear_rpm: dice.uniform(700.0, 1500.0) * if process == Process::Turning { 1.0 } else { 2.0 },
            ramp_rpm_s: dice.uniform(180.0, 420.0) * if process == Process::Turning { 1.0 } else { 2.5 },
            start_ambient_c: dice.uniform(15.0, 24.0),
        }
    }
}

/// The state of the shop while the day is drawn.
struct Shop {
    mode: Mode,
    process: Process,
    needs: Needs,
    recipes: Vec<Pass>,
    tools: Vec<String>,
    /// Edge in use of the roughing and of the finishing tool.
    edges: [usize; 2],
    parts_left: [usize; 2],
    lot: usize,
    lot_left: usize,
    coolant: bool,
}

impl Shop {
    fn open(mode: Mode, process: Process, needs: Needs, dice: &mut Dice) -> Self {
        let mut shop = Self {
            mode,
            process,
            needs,
            recipes: Vec::new(),
            tools: vec!["T1-a".into(), "T2-a".into()],
            edges: [0, 1],
            parts_left: [dice.whole(3, 5), dice.whole(4, 7)],
            lot: 0,
            lot_left: dice.whole(3, 6),
            coolant: true,
        };
        let count = match mode {
            Mode::Mono => 1,
            _ => 4,
        };
        shop.recipes = (0..count).map(|i| shop.draw_pass(if count == 1 { 1 } else { i }, dice)).collect();
        shop
    }

    fn part(&mut self, index: usize, dice: &mut Dice) -> Part {
        let edge_changed = self.change_edges(dice);
        self.change_lot(edge_changed, dice);
        self.coolant = !dice.chance(0.3);
        let passes = match self.mode {
            Mode::Production => self.recipes.clone(),
            Mode::Mono => vec![self.recipes[0]; 4],
            Mode::Rich | Mode::ClosedLoop => self.rich_passes(index, dice),
        };
        let mut passes: Vec<Pass> = passes.into_iter().map(|p| self.prepare(p, dice)).collect();
        self.change_within_part(&mut passes, dice);
        Part { lot: self.lot, pause_s: dice.uniform(20.0, 140.0), door_s: dice.uniform(2.0, 6.0), passes }
    }

    fn rich_passes(&self, index: usize, dice: &mut Dice) -> Vec<Pass> {
        let mut passes: Vec<Pass> = Vec::new();
        if index == 0 && (self.needs.idle_ladder || dice.chance(0.4)) {
            passes.extend((0..5).map(|_| self.air_pass(dice)));
        }
        if self.needs.creep {
            passes.push(self.creep_pass(dice));
        }
        let count = dice.whole(3, 5);
        passes.extend((0..count).map(|i| self.draw_pass([0, 1, 3, 1, 2][i % 5], dice)));
        passes
    }

    /// A pass of this part: coolant, edge, small scatter of times, an override step now and then.
    fn prepare(&self, mut pass: Pass, dice: &mut Dice) -> Pass {
        pass.coolant = if self.mode == Mode::Rich { dice.chance(0.6) } else { self.coolant };
        pass.tool = self.edges[usize::from(pass.operation >= 2)];
        pass.cut_s *= dice.uniform(0.95, 1.05);
        pass.air_s *= dice.uniform(0.8, 1.2);
        if self.mode != Mode::ClosedLoop && dice.chance(self.override_chance()) {
            pass.override_at_s = pass.cut_s * dice.uniform(0.2, 0.8);
            pass.override_to = *dice.pick(&[0.6, 0.7, 0.8, 1.1, 1.2]);
        }
        pass
    }

    fn override_chance(&self) -> f64 {
        match (self.needs.overrides, self.mode) {
            (true, _) => 0.7,
            _ if self.needs.one_feed => 0.0,
            (false, Mode::Rich) => 0.08,
            _ => 0.0,
        }
    }

    /// Now and then the roughing edge is changed in the middle of a part.
    fn change_within_part(&mut self, passes: &mut [Pass], dice: &mut Dice) {
        if self.needs.lots_with_tools || !dice.chance(0.12) || passes.len() < 3 {
            return;
        }
        self.new_edge(0);
        self.parts_left[0] = dice.whole(3, 5);
        let edge = self.edges[0];
        passes.iter_mut().skip(2).filter(|p| p.operation < 2).for_each(|p| p.tool = edge);
    }

    fn change_edges(&mut self, dice: &mut Dice) -> bool {
        let mut changed = false;
        for side in 0..2 {
            if self.parts_left[side] == 0 {
                self.new_edge(side);
                self.parts_left[side] = dice.whole(3, 6) + side;
                changed = true;
            }
            self.parts_left[side] -= 1;
        }
        changed
    }

    fn new_edge(&mut self, side: usize) {
        self.edges[side] = self.tools.len();
        let letter = char::from(b'a' + (self.tools.len() % 26) as u8);
        self.tools.push(format!("T{}-{letter}", side + 1));
    }

    fn change_lot(&mut self, edge_changed: bool, dice: &mut Dice) {
        if self.needs.lots_with_tools {
            self.lot += usize::from(edge_changed);
            return;
        }
        if self.lot_left == 0 {
            self.lot += 1;
            self.lot_left = dice.whole(3, 6);
        }
        self.lot_left -= 1;
    }

    fn air_pass(&self, dice: &mut Dice) -> Pass {
        let mut pass = self.draw_pass(1, dice);
        let top = if self.process == Process::Turning { 3800.0 } else { 8000.0 };
        pass.speed_rpm = if self.needs.one_speed { pass.speed_rpm } else { (dice.uniform(0.1, 1.0) * top).round() };
        (pass.cut_s, pass.air_s) = (0.0, dice.uniform(14.0, 20.0));
        pass
    }

    /// Threading, tapping and orientation: the lowest speeds of the machine.
    fn creep_pass(&self, dice: &mut Dice) -> Pass {
        let mut pass = self.draw_pass(4, dice);
        pass.speed_rpm = dice.log_uniform(18.0, 320.0).round();
        (pass.cut_s, pass.air_s) = (0.0, dice.uniform(14.0, 24.0));
        pass
    }

    fn draw_pass(&self, operation: usize, dice: &mut Dice) -> Pass {
        let pass = match self.process {
            Process::Turning => passes::turning(operation, self.needs, dice),
            Process::Milling => passes::milling(operation, dice),
            Process::Drilling => passes::drilling(operation, dice),
        };
        self.restrict(pass)
    }

    fn restrict(&self, mut pass: Pass) -> Pass {
        if self.needs.one_speed {
            pass.speed_rpm = 1200.0;
        }
        if self.needs.one_feed {
            pass.feed_mm_rev = 0.2;
        }
        pass
    }
}

impl Needs {
    /// Both needs at once.
    pub(crate) fn with(self, other: Self) -> Self {
        Self {
            creep: self.creep | other.creep,
            low_cutting_speed: self.low_cutting_speed | other.low_cutting_speed,
            shallow: self.shallow | other.shallow,
            overrides: self.overrides | other.overrides,
            one_speed: self.one_speed | other.one_speed,
            one_feed: self.one_feed | other.one_feed,
            lots_with_tools: self.lots_with_tools | other.lots_with_tools,
            idle_ladder: self.idle_ladder | other.idle_ladder,
        }
    }
}
