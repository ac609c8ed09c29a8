//! What an `mtconnect://` address says.

use crate::OwnDataItem;
use adapter_core::address::{AddressProblem, Endpoint, Keys, parse_endpoint};
use adapter_core::channel::PATHS;
use adapter_core::own::Own;

/// A device behind an agent.
#[derive(Debug, Clone, PartialEq)]
pub struct MtConnectTarget {
    /// Host and port of the agent.
    pub endpoint: Endpoint,
    /// Name, uuid or id of the device; without one it is the only one of the agent.
    pub device: Option<String>,
    /// Pace of the polls, ms. The agent is asked to send twice as often.
    pub period_ms: u64,
    /// Longest silence of the agent, ms.
    pub timeout_ms: u64,
    /// Name or id of the component that is the spindle, where it is not clear.
    pub spindle: Option<String>,
    /// Which paths of the control are read, from 1; the first one has the plain names.
    pub paths: Vec<u8>,
    /// The user's own channels, which the configuration adds.
    pub own: Vec<Own<OwnDataItem>>,
}

/// The port that agents listen at.
pub const AGENT_PORT: u16 = 5000;

/// The device that the address names.
///
/// # Errors
/// It names no host or no port.
pub fn parse_mtconnect(body: &str, keys: &mut Keys) -> Result<MtConnectTarget, AddressProblem> {
    let period_ms = keys.take_number("period_ms", 200, 20, 60_000);
    let timeout_ms = keys.take_number("timeout_ms", 2000.max(2 * period_ms), 100, 120_000);
    if timeout_ms < 2 * period_ms {
        keys.add_problem(format!("timeout_ms={timeout_ms}: give at least twice the period_ms, {}", 2 * period_ms));
    }
    let spindle = keys.take_text("spindle");
    let paths = parse_paths(keys);
    let rest = body.strip_prefix("//").unwrap_or(body);
    let (agent, device) = rest.split_once('/').unwrap_or((rest, ""));
    let device = device.trim_matches('/');
    Ok(MtConnectTarget {
        endpoint: parse_endpoint(agent, Some(AGENT_PORT))?,
        device: (!device.is_empty()).then(|| device.to_owned()),
        period_ms,
        timeout_ms,
        spindle,
        paths,
        own: Vec::new(),
    })
}

fn parse_paths(keys: &mut Keys) -> Vec<u8> {
    let Some(text) = keys.take_text("paths") else { return vec![1] };
    let numbers: Option<Vec<u8>> = text.split(',').map(|number| number.parse().ok()).collect();
    let is_usable = |paths: &Vec<u8>| {
        let mut unique = paths.clone();
        unique.sort_unstable();
        unique.dedup();
        unique.len() == paths.len() && paths.iter().all(|path| PATHS.contains(path))
    };
    numbers.filter(is_usable).unwrap_or_else(|| {
        keys.add_problem(format!(
            "paths={text}: name each path of the control from 1 to 3 once, for example paths=1,2"
        ));
        vec![1]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<MtConnectTarget, String> {
        let of_scheme = |_: &str, body: &str, keys: &mut Keys| parse_mtconnect(body, keys);
        adapter_core::address::parse(text, |_| String::new(), of_scheme).map_err(|error| error.to_string())
    }

    #[test]
    fn an_address_names_agent_device_and_pace() {
        let target = parse("mtconnect://agent:5001/Mazak?period_ms=500&paths=2,1").expect("usable");
        assert_eq!((target.endpoint.port, target.device.as_deref()), (5001, Some("Mazak")));
        assert_eq!((target.period_ms, target.timeout_ms, target.paths), (500, 2000, vec![2, 1]));
        let bare = parse("mtconnect://10.0.0.7").expect("usable");
        assert_eq!((bare.endpoint.port, bare.device, bare.paths), (AGENT_PORT, None, vec![1]));
        assert_eq!(parse("mtconnect://a?period_ms=5000").expect("usable").timeout_ms, 10_000);
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_to_write() {
        for (text, part) in [
            ("mtconnect://a/D?periodms=50", "did you mean period_ms?"),
            ("mtconnect://a/D?paths=1,1", "paths=1,2"),
            ("mtconnect://a/D?paths=4", "paths=1,2"),
            ("mtconnect://a/D?period_ms=1000&timeout_ms=500", "at least twice"),
            ("mtconnect:///D", "HOST:PORT"),
            ("mtconnect://a:70000/D", "port"),
        ] {
            let told = parse(text).expect_err(text);
            assert!(told.contains(part), "{text}: {told}");
        }
    }
}
