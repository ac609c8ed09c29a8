//! Questions to one agent, and its answers as documents.

use crate::address::MtConnectTarget;
use crate::deadline::Deadline;
use crate::http::{HttpError, Response, escape_path_part, send_request};
use crate::model::{Device, parse_devices};
use crate::streams::{Header, Observation, StreamsEvent, StreamsReader};
use adapter_core::address::Endpoint;
use adapter_core::channel::find_nearest_name;
use adapter_core::driver::SourceError;
use adapter_core::integer::saturate_to_ms;
use adapter_core::text::shorten_text;
use std::time::Duration;

/// Most observations of a document. An agent is asked for 4,096, and has as many more as it has data items and standing conditions.
pub(crate) const OBSERVATIONS_MAX: usize = 100_000;
/// Names of devices that are told at most.
const NAMES_SHOWN: usize = 10;

/// An answer to `current` or `sample`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct StreamsDocument {
    pub(crate) header: Header,
    pub(crate) observations: Vec<Observation>,
}

/// Why a document is no MTConnectStreams.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum DocumentError {
    #[error("the agent refuses: {code} {text}")]
    Refused { code: String, text: String },
    #[error("{0}")]
    Nonsense(String),
}

/// Reads an answer of an agent.
pub(crate) fn parse_streams(document: &[u8]) -> Result<StreamsDocument, DocumentError> {
    let mut reader = StreamsReader::new(document);
    let mut found = StreamsDocument::default();
    while let Some(event) = reader.read_event().map_err(|error| DocumentError::Nonsense(error.to_string()))? {
        match event {
            StreamsEvent::Header(header) => found.header = header,
            StreamsEvent::Observation(_) if found.observations.len() >= OBSERVATIONS_MAX => {
                return Err(DocumentError::Nonsense(format!("it has more than {OBSERVATIONS_MAX} observations")));
            }
            StreamsEvent::Observation(observation) => found.observations.push(observation),
            StreamsEvent::Error { code, text } => {
                return Err(DocumentError::Refused { code: shorten_text(code), text: shorten_text(text) });
            }
        }
    }
    match reader.root() {
        Some("MTConnectStreams") if reader.is_whole() => Ok(found),
        Some("MTConnectStreams") => Err(DocumentError::Nonsense("the document ends in the middle".to_owned())),
        Some(other) => Err(DocumentError::Nonsense(format!("it is {other} and not MTConnectStreams"))),
        None => Err(DocumentError::Nonsense("it is no XML".to_owned())),
    }
}

/// Where an agent is, and which of its devices is meant.
#[derive(Debug, Clone)]
pub(crate) struct AgentLink {
    /// The address, as in the configuration.
    pub(crate) name: String,
    endpoint: Endpoint,
    device: Option<String>,
    pub(crate) silence: Duration,
    /// Does the agent take the name of a device before a request? Some with one device do not.
    takes_name: bool,
    /// Of the poll that runs.
    deadline: Deadline,
}

impl AgentLink {
    pub(crate) fn new(name: &str, target: &MtConnectTarget) -> Self {
        Self {
            name: name.to_owned(),
            endpoint: target.endpoint.clone(),
            device: target.device.clone(),
            silence: Duration::from_millis(target.timeout_ms),
            takes_name: true,
            deadline: Deadline::begin(Duration::from_millis(target.timeout_ms)),
        }
    }

    /// A poll begins: all of its questions share one deadline.
    pub(crate) fn begin_poll(&mut self) {
        self.deadline = Deadline::begin(self.silence);
    }

    /// The deadline of the poll that runs.
    pub(crate) fn deadline(&self) -> Deadline {
        self.deadline
    }

    /// The device, as the agent describes it.
    pub(crate) fn probe_device(&mut self) -> Result<Device, SourceError> {
        self.takes_name = true;
        let Some(wanted) = self.device.clone() else { return self.find_only_device() };
        let path = format!("/{}/probe", escape_path_part(&wanted));
        let described = match self.probe(&path) {
            Err(error) if !matches!(error, SourceError::Refused { .. }) => return Err(error),
            described => described.unwrap_or_default(),
        };
        if let Some(device) = described.into_iter().find(|device| device.has_name(&wanted)) {
            return Ok(device);
        }
        self.takes_name = false;
        let mut devices = self.probe("/probe")?;
        match devices.iter().position(|device| device.has_name(&wanted)) {
            Some(place) => Ok(devices.swap_remove(place)),
            None => Err(self.build_unknown_device_error(&wanted, &devices)),
        }
    }

    fn find_only_device(&self) -> Result<Device, SourceError> {
        let mut machines = self.probe("/probe")?;
        machines.retain(|device| !device.is_agent);
        if machines.len() == 1
            && let Some(only) = machines.pop()
        {
            return Ok(only);
        }
        let names: Vec<&str> = machines.iter().map(|device| device.name.as_str()).collect();
        Err(self.refuse(
            "probe",
            format!("the agent has {} devices{}", names.len(), list_names(&names)),
            "Name one of them behind the port: mtconnect://HOST:PORT/DEVICE".to_owned(),
        ))
    }

    fn build_unknown_device_error(&self, wanted: &str, devices: &[Device]) -> SourceError {
        let names: Vec<&str> =
            devices.iter().filter(|device| !device.is_agent).map(|device| device.name.as_str()).collect();
        let next = match find_nearest_name(wanted, names.iter().copied()) {
            Some(near) => format!("Did you mean {near}?"),
            None => "Write the name of one of its devices behind the port".to_owned(),
        };
        self.refuse("probe", format!("the agent has no device {wanted}{}", list_names(&names)), next)
    }

    fn probe(&self, path: &str) -> Result<Vec<Device>, SourceError> {
        let body = self.ask(path)?;
        parse_devices(&body).map_err(|error| match parse_streams(&body) {
            Err(DocumentError::Refused { code, text }) => self.refuse("probe", format!("{code} {text}"), String::new()),
            _ => self.build_nonsense("probe", error.to_string()),
        })
    }

    /// What the device says now.
    pub(crate) fn ask_current(&self, device: &Device) -> Result<StreamsDocument, SourceError> {
        let body = self.ask(&format!("{}/current", self.name_in_path(device)))?;
        parse_streams(&body).map_err(|error| self.to_source_error("current", error))
    }

    /// The observations from a number on, once.
    pub(crate) fn ask_sample(
        &self,
        device: &Device,
        from: Option<u64>,
        count: u64,
    ) -> Result<StreamsDocument, SourceError> {
        let body = self.ask(&format!("{}/sample?{}count={count}", self.name_in_path(device), format_from(from)))?;
        parse_streams(&body).map_err(|error| self.to_source_error("sample", error))
    }

    /// The observations from a number on, for ever: as a rule an answer in parts.
    pub(crate) fn open_sample(
        &self,
        device: &Device,
        from: Option<u64>,
        count: u64,
        interval: Duration,
    ) -> Result<Response, SourceError> {
        let interval_ms = saturate_to_ms(interval);
        let query = format!("{}interval={interval_ms}&heartbeat={interval_ms}&count={count}", format_from(from));
        let path = format!("{}/sample?{query}", self.name_in_path(device));
        let deadline = self.deadline;
        let response = send_request(&self.endpoint, &path, deadline);
        let response = response.map_err(|error| self.to_line_error("sample", error))?;
        self.check_status("sample", response, deadline)
    }

    /// An agent takes the name or the uuid of a device. One that does not answers for all of its devices, whose items have other identifiers.
    fn name_in_path(&self, device: &Device) -> String {
        let name = if device.name.is_empty() { &device.uuid } else { &device.name };
        if self.takes_name { format!("/{}", escape_path_part(name)) } else { String::new() }
    }

    fn ask(&self, path: &str) -> Result<Vec<u8>, SourceError> {
        let deadline = self.deadline;
        let request = path.split('?').next().and_then(|path| path.rsplit('/').next()).unwrap_or(path);
        let response =
            send_request(&self.endpoint, path, deadline).map_err(|error| self.to_line_error(request, error))?;
        let response = self.check_status(request, response, deadline)?;
        response.read_body(deadline).map_err(|error| self.to_line_error(request, error))
    }

    /// Passes an answer with status 200 on; what another one says is the reason of the refusal.
    fn check_status(&self, request: &str, response: Response, deadline: Deadline) -> Result<Response, SourceError> {
        let (status, location) = (response.status, response.location.clone());
        if status == 200 {
            return Ok(response);
        }
        if let Some(location) = location.filter(|_| (300..400).contains(&status)) {
            let next = "Write the address where the agent itself answers by http; https is not spoken".to_owned();
            return Err(self.refuse(request, format!("it sends to {location}"), next));
        }
        let body = response.read_body(deadline).unwrap_or_default();
        let what = match parse_streams(&body) {
            Err(DocumentError::Refused { code, text }) => format!("{code} {text}"),
            _ => format!("HTTP status {status}"),
        };
        let next =
            "Look whether host and port are those of an MTConnect agent, and the device one of its own".to_owned();
        Err(self.refuse(request, what, next))
    }

    fn refuse(&self, request: &str, what: String, next: String) -> SourceError {
        SourceError::Refused { source_name: self.name.clone(), request: request.to_owned(), what, next }
    }

    pub(crate) fn build_nonsense(&self, request: &str, what: String) -> SourceError {
        SourceError::Decode { source_name: self.name.clone(), request: request.to_owned(), what }
    }

    pub(crate) fn to_source_error(&self, request: &str, error: DocumentError) -> SourceError {
        match error {
            DocumentError::Refused { .. } => {
                self.refuse(request, error.to_string(), adapter_core::driver::SEE_DOCTOR.to_owned())
            }
            DocumentError::Nonsense(what) => self.build_nonsense(request, what),
        }
    }

    pub(crate) fn to_line_error(&self, request: &str, error: HttpError) -> SourceError {
        match error {
            HttpError::Line(what) => SourceError::Line {
                source_name: self.name.clone(),
                what,
                next: "Look whether the agent runs, whether host and port are right, and whether a firewall stands between".to_owned(),
            },
            HttpError::Timeout => SourceError::Timeout {
                source_name: self.name.clone(),
                request: request.to_owned(),
                deadline_ms: saturate_to_ms(self.silence),
                next: "Look whether the agent runs and its computer is reached; a slow one needs a longer timeout_ms".to_owned(),
            },
            HttpError::Nonsense(what) => self.build_nonsense(request, what),
        }
    }
}

fn format_from(from: Option<u64>) -> String {
    from.map_or_else(String::new, |from| format!("from={from}&"))
}

fn list_names(names: &[&str]) -> String {
    if names.is_empty() {
        return String::new();
    }
    let more = if names.len() > NAMES_SHOWN { ", ..." } else { "" };
    format!(": {}{more}", names.iter().take(NAMES_SHOWN).copied().collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_is_whole_or_refused() {
        let of = |text: &str| parse_streams(text.as_bytes());
        assert!(of("<MTConnectStreams><Header/></MTConnectStreams>").is_ok());
        assert_eq!(
            of("<MTConnectStreams><Header/>"),
            Err(DocumentError::Nonsense("the document ends in the middle".to_owned()))
        );
        assert!(
            matches!(of("<MTConnectDevices/>"), Err(DocumentError::Nonsense(what)) if what.contains("MTConnectDevices"))
        );
        assert_eq!(of(""), Err(DocumentError::Nonsense("it is no XML".to_owned())));
        let refused = of("<MTConnectError><Error errorCode=\"OUT_OF_RANGE\">too old</Error></MTConnectError>");
        assert_eq!(
            refused,
            Err(DocumentError::Refused { code: "OUT_OF_RANGE".to_owned(), text: "too old".to_owned() })
        );
    }
}
