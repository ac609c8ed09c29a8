//! What an effect sees: the inputs of a recording by the part they play.

mod columns;

use crate::cut::mark_contact_rows;
use adapter_core::channel::quantity::Quantity;
use recording::{Recording, Words};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, OnceLock};
use thiserror::Error;

/// Relative change of the spindle speed from one row to the next that starts a new pass.
const PASS_JUMP: f64 = 0.05;
/// Periods between two rows beyond which they lie on two sides of a pause; for so long an input is held across it.
pub const PAUSE_PERIODS: f64 = 10.0;

/// The parts that columns play for the effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Speed of the spindle, rpm.
    Speed,
    /// Acceleration of an axis or drive.
    Acceleration,
    /// Velocity of an axis or drive.
    Velocity,
    /// Position of an axis or drive.
    Position,
    /// Load on the drive, where the model has no `cutting_power`.
    Load,
    /// Tool in the work, 0 to 1.
    Engaged,
    /// Temperature of the machine part that matters (bearing), degrees Celsius.
    Temperature,
    /// Temperature of the shop, degrees Celsius.
    Ambient,
    /// Voltage of the supply, V.
    Voltage,
    /// Position of the axis that moves against gravity, or the word that names the axis.
    Vertical,
}

impl Role {
    /// Every role, for tables of words.
    pub const ALL: [Self; 10] = [
        Self::Speed,
        Self::Acceleration,
        Self::Velocity,
        Self::Position,
        Self::Load,
        Self::Engaged,
        Self::Temperature,
        Self::Ambient,
        Self::Voltage,
        Self::Vertical,
    ];

    /// The name in `[roles]` of a model file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Acceleration => "acceleration",
            Self::Velocity => "velocity",
            Self::Position => "position",
            Self::Load => "load",
            Self::Engaged => "engaged",
            Self::Temperature => "temperature",
            Self::Ambient => "ambient",
            Self::Voltage => "voltage",
            Self::Vertical => "vertical",
        }
    }

    /// The role of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.name() == name)
    }

    /// The channels that play the role by their meaning, best first.
    #[must_use]
    pub fn default_channels(self) -> &'static [&'static str] {
        match self {
            Self::Speed => &["spindle_speed_rpm", "motor_speed_rpm", "spindle_programmed_rpm"],
            Self::Acceleration => &["acceleration_m_s2", "axis_acceleration_mm_s2"],
            Self::Velocity => &["axis_velocity_mm_min", "velocity_m_s"],
            Self::Position => &["axis_position_mm", "position_m", "z_axis_position_mm"],
            Self::Load => &[],
            Self::Engaged => &["engaged"],
            Self::Temperature => &["bearing_temperature_c", "motor_temperature_c"],
            Self::Ambient => &["ambient_temperature_c"],
            Self::Voltage => &["supply_voltage_v"],
            Self::Vertical => &[],
        }
    }
}

/// What kind of quantity the output is: it decides whether friction is a level or grows with speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputKind {
    /// Power: a friction force costs power in proportion to speed.
    Power,
    /// Force, torque, load or current of a drive: a friction force is a level with the sign of motion.
    Force,
    /// Displacement of the tool against the work.
    Displacement,
    /// Any other quantity, temperature and position among them.
    Other,
}

impl OutputKind {
    /// From the quantity that the output's name tells.
    #[must_use]
    pub fn from_output_name(output: &str) -> Self {
        match Quantity::from_column_name(output) {
            Quantity::Displacement => Self::Displacement,
            Quantity::Power => Self::Power,
            Quantity::Force | Quantity::Torque | Quantity::Current | Quantity::Load => Self::Force,
            Quantity::Temperature | Quantity::Position | Quantity::Other => Self::Other,
        }
    }
}

/// Why a scene cannot be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SceneError {
    /// The output is not a quantity of the recording.
    #[error("the recording has no quantity {output}, the output of the model. {hint}")]
    NoOutput {
        /// The output named by the model.
        output: String,
        /// What to do, as one sentence.
        hint: String,
    },
}

/// A recording seen by the effects. Gaps of an input are filled by holding the last value within the run (a run's
/// head by the first value that comes), and only then are products of inputs formed: a product that was held across a gap
/// would be that of other work. [`Scene::filled_rows`] tells where; [`Scene::usable_rows`] where an output value stands.
#[derive(Debug, Clone)]
pub struct Scene {
    rows: usize,
    time_s: Vec<f64>,
    runs: Vec<Range<usize>>,
    run_names: Vec<String>,
    clock_s: Vec<f64>,
    period_s: f64,
    columns: BTreeMap<String, Vec<f64>>,
    absent: BTreeMap<String, Vec<bool>>,
    filled_rows: BTreeMap<String, Vec<usize>>,
    words: BTreeMap<String, Words>,
    roles: BTreeMap<Role, String>,
    output: String,
    recorded: Vec<f64>,
    usable: Vec<bool>,
    passes: Vec<Range<usize>>,
    load: Option<Vec<f64>>,
    load_at_output: Option<Vec<f64>>,
    simulated: Option<Vec<f64>>,
    unrecorded_state: Option<Vec<f64>>,
    laws: RefCell<BTreeMap<String, LinearLaw>>,
    feed_load_growth: OnceLock<Option<Vec<f64>>>,
    usual_cut: OnceLock<f64>,
}

/// A formula over columns that is linear in its parameters: what it is with all of them at zero, then what one unit of
/// each adds, per row; `None` for a formula that is not linear.
pub type LinearLaw = Option<Arc<Vec<Vec<f64>>>>;

impl Scene {
    /// Prepares a recording for a model with this output and these declared roles.
    ///
    /// # Errors
    /// [`SceneError::NoOutput`] when the output is not recorded.
    pub fn new(recording: &Recording, output: &str, roles: &BTreeMap<Role, String>) -> Result<Self, SceneError> {
        let measured = recording.find_numbers(output).ok_or_else(|| SceneError::NoOutput {
            output: output.to_owned(),
            hint: format!("Record the channel {output}, or name another output in the model."),
        })?;
        let runs = recording.list_runs();
        let run_names = runs.iter().map(|run| run.name.clone()).collect();
        let runs: Vec<Range<usize>> = runs.into_iter().map(|run| run.rows).collect();
        let mut scene = Self {
            rows: recording.count_rows(),
            time_s: recording.time_s.clone(),
            clock_s: compute_clock_s(recording, &runs),
            period_s: compute_median_period_s(&recording.time_s, &runs),
            recorded: measured.iter().map(|value| value.unwrap_or(0.0)).collect(),
            usable: measured.iter().map(|value| value.is_some()).collect(),
            run_names,
            columns: BTreeMap::new(),
            absent: BTreeMap::new(),
            filled_rows: BTreeMap::new(),
            words: BTreeMap::new(),
            roles: BTreeMap::new(),
            output: output.to_owned(),
            passes: Vec::new(),
            load: None,
            load_at_output: None,
            simulated: None,
            unrecorded_state: None,
            laws: RefCell::default(),
            feed_load_growth: OnceLock::new(),
            usual_cut: OnceLock::new(),
            runs,
        };
        scene.read_columns(recording);
        scene.assign_roles(roles);
        scene.passes = scene.find_passes();
        Ok(scene)
    }

    fn assign_roles(&mut self, declared: &BTreeMap<Role, String>) {
        for role in Role::ALL {
            let default = role.default_channels().iter().find(|name| self.columns.contains_key(**name));
            let column = declared.get(&role).cloned().or_else(|| default.map(|name| (*name).to_owned()));
            if let Some(column) = column {
                self.roles.insert(role, column);
            }
        }
    }

    /// Stretches with the tool in the work, within a run; another word in `pass`, a jump of the spindle speed while
    /// engaged (surface speed held on another diameter) or of what holds an axis in its place (another diameter at the
    /// same speed) starts a new one.
    fn find_passes(&self) -> Vec<Range<usize>> {
        let Some(engaged) = self.role_values(Role::Engaged) else { return Vec::new() };
        let in_contact = mark_contact_rows(engaged);
        let speed = self.role_values(Role::Speed);
        let named = self.text_column("pass");
        let moved = super::tool_load::mark_moved_rows(self);
        let steps = |row: usize| {
            speed.is_some_and(|n| (n[row] - n[row - 1]).abs() > PASS_JUMP * n[row - 1].abs())
                || named.is_some_and(|pass| pass.get(row) != pass.get(row - 1))
                || moved.get(row).is_some_and(|moved| *moved)
        };
        let mut passes: Vec<Range<usize>> = Vec::new();
        for run in &self.runs {
            // What takes several rows to change has changed at the last of them.
            let jumps = |row: usize| steps(row) && (row + 1 == run.end || !steps(row + 1));
            let mut start = None;
            for row in run.clone() {
                match (in_contact[row], start) {
                    (true, None) => start = Some(row),
                    (true, Some(first)) if jumps(row) => {
                        passes.push(first..row);
                        start = Some(row);
                    }
                    (false, Some(first)) => {
                        passes.push(first..row);
                        start = None;
                    }
                    _ => {}
                }
            }
            if let Some(first) = start {
                passes.push(first..run.end);
            }
        }
        passes
    }

    /// Number of rows; every column has as many values.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Seconds, as recorded; restarts at a run where the recording does.
    #[must_use]
    pub fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Rows of each run.
    #[must_use]
    pub fn runs(&self) -> &[Range<usize>] {
        &self.runs
    }

    /// Name of each run.
    #[must_use]
    pub fn run_names(&self) -> &[String] {
        &self.run_names
    }

    /// Seconds on a clock that never restarts: across a known pause it runs on, across an unknown one (the recording's
    /// time restarts) it stands still. States are carried on this clock.
    #[must_use]
    pub fn clock_s(&self) -> &[f64] {
        &self.clock_s
    }

    /// How long the row before this one drove a state, s: until this row, but for ten periods at most; `row` from 1 on.
    #[must_use]
    pub fn driven_s(&self, row: usize) -> f64 {
        (self.clock_s[row] - self.clock_s[row - 1]).clamp(0.0, PAUSE_PERIODS * self.period_s)
    }

    /// Median time between two rows of a run.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// A quantity by its name in the recording.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.get(name).map(Vec::as_slice)
    }

    /// Names of the quantities.
    pub fn column_names(&self) -> impl Iterator<Item = &str> {
        self.columns.keys().map(String::as_str)
    }

    /// Names of the columns of words.
    pub fn text_column_names(&self) -> impl Iterator<Item = &str> {
        self.words.keys().map(String::as_str)
    }

    /// Where a quantity has no value of its own (the filled value is held).
    #[must_use]
    pub fn absent_rows(&self, name: &str) -> Option<&[bool]> {
        self.absent.get(name).map(Vec::as_slice)
    }

    /// The rows of a column, of numbers or of words, whose value is not recorded but filled in, or follows from one that is.
    #[must_use]
    pub fn filled_rows(&self, name: &str) -> &[usize] {
        self.filled_rows.get(name).map_or(&[], Vec::as_slice)
    }

    /// A text column by its name.
    #[must_use]
    pub fn text_column(&self, name: &str) -> Option<&Words> {
        self.words.get(name)
    }

    /// The quantity that plays this role.
    #[must_use]
    pub fn role_values(&self, role: Role) -> Option<&[f64]> {
        self.column(self.roles.get(&role)?)
    }

    /// The name of the column that plays this role, or the word declared for it.
    #[must_use]
    pub fn role_name(&self, role: Role) -> Option<&str> {
        self.roles.get(&role).map(String::as_str)
    }

    /// The simulated output's name.
    #[must_use]
    pub fn output_name(&self) -> &str {
        &self.output
    }

    /// What kind of quantity the output is.
    #[must_use]
    pub fn output_kind(&self) -> OutputKind {
        OutputKind::from_output_name(&self.output)
    }

    /// The recorded output; meaningful only where [`Scene::usable_rows`].
    #[must_use]
    pub fn recorded_output(&self) -> &[f64] {
        &self.recorded
    }

    /// Rows with a recorded output.
    #[must_use]
    pub fn usable_rows(&self) -> &[bool] {
        &self.usable
    }

    /// Takes rows out of the comparison (spikes, dropouts, absent inputs).
    pub fn exclude_rows(&mut self, rows: impl IntoIterator<Item = usize>) {
        rows.into_iter().for_each(|row| self.usable[row] = false);
    }

    /// Stretches with the tool in the work.
    #[must_use]
    pub fn passes(&self) -> &[Range<usize>] {
        &self.passes
    }

    /// The load of the cut in the output's unit: the simulated cutting power where the model has one, else the role
    /// `load`. `None` when nothing tells how hard the cut is.
    #[must_use]
    pub fn load(&self) -> Option<&[f64]> {
        self.load.as_deref().or_else(|| self.role_values(Role::Load))
    }

    /// Sets what the model simulates as the cut.
    pub fn set_load(&mut self, load: Option<Vec<f64>>) {
        self.load = load;
    }

    /// The load of the cut as it comes to the output, with the losses that the model has it cause; without such losses
    /// [`Scene::load`]. What mis-states the cut mis-states its losses as well.
    #[must_use]
    pub fn load_at_output(&self) -> Option<&[f64]> {
        self.load_at_output.as_deref().or_else(|| self.load())
    }

    /// Sets what the model simulates as the cut and the losses that it causes.
    pub fn set_load_at_output(&mut self, load: Option<Vec<f64>>) {
        self.load_at_output = load;
    }

    /// A state that nobody records, as it was read from the whole recording while a law is fitted to it; `None` in a
    /// simulation.
    #[must_use]
    pub fn unrecorded_state(&self) -> Option<&[f64]> {
        self.unrecorded_state.as_deref()
    }

    /// Sets such a state, one number per row.
    pub fn set_unrecorded_state(&mut self, state: Option<Vec<f64>>) {
        self.unrecorded_state = state;
    }

    /// The columns of a formula over this recording, found by `find` once and kept: columns never change.
    pub fn cache_linear_law(&self, formula: &str, find: impl FnOnce() -> LinearLaw) -> LinearLaw {
        if let Some(known) = self.laws.borrow().get(formula) {
            return known.clone();
        }
        let found = find();
        self.laws.borrow_mut().insert(formula.to_owned(), found.clone());
        found
    }

    /// What the output usually has in the cut beyond what it usually has out of it; of all where it is never out. One
    /// where nothing tells.
    #[must_use]
    pub fn usual_cut(&self) -> f64 {
        *self.usual_cut.get_or_init(|| {
            let Some(engaged) = self.role_values(Role::Engaged) else { return 1.0 };
            let middle = |cutting: bool| {
                let rows = (0..self.rows).filter(|row| self.usable[*row] && (engaged[*row] > 0.5) == cutting);
                numerics::statistics::quantile(rows.map(|row| self.recorded[row].abs()), 0.5)
            };
            let usual = middle(true).unwrap_or(1.0) - middle(false).unwrap_or(0.0);
            if usual > 0.0 { usual } else { 1.0 }
        })
    }

    /// Growth of the feed drives' load since each tool's edge was new, relative, from that tool's earlier rows only;
    /// `None` when no feed drive tells.
    #[must_use]
    pub fn feed_load_growth(&self) -> Option<&[f64]> {
        self.feed_load_growth.get_or_init(|| super::tool_load::estimate_growth(self)).as_deref()
    }

    /// The output as the model simulates it, for effects of the measurement.
    #[must_use]
    pub fn simulated_output(&self) -> Option<&[f64]> {
        self.simulated.as_deref()
    }

    /// Sets the simulated output.
    pub fn set_simulated(&mut self, simulated: Option<Vec<f64>>) {
        self.simulated = simulated;
    }
}

fn compute_clock_s(recording: &Recording, runs: &[Range<usize>]) -> Vec<f64> {
    let time_s = &recording.time_s;
    if recording.pauses_known() {
        return time_s.iter().map(|time| time - time_s[0]).collect();
    }
    let period_s = compute_median_period_s(time_s, runs);
    let mut clock_s = vec![0.0; time_s.len()];
    for (index, run) in runs.iter().enumerate() {
        let start_s = if index == 0 { 0.0 } else { clock_s[run.start - 1] + period_s };
        run.clone().for_each(|row| clock_s[row] = start_s + time_s[row] - time_s[run.start]);
    }
    clock_s
}

fn compute_median_period_s(time_s: &[f64], runs: &[Range<usize>]) -> f64 {
    let steps = runs.iter().flat_map(|run| time_s[run.clone()].windows(2).map(|pair| pair[1] - pair[0]));
    numerics::statistics::median(steps.filter(|step| *step > 0.0).collect()).unwrap_or(1.0)
}
