//! Controls behind an MTConnect agent (ANSI/MTC1.4, Parts 1 to 3): Okuma, Mazak, Haas and every other with an adapter.
//!
//! The agent is an HTTP server in the shop's network; its documents are XML. It is asked what the device has (`probe`), what that says now
//! (`current`), and then for every observation in the order of its sequence number (`sample`), as one answer that does not end.
//!
//! | file | what |
//! |---|---|
//! | `address` | what an `mtconnect://` address says |
//! | `deadline`, `http`, `body`, `multipart` | a request with its limits of time and size; the parts of an answer that does not end |
//! | `xml`, `streams` | MTConnectStreams and MTConnectError as a sequence of events; recordings are read with it too |
//! | `standard` | types of the standard with their units and words |
//! | `model` | MTConnectDevices: components and data items of a device |
//! | `place`, `rows`, `plan` | which data item feeds which channel, in which unit |
//! | `words` | states, tools, blocks and flags in the words of the channels |
//! | `conditions` | which faults and warnings stand |
//! | `sequence` | which observation is new, what was overwritten before it was read, whether the agent has started anew |
//! | `device_clock` | from the times of the observations to the gateway's clock |
//! | `agent`, `feed` | questions to one agent; the answer that does not end, or a question at every poll |
//! | `held_values` | what every channel says, from one poll to the next |
//! | `own_data_item` | what the user can have read |
//! | `source`, `history` | the [`Source`](adapter_core::Source); what has been lost so far, as facts and problems |
//!
//! **Once each.** An observation has a sequence number, the agent a buffer of some thousand of them. After a broken line the next
//! question begins where the last answer ended. What the agent has overwritten meanwhile is counted and told. Another `instanceId` is an agent
//! that has started anew: its devices are asked for again, and nothing has a value until they are known.
//!
//! **A change is told, a value that stays is not.** Every part of the answer, also an empty one (the heartbeat), says that all other
//! values are as before. So every poll with a part makes a reading of every channel; without a part the values become stale, and after
//! [`address::MtConnectTarget::timeout_ms`] the line counts as broken.
//!
//! **Off.** `AVAILABILITY` says whether the adapter reaches the control. `UNAVAILABLE` is a control that does not answer
//! ([`Absence::Disconnected`](adapter_core::Absence::Disconnected)), and never a machine that is off; an agent that refuses the connection is no machine either.
//!
//! **Units.** An agent converts into the unit that the data item names (`units`). Where it names none, the numbers are native ones, with
//! `nativeUnits` and `nativeScale`; where it names neither, those of the standard for its type.
//!
//! **Limits.** A document of [`multipart::DOCUMENT_BYTES_MAX`], [`model::ITEMS_MAX`] data items, `agent::OBSERVATIONS_MAX`
//! observations in a document, and [`deadline::REQUEST_MAX`] for all questions of a poll.

pub mod address;
mod agent;
mod body;
mod conditions;
pub mod deadline;
mod device_clock;
mod feed;
mod held_values;
mod history;
mod http;
pub mod model;
pub mod multipart;
mod own_data_item;
mod place;
mod plan;
mod rows;
mod sequence;
mod source;
pub mod standard;
pub mod streams;
mod words;
pub mod xml;

#[cfg(test)]
mod scripted_agent;
#[cfg(test)]
mod source_tests;

pub use own_data_item::OwnDataItem;
pub use plan::list_channels;
pub use source::MtConnectSource;
