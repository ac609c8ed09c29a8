//! What a person may do, from least to most. Each role may do everything that the ones before it may.

use serde::{Deserialize, Serialize};
use std::fmt;

/// What a person may do: each role may do what the ones before it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Reads, and gives the machine back to its dial.
    Viewer,
    /// Edits rules, tables and settings; acknowledges alarms.
    Setter,
    /// Lets the gate write to the machine, where the configuration allows that from the page.
    Armer,
    /// Manages persons, backups and everything else.
    Admin,
}

impl Role {
    /// All of them, from least to most.
    pub const ALL: [Self; 4] = [Self::Viewer, Self::Setter, Self::Armer, Self::Admin];

    /// The word in files, documents and on the command line.
    #[must_use]
    pub const fn as_word(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Setter => "setter",
            Self::Armer => "armer",
            Self::Admin => "admin",
        }
    }

    /// The word in Chinese.
    #[must_use]
    pub const fn as_chinese_word(self) -> &'static str {
        match self {
            Self::Viewer => "查看",
            Self::Setter => "调试",
            Self::Armer => "授权写入",
            Self::Admin => "管理",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_word())
    }
}
