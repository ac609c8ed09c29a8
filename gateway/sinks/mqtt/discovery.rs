//! What Home Assistant, and others that follow its notation, must know to show the machine by itself. Pure.
//!
//! Source: Home Assistant, "MQTT Discovery" and "MQTT Sensor": a retained document for each sensor on
//! `homeassistant/sensor/BOX/NAME/config`.

use gateway_history::{Outbox, Reading, SeriesKind};
use mqtt::Outgoing;
use serde_json::{Value as Json, json};

/// Units as Home Assistant writes them, with its word for the quantity.
const CLASSES: [(&str, &str); 6] =
    [("W", "power"), ("A", "current"), ("V", "voltage"), ("°C", "temperature"), ("s", "duration"), ("J", "energy")];

/// The document of a series whose values stand on `PREFIX/NAME`.
pub(super) fn build_sensor_document(outbox: &Outbox, prefix: &str, reading: &Reading) -> Outgoing {
    let (series, box_id) = (&reading.series, outbox.box_id());
    let mut document = json!({
        "name": &*series.en,
        "unique_id": format!("{box_id}_{}", series.name),
        "object_id": format!("{box_id}_{}", series.name),
        "state_topic": format!("{prefix}/{}", series.name),
        "availability_topic": format!("{prefix}/online"),
        "availability_template": "{{ 'online' if value_json.online else 'offline' }}",
        "device": {"identifiers": [box_id], "name": outbox.machine(), "manufacturer": "cnc-gateway"},
    });
    if series.kind == SeriesKind::Number {
        document["state_class"] = json!("measurement");
        if *series.unit != *"1" {
            document["unit_of_measurement"] = json!(&*series.unit);
        }
        if let Some((_, class)) = CLASSES.iter().find(|(unit, _)| *unit == &*series.unit) {
            document["device_class"] = Json::from(*class);
        }
    }
    let topic = format!("homeassistant/sensor/{box_id}/{}/config", series.name);
    Outgoing { topic, payload: document.to_string().into_bytes(), retain: true }
}
