//! What the adapter needs of a controller, however it is talked to.

use super::answer::{FocasItemResult, Refusal};
use super::generation::Opening;
use super::item::{Question, Write};
use std::time::Duration;
use thiserror::Error;

/// Asks and writes. Three implementations: [`Native`](super::native::Native) over TCP, the vendor's library in a child
/// process, and a mock in tests.
pub trait Focas: Send {
    /// What the controller said when the connection was opened.
    fn opening(&self) -> &Opening;

    /// Asks all questions, of whatever paths, in as few round trips as this way of talking allows, and appends one
    /// result per question to `out`, in the same order.
    ///
    /// # Errors
    /// The connection as a whole failed; it is not usable any more and `out` holds nothing new.
    fn ask_questions(&mut self, questions: &[Question], out: &mut Vec<FocasItemResult>) -> Result<(), FocasError>;

    /// Writes, on the path that the connection was made for.
    ///
    /// # Errors
    /// [`FocasError::Refused`] when the controller says no, after which the connection is still good; any other error
    /// as in [`Focas::ask_questions`].
    fn write(&mut self, write: &Write) -> Result<(), FocasError>;
}

/// Why a connection gave nothing.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FocasError {
    /// The host is there and nobody listens on the port.
    #[error("nobody answers on this port: {0}")]
    NobodyThere(String),
    /// The host does not answer at all.
    #[error("the host does not answer: {0}")]
    Unreachable(String),
    /// The name of the host is not known.
    #[error("the name of the host is not known: {0}")]
    Name(String),
    /// Every connection that the controller can serve is in use.
    #[error("the controller has no free connection")]
    NoSession,
    /// The connection broke while it was used.
    #[error("the connection broke: {0}")]
    Broken(String),
    /// An answer began and did not end: the control lives, and the line or the control is at fault.
    #[error("the answer ended after {got} bytes{}", if .waited.is_some() { "; nothing more came" } else { ", then the connection" })]
    Cut {
        /// Bytes that came of the answer.
        got: usize,
        /// How long more was waited for; `None` when the connection was closed.
        waited: Option<Duration>,
    },
    /// No answer in time.
    #[error("no answer within {} ms", .0.as_millis())]
    Timeout(Duration),
    /// The answer is no answer to the question.
    #[error("{0}")]
    Protocol(String),
    /// The controller refused to be written to.
    #[error("{}", .0.code)]
    Refused(Refusal),
    /// What runs the vendor's library failed.
    #[error("{0}")]
    Library(String),
    /// The vendor's library cannot be loaded, or lacks what nothing works without.
    #[error("the library cannot be used: {0}")]
    Unusable(String),
    /// This address may not be written to.
    #[error("{0}")]
    NotAllowed(String),
}

impl FocasError {
    /// What to do next.
    #[must_use]
    pub fn next(&self) -> String {
        let fixed = match self {
            Self::NobodyThere(_) => {
                "Check that FOCAS2/Ethernet is enabled on the controller and the port (8193 unless changed)"
            }
            Self::Unreachable(_) => "Check power, cable and address of the controller",
            Self::Name(_) => "Write the number of the host, or put its name into the hosts file",
            Self::NoSession => "Close other programs that read this controller, or wait until their connections expire",
            Self::Broken(_) | Self::Timeout(_) | Self::Cut { .. } => {
                "It is tried again by itself; if it lasts, look at cable and switch"
            }
            Self::Protocol(_) => "Check that this is the FOCAS2 port of a FANUC controller",
            Self::Refused(refusal) => return refusal.code.next().to_owned(),
            Self::Library(_) => "The child process is started again by itself; backend=native needs no library",
            Self::Unusable(_) => {
                "Check library= in the address, and that the file is for this processor; backend=native needs none"
            }
            Self::NotAllowed(_) => "Add it to allow= in the address if the ladder is made for it",
        };
        fixed.to_owned()
    }
}
