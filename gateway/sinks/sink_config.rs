//! A sink as the configuration names it.

use crate::SinkAddress;

/// One section `[[sink]]`: a receiver of what leaves the box.
#[derive(Debug, Clone, PartialEq)]
pub struct SinkConfig {
    /// Where it is and how to talk to it.
    pub address: SinkAddress,
    /// Short name; the text of the address when none was given.
    pub name: String,
    /// May computers on its network ask the gate for something?
    pub allow_requests: bool,
    /// May computers on its network tell facts of production?
    pub allow_facts: bool,
}
