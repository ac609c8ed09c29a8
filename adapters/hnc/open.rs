//! From an address to a source and, where a mailbox is named, an actuator.

use super::actuator::HncActuator;
use super::line::{HncSettings, Line};
use super::source::HncSource;
use crate::address::{Address, HncNetTarget};
use crate::driver::Actuator;
use crate::open::{Opened, Refused};
use std::time::Duration;

/// A call on a dead link takes the library 3 s.
const DEADLINE: Duration = Duration::from_millis(4500);

/// Opens an address; the child is started with the first poll.
#[must_use]
pub fn open(address: &Address, target: &HncNetTarget) -> Opened {
    let line = Line::new(HncSettings {
        name: address.text().to_owned(),
        vendor_library: target.vendor_library.clone(),
        at: target.at.clone(),
        local_host: target.local_host.clone(),
        local_port: target.local_port,
        long_bytes: target.long_bytes,
        deadline: DEADLINE,
        program: None,
        environment: Vec::new(),
    });
    let source = HncSource::new(line.clone(), Duration::from_millis(target.period_ms), target.sample);
    let actuator = target.mailbox.map(|first| Box::new(HncActuator::new(line, first)) as Box<dyn Actuator>);
    Opened { sources: vec![Box::new(source)], actuator, simulated: None, refused: Refused::default() }
}
