//! `cnc-gateway metrics`: what a plant with Prometheus and Grafana loads.

use super::{CommandOutcome, CommandResult, print_text};
use crate::monitoring::{ALERTS, DASHBOARD, DASHBOARD_FLEET, PROVISIONING};
use clap::Subcommand;

/// What is asked for.
#[derive(Debug, Clone, Copy, Subcommand)]
pub(super) enum Metrics {
    /// Print the Grafana dashboard (JSON; Dashboards, New, Import).
    Dashboard,
    /// Print the Grafana dashboard of the database of many boxes (JSON; its data source is PostgreSQL).
    DashboardFleet,
    /// Print the files with which Grafana sets up data sources and dashboards by itself (YAML).
    Provisioning,
    /// Print the alert rules of Prometheus (YAML; `rule_files`).
    Alerts,
}

pub(super) fn run(metrics: Metrics) -> CommandResult {
    print_text(match metrics {
        Metrics::Dashboard => DASHBOARD,
        Metrics::DashboardFleet => DASHBOARD_FLEET,
        Metrics::Provisioning => PROVISIONING,
        Metrics::Alerts => ALERTS,
    });
    Ok(CommandOutcome::Fine)
}
