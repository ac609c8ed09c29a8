//! State words of controllers, one spelling for every make: those of MTConnect (Part 3, ControllerMode and Execution).
//! Drivers translate into them; the gate and the scripts compare with them.

/// Words of the channel `mode`.
pub mod mode {
    /// A program runs or can be started (memory, tape, remote).
    pub const AUTOMATIC: &str = "AUTOMATIC";
    /// Handwheel, jog, incremental, reference.
    pub const MANUAL: &str = "MANUAL";
    /// Single commands typed in (MDI).
    pub const MANUAL_DATA_INPUT: &str = "MANUAL_DATA_INPUT";
    /// One block at a time.
    pub const SEMI_AUTOMATIC: &str = "SEMI_AUTOMATIC";
    /// A program is being edited.
    pub const EDIT: &str = "EDIT";

    /// Every word that the channel `mode` can have.
    pub const ALL: [&str; 5] = [AUTOMATIC, MANUAL, MANUAL_DATA_INPUT, SEMI_AUTOMATIC, EDIT];
}

/// Words of the channel `execution`.
pub mod execution {
    /// Nothing runs; a program can be started.
    pub const READY: &str = "READY";
    /// A program runs and nothing holds it.
    pub const ACTIVE: &str = "ACTIVE";
    /// Running, but the feed is at 0 % or waits for something.
    pub const INTERRUPTED: &str = "INTERRUPTED";
    /// Feed hold was pressed.
    pub const FEED_HOLD: &str = "FEED_HOLD";
    /// Stopped by the operator, by the program (M0, M1) or by an alarm.
    pub const STOPPED: &str = "STOPPED";
    /// The program came to its end.
    pub const PROGRAM_COMPLETED: &str = "PROGRAM_COMPLETED";

    /// Every word that the channel `execution` can have.
    pub const ALL: [&str; 6] = [READY, ACTIVE, INTERRUPTED, FEED_HOLD, STOPPED, PROGRAM_COMPLETED];
}

/// The words that a channel can have; nothing for a channel whose texts are free.
#[must_use]
pub fn of_channel(channel: &str) -> Option<&'static [&'static str]> {
    match channel {
        "mode" => Some(&mode::ALL),
        "execution" => Some(&execution::ALL),
        _ => None,
    }
}

/// The word that a recording of other hands means: capitals do not count, and a blank or a hyphen stands for `_`. `None` where
/// the channel has no such word.
#[must_use]
pub fn find_canonical_word(channel: &str, text: &str) -> Option<&'static str> {
    let plain = text.trim().replace([' ', '-'], "_");
    of_channel(channel)?.iter().copied().find(|word| word.eq_ignore_ascii_case(&plain))
}

/// Words of the channel `operation` in which the feed follows the spindle and no override may act.
pub mod operation {
    /// A thread is cut with the spindle and the feed in step.
    pub const THREADING: &str = "threading";
    /// A thread is tapped with the spindle and the feed in step.
    pub const TAPPING: &str = "tapping";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_in_other_letters_is_the_same_word() {
        assert_eq!(find_canonical_word("mode", "automatic"), Some(mode::AUTOMATIC));
        assert_eq!(find_canonical_word("mode", " Semi-automatic"), Some(mode::SEMI_AUTOMATIC));
        assert_eq!(find_canonical_word("execution", "feed hold"), Some(execution::FEED_HOLD));
        assert_eq!(find_canonical_word("mode", "MEM"), None);
        assert_eq!(find_canonical_word("program", "automatic"), None);
    }
}
