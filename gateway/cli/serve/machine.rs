//! `cnc-gateway serve machine`: one simulated machine behind several protocols at once, as a shop floor has them: the control, the meters
//! in its supply, and where a broker is named the same control as an NC-Link device.

use super::fanuc::ControlArguments;
use super::modbus::MeterArguments;
use super::nclink::parse_serial;
use super::{CommandResult, fanuc, modbus, nclink, start_machine, until_stopped};
use clap::Args;
use std::net::SocketAddr;

/// Arguments of `serve machine`.
#[derive(Debug, Args)]
pub(in crate::cli) struct MachineArguments {
    /// Address and port of its FANUC control; port 0 takes a free one.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:8193")]
    fanuc: SocketAddr,
    /// Address and port of its Modbus TCP meters; port 0 takes a free one.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5020")]
    modbus: SocketAddr,
    /// The MQTT broker at which it is an NC-Link device too.
    #[arg(long, value_name = "HOST:PORT")]
    broker: Option<String>,
    /// Serial number: the last part of every topic of the device.
    #[arg(long, value_name = "SERIAL", default_value = "SIM0001", value_parser = parse_serial)]
    serial: String,
    /// The machine: lathe, mill, or a whole address such as simulated://lathe?seed=7&speed=10.
    #[arg(long, value_name = "lathe|mill", default_value = "lathe")]
    machine: String,
    #[command(flatten)]
    control: ControlArguments,
    #[command(flatten)]
    meter: MeterArguments,
}

/// Serves until told to stop.
pub(super) fn serve(arguments: &MachineArguments) -> CommandResult {
    let running = start_machine(&arguments.machine)?;
    let _control = fanuc::start(&arguments.control, arguments.fanuc, &running)?;
    let _meters = modbus::start(&arguments.meter, arguments.modbus, &running)?;
    let device = arguments.broker.as_ref().map(|broker| nclink::start(broker, &arguments.serial, &running));
    let _device = device.transpose()?;
    until_stopped()
}
