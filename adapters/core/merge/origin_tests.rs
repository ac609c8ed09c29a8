//! Which source a channel is taken from: of every kind of channel, whatever the source that it belongs to does.

use super::*;
use crate::channel::{CHANNELS, Kind};
use crate::reading::{Stamp, Value};
use crate::sample::Slot;
use std::sync::Arc;

const PERIOD_NS: i64 = 100_000_000;

/// What the first source does after its first values.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Loss {
    /// It says nothing more.
    Silent,
    /// Its polls fail.
    Failing,
    /// It tells that it has no value, for this reason.
    Absent(Absence),
}

const LOSSES: [Loss; 6] = [
    Loss::Silent,
    Loss::Failing,
    Loss::Absent(Absence::Refused),
    Loss::Absent(Absence::NotSupported),
    Loss::Absent(Absence::OutOfRange),
    Loss::Absent(Absence::UnknownUnit),
];

struct Two {
    merge: Merge,
    channel: ChannelId,
    at_ns: i64,
}

impl Two {
    fn new(channel: ChannelId, declared: bool) -> Self {
        let plan = |name: &str, stand_in: Vec<ChannelId>| SourcePlan {
            name: name.to_owned(),
            channels: vec![channel],
            period: Duration::from_nanos(PERIOD_NS.unsigned_abs()),
            stand_in,
        };
        let second = plan("second", if declared { vec![channel] } else { Vec::new() });
        Self { merge: Merge::new(&[plan("first", Vec::new()), second], Delay::default()), channel, at_ns: 0 }
    }

    fn push(&mut self, source: usize, value: Result<Value, Absence>) {
        let stamp = Stamp::from_exact_time(self.at_ns);
        let reading = match value {
            Ok(Value::Number(number)) => Reading::from_number(self.channel, stamp, number),
            Ok(Value::Text(text)) => Reading::from_text(self.channel, stamp, text),
            Err(reason) => Reading::from_absence(self.channel, stamp, reason),
        };
        self.merge.push(SourceId(source), reading);
    }

    fn lose(&mut self, loss: Loss) {
        match loss {
            Loss::Silent => {}
            Loss::Failing => self.merge.record_failure(
                SourceId(0),
                self.at_ns,
                &SourceError::Line { source_name: "first".into(), what: "reset".into(), next: "Wait.".into() },
            ),
            Loss::Absent(reason) => self.push(0, Err(reason)),
        }
    }

    /// Steps of a period in each of which the second source has its value and the first one does what is asked.
    fn run(&mut self, steps: i64, mut first: impl FnMut(&mut Self)) -> Slot {
        let second = value_of(self.channel, 1);
        for _ in 0..steps {
            self.at_ns += PERIOD_NS;
            self.push(1, Ok(second.clone()));
            first(self);
        }
        let mut sample = Sample::new_empty(0);
        self.merge.sample_into(&mut sample, self.at_ns);
        sample.slot(self.channel).clone()
    }
}

/// A value that a channel can have, another one for each source.
fn value_of(channel: ChannelId, source: u8) -> Value {
    let row = channel.channel();
    if row.kind == Kind::Text {
        return Value::Text(Arc::from(if source == 0 { "first" } else { "second" }));
    }
    Value::Number(if source == 0 { row.range.0 } else { row.range.1 })
}

fn list_channels() -> Vec<ChannelId> {
    ChannelId::list_all().take(CHANNELS.len()).collect()
}

#[test]
fn a_second_source_never_takes_the_place_of_the_first_unless_it_is_declared() {
    let (mut absent, mut taken) = (0, 0);
    for channel in list_channels() {
        for (loss, declared) in LOSSES.iter().flat_map(|loss| [(*loss, false), (*loss, true)]) {
            let mut two = Two::new(channel, declared);
            let own = value_of(channel, 0);
            let slot = two.run(3, |two| two.push(0, Ok(own.clone())));
            assert_eq!(slot.value, Ok(own.clone()), "{channel:?} {loss:?}");
            let slot = two.run(5, |two| two.lose(loss));
            let origin = two.merge.find_origin(channel).expect("a value was seen");
            let (unused, counts) = (two.merge.list_unused_channels(SourceId(1)).count(), two.merge.counts(SourceId(1)));
            if declared {
                assert_eq!(slot.value, Ok(value_of(channel, 1)), "{channel:?} {loss:?}");
                assert_eq!((origin.source, unused, counts.stepped_in), (SourceId(1), 0, 1));
                assert!(origin.stands_in_because.is_some(), "{loss:?}");
                taken += 1;
            } else {
                let reason = slot.value.expect_err("nobody stands in");
                let expected = match loss {
                    Loss::Silent => Absence::Stale,
                    Loss::Failing => Absence::Disconnected,
                    Loss::Absent(reason) => reason,
                };
                assert_eq!(reason, expected, "{channel:?}");
                assert_eq!((origin.source, unused, counts.stepped_in), (SourceId(0), 1, 0));
                absent += 1;
            }
            let slot = two.run(3, |two| two.push(0, Ok(own.clone())));
            let origin = two.merge.find_origin(channel).expect("a value was seen");
            assert_eq!((slot.value, origin.source, origin.stands_in_because), (Ok(own), SourceId(0), None));
        }
    }
    assert!(absent == taken && absent >= 6 * 60, "{absent} of {taken}");
}

#[test]
fn a_source_that_never_had_the_channel_leaves_it_to_the_next_one_for_good() {
    for channel in list_channels() {
        let mut two = Two::new(channel, false);
        let before = two.run(2, |_| {});
        assert_eq!(
            before.value,
            Err(Absence::NotYetRead),
            "nothing is taken from elsewhere before the first has answered"
        );
        let other = two.run(2, |two| two.push(0, Err(Absence::NotSupported)));
        assert_eq!(other.value, Ok(value_of(channel, 1)), "{channel:?}");
        let silent = two.run(9, |two| two.lose(Loss::Failing));
        assert_eq!(silent.value, Ok(value_of(channel, 1)), "what it lacks it lacks while it is silent as well");
        let origin = two.merge.find_origin(channel).expect("a value was seen");
        assert_eq!((origin.source, origin.stands_in_because), (SourceId(1), None));
        // A meter that starts refuses a register for seconds, and has it then.
        let own = value_of(channel, 0);
        let slot = two.run(3, |two| two.push(0, Ok(own.clone())));
        assert_eq!(slot.value, Ok(own), "{channel:?}");
        assert_eq!(two.run(3, |two| two.push(0, Err(Absence::NotSupported))).value, Err(Absence::NotSupported));
    }
}
