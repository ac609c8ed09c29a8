//! No-load power as a table over speed: the law of the running machine (`numerics::speed_weights`).

use numerics::speed_weights::{SimulatedSpeedWeights, Weights, form_sd};
use physics::{Role, Scene};

/// Speeds of a no-load table; the powers are the part's parameters `power_w[0]`, `power_w[1]`, ...
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedTable {
    /// Spindle speeds, rpm, increasing.
    pub speeds_rpm: Vec<f64>,
    /// The gear stage it holds for; `None` for every stage.
    pub gear_stage: Option<f64>,
}

/// Where the law of a table is doubted most among the speeds of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FormDoubt {
    /// Spindle speed of the row, rpm.
    pub speed_rpm: f64,
    /// What the law gives there, in the unit of the table.
    pub power: f64,
    /// One standard deviation by the choice of the law.
    pub sd: f64,
}

impl SpeedTable {
    /// One column per speed: the weight of that speed's power in each row. Too far beyond the ends the last value holds.
    pub(super) fn compute_columns(&self, scene: &Scene) -> Option<Vec<(String, Vec<f64>)>> {
        let weights = SimulatedSpeedWeights::new(&self.speeds_rpm);
        let mut columns = vec![vec![0.0; scene.rows()]; self.speeds_rpm.len()];
        for (row, speed_rpm) in self.list_speeds(scene)? {
            let law = weights.weigh(speed_rpm).law;
            for (at, weight) in law.at.into_iter().zip(law.weight) {
                columns[at][row] += weight;
            }
        }
        Some(columns.into_iter().enumerate().map(|(index, column)| (format!("power_w[{index}]"), column)).collect())
    }

    /// Where the law is doubted most in the rows of a recording; `None` where another form never says anything else.
    pub(super) fn find_greatest_doubt(&self, scene: &Scene, powers: &[f64]) -> Option<FormDoubt> {
        let weights = SimulatedSpeedWeights::new(&self.speeds_rpm);
        let doubt = |(_, speed_rpm): (usize, f64)| {
            let found = weights.weigh(speed_rpm);
            let power_by = |weights: Weights| weights.weigh_powers(powers);
            let power = power_by(found.law);
            Some(FormDoubt { speed_rpm, power, sd: form_sd(power, power_by(found.other?)) })
        };
        let doubts = self.list_speeds(scene)?.into_iter().filter_map(doubt).filter(|it| it.sd > 0.0);
        doubts.max_by(|a, b| a.sd.total_cmp(&b.sd))
    }

    /// Row and speed of the rows in its gear stage.
    fn list_speeds(&self, scene: &Scene) -> Option<Vec<(usize, f64)>> {
        let speed = scene.role_values(Role::Speed)?;
        let stage = scene.column("gear_stage");
        let here = |row: &usize| match (self.gear_stage, stage) {
            (Some(wanted), Some(stage)) => (stage[*row] - wanted).abs() < 0.5,
            _ => true,
        };
        Some((0..scene.rows()).filter(here).map(|row| (row, speed[row].abs())).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use estimators::{NoLoadTable, Settings};
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn the_published_weights_at_800_rpm() {
        let speeds = [100.0, 200.0, 300.0, 500.0, 600.0, 700.0, 900.0];
        let got = SimulatedSpeedWeights::new(&speeds).weigh(800.0).law;
        assert_eq!(got.at, [4, 5, 6]);
        assert!(got.weight.iter().zip([-1.0 / 3.0, 1.0, 1.0 / 3.0]).all(|(got, want)| (got - want).abs() < 1e-12));
    }

    /// Power that the running machine and a simulation tell at a speed, of the same table, and the deviation that the former tells.
    fn tell_both(points: &[(f64, f64)], speed_rpm: f64) -> Option<(f64, f64, f64)> {
        let mut settings = Settings::default();
        settings.set_no_load_table(0, points).expect("a table");
        let live = NoLoadTable::new(&settings).get(0, speed_rpm, 0, &settings).ok()?;
        let (speeds, powers): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        Some((live.power_w, SimulatedSpeedWeights::new(&speeds).weigh(speed_rpm).law.weigh_powers(&powers), live.sd_w))
    }

    #[test]
    fn four_nodes_give_628_7_w_at_1200_rpm_in_both_and_the_straight_line_is_inside_the_interval() {
        let points = [(200.0, 110.0), (300.0, 150.0), (600.0, 330.0), (2000.0, 900.0)];
        let (live_w, simulated_w, sd_w) = tell_both(&points, 1200.0).expect("between known speeds");
        println!("1200 rpm: live {live_w:.2} +- {:.1} W, simulated {simulated_w:.2} W", 1.96 * sd_w);
        assert!((live_w - 628.74).abs() < 0.01 && (simulated_w - live_w).abs() < 1e-9);
        assert!(574.29 > live_w - 1.96 * sd_w, "the other form is inside");
    }

    /// Tables of two to eight speeds, close together and far apart, at speeds inside and outside: wherever the running machine says a power,
    /// the simulation says the same.
    #[test]
    fn the_running_machine_and_a_simulation_have_one_law() {
        let mut dice = Pcg64Mcg::seed_from_u64(5);
        let (mut compared, mut refused) = (0, 0);
        for _ in 0..400 {
            let mut points = vec![(dice.random_range(50.0..400.0), dice.random_range(40.0..200.0))];
            for _ in 1..dice.random_range(2..=8) {
                let (speed, power): (f64, f64) = points[points.len() - 1];
                points.push((speed * dice.random_range(1.025..2.2), power * dice.random_range(1.0..2.0)));
            }
            let (first, last) = (points[0].0, points[points.len() - 1].0);
            for at in 0..60 {
                let speed_rpm = 0.6 * first + (1.5 * last - 0.6 * first) * f64::from(at) / 59.0;
                match tell_both(&points, speed_rpm) {
                    Some((live_w, simulated_w, _)) => {
                        compared += 1;
                        assert!(
                            (live_w - simulated_w).abs() < 1e-6 * live_w,
                            "{points:?} at {speed_rpm}: {live_w} {simulated_w}"
                        );
                    }
                    None => refused += 1,
                }
            }
        }
        println!("{compared} powers compared, {refused} refused by the running machine");
        assert!(compared > 10_000 && refused > 100);
    }
}
