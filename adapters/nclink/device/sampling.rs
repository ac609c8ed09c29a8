//! Messages of a sample channel: a column per item, one value per interval.

use super::{to_milliseconds, values};
use nclink::model::{Model, SampleChannel};
use serde_json::{Value, json};
use simulated::Simulated;

/// A device that is further behind than this goes on from now.
const BEHIND_NS: i64 = 2_000_000_000;

pub(super) struct ChannelSampler {
    name: String,
    paths: Vec<String>,
    names: Vec<String>,
    interval_ms: i64,
    upload_ms: i64,
    /// First instant of the next message.
    begin_ms: i64,
}

impl ChannelSampler {
    /// `None` for a channel whose times are not whole milliseconds or whose upload holds no value.
    pub(super) fn new(channel: &SampleChannel, model: &Model) -> Option<Self> {
        let whole = |ms: f64| nclink::lenient_json::parse_integer(&json!(ms)).filter(|ms| *ms > 0);
        let (interval_ms, upload_ms) = (whole(channel.interval_ms)?, whole(channel.upload_ms)?);
        let path = |name: &String| model.find_item(name).map(|item| item.path.clone());
        let paths: Vec<String> = channel.items.iter().filter_map(path).collect();
        let names = channel.items.clone();
        (upload_ms >= interval_ms && paths.len() == names.len()).then(|| Self {
            name: channel.id.clone(),
            paths,
            names,
            interval_ms,
            upload_ms,
            begin_ms: 0,
        })
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The device is at the broker from now on.
    pub(super) fn begin_sampling(&mut self, now_ns: i64) {
        self.begin_ms = to_milliseconds(now_ns);
    }

    /// When the next message is complete.
    pub(super) fn due_ns(&self) -> i64 {
        (self.begin_ms + self.upload_ms) * 1_000_000
    }

    /// The next message, if it is complete by now.
    pub(super) fn next(&mut self, now_ns: i64, machine: &Simulated) -> Option<Value> {
        if now_ns - self.due_ns() > BEHIND_NS {
            self.begin_sampling(now_ns);
        }
        if now_ns < self.due_ns() {
            return None;
        }
        let begin_ms = self.begin_ms;
        let instants = self.upload_ms / self.interval_ms;
        self.begin_ms += instants * self.interval_ms;
        let mut columns = vec![Vec::new(); self.paths.len()];
        for instant in 0..instants {
            let moment = machine.moment((begin_ms + instant * self.interval_ms) * 1_000_000);
            for (column, path) in columns.iter_mut().zip(&self.paths) {
                column.push(values::find_value(path, &moment).unwrap_or(Value::Null));
            }
        }
        let data: Vec<Value> = columns.into_iter().map(|column| json!({"data": column})).collect();
        Some(json!({
            "@id": adapter_core::unique_id::generate_unique_id(), "paths": self.names, "id": self.name, "beginTime": begin_ms.to_string(),
            "data": data, "interval": self.interval_ms, "uploadInterval": self.upload_ms,
        }))
    }
}
