//! `cnc-gateway serve nclink`: the simulated machine as an NC-Link device. A device does not listen; it dials a broker.

use super::guard::ServingThread;
use super::{Common, RunningMachine, until_stopped};
use crate::cli::{CannotRun, CommandResult, print_text};
use adapters::mqtt::Options;
use adapters::nclink_device::{DeviceEvent, MAILBOX, NcLinkDevice, OFFSETS};
use clap::Args;
use std::sync::atomic::AtomicBool;

/// Arguments of `serve nclink`.
#[derive(Debug, Args)]
pub(in crate::cli) struct NclinkArguments {
    #[command(flatten)]
    common: Common,
    /// The MQTT broker that device and clients meet at, for example mosquitto on this computer.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:1883")]
    broker: String,
    /// Serial number: the last part of every topic of the device.
    #[arg(long, value_name = "SERIAL", default_value = "SIM0001", value_parser = parse_serial)]
    serial: String,
}

pub(super) fn parse_serial(text: &str) -> Result<String, String> {
    match text.is_empty() || text.contains(['/', '+', '#', '?']) {
        true => Err("give letters and digits without / + # ?".to_owned()),
        false => Ok(text.to_owned()),
    }
}

/// Makes the machine a device at a broker, and says so when it is connected.
pub(super) fn start(broker: &str, serial: &str, running: &RunningMachine) -> Result<ServingThread, CannotRun> {
    let options = parse_broker(broker)?;
    let mut device = NcLinkDevice::new(serial, &running.machine, running.clock.clone());
    let name = format!("nclink://{broker}/{serial}");
    let run = move |stop: &AtomicBool| device.run(&options, stop, |said| print_text(&format_event(&name, &said)));
    let thread = ServingThread::start("device", run);
    thread.map_err(|error| CannotRun::new(format!("no thread for the device: {error}"), ""))
}

/// Serves until told to stop.
pub(super) fn serve(arguments: &NclinkArguments) -> CommandResult {
    if arguments.common.listen.is_some() {
        return Err(CannotRun::new(
            "an NC-Link device does not listen, it dials a broker",
            "give --broker HOST:PORT in place of --listen",
        ));
    }
    let running = arguments.common.start_machine()?;
    let _served = start(&arguments.broker, &arguments.serial, &running)?;
    until_stopped()
}

fn parse_broker(text: &str) -> Result<Options, CannotRun> {
    let wrong = || CannotRun::new(format!("--broker {text}: this is no HOST:PORT"), "write it like 127.0.0.1:1883");
    let (host, port) = text.rsplit_once(':').ok_or_else(wrong)?;
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let port = port.parse().ok().filter(|port| *port > 0 && !host.is_empty()).ok_or_else(wrong)?;
    Ok(Options::new(host, port, "cnc-gateway-device"))
}

fn format_event(name: &str, said: &DeviceEvent) -> String {
    match said {
        DeviceEvent::Connected => {
            format!("serving {name} (mailbox for the feed override: {MAILBOX}, for offsets: {OFFSETS})\n")
        }
        DeviceEvent::Failed(error) => format!("not served: {error}; dialling again every second\n"),
    }
}
