//! A physical form as sixteen numbers, as a script holds it: `const WEAR = [...];`.

use super::coding::Range;
use super::physical::Physical;
use crate::regression::{Refusal, RefusalKind};

/// How many numbers there are.
pub const SHORT_LENGTH: usize = 16;

/// What the numbers are, in order.
pub const SHORT_FORM: &str = "P0, x, y, z, W, vc0, f0, ap0, sd, vc from, vc to, f from, f to, ap from, ap to, VB to";

/// Degrees of freedom that a short form is taken to have: its intervals are those of a normal distribution.
const MANY: f64 = 1e6;

impl Physical {
    /// The sixteen numbers, see [`SHORT_FORM`].
    #[must_use]
    pub fn to_short_form(&self) -> [f64; SHORT_LENGTH] {
        let ([x, y, z], [speed, feed, depth]) = (self.exponents, self.reference);
        let Range { least, greatest } = self.range;
        [
            self.cutting_power_w,
            x,
            y,
            z,
            self.wear_w_min_m_mm2,
            speed,
            feed,
            depth,
            self.residual_sd_w,
            least[1],
            greatest[1],
            least[2],
            greatest[2],
            least[3],
            greatest[3],
            greatest[0],
        ]
    }

    /// The form of sixteen numbers.
    ///
    /// # Errors
    /// Another count, or numbers that cannot be such a form.
    pub fn from_short(numbers: &[f64]) -> Result<Self, Refusal> {
        let next = "take the line that `identify tool-wear` prints for scripts";
        let Ok([p0, x, y, z, w, vc0, f0, ap0, sd, vc1, vc2, f1, f2, ap1, ap2, vb2]) =
            <[f64; SHORT_LENGTH]>::try_from(numbers)
        else {
            let what = format!("{} numbers where {SHORT_LENGTH} are needed: {SHORT_FORM}", numbers.len());
            return Err(Refusal::new(RefusalKind::Mismatch, what, next));
        };
        let positive = [p0, vc0, f0, ap0, vb2].iter().all(|number| *number > 0.0) && sd >= 0.0;
        if !positive || numbers.iter().any(|number| !number.is_finite()) || vc2 < vc1 || f2 < f1 || ap2 < ap1 {
            return Err(Refusal::new(RefusalKind::OutOfRange, "these numbers are no wear model", next));
        }
        Ok(Self {
            reference: [vc0, f0, ap0],
            cutting_power_w: p0,
            exponents: [x, y, z],
            wear_w_min_m_mm2: w,
            covariance: Vec::new(),
            residual_sd_w: sd,
            degrees_of_freedom: MANY,
            range: Range { least: [0.0, vc1, f1, ap1], greatest: [vb2, vc2, f2, ap2] },
        })
    }
}
