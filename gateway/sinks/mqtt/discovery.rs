//! What Home Assistant, and others that follow its notation, must know to show the machine by itself. Pure.
//!
//! Source: Home Assistant, "MQTT Discovery" and "MQTT Sensor": a retained document for each sensor on
//! `homeassistant/sensor/MACHINE/NAME/config`, where `MACHINE` is the path of the machine with underscores, or else the name of the box. A box
//! that takes the place of another one goes on with the same sensors.

use gateway_base::machine_path::MachinePath;
use gateway_history::{Outbox, Reading, SeriesKind};
use mqtt::Outgoing;
use serde_json::{Value as Json, json};

/// Units as Home Assistant writes them, with its word for the quantity.
const CLASSES: [(&str, &str); 6] =
    [("W", "power"), ("A", "current"), ("V", "voltage"), ("°C", "temperature"), ("s", "duration"), ("J", "energy")];

/// The documents of these series, whose values stand on `PREFIX/NAME`. Where the machine has a path, those that the box has told without one
/// are taken back.
pub(super) fn build_sensor_documents(outbox: &Outbox, prefix: &str, readings: &[&Reading]) -> Vec<Outgoing> {
    let taken_back = |reading: &&Reading| {
        let topic = format_topic(&outbox.box_id(), &reading.series.name);
        outbox.path().map(|_| Outgoing { topic, payload: Vec::new(), retain: true })
    };
    let told = readings.iter().map(|reading| build_sensor_document(outbox, prefix, reading));
    told.chain(readings.iter().filter_map(taken_back)).collect()
}

fn format_topic(machine: &str, name: &str) -> String {
    format!("homeassistant/sensor/{machine}/{name}/config")
}

fn build_sensor_document(outbox: &Outbox, prefix: &str, reading: &Reading) -> Outgoing {
    let series = &reading.series;
    let machine = outbox.path().map_or_else(|| outbox.box_id(), MachinePath::format_underscored);
    let mut document = json!({
        "name": &*series.en,
        "unique_id": format!("{machine}_{}", series.name),
        "object_id": format!("{machine}_{}", series.name),
        "state_topic": format!("{prefix}/{}", series.name),
        "availability_topic": format!("{prefix}/online"),
        "availability_template": "{{ 'online' if value_json.online else 'offline' }}",
        "device": {"identifiers": [machine], "name": outbox.machine(), "manufacturer": "cnc-gateway"},
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
    Outgoing { topic: format_topic(&machine, &series.name), payload: document.to_string().into_bytes(), retain: true }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gateway_base::machine_path::NamedMachine;
    use gateway_history::{Cell, OutboxSettings, SeriesInfo};
    use std::collections::BTreeSet;
    use std::sync::Arc;

    #[test]
    fn a_machine_with_a_path_takes_back_what_its_box_has_told() {
        let series = Arc::new(SeriesInfo {
            id: 1,
            name: "spindle_power_w".into(),
            unit: "W".into(),
            en: "Spindle power".into(),
            zh: "主轴功率".into(),
            kind: SeriesKind::Number,
            range: None,
            form: adapter_core::channel::Form::Real,
            estimated: false,
        });
        let reading = Reading { series, value: Cell::Number(2249.5) };
        let told = |path: Option<&str>| {
            let path = path.map(|path| path.parse().expect("a path"));
            let machine = NamedMachine { name: "Lathe 7".to_owned(), path };
            let outbox = Outbox::of_box(machine, OutboxSettings::default(), "Lathe-7-3fa9c1");
            let documents = build_sensor_documents(&outbox, "works", &[&reading]);
            documents.into_iter().map(|told| (told.topic, !told.payload.is_empty())).collect::<BTreeSet<_>>()
        };
        let of_box = "homeassistant/sensor/Lathe-7-3fa9c1/spindle_power_w/config".to_owned();
        let of_path = "homeassistant/sensor/shanghai_line__2_lathe-7/spindle_power_w/config".to_owned();
        assert_eq!(told(None), BTreeSet::from([(of_box.clone(), true)]));
        assert_eq!(told(Some("shanghai/line_2/lathe-7")), BTreeSet::from([(of_box, false), (of_path, true)]));
    }
}
