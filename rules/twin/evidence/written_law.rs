//! The names as they would be written: every law with the baseline refitted beside it, from several starts, in the form that
//! leaves least of rows left out, and with the departure of the machine from it where that carries over.

use super::latent_law::is_latent;
use super::law_starts::StartSearch;
use super::report::EvidenceReport;
use crate::channel::{SIMULATED_CUT, TIME, read_channel_values};
use crate::departure::{DEPARTURE_USUAL, Departure};
use crate::fit::Fit;
use crate::model::{Part, simulate_parts};
use numerics::linear::columns::dot;
use numerics::statistics::quantile;
use physics::Role;

/// Share of the greatest contribution from which a row counts as acted upon. Chosen by hand, not measured: lower
/// takes in rows of noise for the ends of a departure, higher leaves out those of light work.
const ACTING: f64 = 0.05;
/// Where the knots of a departure lie among the rows that are acted upon: its ends are not those of single rows.
const KNOTS: [f64; 3] = [0.03, 0.5, 0.97];
/// Departures of one model, at most: three channels are as many as a recording of an hour varies on their own.
const DEPARTURES_MAX: usize = 3;
/// Share by which the squares of rows left out must fall for a departure: chance moves them by less than a thousandth where a
/// thousand rows are compared.
const DEPARTURE_GAIN: f64 = 2e-3;

impl EvidenceReport<'_, '_> {
    /// The best fit of these laws beside the baseline; each is given as it comes nearest to the curve that was found.
    pub(super) fn fit_named_laws(&mut self, near: &[(String, Part)]) -> Option<Fit> {
        let search = self.prepare_starts();
        let first = self.fit_from_starts(near, &search)?;
        let best = self.mend_by_subsets(near, first);
        let wider = self.add_departures(best);
        let settled = self.settle_parameters(wider);
        Some(self.replace_open_forms(near, &search, settled))
    }

    /// Of the fits from the nearest laws and from the output the one that leaves least of rows left out.
    fn fit_from_starts(&mut self, near: &[(String, Part)], search: &StartSearch) -> Option<Fit> {
        let mut all = Vec::new();
        for (name, part) in near {
            let columns = || part.compute_columns(&self.case.scene).unwrap_or_default();
            let latent = || columns().into_iter().map(|(_, column)| column).collect::<Vec<_>>();
            let own = if is_latent(part) {
                vec![self.build_start(part.clone(), &latent(), search)]
            } else {
                self.list_law_starts(name, search)
            };
            all.push(own);
        }
        let mut starts: Vec<Vec<Part>> = vec![near.iter().map(|(_, part)| part.clone()).collect()];
        if !near.is_empty() && all.iter().all(|own| !own.is_empty()) {
            starts.extend(search.list_start_sets(&all));
        }
        let mut best: Option<(f64, Fit)> = None;
        for start in starts {
            let parts: Vec<Part> = self.baseline.parts.iter().cloned().chain(start).collect();
            let Some(fit) = self.refit_parts(&parts) else { continue };
            let left = self.prepare_left_out(&fit).compute_square();
            if best.as_ref().is_none_or(|(known, _)| left < *known) {
                best = Some((left, fit));
            }
        }
        best.map(|(_, fit)| fit)
    }

    /// More laws never fit worse than fewer: where they do, the fit is stuck, and goes on from the fewer.
    fn mend_by_subsets(&mut self, near: &[(String, Part)], fit: Fit) -> Fit {
        let first = self.baseline.parts.len();
        let mut best = fit;
        for gone in 0..near.len() {
            if near.len() < 2 {
                break;
            }
            let Some(fewer) = self.fit_without(&best, first + gone) else { continue };
            if self.sum_left_squares(&fewer) < self.sum_left_squares(&best) {
                let mut parts = fewer.parts;
                parts.insert(first + gone, near[gone].1.clone());
                let again = self.refit_parts(&parts);
                best =
                    again.filter(|again| self.sum_left_squares(again) < self.sum_left_squares(&best)).unwrap_or(best);
            }
        }
        best
    }

    /// The others refitted without one part.
    pub(super) fn fit_without(&mut self, fit: &Fit, gone: usize) -> Option<Fit> {
        let mut parts = fit.parts.clone();
        parts.remove(gone);
        self.refit_parts(&parts)
    }

    /// What a fit leaves of the fitted rows, in the metric of the noise.
    pub(super) fn sum_left_squares(&self, fit: &Fit) -> f64 {
        let rest: Vec<f64> = self.recorded.iter().zip(&fit.simulated).map(|(y, f)| y - f).collect();
        let left = self.whiten(&rest);
        dot(&left, &left)
    }

    /// The laws with the departures that carry over to rows left out, the best first.
    fn add_departures(&mut self, fit: Fit) -> Fit {
        let mut best = fit;
        for _ in 0..DEPARTURES_MAX {
            // The scene holds load and output of whatever was fitted last.
            if simulate_parts(&best.parts, &mut self.case.scene).is_none() {
                break;
            }
            let Some((place, departure)) = self.find_best_departure(&best) else { break };
            let before = self.prepare_left_out(&best).compute_square();
            let mut parts = best.parts.clone();
            let part = &mut parts[place];
            let values = vec![0.0; departure.x.len()];
            part.parameters.extend(departure.build_parameters(part.departures.len(), &values, Some(values.len() / 2)));
            part.departures.push(departure);
            let Some(wider) = self.refit_parts(&parts) else { break };
            if self.prepare_left_out(&wider).compute_square() > (1.0 - DEPARTURE_GAIN) * before {
                break;
            }
            best = wider;
        }
        best
    }

    /// The departure of a law whose first step leaves least of rows left out.
    fn find_best_departure(&self, fit: &Fit) -> Option<(usize, Departure)> {
        let mut left_out = self.prepare_left_out(fit);
        let fixed = left_out.count_columns();
        let mut best = ((1.0 - DEPARTURE_GAIN) * left_out.compute_square(), None);
        for place in self.baseline.parts.len()..fit.parts.len() {
            let part = &fit.parts[place];
            // A state and what a meter does to the whole output know nothing of the cut.
            let may_depart = part.effect_and_form().is_none_or(|(effect, _)| effect.may_depart());
            let departs = may_depart && !is_latent(part) && !part.acts_on_output();
            let Some(own) = part.compute_contribution(&self.case.scene).filter(|_| departs) else { continue };
            for departure in self.list_departures(part, &own) {
                let last = departure.x.len() - 1;
                for knot in [0, last] {
                    let column = self.compute_knot_column(&departure, knot, &own);
                    left_out.add_column(self.whiten(&column), Some(DEPARTURE_USUAL));
                }
                let square = left_out.compute_square();
                if square < best.0 {
                    best = (square, Some((place, departure)));
                }
                left_out.truncate_columns(fixed);
            }
        }
        best.1
    }

    /// What the law changes with the value at one knot.
    fn compute_knot_column(&self, departure: &Departure, knot: usize, own: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; departure.x.len()];
        y[knot] = 1.0;
        let values = read_channel_values(&self.case.scene, &departure.over);
        let factor = |row: usize| values.as_ref().map_or(0.0, |values| departure.interpolate(&y, values[row]));
        own.iter().enumerate().map(|(row, x)| x * factor(row)).collect()
    }

    /// Departures that a part does not have yet: over every channel that changes where it acts.
    fn list_departures(&self, part: &Part, own: &[f64]) -> Vec<Departure> {
        let scene = &self.case.scene;
        let top = self.inputs.fitted_rows(false).map(|row| own[row].abs()).fold(0.0, f64::max);
        let rows: Vec<usize> = self.inputs.fitted_rows(false).filter(|row| own[*row].abs() > ACTING * top).collect();
        let role = |role: Role| scene.role_name(role).map(str::to_owned);
        let motion = role(Role::Speed).or_else(|| role(Role::Velocity));
        let columns = ["depth_of_cut_mm", "feed_per_rev_mm", "width_of_cut_mm", SIMULATED_CUT, TIME].map(str::to_owned);
        let over = columns.into_iter().chain(motion).chain(role(Role::Temperature)).chain(role(Role::Position));
        let build = |over: String| {
            if part.departures.iter().any(|known| known.over == over) {
                return None;
            }
            let values = read_channel_values(scene, &over)?;
            let x: Vec<f64> =
                KNOTS.iter().filter_map(|share| quantile(rows.iter().map(|row| values[*row]), *share)).collect();
            let (low, high) = (*x.first()?, *x.last()?);
            let rises =
                x.windows(2).all(|pair| pair[1] - pair[0] > 0.02 * (high - low)) && high - low > 1e-6 * high.abs();
            // Two levels have no middle.
            let x = if rises {
                x
            } else if high - low > 1e-6 * high.abs() {
                vec![low, 0.5 * (low + high), high]
            } else {
                return None;
            };
            Some(Departure { over, x })
        };
        over.filter_map(build).collect()
    }
}
