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

    /// Every word.
    pub const ALL: [&str; 5] = [AUTOMATIC, MANUAL, MANUAL_DATA_INPUT, SEMI_AUTOMATIC, EDIT];
}

/// Words of the channel `execution`.
pub mod execution {
    /// Nothing runs; a program can be started.
    pub const READY: &str = "READY";
    /// A program runs.
    pub const ACTIVE: &str = "ACTIVE";
    /// Running, but the feed is at 0 % or waits for something.
    pub const INTERRUPTED: &str = "INTERRUPTED";
    /// Feed hold was pressed.
    pub const FEED_HOLD: &str = "FEED_HOLD";
    /// Stopped by the operator, by the program (M0, M1) or by an alarm.
    pub const STOPPED: &str = "STOPPED";
    /// The program came to its end.
    pub const PROGRAM_COMPLETED: &str = "PROGRAM_COMPLETED";

    /// Every word.
    pub const ALL: [&str; 6] = [READY, ACTIVE, INTERRUPTED, FEED_HOLD, STOPPED, PROGRAM_COMPLETED];
}

/// Words of the channel `operation` in which the feed follows the spindle and no override may act.
pub mod operation {
    /// A thread is cut with the spindle and the feed in step.
    pub const THREADING: &str = "threading";
    /// A thread is tapped with the spindle and the feed in step.
    pub const TAPPING: &str = "tapping";
}
