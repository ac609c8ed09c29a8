//! Tells when temperatures leave the range of the identification, and what the compensation does then. Nobody notices by himself
//! that an offset stands still.

use adapters::clock::{SECOND_NS, TimeNs};
use gateway_base::log::{Notice, Severity};
use rules::estimators::thermal::{CompensationStep, Outside, Standing, ThermalPrediction};

/// The temperatures must be inside for so long before that is told: a sensor at the border goes to and fro.
const INSIDE_NS: i64 = 300 * SECOND_NS;

/// Tells when temperatures leave the range that the law was identified in.
#[derive(Debug, Default)]
pub struct OutsideWatch {
    last_reported: Option<Standing>,
    inside_since_ns: Option<TimeNs>,
}

impl OutsideWatch {
    /// What is to be told of this step.
    pub fn watch_step(
        &mut self,
        at_ns: TimeNs,
        prediction: Option<&ThermalPrediction>,
        step: &CompensationStep,
        sensors: &[&str],
    ) -> Option<Notice> {
        let prediction = prediction?;
        let Some(outside) = prediction.outside else { return self.report_return(at_ns) };
        self.inside_since_ns = None;
        // What is worse than what was told is told; what is better waits for the inside.
        if self.last_reported.is_some_and(|told| rank_standing(told) >= rank_standing(step.standing)) {
            return None;
        }
        self.last_reported = Some(step.standing);
        let (where_to, sd_um) = (describe_outside(outside, sensors), prediction.error_um.sd);
        let what = match step.standing {
            Standing::AtTheEdge => format!(
                "the law goes on to half of its range beyond it, and the offset is that of this edge ({:.1} um, uncertain by {sd_um:.1} um)",
                step.value_um
            ),
            Standing::Doubted => format!(
                "the prediction is uncertain by {sd_um:.1} um, as much as it would compensate: the offset stays at {:.1} um",
                step.value_um
            ),
            _ => format!("the offset goes on by the law, uncertain by {sd_um:.1} um (one standard deviation)"),
        };
        let next = "a recording of such a day and `cnc-gateway identify thermal` widen the range";
        let text = format!("{where_to}: {what}; {next}");
        Some(Notice::new(Severity::Warning, "thermal_outside", text))
    }

    fn report_return(&mut self, at_ns: TimeNs) -> Option<Notice> {
        self.last_reported?;
        let since_ns = *self.inside_since_ns.get_or_insert(at_ns);
        if (0..INSIDE_NS).contains(&(at_ns - since_ns)) {
            return None;
        }
        (self.last_reported, self.inside_since_ns) = (None, None);
        let text = "the temperatures are those of the identification again";
        Some(Notice::new(Severity::Info, "thermal_inside", text))
    }
}

fn rank_standing(standing: Standing) -> u8 {
    match standing {
        Standing::Doubted => 2,
        Standing::AtTheEdge => 1,
        _ => 0,
    }
}

fn describe_outside(outside: Outside, sensors: &[&str]) -> String {
    match outside {
        Outside::Sensor { sensor, temperature_c, range_c: (least, greatest) } => {
            let by_k = (least - temperature_c).max(temperature_c - greatest);
            let name = sensors.get(sensor).copied().unwrap_or("a temperature");
            format!(
                "{name} is {temperature_c:.1} °C, {by_k:.1} K outside the {least:.1} to {greatest:.1} °C of the identification of the \
                 thermal law"
            )
        }
        Outside::Combination => {
            "each temperature was seen when the thermal law was identified, all of them together were not".to_owned()
        }
    }
}
