//! Shifts of edges, part by part, by a law of the test: an operation that takes more or less than the model says, lots of another hardness,
//! edges that somebody changes at the criterion. What the limit says is counted with what new edges have shown and without.

use super::super::work::{EdgeWork, WorkKey, WorkReference};
use super::super::{WearFollower, WearKey, WearModel, WearRecord, build_published_surface};
use super::*;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const CRITERION_MM: f64 = 0.3;
const RISE_PER_MM: f64 = 0.6;
const LOT_PARTS: u32 = 12;
const PARTS_IN_A_ROW: u32 = 3;

/// An operation with its own edges.
#[derive(Clone)]
struct Operation {
    tool: &'static str,
    /// What it takes beside the model, as a logarithm.
    beside: f64,
    wear_mm: f64,
    rate_mm: f64,
    edge: u32,
    told: bool,
}

/// Alarms of the limit alone: below half the criterion, below four fifths of it, how far off it in sum; and edges that were told before they
/// were changed, of all that were changed.
#[derive(Debug, Default, PartialEq)]
struct Told {
    early: u32,
    below_four_fifths: u32,
    off_mm: f64,
    alarms: u32,
    announced: u32,
    changed: u32,
}

fn build_work(operation: &Operation, ratio: f64) -> EdgeWork {
    let key = WorkKey {
        reference: WorkReference::Model,
        tool: operation.tool.to_owned(),
        program: "O1".to_owned(),
        operation: String::new(),
        work_material: "C45".to_owned(),
    };
    let edge =
        if operation.edge == 1 { operation.tool.to_owned() } else { format!("{}-{}", operation.tool, operation.edge) };
    let mut work = EdgeWork::new(key, edge, CRITERION_MM);
    (work.seconds, work.path_mm, work.slide_m) = (100.0, 200.0, 300.0);
    (work.energy_j, work.expected_j) = ((1e5 * ratio, 500.0), (1e5, RISE_PER_MM * 1e5));
    work
}

/// So many parts of three operations, whose edges had this wear at the start; with what new edges show, or as if they showed nothing.
fn count(seed: u64, beside_sd: f64, start_mm: f64, parts: u32, learns: bool) -> Told {
    let mut dice = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = |sd: f64| sd * dice.sample::<f64, _>(StandardNormal);
    let rate = |normal: &mut dyn FnMut(f64) -> f64| (0.007 * (1.0 + normal(0.15))).clamp(0.004, 0.012);
    let mut operations: Vec<Operation> = ["T1", "T2", "T3"]
        .map(|tool| {
            let (beside, rate_mm) = (normal(beside_sd), rate(&mut normal));
            Operation { tool, beside, wear_mm: start_mm, rate_mm, edge: 1, told: false }
        })
        .to_vec();
    let (mut follower, mut told, mut hardness) = (WearFollower::default(), Told::default(), 0.0);
    for part in 0..parts {
        if part.is_multiple_of(LOT_PARTS) {
            hardness = normal(0.04);
        }
        let works: Vec<EdgeWork> = operations
            .iter_mut()
            .map(|it| {
                it.wear_mm += it.rate_mm;
                let level = it.beside + hardness + (1.0 + RISE_PER_MM * it.wear_mm).ln() + normal(0.006);
                build_work(it, level.exp())
            })
            .collect();
        follower.record_part(&works, 300.0 * f64::from(part));
        if !learns {
            follower.groups.iter_mut().for_each(|group| group.fresh = FreshLevels::default());
        }
        for (operation, work) in operations.iter_mut().zip(&works) {
            let above = follower.read_witnesses(&work.edge).0.unwrap_or(0);
            if above >= PARTS_IN_A_ROW && !operation.told {
                operation.told = true;
                told.alarms += 1;
                told.below_four_fifths += u32::from(operation.wear_mm < 0.8 * CRITERION_MM);
                told.off_mm += (operation.wear_mm - CRITERION_MM).abs();
                told.early += u32::from(operation.wear_mm < 0.5 * CRITERION_MM);
            }
            if operation.wear_mm > CRITERION_MM {
                told.changed += 1;
                told.announced += u32::from(operation.told);
                let rate_mm = rate(&mut normal);
                *operation = Operation { wear_mm: 0.015, rate_mm, edge: operation.edge + 1, told: false, ..*operation };
            }
        }
    }
    told
}

fn sum(beside_sd: f64, start_mm: f64, parts: u32, learns: bool) -> Told {
    let mut all = Told::default();
    for seed in 1..=20 {
        let one = count(seed, beside_sd, start_mm, parts, learns);
        all.early += one.early;
        all.below_four_fifths += one.below_four_fifths;
        all.off_mm += one.off_mm;
        all.alarms += one.alarms;
        all.announced += one.announced;
        all.changed += one.changed;
    }
    all
}

/// `cargo test -p estimators --lib limit_of_an_operation -- --nocapture`
#[test]
fn the_limit_of_an_operation_is_learned_from_two_edges() {
    for (beside_sd, start_mm) in [(0.1, 0.015), (0.1, 0.25), (0.0, 0.015)] {
        let [with, without] = [true, false].map(|learns| sum(beside_sd, start_mm, 300, learns));
        println!(
            "operations {beside_sd} off, edges of {start_mm} mm at the start: learned {with:?}; of the model {without:?}"
        );
        assert!(with.early <= without.early, "{with:?} {without:?}");
        if beside_sd == 0.0 {
            continue; // The model is right: there is nothing to learn.
        }
        let mean_mm = |told: &Told| told.off_mm / f64::from(told.alarms);
        assert!(mean_mm(&with) < 0.85 * mean_mm(&without), "{with:?} {without:?}");
        // What is told less often is what was told far too early.
        assert!(f64::from(with.announced) > 0.9 * f64::from(without.announced), "{with:?} {without:?}");
    }
}

/// Nothing is held back for edges that were worn from the start: until two were changed, the limit is that of the model.
#[test]
fn an_edge_that_was_there_at_the_start_teaches_nothing() {
    for start_mm in [0.015, 0.15, 0.25] {
        // Before the second edge of any tool is used up.
        let [with, without] = [true, false].map(|learns| sum(0.1, start_mm, 30, learns));
        assert_eq!(with, without, "{start_mm}");
    }
}

#[test]
fn two_edges_are_the_least_and_one_hard_lot_is_not_the_middle() {
    let mut fresh = FreshLevels::default();
    let mut show = |edge: u32, level: f64| {
        (1..=5).for_each(|part| fresh.add_part(edge, part, level + if part > 3 { 0.2 } else { 0.0 }));
        fresh.learned_level()
    };
    assert_eq!(show(2, 0.1), None);
    let two = show(3, 0.14).expect("two edges");
    assert!((two.value - 0.12).abs() < 1e-12 && (two.sd - 0.04 / 2.0_f64.sqrt()).abs() < 1e-12, "{two:?}");
    assert!((show(4, 0.4).expect("three").value - 0.14).abs() < 1e-12);
}

#[test]
fn another_model_begins_anew_and_the_same_one_goes_on() {
    let record = |criterion_mm: f64| {
        let origin = ("test".to_owned(), 27, 0.99);
        let model = WearModel::Surface(build_published_surface());
        Arc::new(WearRecord::new(WearKey::default(), criterion_mm, origin, model))
    };
    let mut follower = WearFollower::default();
    let mut operation = Operation { tool: "T1", beside: 0.1, wear_mm: 0.0, rate_mm: 0.0, edge: 1, told: false };
    let mut known = 0;
    follower.keep_levels_of(&[record(0.3)], &mut known);
    for edge in 1..=3 {
        operation.edge = edge;
        (0..6).for_each(|_| drop(follower.record_part(&[build_work(&operation, 1.1)], 300.0)));
    }
    let key = build_work(&operation, 1.1).key;
    let text = serde_json::to_string(&follower).expect("JSON");
    let mut follower: WearFollower = serde_json::from_str(&text).expect("JSON");
    follower.keep_levels_of(&[record(0.3)], &mut known);
    let level = follower.learned_level(&key).expect("two new edges").value;
    assert!((level - 1.1_f64.ln()).abs() < 0.02, "{level}");
    follower.keep_levels_of(&[record(0.25)], &mut known);
    assert_eq!(follower.learned_level(&key), None);
}
