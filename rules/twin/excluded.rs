//! What the model file excludes is never named, but it may be the truth: where it would explain clearly more than all that
//! is named, the names are what was left over, and are withdrawn.

use super::designs::{Design, designs_of, wanted};
use super::diagnose::Case;
use super::fit::Fit;
use super::model::{Model, simulate};
use super::search::Hypothesis;
use super::verdicts::CLASS_INFORMATION;

impl Case<'_> {
    /// The kinds that the search must not consider and that would explain clearly more than what is named.
    pub(super) fn outdone_by_excluded(
        &mut self,
        base: &Fit,
        best: &Hypothesis,
        designs: &[Design],
        seed: u64,
    ) -> Option<String> {
        let narrowed = !self.model.exclude.is_empty() || !self.model.only.is_empty();
        if !narrowed || best.members.is_empty() {
            return None;
        }
        self.simulate_baseline(base);
        let all = [designs, &self.excluded_designs()].concat();
        let found = (all.len() > designs.len()).then(|| self.searched(base, &all, seed).best);
        let _ = simulate(&best.fit.parts, &mut self.scene);
        let found = found?;
        let kinds = |of: &Hypothesis| of.members.iter().map(|member| all[*member].kind.clone()).collect::<Vec<_>>();
        let (named, instead) = (kinds(best), kinds(&found));
        // What merely stands beside all that is named takes nothing from it.
        let replaces = named.iter().any(|kind| !instead.contains(kind));
        let clearly = found.information > best.information + CLASS_INFORMATION;
        let excluded = found.members.iter().filter(|member| **member >= designs.len());
        let excluded: Vec<&str> = excluded.map(|member| all[*member].kind.as_str()).collect();
        (replaces && clearly && !excluded.is_empty()).then(|| excluded.join(", "))
    }

    /// Every form of the kinds that the model file keeps out of the search.
    fn excluded_designs(&self) -> Vec<Design> {
        let open = Model { exclude: Vec::new(), only: Vec::new(), ..self.model.clone() };
        let excluded = |kind: &str| crate::physics::effect(kind).is_some_and(|effect| !wanted(effect, self.model));
        designs_of(&self.scene, &self.frame, &open, excluded)
    }
}

#[cfg(test)]
mod tests {
    use crate::twin::{Diagnosis, diagnose, parse_model};
    use adapters::recording::read_csv;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use std::fmt::Write;

    /// A slide with viscous friction that a model of its mass lacks.
    fn found(candidates: &str) -> Diagnosis {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let mut text = String::from("time_s,run,velocity_m_s,acceleration_m_s2,axis_force_n\n");
        for row in 0..1500_u32 {
            let t = 0.5 * f64::from(row);
            let velocity = 0.4 * (t / 7.0).sin() * (0.4 + 0.6 * (t / 90.0).sin().abs());
            let acceleration = 0.4 / 7.0 * (t / 7.0).cos();
            let noise: f64 = StandardNormal.sample(&mut rng);
            let force = 900.0 * acceleration + 20.0 * velocity + 4.0 * noise;
            writeln!(text, "{t},{},{velocity:.6},{acceleration:.6},{force:.4}", row / 150).expect("a string takes it");
        }
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let model = format!(
            "schema = \"model/1\"\noutput = \"axis_force_n\"\n[[effect]]\nkind = \"linear\"\n\
             columns = {{ acceleration_m_s2 = 900.0 }}\n[roles]\nvelocity = \"velocity_m_s\"\n{candidates}"
        );
        diagnose(&recording, &parse_model(&model).expect("fine"), 1).expect("usable")
    }

    #[test]
    fn what_is_left_over_is_no_name_where_the_best_is_excluded() {
        assert_eq!(found("").missing[0].effect, "viscous_friction");
        let narrowed = found("[candidates]\nexclude = [\"viscous_friction\"]\n");
        assert_eq!((narrowed.verdict.word(), narrowed.missing[0].effect.as_str()), ("unexplained", "unknown"));
        assert!(narrowed.missing[0].statement.contains("viscous_friction would explain"), "{:?}", narrowed.missing);
    }

    #[test]
    fn what_explains_nothing_may_be_excluded() {
        assert_eq!(
            found("[candidates]\nexclude = [\"gear_stage\", \"bearing_warm_up\"]\n").missing[0].effect,
            "viscous_friction"
        );
    }
}
