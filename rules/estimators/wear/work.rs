//! What an edge has done in one part: its cutting energy, and what a sharp edge would have taken for the same.
//!
//! Different cuts are made comparable by a reference: the learned model of the wear where one covers the cut; otherwise typical
//! numbers (Kienzle's law for steel), of which only the ratios between cuts of one operation matter; without depth or diameter the
//! feed alone. Whatever the reference leaves over is a constant of the operation, which the filter learns.

use super::conditions::{CutConditions, cutting_speed_m_min};
use super::prior::ANY_MATERIAL_SD;
use super::record::WearRecord;
use serde::{Deserialize, Serialize};

/// Typical specific cutting force of steel for a chip of 1 mm, N/mm2, and exponent of the chip thickness (Kienzle, tables of kc1.1:
/// 1500 to 2100 and 0.20 to 0.30).
const SPECIFIC_FORCE_N_MM2: f64 = 1700.0;
const CHIP_EXPONENT: f64 = 0.25;
/// Typical force of a worn flank, N per mm of land and mm of depth. The published surface gives 642 W/mm at 120 m/min and 1 mm:
/// 321 N/mm2.
const FLANK_FORCE_N_MM2: f64 = 300.0;
/// Feed that is assumed where none is known, mm/rev.
const FEED_MM: f64 = 0.2;
/// Cutting speed that is assumed where none is known, m/s.
const SPEED_M_S: f64 = 2.5;

/// What the work is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorkReference {
    /// The learned wear model for this cut.
    Model,
    /// Typical numbers for this depth, feed and speed.
    Typical,
    /// The feed alone: depth or diameter are not known.
    Feed,
}

/// One moment of cutting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutMoment {
    /// Cutting power and its standard deviation, W.
    pub power_w: (f64, f64),
    /// Spindle speed, rpm; `None` where it is not known.
    pub speed_rpm: Option<f64>,
    /// Feed along the path, mm/min.
    pub feed_mm_min: Option<f64>,
    /// Depth of cut, mm; `None` where no recipe tells it.
    pub depth_mm: Option<f64>,
    /// Diameter of work or tool, mm.
    pub diameter_mm: Option<f64>,
    /// Width of cut, mm, and teeth: milling only.
    pub milling: Option<(f64, f64)>,
}

/// What a sharp edge takes in this moment, W, and what each millimetre of wear adds, W/mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ExpectedPower {
    pub(super) reference: WorkReference,
    pub(super) sharp_w: f64,
    pub(super) wear_w_per_mm: f64,
    /// Standard deviation of the reference, as a share of the power.
    pub(super) doubt: f64,
}

impl CutMoment {
    /// Sliding speed of the edge, m/s.
    pub(super) fn speed_m_s(&self) -> f64 {
        let speed = self.diameter_mm.zip(self.speed_rpm).and_then(|(d, n)| cutting_speed_m_min(d, n).ok());
        speed.map_or(SPEED_M_S, |metres_min| metres_min / 60.0)
    }

    /// Speed, feed per revolution and depth, where all are known.
    pub(super) fn to_conditions(self) -> Option<CutConditions> {
        let turns = self.speed_rpm?.abs();
        let speed = cutting_speed_m_min(self.diameter_mm?, turns).ok()?;
        let cut = CutConditions::from_vector([0.0, speed, self.feed_mm_min? / turns.max(1.0), self.depth_mm?]);
        cut.list_problems().is_empty().then_some(cut)
    }

    pub(super) fn estimate_expected_power(&self, model: Option<&WearRecord>) -> ExpectedPower {
        let of_model = || self.of_model(model?);
        of_model().or_else(|| self.estimate_typical_power()).unwrap_or_else(|| self.of_feed())
    }

    fn of_model(&self, record: &WearRecord) -> Option<ExpectedPower> {
        let sharp = self.to_conditions()?;
        let worn = sharp.with_wear(record.criterion_mm);
        if !record.model.find_factors_outside(&worn).is_empty() {
            return None;
        }
        let (at_none, at_worn) = (record.model.predict_power(&sharp), record.model.predict_power(&worn));
        let wear_w_per_mm = (at_worn.power_w - at_none.power_w) / record.criterion_mm;
        // A model whose power does not rise with the wear here says nothing of it.
        let stands = at_none.power_w > 0.0 && wear_w_per_mm > 0.0;
        let of_material = if record.key.work_material.is_empty() { ANY_MATERIAL_SD } else { 0.0 };
        let doubt = of_material.hypot(at_worn.observation_sd_w() / at_none.power_w);
        stands.then_some(ExpectedPower {
            reference: WorkReference::Model,
            sharp_w: at_none.power_w,
            wear_w_per_mm,
            doubt,
        })
    }

    fn estimate_typical_power(&self) -> Option<ExpectedPower> {
        let cut = self.to_conditions()?;
        let (depth, speed_m_s) = (cut.depth_of_cut_mm, cut.cutting_speed_m_min / 60.0);
        let (chip_mm, engaged) = match self.milling.filter(|(width, teeth)| *width > 0.0 && *teeth > 0.0) {
            None => (cut.feed_per_rev_mm, 1.0),
            Some((width, teeth)) => {
                let share = (width / self.diameter_mm?).clamp(1e-3, 1.0).sqrt();
                (cut.feed_per_rev_mm / teeth * share, share)
            }
        };
        let specific = SPECIFIC_FORCE_N_MM2 * chip_mm.max(1e-3).powf(-CHIP_EXPONENT);
        let sharp_w = match self.milling.filter(|(width, _)| *width > 0.0) {
            None => specific * chip_mm * depth * speed_m_s,
            Some((width, _)) => specific * depth * width * self.feed_mm_min? / 60_000.0,
        };
        let wear_w_per_mm = FLANK_FORCE_N_MM2 * depth * engaged * speed_m_s;
        (sharp_w > 0.0).then_some(ExpectedPower {
            reference: WorkReference::Typical,
            sharp_w,
            wear_w_per_mm,
            doubt: 0.0,
        })
    }

    fn of_feed(&self) -> ExpectedPower {
        let per_turn = self.feed_mm_min.zip(self.speed_rpm).map(|(feed, turns)| feed / turns.abs().max(1.0));
        let chip_mm = per_turn.unwrap_or(FEED_MM).clamp(0.01, 2.0);
        let sharp_w = self.feed_mm_min.unwrap_or(1.0).max(0.0).powf(1.0 - CHIP_EXPONENT);
        let rise = FLANK_FORCE_N_MM2 / (SPECIFIC_FORCE_N_MM2 * chip_mm.powf(1.0 - CHIP_EXPONENT));
        ExpectedPower { reference: WorkReference::Feed, sharp_w, wear_w_per_mm: rise * sharp_w, doubt: 0.0 }
    }
}

/// Whose work it is and what it is compared with.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct WorkKey {
    /// What it is compared with.
    pub reference: WorkReference,
    /// Tool, without its edge.
    pub tool: String,
    /// NC program, as the controller names it.
    pub program: String,
    /// Operation, empty where none is named.
    pub operation: String,
    /// Work material, empty where none is named.
    pub work_material: String,
}

impl WorkKey {
    /// The same tool in the same operation of the same program, whatever it is compared with?
    #[must_use]
    pub fn is_of_the_same_operation(&self, other: &Self) -> bool {
        (&self.tool, &self.program, &self.operation, &self.work_material)
            == (&other.tool, &other.program, &other.operation, &other.work_material)
    }
}

/// The work of one edge in one part, with one reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EdgeWork {
    /// Whose work it is and what it is compared with.
    pub key: WorkKey,
    /// The edge, as the controller names it.
    pub edge: String,
    /// Flank wear at which it is worn, mm.
    pub criterion_mm: f64,
    /// Time in the cut, s.
    pub seconds: f64,
    /// Length of the cut path, mm.
    pub path_mm: f64,
    /// Length of work that slid along the edge, m.
    pub slide_m: f64,
    /// Cutting energy, and how far it may be wrong because of the no-load power, J.
    pub energy_j: (f64, f64),
    /// What a sharp edge takes, J, and each millimetre of wear adds, J/mm.
    pub expected_j: (f64, f64),
    /// Sum of the reference's own doubt, J.
    pub doubt_j: f64,
}

impl EdgeWork {
    /// The work of an edge before its first cut: every sum is zero.
    #[must_use]
    pub fn new(key: WorkKey, edge: String, criterion_mm: f64) -> Self {
        Self {
            key,
            edge,
            criterion_mm,
            seconds: 0.0,
            path_mm: 0.0,
            slide_m: 0.0,
            energy_j: (0.0, 0.0),
            expected_j: (0.0, 0.0),
            doubt_j: 0.0,
        }
    }

    pub(super) fn add(&mut self, moment: &CutMoment, expected: &ExpectedPower, step_s: f64) {
        self.seconds += step_s;
        self.path_mm += moment.feed_mm_min.unwrap_or(0.0) / 60.0 * step_s;
        self.slide_m += moment.speed_m_s() * step_s;
        self.energy_j.0 += moment.power_w.0 * step_s;
        self.energy_j.1 += moment.power_w.1 * step_s;
        self.expected_j.0 += expected.sharp_w * step_s;
        self.expected_j.1 += expected.wear_w_per_mm * step_s;
        self.doubt_j += expected.doubt * expected.sharp_w * step_s;
    }

    /// Logarithm of the energy over that of a sharp edge.
    pub(super) fn log_energy_ratio(&self) -> Option<f64> {
        let ratio = self.energy_j.0 / self.expected_j.0;
        (ratio > 0.0 && ratio.is_finite()).then(|| ratio.ln())
    }

    /// Energy over that of an edge at its criterion; only where a learned model says what that is.
    pub(super) fn of_limit(&self) -> Option<f64> {
        let limit_j = self.expected_j.0 + self.criterion_mm * self.expected_j.1;
        (self.key.reference == WorkReference::Model && limit_j > 0.0).then(|| self.energy_j.0 / limit_j)
    }

    /// Rise of the power by a millimetre of wear, over that of a sharp edge.
    pub(super) fn rise_per_mm(&self) -> f64 {
        self.expected_j.1 / self.expected_j.0
    }

    /// How far the energy may be wrong, as a share.
    pub(super) fn energy_doubt(&self) -> f64 {
        self.energy_j.1 / self.energy_j.0.max(f64::MIN_POSITIVE)
    }

    /// Standard deviation of the reference, as a share.
    pub(super) fn reference_doubt(&self) -> f64 {
        self.doubt_j / self.expected_j.0.max(f64::MIN_POSITIVE)
    }
}
