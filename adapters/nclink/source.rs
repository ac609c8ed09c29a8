//! An NC-Link device as a source.

use super::connection::{Connection, Link, Unasked};
use super::map::{self, NcLinkLayout, NcLinkPoll};
use super::message::{NcLinkAnswer, RequestedItem};
use super::model::{Model, ModelItem};
use super::own_path::OwnPath;
use super::sample::SampleBlock;
use super::sample_tracks::SampleTracks;
use super::topic::Subject;
use crate::address::NcLinkTarget;
use adapter_core::channel::ChannelId;
use adapter_core::clock::{Clock, SECOND_NS, TimeNs};
use adapter_core::driver::{Fact, Offer, Source, SourceError, SourceProblem};
use adapter_core::own::Own;
use adapter_core::reading::{Reading, Stamp};
use std::time::{Duration, Instant};

/// Takes whole blocks of a sample channel, with the moment of their arrival.
pub type BlockSink = Box<dyn FnMut(&SampleBlock, Instant) + Send>;

/// A device that says nothing of it may have another model all the same: it is asked so often.
const PROBE_NS: i64 = 60 * SECOND_NS;
/// A device that registers itself so often within one poll never comes to rest.
const REGISTERED_MAX: usize = 3;

/// Reads a device at the pace of its address. Connects at the first poll, and anew after the line broke.
pub struct NcLinkSource {
    link: Link,
    layout: NcLinkLayout,
    period: Duration,
    channels: Vec<ChannelId>,
    own: Vec<Own<OwnPath>>,
    session: Option<NcLinkSession>,
    track: SampleTracks,
    /// Models that were another one than before.
    model_changes: u32,
    sink: Option<BlockSink>,
}

/// What holds as long as the connection does.
struct NcLinkSession {
    connection: Connection,
    model: Model,
    poll: NcLinkPoll,
    by_path: bool,
    /// Has any answer been of use? Until then the other way of naming is tried once.
    understood: bool,
    turned: bool,
    /// It was silent, or registered itself: it may have another model, or be another machine.
    doubtful: bool,
    /// Was its model another one when it was asked for again?
    has_new_model: bool,
    /// When its model was last asked for.
    probed_ns: TimeNs,
}

impl NcLinkSource {
    /// A source of this name for what the address says.
    #[must_use]
    pub fn new(name: &str, target: &NcLinkTarget, login: Option<(String, String)>) -> Self {
        let link = Link::from_target(name, target, login);
        let layout = NcLinkLayout { f_channel: target.f_channel, spindle_axis: target.spindle_axis };
        let period = Duration::from_millis(target.period_ms);
        Self {
            link,
            layout,
            period,
            channels: map::list_channels(&target.own),
            own: target.own.clone(),
            session: None,
            track: SampleTracks::default(),
            model_changes: 0,
            sink: None,
        }
    }

    /// Whole blocks of every sample channel go there from now on.
    pub fn on_block(&mut self, sink: BlockSink) {
        self.sink = Some(sink);
    }

    /// What the sample channels have brought so far.
    #[must_use]
    pub fn track(&self) -> &SampleTracks {
        &self.track
    }

    /// What the device says it has; `None` while it is not connected.
    #[must_use]
    pub fn model(&self) -> Option<&Model> {
        self.session.as_ref().map(|session| &session.model)
    }

    fn poll(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        let mut session = match self.session.take() {
            Some(session) => session,
            None => NcLinkSession::open(&self.link, self.layout, &self.own, clock.now_ns())?,
        };
        let mut outcome = Err(self.build_restless_error());
        for _ in 0..REGISTERED_MAX {
            let answers = session.query_values(self.layout, &self.own, clock);
            self.model_changes += u32::from(std::mem::take(&mut session.has_new_model));
            // What came by itself is taken in any case: a device that does not answer may still send.
            let registered = self.record_unasked(&mut session)?;
            if !registered {
                outcome = answers.map(|(answers, stamp)| session.poll.append_readings(&answers, stamp, out));
                session.doubtful = matches!(outcome, Err(SourceError::Timeout { .. }));
                break;
            }
            // The answers may be those of the old model or of the new one: they are asked for again, after the model.
            session.doubtful = true;
        }
        // Only a broken line needs another connection.
        self.session = (!matches!(outcome, Err(SourceError::Line { .. }))).then_some(session);
        outcome
    }

    /// Takes what came by itself. Has the device registered itself or told a version of its model? What it sent after that cannot be
    /// read before the model is known, and is dropped.
    fn record_unasked(&mut self, session: &mut NcLinkSession) -> Result<bool, SourceError> {
        let unasked = session.connection.take_unasked()?;
        self.track.lost_messages(session.connection.count_lost());
        let mut registered = false;
        for message in &unasked {
            match message.subject {
                Subject::Register | Subject::Version => registered = true,
                Subject::Sample if registered => {
                    self.track.record_dropped("it came before the model that belongs to it was known");
                }
                _ => self.record_message(message, &session.model),
            }
        }
        Ok(registered)
    }

    fn build_restless_error(&self) -> SourceError {
        SourceError::Decode {
            source_name: self.link.name.clone(),
            request: "the probe of its model".to_owned(),
            what: "the device registers itself anew all the time: do two devices have this serial number?".to_owned(),
        }
    }

    fn record_message(&mut self, message: &Unasked, model: &Model) {
        match message.subject {
            Subject::Sample => match SampleBlock::parse(&message.message, &message.tail, model) {
                Ok(block) => {
                    self.track.record_block(&block);
                    if let Some(sink) = &mut self.sink {
                        sink(&block, message.arrived);
                    }
                }
                Err(why) => self.track.record_nonsense(why.to_string()),
            },
            _ => self.track.record_event(&message.message),
        }
    }
}

impl NcLinkSession {
    fn open(link: &Link, layout: NcLinkLayout, own: &[Own<OwnPath>], probed_ns: TimeNs) -> Result<Self, SourceError> {
        let mut connection = Connection::open(link, true)?;
        let model = connection.probe_model()?;
        let by_path = model.names_by_path();
        let plan = NcLinkPoll::from_model(&model, layout, own, by_path);
        if plan.requested_items().is_empty() {
            return Err(SourceError::Decode {
                source_name: link.name.clone(),
                request: "the probe of its model".to_owned(),
                what: format!("none of its {} data items is one that the gateway knows", model.items.len()),
            });
        }
        Ok(Self {
            connection,
            model,
            poll: plan,
            by_path,
            understood: false,
            turned: false,
            doubtful: false,
            has_new_model: false,
            probed_ns,
        })
    }

    /// Asks for the model again.
    fn renew_model(&mut self, layout: NcLinkLayout, own: &[Own<OwnPath>], now_ns: TimeNs) -> Result<(), SourceError> {
        // Until it has come nothing is believed.
        self.doubtful = true;
        let model = self.connection.probe_model()?;
        (self.doubtful, self.probed_ns) = (false, now_ns);
        if model != self.model {
            self.model = model;
            self.by_path = self.model.names_by_path();
            (self.has_new_model, self.understood, self.turned) = (true, false, false);
            self.poll = NcLinkPoll::from_model(&self.model, layout, own, self.by_path);
        }
        Ok(())
    }

    /// One query for everything. When a device refuses everything it is asked once by its other names.
    fn query_values(
        &mut self,
        layout: NcLinkLayout,
        own: &[Own<OwnPath>],
        clock: &dyn Clock,
    ) -> Result<(Vec<Option<NcLinkAnswer>>, Stamp), SourceError> {
        let now_ns = clock.now_ns();
        // A clock that was set back asks, too.
        if self.doubtful || !(0..PROBE_NS).contains(&(now_ns - self.probed_ns)) {
            self.renew_model(layout, own, now_ns)?;
        }
        loop {
            let began_ns = clock.now_ns();
            let answers = self.connection.query_values(self.poll.requested_items())?;
            let stamp = Stamp::of_request(began_ns, clock.now_ns());
            self.understood |= answers.iter().any(|answer| matches!(answer, Some(Ok(_))));
            if self.understood || self.turned {
                return Ok((answers, stamp));
            }
            self.turned = true;
            self.by_path = !self.by_path;
            self.poll = NcLinkPoll::from_model(&self.model, layout, own, self.by_path);
        }
    }
}

impl Source for NcLinkSource {
    fn name(&self) -> &str {
        &self.link.name
    }

    fn channels(&self) -> &[ChannelId] {
        &self.channels
    }

    fn period(&self) -> Duration {
        self.period
    }

    fn query_identity(&self) -> Vec<(&'static str, String)> {
        let Some(model) = self.model() else { return Vec::new() };
        let sampled: Vec<String> =
            model.samples.iter().map(|channel| format!("{} every {} ms", channel.id, channel.interval_ms)).collect();
        vec![
            ("name", model.name.clone()),
            ("serial", self.link.serial.clone()),
            ("data items", model.items.len().to_string()),
            ("sample channels", sampled.join(", ")),
        ]
    }

    fn read(&mut self, clock: &dyn Clock, out: &mut Vec<Reading>) -> Result<(), SourceError> {
        self.poll(clock, out)
    }

    fn collect_facts(&self) -> Vec<Fact> {
        let mut facts = self.track.collect_facts();
        facts.extend(self.model().map(|model| Fact::from_text("device", &model.name)));
        facts.push(Fact::from_number("model_changes", f64::from(self.model_changes)));
        facts
    }

    fn list_problems(&self) -> Vec<SourceProblem> {
        let of_model = self.session.as_ref().map_or_else(Vec::new, |session| session.poll.problems().to_vec());
        of_model.into_iter().chain(self.track.list_problems()).collect()
    }

    fn list_offers(&mut self, clock: &dyn Clock) -> Result<Vec<Offer>, SourceError> {
        let mut session = match self.session.take() {
            Some(session) => session,
            None => NcLinkSession::open(&self.link, self.layout, &self.own, clock.now_ns())?,
        };
        let offers = session.list_offers();
        self.session = offers.is_ok().then_some(session);
        offers
    }
}

/// At most so many items are asked for in one request.
const OFFERED_AT_ONCE: usize = 50;
/// A value is shown up to this length.
const SHOWN_MAX: usize = 60;

impl NcLinkSession {
    /// Every item of the model, with what it says now. What the model itself tells is no data item.
    fn list_offers(&mut self) -> Result<Vec<Offer>, SourceError> {
        let items: Vec<ModelItem> = self.model.items.iter().filter(|item| item.value.is_none()).cloned().collect();
        let mut offers = Vec::with_capacity(items.len());
        for some in items.chunks(OFFERED_AT_ONCE) {
            let names: Vec<String> = some.iter().map(|item| map::name_item(item, self.by_path)).collect();
            let asks: Vec<RequestedItem> = names.iter().map(|name| RequestedItem::from_id(name)).collect();
            let answers = self.connection.query_values(&asks)?;
            for ((item, name), answer) in some.iter().zip(&names).zip(answers) {
                offers.push(Offer {
                    name: item.path.clone(),
                    says: describe_answer(item, answer),
                    channel: self.poll.find_channel(name),
                });
            }
        }
        Ok(offers)
    }
}

fn describe_answer(item: &ModelItem, answer: Option<NcLinkAnswer>) -> Result<String, String> {
    if item.path.contains("VARIABLE@") {
        return Ok("a list: name an element, as in `read = \"PATH 120\"`".to_owned());
    }
    let values = answer.unwrap_or_else(|| Err("nothing".to_owned()))?;
    let shown: Vec<String> = values.iter().map(ToString::to_string).collect();
    let mut text: String = shown.join(", ").chars().take(SHOWN_MAX).collect();
    if let Some(unit) = &item.unit {
        text.push_str(&format!(" {unit}"));
    }
    Ok(text)
}
