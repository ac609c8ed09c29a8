//! What is on its way to other systems: everything that leaves the box, with one number each, kept until every sink has
//! delivered it.
//!
//! # Why it lies in the history database
//! An item becomes durable in the same transaction as the sample or record it came from. A box that is killed has
//! therefore neither sent something it does not remember, nor remembers something that is never sent.
//!
//! # Data
//! An [`Item`] is the values of one tick that changed ([`OutboxSettings`] says what counts as a change), one record (a state,
//! part, alarm, decision, diagnosis or event), a [`Gap`] in which there were no samples, or the means of a minute, hour or
//! day. Items are numbered from 1 without holes over the life of the database; the
//! number together with [`Outbox::box_id`] and the [`epoch`] of the life that gave it names an item everywhere, also where the database is a
//! copy that was put back. The items of one commit lie in one compressed row of
//! the table `outbox`; the table `outbox_sinks` holds what each sink still has to deliver.
//!
//! # Bounds
//! The outbox holds at most [`OutboxSettings::max_bytes`] and nothing older than [`OutboxSettings::max_age`]. What is dropped by
//! that is counted for each sink that had not delivered it ([`DeliveryState::dropped`]). While no sink is configured nothing
//! is gathered and the tables do not exist.
//!
//! # Who does what
//! `report` decides which values of a tick are worth sending, `means` when a minute, hour or day is over, `gather` numbers them on the writer thread, `store` puts them
//! into the transaction of the commit, `position` is the arithmetic of what is delivered, [`Outbox`] is the handle through
//! which sinks read ([`OutboxReader`]) and acknowledge.

mod epoch;
mod gather;
mod handle;
mod item;
mod line;
mod means;
mod means_again;
mod number;
mod position;
mod property;
mod reader;
mod redate;
mod report;
mod resend;
mod store;

pub use epoch::RESENT_EPOCH;
pub(crate) use gather::Gatherer;
pub use handle::{DeliveryState, Outbox, OutboxFigures, OutboxHead};
pub use item::parse_nested_json;
pub use item::{Cell, Content, Gap, Item, Reading, SeriesInfo, SeriesMean};
pub use line::NOT_RUNNING;
pub use position::Position;
pub use reader::{OutboxReader, OutboxStretch};
pub use redate::ItemMove;
pub(crate) use redate::{RedatedItems, redate_items};
pub use report::OutboxSettings;
pub use resend::ResentItems;
pub use store::box_id;
pub(crate) use store::{create_like, known_box_id, next_sequence_of};
