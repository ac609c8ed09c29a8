//! Work off the threads that serve.

use super::problem::ApiProblem;

/// Runs what waits for a disk or computes, off the threads that serve.
pub(super) async fn run_blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ApiProblem> + Send + 'static,
) -> Result<T, ApiProblem> {
    tokio::task::spawn_blocking(work).await.map_err(|_| ApiProblem::internal_error())?
}
