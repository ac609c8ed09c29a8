//! What the tick hands over to whoever shows it.

use super::Status;
use std::sync::Arc;
use std::time::Instant;

/// The latest status and when it came.
#[derive(Debug, Clone)]
pub struct Published {
    /// The document of `/api/v1/status`.
    pub status: Arc<Status>,
    /// When it was published, on the monotonic clock of this process.
    pub at: Instant,
}
