//! What is different where something else stands for spindle power; see [`StateBasis`].

use super::Inference;
use crate::basis::StateBasis;
use crate::estimate::Estimates;
use crate::no_load::NoLoadTable;
use crate::settings::Settings;
use adapter_core::Absence;

impl Inference {
    /// No-load powers that were learned from something else are in another unit. A basis is also one that was stored before there
    /// were several: spindle power.
    pub(super) fn follow_basis(&mut self, basis: StateBasis) {
        // Nothing is learned from motion alone.
        if self.state.basis == basis.as_word() || basis == StateBasis::Motion {
            return;
        }
        let before = std::mem::replace(&mut self.state.basis, basis.as_word().to_owned());
        let was_in_watts =
            StateBasis::ALL.into_iter().find(|known| known.as_word() == before).is_none_or(StateBasis::in_watts);
        if was_in_watts && basis.in_watts() {
            return;
        }
        let no_load_table = if basis.in_watts() { self.settings.no_load_table.clone() } else { Vec::new() };
        self.state.no_load = NoLoadTable::new(&Settings { no_load_table, ..self.settings.clone() });
        self.state.upper_bound = None;
        self.state.signals.forget_history();
        self.state.learner.discard_collected();
        self.state.detector.forget_past();
    }

    /// What stands for power tells the state, and nothing in watts.
    pub(super) fn without_watts(&self, estimates: Estimates) -> Estimates {
        let none = Err(self.explain_missing_input(self.channels.power, Absence::NotProvided));
        Estimates {
            filtered_power_w: none,
            no_load_power_w: none,
            cutting_power_w: none,
            load_loss_w: none,
            visible_cutting_power_w: none,
            ..estimates
        }
    }
}
