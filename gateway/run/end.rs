//! The end of `run`: a signal, or a tick that has ended by itself; then the last commit, which waits for the sinks.

use super::outputs::ConfiguredSinks;
use crate::signals::{SignalRequest, Signals};
use gateway_base::log::{Notice, Severity};
use gateway_status::Published;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::watch;

/// What the rest of the process asks of the tick, which sees it at its next turn.
#[derive(Debug, Default)]
pub struct RunFlags {
    /// Finish this tick and end.
    pub stop: AtomicBool,
    /// The scripts are to be read again.
    pub reload: AtomicBool,
}

/// Returns when a signal has said stop, or the tick has ended by itself, and the history is closed.
pub(super) async fn wait_for_end(
    run_flags: &RunFlags,
    mut signals: Option<&mut Signals>,
    outputs: Option<&ConfiguredSinks>,
    live: watch::Receiver<Option<Published>>,
) {
    tokio::select! {
        () = wait_for_stop(run_flags, signals.as_deref_mut()) => Notice::new(Severity::Info, "stopping", "stopping: the history is being closed").write_to_logs(),
        () = until_closed(live.clone()) => {}
    }
    run_flags.stop.store(true, Ordering::SeqCst);
    // The last commit of the history waits for the sinks; who asks twice does not want to wait.
    tokio::select! {
        () = wait_for_stop(run_flags, signals) => outputs.into_iter().for_each(|outputs| outputs.outbox.set_hurried(true)),
        () = until_closed(live.clone()) => {}
    }
    until_closed(live).await;
}

/// Returns when a signal says stop.
async fn wait_for_stop(run_flags: &RunFlags, signals: Option<&mut Signals>) {
    let Some(signals) = signals else { return std::future::pending().await };
    loop {
        match signals.next().await {
            SignalRequest::Stop => return,
            SignalRequest::Reload => run_flags.reload.store(true, Ordering::SeqCst),
        }
    }
}

/// Returns when the tick has ended and nothing will be published any more.
async fn until_closed(mut live: watch::Receiver<Option<Published>>) {
    while live.changed().await.is_ok() {}
}
