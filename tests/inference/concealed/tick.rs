//! The machine at one instant of the hidden world, ten times a second.

/// Seconds between two instants of the hidden world.
pub(crate) const STEP_S: f64 = 0.1;

/// Everything about the machine at one instant; most of it is never recorded.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tick {
    /// Seconds since the first instant, pauses included.
    pub(crate) t_s: f64,
    /// Seconds of standstill that were not recorded just before this instant; 0 inside a part.
    pub(crate) gap_s: f64,
    pub(crate) run: usize,
    /// Counts passes over the whole recording.
    pub(crate) pass: usize,
    /// Index into the tool labels of the plan: one per cutting edge.
    pub(crate) tool: usize,
    pub(crate) lot: usize,
    /// Index into the operation labels of the plan.
    pub(crate) operation: usize,
    pub(crate) speed_rpm: f64,
    pub(crate) acceleration_rpm_s: f64,
    /// Feed per revolution that the program and the override ask for.
    pub(crate) commanded_mm_rev: f64,
    /// Feed per revolution that the axis really makes.
    pub(crate) feed_mm_rev: f64,
    pub(crate) programmed_mm_rev: f64,
    pub(crate) depth_mm: f64,
    pub(crate) width_mm: f64,
    pub(crate) diameter_mm: f64,
    pub(crate) teeth: f64,
    pub(crate) engaged: bool,
    /// Seconds since the cut began and until it ends; 0 outside.
    pub(crate) since_entry_s: f64,
    pub(crate) until_exit_s: f64,
    pub(crate) position_mm: f64,
    /// Share of the pass that lies behind, 0..1.
    pub(crate) progress: f64,
    /// Signed velocity of the feed axis.
    pub(crate) velocity_mm_min: f64,
    pub(crate) coolant: bool,
    pub(crate) door_open: bool,
    pub(crate) supply_v: f64,
    pub(crate) ambient_c: f64,
    pub(crate) gear_stage: u8,
}

impl Tick {
    /// Cutting speed in m/min.
    pub(crate) fn cutting_speed_m_min(&self) -> f64 {
        std::f64::consts::PI * self.diameter_mm * self.speed_rpm / 1000.0
    }

    /// Angular speed in rad/s.
    pub(crate) fn omega(&self) -> f64 {
        self.speed_rpm * std::f64::consts::TAU / 60.0
    }

    /// Angular acceleration in rad/s2.
    pub(crate) fn alpha(&self) -> f64 {
        self.acceleration_rpm_s * std::f64::consts::TAU / 60.0
    }

    /// Seconds from the previous instant to this one, the pause included.
    pub(crate) fn elapsed_s(&self) -> f64 {
        STEP_S + self.gap_s
    }
}
