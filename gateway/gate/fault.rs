//! What ends an arming on the way to the machine, in words for the operator.

use super::arming::Disarmed;
use adapters::units::OverridePct;
use adapters::{Axis, SourceError};
use std::fmt;

/// Why the machine is not written to any more. The gate is to be disarmed with [`Fault::disarmed`], and an alarm raised.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// The machine shows another override than any that was written while it had time to settle.
    ReadBack {
        /// Written last.
        asked: OverridePct,
        /// Read back.
        found: OverridePct,
    },
    /// Writing or reading back failed.
    Line(SourceError),
    /// The control shows another offset than the one that was written.
    Offset {
        /// Which axis.
        axis: Axis,
        /// Written, um.
        asked_um: f64,
        /// Read back, um.
        found_um: f64,
    },
    /// An offset could not be written or read back.
    OffsetLine(SourceError),
    /// For so long no sign of life reached the ladder, which therefore may have taken the dial back in between.
    Late {
        /// How long, ms.
        silent_ms: i64,
    },
    /// The thread that writes has ended.
    Gone,
}

impl Fault {
    /// The reason the gate is disarmed with.
    #[must_use]
    pub fn disarmed(&self) -> Disarmed {
        match self {
            // A machine that answers and says no has been reached.
            Self::ReadBack { .. } | Self::Line(SourceError::Refused { .. }) => Disarmed::ReadBack,
            Self::Offset { .. } | Self::OffsetLine(SourceError::Refused { .. }) => Disarmed::Offset,
            Self::Line(_) | Self::OffsetLine(_) | Self::Late { .. } | Self::Gone => Disarmed::Line,
        }
    }

    /// The alarm in Chinese.
    #[must_use]
    pub fn zh(&self) -> &'static str {
        match self {
            Self::ReadBack { .. } | Self::Line(_) => "写入的进给倍率未生效，闸门已解除；请检查梯形图与面板倍率",
            Self::Late { .. } => "心跳中断，梯形图可能已恢复面板倍率，闸门已解除；请检查网络与数控系统负载",
            Self::Gone => "写入线程已退出，闸门已解除；请重启网关",
            Self::Offset { .. } | Self::OffsetLine(_) => {
                "写入的工件零点偏移未生效，闸门已解除；请检查数控系统的偏移保护"
            }
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ReadBack { asked, found } => write!(
                f,
                "feed override {asked} was written and {found} is in force: the machine does not take it; the gate is disarmed. \
                 Look whether the ladder passes the gateway's override on, and whether the dial limits it"
            ),
            Self::Line(error) => write!(f, "the feed override could not be written; the gate is disarmed. {error}"),
            Self::Offset { axis, asked_um, found_um } => write!(
                f,
                "offset {asked_um:.0} um of {} was written and the control shows {found_um:.0} um; the gate is disarmed. Look \
                 whether the offsets are protected, and who else writes them",
                axis.word()
            ),
            Self::OffsetLine(error) => {
                write!(f, "the offset could not be written or read back; the gate is disarmed. {error}")
            }
            Self::Late { silent_ms } => write!(
                f,
                "no sign of life reached the ladder for {silent_ms} ms, so it may have taken the dial back; the gate is \
                 disarmed. Look at the network and at what else asks the control"
            ),
            Self::Gone => f.write_str(
                "the thread that writes has ended, so nothing can be written; the ladder falls back to the dial by itself. \
                 Start the gateway again, and report this with the log",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_that_says_no_has_been_reached() {
        let (source_name, what, next) = ("fanuc://10.0.0.7".to_owned(), "protected".to_owned(), String::new());
        let line = SourceError::Line { source_name: source_name.clone(), what: what.clone(), next: next.clone() };
        let refused = SourceError::Refused { source_name, request: "the offset".to_owned(), what, next };
        assert_eq!(Fault::Line(refused.clone()).disarmed(), Disarmed::ReadBack);
        assert_eq!(Fault::OffsetLine(refused).disarmed(), Disarmed::Offset);
        assert_eq!(Fault::OffsetLine(line.clone()).disarmed(), Disarmed::Line);
        assert_eq!(Fault::Line(line).disarmed(), Disarmed::Line);
    }
}
