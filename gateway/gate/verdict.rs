//! What the gate decided, as a value and as words.

use super::hold::Hold;
use super::limit::Bound;
use adapter_core::clock::TimeNs;
use adapter_core::override_pct::OverridePct;

/// What became of the request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GateOutcome {
    /// As asked for; without a request, the programmed feed.
    Permitted,
    /// Inside the band and the pace instead.
    Limited(Bound),
    /// 100 %, because of this.
    Held(Hold),
    /// Not a number from 0 to 254 %: back to 100 %.
    Refused,
    /// The operator's dial is at or below what is asked for, and the ladder takes the lesser one: nothing is asked of it.
    DialCounts(OverridePct),
}

/// The decision of one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Time of the tick, ns since 1970.
    pub at_ns: TimeNs,
    /// What was asked for, as it was; may be no number.
    pub wanted_pct: Option<f64>,
    /// What is let through.
    pub permitted: OverridePct,
    /// How the one became the other.
    pub outcome: GateOutcome,
    /// May it be written?
    pub armed: bool,
}

impl Verdict {
    /// Is the machine asked for anything? At 100 % the dial alone counts, and the enable is withdrawn.
    #[must_use]
    pub fn has_request(&self) -> bool {
        self.permitted != OverridePct::FULL
    }

    /// The word in the history: `written`, `shadow`, `held`, `limited` or `refused`.
    #[must_use]
    pub fn as_word(&self) -> &'static str {
        match self.outcome {
            GateOutcome::Held(_) => "held",
            GateOutcome::Refused => "refused",
            GateOutcome::Limited(_) | GateOutcome::DialCounts(_) => "limited",
            GateOutcome::Permitted if self.armed => "written",
            GateOutcome::Permitted => "shadow",
        }
    }

    /// Why, for the operator.
    #[must_use]
    pub fn reason(&self) -> String {
        match self.outcome {
            GateOutcome::Permitted if self.armed && !self.has_request() => {
                "nothing is asked of the machine: the dial counts".to_owned()
            }
            GateOutcome::Permitted if self.armed => "as asked for".to_owned(),
            GateOutcome::DialCounts(dial) => {
                format!(
                    "the operator's dial at {dial} is not above it: nothing is asked of the machine, the dial counts"
                )
            }
            GateOutcome::Permitted => "the gate is not armed: recorded, not written".to_owned(),
            GateOutcome::Limited(Bound::Least) => format!("the least override is {}", self.permitted),
            GateOutcome::Limited(Bound::Greatest) => format!("the greatest override is {}", self.permitted),
            GateOutcome::Limited(Bound::Dial(most)) => format!(
                "nothing above {most} is asked of the ladder, which takes the lesser of it and the operator's dial; `above_dial` under \
                 [gate] would allow it"
            ),
            GateOutcome::Limited(Bound::Slew) => format!("the change is limited; {} now", self.permitted),
            GateOutcome::Limited(Bound::NotPossible) | GateOutcome::Refused => {
                "a feed override is a number from 0 to 254 %; back to 100 %".to_owned()
            }
            GateOutcome::Held(hold) => format!("no override, the dial counts: {hold}"),
        }
    }
}
