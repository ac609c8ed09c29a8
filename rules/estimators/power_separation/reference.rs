//! What tells the power at the cutting edge besides the spindle power: torque, force, or a known removal.
//!
//! A sensor may count against the drive, so its sign is settled once per recording and direction of rotation, from the mean of
//! all cuts less that of idling. Never row by row: the magnitude of noise about zero has a mean of its own.

use super::rows::MachineRow;
use crate::State;
use crate::regression::{Plausible, Refusal, RefusalKind};
use recording::Recording;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// What to look at.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceChoice {
    /// Column of the cutting torque at the spindle, N·m.
    pub torque_column: String,
    /// Cutting energy of the material, J/mm3, and its standard deviation, where known: cuts of known removal then serve.
    pub specific_energy_j_mm3: Option<(f64, f64)>,
}

impl Default for ReferenceChoice {
    fn default() -> Self {
        Self { torque_column: "torque_nm".to_owned(), specific_energy_j_mm3: None }
    }
}

/// What tells the power at the edge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PowerReference {
    /// Torque times angular speed.
    Torque,
    /// Main cutting force times cutting speed.
    Force,
    /// Removal rate times the material's cutting energy: as good as that energy is known.
    Removal {
        /// Relative standard deviation of the cutting energy.
        relative_sd: f64,
    },
}

/// The reference of every row, W.
pub(super) struct Referenced {
    pub(super) reference: PowerReference,
    pub(super) power_w: Vec<Option<f64>>,
}

/// The best reference that the recording holds.
///
/// # Errors
/// No reference, or a unit that was mistaken.
pub(super) fn select_reference(
    recording: &Recording,
    rows: &[MachineRow],
    choice: &ReferenceChoice,
) -> Result<Referenced, Refusal> {
    let column = |name: &str| recording.find_numbers(name);
    let per_row = |of: &dyn Fn(&MachineRow) -> Option<f64>| rows.iter().map(of).collect::<Vec<Option<f64>>>();
    if let Some(torque) = column(&choice.torque_column) {
        Plausible::TORQUE_NM
            .check_values(filter_cutting_values(rows, |row| torque.get(row.row)))
            .map_err(|it| it.with_place(&choice.torque_column))?;
        let power = |row: &MachineRow| Some(torque.get(row.row)? * row.speed_rpm? * TAU / 60.0);
        return Ok(Referenced { reference: PowerReference::Torque, power_w: orient_powers(rows, per_row(&power)) });
    }
    if let (Some(force), Some(diameter)) = (column("cutting_force_n"), column("diameter_mm")) {
        Plausible::CUTTING_FORCE_N
            .check_values(filter_cutting_values(rows, |row| force.get(row.row)))
            .map_err(|it| it.with_place("cutting_force_n"))?;
        let power =
            |row: &MachineRow| Some(force.get(row.row)? * PI * diameter.get(row.row)? / 1000.0 * row.speed_rpm? / 60.0);
        return Ok(Referenced { reference: PowerReference::Force, power_w: orient_powers(rows, per_row(&power)) });
    }
    let removal = recording::with_derived(recording.clone());
    match (removal.find_numbers("removal_rate_cm3_min"), choice.specific_energy_j_mm3) {
        (Some(removal), Some((energy_j_mm3, sd))) if energy_j_mm3 > 0.0 && sd >= 0.0 => {
            let power = |row: &MachineRow| Some(removal.get(row.row)? * 1000.0 / 60.0 * energy_j_mm3);
            let reference = PowerReference::Removal { relative_sd: sd / energy_j_mm3 };
            Ok(Referenced { reference, power_w: per_row(&power) })
        }
        (Some(_), _) => Err(refuse_power_alone("the removal rate is known, the cutting energy of the material is not")),
        (None, _) => Err(refuse_power_alone("there is no torque, no force and no removal rate")),
    }
}

/// The same powers with the sign that makes cuts positive, settled for each direction of rotation.
fn orient_powers(rows: &[MachineRow], mut power_w: Vec<Option<f64>>) -> Vec<Option<f64>> {
    for backward in [false, true] {
        let mean = |state: State| {
            let own = rows.iter().zip(&power_w).filter(|(row, _)| row.backward == backward && row.state == state);
            let (sum, n) =
                own.filter_map(|(_, power)| *power).fold((0.0, 0.0), |(sum, n), power| (sum + power, n + 1.0));
            (n > 0.0).then(|| sum / n)
        };
        if mean(State::Cutting).is_some_and(|cutting| cutting < mean(State::Idle).unwrap_or(0.0)) {
            let own = rows.iter().zip(&mut power_w).filter(|(row, _)| row.backward == backward);
            own.for_each(|(_, power)| *power = power.map(|power| -power));
        }
    }
    power_w
}

fn filter_cutting_values<'a>(
    rows: &'a [MachineRow],
    of: impl Fn(&MachineRow) -> Option<f64> + 'a,
) -> impl Iterator<Item = f64> + 'a {
    rows.iter().filter(|row| row.state == State::Cutting).filter_map(of)
}

fn refuse_power_alone(why: &str) -> Refusal {
    let what = format!(
        "load loss cannot be told from power alone ({why}): with cutting power k Q the power above no-load is \
         (1 + a0) k Q + a1 k^2 Q^2, and every k gives the same curve with other a0 and a1"
    );
    let next =
        "record torque_nm, or cutting_force_n with diameter_mm, or give the cutting energy of the material in J/mm3";
    Refusal::new(RefusalKind::NotIdentifiable, what, next)
}
