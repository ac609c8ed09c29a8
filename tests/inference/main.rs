//! What nobody measures: states, coefficients and missing physics, against machines whose truth is known and against published
//! numbers.

mod commission;
mod concealed;
mod diagnose_cli;
mod estimators;
mod identify;
mod long_recording;
mod published;
mod second_round;
