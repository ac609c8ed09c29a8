//! A controller on a free port, and an adapter that reads it.

use adapters::address::Address;
use adapters::clock::{Clock, SystemClock};
use adapters::fanuc::item::{Area, BlockWord};
use adapters::fanuc::wire::Number;
use adapters::fanuc_server::{Controller, Server, ServerSettings};
use adapters::open::{Opened, open_address};
use adapters::{Absence, Reading, Source, SourceError, Value};
use std::net::TcpListener;

/// What a cut of [`controller`] says, whoever reads it.
pub(crate) const CUT: [(&str, f64); 7] = [
    ("spindle_speed_rpm", 1200.0),
    ("spindle_programmed_rpm", 1200.0),
    ("feed_mm_min", 240.0),
    ("feed_programmed_mm_min", 250.0),
    ("feed_override_pct", 80.0),
    ("spindle_override_pct", 100.0),
    ("spindle_load_pct", 41.0),
];

/// A lathe that cuts: 1200 rpm, 0.2 mm per turn, load 41 %.
pub(crate) fn controller(version: u16) -> Controller {
    let mut control = Controller::new(version, &['X', 'Z']);
    (control.status.run, control.status.motion) = (3, 1);
    control.feed = Number::from_decimal(240, 0);
    control.spindles[0].quantities = [41, 4000, 2, 1200, 41, 1200].map(|value| Number::from_decimal(value, 0));
    control.axes[0].positions[1] = Number::from_decimal(79_000, 3);
    control.axes[1].positions[1] = Number::from_decimal(-12_345, 3);
    control.axes[1].load = Number::from_decimal(-17, 0);
    control.axes[1].current = Number::from_decimal(31, 1);
    control.program = (1001, 1001);
    control.sequence = 120;
    control.set_modal_words([(BlockWord::F, 250), (BlockWord::S, 1200), (BlockWord::T, 303)]);
    control.set_parameter(6711, 3, Number::from_decimal(17, 0));
    control.set_parameter(1001, 0, Number::from_decimal(0, 0));
    control.set_diagnosis(403, 1, Number::from_decimal(48, 0));
    control.memory.set_byte(Area::G, 12, 0xAF);
    control.memory.set_byte(Area::G, 30, 100);
    control.memory.set_byte(Area::F, 0, 0x60);
    control
}

pub(crate) fn serve(controller: Controller, settings: ServerSettings) -> Server {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    Server::start(listener, Box::new(controller), settings).expect("threads")
}

pub(crate) fn address(server: &Server, keys: &str) -> Address {
    format!("fanuc://{}?{keys}", server.address()).parse().expect("usable")
}

pub(crate) fn opened(server: &Server, keys: &str) -> Opened {
    open_address(&address(server, keys), SystemClock::new().now_ns()).expect("opens")
}

/// One poll of a source.
pub(crate) fn poll(source: &mut dyn Source) -> Result<Vec<Reading>, SourceError> {
    let mut out = Vec::new();
    source.read(&SystemClock::new(), &mut out).map(|()| out)
}

/// What a channel says in a poll.
pub(crate) fn value(readings: &[Reading], channel: &str) -> Result<Value, Absence> {
    let found = readings.iter().find(|reading| reading.channel.name() == channel);
    found.unwrap_or_else(|| panic!("no reading of {channel}")).value.clone()
}

pub(crate) fn number(readings: &[Reading], channel: &str) -> f64 {
    match value(readings, channel) {
        Ok(Value::Number(number)) => number,
        other => panic!("{channel}: {other:?}"),
    }
}

pub(crate) fn text(readings: &[Reading], channel: &str) -> String {
    match value(readings, channel) {
        Ok(Value::Text(text)) => text.to_string(),
        other => panic!("{channel}: {other:?}"),
    }
}
