//! Cutting wet needs another force than cutting dry.

use crate::cut::{estimate_cut_load, multiply_cut, mark_cutting_rows};
use crate::excitation::{has_variation, count_visits};
use crate::state::apply_continuous_lag;
use crate::{Bound, Effect, EffectDoc, Form, ParameterColumns, ParameterDoc, Scene, Texts};
use numerics::statistics::median;

/// Cut that differs wet and dry.
#[derive(Debug, Clone, Copy)]
pub struct CoolantRegime;

static DOC: EffectDoc = EffectDoc {
    kind: "coolant_regime",
    family: "cutting",
    law: "y = change * L * w, w = coolant_on; arriving: dw/dt = (coolant_on - w) / tau; fading: w = coolant_on * (vm / vc)^fading, vm the median cutting speed of the wet cuts",
    parameters: &[
        ParameterDoc::new_linear(
            "change",
            "1",
            (-0.3, 0.3),
            "share by which the cut changes with coolant, where it fades at the usual cutting speed; negative is lighter",
            "有冷却液时切削变化的比例（作用随速度减弱时指常用切速下），负值为变轻",
        ),
        ParameterDoc::new_shape(
            "fading",
            "1",
            (0.0, 4.0),
            "exponent by which it does less at higher cutting speed",
            "切速升高时作用减弱的指数",
        ),
        ParameterDoc::new_shape(
            "tau_s",
            "s",
            (0.05, 8.0),
            "time the coolant takes to reach the cut and to leave it",
            "冷却液到达和离开切削区的时间",
        ),
    ],
    needs: &["load | engaged", "coolant_on"],
    source: "friction on rake and flank wet against dry: 5-15 % of cutting power; less gets to the chip the faster it runs \
             (Shaw, Metal Cutting Principles, 2nd ed., chapter 13)",
    experiment_minutes: 5.0,
    rivals: &["auxiliary_switch", "hardness_batch", "speed_softening"],
    en: Texts {
        name: "coolant in the cut",
        statement: "Cutting wet needs another force than cutting dry",
        absence: "cuts with coolant differ from cuts without by the same share; idle does not depend on the coolant",
        confused_with: "the power of the pump itself (also idle)",
        experiment: "cut the same pass wet and dry, and run idle wet and dry",
    },
    zh: Texts {
        name: "冷却润滑状态",
        statement: "湿切与干切所需的力不同",
        absence: "有冷却液的切削与无冷却液的按同一比例不同，空转与冷却液无关",
        confused_with: "冷却泵自身功率（空转也有）",
        experiment: "同一走刀分别湿切和干切，并分别空转",
    },
};

impl Effect for CoolantRegime {
    fn doc(&self) -> &'static EffectDoc {
        &DOC
    }

    fn bound(&self) -> Bound {
        // dry and wet cutting differ by 5 to 15 %
        Bound::Cut(0.5)
    }

    fn form_names(&self) -> &'static [&'static str] {
        &[FADING, ARRIVING]
    }

    fn propose_forms(&self, scene: &Scene) -> Vec<Form> {
        let Some(coolant) = scene.column("coolant_on") else { return Vec::new() };
        let cutting = mark_cutting_rows(scene);
        let wet = count_visits(scene, |row| cutting[row] && coolant[row] > 0.5);
        let dry = count_visits(scene, |row| cutting[row] && coolant[row] < 0.5);
        if wet.min(dry) == 0 || estimate_cut_load(scene).is_none() {
            return Vec::new();
        }
        let speeds = list_wet_speeds(scene, coolant).filter(|speeds| has_variation(speeds));
        let fading = speeds.map(|_| Form { name: FADING, ..Form::from_shape(&[("fading", 1.0)]) });
        let arriving = ARRIVING_S.into_iter().filter(|tau_s| *tau_s > ARRIVING_PERIODS * scene.period_s());
        let arriving = arriving.map(|tau_s| Form { name: ARRIVING, ..Form::from_shape(&[("tau_s", tau_s)]) });
        [Form::without_shape()].into_iter().chain(fading).chain(arriving).collect()
    }

    fn compute_columns(&self, scene: &Scene, form: &Form) -> Option<ParameterColumns> {
        let coolant = scene.column("coolant_on")?;
        let wet = match form.name {
            ARRIVING => apply_continuous_lag(scene, coolant, form.shape_value("tau_s").unwrap_or(1.0)),
            FADING => fade_coolant(scene, coolant, form.shape_value("fading").unwrap_or(1.0))?,
            _ => coolant.to_vec(),
        };
        Some(vec![("change", multiply_cut(scene, |row| wet[row])?)])
    }
}

/// The form that does less the faster the cut.
const FADING: &str = "fading";
/// The form in which the cut grows wet and dry again in time: the pipe fills, a film builds up.
const ARRIVING: &str = "arriving";
/// Time constants to start from, s, and the shortest that rows can tell, in sampling periods.
const ARRIVING_S: [f64; 3] = [0.3, 1.0, 4.0];
const ARRIVING_PERIODS: f64 = 0.4;
/// Share of the usual cutting speed below which coolant does no more.
const SLOW_SHARE: f64 = 0.1;

/// Coolant by what it does at the speed of each row; `None` where that is not known.
fn fade_coolant(scene: &Scene, coolant: &[f64], exponent: f64) -> Option<Vec<f64>> {
    let usual = median(list_wet_speeds(scene, coolant)?)?;
    let speed = scene.column("cutting_speed_m_min")?;
    let share = |speed: &f64| (usual / speed.max(SLOW_SHARE * usual)).powf(exponent);
    Some(coolant.iter().zip(speed).map(|(on, speed)| on * share(speed)).collect())
}

/// Cutting speeds of the rows that cut wet, m/min; `None` where they are not known.
fn list_wet_speeds(scene: &Scene, coolant: &[f64]) -> Option<Vec<f64>> {
    let speed = scene.column("cutting_speed_m_min")?;
    let cutting = mark_cutting_rows(scene);
    let wet = |row: &usize| cutting[*row] && coolant[*row] > 0.5 && speed[*row] > 0.0;
    let speeds: Vec<f64> = (0..scene.rows()).filter(wet).map(|row| speed[row]).collect();
    (!speeds.is_empty()).then_some(speeds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::tests::{column, scene, set};
    use recording::Recording;

    /// Four seconds in a cut of 800 W, at these speeds in m/min and with the coolant on where it is one.
    fn cut_for_four_seconds(speed: [f64; 4], coolant_on: [f64; 4]) -> Scene {
        let mut recording = Recording::new("wet", (0..4).map(f64::from).collect(), None);
        set(&mut recording, "cutting_speed_m_min", |row| speed[row]);
        set(&mut recording, "coolant_on", |row| coolant_on[row]);
        set(&mut recording, "engaged", |_| 1.0);
        set(&mut recording, "spindle_power_w", |_| 1.0);
        let mut scene = scene(&recording, "spindle_power_w");
        scene.set_load(Some(vec![800.0; 4]));
        scene
    }

    #[test]
    fn coolant_that_arrives_late_is_all_there_later() {
        let form = Form { name: "arriving", ..Form::from_shape(&[("tau_s", 0.5)]) };
        let scene = cut_for_four_seconds([100.0; 4], [0.0, 1.0, 1.0, 1.0]);
        let column = column(&CoolantRegime, &scene, &form);
        assert!(column[0] == 0.0 && column[1] < 500.0 && column[1] < column[2] && column[3] > 780.0, "{column:?}");
    }

    #[test]
    fn coolant_that_fades_does_half_at_twice_the_usual_speed() {
        let form = Form { name: "fading", ..Form::from_shape(&[("fading", 1.0)]) };
        let scene = cut_for_four_seconds([100.0, 100.0, 200.0, 200.0], [1.0, 1.0, 1.0, 0.0]);
        assert_eq!(column(&CoolantRegime, &scene, &form), [800.0, 800.0, 400.0, 0.0]);
    }
}
