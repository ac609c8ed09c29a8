//! Numerical methods shared by the estimators and the twin: least squares of small dense problems and robust statistics.

pub mod linear;
pub mod statistics;
