//! Power separation: what a recording tells about a machine's no-load power and load loss.
//!
//! Law: `Pi = Pu(n) + (1 + a0) Pc + a1(n) Pc^2` per gear stage; the split of one sample is [`super::LoadLossLaw`], no-load power
//! between known speeds is [`super::lagrange_weights`]. Here the numbers of that law are found in recordings.
//!
//! | file | what |
//! |---|---|
//! | `rows` | a recording through the estimators: what the machine was doing in each row |
//! | `stretches` | idle stretches of one speed, their settled part, its level |
//! | `no_load` | no-load power per gear stage and speed, several visits put together |
//! | `reference` | what tells the power at the edge: torque, force, known removal |
//! | `cuts` | steady cuts and idle stretches with power and reference |
//! | `load_loss` | a0 and a1 per gear stage |
//! | `forms` | how a1 goes with the spindle speed: not at all, or with 1/n^2 |
//! | `accuracy` | error of the separation per cut, beside the fixed losses of practice |
//! | `words` | the result as text, as JSON and as a script's settings |

mod accuracy;
mod cuts;
#[cfg(test)]
mod doubt_tests;
mod forms;
mod load_loss;
mod no_load;
mod reference;
mod rows;
mod stretches;
mod words;

pub use accuracy::{Accuracy, FIXED_LOSSES, GroupAccuracy};
pub use cuts::SteadyPoint;
pub use forms::FormResiduals;
pub use load_loss::{IntervalEstimate, LoadLossLearned, StageLearned, identify_load_loss};
pub use no_load::{NoLoadLearned, SpeedLearned, identify_no_load};
pub use reference::{PowerReference, ReferenceChoice};
pub use stretches::Stretch;
pub(super) use stretches::settled_from;
