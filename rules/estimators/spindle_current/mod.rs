//! Spindle current as a measure of cutting load: filter, feature over whole half periods, and the curve of that feature
//! over feed, by depth of cut.
//!
//! Source: constant-load feed control on the spindle current of a mill (DM4600): 1 kHz, low-pass of 4th order at 350 Hz,
//! feature over the current's period, cubic over feed by least squares, one curve per depth.
//!
//! | file | what |
//! |---|---|
//! | `butterworth` | the low-pass, designed for any rate, as second-order sections; running without allocation |
//! | `half_periods` | where the half periods of a current begin, and what it sums up to in each |
//! | `feature` | mean absolute, rms or integral over whole half periods, one phase or three |
//! | `cubic` | a cubic over a range of feeds: slope, monotony, inverse |
//! | `plateaus` | stretches of constant speed, depth and feed in a recording |
//! | `feed_curve` | the curve of a recording: degree, intervals, checks |
//! | `family` | curves over depth: which depth, which feed |

mod butterworth;
mod cubic;
mod family;
mod feature;
mod feed_curve;
mod half_periods;
mod plateaus;
mod words;

pub use butterworth::{LowPass, LowPassDesign};
pub use cubic::{Cubic, Inversion};
pub use family::{CurveAtDepth, CurveFamily, Inferred};
pub use feature::{Feature, FeatureKind, PhaseFeature, ThreePhase, WindowSpan};
pub use feed_curve::{CurveLearned, FeedCurves, Scatter, identify_feed_curve};
pub use plateaus::Plateau;
