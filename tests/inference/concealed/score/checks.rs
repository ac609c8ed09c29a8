//! The scorer against answers whose worth is known: one that knows everything, a mute one, a wrong one.

use serde_json::json;

use crate::concealed::case::{Case, Column};
use crate::concealed::groups;
use crate::concealed::score::answer::Answer;
use crate::concealed::score::outcome::{Outcome, area};

fn case(group: &str) -> Case {
    let orders = groups::orders(5);
    let case = orders.iter().filter(|o| o.group() == group).find_map(groups::Order::build);
    case.expect("some case of the group can be built")
}

/// Runs of the recording, and those that play the held-out part.
fn runs(case: &Case) -> (Vec<String>, Vec<String>) {
    let column = case.table.columns.iter().find(|(name, _)| name == "run");
    let Some((_, Column::Text(runs))) = column else { panic!("every case has runs") };
    let mut held_out = runs.clone();
    held_out.dedup();
    (runs.clone(), held_out.into_iter().skip(3).step_by(4).collect())
}

/// An answer with the given names whose new model adds `share` of the truth to the old one.
fn answer(case: &Case, verdict: &str, names: &[&str], share: f64) -> Result<Answer, String> {
    let (runs, held_out) = runs(case);
    let missing: Vec<_> = names.iter().map(|name| json!({ "effect": name, "parameters": [] })).collect();
    let document = json!({ "schema": "diagnosis/1", "verdict": verdict, "missing": missing,
                           "fit": { "held_out_runs": held_out } });
    let mut rows = String::from("time_s,run,recorded,simulated_before,simulated_after,effect_any\n");
    for (row, clean) in case.clean.iter().enumerate() {
        let left: f64 = case.hidden.iter().map(|h| h.remainder[row]).sum();
        let whole: f64 = case.hidden.iter().map(|h| h.contribution[row]).sum();
        let (before, after) = (clean - left, clean - left * (1.0 - share));
        rows += &format!("{row},{},0,{before},{after},{}\n", runs[row], share * whole);
    }
    Answer::read(&document.to_string(), &rows, 0.1)
}

#[test]
fn an_answer_that_knows_everything_is_right() {
    let case = case("pair-rich-rho1");
    let names: Vec<&str> = case.hidden.iter().map(|h| h.name.as_str()).collect();
    let outcome = Outcome::of(&case, &answer(&case, "explained", &names, 1.0));
    assert!(outcome.right && outcome.named && outcome.in_class && outcome.extra == 0, "{outcome:?}");
    assert!(outcome.auc.is_some_and(|auc| auc > 0.999), "{outcome:?}");
    assert!(outcome.auc_orthogonal.is_some_and(|auc| auc > 0.98), "{outcome:?}");
    assert!(outcome.removed.is_some_and(|share| share > 0.999), "{outcome:?}");
}

#[test]
fn half_of_a_pair_is_not_enough() {
    let case = case("pair-rich-rho1");
    let outcome = Outcome::of(&case, &answer(&case, "explained", &[case.hidden[0].name.as_str()], 0.5));
    assert!(!outcome.right && !outcome.named);
    assert!(outcome.removed.is_some_and(|share| (share - 0.75).abs() < 1e-6), "{outcome:?}");
}

#[test]
fn a_mute_answer_is_right_only_where_nothing_is_hidden() {
    let hidden = case("single-rich-rho1");
    assert!(!Outcome::of(&hidden, &answer(&hidden, "no_mismatch", &[], 0.0)).right);
    let empty = case("nothing-ar92");
    assert!(Outcome::of(&empty, &answer(&empty, "no_mismatch", &[], 0.0)).right);
    assert!(!Outcome::of(&empty, &answer(&empty, "unexplained", &["unknown"], 0.0)).right);
}

#[test]
fn a_sure_name_for_unlisted_physics_is_wrong() {
    let case = case("unlisted-rich-rho1");
    let sure = Outcome::of(&case, &answer(&case, "explained", &["flank_wear"], 0.9));
    assert!(!sure.right && sure.certain && !sure.named);
    assert!(Outcome::of(&case, &answer(&case, "unexplained", &["unknown"], 0.9)).right);
}

#[test]
fn a_broken_document_is_a_failure() {
    let case = case("single-rich-rho1");
    let outcome = Outcome::of(&case, &Answer::read("{\"schema\":\"diagnosis/1\",\"verdict\":\"maybe\"}", "run\n", 0.1));
    assert!(outcome.broken && !outcome.right);
}

#[test]
fn area_under_the_curve() {
    let truth = [0.0, 0.1, 0.2, 0.3, 9.0];
    assert_eq!(area(&[0.0, 0.0, 0.0, 0.0, 1.0], &truth), Some(1.0));
    assert_eq!(area(&[1.0, 1.0, 1.0, 1.0, 0.0], &truth), Some(0.0));
    assert_eq!(area(&[1.0; 5], &truth), Some(0.5));
}
