//! A feed axis made for tests, with laws of its own: inertia, viscous friction and what a test adds.

use std::fmt::Write as _;

/// What the simulation believes of it.
pub const MODEL: &str = "schema = \"model/1\"\nname = \"axis\"\noutput = \"force_n\"\n\n[[effect]]\nkind = \"linear\"\n\
                         columns = { acceleration_m_s2 = 90.0, velocity_m_s = 210.0 }\n";

/// Reproducible normal deviates (a linear congruential generator, twelve uniform numbers each).
pub struct Noise(u64);

impl Noise {
    /// A sequence of its own per seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(self.0 >> 32).unwrap_or(0)) / f64::from(u32::MAX)
    }

    /// Mean 0, deviation 1.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// `runs` runs of 200 rows at 10 Hz back and forth, with a dry friction of `friction_n`.
pub fn recording(runs: usize, friction_n: f64, noise: &mut Noise) -> String {
    recording_with(runs, friction_n, noise, |_| 0.0)
}

/// The same with a force of `extra` newtons at each time, beside a column `fan_on` that says when it is not zero.
pub fn recording_with(runs: usize, friction_n: f64, noise: &mut Noise, extra: impl Fn(f64) -> f64) -> String {
    let mut text = String::from("time_s,run,velocity_m_s,acceleration_m_s2,force_n,fan_on\n");
    for run in 1..=runs {
        let speed = 0.05 + 0.04 * f64::from(u32::try_from(run % 5).unwrap_or(0));
        let mut slow = 0.0;
        for row in 0..200_u32 {
            let time_s = f64::from(row) / 10.0;
            let angle = std::f64::consts::TAU * time_s / 5.0;
            let velocity = speed * (1.6 * angle.sin()).clamp(-1.0, 1.0);
            let before = speed * (1.6 * (angle - 0.02).sin()).clamp(-1.0, 1.0);
            let acceleration = (velocity - before) / 0.02 * std::f64::consts::TAU / 5.0;
            slow = 0.8 * slow + 0.4 * noise.normal();
            let added = extra(time_s);
            let friction = if velocity.abs() > 1e-9 { friction_n * velocity.signum() } else { 0.0 };
            let force = 95.0 * acceleration + 200.0 * velocity + friction + added + slow + 0.5 * noise.normal();
            let fan = u8::from(added != 0.0);
            let _ = writeln!(text, "{time_s},{run},{velocity:.6},{acceleration:.6},{force:.4},{fan}");
        }
    }
    text
}
