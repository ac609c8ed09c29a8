//! The machine at one instant: what its control shows, what is electrically true, and what only a scorer may know.

use adapter_core::clock::TimeNs;

/// What the machine truly does. Compare an estimate with it; never feed it to one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TrueState {
    /// The main switch is off.
    Off,
    /// The control is on, the spindle stands.
    Standby,
    /// The spindle runs up from rest, until speed and power have settled.
    SpindleStart,
    /// The spindle turns at its speed, nothing is cut.
    Idle,
    /// Material is being removed.
    Cutting,
    /// The spindle goes to another speed or to rest.
    SpeedChange,
    /// Axes traverse rapidly while the spindle turns.
    Rapid,
}

impl TrueState {
    /// Every state, from off to rapid traverse.
    pub const ALL: [Self; 7] =
        [Self::Off, Self::Standby, Self::SpindleStart, Self::Idle, Self::Cutting, Self::SpeedChange, Self::Rapid];

    /// The word for tables and JSON.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Standby => "standby",
            Self::SpindleStart => "spindle_start",
            Self::Idle => "idle",
            Self::Cutting => "cutting",
            Self::SpeedChange => "speed_change",
            Self::Rapid => "rapid",
        }
    }
}

/// What the control knows and shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Panel {
    /// Has the control finished starting?
    pub booted: bool,
    /// Are the drives on and ready?
    pub drives_on: bool,
    /// A word of [`words::mode`](adapter_core::words::mode).
    pub mode: &'static str,
    /// A word of [`words::execution`](adapter_core::words::execution).
    pub execution: &'static str,
    /// Number after the O.
    pub program: u16,
    /// Number after the N.
    pub block: u16,
    /// As the process plan names it.
    pub operation: &'static str,
    /// Number after the T.
    pub tool: u8,
    /// How many edges of this tool have been used up.
    pub edge: u16,
    /// Parts since the first start.
    pub part_count: u32,
    /// Text of the alarm, empty without one.
    pub alarm: &'static str,
    /// Commanded speed with the sign of the direction.
    pub spindle_programmed_rpm: f64,
    /// Actual speed with the sign of the direction.
    pub spindle_speed_rpm: f64,
    /// Feed that the program commands.
    pub feed_programmed_mm_min: f64,
    /// Actual feed, also in rapid.
    pub feed_mm_min: f64,
    /// Feed override in force, 0 to 254 %.
    pub feed_override_pct: u8,
    /// The operator's dial, 0 to 254 %.
    pub dial_pct: u8,
    /// Do the axes traverse rapidly?
    pub rapid: bool,
    /// The override is without effect: threading and tapping.
    pub override_locked: bool,
    /// Gear stage of the spindle.
    pub gear_stage: u8,
    /// Does the coolant pump run?
    pub coolant_on: bool,
    /// Does the hydraulic pump run?
    pub hydraulics_on: bool,
    /// X (a diameter on the lathe), Y, Z.
    pub position_mm: [f64; 3],
    /// Velocities of X, Y and Z, signed.
    pub velocity_mm_min: [f64; 3],
    /// Planned depth of cut of the block, 0 outside cutting blocks.
    pub depth_of_cut_mm: f64,
    /// Planned width of cut of the block, 0 in turning.
    pub width_of_cut_mm: f64,
    /// Diameter of the work (lathe) or of the tool (mill).
    pub diameter_mm: f64,
    /// Teeth of the tool; 0 in turning.
    pub teeth: f64,
}

/// What only a scorer may know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// The instant of these values.
    pub at_ns: TimeNs,
    /// What the machine truly does.
    pub state: TrueState,
    /// True speed with the sign of the direction.
    pub spindle_speed_rpm: f64,
    /// Power into the spindle drive.
    pub spindle_power_w: f64,
    /// Power into the machine.
    pub total_power_w: f64,
    /// What the spindle would take at this speed, stage and temperature without cutting and settled; 0 at rest.
    pub no_load_power_w: f64,
    /// Power at the cutting edge.
    pub cutting_power_w: f64,
    /// Loss that exists only because of the load.
    pub load_loss_w: f64,
    /// Power that accelerates masses, negative when braking, and the excess of a start.
    pub transient_power_w: f64,
    /// Share of the edge that is in the work, 0 to 1.
    pub engaged: f64,
    /// Flank wear of the tool in use.
    pub flank_wear_mm: f64,
    /// Cutting force at the edge.
    pub cutting_force_n: f64,
    /// Displacement of the tool against the work.
    pub thermal_error_um: f64,
    /// Hardness of the material against the plan.
    pub hardness: f64,
}

/// What can be measured with electrical and temperature sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Electric {
    /// Voltage of the supply from phase to phase.
    pub supply_voltage_v: f64,
    /// Spindle motor current, rms.
    pub spindle_current_a: f64,
    /// Temperature of the spindle bearing.
    pub bearing_temperature_c: f64,
    /// Temperature of the spindle motor.
    pub motor_temperature_c: f64,
    /// Temperature of the air around the machine.
    pub ambient_temperature_c: f64,
    /// Load display of the drive, percent of rated power.
    pub spindle_load_pct: f64,
}

/// Running integrals since the start: their differences are exact averages over any window.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Integrals {
    pub(super) spindle_j: f64,
    pub(super) total_j: f64,
    pub(super) current_squared_a2s: f64,
    /// Phase of the mains, rad.
    pub(super) mains_rad: f64,
}

/// The machine at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// What the control shows.
    pub panel: Panel,
    /// What sensors can measure.
    pub electric: Electric,
    /// What only a scorer may know.
    pub truth: Truth,
    pub(super) integrals: Integrals,
}
