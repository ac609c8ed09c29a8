//! How items look on their topics. Pure.
//!
//! | layout | topic | payload |
//! |---|---|---|
//! | `items` | `PREFIX/KIND` | the document of the item ([`Item::to_json`]) with `machine`, `box` and `historical` |
//! | `flat` | `PREFIX/KIND` | one object: `ts` (milliseconds since 1970), `machine`, `box`, `sequence`, `historical`, and every value or field by its name; a missing value is null |
//! | `topics` | `PREFIX/NAME` for each value | the value alone, as text; nothing for a missing one. Records and means as in `flat` |
//! | `uns` | `PREFIX/PATH/NAME`, or `PATH/NAME` without a prefix | as `topics`: one name space for a plant, in which a machine stands by its path |
//!
//! Documents hold the `path` of the machine where there is one.
//!
//! What a subscriber that comes late must know is retained: the newest state, part and diagnosis, with `topics` the newest value of
//! each channel, and in every layout `PREFIX/latest` ([`build_latest_message`]).

use adapter_core::clock::TimeNs;
use gateway_base::moment;
use gateway_history::{Cell, Content, Gap, Item, Outbox, Reading, SeriesMean};
use mqtt::Outgoing;
use serde_json::{Map, Value as Json, json};

/// How items look on their topics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// The document of each item.
    Items,
    /// One flat object for each item.
    Flat,
    /// A topic for each value.
    Topics,
    /// The same below the path of the machine.
    Uns,
}

impl Layout {
    /// Has each value a topic of its own?
    pub(super) fn divides_values(self) -> bool {
        matches!(self, Self::Topics | Self::Uns)
    }
}

/// Kinds whose newest message the broker keeps.
const RETAINED: [&str; 3] = ["state", "part", "diagnosis"];

/// The document of an item, with who made it and whether it comes late.
pub(crate) fn build_document(outbox: &Outbox, item: &Item, historical: bool) -> Json {
    let mut document = item.to_json();
    document["machine"] = Json::from(outbox.machine());
    document["box"] = Json::from(outbox.box_id());
    if let Some(path) = outbox.path() {
        document["path"] = Json::from(path.format_topic());
    }
    document["historical"] = Json::from(historical);
    document
}

/// The messages of an item under this prefix.
pub(super) fn build_messages(
    layout: Layout,
    outbox: &Outbox,
    prefix: &str,
    item: &Item,
    historical: bool,
) -> Vec<Outgoing> {
    let whole = |document: Json| Outgoing {
        topic: format!("{prefix}/{}", item.kind()),
        payload: document.to_string().into_bytes(),
        retain: !historical && RETAINED.contains(&item.kind()),
    };
    match (layout, &item.content) {
        (Layout::Items, _) => vec![whole(build_document(outbox, item, historical))],
        // An old value must not take the place of a newer one that the broker keeps.
        (_, Content::Sample(readings)) if layout.divides_values() && !historical => {
            readings.iter().map(|reading| build_value_message(prefix, reading)).collect()
        }
        _ => vec![whole(build_flat_document(outbox, item, historical))],
    }
}

/// The newest value of a channel on its own topic.
pub(super) fn build_value_message(prefix: &str, reading: &Reading) -> Outgoing {
    let payload = match &reading.value {
        Cell::Number(number) => number.to_string(),
        Cell::Text(text) => text.to_string(),
        // An empty message takes away what the broker keeps.
        Cell::Missing(_) => String::new(),
    };
    Outgoing { topic: format!("{prefix}/{}", reading.series.name), payload: payload.into_bytes(), retain: true }
}

fn build_flat_document(outbox: &Outbox, item: &Item, historical: bool) -> Json {
    let mut fields = build_common_fields(outbox, item.at_ns);
    fields.insert("sequence".to_owned(), json!(item.sequence));
    fields.insert("epoch".to_owned(), json!(item.epoch));
    fields.insert("historical".to_owned(), json!(historical));
    match &item.content {
        Content::Sample(readings) => fields.extend(readings.iter().map(to_named_value)),
        Content::Record(_) => {
            if let Json::Object(record) = item.to_json()["record"].take() {
                fields.extend(record.into_iter().filter(|(name, _)| name != "at_ns"));
            }
        }
        Content::Gap(Gap { until_ns, reason }) => {
            fields.insert("until_ns".to_owned(), json!(until_ns));
            fields.insert("reason".to_owned(), json!(&**reason));
        }
        Content::Means { width_s, means } => {
            fields.insert("width_s".to_owned(), json!(width_s));
            fields.extend(means.iter().map(|SeriesMean { series, mean, .. }| (series.name.to_string(), json!(mean))));
        }
    }
    Json::Object(fields)
}

fn build_common_fields(outbox: &Outbox, at_ns: TimeNs) -> Map<String, Json> {
    let fields = [
        ("ts", json!(at_ns.div_euclid(1_000_000))),
        ("machine", json!(outbox.machine())),
        ("box", json!(outbox.box_id())),
    ];
    let path = outbox.path().map(|path| ("path", json!(path.format_topic())));
    fields.into_iter().chain(path).map(|(name, value)| (name.to_owned(), value)).collect()
}

fn to_named_value(reading: &Reading) -> (String, Json) {
    let value = match &reading.value {
        Cell::Number(number) => json!(number),
        Cell::Text(text) => json!(&**text),
        Cell::Missing(_) => Json::Null,
    };
    (reading.series.name.to_string(), value)
}

/// Everything that is known now, retained on `PREFIX/latest`: `values` by name, `missing` with the reason, and the codes of the
/// alarms that stand.
pub(super) fn build_latest_message<'a>(
    outbox: &Outbox,
    prefix: &str,
    alarms: impl Iterator<Item = &'a String>,
) -> Outgoing {
    let at_ns = outbox.watch_head().borrow().newest_ns.unwrap_or(0);
    let readings = outbox.latest_readings();
    let delivered = |reading: &&Reading| !is_unprovided(reading);
    let is_missing = |reading: &&Reading| matches!(reading.value, Cell::Missing(_));
    let reason = |reading: &Reading| match &reading.value {
        Cell::Missing(reason) => Some((reading.series.name.to_string(), json!(&**reason))),
        _ => None,
    };
    let mut document = build_common_fields(outbox, at_ns);
    let present = readings.iter().filter(|reading| !is_missing(reading));
    document.insert("time_utc".to_owned(), json!(moment::format_utc(at_ns)));
    document.insert("values".to_owned(), Json::Object(present.map(to_named_value).collect()));
    document.insert("missing".to_owned(), Json::Object(readings.iter().filter(delivered).filter_map(reason).collect()));
    document.insert("alarms".to_owned(), alarms.map(|code| json!(code)).collect());
    Outgoing {
        topic: format!("{prefix}/latest"),
        payload: Json::Object(document).to_string().into_bytes(),
        retain: true,
    }
}

/// Nobody provides it on this machine.
pub(super) fn is_unprovided(reading: &Reading) -> bool {
    matches!(&reading.value, Cell::Missing(reason) if **reason == *"not_provided")
}
