//! Thermal error: prediction from temperatures, the lag of a structure, and increments of a compensation.

use super::{Arguments, Method, MethodParameter, MethodResult, Subject, define_parameter};
use estimators::regression::{Refusal, RefusalKind};
use estimators::thermal::first_order;

pub(super) static SUBJECT: Subject = Subject { en: "Thermal error", zh: "热误差", methods: METHODS };

/// A temperature above this was meant in kelvin.
const KELVIN_FROM_C: f64 = 200.0;

const PREDICTION: &[MethodParameter] = &[
    define_parameter("temperatures_c", "[°C]"),
    define_parameter("coefficients_um_per_k", "[um/K]"),
    define_parameter("intercept_um", "um"),
];

const DEVIATION: &[MethodParameter] = &[
    define_parameter("temperatures_c", "[°C]"),
    define_parameter("covariance_by_rows", "[um2]"),
    define_parameter("residual_sd_um", "um"),
];

const LAG: &[MethodParameter] = &[
    define_parameter("state_c", "°C"),
    define_parameter("temperature_before_c", "°C"),
    define_parameter("temperature_c", "°C"),
    define_parameter("dt_s", "s"),
    define_parameter("tau_s", "s"),
];

const WANTED: &[MethodParameter] = &[
    define_parameter("value_um", "um"),
    define_parameter("error_um", "um"),
    define_parameter("limit_um", "um"),
    define_parameter("dead_band_um", "um"),
    define_parameter("slew_um_per_s", "um/s"),
    define_parameter("dt_s", "s"),
];

const PULSES: &[MethodParameter] =
    &[define_parameter("value_um", "um"), define_parameter("sent_um", "um"), define_parameter("pulse_um", "um")];

static METHODS: &[Method] = &[
    Method {
        name: "predicted_thermal_error_um",
        parameters: PREDICTION,
        returns: "um",
        en: "Thermal error E = intercept + sum of coefficient times temperature; a lagged sensor takes its state from first_order_c",
        zh: "由各测温点温度线性预测热误差",
        run: |given| predict_error(given).map(MethodResult::Number),
    },
    Method {
        name: "predicted_thermal_error_sd_um",
        parameters: DEVIATION,
        returns: "um",
        en: "Standard deviation of that prediction, from the covariance of intercept and coefficients, row by row, and the residual",
        zh: "热误差预测的标准不确定度",
        run: |given| compute_deviation(given).map(MethodResult::Number),
    },
    Method {
        name: "temperature_outside_k",
        parameters: &[
            define_parameter("temperatures_c", "[°C]"),
            define_parameter("least_c", "[°C]"),
            define_parameter("greatest_c", "[°C]"),
        ],
        returns: "K",
        en: "By how much the worst temperature lies outside its range of identification; 0 inside",
        zh: "温度超出辨识范围的最大值",
        run: |given| measure_excursion(given).map(MethodResult::Number),
    },
    Method {
        name: "first_order_c",
        parameters: LAG,
        returns: "°C",
        en: "State of a structure that follows its temperature late, dw/dt = (T - w) / tau, dt_s later; keep it in memory",
        zh: "一阶滞后温度状态",
        run: |given| advance_lagged_state(given).map(MethodResult::Number),
    },
    Method {
        name: "thermal_compensation_um",
        parameters: WANTED,
        returns: "um",
        en: "Next compensation value: against the error, within the limit, followed outside the dead band, at most slew times dt",
        zh: "热误差补偿量（限幅、死区、限速）",
        run: |given| advance_compensation(given).map(MethodResult::Number),
    },
    Method {
        name: "thermal_compensation_pulses",
        parameters: PULSES,
        returns: "1",
        en: "Whole pulses that bring what was sent to the value; what is less than a pulse is carried",
        zh: "补偿脉冲增量（小数部分保留）",
        run: |given| count_pulses(given).map(MethodResult::Number),
    },
];

fn refuse_call<T>(kind: RefusalKind, what: String, next: &str) -> Result<T, Refusal> {
    Err(Refusal::new(kind, what, next))
}

/// The temperatures of a call, none of them in kelvin.
fn read_temperatures<'a>(given: &'a Arguments<'_>) -> Result<&'a [f64], Refusal> {
    let all = given.numbers(0);
    match all.iter().find(|temperature| **temperature > KELVIN_FROM_C) {
        Some(hot) => refuse_call(RefusalKind::Unit, format!("{hot:.1} °C looks like K"), "subtract 273.15"),
        None => Ok(all),
    }
}

fn predict_error(given: &Arguments<'_>) -> Result<f64, Refusal> {
    let (temperatures, coefficients) = (read_temperatures(given)?, given.numbers(1));
    if temperatures.is_empty() || temperatures.len() != coefficients.len() {
        let what = format!("{} temperatures for {} coefficients", temperatures.len(), coefficients.len());
        return refuse_call(RefusalKind::Mismatch, what, "give one coefficient for each temperature");
    }
    Ok(given.number(2) + temperatures.iter().zip(coefficients).map(|(t, b)| t * b).sum::<f64>())
}

fn compute_deviation(given: &Arguments<'_>) -> Result<f64, Refusal> {
    let point: Vec<f64> = std::iter::once(1.0).chain(read_temperatures(given)?.iter().copied()).collect();
    let covariance = given.numbers(1);
    if covariance.len() != point.len() * point.len() {
        let what = format!("{} entries for {} coefficients with intercept", covariance.len(), point.len());
        return refuse_call(RefusalKind::Mismatch, what, "give the whole covariance, row by row");
    }
    let rows = covariance.chunks(point.len()).zip(&point);
    let variance: f64 = rows.map(|(row, x)| x * row.iter().zip(&point).map(|(c, y)| c * y).sum::<f64>()).sum();
    if variance < 0.0 {
        return refuse_call(RefusalKind::Contradiction, "the covariance is none".to_owned(), "copy it whole");
    }
    Ok(variance.sqrt().hypot(given.number(2)))
}

fn measure_excursion(given: &Arguments<'_>) -> Result<f64, Refusal> {
    let (temperatures, least, greatest) = (read_temperatures(given)?, given.numbers(1), given.numbers(2));
    let count = temperatures.len();
    if count == 0 || least.len() != count || greatest.len() != count {
        let what = format!("{count} temperatures for {} and {} limits", least.len(), greatest.len());
        return refuse_call(RefusalKind::Mismatch, what, "give one range for each temperature");
    }
    let beyond = |at: usize| (least[at] - temperatures[at]).max(temperatures[at] - greatest[at]);
    Ok((0..count).map(beyond).fold(0.0, f64::max))
}

fn advance_lagged_state(given: &Arguments<'_>) -> Result<f64, Refusal> {
    let (dt_s, tau_s) = (given.number(3), given.number(4));
    if tau_s <= 0.0 || dt_s < 0.0 {
        let what = format!("dt_s = {dt_s}, tau_s = {tau_s}");
        return refuse_call(RefusalKind::OutOfRange, what, "time does not go back, and a time constant is positive");
    }
    Ok(first_order(given.number(0), given.number(1), given.number(2), dt_s, tau_s))
}

fn advance_compensation(given: &Arguments<'_>) -> Result<f64, Refusal> {
    let [value, error, limit, dead_band, slew, dt_s] = std::array::from_fn(|at| given.number(at));
    if limit <= 0.0 || dead_band < 0.0 || slew <= 0.0 || dt_s < 0.0 {
        let what = format!("limit {limit} um, dead band {dead_band} um, slew {slew} um/s, dt {dt_s} s");
        return refuse_call(
            RefusalKind::OutOfRange,
            what,
            "limit and slew are positive, dead band and dt not negative",
        );
    }
    let wanted = (-error).clamp(-limit, limit);
    let step = if (wanted - value).abs() <= dead_band { 0.0 } else { wanted - value };
    Ok((value + step.clamp(-slew * dt_s, slew * dt_s)).clamp(-limit, limit))
}

fn count_pulses(given: &Arguments<'_>) -> Result<f64, Refusal> {
    let [value, sent, pulse] = std::array::from_fn(|at| given.number(at));
    if pulse <= 0.0 {
        return refuse_call(RefusalKind::OutOfRange, format!("pulse_um = {pulse}"), "a pulse has a length");
    }
    // A whole pulse is not missed by rounding of the division.
    Ok(((value - sent) / pulse * (1.0 + 1e-12)).trunc())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rhai::Dynamic;

    fn call(name: &str, values: Vec<Dynamic>) -> Result<f64, Refusal> {
        let method = METHODS.iter().find(|method| method.name == name).expect("a method");
        let mut values = values;
        let handed: Vec<&mut Dynamic> = values.iter_mut().collect();
        let arguments = Arguments::read(method, &handed).expect("arguments of the right kind");
        (method.run)(&arguments).map(|answer| match answer {
            MethodResult::Number(number) => number,
            other => panic!("a number, not {other:?}"),
        })
    }

    fn list(values: &[f64]) -> Dynamic {
        values.iter().map(|value| Dynamic::from_float(*value)).collect::<Vec<Dynamic>>().into()
    }

    fn numbers(values: &[f64]) -> Vec<Dynamic> {
        values.iter().map(|value| Dynamic::from_float(*value)).collect()
    }

    #[test]
    fn a_prediction_and_its_deviation() {
        let temperatures = || list(&[30.0, 20.0]);
        let error = call("predicted_thermal_error_um", vec![temperatures(), list(&[2.0, -1.0]), (-10.0).into()]);
        assert_eq!(error, Ok(30.0));
        // Independent coefficients: 1 + 900 * 0.01 + 400 * 0.0025 + 2^2.
        let covariance = list(&[1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 0.0025]);
        let sd = call("predicted_thermal_error_sd_um", vec![temperatures(), covariance, 2.0.into()]);
        assert!((sd.expect("a deviation") - 15.0_f64.sqrt()).abs() < 1e-12);
        let kelvin = call("predicted_thermal_error_um", vec![list(&[303.0]), list(&[2.0]), 0.0.into()]);
        assert_eq!(kelvin.expect_err("kelvin").kind, RefusalKind::Unit);
        let odd = call("predicted_thermal_error_um", vec![temperatures(), list(&[2.0]), 0.0.into()]);
        assert_eq!(odd.expect_err("one coefficient short").kind, RefusalKind::Mismatch);
        let outside = vec![temperatures(), list(&[15.0, 21.5]), list(&[28.0, 40.0])];
        assert_eq!(call("temperature_outside_k", outside), Ok(2.0));
    }

    #[test]
    fn a_state_follows_and_time_does_not_go_back() {
        let settled = call("first_order_c", numbers(&[20.0, 30.0, 30.0, 1e6, 600.0]));
        assert!((settled.expect("a state") - 30.0).abs() < 1e-9);
        assert!(call("first_order_c", numbers(&[20.0, 30.0, 30.0, -1.0, 600.0])).is_err());
    }

    #[test]
    fn increments_add_up_within_the_limits() {
        let (mut value, mut sent) = (0.0, 0.0);
        for _ in 0..1000 {
            value = call("thermal_compensation_um", numbers(&[value, 37.3, 25.0, 0.5, 2.0, 0.1])).expect("a value");
            let pulses = call("thermal_compensation_pulses", numbers(&[value, sent, 0.7])).expect("pulses");
            assert_eq!(pulses, pulses.trunc());
            sent += pulses * 0.7;
            assert!((value - sent).abs() < 0.7 + 1e-9);
        }
        assert!((-25.0..=-24.5).contains(&value), "against the error, to the dead band of the limit: {value}");
        assert!(call("thermal_compensation_um", numbers(&[0.0, 10.0, -1.0, 0.5, 2.0, 0.1])).is_err());
        assert!(call("thermal_compensation_pulses", numbers(&[1.0, 0.0, 0.0])).is_err());
    }
}
