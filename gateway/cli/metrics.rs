//! `cnc-gateway metrics`: what a plant with Prometheus and Grafana loads.

use super::{CommandOutcome, CommandResult, print};
use crate::monitoring::{ALERTS, DASHBOARD};
use clap::Subcommand;

/// What is asked for.
#[derive(Debug, Clone, Copy, Subcommand)]
pub(super) enum Metrics {
    /// Print the Grafana dashboard (JSON; Dashboards, New, Import).
    Dashboard,
    /// Print the alert rules of Prometheus (YAML; `rule_files`).
    Alerts,
}

/// Prints it.
pub(super) fn run(metrics: Metrics) -> CommandResult {
    print(match metrics {
        Metrics::Dashboard => DASHBOARD,
        Metrics::Alerts => ALERTS,
    });
    Ok(CommandOutcome::Fine)
}
