//! What the integrator decides: the host of rhai scripts.
//!
//! [`Host::run_due_scripts`] takes a sample and the estimates and yields a [`Decision`]: alarms, notes, and a request to the gate.
//! A script can only ask; whether anything is written is decided elsewhere, by compiled code.
//!
//! - A script is a text that runs from top to bottom at every tick, or every `const EVERY_S = 1.0;` seconds. Functions with
//!   the names of [`HANDLERS`] run before it when a state, part, program, tool or alarm of the controller has changed.
//! - It sees the words of [`list_words`] as variables: channels, estimates, `state`, `now_s`, `dt_s`, and `memory`, which is
//!   its own; the same as fields of [`RECORDS`], with age and reason of absence. A word without a value is `()`: `has(x)`
//!   asks, `x ?? 0.0` replaces, a comparison is false. A script that computes with a value that is not there waits: it asks
//!   for nothing and runs again when it is due.
//! - `fn settings() { #{ c1: 0.15 } }` is called once when the script is loaded and sets the estimators.
//! - What it remembers outlives a changed text and the process ([`Host::take_snapshot`]).
//! - Everything is bounded: operations, depth, sizes, names, notes. A script that fails is replaced by its last good
//!   version or suspended.
//! - The same samples give the same decisions: there is no clock, no random number, no file and no network in reach.
//!
//! | file | what |
//! |---|---|
//! | `vocabulary`, `quantities`, `fields`, `events`, `callable` | what a script sees, handles and can call |
//! | `engine`, `deadline` | the interpreter and its limits |
//! | `outcomes` | the functions through which a script leaves its effects |
//! | `functions` | the methods that scripts call by name, one table per subject |
//! | `api` | everything of it as a document |
//! | `declared` | the settings that scripts declare, and their values |
//! | `compile`, `script_set`, `examine`, `kinds`, `handlers`, `settings` | from text to a script, and everything that is wrong with it |
//! | `order` | channels that one script reads of another, and the order of running |
//! | `host`, `slot`, `variables`, `running`, `collect`, `notes` | running |
//! | `timers`, `script_memory` | what a script remembers |
//! | `trials` | given and expected, written in the script file itself |
//! | `decision`, `status`, `problem` | what comes out |
//! | `example_scripts`, `recipes` | the scripts that come with the gateway |

mod api;
mod callable;
mod collect;
mod compile;
mod deadline;
mod decision;
mod declared;
mod engine;
mod events;
mod examine;
mod example_scripts;
mod fields;
pub mod functions;
mod handlers;
mod host;
mod kinds;
mod notes;
mod order;
mod outcomes;
mod problem;
mod quantities;
mod recipes;
mod running;
mod script_memory;
mod script_set;
mod settings;
mod slot;
mod status;
mod timers;
mod trials;
mod variables;
mod vocabulary;

pub use api::{api_json, format_api_reference};
pub use callable::{FUNCTIONS, Function};
pub use compile::{
    ScriptFile, compile_one, compile_scripts, compile_with, list_declarations, prepare_scripts, prepare_with,
};
pub use deadline::Deadline;
pub use decision::{
    Alarm, AlarmChange, AlarmLevel, Axis, Decision, Note, OffsetProposal, OverrideRequest, Published, SCRIPT_STOPPED,
    Stop, StopRequest,
};
pub use declared::{DeclarationPlace, Declared, Per, SETTINGS_TEXT_MAX, SettingValue, SettingValues};
pub use engine::{OPERATIONS_MAX, TEXT_MAX};
pub use events::{HANDLERS, Handler};
pub use example_scripts::list_shipped_scripts;
pub use fields::{RECORDS, Record};
pub use host::Host;
pub use problem::ScriptProblem;
pub use recipes::{RECIPES, ScriptRecipe, find_recipe};
pub use script_set::ScriptSet;
pub use status::{ScriptCondition, ScriptStatus, Status};
pub use trials::{TRIAL_FUNCTIONS, TrialResult, prove_scripts, run_trials};
pub use vocabulary::{Word, WordKind, format_vocabulary, list_words};
