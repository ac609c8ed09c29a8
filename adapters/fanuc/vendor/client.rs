//! The parent's side: the library through its child.

use super::KIND;
use super::message::{FocasReply, FocasRequest};
use crate::answer::{FocasItemError, FocasItemResult, Refusal};
use crate::code::{Consequence, FocasReturnCode};
use crate::focas::{Focas, FocasError};
use crate::generation::Opening;
use crate::item::{Question, Write};
use adapter_core::address::Endpoint;
use adapter_core::stream;
use adapter_core::text::TextEncoding;
use device_line::child::{ChildClient, ChildCounts, ChildError, ChildSettings, Taken};
use std::io::ErrorKind;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What the child may take longer than the library's own patience, which is about a second more than it is told.
const GRACE: Duration = Duration::from_millis(1500);

/// How the library is used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VendorSettings {
    /// The file of the vendor's library.
    pub vendor_library: PathBuf,
    /// Where the controller is.
    pub endpoint: Endpoint,
    /// Path of the control, counted from 1.
    pub path: u8,
    /// The library's patience with the controller; whole seconds, at least one.
    pub timeout: Duration,
    /// Character set of the controller's texts.
    pub encoding: TextEncoding,
    /// Longest wait for the child; `None` follows from `timeout`.
    pub deadline: Option<Duration>,
    /// The program that runs as the child; `None` is this one.
    pub program: Option<PathBuf>,
    /// Environment variables for the child.
    pub environment: Vec<(String, String)>,
}

/// A controller through the vendor's library.
pub struct Vendor {
    child: ChildClient<Question>,
    settings: VendorSettings,
    opening: Opening,
}

impl Vendor {
    /// Starts a child, loads the library and connects.
    ///
    /// # Errors
    /// See [`FocasError`].
    pub fn connect(settings: VendorSettings) -> Result<Self, FocasError> {
        let patience = Duration::from_secs(u64::from(round_up_seconds(settings.timeout).unsigned_abs()));
        let mut child = ChildSettings::new(KIND, &[], settings.deadline.unwrap_or(patience + GRACE));
        child.program.clone_from(&settings.program);
        child.environment.clone_from(&settings.environment);
        child.pause_min = Duration::ZERO;
        let mut child = ChildClient::new(child);
        let opening = open_connection(&mut child, &settings)?;
        Ok(Self { child, settings, opening })
    }

    /// How the child has been doing.
    #[must_use]
    pub fn counts(&self) -> ChildCounts {
        self.child.counts()
    }

    /// Process number of the child.
    #[must_use]
    pub fn process_id(&self) -> Option<u32> {
        self.child.child().process_id()
    }

    /// Asks a child in which the connection is open; opens it in a new child.
    fn ask_child(&mut self, ask: &FocasRequest) -> Result<Result<FocasReply, ChildError>, FocasError> {
        if !self.child.is_running() {
            self.opening = open_connection(&mut self.child, &self.settings)?;
        }
        Ok(self.child.request_answer(ask))
    }

    /// Reads as many of the questions as one child survives; the answers, in order, at least one.
    fn read(&mut self, questions: &[Question]) -> Result<Vec<FocasItemResult>, FocasError> {
        if !self.child.is_running() {
            self.opening = open_connection(&mut self.child, &self.settings)?;
        }
        let mut answers = Vec::with_capacity(questions.len());
        let take = |told| {
            answers.push(match told {
                FocasReply::Read(result) => result,
                other => Err(FocasItemError::Malformed(format!("{other:?}"))),
            });
            if matches!(answers.last(), Some(Err(FocasItemError::Malformed(_)))) { Taken::Suspect } else { Taken::Good }
        };
        if let Err((fatal, error)) = self.child.told_each(questions, &FocasRequest::Read(questions.to_vec()), take) {
            answers.push(Err(FocasItemError::Failed(format!("the library failed in {fatal:?}: {error}"))));
        }
        Ok(answers)
    }
}

/// Whole seconds, at least one: zero would mean for ever.
fn round_up_seconds(timeout: Duration) -> i32 {
    timeout.as_secs_f64().ceil().max(1.0) as i32
}

fn open_connection(child: &mut ChildClient<Question>, settings: &VendorSettings) -> Result<Opening, FocasError> {
    let ask = FocasRequest::Open {
        vendor_library: settings.vendor_library.clone(),
        host: settings.endpoint.host.clone(),
        port: settings.endpoint.port,
        path: settings.path,
        timeout_s: round_up_seconds(settings.timeout),
        encoding: settings.encoding,
    };
    let opened = match child.request_answer(&ask).map_err(|error| FocasError::Library(error.to_string()))? {
        FocasReply::Opened(opening) => return Ok(opening),
        FocasReply::Code(code @ FocasReturnCode::SOCKET) => no_socket(settings, code),
        FocasReply::Code(FocasReturnCode(-17)) => FocasError::NoSession,
        FocasReply::Code(code) => FocasError::Refused(Refusal { code, detail: 0 }),
        FocasReply::Unloadable(what) => FocasError::Unusable(format!("{}: {what}", settings.vendor_library.display())),
        other => FocasError::Library(format!("{other:?}")),
    };
    child.end_child();
    Err(opened)
}

/// What the library's one code for every failed connection means: a connection of our own tells.
fn no_socket(settings: &VendorSettings, code: FocasReturnCode) -> FocasError {
    match stream::connect_host(&settings.endpoint, Instant::now() + settings.timeout) {
        Ok(_) => FocasError::Timeout(settings.timeout),
        Err(error) if error.kind() == ErrorKind::ConnectionRefused => FocasError::NobodyThere(code.to_string()),
        Err(_) => FocasError::Unreachable(code.to_string()),
    }
}

impl Focas for Vendor {
    fn opening(&self) -> &Opening {
        &self.opening
    }

    fn ask_questions(&mut self, questions: &[Question], out: &mut Vec<FocasItemResult>) -> Result<(), FocasError> {
        let before = out.len();
        let mut rest = questions;
        while !rest.is_empty() {
            let answers = match self.child.count_survived(rest) {
                0 => vec![Err(FocasItemError::NotOffered)],
                count => self.read(&rest[..count]).inspect_err(|_| out.truncate(before))?,
            };
            rest = rest.get(answers.len()..).unwrap_or_default();
            out.extend(answers);
        }
        Ok(())
    }

    fn write(&mut self, write: &Write) -> Result<(), FocasError> {
        match self.ask_child(&FocasRequest::Write(write.clone()))? {
            Ok(FocasReply::Written) => Ok(()),
            Ok(FocasReply::Code(code)) if code.consequence() == Consequence::Reconnect => {
                Err(FocasError::Broken(code.to_string()))
            }
            Ok(FocasReply::Code(code)) => Err(FocasError::Refused(Refusal { code, detail: 0 })),
            Ok(FocasReply::Confused(_)) => Err(FocasError::Refused(Refusal { code: FocasReturnCode::FUNC, detail: 0 })),
            Ok(other) => Err(FocasError::Library(format!("{other:?}"))),
            Err(error) => Err(FocasError::Library(error.to_string())),
        }
    }
}
