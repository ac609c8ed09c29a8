//! FANUC controllers over FOCAS2: everything a gateway needs in one round trip, with or without the vendor's library.
//!
//! ```text
//!   Item, Write ──► request ──► wire ──► TCP ──► controller           (native, the default)
//!   Item, Write ──► child process ──► the vendor's library ──► TCP    (vendor, optional)
//!        ▼                                   ▲
//!     decode ──► Answer, one result per item; an item can be refused alone
//!        ▼
//!     readings ──► channels in their units and states
//! ```
//!
//! | file | what |
//! |---|---|
//! | `wire` | frames, blocks, numbers: pure |
//! | `item`, `pmc`, `word`, `answer` | what can be asked and written, what comes back, typed |
//! | `table` | the one table of what goes over the wire |
//! | `generation` | generation, axes and spindles from the opening of a connection |
//! | `request`, `decode`, `records` | items as blocks and data as answers, in the encoding of the generation |
//! | `code` | every return code as cause and next step |
//! | `focas` | the one narrow trait over what the adapter needs |
//! | `native` | FOCAS2/Ethernet spoken by ourselves |
//! | `vendor` | the vendor's library in a child process |
//! | `facts` | what a control says once of itself, asked for until it has |
//! | `statistics` | what the round trips cost |
//! | `line` | the one connection that everything shares: opening, loss, power-off, duty cycle, allowed writes |
//! | `poll`, `source` | what is asked for at which pace; the groups as sources |
//! | `states`, `view`, `readings` | status words and signals as states, answers as channels; pure |
//! | `details` | the slow group: parts, times, texts, codes, tool life |
//! | `extra`, `own_item` | further axes and spindles, and what the user can have read |
//! | `refusals` | what is refused, one sentence per return code |
//! | `feed_override` | the inverted byte, and nothing else |
//! | `allow_list` | what may be written |
//! | `dial` | where the operator's dial stands |
//! | `actuator` | the feed override: mailbox, second override, macro variable, direct |
//! | `ladder` | bytes that gateway and ladder write for each other |
//! | `ladder_request` | feed hold and stop, latched once by the ladder |
//! | `work_offset` | the external work offset between programs |
//! | `open` | from an address to all of this |
//!
//! **Several paths** (`paths=1,2`, up to 3) share the connection: every block of a frame names its path, so the quick
//! group of all of them is one round trip where the control's longest answer holds it (two paths do on every
//! generation). The path that is named first has the plain channel names, and is the one that is written to, with its
//! override, its requests and its external offsets; the gate watches the plain names. The channels of another path N begin
//! with `pathN_`; signals of path N stand 1000 (N - 1) bytes further. Parts, gear stage, drive currents and temperature are
//! read of the first one only. `paths=2,1` writes to path 2 and reads path 1 besides; `path=2` reads nothing else.
//!
//! Where the facts come from: frames and layouts were fixed by watching the vendor's own client talk to a server of
//! ours and agree with two independent open clients; the manuals named beside the constants give the rest. No real
//! controller was available: what a certain series does differently will be found by `doctor`.
//!
//! What is deliberately absent: no retry inside a connection (a frame that does not fit ends it), no second
//! connection, no thread, no write outside the allowed addresses.

pub mod actuator;
pub mod address;
pub mod alarms;
pub mod allow_list;
pub mod answer;
pub mod axis_name;
pub mod code;
pub mod decode;
mod details;
pub mod dial;
pub mod extra;
pub mod facts;
mod fast_channels;
pub mod feed_override;
pub mod focas;
pub mod generation;
pub mod item;
pub mod ladder;
mod ladder_request;
pub mod line;
mod manner;
pub mod native;
pub mod open;
pub mod own_item;
mod pmc;
pub mod poll;
pub mod poll_period;
pub mod readings;
mod records;
mod refusals;
pub mod request;
pub mod source;
pub mod states;
pub mod statistics;
pub mod table;
pub mod vendor;
mod view;
pub mod wire;
mod word;
pub mod work_offset;

pub use details::list_slow_questions;

#[cfg(test)]
mod line_tests;
