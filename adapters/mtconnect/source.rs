//! A device behind an MTConnect agent as a source.

use crate::address::MtConnectTarget;
use crate::agent::{AgentLink, DocumentError, StreamsDocument, parse_streams};
use crate::device_clock::{DeviceClock, parse_time};
use crate::feed::{LiveStream, ObservationFeed};
use crate::held_values::HeldValues;
use crate::history::ReadingHistory;
use crate::http::HttpError;
use crate::model::Device;
use crate::plan::{ChannelPlan, list_channels};
use crate::sequence::{Break, SequenceTrack};
use crate::streams::{Observation, UNAVAILABLE};
use adapter_core::channel::ChannelId;
use adapter_core::clock::{Clock, SECOND_NS, TimeNs};
use adapter_core::driver::{Fact, Offer, Source, SourceError, SourceProblem};
use adapter_core::integer::saturate_to_ns;
use adapter_core::reading::{Reading, Stamp};
use std::time::{Duration, Instant};

/// A device may be another one although its agent says nothing of it: it is asked for so often.
const PROBE_EVERY: Duration = Duration::from_secs(60);
/// Most observations of one document; an agent refuses more than its buffer holds.
const COUNT_MAX: u64 = 4096;
/// Most questions at one poll, where an agent does not answer in parts.
const QUESTIONS_MAX: usize = 20;
/// After so many answers in parts that came to nothing an agent is asked at every poll.
const BROKEN_STREAMS_MAX: u32 = 2;
/// Clocks that lie farther apart are told. Computers that are set by a time server are nearer than this.
const CLOCK_TOLERANCE_NS: i64 = 5 * SECOND_NS;
/// A value is shown up to this length, characters.
const SHOWN_MAX: usize = 60;

/// Reads a device at the pace of its address. Connects at the first poll, and anew after the line broke.
pub struct MtConnectSource {
    link: AgentLink,
    target: MtConnectTarget,
    channels: Vec<ChannelId>,
    session: Option<AgentSession>,
    /// The device as it was described last, and what becomes of its observations.
    device: Option<Device>,
    plan: ChannelPlan,
    values: HeldValues,
    track: SequenceTrack,
    clock: DeviceClock,
    history: ReadingHistory,
    broken_streams: u32,
}

/// What holds as long as a connection does.
struct AgentSession {
    feed: ObservationFeed,
    /// Most observations that are asked for at once.
    count: u64,
    probed_at: Instant,
    /// Until this number what comes is the past.
    catch_up_to: Option<u64>,
}

impl AgentSession {
    fn find_part_interval(&self) -> Option<Duration> {
        match &self.feed {
            ObservationFeed::Stream(stream) => stream.find_part_interval(),
            ObservationFeed::Questions => None,
        }
    }
}

/// Why a session ends.
enum SessionEnd {
    /// Ask for the devices and go on at once.
    Reopen,
    Failed(SourceError),
}

impl From<SourceError> for SessionEnd {
    fn from(error: SourceError) -> Self {
        Self::Failed(error)
    }
}

impl MtConnectSource {
    /// A source of this name for what the address says.
    #[must_use]
    pub fn new(name: &str, target: &MtConnectTarget) -> Self {
        Self {
            link: AgentLink::new(name, target),
            target: target.clone(),
            channels: list_channels(target),
            session: None,
            device: None,
            plan: ChannelPlan::default(),
            values: HeldValues::default(),
            track: SequenceTrack::default(),
            clock: DeviceClock::default(),
            history: ReadingHistory::default(),
            broken_streams: 0,
        }
    }

    /// The agent is asked to send twice at every poll, so that each has a part to say that nothing else has changed.
    fn interval(&self) -> Duration {
        Duration::from_millis((self.target.period_ms / 2).max(10))
    }

    fn poll(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        self.link.begin_poll();
        self.history.expire(clock.now_ns());
        let Some(mut session) = self.session.take() else {
            self.session = Some(self.open_session(clock, out)?);
            return Ok(());
        };
        match self.follow_session(&mut session, clock, out) {
            Ok(()) => self.session = Some(session),
            Err(SessionEnd::Reopen) => self.session = Some(self.open_session(clock, out)?),
            Err(SessionEnd::Failed(error)) => return Err(error),
        }
        Ok(())
    }

    /// Asks for device and values, and for the observations from there on.
    fn open_session(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<AgentSession, SourceError> {
        let device = self.link.probe_device()?;
        let probed_at = Instant::now();
        let began_ns = clock.now_ns();
        let current = self.link.ask_current(&device)?;
        let stamp = Stamp::of_request(began_ns, clock.now_ns());
        let newest = current.observations.iter().filter_map(|observation| observation.sequence).max();
        let resume = self.track.resume(&current.header, newest);
        if let Some(gap) = resume.gap {
            self.history.record_gap(stamp.mid_ns, gap);
            self.values.clear_conditions();
        }
        if resume.is_restart {
            self.history.record_restart(stamp.mid_ns);
        }
        if resume.is_restart || self.device.as_ref() != Some(&device) {
            self.history.model_changes += u64::from(self.device.as_ref().is_some_and(|known| *known != device));
            self.plan = ChannelPlan::from_device(&device, &self.target);
            self.values = HeldValues::default();
        }
        // What comes again in the answer to `sample` is taken there, with its time.
        for observation in &current.observations {
            let comes_again = observation.sequence.is_some() && observation.sequence >= resume.from;
            let is_standing = resume.gap.is_some() && observation.condition.is_some();
            if (!comes_again || is_standing) && !self.values.holds_observation(&self.plan, observation) {
                self.values.record_observation(&self.plan, observation, stamp, &mut Vec::new());
            }
        }
        let count = current.header.buffer_size.unwrap_or(COUNT_MAX).clamp(1, COUNT_MAX);
        let feed = self.open_feed(&device, count)?;
        self.device = Some(device);
        self.history.connections += 1;
        let behind = current.header.next_sequence.or(newest.map(|newest| newest.saturating_add(1)));
        let session = AgentSession { feed, count, probed_at, catch_up_to: behind.filter(|_| behind > resume.from) };
        if session.catch_up_to.is_none() {
            self.values.append_all(&self.plan, stamp, out);
        }
        Ok(session)
    }

    fn open_feed(&mut self, device: &Device, count: u64) -> Result<ObservationFeed, SourceError> {
        if self.broken_streams >= BROKEN_STREAMS_MAX {
            return Ok(ObservationFeed::Questions);
        }
        let response = match self.link.open_sample(device, self.track.next(), count, self.interval()) {
            // An agent that does not know parts, or not so often, answers a plain question.
            Err(SourceError::Refused { .. }) => {
                return self.link.ask_sample(device, self.track.next(), count).map(|_| ObservationFeed::Questions);
            }
            response => response?,
        };
        let to_error = |error| self.link.to_line_error("sample", error);
        match LiveStream::from_response(response, self.link.silence).map_err(to_error)? {
            Ok(stream) => Ok(ObservationFeed::Stream(Box::new(stream))),
            // An answer in one part says whether the question was understood; its observations are asked for again.
            Err(response) => {
                let body = response.read_body(self.link.deadline()).map_err(to_error)?;
                parse_streams(&body).map_err(|error| self.link.to_source_error("sample", error))?;
                Ok(ObservationFeed::Questions)
            }
        }
    }

    /// Takes what has come since the last poll.
    fn follow_session(
        &mut self,
        session: &mut AgentSession,
        clock: &dyn Clock,
        out: &mut Vec<Reading>,
    ) -> Result<(), SessionEnd> {
        if session.probed_at.elapsed() >= PROBE_EVERY {
            session.probed_at = Instant::now();
            if self.device.as_ref() != Some(&self.link.probe_device()?) {
                return Err(SessionEnd::Reopen);
            }
        }
        let interval = self.interval();
        let is_new = match &mut session.feed {
            ObservationFeed::Stream(stream) => {
                let parts = stream.take_parts(interval);
                let so_far = stream.parts;
                let parts = parts.map_err(|error| self.end_stream(error, so_far))?;
                if stream.is_steady() {
                    self.broken_streams = 0;
                }
                let arrived_ns = clock.now_ns();
                for part in &parts {
                    let document = parse_streams(part).map_err(|error| self.end_document(error))?;
                    self.take_document(document, arrived_ns, out)?;
                }
                !parts.is_empty()
            }
            ObservationFeed::Questions => {
                self.ask_questions(session.count, clock, out)?;
                true
            }
        };
        session.catch_up_to = session.catch_up_to.filter(|target| self.track.next() < Some(*target));
        if is_new && session.catch_up_to.is_none() {
            // Of the part that came last it is known that it was made within the last interval.
            let half_ns = saturate_to_ns(
                session.find_part_interval().map_or(self.interval(), |known| known.max(self.interval())),
            ) / 2;
            let stamp = Stamp { mid_ns: clock.now_ns().saturating_sub(half_ns), half_width_ns: half_ns };
            self.values.append_all(&self.plan, stamp, out);
        }
        Ok(())
    }

    fn ask_questions(&mut self, count: u64, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SessionEnd> {
        let Some(device) = self.device.clone() else { return Err(SessionEnd::Reopen) };
        for _ in 0..QUESTIONS_MAX {
            let document = self.link.ask_sample(&device, self.track.next(), count)?;
            let is_last = adapter_core::integer::widen_to_u64(document.observations.len()) < count;
            let is_newest = self.take_document(document, clock.now_ns(), out)?;
            if is_last || is_newest {
                break;
            }
        }
        Ok(())
    }

    fn end_stream(&mut self, error: HttpError, parts: u64) -> SessionEnd {
        // An agent that does not send while nothing changes looks like a broken line: it is asked instead.
        self.broken_streams += u32::from(parts < 2 || error == HttpError::Timeout);
        match error {
            // An agent may end its answer at any time; where it is gone, the next question says so.
            HttpError::Line(_) => SessionEnd::Reopen,
            other => SessionEnd::Failed(self.link.to_line_error("sample", other)),
        }
    }

    fn end_document(&self, error: DocumentError) -> SessionEnd {
        match error {
            // For example because the agent has overwritten what comes next: `current` says how much.
            DocumentError::Refused { .. } => SessionEnd::Reopen,
            nonsense @ DocumentError::Nonsense(_) => SessionEnd::Failed(self.link.to_source_error("sample", nonsense)),
        }
    }

    /// Takes the new observations of a document. Does it say that the agent has no others?
    fn take_document(
        &mut self,
        document: StreamsDocument,
        arrived_ns: TimeNs,
        out: &mut Vec<Reading>,
    ) -> Result<bool, SessionEnd> {
        let unnumbered = document.observations.iter().filter(|observation| observation.sequence.is_none()).count();
        let fresh = self.track.accept(&document.header, document.observations).map_err(|why| {
            self.history.model_changes += u64::from(why == Break::ModelChanged);
            SessionEnd::Reopen
        })?;
        self.history.unusable += adapter_core::integer::widen_to_u64(unnumbered);
        let times: Vec<Option<TimeNs>> =
            fresh.observations.iter().map(|observation| parse_time(&observation.timestamp)).collect();
        times.iter().flatten().for_each(|told_ns| self.clock.record_arrival(arrived_ns, *told_ns));
        for (observation, told_ns) in fresh.observations.iter().zip(times) {
            self.history.observations += 1;
            self.history.unusable += u64::from(told_ns.is_none());
            let mid_ns = told_ns.map_or(arrived_ns, |told_ns| self.clock.convert_time(told_ns, arrived_ns));
            let stamp = Stamp { mid_ns, half_width_ns: saturate_to_ns(self.interval()) / 2 };
            self.values.record_observation(&self.plan, observation, stamp, out);
        }
        Ok(fresh.is_newest)
    }

    fn describe_way(&self) -> &'static str {
        match self.session.as_ref().map(|session| &session.feed) {
            Some(ObservationFeed::Stream(_)) => "one answer that does not end",
            Some(ObservationFeed::Questions) => "a question at every poll",
            None => "not connected",
        }
    }

    fn find_clock_problem(&self) -> Option<SourceProblem> {
        let difference_ns = self.clock.find_difference_ns()?;
        (difference_ns.saturating_abs() > CLOCK_TOLERANCE_NS).then(|| SourceProblem {
            what: "the times of its observations lie more than 5 s from the gateway's clock; they are moved by the difference".to_owned(),
            next: "Set the clocks of adapter, agent and box by the same time server, and the adapter to UTC".to_owned(),
        })
    }
}

impl Source for MtConnectSource {
    fn name(&self) -> &str {
        &self.link.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        Duration::from_millis(self.target.period_ms)
    }

    fn achievable_period(&self) -> Duration {
        let known = self.session.as_ref().and_then(AgentSession::find_part_interval);
        known.map_or(self.period(), |known| known.max(self.period()))
    }

    fn query_identity(&self) -> Vec<(&'static str, String)> {
        let Some(device) = &self.device else { return Vec::new() };
        vec![
            ("name", device.name.clone()),
            ("uuid", device.uuid.clone()),
            ("machine", device.description.clone()),
            ("data items", device.items.len().to_string()),
            ("way", self.describe_way().to_owned()),
        ]
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        self.poll(clock, out)
    }

    #[expect(clippy::cast_precision_loss, reason = "a count, and nanoseconds that are shown in seconds")]
    fn collect_facts(&self) -> Vec<Fact> {
        let mut facts = self.history.collect_facts();
        facts.push(Fact::from_number("repeated_observations", self.track.repeated_count as f64));
        facts.push(Fact::from_text("way", self.describe_way()));
        facts.extend(self.device.as_ref().map(|device| Fact::from_text("device", &device.name)));
        let difference_ns = self.clock.find_difference_ns();
        facts.extend(difference_ns.map(|ns| Fact::from_number("clock_difference_s", ns as f64 / SECOND_NS as f64)));
        facts
    }

    fn list_problems(&self) -> Vec<SourceProblem> {
        let of_device = self.plan.problems.iter().cloned().chain(self.values.list_problems());
        of_device.chain(self.history.list_problems()).chain(self.find_clock_problem()).collect()
    }

    fn list_offers(&mut self, _clock: &dyn Clock) -> Result<Vec<Offer>, SourceError> {
        self.link.begin_poll();
        let device = self.link.probe_device()?;
        let current = self.link.ask_current(&device)?;
        let plan = ChannelPlan::from_device(&device, &self.target);
        let offers = device.items.iter().map(|item| {
            let mut of_item = current.observations.iter().filter(|observation| observation.item == item.id);
            let channel = plan.channels_by_item.get(&item.id).and_then(|fed| fed.first()).map(|fed| fed.channel);
            let condition = plan.conditions.iter().find(|condition| condition.items.contains(&item.id));
            Offer {
                name: item.id.clone(),
                says: match of_item.next() {
                    Some(found) => describe_value(found, item.units.as_deref()).ok_or_else(|| UNAVAILABLE.to_owned()),
                    None => Err("nothing".to_owned()),
                },
                channel: channel.or(condition.map(|condition| condition.channel)),
            }
        });
        Ok(offers.collect())
    }
}

/// What is shown of an observation; `None` where the agent has no value.
fn describe_value(observation: &Observation, units: Option<&str>) -> Option<String> {
    if let Some(fields) = &observation.condition {
        return Some(format!("{:?} {}", fields.level, observation.text).trim().to_owned());
    }
    let shown: String = observation.text.chars().take(SHOWN_MAX).collect();
    let has_value = shown != UNAVAILABLE;
    has_value.then(|| units.map_or_else(|| shown.clone(), |units| format!("{shown} {units}")))
}
