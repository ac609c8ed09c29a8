//! Payloads of Sparkplug B as the specification's `sparkplug_b.proto` writes them, without the parts that this gateway
//! never uses (data sets, templates, extensions); those are passed over when a payload of somebody else is read.
//!
//! Source: Eclipse Sparkplug Specification 3.0.0, chapter 6 (payloads) and appendix (protobuf schema).

use prost::{Message, Oneof};

/// Numbers of the data types (specification, 6.4.16).
pub(super) mod datatype {
    pub(in super::super) const INT32: u32 = 3;
    pub(in super::super) const INT64: u32 = 4;
    pub(in super::super) const UINT64: u32 = 8;
    pub(in super::super) const DOUBLE: u32 = 10;
    pub(in super::super) const BOOLEAN: u32 = 11;
    pub(in super::super) const STRING: u32 = 12;
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct Payload {
    #[prost(uint64, optional, tag = "1")]
    pub(super) timestamp: Option<u64>,
    #[prost(message, repeated, tag = "2")]
    pub(super) metrics: Vec<Metric>,
    #[prost(uint64, optional, tag = "3")]
    pub(super) seq: Option<u64>,
}

/// A value with its name or alias.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Metric {
    #[prost(string, optional, tag = "1")]
    pub(super) name: Option<String>,
    #[prost(uint64, optional, tag = "2")]
    pub(super) alias: Option<u64>,
    #[prost(uint64, optional, tag = "3")]
    pub(super) timestamp: Option<u64>,
    #[prost(uint32, optional, tag = "4")]
    pub(super) datatype: Option<u32>,
    #[prost(bool, optional, tag = "5")]
    pub(super) is_historical: Option<bool>,
    #[prost(bool, optional, tag = "7")]
    pub(super) is_null: Option<bool>,
    #[prost(message, optional, tag = "9")]
    pub(super) properties: Option<PropertySet>,
    #[prost(oneof = "MetricValue", tags = "10, 11, 12, 13, 14, 15")]
    pub(super) value: Option<MetricValue>,
}

/// The value of a metric.
#[derive(Clone, PartialEq, Oneof)]
pub(super) enum MetricValue {
    #[prost(uint32, tag = "10")]
    Int(u32),
    #[prost(uint64, tag = "11")]
    Long(u64),
    #[prost(float, tag = "12")]
    Float(f32),
    #[prost(double, tag = "13")]
    Double(f64),
    #[prost(bool, tag = "14")]
    Boolean(bool),
    #[prost(string, tag = "15")]
    Text(String),
}

/// Properties of a metric: names and values side by side.
#[derive(Clone, PartialEq, Message)]
pub(super) struct PropertySet {
    #[prost(string, repeated, tag = "1")]
    pub(super) keys: Vec<String>,
    #[prost(message, repeated, tag = "2")]
    pub(super) values: Vec<PropertyValue>,
}

#[derive(Clone, PartialEq, Message)]
pub(super) struct PropertyValue {
    #[prost(uint32, optional, tag = "1")]
    pub(super) kind: Option<u32>,
    #[prost(oneof = "Property", tags = "3, 6, 7, 8")]
    pub(super) value: Option<Property>,
}

/// The value of a property.
#[derive(Clone, PartialEq, Oneof)]
pub(super) enum Property {
    #[prost(uint32, tag = "3")]
    Int(u32),
    #[prost(double, tag = "6")]
    Double(f64),
    #[prost(bool, tag = "7")]
    Boolean(bool),
    #[prost(string, tag = "8")]
    Text(String),
}

impl PropertySet {
    pub(super) fn add_property(&mut self, key: &str, value: Property) {
        let kind = match value {
            Property::Int(_) => datatype::INT32,
            Property::Double(_) => datatype::DOUBLE,
            Property::Boolean(_) => datatype::BOOLEAN,
            Property::Text(_) => datatype::STRING,
        };
        self.keys.push(key.to_owned());
        self.values.push(PropertyValue { kind: Some(kind), value: Some(value) });
    }
}

impl Metric {
    /// A metric by name, with a value whose type is known from it.
    pub(super) fn with_name(name: &str, datatype: u32, timestamp: u64, value: MetricValue) -> Self {
        Self {
            name: Some(name.to_owned()),
            timestamp: Some(timestamp),
            datatype: Some(datatype),
            value: Some(value),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_payload_is_what_the_schema_says() {
        let metric = Metric::with_name("a", datatype::DOUBLE, 5, MetricValue::Double(1.0));
        let payload = Payload { timestamp: Some(1), metrics: vec![metric], seq: Some(0) };
        let expected = b"\x08\x01\x12\x10\x0a\x01a\x18\x05\x20\x0a\x69\0\0\0\0\0\0\xf0\x3f\x18\x00";
        assert_eq!(payload.encode_to_vec(), expected);
        assert_eq!(Payload::decode(&expected[..]).expect("readable"), payload);
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..128)) {
            let _either = Payload::decode(&bytes[..]);
        }
    }
}
