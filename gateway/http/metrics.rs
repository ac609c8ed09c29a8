//! `GET /metrics`: the status for Prometheus. Names end in base units, counters in `_total`; a missing value is no
//! sample, never a zero.

use super::ServerState;
use super::problem::ApiProblem;
use super::route::Route;
use adapters::histogram::Histogram;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use axum::routing::get;
use gateway_base::machine_path::MachinePath;
use gateway_sinks::SinkStatus;
use gateway_status::alignment::AlignmentStatus;
use gateway_status::{NumberOrWord, Status};
use std::fmt::Write;

/// Our unit suffix, the base unit of Prometheus, and the factor to it.
const BASE_UNITS: [(&str, &str, f64); 12] = [
    ("_cm3_min", "_cubic_meters_per_second", 1e-6 / 60.0),
    ("_mm_min", "_meters_per_second", 1e-3 / 60.0),
    ("_per_rev_mm", "_per_revolution_meters", 1e-3),
    ("_mm", "_meters", 1e-3),
    ("_um", "_meters", 1e-6),
    ("_pct", "_ratio", 1e-2),
    ("_w", "_watts", 1.0),
    ("_a", "_amperes", 1.0),
    ("_v", "_volts", 1.0),
    ("_c", "_celsius", 1.0),
    ("_n", "_newtons", 1.0),
    ("_count", "s_counted", 1.0),
];

/// Name and factor of a quantity in base units.
fn to_base_unit(name: &str) -> (String, f64) {
    let found = BASE_UNITS.iter().find_map(|(ours, theirs, factor)| Some((name.strip_suffix(ours)?, theirs, factor)));
    match found {
        Some((stem, theirs, factor)) => (format!("cncgw_{stem}{theirs}"), *factor),
        None => (format!("cncgw_{name}"), 1.0),
    }
}

/// The text being built.
#[derive(Default)]
struct Page(String);

impl Page {
    /// One family with its samples: pairs of labels (`a="b"`, may be empty) and value.
    fn write_family(&mut self, name: &str, kind: &str, help: &str, samples: impl IntoIterator<Item = (String, f64)>) {
        let mut samples = samples.into_iter().peekable();
        if samples.peek().is_none() {
            return;
        }
        let _written = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}");
        for (labels, value) in samples {
            let labels = if labels.is_empty() { labels } else { format!("{{{labels}}}") };
            let _written = writeln!(self.0, "{name}{labels} {value}");
        }
    }

    /// One histogram for each pair of labels and durations.
    fn write_histograms(&mut self, name: &str, help: &str, each: &[(String, Histogram)]) {
        let mut counted = each.iter().filter(|(_, histogram)| histogram.count() > 0).peekable();
        if counted.peek().is_none() {
            return;
        }
        let _written = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} histogram");
        for (labels, histogram) in counted {
            let comma = if labels.is_empty() { "" } else { "," };
            for (end_s, count) in histogram.cumulative_counts() {
                let _written = writeln!(self.0, "{name}_bucket{{{labels}{comma}le=\"{end_s}\"}} {count}");
            }
            let (count, sum_s) = (histogram.count(), histogram.sum_s());
            let _written = writeln!(self.0, "{name}_bucket{{{labels}{comma}le=\"+Inf\"}} {count}");
            let labels = if labels.is_empty() { String::new() } else { format!("{{{labels}}}") };
            let _written = writeln!(self.0, "{name}_sum{labels} {sum_s}\n{name}_count{labels} {count}");
        }
    }

    fn write_gauge(&mut self, name: &str, help: &str, value: f64) {
        self.write_family(name, "gauge", help, [(String::new(), value)]);
    }

    #[expect(clippy::cast_precision_loss, reason = "a counter beyond 2^53 may lose its last digit")]
    fn write_counter(&mut self, name: &str, help: &str, value: u64) {
        self.write_family(name, "counter", help, [(String::new(), value as f64)]);
    }
}

fn format_label(name: &str, value: &str) -> String {
    let value = value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n");
    format!("{name}=\"{value}\"")
}

/// Which machine this is: its name, and where it has a path, the path and each of its levels. The level of the machine itself is
/// `machine_id`, because `machine` is the name.
fn format_identity(status: &Status) -> String {
    let name = |level: &'static str| if level == "machine" { "machine_id" } else { level };
    let levels = status.path.iter().flat_map(MachinePath::list_levels);
    let place = status.path.iter().map(|path| format_label("path", &path.format_topic()));
    [format_label("version", status.version), format_label("machine", &status.machine)]
        .into_iter()
        .chain(place)
        .chain(levels.map(|(level, word)| format_label(name(level), word)))
        .collect::<Vec<_>>()
        .join(",")
}

fn write_quantities(page: &mut Page, status: &Status) {
    for channel in &status.channels {
        if let Some(NumberOrWord::Number(value)) = channel.value {
            let (name, factor) = to_base_unit(channel.name);
            let help = adapters::ChannelId::from_name(channel.name).map_or("Measured", |id| id.channel().en);
            page.write_gauge(&name, help, value * factor);
        }
    }
    for estimate in &status.estimates {
        if let (Some(value), Some(uncertainty)) = (estimate.value, estimate.uncertainty) {
            let (name, factor) = to_base_unit(estimate.name);
            page.write_gauge(&name, "Inferred, see /api/v1/channels", value * factor);
            let (stem, unit) = estimate.name.rsplit_once('_').unwrap_or((estimate.name, "w"));
            let (name, factor) = to_base_unit(&format!("{stem}_uncertainty_{unit}"));
            page.write_gauge(&name, "Half the 95 % interval of the inferred value", uncertainty * factor);
        }
    }
    let present = status
        .channels
        .iter()
        .map(|channel| (format_label("channel", channel.name), f64::from(u8::from(channel.missing.is_none()))));
    page.write_family(
        "cncgw_channel_present",
        "gauge",
        "1 when the channel has a value, 0 when it has a reason for none",
        present,
    );
}

#[expect(clippy::cast_precision_loss, reason = "a counter beyond 2^53 may lose its last digit")]
fn write_sources(page: &mut Page, status: &Status) {
    let each = |value: fn(&gateway_status::SourceStatus) -> Option<f64>| {
        status
            .sources
            .iter()
            .filter_map(move |source| Some((format_label("source", &source.name), value(source)?)))
            .collect::<Vec<_>>()
    };
    let up = each(|source| Some(f64::from(u8::from(source.error.is_none()))));
    page.write_family("cncgw_source_up", "gauge", "1 while the source answers", up);
    let readings = each(|source| Some(source.readings as f64));
    page.write_family("cncgw_source_readings_total", "counter", "Readings taken from the source", readings);
    let failures = each(|source| Some(source.failures as f64));
    page.write_family("cncgw_source_failures_total", "counter", "Polls of the source that failed", failures);
    let missed = each(|source| Some(source.missed as f64));
    page.write_family("cncgw_source_missed_total", "counter", "Beats left out because a poll took too long", missed);
    let dropped = each(|source| Some(source.dropped as f64));
    page.write_family(
        "cncgw_source_dropped_total",
        "counter",
        "Readings that came too late or wrongly stamped",
        dropped,
    );
    let jitter = each(|source| source.jitter_p99_ms.map(|ms| ms / 1e3));
    page.write_family(
        "cncgw_source_jitter_p99_seconds",
        "gauge",
        "Deviation from the promised pace, 99th percentile",
        jitter,
    );
    let trip = each(|source| source.round_trip_p50_ms.map(|ms| ms / 1e3));
    page.write_family("cncgw_source_round_trip_median_seconds", "gauge", "From asking to answer, median", trip);
    let lag = each(|source| source.lag_s);
    page.write_family("cncgw_source_lag_seconds", "gauge", "Since the last poll that succeeded", lag);
    let trips: Vec<_> = status.sources.iter().map(|one| (format_label("source", &one.name), one.round_trips)).collect();
    page.write_histograms("cncgw_source_round_trip_seconds", "From asking to answer", &trips);
}

#[expect(clippy::cast_precision_loss, reason = "a counter beyond 2^53 may lose its last digit")]
fn write_sinks(page: &mut Page, status: &Status) {
    let each = |value: fn(&SinkStatus) -> Option<f64>| {
        let of = |sink: &SinkStatus| Some((format_label("sink", &sink.name), value(sink)?));
        status.sinks.iter().filter_map(of).collect::<Vec<_>>()
    };
    let up = each(|sink| Some(f64::from(u8::from(sink.state == "connected" && !sink.failing))));
    page.write_family("cncgw_sink_up", "gauge", "1 while the receiver takes what is sent", up);
    let behind = each(|sink| Some(sink.behind_items as f64));
    page.write_family("cncgw_sink_behind_items", "gauge", "Items that are not delivered", behind);
    let lag = each(|sink| sink.behind_s);
    page.write_family(
        "cncgw_sink_lag_seconds",
        "gauge",
        "How much older than the newest the oldest undelivered item is",
        lag,
    );
    let delivered = each(|sink| Some(sink.delivered as f64));
    page.write_family("cncgw_sink_delivered_total", "counter", "Items delivered since the start", delivered);
    let dropped = each(|sink| Some(sink.dropped as f64));
    page.write_family("cncgw_sink_dropped_total", "counter", "Items that the bounds of the outbox dropped", dropped);
    let refused = each(|sink| Some(sink.refused as f64));
    page.write_family("cncgw_sink_refused_total", "counter", "Items that the receiver will never take", refused);
    let connections = each(|sink| Some(sink.connections as f64));
    page.write_family("cncgw_sink_connections_total", "counter", "Connections since the start", connections);
    let fits = each(|sink| sink.outage_fits_h.map(|hours| hours * 3600.0));
    page.write_family("cncgw_sink_outage_fits_seconds", "gauge", "How long an outage fits at the present rate", fits);
    let delays: Vec<_> = status.sinks.iter().map(|one| (format_label("sink", &one.name), one.delays)).collect();
    page.write_histograms("cncgw_sink_delay_seconds", "From the time of a value to its delivery, live data", &delays);
}

fn write_alignment(page: &mut Page, status: &Status) {
    let each = |value: fn(&AlignmentStatus) -> Option<f64>| {
        let of = |one: &AlignmentStatus| Some((format_label("power", one.power), value(one)?));
        status.alignment.iter().filter_map(of).collect::<Vec<_>>()
    };
    let known = each(|one| Some(f64::from(u8::from(one.lag_s.is_some()))));
    page.write_family(
        "cncgw_meter_lag_known",
        "gauge",
        "1 while the lag of the meter behind the controller is known",
        known,
    );
    let lag = each(|one| one.lag_s);
    page.write_family("cncgw_meter_lag_seconds", "gauge", "How much later the meter is than the controller", lag);
    let width = each(|one| one.uncertainty_s);
    page.write_family("cncgw_meter_lag_uncertainty_seconds", "gauge", "Half the 95 % interval of the lag", width);
    let window = each(|one| one.window_s);
    page.write_family("cncgw_meter_window_seconds", "gauge", "How long the meter averages", window);
    let drift = each(|one| one.drift_ppm.map(|ppm| 1e-6 * ppm));
    page.write_family("cncgw_meter_lag_drift_ratio", "gauge", "Change of the lag over time", drift);
    let applied = each(|one| Some(one.applied_s));
    page.write_family("cncgw_meter_lag_applied_seconds", "gauge", "What the meter's readings are put back by", applied);
}

fn write_machine(page: &mut Page, status: &Status) {
    let current = [(format_label("state", status.state.word), 1.0)];
    page.write_family("cncgw_machine_state", "gauge", "1 for the state the machine is in", current);
    let seconds = status.state.seconds_per_state.iter().map(|(word, s)| (format_label("state", word), *s));
    page.write_family(
        "cncgw_machine_state_seconds_total",
        "counter",
        "Machine time spent in each state since the start",
        seconds,
    );
    page.write_counter("cncgw_parts_total", "Parts finished since the start", status.parts);
    let energies = status.energies.iter().map(|energy| (format_label("channel", energy.channel), energy.joules));
    page.write_family(
        "cncgw_energy_joules_total",
        "counter",
        "Energy drawn since the start, by the power it is counted from",
        energies,
    );
    page.write_gauge("cncgw_alarms", "Alarms that stand", status.alarms.len() as f64);
    page.write_gauge(
        "cncgw_gate_armed",
        "1 while overrides are written to the machine",
        f64::from(u8::from(status.gate.mode == "armed")),
    );
    if let Some(pct) = status.gate.wanted_pct {
        page.write_gauge("cncgw_feed_override_wanted_ratio", "Feed override the scripts ask for", pct / 100.0);
    }
    if let Some(pct) = status.gate.permitted_pct {
        page.write_gauge(
            "cncgw_feed_override_permitted_ratio",
            "Feed override the gate lets through or would",
            pct / 100.0,
        );
    }
}

fn write_process(page: &mut Page, status: &Status) {
    page.write_family(
        "cncgw_build_info",
        "gauge",
        "Version of the program, and name of the machine",
        [(format_identity(status), 1.0)],
    );
    page.write_gauge("cncgw_uptime_seconds", "Seconds since the start of the process", status.uptime_s);
    page.write_counter("cncgw_ticks_total", "Ticks since the start", status.tick.count);
    page.write_counter("cncgw_ticks_skipped_total", "Ticks left out because the box was too late", status.tick.skipped);
    page.write_gauge(
        "cncgw_tick_lateness_p99_seconds",
        "Lateness of the tick, 99th percentile",
        status.tick.late_p99_ms / 1e3,
    );
    page.write_histograms("cncgw_tick_lateness_seconds", "Lateness of the ticks", &[(String::new(), status.tick.late)]);
    page.write_counter("cncgw_history_samples_total", "Samples acknowledged by the history", status.history.rows);
    page.write_counter("cncgw_history_lost_samples_total", "Samples that could not be stored", status.history.lost);
    page.write_gauge("cncgw_history_size_bytes", "Bytes of the history on disk", status.history.bytes as f64);
    let scripts =
        status.scripts.iter().map(|s| (format_label("script", &s.file), f64::from(u8::from(s.error.is_none()))));
    page.write_family("cncgw_script_current", "gauge", "1 when the newest text of the script is in charge", scripts);
    page.write_counter(
        "cncgw_log_lines_dropped_total",
        "Lines for standard output and standard error left out because nobody read them",
        gateway_base::log::count_dropped_lines(),
    );
    page.write_gauge("cncgw_problems", "Things that do not work while the box goes on", status.problems.len() as f64);
    if let Some(usage) = gateway_base::usage::read() {
        page.write_gauge("process_resident_memory_bytes", "Resident memory", usage.resident_bytes as f64);
        page.write_family("process_cpu_seconds_total", "counter", "Processor time", [(String::new(), usage.cpu_s)]);
    }
}

/// The status as Prometheus text (exposition format 0.0.4).
#[must_use]
pub fn render_metrics(status: &Status) -> String {
    let mut page = Page::default();
    write_machine(&mut page, status);
    write_quantities(&mut page, status);
    write_sources(&mut page, status);
    write_sinks(&mut page, status);
    write_alignment(&mut page, status);
    write_process(&mut page, status);
    page.0
}

pub(super) const ROUTES: &[Route] = &[Route::read("/metrics", || get(serve_metrics))];

/// `GET /metrics`: the status in the text format of Prometheus.
pub(super) async fn serve_metrics(State(shared): State<ServerState>) -> Result<impl IntoResponse, ApiProblem> {
    let text = render_metrics(&*shared.require_status()?);
    Ok(([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text))
}
