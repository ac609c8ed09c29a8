//! What parent and child say, as JSON: small, and legible in a debugger.

use crate::answer::FocasItemResult;
use crate::code::FocasReturnCode;
use crate::generation::Opening;
use crate::item::{Question, Write};
use adapter_core::text::TextEncoding;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// From the parent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum FocasRequest {
    /// Load the library and connect.
    Open {
        /// The library's file.
        vendor_library: PathBuf,
        /// The controller.
        host: String,
        /// Its port.
        port: u16,
        /// Path from 1.
        path: u8,
        /// The library's own patience, s.
        timeout_s: i32,
        /// Character set of the controller's texts.
        encoding: TextEncoding,
    },
    /// Read these, one answer for each as soon as it is there. After an answer that cannot be trusted no other comes.
    Read(Vec<Question>),
    /// Write.
    Write(Write),
}

/// From the child.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum FocasReply {
    /// Connected.
    Opened(Opening),
    /// The library could not be loaded, or lacks what nothing works without.
    Unloadable(String),
    /// A return code of opening or writing.
    Code(FocasReturnCode),
    /// Written.
    Written,
    /// One item.
    Read(FocasItemResult),
    /// The request made no sense, or there is no connection.
    Confused(String),
}
