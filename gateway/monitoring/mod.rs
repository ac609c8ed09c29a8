//! What a plant that runs Prometheus and Grafana loads: a dashboard, and alert rules. The values come from `GET /metrics`.

/// A dashboard of Grafana for any number of gateways.
pub const DASHBOARD: &str = include_str!("dashboard.json");
/// Alert rules of Prometheus.
pub const ALERTS: &str = include_str!("alerts.yml");
