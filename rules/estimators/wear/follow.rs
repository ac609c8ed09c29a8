//! The wear of every edge as a state that is followed over cuts, parts and operations: a Kalman filter.
//!
//! What is measured is the logarithm of the cutting energy of an edge in one part over what a sharp edge would take:
//!
//! ```text
//! ln(E / E0) = level of all tools + constant of the operation + hardness of the material + ln(1 + rise * wear) + noise
//! ```
//!
//! Wear and its rate belong to an edge, the constant to a program, tool and operation, the hardness to all tools at once. So a
//! harder lot, which makes every tool take more, is told from an edge that wears; a heavier cut of another operation is told from
//! both; and what was learned of an operation with one edge serves the next. With a learned model the constants are known to be
//! near 0 and the wear is in its millimetres; without one it is in typical millimetres, relative to the first cuts of the edges.
//!
//! A model, or typical numbers, may be far off in one operation: a cut outside of what was learned, a load loss that is not known at
//! its speed. The first cut of an operation tells (`doubt`); without that, a model that is a third too low in one operation makes
//! the edge look worn there.
//!
//! Source: R. E. Kalman 1960, extended to the logarithm by its slope at the estimate. What happened between two parts is chosen
//! among a few possibilities by likelihood: nothing, another hardness, a new edge that nobody announced.

use super::edge_state::{CuttingEdge, EdgeMeasurement, OperationGroup, WearNews};
use super::gaussian::Gaussian;
use super::operation_limit::FreshLevels;
use super::outlook::{Known, Outlook};
use super::prior::*;
use super::work::{EdgeWork, WorkKey, WorkReference};
use adapter_core::tool_name::edge_of;
use serde::{Deserialize, Serialize};

/// Follows the edges of one machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WearFollower {
    pub(super) joint: Gaussian,
    pub(super) hardness: usize,
    level: usize,
    pub(super) edges: Vec<CuttingEdge>,
    pub(super) groups: Vec<OperationGroup>,
    program: String,
    work_material: String,
    last_s: f64,
    parts: u64,
    /// The controller names edges: a new one is announced.
    pub(super) edges_named: bool,
}

impl Default for WearFollower {
    fn default() -> Self {
        let mut joint = Gaussian::default();
        let hardness = joint.add(0.0, HARDNESS_SD.powi(2));
        let level = joint.add(0.0, LEVEL_SD.powi(2));
        Self {
            joint,
            hardness,
            level,
            edges: Vec::new(),
            groups: Vec::new(),
            program: String::new(),
            work_material: String::new(),
            last_s: 0.0,
            parts: 0,
            edges_named: false,
        }
    }
}

impl WearFollower {
    /// Do its numbers belong together? It may come from a file.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let count = self.joint.len();
        let own = [self.hardness, self.level].into_iter();
        let edges = self.edges.iter().flat_map(|edge| [edge.wear, edge.rate]);
        let groups = self.groups.iter().map(|group| group.at);
        self.joint.is_sound() && own.chain(edges).chain(groups).all(|at| at < count)
    }

    /// Takes the work of one part, which ended at `end_s`.
    pub fn record_part(&mut self, works: &[EdgeWork], end_s: f64) -> Vec<WearNews> {
        let works: Vec<&EdgeWork> =
            works.iter().filter(|work| work.seconds >= LEAST_S && work.log_energy_ratio().is_some()).collect();
        let Some(first) = works.first() else { return Vec::new() };
        self.parts += 1;
        self.update_hardness(&first.key, end_s);
        let mut news = Vec::new();
        let wearing = self.predict_wear(&works);
        let measured: Vec<EdgeMeasurement> = works
            .iter()
            .filter(|work| is_leading_operation(work, &works))
            .filter_map(|work| self.measure_edge(work))
            .collect();
        self.weigh_hypotheses(&measured, &mut news);
        for at in &wearing {
            self.hold_against_limit(*at, &works, &mut news);
        }
        for at in wearing {
            self.report_observability(at, &mut news);
        }
        news
    }

    /// Another program, other material or a long pause may bring another hardness.
    fn update_hardness(&mut self, key: &WorkKey, end_s: f64) {
        let other = self.program != key.program || self.work_material != key.work_material;
        if self.parts > 1 && (other || (end_s - self.last_s).abs() > OTHER_MATERIAL_S) {
            self.joint.reset_state(self.hardness, 0.0, HARDNESS_SD.powi(2));
        } else {
            self.joint.add_variance(self.hardness, HARDNESS_STEP_SD.powi(2));
        }
        (self.program, self.work_material, self.last_s) = (key.program.clone(), key.work_material.clone(), end_s);
    }

    /// Lets the edges of this part wear by what has slid along them; which they are.
    fn predict_wear(&mut self, works: &[&EdgeWork]) -> Vec<usize> {
        let mut wearing: Vec<(usize, f64)> = Vec::new();
        for work in works {
            let Some(at) = self.find_or_renew_edge(work) else { continue };
            match wearing.iter_mut().find(|(edge, _)| *edge == at) {
                Some((_, slide_m)) => *slide_m += work.slide_m,
                None => wearing.push((at, work.slide_m)),
            }
        }
        for (at, slide_m) in &wearing {
            let edge = &mut self.edges[*at];
            edge.parts += 1;
            edge.slide_m += slide_m;
            let weight = 1.0 / f64::from(edge.parts.min(5));
            edge.part_m = if edge.part_m > 0.0 { edge.part_m + weight * (slide_m - edge.part_m) } else { *slide_m };
            let rate = self.joint.mean(edge.rate);
            self.joint.add_scaled_state(edge.wear, edge.rate, *slide_m);
            let share = (self.joint.mean(edge.wear) / edge.criterion_mm).clamp(0.0, 1.5);
            self.joint.scale_state(edge.rate, 1.0 + ACCELERATION * share * rate * slide_m / edge.criterion_mm);
            self.joint.add_variance(edge.wear, (GROWTH_STEP * rate * slide_m).powi(2));
            self.joint.add_variance(edge.rate, (RATE_STEP * rate).powi(2));
        }
        wearing.into_iter().map(|(at, _)| at).collect()
    }

    /// The edge of this work; a new one where it has another name than before.
    fn find_or_renew_edge(&mut self, work: &EdgeWork) -> Option<usize> {
        self.edges_named |= edge_of(&work.edge).is_some();
        let found = self.edges.iter().position(|edge| edge.tool == work.key.tool);
        let at = match found {
            Some(at) => at,
            None => self.first_edge(work)?,
        };
        if self.edges[at].name != work.edge {
            self.edges[at].name.clone_from(&work.edge);
            self.renew_edge(at);
        }
        (self.edges[at].criterion_mm, self.edges[at].reference) = (work.criterion_mm, work.key.reference);
        Some(at)
    }

    fn first_edge(&mut self, work: &EdgeWork) -> Option<usize> {
        if self.edges.len() >= TOOLS_MAX {
            return None;
        }
        let (mean, sd) = UNKNOWN_MM;
        let wear = self.joint.add(mean, sd * sd);
        let rate = self.joint.add(RATE.0, RATE.1 * RATE.1);
        self.edges.push(CuttingEdge {
            tool: work.key.tool.clone(),
            name: work.edge.clone(),
            number: 1,
            wear,
            rate,
            slide_m: 0.0,
            parts: 0,
            part_m: 0.0,
            criterion_mm: work.criterion_mm,
            reference: work.key.reference,
            blind: false,
            odd: 0,
            rates: Vec::new(),
            limit_parts: None,
            material_parts: 0,
            lives_m: Vec::new(),
        });
        Some(self.edges.len() - 1)
    }

    /// The edge at this place is a new one; the rate of the one before counts for it.
    pub(super) fn renew_edge(&mut self, at: usize) {
        let edge = &mut self.edges[at];
        let grown = self.joint.mean(edge.wear) - NEW_MM.0;
        if edge.parts >= PARTS_OF_A_LIFE && edge.slide_m > 0.0 && grown > 0.0 {
            edge.rates.push(grown / edge.slide_m);
            let surplus = edge.rates.len().saturating_sub(RATES_MAX);
            edge.rates.drain(..surplus);
        }
        if edge.parts >= PARTS_OF_A_LIFE && edge.slide_m > 0.0 {
            edge.lives_m.push(edge.slide_m);
            let surplus = edge.lives_m.len().saturating_sub(RATES_MAX);
            edge.lives_m.drain(..surplus);
        }
        (edge.number, edge.slide_m, edge.parts, edge.blind) = (edge.number + 1, 0.0, 0, false);
        (edge.limit_parts, edge.material_parts) = (None, 0);
        let (mean, sd) = pool_rates(&edge.rates);
        self.joint.reset_state(edge.wear, NEW_MM.0, NEW_MM.1.powi(2));
        self.joint.reset_state(edge.rate, mean, sd * sd);
    }

    fn measure_edge(&mut self, work: &EdgeWork) -> Option<EdgeMeasurement> {
        let edge = self.edges.iter().position(|edge| edge.tool == work.key.tool)?;
        let excess = work.log_energy_ratio()?;
        let (group, is_new) = self.find_or_add_group(work, excess);
        let group_path = &mut self.groups[group].path_mm;
        if work.key.reference == WorkReference::Feed && (work.path_mm / *group_path - 1.0).abs() > SAME_PATH {
            // What is longer from now on is learned slowly, what was cut short is left out.
            *group_path += 0.2 * (work.path_mm - *group_path);
            return None;
        }
        self.groups[group].used = self.parts;
        self.note_fresh_level(group, edge, excess, work);
        let one = EdgeMeasurement {
            group: self.groups[group].at,
            edge,
            level: work.key.reference == WorkReference::Typical,
            excess,
            rise: work.rise_per_mm(),
            half_m: 0.5 * work.slide_m,
            variance: REPEAT_SD.powi(2) + (CHANGING_SHARE * work.energy_doubt()).powi(2),
        };
        if is_new {
            self.widen_operation_constant(&one);
        }
        Some(one)
    }

    /// Where the first cut of an operation shows far more or less than was believed, its constant is doubted: neither wear nor
    /// hardness knows of another tool path. The variance is the one that makes what was measured likeliest.
    fn widen_operation_constant(&mut self, first: &EdgeMeasurement) {
        let (gradient, above) = self.compute_innovation(first);
        let believed = self.joint.variance_of(&gradient, first.variance);
        let ratio = above.powi(2) / believed.max(f64::MIN_POSITIVE);
        if ratio > 1.0 && 0.5 * (ratio - 1.0 - ratio.ln()) > OTHER_CONSTANT {
            self.joint.add_variance(first.group, above.powi(2) - believed);
        }
    }

    /// The number of the operation of this work, and whether it is new.
    fn find_or_add_group(&mut self, work: &EdgeWork, excess: f64) -> (usize, bool) {
        if let Some(at) = self.groups.iter().position(|group| group.key == work.key) {
            return (at, false);
        }
        let (mean, sd) = match work.key.reference {
            WorkReference::Model => (0.0, work.reference_doubt().max(MODEL_SD_LEAST)),
            WorkReference::Typical => (0.0, OPERATION_SD),
            WorkReference::Feed => (excess, LEVEL_SD),
        };
        let (key, path_mm, used) = (work.key.clone(), work.path_mm, self.parts);
        if self.groups.len() < GROUPS_MAX {
            let at = self.joint.add(mean, sd * sd);
            self.groups.push(OperationGroup { key, at, path_mm, used, fresh: FreshLevels::default() });
            return (self.groups.len() - 1, true);
        }
        let oldest = (0..self.groups.len()).min_by_key(|at| self.groups[*at].used).unwrap_or(0);
        let at = self.groups[oldest].at;
        self.joint.reset_state(at, mean, sd * sd);
        self.groups[oldest] = OperationGroup { key, at, path_mm, used, fresh: FreshLevels::default() };
        (oldest, true)
    }

    /// The slope over the states, and how far the measurement lies above the estimate. The mean of a part is that of its middle.
    pub(super) fn compute_innovation(&self, one: &EdgeMeasurement) -> (Vec<(usize, f64)>, f64) {
        let edge = &self.edges[one.edge];
        let wear = (self.joint.mean(edge.wear) - one.half_m * self.joint.mean(edge.rate)).max(0.0);
        let slope = one.rise / (1.0 + one.rise * wear);
        let mut gradient =
            vec![(one.group, 1.0), (self.hardness, 1.0), (edge.wear, slope), (edge.rate, -slope * one.half_m)];
        let mut expected = self.joint.mean(one.group) + self.joint.mean(self.hardness) + (1.0 + one.rise * wear).ln();
        if one.level {
            gradient.push((self.level, 1.0));
            expected += self.joint.mean(self.level);
        }
        (gradient, one.excess - expected)
    }

    pub(super) fn is_odd(&self, gradient: &[(usize, f64)], above: f64, one: &EdgeMeasurement) -> bool {
        above.abs() > OUTLIER_SD * self.joint.variance_of(gradient, one.variance).sqrt()
    }

    pub(super) fn update_with_measurement(&mut self, one: &EdgeMeasurement) {
        let (gradient, above) = self.compute_innovation(one);
        let odd = self.is_odd(&gradient, above, one);
        let edge = &mut self.edges[one.edge];
        edge.odd = if odd { edge.odd + 1 } else { 0 };
        match edge.odd {
            0 => {}
            // What stays is no error of measurement: the edge has chipped, or was exchanged.
            ODD_IN_A_ROW.. => {
                edge.odd = 0;
                self.joint.add_variance(edge.wear, edge.criterion_mm.powi(2));
            }
            _ => return,
        }
        self.joint.update_with_measurement(&gradient, above, one.variance);
        let edge = &self.edges[one.edge];
        self.joint.at_least(edge.wear, 0.0);
        self.joint.at_least(edge.rate, 0.02 * RATE.0);
    }

    fn report_observability(&mut self, at: usize, news: &mut Vec<WearNews>) {
        let Some(outlook) = self.outlook_at(at) else { return };
        let edge = &mut self.edges[at];
        if edge.blind != outlook.observed {
            return;
        }
        edge.blind = !outlook.observed;
        let name = edge.name.clone();
        news.push(if edge.blind {
            WearNews::NotObservable { edge: name }
        } else {
            WearNews::Observable { edge: name }
        });
    }

    fn outlook_at(&self, at: usize) -> Option<Outlook> {
        let edge = self.edges.get(at)?;
        if edge.parts == 0 {
            return None;
        }
        let of = |a, b| self.joint.covariance(a, b);
        let known = Known {
            wear: self.joint.mean(edge.wear),
            rate: self.joint.mean(edge.rate),
            covariance: [of(edge.wear, edge.wear), of(edge.wear, edge.rate), of(edge.rate, edge.rate)],
            part_m: edge.part_m,
            criterion_mm: edge.criterion_mm,
        };
        Some(known.build_outlook())
    }

    /// How the edge of this name stands after its last part; `None` before the first one.
    #[must_use]
    pub fn find_outlook(&self, edge: &str) -> Option<(WorkReference, Outlook)> {
        let at = self.edges.iter().position(|known| known.name == edge)?;
        Some((self.edges[at].reference, self.outlook_at(at)?))
    }

    /// What the other two witnesses say of the edge of this name: parts in a row above its limit, and the share of the life of the
    /// edges before it.
    #[must_use]
    pub fn read_witnesses(&self, edge: &str) -> (Option<u32>, Option<f64>) {
        let found = self.edges.iter().find(|known| known.name == edge);
        (found.and_then(|edge| edge.limit_parts), found.and_then(CuttingEdge::life_share))
    }

    /// By how much the material takes more than usual, as a share, with its standard deviation; `None` before the first part.
    #[must_use]
    pub fn material_level(&self) -> Option<(f64, f64)> {
        let sd = self.joint.covariance(self.hardness, self.hardness).max(0.0).sqrt();
        (self.parts > 0).then(|| (self.joint.mean(self.hardness).exp_m1(), sd))
    }

    /// The number of the edge of this tool that is in use, from 1.
    #[must_use]
    pub fn edge_number(&self, tool: &str) -> Option<u32> {
        self.edges.iter().find(|edge| edge.tool == tool).map(|edge| edge.number)
    }
}

/// Is this what most of its operation is compared with? The rest of the operation are entries, exits and corners that the model does
/// not cover; their mixture differs from part to part.
pub(super) fn is_leading_operation(work: &EdgeWork, works: &[&EdgeWork]) -> bool {
    works
        .iter()
        .filter(|other| other.key.is_of_the_same_operation(&work.key))
        .all(|other| other.seconds <= work.seconds)
}

#[cfg(test)]
#[path = "follow_tests.rs"]
mod tests;
