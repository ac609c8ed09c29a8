//! Settings that change while the estimators run.

use super::Inference;
use crate::learning::Learner;
use crate::no_load::NoLoadTable;
use crate::settings::Settings;
use crate::signals::Signals;

impl Inference {
    /// Takes new settings and keeps what was learned; the recent past begins anew where a length changed. No-load
    /// powers that the settings newly give replace what was learned at their speeds.
    pub fn apply_settings(&mut self, settings: Settings) {
        let lengths = |settings: &Settings| (settings.filter_samples, settings.window_samples);
        if lengths(&settings) != lengths(&self.settings) {
            let noise = self.state.signals.noise;
            self.state.signals = Signals::new(&settings);
            self.state.signals.noise = noise;
            self.state.learner = Learner::new(&settings);
            self.state.detector.forget_past();
        }
        if settings.no_load_table != self.settings.no_load_table && self.estimates.basis.in_watts() {
            self.state.no_load = NoLoadTable::new(&settings);
        }
        self.settings = settings;
        self.state.loads.reconfigure();
    }

    /// Everything that was learned of the load of this program is learned anew.
    pub fn learn_load_anew(&mut self, program: &str) {
        self.state.loads.learn_anew(program);
    }
}
