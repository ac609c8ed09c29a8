//! What a series is, before the history has numbered it.

/// How exactly numbers are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fidelity {
    /// A decimal of at most 9 significant digits and 9 places comes back bit for bit; any other number is rounded to
    /// the series' resolution. See [`round_to_decimals`](super::round_to_decimals).
    Resolution,
    /// Every number comes back bit for bit. Interpolated values then need about 7 bytes each instead of 1 to 2.
    Exact,
}

/// Whether the values of a series are numbers or words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesKind {
    /// A quantity in its unit.
    Number,
    /// A word, as of a state or a mode.
    Text,
}

/// A series that is stored beside the channels of the table: an estimate, its standard deviation, a residual, or a
/// further column of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtraSeries {
    /// Name, ending in its unit for quantities.
    pub name: String,
    /// Unit symbol; `1` for pure numbers, empty for text.
    pub unit: String,
    /// What it is, in English.
    pub en: String,
    /// What it is, in Chinese.
    pub zh: String,
    /// Whether the values are numbers or words.
    pub kind: SeriesKind,
    /// Decimal places that are kept of numbers with a longer fraction; `None` takes the usual ones of the unit.
    pub decimals: Option<u8>,
}

impl ExtraSeries {
    /// A quantity, with the usual resolution of its unit.
    #[must_use]
    pub fn new_number(name: &str, unit: &str, en: &str, zh: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            en: en.to_owned(),
            zh: zh.to_owned(),
            kind: SeriesKind::Number,
            decimals: None,
        }
    }

    /// A series of words, which has no unit.
    #[must_use]
    pub fn new_text(name: &str, en: &str, zh: &str) -> Self {
        Self { kind: SeriesKind::Text, ..Self::new_number(name, "", en, zh) }
    }
}

/// The value of an [`ExtraSeries`] at one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ExtraValue<'a> {
    /// Finite, in the unit of the series; anything else is stored as `out_of_range`.
    Number(f64),
    /// A word, as of a state or a mode.
    Text(&'a str),
    /// No value, with the reason as one word (`not_learned`, `stale`, ...).
    Missing(&'a str),
}

impl<'a> From<Result<f64, &'a str>> for ExtraValue<'a> {
    fn from(value: Result<f64, &'a str>) -> Self {
        value.map_or_else(Self::Missing, Self::Number)
    }
}
