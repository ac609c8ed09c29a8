//! What a recursion over a hidden state carries along with each of its values: an innovation of its own, and how likely, or
//! how dear, the way there was.

/// Ways that are mixed where they meet, as the forward recursion does.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mixture {
    /// Chance of them together.
    pub(super) chance: f64,
    /// Their innovation in the mean, once settled.
    pub(super) e: f64,
}

impl Mixture {
    /// Takes one more way that is so likely.
    pub(super) fn take(&mut self, likely: f64, e: f64) {
        self.chance += likely;
        self.e += likely * e;
    }

    /// Ends a row, in which all that was taken anywhere is so likely.
    pub(super) fn settle(&mut self, all: f64) {
        self.e /= self.chance.max(f64::MIN_POSITIVE);
        self.chance /= all.max(f64::MIN_POSITIVE);
    }
}

/// The cheapest of the ways that meet, as Viterbi's algorithm keeps it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cheapest {
    /// Minus two times the logarithm of how likely it is.
    pub(super) cost: f64,
    /// Its innovation.
    pub(super) e: f64,
}

impl Cheapest {
    /// No way so far.
    pub(super) const NONE: Self = Self { cost: f64::INFINITY, e: 0.0 };

    /// Takes a way if it is cheaper; says whether it is.
    pub(super) fn take(&mut self, cost: f64, e: f64) -> bool {
        let cheaper = cost < self.cost;
        if cheaper {
            *self = Self { cost, e };
        }
        cheaper
    }
}
