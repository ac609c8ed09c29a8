//! What the families see: the inputs of a recording by the part they play, and which rows are fitted.

use crate::hold_out::Unit;
use numerics::statistics::{count_to_f64, median};
use physics::drive::{compute_rate, is_axis_output};
use physics::{OutputKind, Role, Scene, mark_contact_rows};
use std::collections::BTreeSet;
use std::ops::Range;

/// Pause between two runs whose time restarts, s: it is unknown, and short enough to keep a slow state.
const UNKNOWN_PAUSE_S: f64 = 60.0;
/// Periods between two rows beyond which the noise starts anew.
const GAP_PERIODS: f64 = 6.0;

/// The inputs of a recording; columns are full length, absent inputs are `None`.
pub(super) struct RecordingInputs<'a> {
    pub(super) scene: &'a Scene,
    pub(super) rows: usize,
    pub(super) period_s: f64,
    /// Seconds on a clock that never restarts.
    pub(super) clock_s: Vec<f64>,
    /// Stretch of unbroken noise of each row.
    pub(super) block: Vec<usize>,
    /// Number of the run of each row.
    pub(super) run: Vec<usize>,
    /// Unit of hold-out of each row.
    pub(super) unit: Vec<usize>,
    /// Rows with a recorded output and every input of the model.
    pub(super) comparable: Vec<bool>,
    /// Comparable rows that are fitted.
    pub(super) fitted: Vec<bool>,
    /// Comparable rows that are held out.
    pub(super) held_out: Vec<bool>,
    pub(super) simulated: Vec<f64>,
    /// Share of the tool in the work; `None` where nothing is cut.
    pub(super) engaged: Option<Vec<f64>>,
    /// Rows in the cut; every row where nothing tells.
    pub(super) in_cut: Vec<bool>,
    /// Spindle speed without its sign, rpm.
    pub(super) speed: Option<Vec<f64>>,
    /// Velocity of the axis or drive, in the unit of its column.
    pub(super) velocity: Option<Vec<f64>>,
    pub(super) acceleration: Option<Vec<f64>>,
    pub(super) position: Option<Vec<f64>>,
    pub(super) temperature: Option<Vec<f64>>,
    pub(super) ambient: Option<Vec<f64>>,
    pub(super) coolant_temperature: Option<Vec<f64>>,
    pub(super) voltage: Option<Vec<f64>>,
    pub(super) depth: Option<Vec<f64>>,
    pub(super) width: Option<Vec<f64>>,
    pub(super) feed: Option<Vec<f64>>,
    pub(super) cutting_speed: Option<Vec<f64>>,
    /// The simulated cut in the output's unit; a stand-in of constant height in the cut where the model has none.
    pub(super) cut: Option<Vec<f64>>,
    /// Does the model, or a role, tell how hard the cut is?
    pub(super) knows_cut: bool,
    /// Edge of each row, by number; zero where nobody tells.
    pub(super) edge: Vec<usize>,
    pub(super) edges: usize,
    /// Minutes that each edge has been in the cut.
    pub(super) edge_age_min: Vec<f64>,
    /// Way through a pass, 0 to 1.
    pub(super) progress: Vec<f64>,
    /// Seconds since the pass began and until it ends; large outside.
    pub(super) since_s: Vec<f64>,
    pub(super) to_end_s: Vec<f64>,
    /// What the output measures.
    pub(super) kind: OutputKind,
    /// Does the output belong to a feed drive?
    pub(super) is_axis: bool,
}

impl<'a> RecordingInputs<'a> {
    /// The inputs of a scene whose load and simulated output are set.
    pub(super) fn new(scene: &'a Scene, units: &[Unit], held: &BTreeSet<usize>, comparable: Vec<bool>) -> Self {
        let rows = scene.rows();
        let own = |role: Role| scene.role_values(role).map(<[f64]>::to_vec);
        let column = |name: &str| scene.column(name).map(<[f64]>::to_vec);
        let mut unit = vec![0; rows];
        units.iter().enumerate().for_each(|(index, of)| unit[of.rows.clone()].fill(index));
        let mut run = vec![0; rows];
        scene.runs().iter().enumerate().for_each(|(index, of)| run[of.clone()].fill(index));
        let held_out: Vec<bool> = (0..rows).map(|row| comparable[row] && held.contains(&unit[row])).collect();
        let fitted: Vec<bool> = (0..rows).map(|row| comparable[row] && !held_out[row]).collect();
        let engaged = own(Role::Engaged);
        let clock_s = compute_clock_s(scene);
        let mut inputs = Self {
            scene,
            rows,
            period_s: scene.period_s(),
            block: number_blocks(&clock_s, scene.period_s(), &unit),
            run,
            unit,
            simulated: scene.simulated_output().map_or_else(|| vec![0.0; rows], <[f64]>::to_vec),
            in_cut: engaged.as_ref().map_or_else(|| vec![true; rows], |e| mark_contact_rows(e)),
            speed: own(Role::Speed).map(|n| n.iter().map(|n| n.abs()).collect()),
            velocity: own(Role::Velocity).or_else(|| find_axis_column(scene, "_velocity_mm_min")),
            acceleration: own(Role::Acceleration),
            position: own(Role::Position).or_else(|| find_axis_column(scene, "_position_mm")),
            temperature: own(Role::Temperature),
            ambient: own(Role::Ambient),
            coolant_temperature: column("coolant_temperature_c"),
            voltage: own(Role::Voltage),
            depth: column("depth_of_cut_mm"),
            width: column("width_of_cut_mm"),
            feed: column("feed_per_rev_mm"),
            cutting_speed: column("cutting_speed_m_min"),
            cut: scene.load().map(<[f64]>::to_vec).filter(|cut| cut.iter().any(|x| x.abs() > 0.0)),
            knows_cut: false,
            edge: vec![0; rows],
            edges: 1,
            edge_age_min: vec![0.0; rows],
            progress: vec![0.0; rows],
            since_s: vec![1e9; rows],
            to_end_s: vec![1e9; rows],
            kind: scene.output_kind(),
            is_axis: is_axis_output(scene),
            engaged,
            clock_s,
            comparable,
            fitted,
            held_out,
        };
        inputs.read_cut();
        inputs.read_edges();
        inputs.read_passes();
        inputs
    }

    fn read_cut(&mut self) {
        self.knows_cut = self.cut.is_some();
        if self.cut.is_none() && self.kind != OutputKind::Displacement {
            let usual = self.scene.usual_cut();
            self.cut = self.engaged.as_ref().map(|e| e.iter().map(|e| e * usual).collect());
        }
    }

    fn read_edges(&mut self) {
        if let Some(tools) = self.scene.text_column("tool") {
            self.edges = tools.words().len().max(1);
            self.edge = (0..self.rows).map(|row| tools.find_code(row).map_or(0, |code| code as usize)).collect();
        }
        if let Some(minutes) = self.scene.column("cutting_time_min") {
            self.edge_age_min = minutes.to_vec();
            return;
        }
        let mut ages = vec![0.0; self.edges];
        for row in 0..self.rows {
            let age = &mut ages[self.edge[row]];
            if self.in_cut[row] {
                *age += self.step_s(row) / 60.0;
            }
            self.edge_age_min[row] = *age;
        }
    }

    fn read_passes(&mut self) {
        for pass in self.scene.passes() {
            let (first, last) = (self.clock_s[pass.start], self.clock_s[pass.end - 1]);
            let whole = last - first + self.period_s;
            for row in pass.clone() {
                self.progress[row] = (self.clock_s[row] - first + 0.5 * self.period_s) / whole;
                self.since_s[row] = self.clock_s[row] - first;
                self.to_end_s[row] = last - self.clock_s[row];
            }
        }
    }

    /// Seconds since the row before, five periods at most.
    pub(super) fn step_s(&self, row: usize) -> f64 {
        let before = row.checked_sub(1).map(|before| self.clock_s[row] - self.clock_s[before]);
        before.map_or(self.period_s, |step| step.clamp(0.0, 5.0 * self.period_s))
    }

    /// One number per row.
    pub(super) fn build_column(&self, law: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..self.rows).map(law).collect()
    }

    /// One in the cut, zero outside.
    pub(super) fn cut_indicator(&self, row: usize) -> f64 {
        f64::from(u8::from(self.in_cut[row]))
    }

    /// Mean over rows that are fitted (and in the cut).
    pub(super) fn compute_mean(&self, values: &[f64], in_cut: bool) -> f64 {
        let rows: Vec<f64> = self.fitted_rows(in_cut).map(|row| values[row]).collect();
        numerics::statistics::mean(&rows)
    }

    /// Standard deviation over rows that are fitted (and in the cut).
    pub(super) fn compute_deviation(&self, values: &[f64], in_cut: bool) -> f64 {
        let middle = self.compute_mean(values, in_cut);
        let squares: Vec<f64> = self.fitted_rows(in_cut).map(|row| (values[row] - middle).powi(2)).collect();
        numerics::statistics::mean(&squares).sqrt()
    }

    /// Values at rows that are fitted (and in the cut), sorted.
    pub(super) fn sort_fitted_values(&self, values: &[f64], in_cut: bool) -> Vec<f64> {
        let mut taken: Vec<f64> = self.fitted_rows(in_cut).map(|row| values[row]).collect();
        taken.sort_by(f64::total_cmp);
        taken
    }

    /// Rows that are fitted (and in the cut).
    pub(super) fn fitted_rows(&self, in_cut: bool) -> impl Iterator<Item = usize> + '_ {
        (0..self.rows).filter(move |row| self.fitted[*row] && (!in_cut || self.in_cut[*row]))
    }

    /// Rows that are held out.
    pub(super) fn held_out_rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.rows).filter(|row| self.held_out[*row])
    }

    /// A column for each member of a group, zero elsewhere: those with fitted rows first, then those of rows held out.
    pub(super) fn build_member_columns(&self, codes: &[usize], values: &[f64]) -> (usize, Vec<Vec<f64>>) {
        let known: BTreeSet<usize> = self.fitted_rows(false).map(|row| codes[row]).collect();
        let strange: BTreeSet<usize> =
            self.held_out_rows().map(|row| codes[row]).filter(|c| !known.contains(c)).collect();
        let of = |code: &usize| self.build_column(|row| if codes[row] == *code { values[row] } else { 0.0 });
        (known.len(), known.iter().chain(&strange).map(of).collect())
    }

    /// Seconds of the whole recording.
    pub(super) fn span_s(&self) -> f64 {
        self.clock_s.last().map_or(0.0, |last| last - self.clock_s[0]).max(self.period_s)
    }

    /// Ranges of rows of each block.
    pub(super) fn list_block_ranges(&self) -> Vec<Range<usize>> {
        let mut all: Vec<Range<usize>> = Vec::new();
        for row in 0..self.rows {
            match all.last_mut() {
                Some(last) if self.block[row - 1] == self.block[row] => last.end = row + 1,
                _ => all.push(row..row + 1),
            }
        }
        all
    }

    /// Median number of fitted rows in a block that has any.
    pub(super) fn median_block_rows(&self) -> f64 {
        let rows = |block: &Range<usize>| count_to_f64(block.clone().filter(|row| self.fitted[*row]).count());
        median(self.list_block_ranges().iter().map(rows).filter(|rows| *rows > 0.0).collect()).unwrap_or(1.0)
    }

    /// `values` so many seconds ago, within the block; held before its start.
    pub(super) fn delay_values(&self, values: &[f64], delay_s: f64) -> Vec<f64> {
        let mut out = vec![0.0; self.rows];
        for block in self.list_block_ranges() {
            let mut at = block.start;
            for row in block.clone() {
                let wanted = self.clock_s[row] - delay_s;
                while at + 1 < row && self.clock_s[at + 1] <= wanted {
                    at += 1;
                }
                let (early, late) = (self.clock_s[at], self.clock_s[(at + 1).min(block.end - 1)]);
                let share = if late > early { ((wanted - early) / (late - early)).clamp(0.0, 1.0) } else { 0.0 };
                out[row] = values[at] + share * (values[(at + 1).min(block.end - 1)] - values[at]);
            }
        }
        out
    }

    /// `values` behind a first-order lag, started in each block at its first value.
    pub(super) fn smooth_values(&self, values: &[f64], tau_s: f64) -> Vec<f64> {
        let keep = (-self.period_s / tau_s).exp();
        let mut state = 0.0;
        self.build_column_in_order(|row, first| {
            state = if first { values[row] } else { keep * state + (1.0 - keep) * values[row] };
            state
        })
    }

    /// The mean over so many rows up to this one, within the block.
    pub(super) fn compute_moving_average(&self, values: &[f64], window: usize) -> Vec<f64> {
        let mut out = vec![0.0; self.rows];
        for block in self.list_block_ranges() {
            for row in block.clone() {
                let from = (row + 1).saturating_sub(window).max(block.start);
                out[row] = numerics::statistics::mean(&values[from..=row]);
            }
        }
        out
    }

    /// A slow state that is carried through pauses, in which its input is zero.
    pub(super) fn simulate_slow_state(&self, values: &[f64], tau_s: f64, start: f64) -> Vec<f64> {
        let mut state = start;
        self.build_column_in_order(|row, _| {
            let step_s = row.checked_sub(1).map_or(self.period_s, |before| self.clock_s[row] - self.clock_s[before]);
            let step_s = step_s.max(self.period_s);
            let driven_s = if step_s > GAP_PERIODS * self.period_s { self.period_s } else { step_s };
            state *= (-(step_s - driven_s) / tau_s).exp();
            let keep = (-driven_s / tau_s).exp();
            state = keep * state + (1.0 - keep) * values[row];
            state
        })
    }

    /// Rate of change per second.
    pub(super) fn differentiate_values(&self, values: &[f64]) -> Vec<f64> {
        compute_rate(self.scene, values)
    }

    /// Stretches of unbroken noise among some rows, as places among them.
    pub(super) fn list_unbroken_stretches(&self, rows: &[usize]) -> Vec<Range<usize>> {
        let mut stretches: Vec<Range<usize>> = Vec::new();
        for at in 0..rows.len() {
            let goes_on = at > 0 && self.block[rows[at]] == self.block[rows[at - 1]];
            match stretches.last_mut() {
                Some(last) if goes_on => last.end = at + 1,
                _ => stretches.push(at..at + 1),
            }
        }
        stretches
    }

    fn build_column_in_order(&self, mut law: impl FnMut(usize, bool) -> f64) -> Vec<f64> {
        (0..self.rows).map(|row| law(row, row == 0 || self.block[row - 1] != self.block[row])).collect()
    }
}

fn find_axis_column(scene: &Scene, ending: &str) -> Option<Vec<f64>> {
    let name = scene.column_names().find(|name| name.contains("axis") && name.ends_with(ending))?.to_owned();
    scene.column(&name).map(<[f64]>::to_vec)
}

fn compute_clock_s(scene: &Scene) -> Vec<f64> {
    let time_s = scene.time_s();
    let restarts = time_s.windows(2).any(|pair| pair[1] < pair[0] - 0.5 * scene.period_s());
    let mut clock_s = scene.clock_s().to_vec();
    if !restarts {
        return clock_s;
    }
    // The scene's clock stands still across an unknown pause; a slow state cools in it.
    for (number, run) in scene.runs().iter().enumerate() {
        clock_s[run.clone()].iter_mut().for_each(|clock| *clock += count_to_f64(number) * UNKNOWN_PAUSE_S);
    }
    clock_s
}

fn number_blocks(clock_s: &[f64], period_s: f64, unit: &[usize]) -> Vec<usize> {
    let mut block = vec![0; clock_s.len()];
    for row in 1..clock_s.len() {
        let breaks = unit[row] != unit[row - 1] || clock_s[row] - clock_s[row - 1] > GAP_PERIODS * period_s;
        block[row] = block[row - 1] + usize::from(breaks);
    }
    block
}
