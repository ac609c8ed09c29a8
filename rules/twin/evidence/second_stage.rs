//! The second stage: the leading variants with their form widened, and hidden sequences beside them.
//!
//! A law of a textbook is never quite the law of a machine. So each leading named variant gets departures `law * z` and
//! `law * (z^2 - 1)` over speed, cut, depth, feed, time, velocity and temperature, all together with a small deviation.

use super::inputs::RecordingInputs;
use super::search::{NAMED, NAMELESS, SetEvidence};
use super::variant_bank::{Family, Owner, Variant, VariantBank};
use numerics::statistics::{count_to_f64, rms};
use std::collections::BTreeMap;

/// Leading sets whose members go into the second stage, single variants besides, and variants of one owner.
const SETS: usize = 14;
const SINGLES: usize = 16;
const OF_AN_OWNER: usize = 2;
/// Variants of the second stage, hidden sequences apart.
const VARIANTS_MAX: usize = 26;
/// Deviation of all departures of a form together, relative to the law.
const DEPARTURE: f64 = 0.15;
/// Deviations of a channel beyond which it departs no further.
const FARTHEST: f64 = 2.5;

/// The bank of the second stage.
pub(super) struct SecondStage {
    pub(super) bank: VariantBank,
    /// Logarithm of the prior of each variant.
    pub(super) priors: Vec<f64>,
    /// The variant of the first stage that each comes from; `None` of a hidden sequence.
    pub(super) source: Vec<Option<usize>>,
}

impl SecondStage {
    /// The leading variants of the first stage, widened.
    pub(super) fn from_first_stage(
        inputs: &RecordingInputs<'_>,
        bank: &VariantBank,
        priors: &[f64],
        found: &SetEvidence,
    ) -> Self {
        let departures = compute_departures(inputs);
        let mut second = Self { bank: VariantBank::default(), priors: Vec::new(), source: Vec::new() };
        for index in list_leading_variants(bank, found) {
            let variant = &bank.variants[index];
            let start = second.bank.columns.len();
            let mut relative = variant.relative.clone();
            second.bank.columns.extend_from_slice(&bank.columns[variant.columns.clone()]);
            if can_widen(variant) && !departures.is_empty() {
                let law = &bank.columns[variant.columns.start];
                let share = DEPARTURE / (count_to_f64(departures.len()) / 3.0).sqrt();
                for departure in &departures {
                    let bent = inputs.build_column(|row| law[row] * departure[row]);
                    let size = rms(&inputs.fitted_rows(false).map(|row| bent[row]).collect::<Vec<_>>()) + 1e-30;
                    second.bank.columns.push(bent.iter().map(|x| x / size).collect());
                    relative.push(share);
                }
            }
            let columns = start..second.bank.columns.len();
            second.bank.variants.push(Variant { columns, relative, ..variant.clone() });
            second.priors.push(priors[index]);
            second.source.push(Some(index));
        }
        second
    }

    /// Adds a variant that was read from the recording, with what it has cost to find it as prior.
    pub(super) fn add_variant(&mut self, ln: f64, make: impl FnOnce(&mut VariantBank)) {
        let before = self.bank.variants.len();
        make(&mut self.bank);
        if let Some(variant) = self.bank.variants.get(before) {
            let prior = if variant.kind().is_some() { NAMED } else { NAMELESS };
            self.priors.push(prior + variant.ln_prior + ln);
            self.source.push(None);
        }
    }
}

fn can_widen(variant: &Variant) -> bool {
    matches!(&variant.owner, Owner::Named(Family { widens: true, .. }))
}

/// The variants that lead, the best first.
fn list_leading_variants(bank: &VariantBank, found: &SetEvidence) -> Vec<usize> {
    let mut sets: Vec<(&Vec<(usize, usize)>, f64)> = found.iter().map(|(members, ln)| (members, *ln)).collect();
    sets.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut lead: BTreeMap<usize, f64> = BTreeMap::new();
    for (members, ln) in sets.iter().take(SETS) {
        for (variant, _) in *members {
            let known = lead.entry(*variant).or_insert(f64::NEG_INFINITY);
            *known = known.max(*ln);
        }
    }
    for (members, ln) in sets.iter().filter(|(members, _)| members.len() == 1).take(SINGLES) {
        lead.entry(members[0].0).or_insert(*ln);
    }
    let mut order: Vec<(usize, f64)> = lead.into_iter().collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut of_owner: BTreeMap<String, usize> = BTreeMap::new();
    order.retain(|(index, _)| {
        let variant = &bank.variants[*index];
        let owner = variant.kind().map_or_else(|| variant.label.clone(), str::to_owned);
        let seen = of_owner.entry(owner).or_default();
        *seen += 1;
        *seen <= OF_AN_OWNER
    });
    order.into_iter().take(VARIANTS_MAX).map(|(index, _)| index).collect()
}

/// What a law may depart by: each channel standardised, and its square.
fn compute_departures(inputs: &RecordingInputs<'_>) -> Vec<Vec<f64>> {
    let velocity = if inputs.speed.is_none() { inputs.velocity.as_ref() } else { None };
    let time = Some(&inputs.clock_s);
    let cut = inputs.cut.as_ref();
    let channels = [
        inputs.speed.as_ref(),
        cut,
        inputs.depth.as_ref(),
        inputs.feed.as_ref(),
        time,
        velocity,
        inputs.temperature.as_ref(),
    ];
    let mut all = Vec::new();
    for channel in channels.into_iter().flatten() {
        let (middle, spread) = (inputs.compute_mean(channel, true), inputs.compute_deviation(channel, true));
        if spread > 1e-9 {
            let z = inputs.build_column(|row| ((channel[row] - middle) / spread).clamp(-FARTHEST, FARTHEST));
            all.push(z.iter().map(|z| (z * z - 1.0) / 1.4).collect());
            all.push(z);
        }
    }
    all
}
