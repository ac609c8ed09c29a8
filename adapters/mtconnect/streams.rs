//! What an agent says: MTConnectStreams, the answer to `current` and `sample`, and MTConnectError.

use crate::xml::{XmlElement, XmlError, XmlEvent, XmlReader};
use std::io::BufRead;

/// The head of a document. What an agent leaves out is `None`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Header {
    /// Another one with every start of the agent.
    pub instance_id: Option<String>,
    /// Sequence number of the oldest observation that the agent still has.
    pub first_sequence: Option<u64>,
    /// Where the next question begins.
    pub next_sequence: Option<u64>,
    /// How many observations the agent keeps.
    pub buffer_size: Option<u64>,
    /// When the devices of the agent were last changed while it ran.
    pub model_changed_at: Option<String>,
}

/// Which level a condition has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConditionLevel {
    /// Nothing is wrong any more.
    Normal,
    /// It may become a fault.
    Warning,
    /// Somebody has to do something.
    Fault,
    /// The agent does not know.
    Unavailable,
}

impl ConditionLevel {
    fn from_word(word: &str) -> Option<Self> {
        match word.trim().to_ascii_lowercase().as_str() {
            "normal" => Some(Self::Normal),
            "warning" => Some(Self::Warning),
            "fault" => Some(Self::Fault),
            "unavailable" => Some(Self::Unavailable),
            _ => None,
        }
    }
}

/// What belongs to a condition and to nothing else.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConditionFields {
    /// How serious it is.
    pub level: ConditionLevel,
    /// Type of the condition, for example `SYSTEM`.
    pub kind: String,
    /// Number of the alarm at the control.
    pub native_code: Option<String>,
    /// Tells it apart from others of the same number (from version 2.3 on).
    pub condition_id: Option<String>,
    /// `HIGH` or `LOW`, where a limit was passed.
    pub qualifier: Option<String>,
}

/// One value of one data item at one time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Observation {
    /// Identifier of the data item.
    pub item: String,
    /// Name of the element, which is the type: `PathFeedrate`.
    pub element: String,
    /// `ACTUAL`, `PROGRAMMED` and so on.
    pub sub_type: Option<String>,
    /// Kind of the component that it belongs to: `Rotary`.
    pub component: String,
    /// Its number among all of the agent.
    pub sequence: Option<u64>,
    /// When it was made, as the agent writes it.
    pub timestamp: String,
    /// The value, without the blanks around it.
    pub text: String,
    /// What only a condition has.
    pub condition: Option<ConditionFields>,
}

/// The word for a value that the agent does not have.
pub const UNAVAILABLE: &str = "UNAVAILABLE";

/// What comes next in a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StreamsEvent {
    /// The head of the document.
    Header(Header),
    /// An observation of a data item.
    Observation(Observation),
    /// The agent refuses what it was asked for.
    Error {
        /// One of the words of the standard, for example `OUT_OF_RANGE`.
        code: String,
        /// The sentence that stands beside it.
        text: String,
    },
}

/// Reads a document of an agent, event by event.
pub struct StreamsReader<R> {
    xml: XmlReader<R>,
    root: Option<String>,
    component: String,
    /// Does what comes stand in a list of conditions?
    is_in_conditions: bool,
    /// What began and is told when it ends: depth and event.
    pending: Option<(usize, StreamsEvent)>,
    text: String,
}

impl<R: BufRead> StreamsReader<R> {
    /// A reader of this document, which is UTF-8.
    pub fn new(document: R) -> Self {
        let xml = XmlReader::new(document);
        Self { xml, root: None, component: String::new(), is_in_conditions: false, pending: None, text: String::new() }
    }

    /// Name of the outermost element, once it has begun: `MTConnectStreams`.
    #[must_use]
    pub fn root(&self) -> Option<&str> {
        self.root.as_deref()
    }

    /// Has every element ended?
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.root.is_some() && self.xml.depth() == 0
    }

    /// The next event; `None` at the end.
    ///
    /// # Errors
    /// The text is no XML.
    pub fn read_event(&mut self) -> Result<Option<StreamsEvent>, XmlError> {
        loop {
            match self.xml.read_event()? {
                XmlEvent::Begin(element) => {
                    if let Some(header) = self.begin_element(&element) {
                        return Ok(Some(StreamsEvent::Header(header)));
                    }
                }
                XmlEvent::Text(text) => {
                    if self.pending.as_ref().is_some_and(|(depth, _)| *depth == self.xml.depth()) {
                        self.text.push_str(&text);
                    }
                }
                XmlEvent::End => {
                    if let Some((_, event)) = self.pending.take_if(|(depth, _)| *depth > self.xml.depth()) {
                        return Ok(Some(self.end_event(event)));
                    }
                }
                XmlEvent::Eof => return Ok(None),
            }
        }
    }

    fn begin_element(&mut self, element: &XmlElement) -> Option<Header> {
        let root = self.root.get_or_insert_with(|| element.name.clone());
        if self.pending.is_some() {
            return None;
        }
        match element.name.as_str() {
            "Header" => return Some(parse_header(element)),
            "ComponentStream" => self.component = element.copy_attribute("component").unwrap_or_default(),
            "Samples" | "Events" | "Condition" | "Conditions" => {
                self.is_in_conditions = element.name.starts_with("Condition");
            }
            "Error" if root == "MTConnectError" => {
                let code = element.copy_attribute("errorCode").unwrap_or_default();
                self.begin_event(StreamsEvent::Error { code, text: String::new() });
            }
            _ => {
                if let Some(observation) = self.begin_observation(element) {
                    self.begin_event(StreamsEvent::Observation(observation));
                }
            }
        }
        None
    }

    fn begin_event(&mut self, event: StreamsEvent) {
        self.text.clear();
        self.pending = Some((self.xml.depth(), event));
    }

    fn begin_observation(&self, element: &XmlElement) -> Option<Observation> {
        let (item, timestamp) = (element.copy_attribute("dataItemId")?, element.copy_attribute("timestamp")?);
        let condition = self.is_in_conditions.then(|| ConditionFields {
            level: ConditionLevel::from_word(&element.name).unwrap_or(ConditionLevel::Unavailable),
            kind: element.copy_attribute("type").unwrap_or_else(|| element.name.clone()),
            native_code: element.copy_attribute("nativeCode").filter(|code| !code.is_empty()),
            condition_id: element.copy_attribute("conditionId").filter(|id| !id.is_empty()),
            qualifier: element.copy_attribute("qualifier"),
        });
        Some(Observation {
            item,
            element: element.name.clone(),
            sub_type: element.copy_attribute("subType"),
            component: self.component.clone(),
            sequence: element.parse_attribute("sequence"),
            timestamp,
            text: String::new(),
            condition,
        })
    }

    fn end_event(&mut self, event: StreamsEvent) -> StreamsEvent {
        let words = self.text.trim().to_owned();
        match event {
            StreamsEvent::Observation(mut observation) => {
                // An agent that names the element by the type writes the level as its text.
                let level = ConditionLevel::from_word(&words);
                if let Some(condition) = &mut observation.condition
                    && ConditionLevel::from_word(&observation.element).is_none()
                {
                    condition.level = level.unwrap_or(ConditionLevel::Unavailable);
                    return StreamsEvent::Observation(observation);
                }
                observation.text = words;
                StreamsEvent::Observation(observation)
            }
            StreamsEvent::Error { code, .. } => StreamsEvent::Error { code, text: words },
            StreamsEvent::Header(_) => event,
        }
    }
}

fn parse_header(element: &XmlElement) -> Header {
    Header {
        instance_id: element.copy_attribute("instanceId"),
        first_sequence: element.parse_attribute("firstSequence"),
        next_sequence: element.parse_attribute("nextSequence"),
        buffer_size: element.parse_attribute("bufferSize"),
        model_changed_at: element.copy_attribute("deviceModelChangeTime"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_all(text: &str) -> Vec<StreamsEvent> {
        let mut reader = StreamsReader::new(text.as_bytes());
        std::iter::from_fn(|| reader.read_event().expect("XML")).collect()
    }

    const STREAMS: &str = r#"<MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.7"><Header instanceId="7" firstSequence="3" nextSequence="9" bufferSize="131072"/>
      <Streams><DeviceStream name="M" uuid="u"><ComponentStream component="Path" name="p" componentId="p1">
      <Events><Program dataItemId="pgm" sequence="5" timestamp="2026-11-28T00:00:00.5Z"> A &amp; B </Program>
      <ToolDataSet dataItemId="ds" sequence="6" timestamp="2026-11-28T00:00:00.5Z" count="1"><Entry key="a">1</Entry></ToolDataSet></Events>
      <Condition><Normal dataItemId="c1" sequence="7" timestamp="2026-11-28T00:00:01Z" type="SYSTEM"/>
      <Fault dataItemId="c2" sequence="8" timestamp="2026-11-28T00:00:01Z" type="ACTUATOR" nativeCode="SV0417" qualifier="HIGH">SERVO</Fault></Condition>
      </ComponentStream></DeviceStream></Streams></MTConnectStreams>"#;

    #[test]
    fn observations_conditions_and_the_head_are_read() {
        let events = read_all(STREAMS);
        let StreamsEvent::Header(header) = &events[0] else { panic!("{events:?}") };
        assert_eq!(
            (header.first_sequence, header.next_sequence, header.buffer_size),
            (Some(3), Some(9), Some(131_072))
        );
        let of: Vec<&Observation> = events
            .iter()
            .filter_map(|event| match event {
                StreamsEvent::Observation(observation) => Some(observation),
                _ => None,
            })
            .collect();
        assert_eq!((of[0].text.as_str(), of[0].sequence, of[0].component.as_str()), ("A & B", Some(5), "Path"));
        assert_eq!((of[1].item.as_str(), of[1].text.as_str()), ("ds", ""), "entries of a set are no value");
        assert_eq!(of[2].condition.as_ref().map(|fields| fields.level), Some(ConditionLevel::Normal));
        let fault = of[3].condition.as_ref().expect("a condition");
        assert_eq!(
            (fault.level, fault.native_code.as_deref(), of[3].text.as_str()),
            (ConditionLevel::Fault, Some("SV0417"), "SERVO")
        );
    }

    #[test]
    fn a_condition_of_an_agent_that_names_it_by_its_type_has_its_level_as_a_text() {
        let text = "<MTConnectStreams><Conditions><System dataItemId=\"c\" timestamp=\"2026-11-28T00:00:00Z\" sequence=\"1\">FAULT</System></Conditions></MTConnectStreams>";
        let events = read_all(text);
        let [StreamsEvent::Observation(observation)] = events.as_slice() else { panic!("{events:?}") };
        let fields = observation.condition.as_ref().expect("a condition");
        assert_eq!(
            (fields.level, fields.kind.as_str(), observation.text.as_str()),
            (ConditionLevel::Fault, "System", "")
        );
    }

    #[test]
    fn a_refusal_is_read_in_both_forms() {
        for text in [
            "<MTConnectError><Header instanceId=\"1\"/><Errors><Error errorCode=\"NO_DEVICE\">no M</Error></Errors></MTConnectError>",
            "<MTConnectError><Error errorCode=\"NO_DEVICE\">no M</Error></MTConnectError>",
        ] {
            let wanted = StreamsEvent::Error { code: "NO_DEVICE".to_owned(), text: "no M".to_owned() };
            assert!(read_all(text).contains(&wanted), "{text}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(<(/?)(MTConnectStreams|Condition|Fault|Header|Error|Events|a)( dataItemId=\"x\"| timestamp=\"t\"| sequence=\"[0-9]{0,22}\")*(/?)>|&[a-z#0-9]{0,4};|[a-z <]){0,30}") {
            let mut reader = StreamsReader::new(text.as_bytes());
            while let Ok(Some(_)) = reader.read_event() {}
        }
    }
}
