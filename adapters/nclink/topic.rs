//! The topics of a device with a serial number.

/// What a topic is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Subject {
    /// A device makes itself known. Its topic has no serial number.
    Register,
    /// The device tells the version of its model.
    Version,
    /// Ask for the model.
    Probe,
    /// The answer to it.
    ProbeAnswer,
    /// Ask for values of data items.
    Query,
    /// The answer to it.
    QueryAnswer,
    /// Write values of data items.
    Set,
    /// The answer to it.
    SetAnswer,
    /// Values of a sample channel.
    Sample,
    /// The device tells that something happened.
    Event,
    /// Ask whether the device is there.
    Ping,
    /// The answer of a device that is there.
    Pong,
}

/// Every subject with the beginning of its topic.
const TABLE: [(Subject, &str); 12] = [
    (Subject::Register, "Register/Request"),
    (Subject::Version, "Probe/Version"),
    (Subject::Probe, "Probe/Query/Request"),
    (Subject::ProbeAnswer, "Probe/Query/Response"),
    (Subject::Query, "Query/Request"),
    (Subject::QueryAnswer, "Query/Response"),
    (Subject::Set, "Set/Request"),
    (Subject::SetAnswer, "Set/Response"),
    (Subject::Sample, "Sample"),
    (Subject::Event, "Event"),
    (Subject::Ping, "Ping"),
    (Subject::Pong, "Pong"),
];

impl Subject {
    fn topic_prefix(self) -> &'static str {
        TABLE.iter().find(|(subject, _)| *subject == self).map_or("", |(_, beginning)| beginning)
    }

    /// The topic of this subject for a device.
    #[must_use]
    pub fn build_topic(self, serial: &str) -> String {
        match self {
            Self::Register => self.topic_prefix().to_owned(),
            _ => format!("{}/{serial}", self.topic_prefix()),
        }
    }

    /// The filter that takes this subject, with anything behind the serial number: the name of a sample channel, or the
    /// name of a client.
    #[must_use]
    pub fn build_filter(self, serial: &str) -> String {
        format!("{}/#", self.build_topic(serial))
    }

    /// The subject of a topic of this device, and what stands behind the serial number.
    #[must_use]
    pub fn from_topic<'a>(topic: &'a str, serial: &str) -> Option<(Self, &'a str)> {
        // Of which device it is stands in the message.
        if topic.strip_prefix("Register/Request").is_some_and(|rest| rest.is_empty() || rest.starts_with('/')) {
            return Some((Self::Register, ""));
        }
        let matching = TABLE.iter().filter_map(|(subject, beginning)| {
            let rest = topic.strip_prefix(beginning)?.strip_prefix('/')?.strip_prefix(serial)?;
            if rest.is_empty() { Some((*subject, "")) } else { Some((*subject, rest.strip_prefix('/')?)) }
        });
        matching.into_iter().next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_found_again_with_and_without_a_tail() {
        for (subject, _) in TABLE.into_iter().filter(|(subject, _)| *subject != Subject::Register) {
            let topic = subject.build_topic("SN/1");
            assert_eq!(Subject::from_topic(&topic, "SN/1"), Some((subject, "")));
            assert_eq!(Subject::from_topic(&format!("{topic}/client"), "SN/1"), Some((subject, "client")));
            assert_eq!(Subject::from_topic(&format!("{topic}7"), "SN/1"), None, "another device");
        }
        assert_eq!(Subject::Sample.build_filter("A1"), "Sample/A1/#");
        assert_eq!(Subject::from_topic("Register/Request", "A1"), Some((Subject::Register, "")));
        assert_eq!(Subject::from_topic("Register/Requests", "A1"), None);
    }
}
