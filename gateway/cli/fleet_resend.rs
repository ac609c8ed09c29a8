//! `cnc-gateway fleet resend`: a stretch of the history once more, on the box.

use super::{CannotRun, CommandOutcome, CommandResult, load_configuration, print_text};
use crate::config::Config;
use crate::history::{Item, Outbox, OutboxReader, Reader, ResentItems, box_id};
use crate::log::{Notice, Severity};
use crate::moment;
use crate::sinks::Resender;
use adapters::clock::TimeNs;
use clap::Args;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;
use tokio::sync::mpsc::channel;

#[derive(Debug, Args)]
pub(super) struct ResendArguments {
    /// Configuration of the box.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Name of the [[sink]] to send to, mqtt:// or nats://.
    #[arg(long, value_name = "NAME")]
    sink: String,
    /// Beginning: 2026-01-31T08:15:00Z, 2026-01-31, or a time before the newest sample such as -7d; the whole history without it.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    from: Option<String>,
    /// End (excluded), in the same notation.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    to: Option<String>,
    /// Items a second at most: live data shares the line and the receiver with them.
    #[arg(long, default_value_t = 2000.0, value_name = "ITEMS")]
    rate: f64,
}

/// How often it tells how far it is.
const TELL_EVERY: Duration = Duration::from_secs(60);

impl ResendArguments {
    /// From when to when; what the sink has still to deliver comes by itself.
    fn find_range(&self, reader: &Reader, config: &Config) -> Result<(TimeNs, TimeNs), CannotRun> {
        let (first_ns, newest_ns) = reader.read_present_span().map_err(CannotRun::from_error)?.unwrap_or((0, 0));
        let at = |text: &Option<String>| {
            text.as_ref().map(|text| moment::parse(text, newest_ns).map_err(CannotRun::from_error)).transpose()
        };
        let from_ns = at(&self.from)?.unwrap_or(first_ns);
        let to_ns = at(&self.to)?.unwrap_or(newest_ns.saturating_add(1));
        let mut waiting = OutboxReader::open(&config.history.path).map_err(CannotRun::from_error)?;
        let oldest_ns = waiting.oldest_waiting_ns(&self.sink).map_err(CannotRun::from_error)?;
        Ok((from_ns, to_ns.min(oldest_ns.unwrap_or(to_ns))))
    }

    fn open_resender(&self, config: &Config) -> Result<(Resender, Outbox), CannotRun> {
        let names = || config.sinks.iter().map(|sink| sink.name.as_str()).collect::<Vec<_>>().join(", ");
        let sink = config.sinks.iter().find(|sink| sink.name == self.sink).ok_or_else(|| {
            CannotRun::new(format!("no [[sink]] is named {:?}", self.sink), format!("write one of: {}", names()))
        })?;
        if !(self.rate > 0.0 && self.rate <= 1e6) {
            return Err(CannotRun::new("--rate is out of range", "give a number of items a second above 0"));
        }
        let name = box_id(&config.history.path, &config.gateway.machine.name).map_err(CannotRun::from_error)?;
        let outbox = Outbox::of_box(config.gateway.machine.clone(), config.outbox.clone(), &name);
        let resender = Resender::new(&sink.address, &sink.name, &outbox, self.rate).ok_or_else(|| {
            let what = format!("the sink {} cannot take old data beside new", sink.name);
            CannotRun::new(what, "name a sink whose address begins with mqtt://, mqtts://, nats:// or natss://")
        })?;
        Ok((resender, outbox))
    }
}

pub(super) async fn resend_stretch(arguments: &ResendArguments) -> CommandResult {
    let config = load_configuration(Some(&arguments.config))?;
    let path = config.history.path.clone();
    let reader = Reader::open(&path).map_err(CannotRun::from_error)?;
    let (from_ns, to_ns) = arguments.find_range(&reader, &config)?;
    let (mut resender, outbox) = arguments.open_resender(&config)?;
    drop(reader);
    // The history is read an hour or two ahead of what is sent, and not further.
    let (pieces, mut made) = channel::<Vec<Item>>(1);
    let reading = tokio::task::spawn_blocking(move || {
        let reader = Reader::open(&path)?;
        let mut items = ResentItems::new(&reader, outbox.settings())?;
        items.for_each_piece(from_ns, to_ns, |piece| match pieces.blocking_send(piece) {
            Ok(()) => ControlFlow::Continue(()),
            Err(_gone) => ControlFlow::Break(()),
        })
    });
    let began = std::time::Instant::now();
    let mut told = began;
    while let Some(piece) = made.recv().await {
        let reached = moment::format_utc(piece.first().map_or(from_ns, |item| item.at_ns));
        resender.send_items(&piece).await.map_err(|error| {
            let (what, next) = error.as_parts();
            CannotRun::new(
                format!("{what}; everything before {reached} is sent"),
                format!("{next}; then go on with --from {reached}"),
            )
        })?;
        if told.elapsed() >= TELL_EVERY {
            told = std::time::Instant::now();
            let text = format!("{} items sent, up to {reached}", resender.sent_count);
            Notice::new(Severity::Info, "resend", text).write_to_logs();
        }
    }
    resender.close().await;
    reading.await.map_err(CannotRun::from_error)?.map_err(CannotRun::from_error)?;
    let (sent, refused, seconds) = (resender.sent_count, resender.refused_count, began.elapsed().as_secs_f64());
    print_text(&format!("{sent} items sent in {seconds:.1} s, {refused} refused\n"));
    Ok(CommandOutcome::Fine)
}
