//! Words that stand beside estimates: where a number comes from, and whether cutting can be seen.

use serde::{Deserialize, Serialize};

/// Where the no-load power in force comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoLoadOrigin {
    /// There is no no-load power at this tick.
    None,
    /// Measured, or configured, at this very speed.
    Measured,
    /// Quadratic, or with two speeds linear, interpolation between neighbouring speeds.
    Interpolated,
    /// The same beyond the slowest or fastest known speed; see the noise gain.
    Extrapolated,
    /// Not learned: the level right after a spindle start with the axes already moving. A spindle starts in the air,
    /// but this is only an upper bound, so cutting power is a lower one.
    UpperBound,
}

impl NoLoadOrigin {
    /// Every origin, for tables of words.
    pub const ALL: [Self; 5] = [Self::None, Self::Measured, Self::Interpolated, Self::Extrapolated, Self::UpperBound];

    /// The word used in SQL, scripts, JSON and CSV.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Measured => "measured",
            Self::Interpolated => "interpolated",
            Self::Extrapolated => "extrapolated",
            Self::UpperBound => "upper_bound",
        }
    }
}

/// Can cutting be seen in the spindle power at this moment?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Visibility {
    /// Nothing could be cutting: no feed, rapid traverse, or the spindle is not steady.
    NotAsked,
    /// Feed is on and the power stands out: cutting is seen.
    Visible,
    /// Feed is on and the power does not stand out: either no cut, or one below the least visible cutting power.
    BelowVisibility,
    /// Feed is on and there is no no-load power to compare with.
    NoReference,
}

impl Visibility {
    /// Every answer, for tables of words.
    pub const ALL: [Self; 4] = [Self::NotAsked, Self::Visible, Self::BelowVisibility, Self::NoReference];

    /// The word used in SQL, scripts, JSON and CSV.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NotAsked => "not_asked",
            Self::Visible => "visible",
            Self::BelowVisibility => "below_visibility",
            Self::NoReference => "no_reference",
        }
    }
}

/// Where the load loss in force comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoadLossOrigin {
    /// Nobody has measured it on this drive: the interval is that of drives of this kind.
    NotCommissioned,
    /// Measured on this drive, with its uncertainty.
    Commissioned,
}

impl LoadLossOrigin {
    /// Both origins, for tables of words.
    pub const ALL: [Self; 2] = [Self::NotCommissioned, Self::Commissioned];

    /// The word used in scripts and JSON.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NotCommissioned => "not_commissioned",
            Self::Commissioned => "commissioned",
        }
    }
}
