//! What the box remembers besides samples, one type per kind of row: what the gate writes down, the history stores and the outputs send.
//!
//! Nothing here stores or sends anything, so that who makes a record needs neither a database nor the rules.

mod fact;
mod record;
mod row_rate;

pub use fact::{Fact, FactKind};
pub use record::{
    Alarm, AlarmClear, Audit, Command, Decision, Diagnosis, Event, Model, Part, ReactionTime, Record, StateChange,
};
pub use row_rate::RowRate;
