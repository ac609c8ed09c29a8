//! The codes of a broker in words.

use super::Version;

/// Table 3.1 of the standard: why a connection is refused. From 5 on section 5-3.2.2.2.
pub(super) fn describe_connect_refusal(version: Version, code: u8) -> String {
    if version == Version::V5 {
        return describe_reason(code);
    }
    match code {
        1 => "it does not speak MQTT 3.1.1".to_owned(),
        2 => "the name of this client".to_owned(),
        3 => "it is not available now".to_owned(),
        4 => "user or password are wrong".to_owned(),
        5 => "this user may not connect".to_owned(),
        other => format!("code {other}"),
    }
}

/// Section 5-2.4: the codes of version 5 that say no.
pub(super) fn describe_reason(code: u8) -> String {
    let text = match code {
        0x81 | 0x82 => "it does not understand what was sent",
        0x84 => "it does not speak MQTT 5; write protocol=3.1.1",
        0x85 => "the name of this client",
        0x86 => "user or password are wrong",
        0x87 => "this user may not do that",
        0x88 | 0x89 => "it is not available now",
        0x8a => "this client is banned",
        0x8b => "it is shutting down",
        0x8c => "the way of authentication",
        0x8d => "it heard nothing for too long",
        0x8e => "another client has connected with the same name",
        0x8f => "the form of the subscription",
        0x90 => "the name of the topic",
        0x93 => "too many messages at once",
        0x95 => "the message is larger than it takes",
        0x96 => "too many messages in a short time",
        0x97 => "its quota is exceeded",
        0x98 => "an administrator has ended this",
        0x99 => "the form of the payload",
        0x9a => "it keeps no messages for later",
        0x9b => "the quality of service",
        0x9c | 0x9d => "it wants another broker to be used",
        0x9f => "too many connections in a short time",
        _ => return format!("code {code:#04x}"),
    };
    text.to_owned()
}
