use super::*;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

fn column(name: &str, values: &[f64]) -> Column {
    Column::new(name, values.to_vec())
}

/// NIST Statistical Reference Datasets, Norris: a straight line of 36 rows (y, x), certified to 15 digits.
const NORRIS: [(f64, f64); 36] = [
    (0.1, 0.2),
    (338.8, 337.4),
    (118.1, 118.2),
    (888.0, 884.6),
    (9.2, 10.1),
    (228.1, 226.5),
    (668.5, 666.3),
    (998.5, 996.3),
    (449.1, 448.6),
    (778.9, 777.0),
    (559.2, 558.2),
    (0.3, 0.4),
    (0.1, 0.6),
    (778.1, 775.5),
    (668.8, 666.9),
    (339.3, 338.0),
    (448.9, 447.5),
    (10.8, 11.6),
    (557.7, 556.0),
    (228.3, 228.1),
    (998.0, 995.8),
    (888.8, 887.6),
    (119.6, 120.2),
    (0.3, 0.3),
    (0.6, 0.3),
    (557.6, 556.8),
    (339.3, 339.1),
    (888.0, 887.2),
    (998.5, 999.0),
    (778.9, 779.0),
    (10.2, 11.1),
    (117.6, 118.3),
    (228.9, 229.2),
    (668.4, 669.1),
    (449.2, 448.9),
    (0.2, 0.5),
];

#[test]
fn a_certified_line_is_reproduced() {
    let x: Vec<f64> = NORRIS.iter().map(|row| row.1).collect();
    let y: Vec<f64> = NORRIS.iter().map(|row| row.0).collect();
    let fit = fit_unweighted(&column("y", &y), &[column("x", &x)], Intercept::Fitted).expect("a line");
    let close = |is: f64, should: f64| assert!((is / should - 1.0).abs() < 1e-10, "{is} {should}");
    close(fit.coefficients[0].value, -0.262_323_073_774_029);
    close(fit.coefficients[1].value, 1.002_116_818_020_45);
    close(fit.coefficients[0].standard_error, 0.232_818_234_301_152);
    close(fit.coefficients[1].standard_error, 0.429_796_848_199_937e-3);
    close(fit.residual_sd, 0.884_796_396_144_373);
    close(fit.r2, 0.999_993_745_883_712);
    close(fit.rss, 26.617_398_529_422_4);
    assert!((fit.coefficients[1].variance_inflation.expect("a slope") - 1.0).abs() < 1e-10);
    assert!((fit.leverage.iter().sum::<f64>() - 2.0).abs() < 1e-12);
}

/// NIST, Longley: seven badly conditioned columns.
#[rustfmt::skip]
const LONGLEY: [[f64; 7]; 16] = [
    [60323.0, 83.0, 234289.0, 2356.0, 1590.0, 107608.0, 1947.0],
    [61122.0, 88.5, 259426.0, 2325.0, 1456.0, 108632.0, 1948.0],
    [60171.0, 88.2, 258054.0, 3682.0, 1616.0, 109773.0, 1949.0],
    [61187.0, 89.5, 284599.0, 3351.0, 1650.0, 110929.0, 1950.0],
    [63221.0, 96.2, 328975.0, 2099.0, 3099.0, 112075.0, 1951.0],
    [63639.0, 98.1, 346999.0, 1932.0, 3594.0, 113270.0, 1952.0],
    [64989.0, 99.0, 365385.0, 1870.0, 3547.0, 115094.0, 1953.0],
    [63761.0, 100.0, 363112.0, 3578.0, 3350.0, 116219.0, 1954.0],
    [66019.0, 101.2, 397469.0, 2904.0, 3048.0, 117388.0, 1955.0],
    [67857.0, 104.6, 419180.0, 2822.0, 2857.0, 118734.0, 1956.0],
    [68169.0, 108.4, 442769.0, 2936.0, 2798.0, 120445.0, 1957.0],
    [66513.0, 110.8, 444546.0, 4681.0, 2637.0, 121950.0, 1958.0],
    [68655.0, 112.6, 482704.0, 3813.0, 2552.0, 123366.0, 1959.0],
    [69564.0, 114.2, 502601.0, 3931.0, 2514.0, 125368.0, 1960.0],
    [69331.0, 115.7, 518173.0, 4806.0, 2572.0, 127852.0, 1961.0],
    [70551.0, 116.9, 554894.0, 4007.0, 2827.0, 130081.0, 1962.0],
];

#[test]
fn a_certified_badly_conditioned_fit_is_reproduced() {
    let at = |k: usize| LONGLEY.iter().map(|row| row[k]).collect::<Vec<f64>>();
    let columns: Vec<Column> = (1..7).map(|k| Column::new(format!("x{k}"), at(k))).collect();
    let fit = fit_unweighted(&Column::new("y", at(0)), &columns, Intercept::Fitted).expect("full rank");
    let certified = [
        (-3_482_258.634_595_82, 890_420.383_607_373),
        (15.061_872_271_373_3, 84.914_925_774_766_9),
        (-0.358_191_792_925_910E-01, 0.334_910_077_722_432E-01),
        (-2.020_229_803_816_83, 0.488_399_681_651_699),
        (-1.033_226_867_173_59, 0.214_274_163_161_675),
        (-0.511_041_056_535_807E-01, 0.226_073_200_069_370),
        (1_829.151_464_613_55, 455.478_499_142_212),
    ];
    for (coefficient, (value, error)) in fit.coefficients.iter().zip(certified) {
        assert!((coefficient.value / value - 1.0).abs() < 1e-8, "{coefficient:?}");
        assert!((coefficient.standard_error / error - 1.0).abs() < 1e-8, "{coefficient:?}");
    }
    assert!((fit.residual_sd / 304.854_073_561_965 - 1.0).abs() < 1e-9);
    assert!(fit.condition_number > 1e4 && fit.coefficients[2].variance_inflation.expect("x2") > 1000.0);
}

#[test]
fn leaving_a_row_out_is_what_press_says() {
    let x: Vec<f64> = (0..8).map(f64::from).collect();
    let y: Vec<f64> = x.iter().map(|x| 3.0 + x + (x * 2.7).sin()).collect();
    let whole = fit_unweighted(&column("y", &y), &[column("x", &x)], Intercept::Fitted).expect("a line");
    let mean = y.iter().sum::<f64>() / 8.0;
    let total: f64 = y.iter().map(|y| (y - mean).powi(2)).sum();
    let mut lost = 0.0;
    for out in 0..8 {
        let keep = |values: &[f64]| values.iter().enumerate().filter(|(i, _)| *i != out).map(|(_, v)| *v).collect();
        let part = fit_unweighted(&Column::new("y", keep(&y)), &[Column::new("x", keep(&x))], Intercept::Fitted)
            .expect("a line");
        lost += (y[out] - part.predict_value(&[x[out]]).expect("a point").value).powi(2);
    }
    assert!((whole.predicted_r2.expect("no lone row") - (1.0 - lost / total)).abs() < 1e-12);
}

#[test]
fn a_refusal_names_the_column_and_what_is_needed() {
    let x = [1.0, 2.0, 3.0, 4.0, 5.0];
    let y = column("power_w", &[2.0, 4.1, 5.9, 8.2, 9.9]);
    let told = |columns: &[Column]| fit_unweighted(&y, columns, Intercept::Fitted).expect_err("refused");
    let constant = told(&[column("speed_rpm", &[800.0; 5])]);
    assert_eq!((constant.kind, constant.place.as_str()), (RefusalKind::Constant, "speed_rpm"));
    let twice = told(&[column("a_w", &x), column("b_w", &x.map(|x| 2.0 * x))]);
    assert_eq!(twice.kind, RefusalKind::Collinear);
    assert!(twice.what.contains("a_w, b_w"), "{twice}");
    let sum = told(&[column("a_w", &x), column("b_w", &x.map(|x| x * x)), column("c_w", &x.map(|x| x + x * x))]);
    assert!(sum.what.contains("a_w, b_w, c_w"), "{sum}");
    let nan = told(&[column("a_w", &[1.0, f64::NAN, 3.0, 4.0, 5.0])]);
    assert_eq!((nan.kind, nan.what.as_str()), (RefusalKind::NotFinite, "no number in row 2"));
    let short = told(&[column("a_w", &x[..4])]);
    assert_eq!(short.kind, RefusalKind::Mismatch);
    let few =
        fit_unweighted(&column("y", &[1.0, 2.0]), &[column("x", &[1.0, 2.0])], Intercept::Fitted).expect_err("few");
    assert_eq!(few.kind, RefusalKind::TooFew);
    assert!(fit_weighted(&y, &[column("x", &x)], Intercept::Fitted, &[1.0, 1.0, 0.0, 1.0, 1.0]).is_err());
}

#[test]
fn stated_intervals_cover_as_often_as_they_say() {
    let mut dice = Pcg64Mcg::seed_from_u64(7);
    let x: Vec<f64> = (0..12).map(|i| f64::from(i) / 3.0).collect();
    let runs = 4000;
    let mut inside = [0, 0];
    for _ in 0..runs {
        let noisy = |x: &f64| -> f64 {
            2.0 - 0.5 * x + 0.3 * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut dice)
        };
        let y: Vec<f64> = x.iter().map(noisy).collect();
        let fit = fit_unweighted(&column("y", &y), &[column("x", &x)], Intercept::Fitted).expect("a line");
        for (at, truth) in [(0, 2.0), (1, -0.5)] {
            let (low, high) = fit.coefficients[at].interval;
            inside[at] += usize::from(low <= truth && truth <= high);
        }
    }
    for covered in inside {
        let share = count_to_f64(covered) / count_to_f64(runs);
        assert!((share - 0.95).abs() < 0.012, "{share}");
    }
}

#[test]
fn weights_count_rows_as_if_they_were_repeated() {
    let (x, y) = ([1.0, 2.0, 3.0, 4.0], [1.0, 2.5, 2.9, 4.4]);
    let weighted = fit_weighted(&column("y", &y), &[column("x", &x)], Intercept::Fitted, &[1.0, 2.0, 1.0, 1.0]);
    let repeated = fit_unweighted(
        &column("y", &[1.0, 2.5, 2.5, 2.9, 4.4]),
        &[column("x", &[1.0, 2.0, 2.0, 3.0, 4.0])],
        Intercept::Fitted,
    );
    let (weighted, repeated) = (weighted.expect("a line"), repeated.expect("a line"));
    for (a, b) in weighted.values().iter().zip(repeated.values()) {
        assert!((a - b).abs() < 1e-12);
    }
    assert!((weighted.residuals[3] - repeated.residuals[4]).abs() < 1e-12, "in the unit of y");
}
