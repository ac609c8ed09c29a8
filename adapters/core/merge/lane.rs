//! One channel at a tick: which of its sources it is taken from.

use super::track::ReadingTrack;
use super::{Failure, SourceId, SourceState};
use crate::channel::ChannelId;
use crate::clock::TimeNs;
use crate::reading::Absence;
use crate::sample::Slot;
use std::ops::Range;

/// Where the newest value of a channel came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// The source that delivered it.
    pub source: SourceId,
    /// For a stand-in: why the source that the channel belongs to has no value.
    pub stands_in_because: Option<Absence>,
}

/// The tracks of one channel, in the order of the sources.
pub(super) struct Lane {
    pub(super) channel: ChannelId,
    pub(super) tracks: Range<usize>,
    pub(super) origin: Option<Origin>,
    /// Had the channel a value at the newest tick?
    pub(super) has_value: bool,
}

impl Lane {
    /// The value of the source that the channel belongs to, or of a stand-in; without any, the reason of the one it belongs to.
    pub(super) fn choose_slot(
        &mut self,
        tracks: &mut [ReadingTrack],
        sources: &mut [SourceState],
        at_ns: TimeNs,
    ) -> Slot {
        self.has_value = false;
        let (mut reason, mut owned): (Option<Slot>, bool) = (None, false);
        for track in &mut tracks[self.tracks.clone()] {
            if owned && !track.stands_in {
                continue;
            }
            let state = &mut sources[track.source];
            let slot = explain_absence(track.evaluate_at(at_ns, state.period_limits.gap_ns), state.failure, at_ns);
            if slot.value.is_ok() {
                state.counts.stepped_in += u64::from(owned);
                let stands_in_because = reason.filter(|_| owned).and_then(|reason| reason.value.err());
                self.has_value = true;
                self.origin = Some(Origin { source: SourceId(track.source), stands_in_because });
                return slot;
            }
            if !owned {
                owned = !track.lacks_channel();
                reason = reason.filter(|_| !owned).or(Some(slot));
            }
        }
        reason.unwrap_or_else(|| Slot::from_absence(Absence::NotProvided))
    }

    /// Does the source deliver the channel, and is it not taken from there even while nobody else has a value?
    pub(super) fn leaves_out(&self, source: SourceId, tracks: &[ReadingTrack]) -> bool {
        let tracks = &tracks[self.tracks.clone()];
        let owner = tracks.iter().position(|track| !track.lacks_channel());
        let own = tracks.iter().position(|track| track.source == source.0);
        own.zip(owner).is_some_and(|(own, owner)| own > owner && !tracks[own].stands_in)
    }
}

/// Replaces "stale" and "not yet read" by what the source itself said. A poll that failed ends the freshness of what came
/// before it: nothing is known from its end until the next answer. A number between two answers was measured on either
/// side and stays.
fn explain_absence(slot: Slot, failure: Option<Failure>, at_ns: TimeNs) -> Slot {
    let Some(failure) = failure.filter(|failure| !failure.ended_by(at_ns)) else { return slot };
    match slot.value {
        Err(Absence::Stale | Absence::NotYetRead) if failure.after_ns <= at_ns => {
            Slot { value: Err(failure.reason), age_ns: slot.age_ns }
        }
        Ok(_) if failure.since_ns <= at_ns && slot.age_ns > 0 => {
            Slot { value: Err(failure.reason), age_ns: slot.age_ns }
        }
        _ => slot,
    }
}
