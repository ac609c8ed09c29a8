//! The number of a channel: its position in the table, and behind the table in what a configuration has declared.

use super::{CHANNELS, COUNT, Channel, TABLE, declarations};
use std::fmt;

/// Index into [`CHANNELS`], and behind them into what a configuration has declared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChannelId(u16);

impl ChannelId {
    /// How many channels there are. It grows while a configuration is read; whoever keeps something per channel looks
    /// once, and meets a later channel as one that is not there.
    #[must_use]
    pub fn count_channels() -> usize {
        CHANNELS.len() + declarations::count_declared()
    }

    /// The channel of the table with this name, found while the program is compiled: `const MODE: ChannelId = ChannelId::find_constant("mode");`. A
    /// name that the table does not have does not compile there.
    ///
    /// # Panics
    /// There is none of this name; in a constant that is an error of the compiler.
    #[must_use]
    pub const fn find_constant(name: &str) -> Self {
        let mut index = 0;
        while index < COUNT {
            if is_same_name(TABLE[index].name.as_bytes(), name.as_bytes()) {
                #[expect(clippy::cast_possible_truncation, reason = "the table has some hundred rows")]
                return Self(index as u16);
            }
            index += 1;
        }
        panic!("the table of channels has none of this name")
    }

    /// The channel of this name. A linear search: look names up once, not in a loop.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let known = CHANNELS.iter().position(|channel| channel.name == name);
        let index = known.or_else(|| declarations::find_by_name(name).map(|place| CHANNELS.len() + place))?;
        u16::try_from(index).ok().map(Self)
    }

    /// The channel at this position of the table.
    #[must_use]
    pub fn from_index(index: usize) -> Option<Self> {
        (index < Self::count_channels()).then_some(index).and_then(|index| u16::try_from(index).ok()).map(Self)
    }

    /// Every channel, in the order of the table.
    pub fn list_all() -> impl Iterator<Item = Self> {
        (0..Self::count_channels()).filter_map(|index| u16::try_from(index).ok().map(Self))
    }

    /// Position in the table.
    #[must_use]
    pub fn index(self) -> usize {
        usize::from(self.0)
    }

    /// The row of the table.
    #[must_use]
    pub fn channel(self) -> &'static Channel {
        let index = usize::from(self.0);
        // An id is only made of a row that is there, and no row is ever taken away.
        CHANNELS.get(index).or_else(|| declarations::find_by_index(index - CHANNELS.len())).unwrap_or(&CHANNELS[0])
    }

    /// The name of the channel in the table, which is its name everywhere.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.channel().name
    }
}

const fn is_same_name(left: &[u8], right: &[u8]) -> bool {
    if left.len() != right.len() {
        return false;
    }
    let mut index = 0;
    while index < left.len() {
        if left[index] != right[index] {
            return false;
        }
        index += 1;
    }
    true
}

impl fmt::Display for ChannelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
