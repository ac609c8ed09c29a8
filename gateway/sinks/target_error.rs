//! What can be wrong with the part of an address that its scheme gives a meaning.

use adapter_core::address::AddressProblem;
use gateway_nats::ClusterAddressError;
use thiserror::Error;

/// What is wrong with the part of an address that its scheme gives a meaning.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub(super) enum TargetError {
    /// No sink has this scheme.
    #[error("{known}")]
    UnknownScheme { known: String },
    /// This program was built without this sink.
    #[cfg(not(feature = "opcua"))]
    #[error("this program was built without OPC UA; `cargo build --release --features opcua` makes one that has it")]
    NotBuiltIn,
    /// A host is none.
    #[error(transparent)]
    Host(AddressProblem),
    /// The servers of a cluster are none.
    #[error(transparent)]
    Cluster(#[from] ClusterAddressError),
    /// There is no directory to write to.
    #[error("write the directory, such as parquet:/var/lib/cnc-gateway/lake")]
    NoDirectory,
    /// No topic of MQTT can begin so.
    #[error("{prefix:?} is no beginning of a topic; leave out + and #, and $ at its beginning")]
    Topic { prefix: String },
    /// No subject of NATS can begin so.
    #[error("{prefix:?} is no beginning of a subject; write words with points between, such as cnc.hall-2")]
    Subject { prefix: String },
    /// Sparkplug needs a group and a node.
    #[error("no group and node; write sparkplug://BROKER:1883/GROUP/NODE/DEVICE")]
    NoNode,
    /// A name of Sparkplug that is none.
    #[error("{part:?} is no name of a group, node or device: leave out + and #")]
    NodeName { part: String },
    /// What is posted to is none.
    #[error("{path:?} is no path of an HTTP address; write %20 for a blank")]
    Path { path: String },
    /// Nobody could tell who has sent an alarm.
    #[error("write secret_file=FILE: its first line is the secret that messages are signed with")]
    NoSecret,
    /// Mails come from nobody.
    #[error("write from=ADDRESS: whom the mail server lets send")]
    NoSender,
    /// Mails go to nobody.
    #[error("write to=ADDRESS or to=ADDRESS,ADDRESS: who gets the alarms")]
    NoRecipient,
    /// What is written is no address of mail.
    #[error("{text:?} is no mail address; write one such as shop@works.example, and a list with commas")]
    Mailbox { text: String },
    /// A list that belongs to the mail server.
    #[error("{count} recipients are more than {most}; make a list at the mail server")]
    TooManyRecipients { count: usize, most: usize },
    /// A server that lets nobody in.
    #[cfg(feature = "opcua")]
    #[error("nobody could sign in: write user= and password_file=, or anonymous=yes")]
    NoSignIn,
}
