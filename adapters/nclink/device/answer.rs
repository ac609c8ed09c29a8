//! One request in, one answer out.

use super::{NcLinkDevice, to_milliseconds, values};
use adapter_core::integer::widen_to_usize;
use nclink::lenient_json::{find_list, find_text, parse_integer};
use nclink::mailbox::ControllerRegister;
use nclink::message::find_identifier;
use nclink::topic::Subject;
use serde_json::{Value, json};

/// At most so many elements of a list are answered.
const ELEMENTS_MAX: usize = 4096;

impl NcLinkDevice {
    pub(super) fn answer_request(&mut self, subject: Subject, said: &Value) -> Value {
        let id = find_identifier(said).unwrap_or_default();
        match subject {
            Subject::Probe => json!({"@id": id, "code": "OK", "probe": self.tree}),
            Subject::Query => {
                let values: Vec<Value> = find_list(said, &["ids"]).iter().map(|item| self.query_item(item)).collect();
                json!({"@id": id, "values": values})
            }
            Subject::Set => {
                let results: Vec<Value> = find_list(said, &["values"]).iter().map(|item| self.set_item(item)).collect();
                self.registers.scan_letters(self.clock.as_ref());
                json!({"@id": id, "results": results})
            }
            _ => json!({"@id": id}),
        }
    }

    fn query_item(&self, item: &Value) -> Value {
        let name = find_text(item, &["id"]).unwrap_or_default();
        match self.values_of(&name, item) {
            Ok(values) => json!({"id": name, "code": "OK", "values": values}),
            Err(reason) => json!({"id": name, "code": "NG", "reason": reason}),
        }
    }

    fn values_of(&self, name: &str, item: &Value) -> Result<Vec<Value>, &'static str> {
        let params = item.get("params").unwrap_or(&Value::Null);
        if find_text(params, &["operation"]).is_some_and(|operation| operation != "get_value") {
            return Err("UNSUPPORTED_OPERATION");
        }
        let known = self.model.find_item(name).ok_or("NOT_FOUND")?;
        let now_ns = self.clock.now_ns();
        let moment = self.machine.moment(now_ns);
        if let Some(value) = &known.value {
            return Ok(vec![value.clone()]);
        }
        if let Some(value) = values::find_value(&known.path, &moment) {
            return Ok(vec![value]);
        }
        let indexes = parse_indexes(params)?;
        if known.path == "CONTROLLER/VARIABLE@CHAN_0" {
            // Of the channel's list only the flag of rigid tapping is served.
            let flag = i64::from(moment.panel.operation == adapter_core::words::operation::TAPPING);
            return Ok(indexes.iter().map(|index| json!(if *index == 23 { flag } else { 0 })).collect());
        }
        let kind = register_kind(&known.path).ok_or("NOT_SUPPORTED")?;
        let read = |index: &u32| {
            self.registers.read(ControllerRegister { kind, index: *index }, &moment, to_milliseconds(now_ns))
        };
        indexes.iter().map(|index| read(index).map(|value| json!(value)).ok_or("INDEX_OUT_OF_RANGE")).collect()
    }

    fn set_item(&mut self, item: &Value) -> Value {
        let name = find_text(item, &["id"]).unwrap_or_default();
        match self.write(&name, item) {
            Ok(()) => json!({"id": name, "code": "OK"}),
            Err(reason) => json!({"id": name, "code": "NG", "reason": reason}),
        }
    }

    fn write(&mut self, name: &str, item: &Value) -> Result<(), &'static str> {
        let params = item.get("params").ok_or("NO_PARAMS")?;
        let known = self.model.find_item(name).ok_or("NOT_FOUND")?;
        if !known.settable {
            return Err("NOT_SETABLE");
        }
        let kind = register_kind(&known.path).ok_or("NOT_SETABLE")?;
        let index = params
            .get("index")
            .and_then(parse_integer)
            .and_then(|index| u32::try_from(index).ok())
            .ok_or("NO_INDEX")?;
        let at = ControllerRegister { kind, index };
        let value = params.get("value").and_then(parse_integer).ok_or("NO_VALUE")?;
        let Some(bit) = params.get("offset").and_then(parse_integer) else { return self.registers.write(at, value) };
        let moment = self.machine.moment(self.clock.now_ns());
        let old = self.registers.read(at, &moment, 0).ok_or("INDEX_OUT_OF_RANGE")?;
        let mask = u32::try_from(bit).ok().and_then(|bit| 1_i64.checked_shl(bit)).ok_or("BIT_OUT_OF_RANGE")?;
        self.registers.write(at, if value != 0 { old | mask } else { old & !mask })
    }
}

fn register_kind(path: &str) -> Option<char> {
    path.strip_prefix("CONTROLLER/VARIABLE@REG_")?.chars().next()
}

/// `["1", "3-5"]` is 1, 3, 4, 5.
fn parse_indexes(params: &Value) -> Result<Vec<u32>, &'static str> {
    let mut found = Vec::new();
    for part in find_list(params, &["indexes", "index"]) {
        let part = part.as_str().map_or_else(|| part.to_string(), str::to_owned);
        let (first, last) = part.split_once('-').unwrap_or((&part, &part));
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| "BAD_INDEX");
        let (first, last) = (number(first)?, number(last)?);
        if last < first || found.len() + widen_to_usize(last - first) >= ELEMENTS_MAX {
            return Err("BAD_INDEX");
        }
        found.extend(first..=last);
    }
    if found.is_empty() { Err("NO_INDEX") } else { Ok(found) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_indexes_are_spread_and_bounded() {
        assert_eq!(parse_indexes(&json!({"indexes": ["1", "3-5", 9]})), Ok(vec![1, 3, 4, 5, 9]));
        for bad in
            [json!({}), json!({"indexes": ["x"]}), json!({"indexes": ["5-3"]}), json!({"indexes": ["0-9999999"]})]
        {
            assert!(parse_indexes(&bad).is_err(), "{bad}");
        }
    }
}
