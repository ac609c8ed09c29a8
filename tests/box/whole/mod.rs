//! The whole box: real child processes, sockets, files, signals and a browser.

mod backup;
mod brought;
mod browser;
mod clock;
mod cost;
mod diagnosing;
mod editing;
mod hostile;
mod http;
mod kill;
mod lives;
mod operations;
mod package;
mod packaged_root;
mod page;
mod replay;
mod service;
mod settings;
mod system;
pub(crate) mod twin;
mod update;
mod update_scenarios;
mod views;
mod watchdog;
mod wear;
mod words;
mod year;
