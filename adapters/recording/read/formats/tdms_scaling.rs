//! Scales of a TDMS channel whose values are stored raw: the properties `NI_Scale[n]_..`, as DAQmx and LabVIEW write them. Each scale takes
//! the raw values or what another one gives; the last one gives the values of the channel.

use std::collections::BTreeMap;

/// As an input: the raw values.
const RAW: u32 = u32::MAX;

/// What the properties of an object say.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct TdmsScaling {
    numbers: BTreeMap<String, f64>,
    texts: BTreeMap<String, String>,
}

impl TdmsScaling {
    pub(super) fn accept_text(&mut self, name: &str, text: String) {
        if name.starts_with("NI_Scal") {
            self.texts.insert(name.to_owned(), text);
        }
    }

    pub(super) fn accept_number(&mut self, name: &str, number: f64) {
        if name.starts_with("NI_Scale[") || name == "NI_Number_Of_Scales" {
            self.numbers.insert(name.to_owned(), number);
        }
    }

    /// Does it hold a scale at all?
    pub(super) fn says_something(&self) -> bool {
        self.texts.keys().any(|name| name.ends_with("_Scale_Type"))
    }

    /// The values of the channel; `Err`: the kind of a scale that is not computed.
    pub(super) fn scale_values(&self, raw: Vec<f64>) -> Result<Vec<f64>, String> {
        let is_scaled = self.texts.get("NI_Scaling_Status").is_some_and(|status| status == "scaled");
        let last = self.list_scales().into_iter().next_back().filter(|_| !is_scaled);
        let Some(last) = last else { return Ok(raw) };
        let steps = self.list_steps(last)?;
        Ok(raw.into_iter().map(|value| steps.iter().fold(value, |x, step| compute_polynomial(step, x))).collect())
    }

    fn list_scales(&self) -> Vec<u32> {
        let number = |name: &String| name.strip_prefix("NI_Scale[")?.strip_suffix("]_Scale_Type")?.parse().ok();
        let mut found: Vec<u32> = self.texts.keys().filter_map(number).collect();
        found.sort_unstable();
        found
    }

    /// Coefficients of each scale from the raw values to this one.
    fn list_steps(&self, last: u32) -> Result<Vec<Vec<f64>>, String> {
        let mut steps = Vec::new();
        let mut scale = Some(last);
        while let Some(index) = scale {
            let kind = self.texts.get(&format!("NI_Scale[{index}]_Scale_Type")).cloned().unwrap_or_default();
            let number = |name: &str| self.numbers.get(&format!("NI_Scale[{index}]_{kind}_{name}")).copied();
            let coefficients = match kind.as_str() {
                "Linear" => number("Y_Intercept").zip(number("Slope")).map(|(offset, slope)| vec![offset, slope]),
                "Polynomial" => {
                    // A polynomial without a size has four coefficients.
                    let size = number("Coefficients_Size").unwrap_or(4.0);
                    (0..64_u32)
                        .take_while(|at| f64::from(*at) < size)
                        .map(|at| number(&format!("Coefficients[{at}]")))
                        .collect()
                }
                _ => None,
            };
            // A scale that takes what itself gives would never end.
            let is = |number: u32, source: &f64| f64::from(number).total_cmp(source).is_eq();
            let source = number("Input_Source").filter(|source| !is(RAW, source));
            scale = source.and_then(|source| (0..index).find(|lower| is(*lower, &source)));
            let coefficients = coefficients.filter(|_| source.is_none() || scale.is_some());
            steps.push(coefficients.ok_or_else(|| format!("{kind:?} (NI_Scale[{index}])"))?);
        }
        steps.reverse();
        Ok(steps)
    }
}

fn compute_polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn build_scaling(numbers: &[(&str, f64)], texts: &[(&str, &str)]) -> TdmsScaling {
        let mut found = TdmsScaling::default();
        numbers.iter().for_each(|(name, number)| found.accept_number(name, *number));
        texts.iter().for_each(|(name, text)| found.accept_text(name, (*text).to_owned()));
        found
    }

    #[test]
    fn raw_values_become_those_of_the_channel() {
        let linear = [("NI_Scale[0]_Linear_Slope", 0.1), ("NI_Scale[0]_Linear_Y_Intercept", 2.0)];
        let kind = ("NI_Scale[0]_Scale_Type", "Linear");
        assert_eq!(build_scaling(&linear, &[kind]).scale_values(vec![50.0]), Ok(vec![7.0]));
        assert_eq!(
            build_scaling(&linear, &[kind, ("NI_Scaling_Status", "scaled")]).scale_values(vec![50.0]),
            Ok(vec![50.0])
        );
        let chain = [
            linear[0],
            linear[1],
            ("NI_Scale[1]_Polynomial_Coefficients_Size", 3.0),
            ("NI_Scale[1]_Polynomial_Coefficients[0]", 1.0),
            ("NI_Scale[1]_Polynomial_Coefficients[1]", 0.0),
            ("NI_Scale[1]_Polynomial_Coefficients[2]", 2.0),
            ("NI_Scale[1]_Polynomial_Input_Source", 0.0),
        ];
        let both = [kind, ("NI_Scale[1]_Scale_Type", "Polynomial")];
        assert_eq!(build_scaling(&chain, &both).scale_values(vec![50.0]), Ok(vec![99.0]));
        let table = build_scaling(&[], &[("NI_Scale[0]_Scale_Type", "Table")]).scale_values(vec![1.0]);
        assert!(table.is_err_and(|kind| kind.contains("Table")));
    }
}
