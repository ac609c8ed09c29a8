//! The keys of backups that are taken by themselves.

use super::config_key::Absent::{Default, Optional};
use super::config_key::ValueKind::{Flag, Number, Path};
use super::config_key::{ConfigKey, new_key};

pub(super) const BACKUP: &[ConfigKey] = &[
    new_key(
        ("backup", "directory"),
        Path,
        Optional,
        "Where backups go: a directory, a stick or a share that is mounted there; without it none is taken by itself",
        "备份目录(可为 U 盘或网络共享的挂载点)",
    ),
    new_key(("backup", "every_h"), Number(1.0, 8760.0), Default("24.0"), "Time between two backups", "备份间隔(小时)"),
    new_key(
        ("backup", "keep"),
        Number(1.0, 1000.0),
        Default("14"),
        "So many are kept; whole number; the oldest goes first",
        "保留份数",
    ),
    new_key(
        ("backup", "history"),
        Flag,
        Default("false"),
        "Copy the history beside each backup, too; it is as large as the history",
        "同时复制历史数据库",
    ),
];
