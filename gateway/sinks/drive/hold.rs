//! While a sink holds items back: what may pass is delivered, the rest stays open in its position, over restarts too.

use super::{Left, SinkTask, serve_within_deadline};
use crate::{DeliveryHold, Sink};
use adapter_core::clock::TimeNs;
use gateway_base::clock;
use gateway_base::convert::clamp_to_unsigned;
use gateway_history::OutboxHead;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::sleep;

/// While items are held back, it is looked at this often whether that is over: the clock may be set meanwhile.
const LOOK_EVERY: Duration = Duration::from_secs(30);

impl SinkTask {
    /// One batch of what may pass, or else waits for something to happen.
    pub(super) async fn serve_held(
        &mut self,
        sink: &mut dyn Sink,
        head: &mut watch::Receiver<OutboxHead>,
        hold: DeliveryHold,
    ) -> Result<(), Left> {
        let newest = head.borrow_and_update().next_sequence;
        match self.find_unwalked(newest)?.filter(|_| hold.some_pass) {
            Some((from, to)) => self.pass_items(sink, from, to).await,
            None => self.wait_held(sink, head, hold).await,
        }
    }

    /// The first items that are not delivered and have not been looked at.
    fn find_unwalked(&self, head: u64) -> Result<Option<(u64, u64)>, Left> {
        let state = self.outbox.delivery_state(&self.name).ok_or(Left::Stop)?;
        Ok(state.position.undelivered_from(self.walked_to, head))
    }

    /// Delivers the items up to the first that is held back, or passes over that one.
    async fn pass_items(&mut self, sink: &mut dyn Sink, from: u64, to: u64) -> Result<(), Left> {
        let stretch = self.read(from, to, sink.items_max().max(1)).await?;
        let passing = stretch.items.iter().take_while(|item| !sink.is_held(item)).last().map(|item| item.sequence);
        let Some(last) = passing else {
            // Numbers without an item were dropped.
            let first = stretch.items.first().map_or(stretch.to.max(from + 1), |item| item.sequence);
            self.outbox.mark_delivered(&self.name, from, first);
            if !stretch.items.is_empty() {
                self.outbox.hold_item(&self.name, first);
                self.walked_to = first + 1;
            }
            return Ok(());
        };
        let state = self.outbox.delivery_state(&self.name).ok_or(Left::Stop)?;
        self.deliver_batch(sink, (from, last + 1), from < state.position.next()).await?;
        // With too many gaps what was delivered counts as open.
        let open = self.find_unwalked(last + 1)?.is_some_and(|(first, _)| first == from);
        self.walked_to = if open { last + 1 } else { from };
        Ok(())
    }

    async fn wait_held(
        &mut self,
        sink: &mut dyn Sink,
        head: &mut watch::Receiver<OutboxHead>,
        hold: DeliveryHold,
    ) -> Result<(), Left> {
        // Nobody who stops the box waits for a sink that sends nothing.
        self.outbox.set_linked(&self.name, false);
        let wanted = tokio::select! {
            () = sleep(time_left(hold.until_ns)) => Ok(None),
            changed = head.changed(), if hold.some_pass => changed.map(|()| None).map_err(|_| Left::Stop),
            wanted = sink.wait_for_receiver() => Ok(Some(wanted)),
            _ = self.stopping.wait_for(|stop| *stop) => Err(Left::Stop),
        };
        self.outbox.set_linked(&self.name, true);
        match wanted? {
            Some(wanted) => serve_within_deadline(sink, wanted).await,
            None => Ok(()),
        }
    }
}

fn time_left(until_ns: TimeNs) -> Duration {
    let left_ns = until_ns.saturating_sub(clock::now_ns());
    Duration::from_nanos(clamp_to_unsigned(left_ns)).min(LOOK_EVERY)
}
