//! What is spoken with at the machine: FANUC and Huazhong controllers, agents of MTConnect, meters, and outages of their lines.
//!
//! The suites of one folder are one program, because each program links everything: `cargo test --test controllers fanuc::` runs
//! one suite, `cargo test --test controllers fanuc::ages` a part of it.

mod fanuc;
mod huazhong;
mod meters;
mod mtconnect;
mod outages;
