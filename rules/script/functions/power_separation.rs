//! Power separation: no-load power at a speed, cutting power and load loss.

use super::{Arguments, Method, MethodParameter, MethodResult, Subject, define_parameter};
use estimators::regression::{Refusal, RefusalKind};
use estimators::{
    EXTRAPOLATION_GAIN_MAX, LoadLossLaw, SpeedWeights, noise_gain, solve_power_balance, weigh_known_speeds,
};

pub(super) static SUBJECT: Subject = Subject { en: "Power separation", zh: "功率分离", methods: METHODS };

const BALANCE: &[MethodParameter] = &[
    define_parameter("spindle_power_w", "W"),
    define_parameter("no_load_power_w", "W"),
    define_parameter("load_loss_linear", "1"),
    define_parameter("load_loss_quadratic_per_w", "1/W"),
];

/// `identify no-load --out` writes such pairs.
const TABLE: MethodParameter = define_parameter("no_load_table", "[[rpm, W]]");

static METHODS: &[Method] = &[
    Method {
        name: "interpolated_no_load_power_w",
        parameters: &[TABLE, define_parameter("speed_rpm", "rpm")],
        returns: "W",
        en: "No-load power at a speed, by the parabola through three known speeds of one gear stage that hold it, or the straight line where that would amplify noise; the law of no_load_power_w; no value where extrapolation amplifies noise more than three times",
        zh: "由相邻已知转速插值空载功率（与 no_load_power_w 同一定律）",
        run: |given| {
            let (powers_w, weights) = read_interpolation(given)?;
            Ok(MethodResult::Number(weights.iter().zip(powers_w).map(|(weight, power_w)| weight * power_w).sum()))
        },
    },
    Method {
        name: "no_load_noise_gain",
        parameters: &[TABLE, define_parameter("speed_rpm", "rpm")],
        returns: "1",
        en: "By how much that interpolation amplifies the noise of the known powers; 1 at a known speed",
        zh: "插值的噪声放大倍数",
        run: |given| read_interpolation(given).map(|(_, weights)| MethodResult::Number(noise_gain(&weights))),
    },
    Method {
        name: "separated_cutting_power_w",
        parameters: BALANCE,
        returns: "W",
        en: "Cutting power Pc of Pi = Pu + (1 + a0) Pc + a1 Pc^2; negative below no-load power; no value where no cutting power gives this power",
        zh: "由总功率、空载功率和附加载荷损耗系数求切削功率",
        run: |given| split_excess_power(given).map(|split| MethodResult::Number(split.cutting_power_w)),
    },
    Method {
        name: "separated_load_loss_w",
        parameters: BALANCE,
        returns: "W",
        en: "Additional load loss Pad = a0 Pc + a1 Pc^2 that belongs to this cutting power",
        zh: "附加载荷损耗功率",
        run: |given| split_excess_power(given).map(|split| MethodResult::Number(split.load_loss_w)),
    },
    Method {
        name: "load_loss_quadratic_at_per_w",
        parameters: &[
            define_parameter("load_loss_quadratic_per_w", "1/W"),
            define_parameter("load_loss_speed_rpm", "rpm"),
            define_parameter("speed_rpm", "rpm"),
        ],
        returns: "1/W",
        en: "Coefficient a1 at a spindle speed where it was learned at another and goes with 1/n^2; a learned speed of 0: the same at every speed",
        zh: "由标定转速换算到当前转速的载荷损耗二次系数 a1",
        run: |given| {
            let loss = LoadLossLaw::from_stated_speed(0.0, given.number(0), given.number(1));
            Ok(MethodResult::Number(loss.quadratic_at(given.number(2))))
        },
    },
];

/// Powers of the speeds that are used, and their weights.
fn read_interpolation(given: &Arguments<'_>) -> Result<([f64; 3], [f64; 3]), Refusal> {
    let mut table = given.rows_of::<2>(0)?;
    let speed_rpm = given.number(1).abs();
    table.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let usable = table.iter().flatten().all(|number| number.is_finite() && *number > 0.0) && speed_rpm.is_finite();
    let distinct = table.windows(2).all(|pair| pair[1][0] > 1.001 * pair[0][0]);
    let speeds: Vec<f64> = table.iter().map(|row| row[0]).collect();
    let found = weigh_known_speeds(&speeds, speed_rpm).filter(|_| usable && distinct && table.len() >= 3);
    let Some(SpeedWeights { law, .. }) = found else {
        let what = "the table has fewer than three speeds, one of them twice, or a number that is not positive";
        return Err(Refusal::new(RefusalKind::TooFew, what, "let the spindle idle at three speeds of this gear stage"));
    };
    let gain = noise_gain(&law.weight);
    if gain > EXTRAPOLATION_GAIN_MAX {
        let what = format!("{speed_rpm:.0} rpm lies too far from the known speeds (noise gain {gain:.1})");
        return Err(Refusal::new(RefusalKind::OutOfRange, what, "let the spindle idle at this speed"));
    }
    Ok((law.at.map(|at| table[at][1]), law.weight))
}

fn split_excess_power(given: &Arguments<'_>) -> Result<estimators::Balance, Refusal> {
    let excess_w = given.number(0) - given.number(1);
    solve_power_balance(excess_w, given.number(2), given.number(3)).ok_or_else(|| {
        let what = format!("no cutting power gives {excess_w:.1} W above no-load power with these coefficients");
        Refusal::new(RefusalKind::Contradiction, what, "identify the load loss of this gear stage again")
    })
}
