//! `identify`: coefficients inside their stated intervals over seeded repetitions of a simulated machine, and refusals.
//!
//! The short form runs by default; the long one with
//! `cargo test --release --test inference identify:: -- --ignored --nocapture`.

mod current;
mod loss_over_speed;
mod machine;
mod power;
mod thermal;
mod turning_wear;
mod wear;
mod wear_limits;

/// Repetitions of the long form.
pub(crate) const LONG: u64 = 200;
/// Repetitions of the short form.
pub(crate) const SHORT: u64 = 40;

/// How often the stated interval of one coefficient held the truth.
pub(crate) struct Coverage {
    quantity: String,
    inside: u64,
    repetitions: u64,
}

impl Coverage {
    /// Nothing counted yet.
    pub(crate) fn new(quantity: impl Into<String>) -> Self {
        Self { quantity: quantity.into(), inside: 0, repetitions: 0 }
    }

    /// The same count under another name.
    pub(crate) fn named(self, quantity: impl Into<String>) -> Self {
        Self { quantity: quantity.into(), ..self }
    }

    /// One repetition.
    pub(crate) fn add(&mut self, interval: (f64, f64), truth: f64) {
        assert!(interval.0.is_finite() && interval.1.is_finite() && interval.0 <= interval.1, "{interval:?}");
        self.repetitions += 1;
        self.inside += u64::from(interval.0 <= truth && truth <= interval.1);
    }

    /// Prints the share and asserts that it is 90 to 98 %; an interval that always holds the truth is wider than it says.
    pub(crate) fn assert_neither_narrow_nor_wide(&self) {
        self.assert();
        let share = self.inside as f64 / self.repetitions as f64;
        assert!(share <= 0.98, "{}: {share}", self.quantity);
    }

    /// Prints the share and asserts that it is 90 % at least.
    pub(crate) fn assert(&self) {
        let share = self.inside as f64 / self.repetitions as f64;
        println!("{:<60} {:>3} of {:>3} inside, {:.1} %", self.quantity, self.inside, self.repetitions, 100.0 * share);
        assert!(self.repetitions > 0 && share >= 0.9, "{}: {share}", self.quantity);
    }
}
