//! What the network asks for, between the sinks, the gate and the audit.

use super::command::{Commands, ROWS_AT_ONCE_MAX};
use super::health::Health;
use super::network_requests::{self as requests, GateSituation, RequestJudgement, SettledRequest};
use adapters::clock::TimeNs;
use gateway_control::{Ending, PostedRequest, RequestedChange};
use gateway_gate::{ArmError, Gate, Verdict};
use gateway_pipeline::Pipeline;
use rules::script::OverrideRequest;

impl Commands {
    /// What the network has asked for meanwhile: judged like the request of a script, or refused; a row of the audit each.
    pub(super) fn hear_network(&mut self, gate: &mut Gate, at_ns: TimeNs, health: &mut Health) {
        for _ in 0..ROWS_AT_ONCE_MAX {
            let Ok(posted) = self.orders.requests.try_recv() else { return };
            let judgement = match health.is_storing() {
                true => self.grant_request(&posted, gate, at_ns, health),
                false => RequestJudgement::from_refusal("no_audit", ArmError::NoAudit.to_string()),
            };
            let PostedRequest { request, reply, outcomes } = posted;
            self.record_audit(requests::build_audit_row(&request, &judgement, at_ns), gate, health);
            // Whoever has gone meanwhile finds both in the audit.
            if let Some(outcome) = requests::build_outcome(&request, &judgement, at_ns) {
                let _full = outcomes.try_send(outcome);
            }
            let _gone = reply.send(judgement.reply);
        }
    }

    fn grant_request(
        &mut self,
        posted: &PostedRequest,
        gate: &mut Gate,
        at_ns: TimeNs,
        health: &mut Health,
    ) -> RequestJudgement {
        let PostedRequest { request, outcomes, .. } = posted;
        match &request.change {
            Ok(RequestedChange::AcknowledgeAlarm { code }) => {
                let reply = self.acknowledge_alarm(code, &requests::format_author(&request.sink), at_ns);
                let ending = if reply.done { (Ending::Followed, "") } else { (Ending::Refused, "no_alarm") };
                RequestJudgement { reply, ending: Some(ending) }
            }
            Ok(change) => {
                let replaced = self.network.replace_pending(request, at_ns);
                self.tell_settled(replaced, gate, health);
                self.network.accept_change((request, outcomes), change, gate.override_arming().err(), at_ns)
            }
            Err(why) => RequestJudgement::from_refusal(why.as_word(), why.to_string()),
        }
    }

    /// The feed override that the network asks for at this tick.
    pub fn network_override(&mut self, at_ns: TimeNs) -> Option<OverrideRequest> {
        self.network.find_least_override(at_ns)
    }

    /// What was asked for while nothing could be written is not written when somebody arms the gate now.
    pub(super) fn end_unarmed_requests(&mut self, gate: &mut Gate, at_ns: TimeNs, health: &mut Health) {
        if let Some(why) = gate.override_arming().err() {
            let ended = self.network.end_requests(why, at_ns);
            self.tell_settled(ended, gate, health);
        }
    }

    /// After the tick: whose request has been followed, and whose will not be.
    pub(super) fn settle_requests(&mut self, pipeline: &mut Pipeline, verdict: &Verdict, health: &mut Health) {
        let situation = GateSituation {
            verdict,
            why_disarmed: pipeline.gate().override_arming().err(),
            control: self.control,
            ramping: pipeline.gate().is_ramping(),
            author: pipeline.scripts().decision().request.as_ref().map(|request| &*request.script),
        };
        let settled = self.network.settle_requests(&situation);
        self.tell_settled(settled, pipeline.gate_mut(), health);
    }

    /// The box ends: what is not known yet will not be known.
    pub(super) fn close_requests(&mut self, at_ns: TimeNs, gate: &mut Gate, health: &mut Health) {
        let ended = self.network.close_requests(at_ns);
        self.tell_settled(ended, gate, health);
    }

    fn tell_settled(&self, settled: Vec<SettledRequest>, gate: &mut Gate, health: &mut Health) {
        for it in settled {
            self.record_audit(it.build_audit_row(), gate, health);
            it.tell_asker();
        }
    }
}
