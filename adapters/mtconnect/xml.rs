//! XML as elements with their attributes and texts. References (`&amp;`, `&#37;`) are resolved, entities of a document's own are not: they
//! have no text here.

use quick_xml::Reader;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesRef, BytesStart, Event};
use std::io::BufRead;
use thiserror::Error;

/// The text is no XML.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the XML is broken at byte {at}: {what}")]
pub struct XmlError {
    /// Byte at which it is broken.
    pub at: u64,
    /// What the parser says.
    pub what: String,
}

/// An element with its attributes, without prefixes of namespaces.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct XmlElement {
    /// Its name, without the prefix of a namespace.
    pub name: String,
    attributes: Vec<(String, String)>,
}

impl XmlElement {
    /// The value of an attribute.
    #[must_use]
    pub fn find_attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// The same as a text of its own.
    #[must_use]
    pub fn copy_attribute(&self, name: &str) -> Option<String> {
        self.find_attribute(name).map(str::to_owned)
    }

    /// The value of an attribute as a number.
    #[must_use]
    pub fn parse_attribute<T: std::str::FromStr>(&self, name: &str) -> Option<T> {
        self.find_attribute(name)?.trim().parse().ok()
    }
}

/// What comes next in a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum XmlEvent {
    /// An element begins, with its attributes.
    Begin(XmlElement),
    /// A part of the text of the element that began last and has not ended.
    Text(String),
    /// The element that began last ends.
    End,
    /// The document ends here.
    Eof,
}

/// Reads a document event by event.
pub struct XmlReader<R> {
    reader: Reader<R>,
    buffer: Vec<u8>,
    depth: usize,
}

impl<R: BufRead> XmlReader<R> {
    /// A reader of this document, which is UTF-8.
    pub fn new(document: R) -> Self {
        let mut reader = Reader::from_reader(document);
        reader.config_mut().expand_empty_elements = true;
        Self { reader, buffer: Vec::new(), depth: 0 }
    }

    /// Elements that have begun and not ended.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// The next event of the document.
    ///
    /// # Errors
    /// The text is no XML.
    pub fn read_event(&mut self) -> Result<XmlEvent, XmlError> {
        loop {
            self.buffer.clear();
            let event = self.reader.read_event_into(&mut self.buffer);
            let event = match event {
                Ok(event) => event,
                Err(error) => return Err(XmlError { at: self.reader.error_position(), what: error.to_string() }),
            };
            match event {
                Event::Start(element) => {
                    self.depth += 1;
                    return Ok(XmlEvent::Begin(to_element(&element)));
                }
                Event::End(_) => {
                    self.depth = self.depth.saturating_sub(1);
                    return Ok(XmlEvent::End);
                }
                Event::Text(text) => return Ok(XmlEvent::Text((*text).to_owned())),
                Event::CData(text) => return Ok(XmlEvent::Text((*text).to_owned())),
                Event::GeneralRef(reference) => {
                    if let Some(character) = resolve_reference(&reference) {
                        return Ok(XmlEvent::Text(character.to_string()));
                    }
                }
                Event::Eof => return Ok(XmlEvent::Eof),
                _ => {}
            }
        }
    }
}

fn to_element(element: &BytesStart<'_>) -> XmlElement {
    let attributes = element.attributes().flatten().map(|attribute| {
        let value = attribute.normalized_value(XmlVersion::Implicit1_0);
        let value = value.map_or_else(|_| attribute.value.clone().into_owned(), std::borrow::Cow::into_owned);
        (attribute.key.local_name().as_ref().to_owned(), value)
    });
    XmlElement { name: element.local_name().as_ref().to_owned(), attributes: attributes.collect() }
}

fn resolve_reference(reference: &BytesRef<'_>) -> Option<char> {
    match &**reference {
        "amp" => Some('&'),
        "lt" => Some('<'),
        "gt" => Some('>'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => reference.resolve_char_ref().ok().flatten(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_all(text: &str) -> Result<Vec<XmlEvent>, XmlError> {
        let mut reader = XmlReader::new(text.as_bytes());
        let mut events = Vec::new();
        loop {
            match reader.read_event()? {
                XmlEvent::Eof => return Ok(events),
                event => events.push(event),
            }
        }
    }

    #[test]
    fn references_prefixes_and_empty_elements_are_read() {
        let events =
            read_all("<?xml version=\"1.0\"?><m:a m:x='1 &amp; 2'><b/>A &#38; <![CDATA[B]]></m:a>").expect("XML");
        let XmlEvent::Begin(first) = &events[0] else { panic!("{events:?}") };
        assert_eq!((first.name.as_str(), first.find_attribute("x")), ("a", Some("1 & 2")));
        let text: String = events
            .iter()
            .filter_map(|event| match event {
                XmlEvent::Text(text) => Some(text.as_str()),
                _ => None,
            })
            .collect();
        assert_eq!(text, "A & B");
        assert_eq!(events.iter().filter(|event| **event == XmlEvent::End).count(), 2);
    }

    #[test]
    fn what_is_no_xml_is_told_with_its_place_and_entities_are_not_expanded() {
        assert!(read_all("<a><b></a>").is_err_and(|error| error.at > 0));
        let bomb = "<!DOCTYPE a [<!ENTITY x \"xxxx\"><!ENTITY y \"&x;&x;\">]><a>&y;</a>";
        assert!(!read_all(bomb).expect("XML").iter().any(|event| matches!(event, XmlEvent::Text(_))));
    }
}
