//! What is inferred: estimators invert the laws of [`crate::physics`].
