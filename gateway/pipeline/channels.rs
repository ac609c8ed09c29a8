//! The channels that the box itself looks at, found once.

use adapter_core::ChannelId;

/// See the fields' names.
#[derive(Debug, Clone, Copy)]
pub struct Channels {
    pub(crate) part_count: ChannelId,
    pub(crate) part: ChannelId,
    pub(crate) program: ChannelId,
    pub(crate) tool: ChannelId,
    pub(crate) operation: ChannelId,
    pub(crate) alarm: ChannelId,
    pub(crate) total_power: ChannelId,
    pub(crate) spindle_power: ChannelId,
}

impl Channels {
    /// Looks every name up.
    ///
    /// # Panics
    /// Never: a test holds the names against the table.
    #[must_use]
    pub fn new() -> Self {
        let of = |name| ChannelId::from_name(name).expect("the name stands in the table, which a test checks");
        Self {
            part_count: of("part_count"),
            part: of("part"),
            program: of("program"),
            tool: of("tool"),
            operation: of("operation"),
            alarm: of("alarm"),
            total_power: of("total_power_w"),
            spindle_power: of("spindle_power_w"),
        }
    }
}

impl Default for Channels {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_name_stands_in_the_table() {
        let _found = super::Channels::new();
    }
}
