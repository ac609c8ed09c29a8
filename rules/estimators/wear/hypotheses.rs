//! What may have happened between two parts besides wear, and what the limit of the model says beside the filter.

use super::edge_state::{EdgeMeasurement, WearNews};
use super::follow::{WearFollower, is_leading_operation};
use super::prior::*;
use super::work::EdgeWork;

impl WearFollower {
    /// What happened between the parts: nothing, another hardness, or a new edge of one tool; then takes the measurements. Nothing and
    /// another hardness are mixed by what speaks for them: a fall of all powers may be softer material, or wear that was
    /// overestimated, and a part alone does not tell.
    pub(super) fn weigh_hypotheses(&mut self, measured: &[EdgeMeasurement], news: &mut Vec<WearNews>) {
        let nothing = self.compute_log_likelihood(measured) + OTHER_HARDNESS;
        let mut harder = self.clone();
        harder.joint.reset_state(harder.hardness, 0.0, HARDNESS_SD.powi(2));
        let other = harder.compute_log_likelihood(measured);
        if let Some((renewed, tool)) = self.find_renewed_edge(measured, nothing.max(other)) {
            *self = renewed;
            news.push(WearNews::NewEdge { tool });
            return self.take_all(measured);
        }
        let weight = weight_of(other, nothing);
        let before = self.clone();
        self.take_all(measured);
        if weight > 0.0 {
            harder.take_all(measured);
            self.joint.mix_with(&harder.joint, weight);
            if weight > 0.5 {
                self.edges = harder.edges;
            }
        }
        if weight > 0.5 {
            self.tell_material(&before, news);
        }
    }

    fn take_all(&mut self, measured: &[EdgeMeasurement]) {
        for one in measured {
            self.update_with_measurement(one);
        }
    }

    /// Other material is told with what it means for the wear: what is laid to the one is taken from the other.
    fn tell_material(&self, before: &Self, news: &mut Vec<WearNews>) {
        let change = (self.joint.mean(self.hardness) - before.joint.mean(before.hardness)).exp_m1();
        if change.abs() < MATERIAL_TOLD {
            return;
        }
        let used = self.edges.iter().zip(&before.edges).filter(|(edge, _)| edge.parts > 0);
        let edges =
            used.map(|(edge, old)| (edge.name.clone(), before.joint.mean(old.wear), self.joint.mean(edge.wear)));
        news.push(WearNews::OtherMaterial { change, edges: edges.collect() });
    }

    /// The likeliest new edge of a tool whose controller names none, where it is likelier than `least`.
    fn find_renewed_edge(&self, measured: &[EdgeMeasurement], least: f64) -> Option<(Self, String)> {
        let mut tools: Vec<usize> = measured.iter().map(|one| one.edge).collect();
        tools.dedup();
        let mut best: Option<(f64, Self, String)> = None;
        for at in tools.into_iter().filter(|_| !self.edges_named) {
            let edge = &self.edges[at];
            // Nobody changes an edge that is hardly used, and a fall of its power is another thing.
            if self.joint.mean(edge.wear) < CHANGED_SHARE * edge.criterion_mm {
                continue;
            }
            let mut renewed = self.clone();
            renewed.renew_edge(at);
            renewed.edges[at].parts = 1;
            let likely = renewed.compute_log_likelihood(measured) - UNANNOUNCED_EDGE + OTHER_HARDNESS;
            if likely > best.as_ref().map_or(least, |best| best.0) {
                best = Some((likely, renewed, edge.tool.clone()));
            }
        }
        best.map(|(_, renewed, tool)| (renewed, tool))
    }

    /// Logarithm of how likely the measurements are, one after the other; nothing that leaves one of them odd explains them.
    fn compute_log_likelihood(&self, measured: &[EdgeMeasurement]) -> f64 {
        let mut trial = self.clone();
        let mut sum = 0.0;
        for one in measured {
            let (gradient, above) = trial.compute_innovation(one);
            if trial.is_odd(&gradient, above, one) {
                return f64::NEG_INFINITY;
            }
            sum += trial.joint.log_likelihood(&gradient, above, one.variance);
            trial.joint.update_with_measurement(&gradient, above, one.variance);
        }
        sum
    }

    /// The rule of the source: the power has passed the limit. It counts where every operation that has one says so. The limit is that of the
    /// model, moved by what new edges have shown of the operation.
    pub(super) fn hold_against_limit(&mut self, at: usize, works: &[&EdgeWork], news: &mut Vec<WearNews>) {
        let edge = &self.edges[at];
        let of_edge = works.iter().filter(|work| work.edge == edge.name && is_leading_operation(work, works));
        let of_limit = |work: &&EdgeWork| {
            let beside = self.learned_level(&work.key).map_or(0.0, |level| level.value);
            Some(work.of_limit()? / beside.exp())
        };
        let shares: Vec<f64> = of_edge.filter_map(of_limit).collect();
        let (limit_before, material_before) = (edge.limit_parts, edge.material_parts);
        let is_above = !shares.is_empty() && shares.iter().all(|share| *share > 1.0);
        // The filter may have lost some wear to a softer lot. What it holds for much less than the criterion is an edge in harder
        // material, or in a cut that takes more than the model says; that is told in place of an alarm.
        let may_be_worn = self.joint.mean(edge.wear) >= MAY_BE_WORN_SHARE * edge.criterion_mm;
        let (wear_mm, name) = (self.joint.mean(edge.wear), edge.name.clone());
        let edge = &mut self.edges[at];
        edge.limit_parts =
            (!shares.is_empty()).then(|| if is_above && may_be_worn { limit_before.unwrap_or(0) + 1 } else { 0 });
        edge.material_parts = if is_above && !may_be_worn { material_before + 1 } else { 0 };
        if edge.material_parts == LIMIT_PARTS_TOLD {
            let material = self.joint.mean(self.hardness).exp_m1();
            news.push(WearNews::LimitByMaterial { edge: name, wear_mm, material });
        }
    }
}

/// Weight of a hypothesis against another one, from the logarithms of how likely both are.
fn weight_of(other: f64, nothing: f64) -> f64 {
    match (other.is_finite(), nothing.is_finite()) {
        (true, true) => 1.0 / (1.0 + (nothing - other).exp()),
        (true, false) => 1.0,
        (false, _) => 0.0,
    }
}
