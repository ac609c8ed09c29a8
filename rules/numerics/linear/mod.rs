//! Linear algebra of the estimators and of the twin, for small dense problems.
//!
//! | file | what | when |
//! |---|---|---|
//! | `orthogonal` | Householder QR of scaled columns, singular values | a fit of a few columns whose coefficients a person reads: it tells how well they are determined |
//! | `columns` | modified Gram-Schmidt on long columns, least squares that drop collinear ones | many candidate columns, each thousands of rows long |
//! | `cholesky` | normal equations summed row by row | a fit that is repeated for hundreds of lags over the same rows, where the columns are never held |

pub mod cholesky;
pub mod columns;
pub mod orthogonal;
