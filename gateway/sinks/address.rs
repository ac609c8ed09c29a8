//! Addresses of sinks: the notation of sources, with schemes of their own.

use super::mail::MailTarget;
use super::mqtt::{Layout, MqttTarget};
use super::nats::NatsSinkTarget;
#[cfg(feature = "opcua")]
use super::opcua::OpcuaTarget;
use super::parquet::ParquetTarget;
use super::shdr::ShdrTarget;
use super::sparkplug::SparkplugTarget;
use super::target_error::TargetError;
use super::webhook::WebhookTarget;
use adapter_core::address::{self, AddressError, Keys};
use adapter_core::channel::find_nearest_name;
use std::fmt;
use std::str::FromStr;

/// The schemes of the notation, each with how an address of it is written.
pub const SCHEMES: [(&str, &str); 13] = [
    ("mqtt", "mqtt://BROKER:1883/PREFIX"),
    ("mqtts", "mqtts://BROKER:8883/PREFIX"),
    ("nats", "nats://SERVER:4222,SERVER:4222/PREFIX"),
    ("natss", "natss://SERVER:4222,SERVER:4222/PREFIX"),
    ("opcua", "opcua://0.0.0.0:4840?user=USER&password_file=FILE"),
    ("parquet", "parquet:DIRECTORY"),
    ("smtp", "smtp://HOST:25?from=ADDRESS&to=ADDRESS,ADDRESS"),
    ("smtps", "smtps://HOST:465?from=ADDRESS&to=ADDRESS,ADDRESS"),
    ("sparkplug", "sparkplug://BROKER:1883/GROUP/NODE/DEVICE"),
    ("shdr", "shdr://0.0.0.0:7878"),
    ("sparkplugs", "sparkplugs://BROKER:8883/GROUP/NODE/DEVICE"),
    ("webhook", "webhook://HOST:80/PATH?secret_file=FILE"),
    ("webhooks", "webhooks://HOST:443/PATH?secret_file=FILE"),
];

/// What an address means. Each variant belongs to one kind of sink.
#[derive(Debug, Clone, PartialEq)]
pub enum SinkTarget {
    /// Alarms as mails over SMTP.
    Mail(MailTarget),
    /// JSON documents on plain topics.
    Mqtt(MqttTarget),
    /// A stream of NATS JetStream.
    Nats(NatsSinkTarget),
    /// A server of OPC UA.
    #[cfg(feature = "opcua")]
    Opcua(OpcuaTarget),
    /// A file of columns for each day.
    Parquet(ParquetTarget),
    /// Lines for MTConnect agents.
    Shdr(ShdrTarget),
    /// Sparkplug B at an MQTT broker.
    Sparkplug(SparkplugTarget),
    /// Alarms as HTTP requests.
    Webhook(WebhookTarget),
}

/// Where a sink is, and how to talk to it.
#[derive(Debug, Clone, PartialEq)]
pub struct SinkAddress {
    text: String,
    target: SinkTarget,
}

impl SinkAddress {
    /// The address as it was written. It never holds a password: those are in files.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The kind of sink, with everything that the address says.
    #[must_use]
    pub fn target(&self) -> &SinkTarget {
        &self.target
    }

    /// What is wrong with the files that the address names, each with what to do. Nothing is connected.
    #[must_use]
    pub fn find_file_problems(&self) -> Vec<(String, String)> {
        match &self.target {
            SinkTarget::Mail(target) => target.find_file_problems(),
            SinkTarget::Mqtt(target) => target.broker.find_file_problems(),
            SinkTarget::Nats(target) => target.target.check_files(),
            #[cfg(feature = "opcua")]
            SinkTarget::Opcua(target) => target.find_file_problems(),
            SinkTarget::Parquet(target) => target.find_file_problems(),
            SinkTarget::Shdr(_) => Vec::new(),
            SinkTarget::Sparkplug(target) => target.broker.find_file_problems(),
            SinkTarget::Webhook(target) => target.find_file_problems(),
        }
    }

    /// Can a computer on the network of this sink send the box anything?
    #[must_use]
    pub fn can_receive_requests(&self) -> bool {
        matches!(self.target, SinkTarget::Mqtt(_) | SinkTarget::Sparkplug(_))
    }

    /// Can a computer on the network of this sink tell the box facts of production?
    #[must_use]
    pub fn can_receive_facts(&self) -> bool {
        matches!(self.target, SinkTarget::Mqtt(_))
    }

    /// What the address leaves to the path of the machine, and what to do where there is none.
    #[must_use]
    pub fn find_need_of_path(&self) -> Option<(&'static str, &'static str)> {
        match &self.target {
            SinkTarget::Mqtt(target) if target.layout == Layout::Uns => {
                Some(("layout=uns has topics by the path of the machine, and there is none", WRITE_PATH))
            }
            SinkTarget::Sparkplug(target) if target.place.is_none() => Some((
                "the address has no group and node, and the machine no path that could stand for them",
                WRITE_PLACE,
            )),
            _ => None,
        }
    }

    /// Is the line encrypted, and does the box know who is at its other end?
    #[must_use]
    pub fn is_secured(&self) -> bool {
        self.scheme().ends_with('s')
    }

    /// The word before the colon.
    #[must_use]
    pub fn scheme(&self) -> &str {
        self.text.split(':').next().unwrap_or_default()
    }

    /// Does the text begin with a scheme of sinks?
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        let scheme = text.trim().split(':').next().unwrap_or_default();
        SCHEMES.iter().any(|(known, _)| *known == scheme)
    }
}

const WRITE_PATH: &str = "write path = \"shanghai/line-2\" under [gateway], or another layout";
const WRITE_PLACE: &str =
    "write sparkplug://BROKER:1883/GROUP/NODE/DEVICE, or path = \"shanghai/line-2\" under [gateway]";

impl fmt::Display for SinkAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for SinkAddress {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let text = text.trim();
        let target = address::parse(
            text,
            |_| no_scheme(),
            |scheme, body, keys| parse(scheme, body, keys).map_err(|error| error.to_string()),
        )?;
        Ok(Self { text: text.to_owned(), target })
    }
}

fn no_scheme() -> String {
    let forms: Vec<&str> = SCHEMES.iter().map(|(_, form)| *form).collect();
    format!("no scheme; write one of {}", forms.join(", "))
}

fn parse(scheme: &str, body: &str, keys: &mut Keys) -> Result<SinkTarget, TargetError> {
    match scheme {
        "mqtt" | "mqtts" => MqttTarget::parse(body, keys, scheme == "mqtts").map(SinkTarget::Mqtt),
        "nats" | "natss" => NatsSinkTarget::parse(body, keys, scheme == "natss").map(SinkTarget::Nats),
        #[cfg(feature = "opcua")]
        "opcua" => OpcuaTarget::parse(body, keys).map(SinkTarget::Opcua),
        #[cfg(not(feature = "opcua"))]
        "opcua" => Err(without_opcua(keys)),
        "parquet" => ParquetTarget::parse(body, keys).map(SinkTarget::Parquet),
        "smtp" | "smtps" => MailTarget::parse(body, keys, scheme == "smtps").map(SinkTarget::Mail),
        "shdr" => ShdrTarget::parse(body, keys).map(SinkTarget::Shdr),
        "sparkplug" | "sparkplugs" => {
            SparkplugTarget::parse(body, keys, scheme == "sparkplugs").map(SinkTarget::Sparkplug)
        }
        "webhook" | "webhooks" => WebhookTarget::parse(body, keys, scheme == "webhooks").map(SinkTarget::Webhook),
        _ => Err(TargetError::UnknownScheme { known: describe_unknown_scheme(scheme) }),
    }
}

/// Which build has it. The keys are right there, and are not told as unknown here.
#[cfg(not(feature = "opcua"))]
fn without_opcua(keys: &mut Keys) -> TargetError {
    let _login = adapter_core::address::Login::from_keys(keys);
    for key in ["anonymous", "certificates", "manufacturer", "model", "serial_number"] {
        let _known_elsewhere = keys.take_text(key);
    }
    TargetError::NotBuiltIn
}

fn describe_unknown_scheme(scheme: &str) -> String {
    let hint = match find_nearest_name(scheme, SCHEMES.iter().map(|(known, _)| *known)) {
        Some(near) => format!("did you mean {near}:?"),
        None => no_scheme(),
    };
    format!("{scheme}: is no scheme of a sink; {hint}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opc_ua_is_there_or_the_sentence_says_which_build_has_it() {
        let parsed: Result<SinkAddress, _> = "opcua://0.0.0.0:4840?user=plant&password_file=/etc/cnc/password".parse();
        #[cfg(feature = "opcua")]
        assert!(parsed.is_ok_and(|address| address.find_file_problems().len() == 1), "the password file is not there");
        #[cfg(not(feature = "opcua"))]
        assert!(
            parsed.is_err_and(|error| error.problems.len() == 1 && error.problems[0].contains("--features opcua")),
            "one sentence"
        );
    }
}
