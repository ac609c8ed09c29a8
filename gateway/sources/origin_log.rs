//! Tells when a channel begins to come from another source than before.

use adapters::ChannelId;
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::merge::{Merge, Origin, SourceId};
use gateway_base::log::{Notice, Severity};

/// So many changes of a channel are told within [`TOLD_WITHIN_NS`]; then the next one waits, and what holds at its end is told. Enough for
/// a line that comes and goes while somebody looks for the fault; more would fill the history with one loose plug.
const TOLD_MAX: usize = 6;

const TOLD_WITHIN_NS: i64 = 60 * SECOND_NS;

/// At most so many channels are named in one notice.
const NAMED_MAX: usize = 8;

/// Which source every shared channel was last told to come from.
#[derive(Debug, Default)]
pub struct OriginLog {
    told: Vec<ToldOrigin>,
}

#[derive(Debug)]
struct ToldOrigin {
    channel: ChannelId,
    origin: Option<Origin>,
    /// When the latest changes were told, the newest first.
    told_ns: [TimeNs; TOLD_MAX],
}

/// Channels that changed from one source to another in the same tick.
#[derive(Debug)]
struct OriginChange {
    channels: Vec<ChannelId>,
    from: SourceId,
    to: Origin,
}

impl OriginLog {
    /// What has changed since the last call; `name_of` gives the name of a source.
    pub fn take_notices(&mut self, merge: &Merge, at_ns: TimeNs, name_of: impl Fn(SourceId) -> String) -> Vec<Notice> {
        if self.told.is_empty() {
            let first = |channel| ToldOrigin { channel, origin: None, told_ns: [TimeNs::MIN; TOLD_MAX] };
            self.told.extend(merge.list_shared_channels().map(first));
        }
        let mut changes: Vec<OriginChange> = Vec::new();
        for told in &mut self.told {
            let Some((from, to)) = told.follow_origin(merge.find_origin(told.channel), at_ns) else { continue };
            match changes.iter_mut().find(|change| change.from == from && change.to == to) {
                Some(change) => change.channels.push(told.channel),
                None => changes.push(OriginChange { channels: vec![told.channel], from, to }),
            }
        }
        changes.iter().map(|change| change.to_notice(&name_of)).collect()
    }
}

impl ToldOrigin {
    /// The sources before and now, where that is to be told.
    fn follow_origin(&mut self, now: Option<Origin>, at_ns: TimeNs) -> Option<(SourceId, Origin)> {
        let now = now?;
        let before = *self.origin.get_or_insert(now);
        let waits = at_ns.saturating_sub(self.told_ns[TOLD_MAX - 1]) < TOLD_WITHIN_NS;
        if before.source == now.source || waits {
            return None;
        }
        self.origin = Some(now);
        self.told_ns.rotate_right(1);
        self.told_ns[0] = at_ns;
        Some((before.source, now))
    }
}

impl OriginChange {
    fn to_notice(&self, name_of: impl Fn(SourceId) -> String) -> Notice {
        let named: Vec<&str> = self.channels.iter().take(NAMED_MAX).map(|channel| channel.name()).collect();
        let more = match self.channels.len().saturating_sub(NAMED_MAX) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let (names, from, to) = (named.join(", "), name_of(self.from), name_of(self.to.source));
        match self.to.stands_in_because {
            Some(reason) => {
                let text = format!("{names}{more}: from {to}, which stands in; {from} has no value ({reason})");
                Notice::new(Severity::Warning, "channel_source", text)
            }
            None => Notice::new(
                Severity::Info,
                "channel_source",
                format!("{names}{more}: from {to}, no longer from {from}"),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapters::merge::{Delay, SourcePlan};
    use adapters::{Reading, Sample, Stamp};
    use std::time::Duration;

    const SECOND: i64 = SECOND_NS;

    struct Meters {
        merge: Merge,
        log: OriginLog,
        power: ChannelId,
    }

    impl Meters {
        /// Two meters of one circuit, each with one value a second; the second one stands in.
        fn new() -> Self {
            let power = ChannelId::from_name("total_power_w").expect("in the table");
            let plan = |name: &str, stand_in: Vec<ChannelId>| SourcePlan {
                name: name.to_owned(),
                channels: vec![power],
                period: Duration::from_secs(1),
                stand_in,
            };
            let merge = Merge::new(&[plan("a", vec![]), plan("b", vec![power])], Delay::Fixed(Duration::ZERO));
            Self { merge, log: OriginLog::default(), power }
        }

        /// What is told in this second; the first meter has a value or not.
        fn tick(&mut self, second: i64, first: bool) -> (Option<f64>, Vec<String>) {
            let (at_ns, mut sample) = (second * SECOND, Sample::new_empty(0));
            let stamp = Stamp::from_exact_time(at_ns);
            if first {
                self.merge.push(SourceId(0), Reading::from_number(self.power, stamp, 1500.0));
            }
            self.merge.push(SourceId(1), Reading::from_number(self.power, stamp, 900.0));
            self.merge.sample_into(&mut sample, at_ns);
            let name_of = |source: SourceId| ["main meter", "spare meter"][source.0].to_owned();
            let notices = self.log.take_notices(&self.merge, at_ns, name_of);
            (sample.number(self.power).ok(), notices.into_iter().map(|notice| notice.operator).collect())
        }
    }

    #[test]
    fn a_value_of_another_source_is_told_with_its_reason_and_so_is_the_return() {
        let mut meters = Meters::new();
        assert_eq!(meters.tick(1, true), (Some(1500.0), vec![]));
        for second in 2..=3 {
            assert_eq!(meters.tick(second, false), (Some(1500.0), vec![]), "held for two periods");
        }
        let told = "total_power_w: from spare meter, which stands in; main meter has no value (stale)";
        assert_eq!(meters.tick(4, false), (Some(900.0), vec![told.to_owned()]));
        assert_eq!(meters.tick(5, false), (Some(900.0), vec![]), "once");
        let told = "total_power_w: from main meter, no longer from spare meter";
        assert_eq!(meters.tick(6, true), (Some(1500.0), vec![told.to_owned()]));
    }

    #[test]
    fn a_line_that_comes_and_goes_is_told_a_few_times_a_minute_and_its_end_always() {
        let mut meters = Meters::new();
        let mut told = Vec::new();
        for second in 0..600 {
            told.extend(meters.tick(second, second < 500 && second % 6 < 2).1.into_iter().map(|text| (second, text)));
        }
        let most = 10 * TOLD_MAX;
        assert!(told.len() >= 20 && told.len() <= most, "{}", told.len());
        let (last, text) = told.last().expect("told");
        assert!(*last <= 560 && text.contains("which stands in"), "{last} s: {text}");
    }
}
