//! What ends an arming on the way to the machine, in words for the operator.

use super::arming::Disarmed;
use adapter_core::override_pct::OverridePct;
use adapter_core::{Axis, LadderRule, SourceError};
use std::fmt;

/// What the machine shows where something else was expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnexpectedReading {
    /// The override in force.
    pub found: OverridePct,
    /// The operator's dial, where it is known.
    pub dial: Option<OverridePct>,
    /// What the configuration says that the ladder makes of the two.
    pub rule: LadderRule,
}

/// Why the machine is not written to any more. The gate is to be disarmed with [`Fault::disarm_reason`], and an alarm raised.
#[derive(Debug, Clone, PartialEq)]
pub enum Fault {
    /// The machine shows another override than any that was written while it had time to settle.
    ReadBack {
        /// The override that was written last.
        asked: OverridePct,
        /// What the machine showed instead.
        shown: UnexpectedReading,
    },
    /// The override was withdrawn and the dial is not in force again.
    StillInForce(UnexpectedReading),
    /// The machine refuses that the override is withdrawn; it is tried again.
    NotWithdrawn(SourceError),
    /// Writing or reading back failed.
    Line(SourceError),
    /// The control shows another offset than the one that was written.
    Offset {
        /// The axis whose offset differs.
        axis: Axis,
        /// The offset that was written, um.
        asked_um: f64,
        /// The offset that was read back, um.
        found_um: f64,
    },
    /// An offset could not be written or read back.
    OffsetLine(SourceError),
    /// For so long no sign of life reached the ladder, which therefore may have taken the dial back in between.
    Late {
        /// Time since the last sign of life, ms.
        silent_ms: i64,
    },
    /// The thread that writes has ended.
    Gone,
}

impl Fault {
    /// The reason the gate is disarmed with.
    #[must_use]
    pub fn disarm_reason(&self) -> Disarmed {
        match self {
            // A machine that answers and says no has been reached.
            Self::ReadBack { .. }
            | Self::StillInForce(_)
            | Self::Line(SourceError::Refused { .. })
            | Self::NotWithdrawn(SourceError::Refused { .. }) => Disarmed::ReadBack,
            Self::Offset { .. } | Self::OffsetLine(SourceError::Refused { .. }) => Disarmed::Offset,
            Self::Line(_) | Self::NotWithdrawn(_) | Self::OffsetLine(_) | Self::Late { .. } | Self::Gone => {
                Disarmed::Line
            }
        }
    }

    /// The alarm in Chinese.
    #[must_use]
    pub fn describe_in_chinese(&self) -> &'static str {
        match self {
            Self::ReadBack { asked, shown } if shown.replaces_dial(*asked) => {
                "梯形图用网关倍率取代了面板倍率，闸门已解除；请让梯形图取面板与网关倍率的较小者"
            }
            Self::ReadBack { .. } | Self::Line(_) => "写入的进给倍率未生效，闸门已解除；请检查梯形图与面板倍率",
            Self::StillInForce(_) => "网关倍率已撤回，但面板倍率尚未恢复；请检查梯形图是否读取使能字节",
            Self::NotWithdrawn(_) => "网关倍率无法撤回，正在重试；心跳停止后梯形图应恢复面板倍率",
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
            Self::ReadBack { asked, shown } => shown.write_explanation(*asked, f),
            Self::StillInForce(UnexpectedReading { found, dial, .. }) => {
                let dial = dial.map_or_else(|| "the dial".to_owned(), |dial| format!("the dial at {dial}"));
                write!(
                    f,
                    "the gateway's override was withdrawn, and {found} is in force instead of {dial}. Look whether the ladder \
                     reads the enable byte, and who else writes the override"
                )
            }
            Self::NotWithdrawn(error) => write!(
                f,
                "the gateway's override could not be withdrawn; it is tried again until the machine takes it, and the ladder \
                 has to fall back to the dial by itself because no sign of life is written any more. {error}"
            ),
            Self::Line(error) => write!(f, "the feed override could not be written; the gate is disarmed. {error}"),
            Self::Offset { axis, asked_um, found_um } => write!(
                f,
                "offset {asked_um:.0} um of {} was written and the control shows {found_um:.0} um; the gate is disarmed. Look \
                 whether the offsets are protected, and who else writes them",
                axis.as_word()
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

impl UnexpectedReading {
    /// The override that was written is in force although the dial stands below it.
    fn replaces_dial(&self, asked: OverridePct) -> bool {
        let expected = self.dial.map(|dial| self.rule.combine_overrides(dial, asked));
        self.found == asked && expected.is_some_and(|expected| expected != asked)
    }

    fn write_explanation(&self, asked: OverridePct, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { found, dial, rule } = *self;
        let Some(dial) = dial else {
            return write!(
                f,
                "feed override {asked} was written and {found} is in force: the machine does not take it; the gate is \
                 disarmed. Look whether the ladder passes the gateway's override on, and whether the dial limits it"
            );
        };
        let expected = rule.combine_overrides(dial, asked);
        write!(
            f,
            "feed override {asked} was written with the dial at {dial}: {expected} should be in force and {found} is. "
        )?;
        f.write_str(if self.replaces_dial(asked) {
            "The ladder lets the override take the place of the operator's dial; the gate is disarmed. Let the machine's maker \
             take the lesser of the two (or their product, with above_dial = true under [gate])"
        } else if found == dial {
            "The ladder does not pass the override on; the gate is disarmed. Compare the address of the mailbox with the ladder"
        } else {
            "The gate is disarmed. Look what else writes the override, and whether the ladder's rule is the one under [gate] \
             (above_dial)"
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_of_an_override_does_not_contradict_itself() {
        let pct = |percent| OverridePct::new(percent).expect("not 255");
        let told = |asked, found, dial: Option<u8>, rule| {
            let shown = UnexpectedReading { found: pct(found), dial: dial.map(pct), rule };
            Fault::ReadBack { asked: pct(asked), shown }.to_string()
        };
        let replaced = told(71, 71, Some(70), LadderRule::Least);
        assert!(
            replaced.contains("71 % was written with the dial at 70 %: 70 % should be in force and 71 % is"),
            "{replaced}"
        );
        assert!(replaced.contains("take the place of the operator's dial"), "{replaced}");
        let ignored = told(60, 80, Some(80), LadderRule::Least);
        assert!(ignored.contains("does not pass the override on") && ignored.contains("60 % should"), "{ignored}");
        let other = told(60, 90, Some(80), LadderRule::Product);
        assert!(other.contains("48 % should be in force and 90 % is") && other.contains("above_dial"), "{other}");
        assert!(told(80, 100, None, LadderRule::Least).contains("80 % was written and 100 % is in force"));
    }

    #[test]
    fn a_machine_that_says_no_has_been_reached() {
        let (source_name, what, next) = ("fanuc://10.0.0.7".to_owned(), "protected".to_owned(), String::new());
        let line = SourceError::Line { source_name: source_name.clone(), what: what.clone(), next: next.clone() };
        let refused = SourceError::Refused { source_name, request: "the offset".to_owned(), what, next };
        assert_eq!(Fault::Line(refused.clone()).disarm_reason(), Disarmed::ReadBack);
        assert_eq!(Fault::OffsetLine(refused).disarm_reason(), Disarmed::Offset);
        assert_eq!(Fault::OffsetLine(line.clone()).disarm_reason(), Disarmed::Line);
        assert_eq!(Fault::Line(line).disarm_reason(), Disarmed::Line);
    }
}
