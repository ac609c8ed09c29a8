//! Settings that a gear stage may have of its own: those of its load loss.

use super::cutting::LoadLossLaw;
use super::load_loss_doubt::LoadLossDoubt;
use super::settings::{STAGES, Settings, find_setting};

/// Settings that a gear stage may have of its own.
pub(super) const OF_STAGE: [&str; 7] = [
    "load_loss_linear",
    "load_loss_quadratic_per_w",
    "load_loss_speed_rpm",
    "load_loss_sd",
    "load_loss_sd_at_w",
    "load_loss_quadratic_sd_per_w",
    "load_loss_only_speed_rpm",
];

impl Settings {
    /// The load loss of a gear stage.
    #[must_use]
    pub fn load_loss(&self, stage: usize) -> LoadLossLaw {
        let [linear, quadratic_per_w, speed_rpm, ..] = self.load_loss_values(stage);
        LoadLossLaw::from_stated_speed(linear, quadratic_per_w, speed_rpm)
    }

    /// How well the load loss of a gear stage is known; `None` where nobody has commissioned it.
    #[must_use]
    pub fn load_loss_doubt(&self, stage: usize) -> Option<LoadLossDoubt> {
        let [_, _, _, share_sd, at_w, quadratic_sd_per_w, only_rpm] = self.load_loss_values(stage);
        let only_speed_rpm = Some(only_rpm).filter(|rpm| *rpm > 0.0);
        (share_sd > 0.0).then_some(LoadLossDoubt { share_sd, at_w, quadratic_sd_per_w, only_speed_rpm })
    }

    /// Of a row of [`OF_STAGE`]: the stage's own value, or else that for every stage.
    pub(super) fn value_of_stage(&self, row: usize, stage: usize) -> Option<f64> {
        let own = self.of_stage.get(row).and_then(|values| values.get(stage).copied().flatten());
        own.or_else(|| find_setting(OF_STAGE.get(row)?).map(|setting| (setting.get)(self)))
    }

    /// In the order of [`OF_STAGE`].
    fn load_loss_values(&self, stage: usize) -> [f64; OF_STAGE.len()] {
        std::array::from_fn(|row| self.value_of_stage(row, stage).unwrap_or(0.0))
    }
}

pub(super) fn find_place_of_stage(base: &str) -> Option<usize> {
    OF_STAGE.iter().position(|name| *name == base)
}

/// `load_loss_linear_stage_3` as base name and stage.
pub(super) fn split_stage_suffix(name: &str) -> Option<(&str, usize)> {
    let (base, stage) = name.rsplit_once("_stage_")?;
    stage.parse().ok().filter(|stage| *stage < STAGES).map(|stage| (base, stage))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gear_stage_may_have_its_own_load_loss() {
        let mut settings = Settings::default();
        settings.set_value("load_loss_linear_stage_2", 0.25).expect("in range");
        settings.set_value("load_loss_speed_rpm_stage_2", 640.0).expect("in range");
        settings.set_value("load_loss_speed_rpm", 800.0).expect("in range");
        settings.set_value("load_loss_speed_rpm_stage_3", 0.0).expect("the same at every speed");
        let of = |linear: f64, speed_rpm: Option<f64>| LoadLossLaw { linear, quadratic_per_w: 0.0, speed_rpm };
        assert_eq!(settings.load_loss(2), of(0.25, Some(640.0)));
        assert_eq!(settings.load_loss(1), of(0.18, Some(800.0)));
        assert_eq!(settings.load_loss(3), of(0.18, None));
        assert_eq!(settings.get("load_loss_speed_rpm_stage_2"), Some(640.0));
        settings.set_value("load_loss_sd_stage_2", 0.01).expect("in range");
        settings.set_value("load_loss_sd_at_w_stage_2", 900.0).expect("in range");
        let doubt = LoadLossDoubt { share_sd: 0.01, at_w: 900.0, quadratic_sd_per_w: 0.0, only_speed_rpm: None };
        assert_eq!(settings.load_loss_doubt(2), Some(doubt));
        assert_eq!(settings.load_loss_doubt(1), None, "not commissioned");
    }
}
