//! What a cut takes, and what it does to the edge. Kienzle's law with a wear term; the simulator's own form.

use super::frame::{MachineSnapshot, Stage};
use super::program::Cut;
use super::settings::CutLevel;

/// A cut at one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Load {
    pub(super) cutting_power_w: f64,
    pub(super) load_loss_w: f64,
    pub(super) force_n: f64,
}

/// Circumstances of a cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct Circumstances {
    /// Angular speed, rad/s, positive.
    pub(super) speed_rad_s: f64,
    /// Actual feed along the path.
    pub(super) feed_mm_min: f64,
    /// Diameter of the work or the tool at the edge.
    pub(super) diameter_mm: f64,
    pub(super) engaged: f64,
    pub(super) wear_mm: f64,
    /// Material against the plan, and the noise of the process.
    pub(super) hardness: f64,
    pub(super) no_load_w: f64,
    /// One insert is missing.
    pub(super) insert_lost: bool,
}

/// Power, loss and force of a cut.
pub(super) fn compute_load(
    frame: &MachineSnapshot,
    stage: &Stage,
    cut: &Cut,
    now: &Circumstances,
    level: CutLevel,
) -> Load {
    if now.engaged <= 0.0 || now.feed_mm_min <= 0.0 || now.speed_rad_s < 0.5 {
        return Load::default();
    }
    let speed_m_s = now.speed_rad_s * now.diameter_mm / 2000.0;
    let planned_n = if frame.lathe { turning_force(frame, cut, now) } else { milling_force(frame, cut, now) };
    let force_n = planned_n * now.engaged * now.hardness;
    let power_w = force_n * speed_m_s;
    match level {
        CutLevel::Planned(factor) => scale_load(stage, force_n, power_w, factor, now.speed_rad_s),
        CutLevel::OfNoLoad(share) => {
            let wanted_w = share * now.no_load_w * now.engaged * now.hardness;
            let power_w = without_loss(stage, wanted_w, now.speed_rad_s);
            scale_load(stage, power_w / speed_m_s.max(1e-3), power_w, 1.0, now.speed_rad_s)
        }
    }
}

fn scale_load(stage: &Stage, force_n: f64, power_w: f64, factor: f64, speed_rad_s: f64) -> Load {
    let cutting_power_w = power_w * factor;
    let load_loss_w = compute_loss(stage, cutting_power_w, speed_rad_s);
    Load { cutting_power_w, load_loss_w, force_n: force_n * factor }
}

/// Transmission in proportion to the power, windings with the square of the torque.
fn compute_loss(stage: &Stage, power_w: f64, speed_rad_s: f64) -> f64 {
    stage.transmission * power_w + stage.copper * (power_w / speed_rad_s).powi(2)
}

/// The cutting power whose sum with its own loss is `sum_w`.
fn without_loss(stage: &Stage, sum_w: f64, speed_rad_s: f64) -> f64 {
    let (a, b) = (stage.copper / speed_rad_s.powi(2), 1.0 + stage.transmission);
    2.0 * sum_w / (b + (b * b + 4.0 * a * sum_w).sqrt())
}

fn turning_force(frame: &MachineSnapshot, cut: &Cut, now: &Circumstances) -> f64 {
    // The only edge is gone: nothing meets the work.
    if now.insert_lost {
        return 0.0;
    }
    let feed_mm = now.feed_mm_min / (now.speed_rad_s * 60.0 / std::f64::consts::TAU);
    let speed_m_min = (now.speed_rad_s * now.diameter_mm * 0.03).max(10.0);
    let chip_n = frame.kc11_n_mm2 * feed_mm.powf(1.0 - frame.chip_exponent) * (speed_m_min / 150.0).powf(-0.08);
    (chip_n + 22.0 + frame.wear_n_mm2 * now.wear_mm) * cut.depth_mm
}

/// Mean tangential force from the removal rate; chip thickness averaged over the arc.
fn milling_force(frame: &MachineSnapshot, cut: &Cut, now: &Circumstances) -> f64 {
    let turns_min = now.speed_rad_s * 60.0 / std::f64::consts::TAU;
    let share = (cut.width_mm / now.diameter_mm).clamp(1e-3, 1.0);
    let chip_mm = (now.feed_mm_min / (turns_min * cut.teeth.max(1.0)) * share.sqrt()).max(1e-3);
    let kc = frame.kc11_n_mm2 * chip_mm.powf(-frame.chip_exponent);
    let power_w = kc * cut.depth_mm * cut.width_mm * now.feed_mm_min / 60_000.0;
    let speed_m_s = now.speed_rad_s * now.diameter_mm / 2000.0;
    let (chips, edges) = count_teeth_left(cut.teeth, frame.chip_exponent, now.insert_lost);
    chips * power_w / speed_m_s + edges * frame.wear_n_mm2 * now.wear_mm * cut.depth_mm * share.sqrt()
}

/// Force of the chips, and of the edges, over those of all teeth. The tooth behind a missing one takes the chip of both, which is
/// twice as thick, with less force for its thickness; the missing edge rubs no more.
fn count_teeth_left(teeth: f64, chip_exponent: f64, insert_lost: bool) -> (f64, f64) {
    if !insert_lost || teeth < 2.0 {
        return (1.0, 1.0);
    }
    ((teeth - 2.0 + 2_f64.powf(1.0 - chip_exponent)) / teeth, (teeth - 1.0) / teeth)
}

/// Growth of the wear land, mm/s: quick at first, then steady, faster again towards the end of the edge's life.
pub(super) fn wear_rate_mm_s(lathe: bool, now: &Circumstances) -> f64 {
    if now.engaged < 0.5 || now.feed_mm_min <= 0.0 {
        return 0.0;
    }
    let speed_m_min = now.speed_rad_s * now.diameter_mm * 0.03;
    let steady = if lathe { 3.4e-5 } else { 2.4e-5 };
    let young = 1.0 + 6.0 * (-now.wear_mm / 0.02).exp();
    let old = 1.0 + (now.wear_mm / 0.26).powi(4);
    steady * (speed_m_min / 150.0).max(0.0).powf(1.6) * young * old * now.hardness
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::address::SimulatedMachine;

    /// The published cut: diameter 79 mm, 800 rpm, 0.153 mm/rev, 1 mm deep takes about 790 W.
    #[test]
    fn a_known_cut_takes_about_the_known_power() {
        let frame = MachineSnapshot::from_machine(SimulatedMachine::Lathe);
        let cut = Cut { depth_mm: 1.0, ..Cut::default() };
        let now = Circumstances {
            speed_rad_s: 800.0 * std::f64::consts::TAU / 60.0,
            feed_mm_min: 0.153 * 800.0,
            diameter_mm: 79.0,
            engaged: 1.0,
            wear_mm: 0.0,
            hardness: 1.0,
            no_load_w: 500.0,
            insert_lost: false,
        };
        let load_planned = compute_load(frame, frame.stage(1), &cut, &now, CutLevel::Planned(1.0));
        assert!((700.0..950.0).contains(&load_planned.cutting_power_w), "{load_planned:?}");
        let light = compute_load(frame, frame.stage(1), &cut, &now, CutLevel::OfNoLoad(0.05));
        assert!((light.cutting_power_w + light.load_loss_w - 25.0).abs() < 1e-6, "{light:?}");
        let broken = Circumstances { insert_lost: true, ..now };
        let without = compute_load(frame, frame.stage(1), &cut, &broken, CutLevel::Planned(1.0));
        assert_eq!((without.cutting_power_w, without.force_n), (0.0, 0.0), "the only edge of a turning tool");
    }

    /// A face mill of five teeth with new edges: the removal rate stays, one chip is twice as thick: 6.4 % less.
    #[test]
    fn a_missing_insert_takes_less_than_its_share() {
        let frame = MachineSnapshot::from_machine(SimulatedMachine::Mill);
        let cut = Cut { depth_mm: 1.5, width_mm: 48.0, teeth: 5.0, ..Cut::default() };
        let now = Circumstances {
            speed_rad_s: 1200.0 * std::f64::consts::TAU / 60.0,
            feed_mm_min: 720.0,
            diameter_mm: 63.0,
            engaged: 1.0,
            wear_mm: 0.0,
            hardness: 1.0,
            no_load_w: 500.0,
            insert_lost: false,
        };
        let power_w = |insert_lost: bool| {
            let now = Circumstances { insert_lost, ..now };
            compute_load(frame, frame.stage(1), &cut, &now, CutLevel::Planned(1.0)).cutting_power_w
        };
        let fall = 1.0 - power_w(true) / power_w(false);
        assert!((fall - 0.0636).abs() < 0.0002, "{fall}");
    }
}
