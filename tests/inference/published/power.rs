//! Power separation on a lathe (CJK6136): no-load power over speed, cutting power and load loss.

use crate::published::Row;
use rules::estimators::{lagrange_weights, noise_gain, solve_power_balance};
use testkit::weights::WEIGHTS;

const SOURCE: &str = "000";

pub(crate) fn rows() -> Vec<Row> {
    let mut rows = balances();
    for (speed, speeds, weights, gain) in WEIGHTS {
        let ours = lagrange_weights(speeds, speed);
        for (at, (published, ours)) in weights.into_iter().zip(ours).enumerate() {
            let quantity = format!("Lagrange weight of {} rpm at {speed} rpm", speeds[at]);
            rows.push(Row::new(quantity, published, ours, 1e-6, SOURCE));
        }
        rows.push(Row::new(format!("noise gain at {speed} rpm"), gain, noise_gain(&ours), 6e-5, SOURCE));
    }
    rows
}

fn balances() -> Vec<Row> {
    let split = |excess_w: f64, a0: f64, a1: f64| solve_power_balance(excess_w, a0, a1).expect("a real root");
    let cut = |excess_w, a0| split(excess_w, a0, 0.0).cutting_power_w;
    let (fitted, exact) = (split(960.0, 0.1807, 4e-5), split(960.0, 0.1807, 3.377e-5));
    let garbled = "printed 'Pad=4*10-5+1.807Pc' gives a loss above the input power; 0.1807 Pc + 4e-5 Pc^2 fits";
    let not_from_formula = "960 W / 1.25 is 768 W, 955 W / 1.25 is 764 W";
    let sign = "830 W is 955 W / 1.15 (no-load power as measured), not 960 W / 1.15";
    vec![
        Row::new("Pc, W, of Pi 1460 Pu 500 a0 0.1807 a1 4e-5", 791.84, fitted.cutting_power_w, 0.005, "000, formula 7"),
        Row::new("Pad, W, of the same", 168.16, fitted.load_loss_w, 0.005, "000, formula 2"),
        Row::new("Pc, W, as printed", 795.0, fitted.cutting_power_w, 795.0 * 0.005, "000, test group"),
        Row::new("Pad, W, as printed", 165.0, fitted.load_loss_w, 3.975, "000, test group"),
        Row::new("Pc, W, with a1 before rounding, 3.377e-5", 795.0, exact.cutting_power_w, 0.05, "000, test group"),
        Row::new("Pc, W, constant 0.15 on Pu 500", 834.8, cut(960.0, 0.15), 0.05, "000, recomputed"),
        Row::new("Pc, W, constant 0.15 on Pu 505", 830.4, cut(955.0, 0.15), 0.05, "000, recomputed"),
        Row::new("Pc, W, constant 0.25 on Pu 500", 768.0, cut(960.0, 0.25), 0.05, "000, recomputed"),
        Row::new("Pc, W, constant 0.25 on Pu 505", 764.0, cut(955.0, 0.25), 0.05, "000, recomputed"),
        Row::misprint("Pc, W, constant 0.15, as printed", 830.0, cut(960.0, 0.15), "000, text", sign),
        Row::misprint("Pc, W, constant 0.25, as printed", 750.0, cut(960.0, 0.25), "000, text", not_from_formula),
        Row::misprint("a0 as printed", 1.807, 0.1807, "000, text", garbled),
        Row::new("Pu measured over interpolated, %", 0.99, 100.0 * (1.0 - 500.0 / 505.0), 0.005, "000, test group"),
    ]
}
