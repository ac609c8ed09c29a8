//! `cnc-gateway serve fanuc`: the simulated machine behind a control that answers FOCAS2/Ethernet.

use super::guard::ServingThread;
use super::{Common, RunningMachine, until_stopped};
use crate::cli::{CannotRun, CommandResult, print_text};
use adapters::LadderRule;
use adapters::clock::Clock;
use adapters::fanuc_server::{Server, ServerSettings, SimulatedControl};
use adapters::override_pct::OverridePct;
use adapters::simulated::Simulated;
use clap::{Args, ValueEnum};
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The ladder runs on when nobody asks.
const LOOK: Duration = Duration::from_millis(50);

/// Arguments of `serve fanuc`.
#[derive(Debug, Args)]
pub(in crate::cli) struct FanucArguments {
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    control: ControlArguments,
}

/// What the control is like.
#[derive(Debug, Args)]
pub(in crate::cli) struct ControlArguments {
    /// Generation of the control, which decides the encodings.
    #[arg(long, value_enum, default_value_t = Generation::Series30i)]
    generation: Generation,
    /// Connections at a time; the vendor's library takes two for one client.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=100))]
    connections: u16,
    /// Paths of the control: 2 adds a second turret with a program, an axis pair and a spindle of its own.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    paths: u8,
    /// What the ladder makes of the operator's dial and the gateway's override.
    #[arg(long, value_enum, default_value_t = Rule::Least)]
    ladder: Rule,
    /// Where the operator's dial of the feed override stands, %.
    #[arg(long, value_name = "PCT", default_value_t = 100, value_parser = clap::value_parser!(u8).range(0..=254))]
    dial: u8,
}

/// How the ladder combines dial and mailbox.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Rule {
    /// The lesser one: never above the dial.
    Least,
    /// One of the other.
    Product,
    /// The gateway's while it is enabled: a ladder as it should not be, for trying what the box makes of it.
    Replace,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Generation {
    /// 30i, 31i, 32i, 35i and later (version word 4).
    #[value(name = "30i")]
    Series30i,
    /// 0i-D, 0i-F (version word 3).
    #[value(name = "0i-f")]
    Series0iF,
    /// 16i, 18i, 21i, 0i-C and before (version word 2).
    #[value(name = "16i")]
    Series16i,
}

impl Generation {
    fn version(self) -> u16 {
        match self {
            Self::Series30i => 4,
            Self::Series0iF => 3,
            Self::Series16i => 2,
        }
    }
}

fn build_control(arguments: &ControlArguments, machine: Simulated, clock: Arc<dyn Clock>) -> SimulatedControl {
    let rule = match arguments.ladder {
        Rule::Least => LadderRule::Least,
        Rule::Product => LadderRule::Product,
        Rule::Replace => LadderRule::Replace,
    };
    let mut control = SimulatedControl::new(machine, clock, arguments.generation.version()).with_rule(rule);
    control.turn_dial(OverridePct::new(arguments.dial).unwrap_or(OverridePct::FULL));
    if arguments.paths > 1 { control.with_path() } else { control }
}

/// Puts the machine behind a control that listens here, and says where.
pub(super) fn start(
    control: &ControlArguments,
    at: SocketAddr,
    running: &RunningMachine,
) -> Result<ServingThread, CannotRun> {
    let next = "stop the other program, or choose another port";
    let listener = TcpListener::bind(at).map_err(|error| CannotRun::new(format!("{at}: {error}"), next))?;
    let simulated = build_control(control, running.machine.clone(), running.clock.clone());
    let settings = ServerSettings { sessions_max: usize::from(control.connections), ..ServerSettings::default() };
    let no_threads = |error: std::io::Error| CannotRun::new(format!("no threads to serve with: {error}"), "");
    let server = Server::start(listener, Box::new(simulated), settings).map_err(no_threads)?;
    let further = if control.paths > 1 { "; those of path 2 are 20 higher" } else { "" };
    print_text(&format!(
        "fanuc://{} answers; the ladder's mailbox is at R900, requests at R905, the dial at R907, its second override \
         at R910{further}\n",
        server.address()
    ));
    let run_ladder = move |stop: &AtomicBool| {
        while !stop.load(Ordering::SeqCst) {
            server.with(|_| ());
            std::thread::sleep(LOOK);
        }
    };
    ServingThread::start("ladder", run_ladder).map_err(no_threads)
}

/// Serves until told to stop.
pub(super) fn serve(arguments: &FanucArguments) -> CommandResult {
    let running = arguments.common.start_machine()?;
    let _served = start(&arguments.control, arguments.common.listen_address(8193), &running)?;
    until_stopped()
}
