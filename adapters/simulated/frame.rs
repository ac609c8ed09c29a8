//! The numbers of the two built-in machines. They are invented, of the size of a small lathe (7.5 kW) and a small
//! machining centre (11 kW).

use crate::address::SimulatedMachine;

/// Losses of the spindle in one gear stage, `P = P0 + M w + k w^1.6 visc(T) + q w^2.8`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage {
    /// Magnetisation and iron, W.
    pub(super) field_w: f64,
    /// Dry friction of bearings, belt and gears, N m.
    pub(super) dry_nm: f64,
    /// Viscous loss at 40 °C, W per (rad/s)^1.6.
    pub(super) viscous: f64,
    /// Windage, W per (rad/s)^2.8.
    pub(super) windage: f64,
    /// Loss of the transmission per cutting power.
    pub(super) transmission: f64,
    /// Loss in the windings, W per (N m)^2 of cutting torque.
    pub(super) copper: f64,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct MachineSnapshot {
    pub(super) lathe: bool,
    pub(super) stages: &'static [Stage],
    /// Inertia of spindle, chuck and motor at the spindle, kg m2.
    pub(super) inertia_kg_m2: f64,
    /// The drive accelerates with no more than this, W.
    pub(super) acceleration_limit_w: f64,
    pub(super) rated_w: f64,
    pub(super) rapid_mm_min: f64,
    /// Control and cabinet, W.
    pub(super) control_w: f64,
    /// Drives ready, W.
    pub(super) drives_w: f64,
    pub(super) hydraulics_w: f64,
    pub(super) coolant_w: f64,
    /// Magnetising current, A.
    pub(super) magnetising_a: f64,
    /// Specific cutting force for 1 mm of chip, N/mm2, and its exponent (Kienzle).
    pub(super) kc11_n_mm2: f64,
    pub(super) chip_exponent: f64,
    /// Force per mm of wear land and mm of depth, N.
    pub(super) wear_n_mm2: f64,
}

static LATHE_STAGES: [Stage; 2] = [
    Stage { field_w: 60.0, dry_nm: 1.6, viscous: 0.205, windage: 2.5e-4, transmission: 0.11, copper: 0.86 },
    Stage { field_w: 60.0, dry_nm: 1.1, viscous: 0.155, windage: 1.1e-4, transmission: 0.09, copper: 1.9 },
];

static MILL_STAGES: [Stage; 1] =
    [Stage { field_w: 90.0, dry_nm: 0.35, viscous: 0.0085, windage: 2.2e-6, transmission: 0.06, copper: 1.4 }];

static LATHE: MachineSnapshot = MachineSnapshot {
    lathe: true,
    stages: &LATHE_STAGES,
    inertia_kg_m2: 0.22,
    acceleration_limit_w: 9000.0,
    rated_w: 7500.0,
    rapid_mm_min: 12000.0,
    control_w: 260.0,
    drives_w: 140.0,
    hydraulics_w: 430.0,
    coolant_w: 370.0,
    magnetising_a: 4.2,
    kc11_n_mm2: 980.0,
    chip_exponent: 0.25,
    wear_n_mm2: 190.0,
};

static MILL: MachineSnapshot = MachineSnapshot {
    lathe: false,
    stages: &MILL_STAGES,
    inertia_kg_m2: 0.018,
    acceleration_limit_w: 14000.0,
    rated_w: 11000.0,
    rapid_mm_min: 30000.0,
    control_w: 340.0,
    drives_w: 220.0,
    hydraulics_w: 250.0,
    coolant_w: 750.0,
    magnetising_a: 6.5,
    kc11_n_mm2: 1450.0,
    chip_exponent: 0.25,
    wear_n_mm2: 120.0,
};

impl MachineSnapshot {
    pub(super) fn from_machine(machine: SimulatedMachine) -> &'static Self {
        match machine {
            SimulatedMachine::Lathe => &LATHE,
            SimulatedMachine::Mill => &MILL,
        }
    }

    /// The losses of a stage, counted from 1.
    pub(super) fn stage(&self, stage: u8) -> &Stage {
        let index = usize::from(stage).saturating_sub(1).min(self.stages.len() - 1);
        &self.stages[index]
    }
}
