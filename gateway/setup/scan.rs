//! Looking for controls in a range of addresses, when a person asks for it. One connection to each address, nothing is sent.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use thiserror::Error;

/// Greatest number of addresses of one look: a network of a shop floor, so that a slip of the keyboard does not search a
/// whole company.
const ADDRESSES_MAX: u32 = 1024;
/// Connections at the same time: few enough for the small router of a cabinet.
const AT_ONCE: usize = 32;
/// A control in the same network answers within some milliseconds.
const CONNECT_WITHIN: Duration = Duration::from_millis(400);

/// Ports where a control listens, with what is there.
const PORTS: [(u16, &str); 2] = [(8193, "fanuc"), (10001, "hncnet")];

/// A range of IPv4 addresses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AddressRange {
    first: u32,
    count: u32,
}

/// Why a text is no range.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RangeError {
    /// It has another form.
    #[error("{0} is no range; write it as 192.168.1.0/24 or 192.168.1.10-60")]
    Form(String),
    /// It is too large.
    #[error("{0} addresses are too many; at most {ADDRESSES_MAX} are looked at")]
    TooMany(u32),
}

impl std::str::FromStr for AddressRange {
    type Err = RangeError;

    fn from_str(text: &str) -> Result<Self, RangeError> {
        let form = || RangeError::Form(text.to_owned());
        let range = match (text.split_once('/'), text.split_once('-')) {
            (Some((address, bits)), _) => {
                let address: Ipv4Addr = address.parse().map_err(|_| form())?;
                let bits: u32 = bits.parse().ok().filter(|bits| (8..=32).contains(bits)).ok_or_else(form)?;
                let count = 1_u32 << (32 - bits);
                Self { first: u32::from(address) & !(count - 1), count }
            }
            (None, Some((address, last))) => {
                let address: Ipv4Addr = address.parse().map_err(|_| form())?;
                let last: u8 = last.parse().map_err(|_| form())?;
                let own = address.octets()[3];
                let count = u32::from(last).checked_sub(u32::from(own)).ok_or_else(form)? + 1;
                Self { first: u32::from(address), count }
            }
            (None, None) => Self { first: u32::from(text.parse::<Ipv4Addr>().map_err(|_| form())?), count: 1 },
        };
        if range.count > ADDRESSES_MAX { Err(RangeError::TooMany(range.count)) } else { Ok(range) }
    }
}

/// Something that listens where a control would.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundControl {
    /// Its address, as in the configuration.
    pub address: String,
}

/// Everything in the range that listens where a control would, in the order of the addresses.
#[must_use]
pub fn scan_for_controls(range: AddressRange) -> Vec<FoundControl> {
    scan_ports(range, &PORTS)
}

fn scan_ports(range: AddressRange, ports: &[(u16, &str)]) -> Vec<FoundControl> {
    let next = AtomicU32::new(0);
    let found = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE.min(range.count as usize) {
            scope.spawn(|| {
                loop {
                    let offset = next.fetch_add(1, Ordering::Relaxed);
                    if offset >= range.count {
                        return;
                    }
                    let host = Ipv4Addr::from(range.first + offset);
                    let open = ports.iter().filter(|(port, _)| is_listening(host, *port));
                    let open: Vec<(u32, String)> =
                        open.map(|(port, scheme)| (offset, format!("{scheme}://{host}:{port}"))).collect();
                    found.lock().unwrap_or_else(std::sync::PoisonError::into_inner).extend(open);
                }
            });
        }
    });
    let mut found = found.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    found.sort();
    found.into_iter().map(|(_, address)| FoundControl { address }).collect()
}

fn is_listening(host: Ipv4Addr, port: u16) -> bool {
    TcpStream::connect_timeout(&SocketAddr::new(IpAddr::V4(host), port), CONNECT_WITHIN).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_and_large_ones_are_refused() {
        let range = |text: &str| text.parse::<AddressRange>();
        assert_eq!(range("192.168.1.77/24"), Ok(AddressRange { first: 0xC0A8_0100, count: 256 }));
        assert_eq!(range("10.0.0.5-9"), Ok(AddressRange { first: 0x0A00_0005, count: 5 }));
        assert_eq!(range("10.0.0.5"), Ok(AddressRange { first: 0x0A00_0005, count: 1 }));
        assert_eq!(range("10.0.0.0/8"), Err(RangeError::TooMany(1 << 24)));
        for wrong in ["", "a", "10.0.0.9-5", "10.0.0.0/33", "10.0.0.0/-1", "300.1.1.1"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_listens_is_found() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("bound").port();
        let found = scan_ports("127.0.0.1".parse().expect("a range"), &[(port, "fanuc")]);
        assert_eq!(found, [FoundControl { address: format!("fanuc://127.0.0.1:{port}") }]);
    }
}
