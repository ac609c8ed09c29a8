//! `cnc-gateway serve`: the simulated machine over a real protocol, for other people's clients and for trying the box without
//! a machine.

mod fanuc;
mod guard;
mod machine;
mod modbus;
mod nclink;
mod waveform;

use super::{CannotRun, CommandOutcome, CommandResult};
use crate::signals::{SignalRequest, Signals};
use adapters::Address;
use adapters::address::{SimulatedTarget, Speed, Target};
use adapters::clock::{Clock, ScaledClock};
use adapters::simulated::{Simulated, SimulatedSettings};
use clap::{Args, Subcommand};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The control of a simulated machine answers so long after the machine's day has begun: it is switched on after some
/// seconds and then starts.
const STARTED_S: f64 = 30.0;

#[derive(Debug, Subcommand)]
pub(super) enum Served {
    /// One machine on FANUC and Modbus at once, and as an NC-Link device where a broker is named.
    Machine(machine::MachineArguments),
    /// A FANUC control that answers FOCAS2/Ethernet, with a ladder that owns the feed override.
    Fanuc(fanuc::FanucArguments),
    /// An NC-Link device (GB/T 41970) at an MQTT broker, laid out like a Huazhong controller.
    Nclink(nclink::NclinkArguments),
    /// A Modbus TCP meter: unit 1 in the machine's supply, unit 2 in that of the spindle drive.
    Modbus(modbus::ModbusArguments),
    /// Three phases of spindle current as a stream of samples; or a file, or a Linux IIO device.
    Waveform(waveform::WaveformArguments),
}

/// What every partner has in common.
#[derive(Debug, Args)]
struct Common {
    /// Address and port to listen on; port 0 takes a free one.
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<SocketAddr>,
    /// The machine: lathe, mill, or a whole address such as simulated://lathe?seed=7&speed=10.
    #[arg(long, value_name = "lathe|mill", default_value = "lathe")]
    machine: String,
}

/// A running machine and the clock that it lives by.
struct RunningMachine {
    machine: Simulated,
    clock: Arc<dyn Clock>,
}

impl Common {
    /// Where to listen; `port` unless given.
    fn listen_address(&self, port: u16) -> SocketAddr {
        self.listen.unwrap_or_else(|| SocketAddr::from(([127, 0, 0, 1], port)))
    }

    fn start_machine(&self) -> Result<RunningMachine, CannotRun> {
        start_machine(&self.machine)
    }
}

/// Switches on the machine of this name or address.
fn start_machine(machine: &str) -> Result<RunningMachine, CannotRun> {
    let whole = machine.contains(':');
    let text = if whole { machine.to_owned() } else { format!("simulated://{machine}") };
    let address: Address = text.parse().map_err(|error| CannotRun::new(format!("{error}"), ""))?;
    let Target::Simulated(target) = address.target() else {
        return Err(CannotRun::new(format!("{text} is no simulated machine"), "give lathe or mill"));
    };
    let Speed::Times(speed) = target.speed else {
        return Err(CannotRun::new("a served machine lives by the clock", "give a factor, for example speed=10"));
    };
    let clock: Arc<dyn Clock> = Arc::new(ScaledClock::new(speed));
    // A partner answers from its first moment: the machine has been switched on and its control has started.
    let target = SimulatedTarget { begun_s: target.begun_s.max(STARTED_S), ..*target };
    let begun_ns = adapters::open::compute_day_start_ns(&target, clock.now_ns());
    let machine = Simulated::new(address.text(), SimulatedSettings::from_target(&target), begun_ns);
    Ok(RunningMachine { machine, clock })
}

/// Serves until told to stop.
pub(super) fn run(what: &Served) -> CommandResult {
    match what {
        Served::Machine(arguments) => machine::serve(arguments),
        Served::Fanuc(arguments) => fanuc::serve(arguments),
        Served::Nclink(arguments) => nclink::serve(arguments),
        Served::Modbus(arguments) => modbus::serve(arguments),
        Served::Waveform(arguments) => waveform::serve(arguments),
    }
}

/// Tells whether a signal has said stop, from a thread that listens.
fn stop_flag() -> Result<impl Fn() -> bool, CannotRun> {
    let stopped = Arc::new(AtomicBool::new(false));
    let told = stopped.clone();
    let listen = move || {
        // Without signals the process is ended by the system.
        let _heard = until_stopped();
        told.store(true, Ordering::SeqCst);
    };
    let thread = std::thread::Builder::new().name("signals".to_owned()).spawn(listen);
    thread.map_err(|error| CannotRun::new(format!("no thread for signals: {error}"), ""))?;
    Ok(move || stopped.load(Ordering::SeqCst))
}

/// Returns when a signal says stop.
fn until_stopped() -> CommandResult {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| CannotRun::new(format!("no signals can be heard: {error}"), ""))?;
    runtime.block_on(async {
        let mut signals = Signals::start_listening()
            .map_err(|error| CannotRun::new(format!("no signals can be heard: {error}"), ""))?;
        while signals.next().await != SignalRequest::Stop {}
        Ok(CommandOutcome::Fine)
    })
}
