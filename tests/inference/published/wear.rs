//! Tool wear from cutting power (patent, lathe CHK460): response surface, coding, sensitivity, adjusted R2.

use crate::published::Row;
use rules::estimators::wear::{
    Array, Coding, Cut, CutConditions, SurfaceOptions, WearModel, build_published_surface, estimate_wear, fit_surface,
    published_over,
};

const SOURCE: &str = "004";

/// Powers of the cube, W: a slowest, d fastest, each -1, 0, 1.
const CUBE: [f64; 81] = [
    319.77, 472.89, 626.01, 553.72, 754.12, 954.52, 787.67, 1035.35, 1283.03, //
    455.64, 670.90, 886.16, 689.59, 952.13, 1214.67, 923.54, 1233.36, 1543.18, //
    591.51, 868.91, 1146.31, 825.46, 1150.14, 1474.82, 1059.41, 1431.37, 1803.33, //
    401.12, 554.24, 707.36, 600.20, 800.60, 1001.00, 799.28, 1046.96, 1294.64, //
    574.01, 789.27, 1004.53, 773.09, 1035.63, 1298.17, 972.17, 1281.99, 1591.81, //
    746.90, 1024.30, 1301.70, 945.98, 1270.66, 1595.34, 1145.06, 1517.02, 1888.98, //
    482.47, 635.59, 788.71, 646.68, 847.08, 1047.48, 810.89, 1058.57, 1306.25, //
    692.38, 907.64, 1122.90, 856.59, 1119.13, 1381.67, 1020.80, 1330.62, 1640.44, //
    902.29, 1179.69, 1457.09, 1066.50, 1391.18, 1715.86, 1230.71, 1602.67, 1974.63,
];

/// Powers at VB = 0.3 mm (a = 0.8077), W: b slowest, d fastest. Eight of them are corners.
const WORN: [f64; 27] = [
    466.83, 619.95, 773.07, 637.74, 838.14, 1038.54, 808.66, 1056.34, 1304.02, //
    669.62, 884.88, 1100.14, 840.53, 1103.07, 1365.61, 1011.45, 1321.27, 1631.09, //
    872.41, 1149.81, 1427.21, 1043.32, 1368.00, 1692.68, 1214.24, 1586.20, 1958.16,
];

pub(crate) fn rows() -> Vec<Row> {
    let mut rows = surface();
    rows.extend(sensitivities());
    rows.extend(fitted());
    rows.extend(inverse());
    rows.extend(misprints());
    rows
}

/// -1, 0 or 1 of a digit of a number written in threes.
fn side(index: usize, digit: u32) -> f64 {
    (index / 3_usize.pow(digit) % 3) as f64 - 1.0
}

fn corner(index: usize) -> bool {
    (0..3).all(|digit| side(index, digit) != 0.0)
}

fn surface() -> Vec<Row> {
    let surface = build_published_surface();
    let at = |a: f64, b: f64, c: f64, d: f64| surface.power_at(&[a, b, c, d]);
    let worn = (0.3 - surface.coding.centre[0]) / surface.coding.half[0];
    let cube = |index: usize| at(side(index, 3), side(index, 2), side(index, 1), side(index, 0)) - CUBE[index];
    let top = |index: usize| at(worn, side(index, 2), side(index, 1), side(index, 0)) - WORN[index];
    let greatest =
        |differences: &mut dyn Iterator<Item = f64>| differences.fold(0.0_f64, |most, it| most.max(it.abs()));
    let summary = |what: &str, difference: f64| Row::new(what, 0.0, difference, 0.005_000_1, SOURCE);
    let key = |what: &str, published: f64, ours: f64| Row::new(what, published, ours, 0.006, SOURCE);
    vec![
        summary("surface: 81 powers of the cube, greatest difference, W", greatest(&mut (0..81).map(cube))),
        summary(
            "surface: 8 corners at VB 0.3 mm, greatest difference, W",
            greatest(&mut (0..27).filter(|index| corner(*index)).map(top)),
        ),
        summary(
            "surface: 19 others at VB 0.3 mm, greatest difference, W",
            greatest(&mut (0..27).filter(|index| !corner(*index)).map(top)),
        ),
        Row::new("surface: coded a of VB 0.3 mm", 0.807_692, worn, 1e-6, SOURCE),
        key("surface: P(0,0,0,0), W", 1035.63, at(0.0, 0.0, 0.0, 0.0)),
        key("surface: P(1,1,1,1), greatest of the cube, W", 1974.63, at(1.0, 1.0, 1.0, 1.0)),
        key("surface: P(-1,-1,-1,-1), least of the cube, W", 319.77, at(-1.0, -1.0, -1.0, -1.0)),
        key("surface: P(0.8077,1,1,1), W", 1958.16, at(worn, 1.0, 1.0, 1.0)),
        key("surface: P(0.8077,1,0,1), W", 1692.68, at(worn, 1.0, 0.0, 1.0)),
        key("surface: P(0.8077,0,1,1), W", 1631.09, at(worn, 0.0, 1.0, 1.0)),
    ]
}

fn sensitivities() -> Vec<Row> {
    let surface = build_published_surface();
    [(0.0, 0.0, 642.0), (1.0, 1.0, 659.0), (1.0, 0.0, 927.0), (1.0, -1.0, 1195.0), (-1.0, 1.0, 89.0)]
        .map(|(b, c, expected)| {
            let slope = surface.wear_slope_w_per_mm(&surface.coding.decode_conditions([0.0, b, c, 0.0]));
            Row::new(format!("sensitivity dP/dVB at b = {b}, c = {c}, W/mm"), expected, slope, 0.6, SOURCE)
        })
        .into()
}

/// A coding with a middle and a half range that a lathe has; the patent's own is lost.
fn coding() -> Coding {
    Coding { centre: [0.195, 120.0, 0.15, 1.0], half: [0.13, 30.0, 0.05, 0.25] }
}

/// The surface at the design's points with scatter that no second-order term explains, scaled to the printed R2.
fn cuts(r2: f64) -> Vec<Cut> {
    let surface = published_over(coding());
    let exact = |noise: f64| -> Vec<Cut> {
        let runs = Array::L27.list_runs();
        let each = runs.iter().enumerate().map(|(index, run)| {
            let conditions =
                coding().decode_conditions([run[0], run[1], run[4], run[8]].map(|level| f64::from(level) - 1.0));
            let scatter = noise * (7.3 * index as f64).sin();
            Cut { conditions, cutting_power_w: surface.predict_power(&conditions).power_w + scatter }
        });
        each.collect()
    };
    let all = fit_surface(&exact(30.0), &SurfaceOptions { p_out: 1.0, ..SurfaceOptions::default() }).expect("a fit");
    let (mut cuts, scatter) = (exact(0.0), all.regression.residuals);
    let mean = cuts.iter().map(|cut| cut.cutting_power_w).sum::<f64>() / 27.0;
    let explained: f64 = cuts.iter().map(|cut| (cut.cutting_power_w - mean).powi(2)).sum();
    let scale = (explained * (1.0 - r2) / r2 / scatter.iter().map(|it| it * it).sum::<f64>()).sqrt();
    cuts.iter_mut().zip(&scatter).for_each(|(cut, it)| cut.cutting_power_w += scale * it);
    cuts
}

/// Backward elimination on cuts with the printed R2 finds the eight printed terms, and with them the printed adjusted R2.
fn fitted() -> Vec<Row> {
    let found = fit_surface(&cuts(0.9929), &SurfaceOptions::default()).expect("a fit");
    let terms = found.regression.coefficients.len() - 1;
    let coefficient = |name: &str, expected: f64| {
        let ours = found.regression.find_value(name).unwrap_or(0.0);
        Row::new(format!("refitted coefficient of {name}, W"), expected, ours, 1e-6, SOURCE)
    };
    vec![
        Row::new("terms that backward elimination keeps of 14", 8.0, terms as f64, 0.0, SOURCE),
        Row::new("adjusted R2 of R2 99.29 %, 27 runs, %", 98.98, 100.0 * found.anova.adjusted_r2, 0.01, SOURCE),
        Row::new("residual s of the same (columns 1, 2, 5, 9), W", 37.6, found.regression.residual_sd, 0.1, SOURCE),
        coefficient("VB", 83.5),
        coefficient("VB*vc", 37.02),
        coefficient("VB*f", -34.87),
        coefficient("f*ap", 47.28),
    ]
}

fn inverse() -> Vec<Row> {
    let surface = published_over(coding());
    let model = WearModel::Surface(surface.clone());
    let middle = CutConditions::from_vector([0.0, 120.0, 0.15, 1.0]);
    let power_w = surface.predict_power(&middle.with_wear(0.276)).power_w;
    let found = estimate_wear(&model, &middle, (power_w, 0.0), 0.3).expect("a wear");
    let slope = surface.wear_slope_w_per_mm(&middle);
    vec![
        Row::new("wear of the measured edge by inversion, mm", 0.276, found.flank_wear_mm, 1e-9, SOURCE),
        Row::new(
            "criterion above the measured wear, %",
            8.70,
            100.0 * (0.3 / found.flank_wear_mm - 1.0),
            0.005,
            SOURCE,
        ),
        Row::new("one residual s as wear at the middle, mm", 0.058, surface.residual_sd_w / slope, 0.001, SOURCE),
    ]
}

fn misprints() -> Vec<Row> {
    let surface = build_published_surface();
    let worn = [0.807_692, 1.0, 1.0, 1.0];
    vec![
        Row::misprint(
            "[Pc] at phi 60, W",
            1996.0,
            surface.power_at(&worn),
            SOURCE,
            "beyond the greatest of the whole cube at VB 0.3 mm: outside the design, or a coefficient is misprinted",
        ),
        Row::misprint(
            "[Pc] at phi 42, W",
            1674.0,
            surface.power_at(&[0.807_692, 1.0, 0.0, 1.0]),
            SOURCE,
            "no combination of levels gives it; the nearest is shown",
        ),
    ]
}
