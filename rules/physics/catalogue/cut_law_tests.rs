//! Laws of the cut that differ between lots.

use super::find_effect;
use super::law_tests::forms;
use super::tests::{scene, set, set_words};
use recording::Recording;

#[test]
fn a_lot_that_no_form_names_is_cut_like_the_others_in_the_mean() {
    let mut recording = Recording::new("lots", (0..40).map(f64::from).collect(), None);
    set(&mut recording, "engaged", |_| 1.0);
    set(&mut recording, "spindle_power_w", |_| 1.0);
    set_words(&mut recording, "lot", |row| format!("L{}", 1 + row / 10));
    let mut scene = scene(&recording, "spindle_power_w");
    scene.set_load(Some(vec![300.0; 40]));
    let lots = forms("hardness_batch", &scene).into_iter().find(|form| form.name == "lots").expect("four lots");
    let met = crate::keep_met_units(lots, |lot| lot != "L4");
    assert_eq!(met.place, Some(("lot".to_owned(), "L1, L2, L3".to_owned())));
    let columns = find_effect("hardness_batch").expect("known").compute_columns(&scene, &met).expect("columns");
    let at = |row: usize| columns.iter().map(|(name, column)| (*name, column[row])).collect::<Vec<_>>();
    assert_eq!(at(5), [("gain_2", 0.0), ("gain_3", 0.0)], "the first lot is the reference");
    assert_eq!(at(15), [("gain_2", 300.0), ("gain_3", 0.0)]);
    assert_eq!(at(35), [("gain_2", 100.0), ("gain_3", 100.0)], "nobody has measured it");
}
