//! Tool wear: the limit of the cutting power, the wear that a power means, the cutting speed.

use super::{Arguments, Method, MethodParameter, MethodResult, Subject, define_parameter};
use estimators::regression::{Refusal, RefusalKind};
use estimators::wear::{
    CutConditions, Observability, Physical, WearEstimate, WearModel, compute_power_limit, cutting_speed_m_min,
    estimate_wear,
};

pub(super) static SUBJECT: Subject = Subject { en: "Tool wear", zh: "刀具磨损", methods: METHODS };

const MODEL: MethodParameter = define_parameter("model", "[16 numbers]");
const CUT: [MethodParameter; 3] = [
    define_parameter("cutting_speed_m_min", "m/min"),
    define_parameter("feed_per_rev_mm", "mm/rev"),
    define_parameter("depth_of_cut_mm", "mm"),
];

static METHODS: &[Method] = &[
    Method {
        name: "cutting_speed_m_min",
        parameters: &[define_parameter("diameter_mm", "mm"), define_parameter("spindle_speed_rpm", "rpm")],
        returns: "m/min",
        en: "Cutting speed of a diameter at a spindle speed: pi D n / 1000",
        zh: "由直径和转速求切削速度",
        run: |given| cutting_speed_m_min(given.number(0), given.number(1)).map(MethodResult::Number),
    },
    Method {
        name: "wear_threshold_w",
        parameters: &[MODEL, CUT[0], CUT[1], CUT[2], define_parameter("criterion_mm", "mm")],
        returns: "W",
        en: "Cutting power [Pc] of an edge worn to the criterion in this cut; model: the line that identify tool-wear prints for \
             scripts; no value outside the cuts that the model was fitted on, nor where the wear cannot be seen",
        zh: "达到磨钝标准时的切削功率阈值；超出试验范围或不可观测时无值",
        run: |given| {
            let (model, cut, criterion_mm) = (read_model(given)?, read_conditions(given, 1), given.number(4));
            let limit = compute_power_limit(&model, &cut, criterion_mm)?;
            check_observability(&limit.extrapolated, limit.observability)?;
            Ok(MethodResult::Number(limit.power_w))
        },
    },
    Method {
        name: "flank_wear_mm",
        parameters: &[
            MODEL,
            define_parameter("cutting_power_w", "W"),
            CUT[0],
            CUT[1],
            CUT[2],
            define_parameter("criterion_mm", "mm"),
        ],
        returns: "mm",
        en: "Flank wear that this cutting power means in this cut; no value where wear_estimate would not call it observable",
        zh: "由切削功率求后刀面磨损量；不可观测时无值",
        run: |given| {
            let found = estimate_from_arguments(given, 1, 0.0, 2, 5)?;
            check_observability(&found.extrapolated, found.observability)?;
            Ok(MethodResult::Number(found.flank_wear_mm))
        },
    },
    Method {
        name: "wear_estimate",
        parameters: &[
            MODEL,
            define_parameter("cutting_power_w", "W"),
            define_parameter("cutting_power_sd_w", "W"),
            CUT[0],
            CUT[1],
            CUT[2],
            define_parameter("criterion_mm", "mm"),
        ],
        returns: "#{ flank_wear_mm, flank_wear_sd_mm, observable: 1 or 0, extrapolated: 1 or 0 }",
        en: "Flank wear with its standard deviation, whether it can be seen in this cut, and whether the cut lies outside those \
             that the model was fitted on",
        zh: "磨损量、标准不确定度、是否可观测、是否外推",
        run: |given| {
            let found = estimate_from_arguments(given, 1, given.number(2), 3, 6)?;
            let flag = |yes: bool| f64::from(u8::from(yes));
            Ok(MethodResult::Map(vec![
                ("flank_wear_mm", found.flank_wear_mm),
                ("flank_wear_sd_mm", found.sd_mm),
                ("observable", flag(found.observability == Observability::Observable)),
                ("extrapolated", flag(!found.extrapolated.is_empty())),
            ]))
        },
    },
];

fn read_model(given: &Arguments<'_>) -> Result<WearModel, Refusal> {
    Physical::from_short(given.numbers(0)).map(WearModel::Physical)
}

/// Speed, feed and depth from this place on.
fn read_conditions(given: &Arguments<'_>, at: usize) -> CutConditions {
    CutConditions::from_vector([0.0, given.number(at), given.number(at + 1), given.number(at + 2)])
}

fn estimate_from_arguments(
    given: &Arguments<'_>,
    power: usize,
    sd_w: f64,
    cut: usize,
    criterion: usize,
) -> Result<WearEstimate, Refusal> {
    let power = (given.number(power), sd_w);
    estimate_wear(&read_model(given)?, &read_conditions(given, cut), power, given.number(criterion))
}

/// A plain number has no place for its doubts.
fn check_observability(extrapolated: &[&str], observability: Observability) -> Result<(), Refusal> {
    if !extrapolated.is_empty() {
        let what = format!("{} lies outside the cuts that the model was fitted on", extrapolated.join(", "));
        return Err(Refusal::new(RefusalKind::OutOfRange, what, "wear_estimate gives the number and says so"));
    }
    if observability == Observability::NotObservableHere {
        let what = "the wear cannot be seen in the power of this cut";
        return Err(Refusal::new(RefusalKind::NotIdentifiable, what, "observe it at another cut of the part"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use estimators::regression::RefusalKind;
    use estimators::wear::Physical;

    #[test]
    fn sixteen_numbers_are_a_model_and_come_back() {
        let numbers = [930.0, 0.92, 0.75, 1.0, 3.2, 120.0, 0.15, 1.0, 20.0, 90.0, 150.0, 0.1, 0.2, 0.75, 1.25, 0.325];
        let physical = Physical::from_short(&numbers).expect("a model");
        assert_eq!(physical.to_short_form(), numbers);
        assert_eq!(Physical::from_short(&numbers[..5]).expect_err("short").kind, RefusalKind::Mismatch);
        let mut wrong = numbers;
        wrong[5] = -1.0;
        assert_eq!(Physical::from_short(&wrong).expect_err("wrong").kind, RefusalKind::OutOfRange);
    }
}
