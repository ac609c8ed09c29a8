//! `cnc-gateway serve modbus`: the simulated machine's meters.

use super::{Common, RunningMachine, until_stopped};
use crate::cli::{CannotRun, CommandResult, print_text};
use adapters::modbus::profile;
use adapters::modbus_server::ModbusServer;
use clap::Args;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Arguments of `serve modbus`.
#[derive(Debug, Args)]
pub(in crate::cli) struct ModbusArguments {
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    meter: MeterArguments,
}

/// What the meters are like.
#[derive(Debug, Args)]
pub(in crate::cli) struct MeterArguments {
    /// Which meter to be.
    #[arg(long, value_name = "NAME", default_value = "sdm630")]
    profile: String,
    /// Directory of profiles of your own.
    #[arg(long, value_name = "DIR")]
    profiles: Option<PathBuf>,
}

/// Puts meters of the machine here, and says where.
pub(super) fn start(
    meter: &MeterArguments,
    listen: SocketAddr,
    running: &RunningMachine,
) -> Result<ModbusServer, CannotRun> {
    let profile = profile::find_profile(&meter.profile, meter.profiles.as_deref());
    let profile = profile.map_err(|error| CannotRun::new(error.to_string(), ""))?;
    let (meter, name) = (profile.meter.clone(), profile.name.clone());
    let server = ModbusServer::start(listen, &running.machine, running.clock.clone(), profile).map_err(|error| {
        CannotRun::new(format!("cannot listen on {listen}: {error}"), "choose another port, for example 127.0.0.1:5021")
    })?;
    let at = server.listen_address();
    print_text(&format!(
        "serving {meter} over Modbus TCP on {at}\n  \
         the machine:       modbus-tcp://{at}?unit=1&profile={name}\n  \
         its spindle drive: modbus-tcp://{at}?unit=2&profile={name}&circuit=spindle\n"
    ));
    Ok(server)
}

/// Serves until told to stop.
pub(super) fn serve(arguments: &ModbusArguments) -> CommandResult {
    let running = arguments.common.start_machine()?;
    let _served = start(&arguments.meter, arguments.common.listen_address(5020), &running)?;
    until_stopped()
}
