//! Power separation: no-load power at a speed, cutting power and load loss.

use super::{Answer, Arguments, Method, Parameter, Subject, takes};
use crate::estimators::balance;
use crate::estimators::regression::{Refusal, RefusalKind};

pub(super) static SUBJECT: Subject = Subject { en: "Power separation", zh: "功率分离", methods: METHODS };

const BALANCE: &[Parameter] = &[
    takes("spindle_power_w", "W"),
    takes("no_load_power_w", "W"),
    takes("load_loss_linear", "1"),
    takes("load_loss_quadratic_per_w", "1/W"),
];

static METHODS: &[Method] = &[
    Method {
        name: "separated_cutting_power_w",
        parameters: BALANCE,
        returns: "W",
        en: "Cutting power Pc of Pi = Pu + (1 + a0) Pc + a1 Pc^2; negative below no-load power; no value where no cutting power gives this power",
        zh: "由总功率、空载功率和附加载荷损耗系数求切削功率",
        run: |given| split(given).map(|split| Answer::Number(split.cutting_power_w)),
    },
    Method {
        name: "separated_load_loss_w",
        parameters: BALANCE,
        returns: "W",
        en: "Additional load loss Pad = a0 Pc + a1 Pc^2 that belongs to this cutting power",
        zh: "附加载荷损耗功率",
        run: |given| split(given).map(|split| Answer::Number(split.load_loss_w)),
    },
];

fn split(given: &Arguments<'_>) -> Result<crate::estimators::Balance, Refusal> {
    let excess_w = given.number(0) - given.number(1);
    balance(excess_w, given.number(2), given.number(3)).ok_or_else(|| {
        let what = format!("no cutting power gives {excess_w:.1} W above no-load power with these coefficients");
        Refusal::new(RefusalKind::Contradiction, what, "identify the load loss of this gear stage again")
    })
}
