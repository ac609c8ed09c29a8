//! Sources and sinks as addresses: the same notation in the configuration, on the command line and in messages.

mod eda9033a;
mod target;

pub use adapter_core::address::*;
pub use eda9033a::EdaTarget;
pub use fanuc::address::{FanucBackend, FanucOptions, WriteMethod};
pub use hnc::address::{HncNetTarget, HncOffset};
pub use modbus::address::MeterTarget;
pub use mtconnect::address::MtConnectTarget;
pub use nclink::address::NcLinkTarget;
pub use simulated::address::{SimulatedDay, SimulatedDevice, SimulatedMachine, SimulatedTarget};
pub use target::{ReplayTarget, Target};

use adapter_core::own::{Own, OwnChannel, OwnChannelError};
use std::fmt;
use std::str::FromStr;

/// The schemes of the notation, for "did you mean" and for help texts.
pub const SCHEMES: [&str; 12] = [
    "simulated",
    "replay",
    "fanuc",
    "nclink",
    "nclinks",
    "hncnet",
    "mtconnect",
    "modbus-tcp",
    "modbus-rtu",
    "eda9033a",
    "temperature",
    "waveform",
];

/// Where a source or sink is, and how to talk to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Address {
    text: String,
    target: Target,
}

impl Address {
    /// The address as it was written: the name of the source everywhere.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The same with the user's own channels, all of which are declared, as are those of further axes and spindles. What each
    /// kind of source can be asked for, it says itself.
    ///
    /// # Errors
    /// Which channel cannot be read there, and why.
    pub fn with_channels(mut self, own: Vec<OwnChannel>) -> Result<Self, OwnChannelError> {
        match &mut self.target {
            Target::Fanuc { path, options, .. } => {
                options.own = Own::declare_all(own, &crate::fanuc::source::list_delivered(options))?;
                crate::fanuc::extra::declare_channels(options, *path).map_err(|(channel, error)| OwnChannelError {
                    channel,
                    key: "name",
                    what: error.to_string(),
                })?;
            }
            // What stands where in a model differs between makers: here every channel can be told its place.
            Target::NcLink(target) => target.own = Own::declare_all(own, &[])?,
            // What a device calls its data items differs between adapters, too.
            Target::MtConnect(target) => target.own = Own::declare_all(own, &[])?,
            Target::HncNet(target) => target.own = Own::declare_all(own, &crate::hnc::delivered())?,
            Target::ModbusTcp { meter, .. } | Target::ModbusRtu { meter, .. } => {
                meter.own = Own::declare_all(own, &[])?
            }
            _ => none_here(own)?,
        }
        Ok(self)
    }

    /// What the address means, typed by its scheme.
    #[must_use]
    pub fn target(&self) -> &Target {
        &self.target
    }
}

/// A kind of source that has nothing besides what it delivers.
fn none_here(own: Vec<OwnChannel>) -> Result<(), OwnChannelError> {
    own.into_iter().next().map_or(Ok(()), |own| {
        let what = "a source of this kind has nothing to be asked for besides what it delivers".to_owned();
        Err(OwnChannelError { channel: own.new.name, key: "read", what })
    })
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let text = text.trim();
        if let Some(meant) = guess_scheme(text) {
            return Err(AddressError { address: text.to_owned(), problems: vec![format!("no scheme; write {meant}")] });
        }
        let target = parse(text, no_scheme, target::parse)?;
        Ok(Self { text: text.to_owned(), target })
    }
}

/// Ports of devices, with the scheme that they speak.
const PORTS: [(u16, &str); 5] =
    [(8193, "fanuc"), (10001, "hncnet"), (502, "modbus-tcp"), (1883, "nclink"), (5000, "mtconnect")];

/// A host with or without a port, as on the network page of a control: the address that is meant. `None` for what has a scheme.
fn guess_scheme(text: &str) -> Option<String> {
    let (host, port) = match text.rsplit_once(':') {
        Some((host, port)) => (host, Some(port.parse::<u16>().ok()?)),
        None => (text, None),
    };
    let is_name = host.contains('.') && host.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '-'));
    let is_address = host.parse::<std::net::IpAddr>().is_ok() || host.starts_with('[') && host.ends_with(']');
    // A name without a port may be that of a file.
    if !(is_address || is_name && port.is_some()) {
        return None;
    }
    let scheme = |port: u16| PORTS.iter().find(|(known, _)| *known == port).map(|(_, scheme)| *scheme);
    let end = |scheme: &str| match scheme {
        "modbus-tcp" => "?profile=sdm630",
        "nclink" => "/SERIAL",
        "hncnet" => "?library=/path/libhncnet.so",
        _ => "",
    };
    match port.map(|port| (port, scheme(port))) {
        Some((port, Some(scheme))) => Some(format!("{scheme}://{host}:{port}{}", end(scheme))),
        Some((port, None)) => Some(format!(
            "its kind before it, for example fanuc://{host}:{port} or modbus-tcp://{host}:{port}?profile=sdm630"
        )),
        None => Some(format!(
            "its kind before it, for example fanuc://{host}:8193 or modbus-tcp://{host}:502?profile=sdm630"
        )),
    }
}

fn no_scheme(text: &str) -> String {
    if std::path::Path::new(text).extension().is_some_and(|end| end == "csv" || end == "gz") {
        return format!("no scheme; a recording is written replay:{text}");
    }
    format!("no scheme; write one of {} followed by a colon", SCHEMES.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Target {
        Address::from_str(text).expect("usable").target().clone()
    }

    fn refused(text: &str) -> String {
        Address::from_str(text).expect_err("unusable").to_string()
    }

    #[test]
    fn every_example_of_the_notation_is_understood() {
        for text in [
            "simulated://lathe",
            "simulated://mill?seed=7&speed=60",
            "replay:recording.csv.gz?speed=max",
            "replay:/data/with space.csv",
            "fanuc://10.0.0.5:8193?path=1&backend=native",
            "fanuc://cnc?backend=vendor&library=/opt/fwlib/libfwlib32.so",
            "fanuc://cnc?paths=1,2",
            "fanuc://cnc?paths=2,1&write=mailbox&mailbox=R920&allow=EXT",
            "fanuc://cnc?write=mailbox&request=R905&dial=R907",
            "fanuc://cnc?write=second_override&dial=G12",
            "fanuc://cnc?write=mailbox&mailbox=D900&period_ms=50&duty_pct=25&allow=#500-#509,EXT",
            "nclink://broker:1883/SERIAL",
            "nclink://broker/SN1?user=u&password_file=/etc/pw&period_ms=50&f_channel=6400&spindle_axis=3",
            "nclinks://broker:8883/SERIAL",
            "nclinks://broker/SERIAL?user=u&password_file=/etc/pw&ca=/etc/ca.pem&cert=/etc/box.pem&key=/etc/box.key",
            "hncnet://10.0.0.6:10001?library=/opt/hnc/libhncnet.so",
            "nclink://broker/SN1?sample=yes&keep=/var/lib/waveforms&keep_above_a=40",
            "hncnet://cnc?library=x.so&sample=yes&sample_scale_a=0.001",
            "hncnet://cnc?library=x.so&local_host=10.0.0.2&local_port=9090&long_bytes=4&period_ms=200&sample=yes",
            "nclink://broker/SN1?write=mailbox&mailbox=R200",
            "nclink://broker/SN1?write=mailbox&offset=D110",
            "hncnet://cnc?library=x.so&offset=W40",
            "hncnet://cnc?library=x.so&offset=zero&offset_unit_um=0.01",
            "mtconnect://10.0.0.8:5000/Mazak01",
            "mtconnect://agent?period_ms=500&timeout_ms=3000&spindle=S1&paths=1,2",
            "modbus-tcp://[::1]:502?unit=1&profile=sdm630",
            "modbus-rtu:///dev/ttyUSB0?baud=9600&parity=none&unit=1&profile=eda9033a",
            "eda9033a:///dev/ttyUSB0?baud=9600&address=1&ct=20",
            "modbus-rtu:///dev/ttyS1?unit=2&profile=own&profiles=/etc/meters&circuit=spindle&ct=1&timeout_ms=200",
            "eda9033a:///dev/ttyUSB0?ct=20&circuit=spindle",
            "temperature:/etc/cnc-gateway/temperatures.toml",
            "waveform://daq:5000",
            "waveform://daq:5000?keep=/var/lib/waveforms&keep_above_a=40",
        ] {
            assert_eq!(Address::from_str(text).expect(text).to_string(), text);
        }
    }

    #[test]
    fn the_replay_speed_is_a_factor_or_as_fast_as_possible() {
        let speed = |text| match parse(text) {
            Target::Replay(replay) => replay.speed,
            other => panic!("{other:?}"),
        };
        assert_eq!(speed("replay:a.csv?speed=max"), Speed::Max);
        assert_eq!(speed("replay:a.csv?speed=2.5"), Speed::Times(2.5));
        assert_eq!(speed("replay:a.csv"), Speed::Times(1.0));
    }

    #[test]
    fn a_misspelt_scheme_or_key_gets_a_suggestion() {
        assert!(refused("fanuk://x").contains("fanuc"), "{}", refused("fanuk://x"));
        assert!(refused("simulated://lathe?sede=1").contains("seed"), "{}", refused("simulated://lathe?sede=1"));
        assert!(refused("simulated://lath").contains("lathe"), "{}", refused("simulated://lath"));
        assert!(refused("recording.csv").contains("replay:recording.csv"));
        for (text, meant) in [
            ("192.168.1.10:8193", "write fanuc://192.168.1.10:8193"),
            ("cnc.shop:8193", "write fanuc://cnc.shop:8193"),
            ("[::1]:8193", "write fanuc://[::1]:8193"),
            ("192.168.1.30:5000", "write mtconnect://192.168.1.30:5000"),
            ("192.168.1.20:502", "write modbus-tcp://192.168.1.20:502?profile=sdm630"),
            ("192.168.1.10", "fanuc://192.168.1.10:8193"),
            ("192.168.1.10:7000", "fanuc://192.168.1.10:7000"),
        ] {
            assert!(refused(text).contains(meant), "{text}: {}", refused(text));
        }
    }

    #[test]
    fn an_offset_of_a_huazhong_control_is_configured_in_full_or_refused() {
        assert!(refused("nclink://b/S?offset=R10").contains("W or D register"));
        assert!(refused("nclink://b/S?offset=zero").contains("is no register"), "only the library can");
        assert!(refused("nclink://b/S?write=mailbox&offset=D103").contains("lies over the mailbox at D100"));
        assert!(refused("hncnet://cnc?library=x.so&offset=zero").contains("offset_unit_um="));
        assert!(refused("hncnet://cnc?library=x.so&offset=D9&offset_unit_um=1").contains("only with offset=zero"));
    }

    #[test]
    fn a_password_in_an_address_is_refused_and_never_repeated() {
        for text in [
            "nclinks://box:s3cret@broker:8883/SERIAL",
            "nclink://s3cret@broker/SERIAL?user=u",
            "fanuc://a:s3cret@10.0.0.5:8193?path=1",
            "modbus-tcp:b:s3cret@meter",
            "hncnet://x:half/s3cret@cnc?library=x.so",
            "waveform://a:s3cret@b@daq:5000",
            "fanuc://cnc?password=s3cret",
        ] {
            assert!(!refused(text).contains("s3cret"), "{}", refused(text));
        }
        assert!(refused("fanuc://a:s3cret@10.0.0.5:8193").contains("password_file="));
        assert!(matches!(parse("replay:/data/a@b.csv"), Target::Replay(_)), "a path may hold it");
    }

    #[test]
    fn all_problems_are_told_at_once() {
        let text = refused("modbus-tcp://meter:99999?unit=900&colour=red&profile=sdm630");
        for part in ["99999", "unit", "colour"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn a_vendor_library_must_be_named() {
        assert!(refused("fanuc://cnc?backend=vendor").contains("library"));
        assert!(refused("hncnet://cnc").contains("library"));
    }

    #[test]
    fn several_paths_begin_with_the_one_that_is_written_to() {
        let further = |text| match parse(text) {
            Target::Fanuc { options, .. } => options.further,
            other => panic!("{other:?}"),
        };
        assert_eq!(further("fanuc://cnc"), [0u8; 0]);
        assert_eq!(further("fanuc://cnc?paths=1"), [0u8; 0]);
        assert_eq!(further("fanuc://cnc?paths=1,3"), [3]);
        let Target::Fanuc { path, options, .. } = parse("fanuc://cnc?paths=2,1") else { panic!("a controller") };
        assert_eq!((path, options.further), (2, vec![1]), "the first is written to");
        for wrong in ["0", "1,1", "1,4", "2,1,2", "1,2,", "x"] {
            assert!(refused(&format!("fanuc://cnc?paths={wrong}")).contains("for example paths=1,2"), "{wrong}");
        }
        assert!(refused("fanuc://cnc?path=2&paths=1,2").contains("either"));
    }

    #[test]
    fn the_ways_of_writing_to_a_fanuc_are_read() {
        let write = |text| match parse(text) {
            Target::Fanuc { options, .. } => options.write,
            other => panic!("{other:?}"),
        };
        assert_eq!(write("fanuc://cnc"), WriteMethod::None, "nothing is written unless it is asked for");
        assert_eq!(write("fanuc://cnc?write=direct"), WriteMethod::Direct);
        assert_eq!(write("fanuc://cnc?write=macro&macro=501"), WriteMethod::Macro { variable: 501 });
        let place = WriteMethod::Mailbox { area: crate::fanuc::item::Area::D, at: 900 };
        assert_eq!(write("fanuc://cnc?write=mailbox&mailbox=D900"), place);
        assert!(refused("fanuc://cnc?write=mailbox&mailbox=G12").contains("R, D or E"));
        assert!(refused("fanuc://cnc?write=mailbox&request=X5").contains("R, D or E"));
        assert!(refused("fanuc://cnc?write=mailbox&dial=G12").contains("leave the dial alone in another byte"));
        assert!(refused("fanuc://cnc?dial=X3").contains("for example R907"));
        assert!(refused("fanuc://cnc?allow=G12").contains("allow=G12"));
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(simulated|replay|fanuc|nclink|modbus-rtu|:|//|\\?|&|=|%|\\[|\\]|[0-9a-z.]|\\PC){0,24}") {
            let _ = Address::from_str(&text);
        }
    }
}
