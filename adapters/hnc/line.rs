//! The parent's side: the library through its child, shared by source and actuator.

use super::KIND;
use super::answer::{HncItemError, HncItemResult, HncReturnCode};
use super::item::{HncItem, define_register};
use super::message::{HncReply, HncRequest};
use super::sampling::{Columns, SampledItem};
use adapter_core::address::Endpoint;
use adapter_core::driver::SourceError;
use adapter_core::integer::saturate_to_ms;
use device_line::child::{ChildClient, ChildCounts, ChildError, ChildSettings, Taken};
use nclink::mailbox::ControllerRegister;
use std::net::UdpSocket;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Why a register is refused that the library has no number for.
const NO_REGISTER: &str = "there is no such register";

/// A call that takes longer has met a dead link: the library waits for 3 s then.
pub(super) const DEAD_LINK: Duration = Duration::from_millis(2500);

/// How the library is used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HncSettings {
    /// The address, as in the configuration.
    pub name: String,
    /// The file of the vendor's library.
    pub vendor_library: PathBuf,
    /// Where the controller is.
    pub endpoint: Endpoint,
    /// Number of this computer in the controller's network; `None` is found out.
    pub local_host: Option<String>,
    /// Port of the library's own listener.
    pub local_port: u16,
    /// Bytes of `Bit32` in arrays.
    pub long_bytes: usize,
    /// Longest wait for the child: more than the library's own 3 s.
    pub deadline: Duration,
    /// The program that runs as the child; `None` is this one.
    pub program: Option<PathBuf>,
    /// Environment variables for the child.
    pub environment: Vec<(String, String)>,
}

/// The state of the connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Alive {
    /// Connections that events told of.
    pub connected: u64,
    /// Losses that events told of.
    pub lost: u64,
    /// Increases whenever the library was loaded anew.
    pub generation: u64,
}

struct HncConnection {
    child: ChildClient<HncItem>,
    settings: HncSettings,
}

/// A handle on the child; clones are handles on the same one.
#[derive(Clone)]
pub struct HncLine {
    connection: Arc<Mutex<HncConnection>>,
    name: String,
}

impl HncLine {
    /// Nothing is started before the first question.
    #[must_use]
    pub fn new(settings: HncSettings) -> Self {
        let mut child = ChildSettings::new(KIND, &[], settings.deadline);
        child.program.clone_from(&settings.program);
        child.environment.clone_from(&settings.environment);
        let name = settings.name.clone();
        let inner = HncConnection { child: ChildClient::new(child), settings };
        Self { connection: Arc::new(Mutex::new(inner)), name }
    }

    /// The address, as in the configuration.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How the child has been doing.
    #[must_use]
    pub fn counts(&self) -> ChildCounts {
        self.lock_connection().child.counts()
    }

    /// Loads and connects if need be, and tells whether the controller is there.
    ///
    /// # Errors
    /// [`SourceError::Line`] while it is not, with what the library says.
    pub fn query_connection(&self) -> Result<Alive, SourceError> {
        let mut inner = self.lock_connection();
        match inner.ask_child(&HncRequest::Alive, "its connection")? {
            HncReply::Alive { code: 0, connected, lost } => {
                Ok(Alive { connected, lost, generation: inner.child.child().generation() })
            }
            HncReply::Alive { code, .. } => Err(inner.line_failed(
                format!("the controller is not connected ({})", HncReturnCode(code)),
                "The library connects again by itself; check that the machine is on and the cable is in.",
            )),
            other => Err(inner.build_decode_error("its connection", &other)),
        }
    }

    /// Reads one item; see [`HncLine::read_each`].
    ///
    /// # Errors
    /// As there.
    pub fn read(&self, item: HncItem) -> Result<HncItemResult, SourceError> {
        self.read_each(&[item]).map(|mut results| results.pop().unwrap_or(Err(HncItemError::NotOffered)))
    }

    /// Reads items in one request to the child. One that the child dies of costs this item only; one that it has died of
    /// twice is not asked again.
    ///
    /// # Errors
    /// [`SourceError::Timeout`] on a dead link, [`SourceError::Line`] when the library cannot be loaded or connected.
    pub fn read_each(&self, items: &[HncItem]) -> Result<Vec<HncItemResult>, SourceError> {
        let mut inner = self.lock_connection();
        let mut results = Vec::with_capacity(items.len());
        while let Some(rest) = items.get(results.len()..).filter(|rest| !rest.is_empty()) {
            match inner.child.count_survived(rest) {
                0 => results.push(Err(HncItemError::NotOffered)),
                count => inner.read_some(&rest[..count], &mut results)?,
            }
        }
        Ok(results)
    }

    /// Writes registers one after the other.
    ///
    /// # Errors
    /// The first that is refused, or the line.
    pub fn write(&self, words: &[(ControllerRegister, i64)]) -> Result<(), SourceError> {
        let mut inner = self.lock_connection();
        for (at, value) in words {
            let request = format!("writing {at}");
            let Some(HncItem::Register(kind, index)) = define_register(*at) else {
                return Err(inner.build_refusal(&request, NO_REGISTER.to_owned()));
            };
            inner.request_action(&HncRequest::Write(kind, index, *value), &request)?;
        }
        Ok(())
    }

    /// The refusal of registers that the library has no number for.
    pub(super) fn refuse_register(&self, request: &str) -> SourceError {
        self.lock_connection().build_refusal(request, NO_REGISTER.to_owned())
    }

    /// Writes the channel's external zero offset of a logical axis, counts.
    ///
    /// # Errors
    /// It is refused, or the line failed.
    pub fn write_zero(&self, axis: i32, counts: i32) -> Result<(), SourceError> {
        self.lock_connection().request_action(&HncRequest::WriteZero(axis, counts), "writing the external zero offset")
    }

    /// Begins to sample.
    ///
    /// # Errors
    /// Refused where the library or the controller cannot, or somebody else samples.
    pub fn start_sampling(&self, items: &[SampledItem]) -> Result<(), SourceError> {
        let mut inner = self.lock_connection();
        match inner.ask_child(&HncRequest::Sample(items.to_vec()), "sampling")? {
            HncReply::Done => Ok(()),
            HncReply::Code(function, code) => Err(inner.build_refusal("sampling", format!("{function}: {code}"))),
            HncReply::Confused(what) => Err(inner.build_refusal("sampling", what)),
            other => Err(inner.build_decode_error("sampling", &other)),
        }
    }

    /// What has been sampled since the last time.
    ///
    /// # Errors
    /// See [`SourceError`].
    pub fn read_samples(&self) -> Result<Columns, SourceError> {
        let mut inner = self.lock_connection();
        match inner.ask_child(&HncRequest::Sampled, "the samples")? {
            HncReply::Sampled(columns) => Ok(columns),
            HncReply::Code(function, code) => Err(inner.build_refusal("the samples", format!("{function}: {code}"))),
            other => Err(inner.build_decode_error("the samples", &other)),
        }
    }

    /// Ends the child; the next question starts another one.
    pub fn end_child(&self) {
        self.lock_connection().child.end_child();
    }

    fn lock_connection(&self) -> MutexGuard<'_, HncConnection> {
        self.connection.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl HncConnection {
    /// Reads as many as one child survives, at least one.
    fn read_some(&mut self, items: &[HncItem], results: &mut Vec<HncItemResult>) -> Result<(), SourceError> {
        self.open_connection()?;
        let mut dead = None;
        let take = |told| match told {
            HncReply::Read(result) => {
                let malformed = matches!(result, Err(HncItemError::Malformed(_)));
                results.push(result);
                if malformed { Taken::Suspect } else { Taken::Good }
            }
            HncReply::DeadLink(took_ms) => {
                dead = Some(Duration::from_millis(took_ms));
                Taken::Last
            }
            other => {
                results.push(Err(HncItemError::Malformed(format!("{other:?}"))));
                Taken::Suspect
            }
        };
        let outcome = self.child.told_each(items, &HncRequest::Read(items.to_vec()), take);
        if let Some(took) = dead {
            return Err(self.dead_link(took));
        }
        if let Err((_, error)) = outcome {
            results.push(Err(HncItemError::Failed(error.to_string())));
        }
        Ok(())
    }

    /// A question whose failure ends the poll.
    fn ask_child(&mut self, ask: &HncRequest, request: &str) -> Result<HncReply, SourceError> {
        self.open_connection()?;
        let began = Instant::now();
        let told = self.child.request_answer(ask).map_err(|error| self.child_failed(&error, request))?;
        if began.elapsed() > DEAD_LINK { Err(self.dead_link(began.elapsed())) } else { Ok(told) }
    }

    /// Something to be done that is done or refused.
    fn request_action(&mut self, ask: &HncRequest, request: &str) -> Result<(), SourceError> {
        match self.ask_child(ask, request)? {
            HncReply::Done => Ok(()),
            HncReply::Code(_, code) => Err(self.build_refusal(request, code.to_string())),
            HncReply::Confused(what) => Err(self.build_refusal(request, what)),
            other => Err(self.build_decode_error(request, &other)),
        }
    }

    /// A child in which the connection is open.
    fn open_connection(&mut self) -> Result<(), SourceError> {
        if self.child.is_running() {
            return Ok(());
        }
        let settings = &self.settings;
        let ask = HncRequest::Open {
            vendor_library: settings.vendor_library.clone(),
            local_host: settings.local_host.clone().unwrap_or_else(|| local_host(&settings.endpoint)),
            local_port: settings.local_port,
            host: settings.endpoint.host.clone(),
            port: settings.endpoint.port,
            long_bytes: settings.long_bytes,
        };
        let told = self.child.request_answer(&ask).map_err(|error| self.child_failed(&error, "opening"));
        let failed = match told? {
            HncReply::Opened => return Ok(()),
            HncReply::Unloadable(what) => self.line_failed(
                format!("the library {} cannot be used: {what}", self.settings.vendor_library.display()),
                "Check library= in the address, and that the file is for this processor.",
            ),
            HncReply::Code(function, code) if function == "HNC_NetInit" => self.line_failed(
                format!("the library cannot listen at port {}: {code}", self.settings.local_port),
                "Give another local_port= in the address, or end the other program.",
            ),
            HncReply::Code(_, code) => self.line_failed(
                format!("the controller does not answer: {code}"),
                "Check that the machine is on, and its network number and port.",
            ),
            other => self.build_decode_error("opening", &other),
        };
        self.child.end_child();
        Err(failed)
    }

    fn line_failed(&self, what: String, next: &str) -> SourceError {
        SourceError::Line { source_name: self.settings.name.clone(), what, next: next.to_owned() }
    }

    fn child_failed(&mut self, error: &ChildError, request: &str) -> SourceError {
        match error {
            ChildError::Hung(deadline) => SourceError::Timeout {
                source_name: self.settings.name.clone(),
                request: request.to_owned(),
                deadline_ms: saturate_to_ms(*deadline),
                next: "The library hung and was ended; it is started again.".to_owned(),
            },
            other => self.line_failed(other.to_string(), "The child with the library is started again by itself."),
        }
    }

    fn dead_link(&self, took: Duration) -> SourceError {
        SourceError::Timeout {
            source_name: self.settings.name.clone(),
            request: "one of its values".to_owned(),
            deadline_ms: saturate_to_ms(took),
            next: "The link to the controller is dead; the library connects again by itself.".to_owned(),
        }
    }

    fn build_refusal(&self, request: &str, what: String) -> SourceError {
        SourceError::Refused {
            source_name: self.settings.name.clone(),
            request: request.to_owned(),
            what,
            next: "Look into the controller's manual whether it has this.".to_owned(),
        }
    }

    fn build_decode_error(&self, request: &str, told: &HncReply) -> SourceError {
        let what = match told {
            HncReply::Confused(what) => what.clone(),
            other => format!("{other:?}"),
        };
        SourceError::Decode { source_name: self.settings.name.clone(), request: request.to_owned(), what }
    }
}

/// The number of this computer by which the controller is reached; nothing is sent to find out.
fn local_host(at: &Endpoint) -> String {
    let found = UdpSocket::bind("0.0.0.0:0").and_then(|socket| {
        socket.connect((at.host.as_str(), at.port))?;
        socket.local_addr()
    });
    found.map_or_else(|_| "0.0.0.0".to_owned(), |address| address.ip().to_string())
}
