//! Names of axes as an address writes them.

/// An axis that has channels of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AxisName {
    /// Its name on the control: a letter, or a letter and a number.
    pub name: String,
    /// Does it turn? Its positions are degrees then.
    pub rotary: bool,
    /// Path from 1; `None` is the one that is written to.
    pub path: Option<u8>,
}

impl AxisName {
    /// `X1`, `B`, `W:deg`, or `Z2@2` of path 2. A, B and C turn unless `:mm` says otherwise, by custom.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let (text, path) = match text.split_once('@') {
            Some((text, path)) => (text, Some(path.parse().ok().filter(|path| (1..=10).contains(path))?)),
            None => (text, None),
        };
        let (name, unit) = text.split_once(':').map_or((text, None), |(name, unit)| (name, Some(unit)));
        let usable = (1..=3).contains(&name.len())
            && name.starts_with(|letter: char| letter.is_ascii_alphabetic())
            && name.chars().all(|letter| letter.is_ascii_alphanumeric());
        let name = name.to_ascii_uppercase();
        let rotary = match unit {
            None => name.starts_with(['A', 'B', 'C']),
            Some("deg") => true,
            Some("mm") => false,
            Some(_) => return None,
        };
        usable.then_some(Self { name, rotary, path })
    }
}
