//! Huazhong controllers (and others) by NC-Link: JSON messages over an MQTT broker. T/CMTBA 1008, GB/T 41970-2022.
//!
//! Device and client both dial the broker; a device is known by its serial number, which is the last part of its topics.
//!
//! | file | what |
//! |---|---|
//! | `lenient_json` | reading JSON that several makers write differently |
//! | `topic` | the topics of a device |
//! | `message` | query and set: requests as JSON, answers as values or reasons |
//! | `model` | the answer to a probe: data items with their paths, sample channels |
//! | `sample`, `begin_time` | one message of a sample channel: columns of values, their times |
//! | `item_conversion` | what a number of an item is in the unit of a channel, polled or sampled |
//! | `map`, `own_path` | which data item feeds which channel, in which unit; what the user can have read |
//! | `decode` | state words from the status item and from the channel's F register |
//! | `connection` | one client at the broker: probe, query, set, by request identifier |
//! | `source`, `open` | the [`Source`](adapter_core::Source), and how an address becomes one |
//! | `sample_tracks` | what sample channels and events have brought, and whether a millisecond is missing |
//! | `mailbox` | the registers through which the ladder is asked for an override |
//! | `actuator` | the [`Actuator`](adapter_core::Actuator): letters into the mailbox, the override in force read back |
//! | `offset_mailbox` | the registers through which the ladder is asked to shift axes |
//! | `registers`, `offsets` | a connection for whoever writes; the registers of a device for such shifts |
//!
//! **Flow.** `source` connects, probes the model, keeps the items that `map` knows, and at every poll sends one query
//! for all of them; the answer is stamped with the middle of the request. Messages of sample channels (1 ms data,
//! uploaded each 200 ms) and events arrive in between: they are followed by `sample_tracks`, which counts missing milliseconds,
//! and whole blocks go to whoever asked for them with [`NcLinkSource::on_block`]: with `sample=yes` the box makes a
//! feature of the spindle's load current out of them. They make no readings here; the values at a tick are those of the
//! query. A question that is not answered in time, a broker that is gone, a device that says `NG` and an answer without
//! sense are four different errors. After a broken line the next poll connects anew.
//!
//! **Dialects.** Read as they come: `setable` and `settable`, `datatype` and `dataType`, `WARNING` and `WARNNING`; items
//! named by node number (`010302`) or by path, with or without a leading `/` and the device's type; numbers in quotes;
//! `value` and `values`; samples without `paths` (their order is that of the model) and with `[]` for no value; several
//! values per instant. Which way a device names its items is seen in its model, and tried the other way round once when
//! everything is refused.
//!
//! **Another model.** A device that registers itself, or tells a version of its model, is asked for its model again before a value
//! is believed: the same node numbers may mean something else. Answers and samples in between are dropped. A device that does
//! neither is asked once a minute.
//!
//! **Units.** Where the model tells the unit of an item, its number is converted; a unit that is not known costs the channel
//! its value, with that reason. An item that another maker has put under another component is found where it is the only one
//! of its name.
//!
//! **Limits.** A model of at most [`model::ITEMS_MAX`] items, [`sample::VALUES_MAX`] values in a sample message, one
//! request at a time. `nclinks://` is the same over TLS.
//!
//! **Certain and not.** Topics and messages are those of open implementations and their recorded wire samples. Not
//! published anywhere and to be checked on a machine: the meaning of the status item's numbers (so mode and execution are
//! taken from the channel's F word, whose bits are known), the unit of the load current (taken as A), and the register
//! offsets of configurations other than HNC-30 (key `f_channel`).

mod actuator;
pub mod address;
mod begin_time;
pub mod connection;
mod decode;
pub mod item_conversion;
pub mod lenient_json;
pub mod mailbox;
mod map;
pub mod message;
pub mod model;
pub mod offset_mailbox;
mod offsets;
mod open;
mod own_path;
mod registers;
pub mod sample;
mod sample_tracks;
mod source;
pub mod topic;

pub use actuator::NcLinkActuator;
pub use begin_time::ForeignClock;
pub use message::{NcLinkAnswer, Params, RequestedItem};
pub use open::{open_address, open_sampled};
pub use own_path::OwnPath;
pub use sample_tracks::{ChannelTrack, SampleTracks};
pub use source::{BlockSink, NcLinkSource};
