//! What parent and child say, as JSON: small, and legible in a debugger.

use crate::answer::FocasItemResult;
use crate::code::FocasReturnCode;
use crate::generation::Opening;
use crate::item::{Question, Write};
use adapter_core::text::TextEncoding;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum FocasRequest {
    /// Load the library and connect.
    Open {
        vendor_library: PathBuf,
        host: String,
        port: u16,
        path: u8,
        /// The library's own patience, s.
        timeout_s: i32,
        /// Character set of the controller's texts.
        encoding: TextEncoding,
    },
    /// Read these, one answer for each as soon as it is there. After an answer that cannot be trusted no other comes.
    Read(Vec<Question>),
    Write(Write),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum FocasReply {
    Opened(Opening),
    /// The library could not be loaded, or lacks what nothing works without.
    Unloadable(String),
    /// A return code of opening or writing.
    Code(FocasReturnCode),
    Written,
    Read(FocasItemResult),
    /// The request made no sense, or there is no connection.
    Confused(String),
}
