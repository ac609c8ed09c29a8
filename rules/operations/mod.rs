//! What no controller can be asked for: depth and width of cut, diameter, tool and work material of every stretch of an
//! NC program, from a table that the process planner writes.
//!
//! ```toml
//! schema = "operations/1"
//!
//! [[operation]]
//! program = "O1234"            # as the controller names it
//! blocks = [10, 120]           # sequence numbers, both included; without it: the rest of the program
//! name = "rough turning"
//! depth_of_cut_mm = 1.5
//! diameter_mm = 79.0           # of the work in turning, of the tool in milling
//! tool = "T0101"
//! work_material = "45# steel"
//! ```
//!
//! [`parse`] reads the text and tells everything that is wrong with it, [`Recipe::find_operation`] looks a block up,
//! [`Completion::apply_recipe`] fills in what the sources of a sample do not deliver. What was filled in says so: the channel
//! `recipe` names the operation and the version of the table.

mod complete;
mod quantity;
mod read;
mod recipe;

pub use complete::{Completion, complete_recording};
pub use quantity::{OperationQuantity, QUANTITIES};
pub use read::{OPERATIONS_MAX, TEXT_MAX, parse};
pub use recipe::{Lookup, Operation, Recipe, block_number};
