//! `cnc-gateway serve waveform`: a sampler's stream: the simulated spindle current, a file, or a Linux IIO device.

use super::{CannotRun, CommandResult, Common};
use crate::cli::{CommandOutcome, print_text};
use adapters::clock::{Clock, SystemClock};
use adapters::waveform::{Iio, Producer, Recorded, Sampler, SimulatedCurrent};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Arguments of `serve waveform`.
#[derive(Debug, Args)]
pub(in crate::cli) struct WaveformArguments {
    #[command(flatten)]
    common: Common,
    /// Samples per second and phase of the simulated current, or of the file.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate_hz: f64,
    /// Play this CSV (time_s, then one column per phase, A) in place of the simulated machine.
    #[arg(long, value_name = "CSV", conflicts_with = "iio")]
    file: Option<PathBuf>,
    /// Greatest current in the file, A.
    #[arg(long, value_name = "A", default_value_t = 200.0)]
    peak_a: f64,
    /// Sample this IIO device, for example iio:device0; its channels and rate are set in sysfs beforehand.
    #[arg(long, value_name = "DEVICE")]
    iio: Option<String>,
    /// What the transducer makes of an ampere, A per V, where the device measures voltage.
    #[arg(long, value_name = "A/V", default_value_t = 1.0)]
    a_per_v: f64,
}

impl WaveformArguments {
    fn build_sampler(&self) -> Result<Box<dyn Sampler>, CannotRun> {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        if let Some(device) = &self.iio {
            let name = device.rsplit('/').next().unwrap_or(device);
            let (sysfs, node) = (Path::new("/sys/bus/iio/devices").join(name), Path::new("/dev").join(name));
            let next =
                "enable channels in scan_elements, set sampling_frequency, and see that nobody else has the device";
            let opened = Iio::open(&sysfs, &node, self.a_per_v, clock);
            return opened.map(box_sampler).map_err(|error| CannotRun::new(format!("{name}: {error}"), next));
        }
        if let Some(file) = &self.file {
            let opened = Recorded::open(file, self.rate_hz, self.peak_a, clock);
            return opened.map(box_sampler).map_err(|error| CannotRun::new(format!("{}: {error}", file.display()), ""));
        }
        if !(10.0..=100_000.0).contains(&self.rate_hz) {
            return Err(CannotRun::new(format!("{} samples per second", self.rate_hz), "give 10 to 100000"));
        }
        let running = self.common.start_machine()?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 2000")]
        let block = (self.rate_hz / 50.0).ceil() as u16;
        Ok(box_sampler(SimulatedCurrent::new(&running.machine, running.clock.clone(), self.rate_hz, block)))
    }
}

fn box_sampler<S: Sampler + 'static>(sampler: S) -> Box<dyn Sampler> {
    Box::new(sampler)
}

/// Serves until told to stop, or until the sampler has come to its end.
pub(super) fn serve(arguments: &WaveformArguments) -> CommandResult {
    let sampler = arguments.build_sampler()?;
    let listen = arguments.common.listen_address(5030);
    let header = sampler.header();
    let producer = Producer::start(listen, sampler).map_err(|error| {
        CannotRun::new(
            format!("cannot listen on {listen}: {error}"),
            "choose another port with --listen 127.0.0.1:5031",
        )
    })?;
    let (at, names) = (producer.listen_address(), header.channels.join(", "));
    print_text(&format!("serving {names} at {} Hz: waveform://{at}\n", header.rate_hz));
    let stopping = super::stop_flag()?;
    while !producer.is_finished() && !stopping() {
        std::thread::sleep(Duration::from_millis(100));
    }
    producer
        .stop_sampling()
        .map(|()| CommandOutcome::Fine)
        .map_err(|error| CannotRun::new(format!("the sampler failed: {error}"), ""))
}
