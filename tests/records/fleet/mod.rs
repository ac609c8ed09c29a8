//! Many boxes and one database: real NATS servers and a real PostgreSQL, and what is left when parts of them die.
//!
//! `nats-server` and `initdb` are looked for; where one is not installed the tests say that they skip, with `CNC_GATEWAY_CI` set
//! they fail.

mod backfill;
mod boxes;
mod identity;
mod intake;
mod killed;
mod means;
mod monitoring;
mod panels;
pub(crate) mod partitions;
mod pipeline;
mod poison;
mod postgres;
mod questions;
mod redated;
mod resent;
mod restored;
mod secured;
mod shifts;
mod silent_box;
mod sizes;
mod stream_size;
mod told;
mod versions;
