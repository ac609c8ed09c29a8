//! Names that nobody else has: of clients, inboxes, files.

/// Twelve hexadecimal digits that differ between processes, threads and calls.
#[must_use]
pub fn generate_unique_id() -> String {
    use std::hash::{BuildHasher, Hasher, RandomState};
    format!("{:012x}", RandomState::new().build_hasher().finish() & 0xffff_ffff_ffff)
}
