//! Which numbers a channel can have.

/// Which numbers a channel can have, for receivers that tell them apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Any number within the range.
    Real,
    /// Whole numbers within the range.
    Whole,
    /// 0 for no, 1 for yes.
    Flag,
}
