//! Thermal error of the tool against the work, from temperatures: which sensors, which law, and what to do about it.
//!
//! Source: thermal-error compensation on a milling spindle with 13 temperature points (grey relational grades, multiple
//! linear regression, pulse insertion). Where that method is known to fail the better one stands beside it.
//!
//! | file | what |
//! |---|---|
//! | `quantities` | units that were mistaken, series that teach nothing |
//! | `course` | rows of warm-ups, run by run, blocks to leave out |
//! | `recording` | the same from a recording |
//! | `grey` | grey relational grades, two normalisations |
//! | `selection` | which sensors, and why |
//! | `cross_validation` | errors of blocks that were left out |
//! | `noise` | residuals that remember |
//! | `regression` | multiple linear regression with intervals that hold |
//! | `lagged` | the same law late: time constant, hysteresis removed |
//! | `report`, `script_text` | what was learned in words, and as a script |
//! | `learn` | all of it, and which law to use |
//! | `law` | which temperatures, with what weight, late by how much |
//! | `predictor` | the law at work: error, uncertainty, residual, outside the range |
//! | `follow` | a law that readings of a probe correct, by bounded steps |
//! | `model` | the law as a file that the box runs |
//! | `sensor_model`, `sensor_watch` | what a sensor should read from the others; which are believed, and what stands in |
//! | `compensation` | clamp, dead band, slew, increments that add up |
//! | `quadrature` | encoder lines A and B, and a decoder |
//! | `pulse_insertion` | extra pulses between encoder and controller |

#[cfg(test)]
mod bed;
mod compensation;
mod course;
mod cross_validation;
mod follow;
mod grey;
mod lagged;
mod law;
mod learn;
mod model;
mod noise;
mod predictor;
mod pulse_insertion;
mod quadrature;
mod quantities;
mod recording;
mod regression;
mod report;
mod script_text;
mod selection;
mod sensor_model;
mod sensor_watch;

pub use compensation::{
    AxisSituation, CompensationSettingError, CompensationSettings, CompensationStep, Compensator, Standing,
};
pub use course::{Course, Sensor};
pub use cross_validation::HeldOut;
pub use follow::{Corrected, Correction, FollowSettings, HoldReason, ThermalFollower};
pub use grey::{Grade, Grades, Normalisation, RHO_USUAL, compute_grades};
pub use law::{POINTS_MAX, Path, TERMS_MAX, ThermalLaw, ThermalTerm, first_order};
pub use learn::{CandidateLaw, ThermalLearned, learn_law};
pub use model::{SCHEMA as MODEL_SCHEMA, ThermalModel};
pub use predictor::{NoPrediction, Outside, PredictedAndMeasured, Predictor, ThermalPrediction};
pub use pulse_insertion::{InsertionFault, PulseInserter, SignalEdge};
pub use quadrature::{Decoder, EDGES_PER_PULSE, IllegalTransition, Lines};
pub use quantities::Series;
pub use recording::{LeftOut, ThermalRows, collect_rows};
pub use regression::{Autocorrelation, ThermalCoefficient, ThermalFit, fit_static};
pub use selection::{GradeChoice, Selection, SelectionSettings, SensorVerdict, select_sensors};
pub use sensor_model::SensorModel;
pub use sensor_watch::{DoubtedSensor, SensorFault, SensorWatch};
