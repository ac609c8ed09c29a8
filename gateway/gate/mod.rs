//! The gate: what a script asks for becomes a command, or it does not, with the reason.
//!
//! Compiled, because no script may widen it. [`Gate::decide`] looks at the request, the sample, the estimates and the
//! limits of the configuration, and at nothing else; given the same it decides the same. It never writes: in `shadow`,
//! which is the default, a [`Verdict`] is recorded and that is all. Only a [`Writer`] writes, and only verdicts that say
//! so, which needs `mode = "armed"` in the configuration *and* arming on the box, for a limited time, after every start.
//!
//! What holds 100 % whatever is asked for is the list of [`Hold`]: the contract that machine builders know from the
//! adaptive controls of the last decades (second feed override behind the operator's dial, 100 % in threading and
//! tapping, off after start-up).
//!
//! | file | what |
//! |---|---|
//! | `hold` | the reasons that hold 100 % |
//! | `thread_cycle` | threading and tapping from the text of NC blocks |
//! | `limit` | band and slew |
//! | `verdict` | what was decided, as words |
//! | `arming` | who let it write, and until when |
//! | `write` | writing, reading back, restoring |

mod arming;
mod hold;
mod limit;
mod thread_cycle;
mod verdict;
mod write;

pub use arming::{ArmError, Armed, Disarmed};
pub use hold::Hold;
pub use limit::Bound;
pub use verdict::{Outcome, Verdict};
pub use write::{Fault, Writer, Written};

use crate::config::{self, GateMode};
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::{ChannelId, Sample};
use arming::Arming;
use hold::Interlocks;
use limit::Slew;
use rules::estimators::Estimates;
use rules::script::OverrideRequest;

/// Decides about feed overrides. One per machine; remembers the last decision, for the slew limit, and the arming.
#[derive(Debug)]
pub struct Gate {
    limits: config::Gate,
    interlocks: Interlocks,
    slew: Slew,
    arming: Arming,
}

impl Gate {
    /// A gate with these limits. It is disarmed, whatever the configuration says.
    #[must_use]
    pub fn new(limits: config::Gate) -> Self {
        let stale_ns = i64::try_from(limits.stale.as_nanos()).unwrap_or(i64::MAX);
        Self {
            interlocks: Interlocks::new(stale_ns),
            slew: Slew::new(limits.slew_up_pct_per_s, limits.slew_down_pct_per_s),
            arming: Arming::new(limits.mode, limits.armed_for),
            limits,
        }
    }

    /// The limits in force.
    #[must_use]
    pub fn limits(&self) -> &config::Gate {
        &self.limits
    }

    /// Lets the gate write from now on, for the time that the configuration gives.
    ///
    /// # Errors
    /// The configuration does not allow it, or nobody is named.
    pub fn arm(&mut self, by: &str, at_ns: TimeNs) -> Result<&Armed, ArmError> {
        self.arming.arm(by, at_ns)
    }

    /// Ends the permission to write. The writer restores 100 % at the next verdict.
    pub fn disarm(&mut self, why: Disarmed) {
        self.arming.disarm(why);
    }

    /// Who armed the gate, while it is armed, or why it is not.
    ///
    /// # Errors
    /// Why it is not.
    pub fn armed(&self) -> Result<&Armed, Disarmed> {
        self.arming.state()
    }

    /// Decides about this tick's request; without one, the programmed feed is what is wanted.
    pub fn decide(&mut self, request: Option<&OverrideRequest>, sample: &Sample, estimates: &Estimates) -> Verdict {
        let at_ns = sample.at_ns;
        self.arming.expire(at_ns);
        let hold = match self.limits.mode {
            GateMode::Off => Some(Hold::Off),
            GateMode::Shadow | GateMode::Armed => self.interlocks.look(sample, estimates),
        };
        self.arming.silent(matches!(hold, Some(Hold::Missing(..))), at_ns);
        let wanted_pct = request.map(|request| request.pct);
        let (target_pct, bound) = limit::band(wanted_pct, self.limits.min_pct, self.limits.max_pct);
        let outcome = match (hold, bound) {
            (Some(hold), _) => Outcome::Held(hold),
            (None, Some(Bound::NotPossible)) => Outcome::Refused,
            (None, Some(bound)) => Outcome::Limited(bound),
            (None, None) => Outcome::Permitted,
        };
        let permitted =
            if hold.is_some() { self.slew.jump_to_full(at_ns) } else { self.slew.approach(target_pct, at_ns) };
        let slewing = hold.is_none() && bound.is_none() && (self.slew.exact_pct() - target_pct).abs() >= 1.0;
        let outcome = if slewing { Outcome::Limited(Bound::Slew) } else { outcome };
        Verdict { at_ns, wanted_pct, permitted, outcome, armed: self.arming.state().is_ok() }
    }
}

/// A channel of the table that the gate cannot do without.
fn channel(name: &str) -> Option<ChannelId> {
    ChannelId::of(name)
}

/// The longest time between two decisions over which the slew limit still counts; after more, it begins at 100 %.
const PAUSE_NS: i64 = SECOND_NS;
