//! `[[sink]]` and `[outbox]`: from checked values to the configuration.

use super::SinkConfig;
use super::build::{as_text, find_number, find_text, origin_of_name, source_name};
use super::check_value::Scalar;
use super::read::{ConfigInput, Origin, SectionValues};
use adapters::channel::{CHANNELS, find_nearest_name};
use gateway_history::OutboxSettings;
use gateway_sinks::SinkAddress;
use std::time::Duration;

/// The sinks; names that are there twice are reported.
pub(super) fn build_sinks(reading: &mut ConfigInput<'_>) -> Option<Vec<SinkConfig>> {
    let sinks: Option<Vec<SinkConfig>> = reading.sinks.iter().map(build_sink).collect();
    needs_a_way_in(reading, "allow_requests", ("nothing can be asked for", "mqtts:// or sparkplugs://"), |address| {
        address.can_receive_requests()
    });
    needs_a_way_in(reading, "allow_facts", ("no facts can be told", "mqtts://"), SinkAddress::can_receive_facts);
    places_need_a_path(reading);
    let names: Vec<Option<String>> = reading.sinks.iter().map(source_name).collect();
    for (index, name) in names.iter().enumerate().filter(|(_, name)| name.is_some()) {
        if names[..index].contains(name) {
            let origin = origin_of_name(&reading.sinks[index]);
            let what = format!("there are two sinks named {:?}", name.clone().unwrap_or_default());
            reading.add_problem(&origin, what, "give each [[sink]] its own `name`");
        }
    }
    sinks
}

fn build_sink(values: &SectionValues) -> Option<SinkConfig> {
    let address = values.found.get("address").and_then(as_text)?.parse().ok()?;
    let allows = |key| allows(values, key);
    Some(SinkConfig {
        name: source_name(values)?,
        address,
        allow_requests: allows("allow_requests"),
        allow_facts: allows("allow_facts"),
    })
}

fn allows(values: &SectionValues, key: &str) -> bool {
    values.found.get(key).is_some_and(|found| found.value == Scalar::Flag(true))
}

/// Only through a broker can the network ask for something, or tell it. `words` say what cannot be done, and through which addresses it can.
fn needs_a_way_in(
    reading: &mut ConfigInput<'_>,
    key: &str,
    (what, schemes): (&str, &str),
    has_one: impl Fn(&SinkAddress) -> bool,
) {
    let origin = |values: &SectionValues| {
        let address: SinkAddress = values.found.get("address").and_then(as_text)?.parse().ok()?;
        let deaf = allows(values, key) && !has_one(&address);
        values.found.get(key).filter(|_| deaf).map(|found| (found.origin.clone(), address))
    };
    let deaf: Vec<_> = reading.sinks.iter().filter_map(origin).collect();
    for (origin, address) in deaf {
        let what = format!("`{key} = true`, but {what} through {}:", address.scheme());
        reading.add_problem(&origin, what, format!("leave it out, or use an {schemes} sink"));
    }
}

/// A sink whose address leaves the place of the machine to its path needs one.
fn places_need_a_path(reading: &mut ConfigInput<'_>) {
    if find_text(reading, "gateway", "path").is_some() {
        return;
    }
    let missing = |values: &SectionValues| {
        let found = values.found.get("address")?;
        let address: SinkAddress = as_text(found)?.parse().ok()?;
        Some((found.origin.clone(), address.find_need_of_path()?))
    };
    let missing: Vec<_> = reading.sinks.iter().filter_map(missing).collect();
    for (origin, (what, next)) in missing {
        reading.add_problem(&origin, what, next);
    }
}

/// What the sinks are sent.
pub(super) fn build_outbox(reading: &mut ConfigInput<'_>) -> Option<OutboxSettings> {
    let every_nth = find_number(reading, "outbox", "every_nth")?;
    let origin = reading.get("outbox", "every_nth").map_or(Origin::Default, |found| found.origin.clone());
    if every_nth.fract() != 0.0 {
        reading.add_problem(&origin, format!("`every_nth = {every_nth}` is no whole number"), "write 1, 2, 10, ...");
    }
    let (dead_bands, ranges) = (dead_bands(reading), parse_ranges(reading));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the table holds their ranges")]
    let (every_nth, max_bytes) = (every_nth as u32, (find_number(reading, "outbox", "max_gb")? * 1e9) as u64);
    Some(OutboxSettings {
        every_nth,
        dead_bands,
        ranges,
        refresh: Duration::from_secs_f64(find_number(reading, "outbox", "refresh_s")?),
        tick: Duration::from_secs_f64(1.0 / find_number(reading, "gateway", "tick_hz")?),
        drain: Duration::from_secs_f64(find_number(reading, "sinks", "drain_s")?),
        max_bytes,
        max_age: Duration::from_secs_f64(find_number(reading, "outbox", "max_age_h")? * 3600.0),
    })
}

/// `spindle_power_w=5, feed_mm_min=1`; what is wrong is reported.
fn dead_bands(reading: &mut ConfigInput<'_>) -> Vec<(String, f64)> {
    let band = |text: &str| text.parse::<f64>().ok().filter(|band| band.is_finite() && *band >= 0.0);
    named_values(reading, "dead_band", ("a number from 0 up", "spindle_power_w=5, feed_mm_min=1"), band)
}

/// `spindle_speed_rpm=0..4500`; what is wrong is reported.
fn parse_ranges(reading: &mut ConfigInput<'_>) -> Vec<(String, (f64, f64))> {
    let range = |text: &str| {
        let (low, high) = text.split_once("..")?;
        let (low, high) = (low.trim().parse::<f64>().ok()?, high.trim().parse::<f64>().ok()?);
        (low.is_finite() && high.is_finite() && low < high).then_some((low, high))
    };
    named_values(reading, "ranges", ("a range", "spindle_speed_rpm=0..4500, spindle_power_w=-5000..15000"), range)
}

/// The values of a key `NAME=VALUE, NAME=VALUE`, each name a series. `form` says what a value is, and gives an example.
fn named_values<T>(
    reading: &mut ConfigInput<'_>,
    key: &str,
    form: (&str, &str),
    value: impl Fn(&str) -> Option<T>,
) -> Vec<(String, T)> {
    let Some(written) = find_text(reading, "outbox", key) else { return Vec::new() };
    let origin = reading.get("outbox", key).map_or(Origin::Default, |found| found.origin.clone());
    let mut values = Vec::new();
    for part in written.split(',').map(str::trim).filter(|part| !part.is_empty()) {
        match named_value(part, key, form, &value) {
            Ok(value) => values.push(value),
            Err((what, next)) => reading.add_problem(&origin, what, next),
        }
    }
    values
}

fn named_value<T>(
    part: &str,
    key: &str,
    (kind, example): (&str, &str),
    value: impl Fn(&str) -> Option<T>,
) -> Result<(String, T), (String, String)> {
    let form = format!("write \"{example}\"");
    let (name, written) = part.split_once('=').ok_or_else(|| (format!("`{key}` holds {part:?}"), form.clone()))?;
    let (name, written) = (name.trim(), written.trim());
    let value =
        value(written).ok_or_else(|| (format!("`{key}` of {name} is {written:?}, which is not {kind}"), form))?;
    let stored: Vec<String> = gateway_pipeline::stored_series().into_iter().map(|series| series.name).collect();
    let names = || CHANNELS.iter().map(|channel| channel.name).chain(stored.iter().map(String::as_str));
    if !names().any(|known| known == name) {
        let next = match find_nearest_name(name, names()) {
            Some(near) => format!("did you mean {near}?"),
            None => "`cnc-gateway check --vocabulary` prints the names".to_owned(),
        };
        return Err((format!("`{key}` names {name}, which is no channel"), next));
    }
    Ok((name.to_owned(), value))
}
