//! A template: the least that a driver is. It reads one temperature from a device that answers in text; chapter `inside`
//! says what else belongs to a driver.

use adapters::clock::{Clock, ManualClock, SECOND_NS};
use adapters::merge::{Delay, Merge, SourceId, SourcePlan};
use adapters::{Absence, ChannelId, Reading, Sample, Source, SourceError, Stamp};
use std::time::Duration;

/// What the driver needs of a line: ask, and get a text or the reason for none. A real one has a deadline.
trait Ask: Send {
    fn ask(&mut self, question: &str) -> std::io::Result<String>;
}

/// A thermometer that answers `bearing?` with degrees Celsius, or with `-` when its sensor is broken.
struct Thermometer<A> {
    address: String,
    line: A,
    channels: [ChannelId; 1],
}

impl<A: Ask> Thermometer<A> {
    fn new(address: &str, line: A) -> Self {
        let bearing = ChannelId::from_name("bearing_temperature_c").expect("a row of the channel table");
        Self { address: address.to_owned(), line, channels: [bearing] }
    }
}

impl<A: Ask> Source for Thermometer<A> {
    fn name(&self) -> &str {
        &self.address
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        Duration::from_secs(1)
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let began_ns = clock.now_ns();
        let answer = self.line.ask("bearing?").map_err(|error| SourceError::Line {
            source_name: self.address.clone(),
            what: error.to_string(),
            next: "Look at the cable and the power supply of the thermometer".to_owned(),
        })?;
        // The value was true somewhere between question and answer.
        let stamp = Stamp::of_request(began_ns, clock.now_ns());
        let [bearing] = self.channels;
        out.push(match answer.trim() {
            "-" => Reading::from_absence(bearing, stamp, Absence::NotSupported),
            text => match text.parse() {
                // Outside the range of the channel table it becomes an absence by itself.
                Ok(degrees_c) => Reading::from_number(bearing, stamp, degrees_c),
                Err(_) => Reading::from_absence(bearing, stamp, Absence::OutOfRange),
            },
        });
        Ok(())
    }
}

/// A line that gives these answers, one after the other; then it is broken.
struct Script(Vec<&'static str>);

impl Ask for Script {
    fn ask(&mut self, _: &str) -> std::io::Result<String> {
        if self.0.is_empty() {
            return Err(std::io::Error::other("unplugged"));
        }
        Ok(self.0.remove(0).to_owned())
    }
}

#[test]
fn a_driver_reads_and_the_merge_takes_it() {
    let clock = ManualClock::with_time(SECOND_NS);
    let mut source = Thermometer::new("thermometer:test", Script(vec!["41.5\n", "-", "900", "hot"]));
    let bearing = source.channels()[0];
    let mut merge = Merge::new(&[SourcePlan::from_source(&source)], Delay::Fixed(Duration::ZERO));
    let mut readings = Vec::new();
    source.read(&clock, &mut readings).expect("answers");
    merge.push_all(SourceId(0), &mut readings);
    let mut sample = Sample::new_empty(0);
    merge.sample_into(&mut sample, SECOND_NS);
    assert_eq!(sample.slot(bearing).value.as_ref().ok().and_then(|value| value.as_number()), Some(41.5));
    for reason in [Absence::NotSupported, Absence::OutOfRange, Absence::OutOfRange] {
        source.read(&clock, &mut readings).expect("answers");
        assert_eq!(readings.pop().map(|reading| reading.value), Some(Err(reason)));
    }
    let error = source.read(&clock, &mut readings).expect_err("unplugged");
    assert_eq!(error.to_absence(), Absence::Disconnected);
    assert!(readings.is_empty());
}
