//! How late the meter is against the controller, and how long it averages: one time base for two clocks.
//!
//! A controller says how fast the spindle turns, a meter how much power it takes, and neither says when that was true. The
//! delay between them is seen only where the speed changes; and there a cross-correlation of the two answers another
//! question, because power follows the *change* of speed (inertia) as well as the speed. So lag, averaging window and a
//! small power model are estimated together: for every lag and window the predictors are averaged as the meter averages,
//! the model is fitted, and the residual is compared.
//!
//! Law: `P(t) = c0 + c1 |n| + c2 n^2 + c3 |n|^3 + c4 [n > 0] + J+ [w dw/dt]+ + J- [w dw/dt]- + X e(t)`, each predictor a mean over
//! `[t - lag - window/2, t - lag + window/2]`. `J-` is free because braking may go back to the supply or into a resistor;
//! `e` decays from the beginning of a run-up (break-away, magnetisation) and takes part only where it explains more than
//! chance. The mean of `w dw/dt` is exact: it is the difference of `w^2 / 2` over the window.
//!
//! | file | what |
//! |---|---|
//! | `speed` | a course of speed, and running integrals of everything that is predicted from it |
//! | `steady` | stamps of the controller put on the beat of its polling, where that is the steadier clock |
//! | `fit` | the power model at one lag and window, and its residual |
//! | `profile` | the residual over lag and window, its minimum and its rivals |
//! | `estimate` | [`estimate_lag`]: lag, width, drift and window over all transients, or why they cannot be known |
//! | `courses` | a file on a clock that nobody set, laid beside the history by its cuts |
//! | `collect` | transients out of a running machine, without what was measured while it cut |
//! | `change` | whether a new change of speed has the lag that is known, or another one |
//! | `follow` | the lag in force: follows the estimates slowly, stands still while the machine cuts |
//!
//! What makes a lag not identifiable is an answer of its own ([`NotIdentifiable`]): no change of speed, changes too slow to
//! tell delay from level, a model that does not explain the power, a second lag as good as the first.
//!
//! The lag is that between the stamps of the two sources' readings and is meant for interpolation: the power stamped `t`
//! belongs to the speed stamped `t - lag`. A drift is a change of that lag over time; for polled devices, stamped by one
//! clock, it is zero within its width, for a device that streams by its own clock it is that clock's error.

mod change;
mod collect;
mod courses;
mod estimate;
mod fit;
mod follow;
mod profile;
mod speed;
mod steady;

#[cfg(test)]
mod tests;

pub use change::{LagChange, LagWatch};
pub use collect::{AlignmentData, Collector};
pub use courses::{Matched, match_courses};
pub use estimate::{Drift, Lag, LagSettings, NotIdentifiable, estimate_lag};
pub use fit::PowerModel;
pub use follow::LagFollower;
pub use speed::{PowerPoint, SpeedPoint, Transient};
