//! Channels that a configuration adds to the table: further axes and spindles by their own names, and whatever the user
//! wants read. They are declared while the configuration is read and have a name, a unit and a range like all others.
//!
//! A declared channel stays declared as long as the process runs: what is stored and what scripts were checked against must
//! not lose its meaning. Declaring the same channel again changes nothing.

use super::{CHANNELS, Channel, ChannelId, Form, Kind};
use std::sync::{Mutex, OnceLock, PoisonError};
use thiserror::Error;

/// Most channels that can be declared. Each one takes its place in every sample.
pub const DECLARED_MAX: usize = 256;

/// Longest name of a declared channel.
const NAME_MAX: usize = 60;

static DECLARED: [OnceLock<Channel>; DECLARED_MAX] = [const { OnceLock::new() }; DECLARED_MAX];
/// Guards the order in which places are taken.
static TAKING: Mutex<()> = Mutex::new(());

/// A channel to be added.
#[derive(Debug, Clone, PartialEq)]
pub struct NewChannel {
    /// Name; lower-case letters, digits and underscores, the unit last.
    pub name: String,
    /// Unit symbol; `1` for pure numbers, empty for text.
    pub unit: String,
    /// Least and greatest value that is possible, in the unit.
    pub range: (f64, f64),
    /// Continuous, held or text.
    pub kind: Kind,
    /// What it is, in English.
    pub en: String,
    /// What it is, in Chinese.
    pub zh: String,
}

/// Why a channel cannot be added.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum DeclareError {
    /// The name has other characters.
    #[error(
        "a channel is named with lower-case letters, digits and underscores, at most {NAME_MAX} of them, and begins with a letter"
    )]
    Name,
    /// The table has a channel of this name.
    #[error("there is a channel of this name already")]
    Known,
    /// It was declared with another unit, kind or range.
    #[error("a channel of this name was declared with another unit, kind or range; start the gateway again")]
    Differs,
    /// There is no place left.
    #[error("at most {DECLARED_MAX} channels can be added")]
    Full,
}

/// How many channels have been declared.
pub(super) fn count_declared() -> usize {
    DECLARED.iter().take_while(|place| place.get().is_some()).count()
}

/// The declared channel at this place behind the table.
pub(super) fn find_by_index(index: usize) -> Option<&'static Channel> {
    DECLARED.get(index)?.get()
}

/// The place of the declared channel of this name.
pub(super) fn find_by_name(name: &str) -> Option<usize> {
    let known = |place: &OnceLock<Channel>| place.get().map(|channel| channel.name == name);
    DECLARED.iter().map_while(known).position(|is_it| is_it)
}

fn is_name(name: &str) -> bool {
    let mut letters = name.bytes();
    letters.next().is_some_and(|first| first.is_ascii_lowercase())
        && name.len() <= NAME_MAX
        && letters.all(|letter| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == b'_')
}

/// Adds a channel to the table, or finds it where it was declared before.
///
/// # Errors
/// See [`DeclareError`].
pub fn declare_channel(new: &NewChannel) -> Result<ChannelId, DeclareError> {
    if !is_name(&new.name) {
        return Err(DeclareError::Name);
    }
    if CHANNELS.iter().any(|known| known.name == new.name) {
        return Err(DeclareError::Known);
    }
    let _guard = TAKING.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(place) = find_by_name(&new.name) {
        let same = find_by_index(place)
            .is_some_and(|known| known.unit == new.unit && known.kind == new.kind && known.range == new.range);
        return if same {
            ChannelId::from_index(CHANNELS.len() + place).ok_or(DeclareError::Full)
        } else {
            Err(DeclareError::Differs)
        };
    }
    let place = count_declared();
    let text = |text: &str| -> &'static str { String::leak(text.to_owned()) };
    let (name, unit, en, zh) = (text(&new.name), text(&new.unit), text(&new.en), text(&new.zh));
    let channel = Channel { name, unit, range: new.range, kind: new.kind, form: Form::Real, en, zh };
    DECLARED.get(place).ok_or(DeclareError::Full)?.get_or_init(|| channel);
    ChannelId::from_index(CHANNELS.len() + place).ok_or(DeclareError::Full)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn new(name: &str) -> NewChannel {
        let (unit, en, zh) = ("bar".to_owned(), "Pressure".to_owned(), "压力".to_owned());
        NewChannel { name: name.to_owned(), unit, range: (0.0, 400.0), kind: Kind::Held, en, zh }
    }

    #[test]
    fn a_declared_channel_is_like_every_other() {
        let id = declare_channel(&new("test_clamping_pressure_bar")).expect("a place");
        assert_eq!(ChannelId::from_name("test_clamping_pressure_bar"), Some(id));
        assert_eq!((id.name(), id.channel().unit), ("test_clamping_pressure_bar", "bar"));
        assert!(ChannelId::list_all().any(|known| known == id) && id.index() < ChannelId::count_channels());
        assert_eq!(declare_channel(&new("test_clamping_pressure_bar")), Ok(id), "once more is the same");
        let other = NewChannel { unit: "MPa".to_owned(), ..new("test_clamping_pressure_bar") };
        assert_eq!(declare_channel(&other), Err(DeclareError::Differs));
    }

    #[test]
    fn what_cannot_be_declared() {
        assert_eq!(declare_channel(&new("spindle_speed_rpm")), Err(DeclareError::Known));
        for name in ["", "Pressure_bar", "1st_bar", "pressure-bar", "druck_bär", &"x".repeat(61)] {
            assert_eq!(declare_channel(&new(name)), Err(DeclareError::Name), "{name}");
        }
    }
}
