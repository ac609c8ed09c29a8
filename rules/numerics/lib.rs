//! Numerical methods shared by the estimators and the twin: least squares of small dense problems robust statistics, and the
//! weights of powers that are known at some speeds.

pub mod linear;
pub mod speed_weights;
pub mod statistics;
