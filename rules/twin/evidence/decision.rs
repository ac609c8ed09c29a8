//! The one rule by which something is reported, and the table of its thresholds.

/// Every threshold of the decision. Each says where it comes from, what it costs to be wrong and which test notices.
pub(super) struct Thresholds {
    /// Greatest probability of "nothing" with which something is reported.
    pub(super) nothing_max: f64,
    /// Least paired deviation (mean over deviation of the mean, by stretches of 15 s) by which what is reported lowers the
    /// error in inner parts of the fitted rows that took no part in its sizes.
    pub(super) inner_gain: f64,
    /// Probability from which one name stands alone.
    pub(super) alone: f64,
    /// Share of a curve that a named law makes from which it gives it its name.
    pub(super) name_share: f64,
    /// What two laws together must make beyond that, and beyond one of them.
    pub(super) pair_more: f64,
    pub(super) pair_gain: f64,
    /// Nats that a law may lose in the place of another and still stand beside it.
    pub(super) class_nats: f64,
    /// Share of the energy from which a nameless part makes the whole unexplained.
    pub(super) unknown_share: f64,
    /// Share of the energy below which a name is dropped.
    pub(super) name_energy: f64,
    /// Size in deviations of the ordinary noise, and as a share of the output, below which (both) a name is dropped.
    pub(super) size_noise: f64,
    pub(super) size_output: f64,
    /// Nats behind the best within which a set is looked at.
    pub(super) looked_at: f64,
    /// Nats behind the best within which another name stands beside it.
    pub(super) beside: f64,
}

/// The table.
pub(super) const THRESHOLDS: Thresholds = Thresholds {
    nothing_max: 0.12,
    inner_gain: 0.8,
    alone: 0.85,
    name_share: 0.8,
    pair_more: 0.05,
    pair_gain: 0.12,
    class_nats: 2.0,
    unknown_share: 0.35,
    name_energy: 0.02,
    size_noise: 0.15,
    size_output: 0.005,
    looked_at: 6.0,
    beside: 3.5,
};
