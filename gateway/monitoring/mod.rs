//! What a plant that runs Prometheus and Grafana loads: dashboards and alert rules. The values come from `GET /metrics`, or from the
//! database of many boxes.

/// A dashboard of Grafana for any number of gateways.
pub const DASHBOARD: &str = include_str!("dashboard.json");
/// Alert rules of Prometheus.
pub const ALERTS: &str = include_str!("alerts.yml");
/// A dashboard of Grafana for the database of `fleet ingest`.
pub const DASHBOARD_FLEET: &str = include_str!("dashboard_fleet.json");
/// Data sources and dashboards as Grafana provisions them.
pub const PROVISIONING: &str = include_str!("provisioning.yml");
