//! No-load power as a table over speed, interpolated quadratically between neighbouring speeds (seed 000, eq. 4).

use physics::{Role, Scene};

/// Speeds of a no-load table; the powers are the part's parameters `power_w[0]`, `power_w[1]`, ...
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedTable {
    /// Spindle speeds, rpm, increasing.
    pub speeds_rpm: Vec<f64>,
    /// The gear stage it holds for; `None` for every stage.
    pub gear_stage: Option<f64>,
}

impl SpeedTable {
    /// One column per speed: the weight of that speed's power in each row. Beyond the ends the end value holds.
    pub(super) fn compute_columns(&self, scene: &Scene) -> Option<Vec<(String, Vec<f64>)>> {
        let speed = scene.role_values(Role::Speed)?;
        let stage = scene.column("gear_stage");
        let count = self.speeds_rpm.len();
        let mut columns = vec![vec![0.0; scene.rows()]; count];
        for row in 0..scene.rows() {
            let here = match (self.gear_stage, stage) {
                (Some(wanted), Some(stage)) => (stage[row] - wanted).abs() < 0.5,
                _ => true,
            };
            if here {
                for (index, weight) in compute_lagrange_weights(&self.speeds_rpm, speed[row].abs()) {
                    columns[index][row] = weight;
                }
            }
        }
        Some(columns.into_iter().enumerate().map(|(index, column)| (format!("power_w[{index}]"), column)).collect())
    }
}

/// Lagrange weights on the three neighbouring speeds, the nearer outer one on a side with a choice.
fn compute_lagrange_weights(speeds: &[f64], n: f64) -> Vec<(usize, f64)> {
    let count = speeds.len();
    let n = n.clamp(speeds[0], speeds[count - 1]);
    if count < 3 {
        return compute_linear_weights(speeds, n);
    }
    let upper = speeds.partition_point(|speed| *speed < n).clamp(1, count - 1);
    let take_left = upper + 1 >= count || (upper >= 2 && n - speeds[upper - 2] <= speeds[upper + 1] - n);
    let first = if take_left { upper - 2 } else { upper - 1 };
    (first..first + 3)
        .map(|k| {
            let others = (first..first + 3).filter(|j| *j != k);
            (k, others.map(|j| (n - speeds[j]) / (speeds[k] - speeds[j])).product())
        })
        .collect()
}

fn compute_linear_weights(speeds: &[f64], n: f64) -> Vec<(usize, f64)> {
    if speeds.len() == 1 {
        return vec![(0, 1.0)];
    }
    let share = (n - speeds[0]) / (speeds[1] - speeds[0]);
    vec![(0, 1.0 - share), (1, share)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_weights_at_800_rpm() {
        let speeds = [100.0, 200.0, 300.0, 500.0, 600.0, 700.0, 900.0];
        let got = compute_lagrange_weights(&speeds, 800.0);
        assert_eq!(got.iter().map(|(k, _)| *k).collect::<Vec<_>>(), vec![4, 5, 6]);
        for ((_, got), want) in got.iter().zip([-1.0 / 3.0, 1.0, 1.0 / 3.0]) {
            assert!((got - want).abs() < 1e-12);
        }
    }
}
