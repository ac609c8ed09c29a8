//! Terms of a polynomial in several variables: `1`, `a`, `a*b`, `a^2`.

/// A product of powers, one power per variable, together at most two.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub struct WearTerm(Vec<u8>);

impl WearTerm {
    /// The term of these powers.
    #[must_use]
    pub fn new(powers: Vec<u8>) -> Self {
        Self(powers)
    }

    /// The power of each variable.
    #[must_use]
    pub fn powers(&self) -> &[u8] {
        &self.0
    }

    /// Sum of the powers.
    #[must_use]
    pub fn order(&self) -> u8 {
        self.0.iter().sum()
    }

    /// Value at a point, one coordinate per variable.
    #[must_use]
    pub fn evaluate_at(&self, point: &[f64]) -> f64 {
        self.0.iter().zip(point).map(|(power, x)| x.powi(i32::from(*power))).product()
    }

    /// Derivative with respect to one variable at a point.
    #[must_use]
    pub fn slope(&self, variable: usize, point: &[f64]) -> f64 {
        match self.0.get(variable).copied().unwrap_or(0) {
            0 => 0.0,
            power => {
                let mut lower = self.clone();
                lower.0[variable] -= 1;
                f64::from(power) * lower.evaluate_at(point)
            }
        }
    }

    /// The term in these symbols: `VB*vc`, `f^2`, `1`.
    #[must_use]
    pub fn format_name(&self, symbols: &[&str]) -> String {
        let part = |(power, symbol): (&u8, &&str)| match power {
            0 => None,
            1 => Some((*symbol).to_owned()),
            power => Some(format!("{symbol}^{power}")),
        };
        let parts: Vec<String> = self.0.iter().zip(symbols).filter_map(part).collect();
        if parts.is_empty() { "1".to_owned() } else { parts.join("*") }
    }

    /// Does this term contain every factor of the other one? Then the other one stays while this one is there.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        self != other && self.0.iter().zip(&other.0).all(|(mine, theirs)| mine >= theirs)
    }
}

/// Every term up to the second order: the constant, the variables, their products, their squares.
#[must_use]
pub fn second_order(variables: usize) -> Vec<WearTerm> {
    let unit = |i: usize| (0..variables).map(|j| u8::from(i == j)).collect::<Vec<u8>>();
    let sum = |i: usize, j: usize| WearTerm(unit(i).iter().zip(unit(j)).map(|(a, b)| a + b).collect());
    let singles = (0..variables).map(|i| WearTerm(unit(i)));
    let products = (0..variables).flat_map(|i| (i + 1..variables).map(move |j| (i, j)));
    let squares = (0..variables).map(|i| (i, i));
    [WearTerm(vec![0; variables])]
        .into_iter()
        .chain(singles)
        .chain(products.chain(squares).map(|(i, j)| sum(i, j)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_variables_have_fifteen_terms() {
        let terms = second_order(4);
        let names: Vec<String> = terms.iter().map(|term| term.format_name(&["a", "b", "c", "d"])).collect();
        assert_eq!(
            names,
            ["1", "a", "b", "c", "d", "a*b", "a*c", "a*d", "b*c", "b*d", "c*d", "a^2", "b^2", "c^2", "d^2"]
        );
        assert!(terms[5].contains(&terms[1]) && terms[5].contains(&terms[0]) && !terms[1].contains(&terms[5]));
    }

    #[test]
    fn the_slope_is_that_of_the_value() {
        let point = [0.3, -0.7, 1.1];
        for term in second_order(3) {
            for variable in 0..3 {
                let mut moved = point;
                moved[variable] += 1e-6;
                let slope = (term.evaluate_at(&moved) - term.evaluate_at(&point)) / 1e-6;
                assert!((slope - term.slope(variable, &point)).abs() < 1e-5);
            }
        }
    }
}
