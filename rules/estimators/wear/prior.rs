//! What is believed of edges, material and cuts before anything is measured, and how much they may change from part to part. Each
//! number says where it comes from. Too small a scatter makes the filter slow to believe what it measures, too great a one makes it
//! follow every lot.

/// Tools that are followed.
pub(super) const TOOLS_MAX: usize = 12;
/// Operations that are told apart.
pub(super) const GROUPS_MAX: usize = 48;
/// Less cutting in a part says nothing, s.
pub(super) const LEAST_S: f64 = 5.0;
/// Without depth, a part whose cut path differs by more was interrupted, or is another.
pub(super) const SAME_PATH: f64 = 0.1;
/// Hardness of a lot about the mean, as a share: a tolerance of +-15 HB about 200 HB is +-4 to +-8 % of specific force.
pub(super) const HARDNESS_SD: f64 = 0.04;
/// Its change from part to part within a lot.
pub(super) const HARDNESS_STEP_SD: f64 = 0.003;
/// Scatter of the same cut from part to part.
pub(super) const REPEAT_SD: f64 = 0.008;
/// Share of the uncertainty of the no-load power that changes from part to part; the rest is a constant.
pub(super) const CHANGING_SHARE: f64 = 0.3;
/// What typical numbers may be wrong for one operation, against another, and for all.
pub(super) const OPERATION_SD: f64 = 0.10;
pub(super) const LEVEL_SD: f64 = 0.5;
/// Least uncertainty of a learned model for one operation, as a share: other tool paths than the cuts it was learned from differ by
/// 4 to 7 % on the simulated lathe. Too small, the difference is taken for wear and a good edge is alarmed.
pub(super) const MODEL_SD_LEAST: f64 = 0.05;
/// The same of a model that names no work material: the specific cutting force of steels is 1400 to 2800 N/mm2, so a model of another
/// material would take a good edge in a hard part for a worn one. Its shape over the cut counts, hardly its level; the wear is
/// followed by its growth.
pub(super) const ANY_MATERIAL_SD: f64 = 0.3;
/// A new edge, mm: the land of the first minutes, which wears in quickly.
pub(super) const NEW_MM: (f64, f64) = (0.015, 0.010);
/// An edge of which nothing is known, mm: shops do not begin to record with edges at their end.
pub(super) const UNKNOWN_MM: (f64, f64) = (0.04, 0.04);
/// Rate of an edge of which nothing is known, mm per m of work: 0.3 mm in 3 to 30 km.
pub(super) const RATE: (f64, f64) = (4.0e-5, 4.0e-5);
/// Change of the rate from part to part, and of the wear beside it, as shares of rate and growth.
pub(super) const RATE_STEP: f64 = 0.15;
pub(super) const GROWTH_STEP: f64 = 0.2;
/// Growth of the rate towards the end of an edge: by so many times its own, per criterion of wear, at the criterion. The rapid
/// stage of the wear curve (ISO 3685, annex) is taken up early by it instead of late by the filter.
pub(super) const ACCELERATION: f64 = 1.0;
/// Rates of edges that were used up, remembered for each tool.
pub(super) const RATES_MAX: usize = 8;
/// An edge must have slid so far for its rate to count for the next ones, in parts.
pub(super) const PARTS_OF_A_LIFE: u32 = 4;
/// How much likelier than nothing another hardness, or a new edge that nobody announced, must make what was measured
/// (logarithms).
pub(super) const OTHER_HARDNESS: f64 = 4.0;
pub(super) const UNANNOUNCED_EDGE: f64 = 7.0;
/// The same of a constant of an operation that is far from the believed one: odds of 10 to 1, which is 2.8 standard deviations.
/// Lower: the level at which a half worn edge begins is forgotten; higher: an operation that the model does not fit passes for wear.
/// In 50 shifts of the lathe with a learned model, of seeds that took no part in choosing it, 15 of 146 alarms were false without it
/// and 1 of 130 with it.
pub(super) const OTHER_CONSTANT: f64 = 2.3;
/// A change of the material by less than this is not told, as a share.
pub(super) const MATERIAL_TOLD: f64 = 0.015;
/// An edge is changed by somebody when it has this share of its criterion: below, a fall of the power is no new edge. Higher: edges that
/// were changed early are missed; lower: softer lots pass for new edges.
pub(super) const CHANGED_SHARE: f64 = 0.4;
/// Power above the limit counts against an edge that the filter believes to have this share of its criterion. A lot of +-6 % is worth
/// 0.09 mm of 0.30 mm: by so much the filter may be wrong, and a new edge in hard material passes the limit too. Higher: wear that was
/// taken for a softer lot is told late; lower: with 0, 25 of 55 alarms of twelve shifts of a lathe with a learned model came below
/// 0.15 mm, all of them by the limit.
pub(super) const MAY_BE_WORN_SHARE: f64 = 2.0 / 3.0;
/// After so many parts above the limit, with too little wear for it, that is told.
pub(super) const LIMIT_PARTS_TOLD: u32 = 2;
/// A measurement so many standard deviations off is none.
pub(super) const OUTLIER_SD: f64 = 5.0;
/// So many in a row are an edge that has suddenly changed.
pub(super) const ODD_IN_A_ROW: u32 = 3;
/// A gap so long may bring other material, s.
pub(super) const OTHER_MATERIAL_S: f64 = 3600.0;

/// Mean and standard deviation of the rate of the next edge.
pub(super) fn pool_rates(rates: &[f64]) -> (f64, f64) {
    if rates.is_empty() {
        return RATE;
    }
    let count = rates.len() as f64;
    let mean = rates.iter().sum::<f64>() / count;
    let scatter = (rates.iter().map(|rate| (rate - mean).powi(2)).sum::<f64>() / count).sqrt();
    // One edge tells of the next within a third; more of them tell it better, never better than a sixth.
    let least = mean * if rates.len() == 1 { 0.33 } else { 0.17 };
    (mean, scatter.max(least))
}
