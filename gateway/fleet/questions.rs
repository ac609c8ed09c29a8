//! What a shop asks of many machines, in SQL: printed by `fleet sql`, and run by the tests against what the boxes know.

/// A query over the machines of the fleet database or of the lake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FleetQuestion {
    /// Name on the command line.
    pub name: &'static str,
    /// The whole query, with a comment that says what it asks.
    pub sql: &'static str,
}

macro_rules! questions {
    ($($name:literal => $file:literal),* $(,)?) => {
        /// Every question; those whose names end in `-parquet` are for the lake.
        pub const QUESTIONS: &[FleetQuestion] =
            &[$(FleetQuestion { name: $name, sql: include_str!(concat!("questions/", $file, ".sql")) }),*];
    };
}

questions! {
    "mean-by-machine" => "mean_by_machine",
    "power-while-cutting" => "power_while_cutting",
    "series-over-machines" => "series_over_machines",
    "machines-now" => "machines_now",
    "states-by-machine" => "states_by_machine",
    "energy-by-day" => "energy_by_day",
    "energy-per-part" => "energy_per_part",
    "energy-per-operation" => "energy_per_operation",
    "energy-per-order" => "energy_per_order",
    "oee-per-shift" => "oee_per_shift",
    "stops-by-reason" => "stops_by_reason",
    "alarms-by-code" => "alarms_by_code",
    "same-finding" => "same_finding",
    "same-finding-parquet" => "same_finding_parquet",
    "mean-by-machine-parquet" => "mean_by_machine_parquet",
    "mean-by-machine-clickhouse" => "mean_by_machine_clickhouse",
}

/// The question of this name.
#[must_use]
pub fn of_name(name: &str) -> Option<&'static FleetQuestion> {
    QUESTIONS.iter().find(|question| question.name == name)
}
