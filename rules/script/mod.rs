//! What the integrator decides: the host of rhai scripts.
//!
//! [`Host::tick`] takes a sample and the estimates and yields a [`Decision`]: alarms, notes, and a request to the gate.
//! A script can only ask; whether anything is written is decided elsewhere, by compiled code.
//!
//! - A script is a text that runs from top to bottom at every tick, or every `const EVERY_S = 1.0;` seconds.
//! - It sees the words of [`words`] as variables: channels, estimates, `state`, `now_s`, `dt_s`, and `memory`, which is
//!   its own. A word without a value is `()`: `has(x)` asks, `x ?? 0.0` replaces, a comparison is false. A script that
//!   computes with a value that is not there waits: it asks for nothing and runs again when it is due.
//! - `fn settings() { #{ c1: 0.15 } }` is called once when the script is loaded and sets the estimators.
//! - Everything is bounded: operations, depth, sizes, names, notes. A script that fails is replaced by its last good
//!   version or suspended.
//! - The same samples give the same decisions: there is no clock, no random number, no file and no network in reach.
//!
//! | file | what |
//! |---|---|
//! | `vocabulary` | what a script sees and can call |
//! | `engine` | the interpreter and its limits |
//! | `functions` | the methods that scripts call by name, one table per subject |
//! | `api` | everything of it as a document |
//! | `compile`, `examine`, `settings` | from text to a script, and everything that is wrong with it |
//! | `host`, `slot`, `running`, `collect`, `notes` | running |
//! | `decision`, `status`, `problem` | what comes out |
//! | `shipped` | the scripts that come with the gateway |

mod api;
mod collect;
mod compile;
mod decision;
mod engine;
mod examine;
pub mod functions;
mod host;
mod notes;
mod problem;
mod running;
mod settings;
mod shipped;
mod slot;
mod status;
mod vocabulary;

pub use api::{api, api_json};
pub use compile::{ScriptFile, ScriptSet, compile};
pub use decision::{Alarm, AlarmChange, Decision, Note, OverrideRequest, SCRIPT_STOPPED};
pub use engine::{OPERATIONS_MAX, TEXT_MAX};
pub use host::Host;
pub use problem::Problem;
pub use shipped::shipped;
pub use status::{Condition, ScriptStatus, Status};
pub use vocabulary::{FUNCTIONS, Function, Word, WordKind, vocabulary, words};
