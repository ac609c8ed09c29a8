//! The scripts that come with the gateway: examples that run, are tested, and are meant to be edited.

use super::compile::ScriptFile;

const SHIPPED: [(&str, &str); 7] = [
    ("alarms.rhai", include_str!("../scripts/alarms.rhai")),
    ("constant_load.rhai", include_str!("../scripts/constant_load.rhai")),
    ("energy.rhai", include_str!("../scripts/energy.rhai")),
    ("state.rhai", include_str!("../scripts/state.rhai")),
    ("teach.rhai", include_str!("../scripts/teach.rhai")),
    ("thermal.rhai", include_str!("../scripts/thermal.rhai")),
    ("tool_wear.rhai", include_str!("../scripts/tool_wear.rhai")),
];

/// Every script that comes with the gateway.
#[must_use]
pub fn list_shipped_scripts() -> Vec<ScriptFile> {
    SHIPPED.iter().map(|(name, text)| ScriptFile { name: (*name).to_owned(), text: (*text).to_owned() }).collect()
}

#[cfg(test)]
mod tests {
    use super::list_shipped_scripts;
    use crate::{Host, compile_scripts, prove_scripts, run_trials};
    use adapter_core::clock::SECOND_NS;
    use adapter_core::{ChannelId, Sample, Slot, Value};
    use estimators::loads::LoadEstimator;
    use estimators::{Estimate, Estimates, State};

    #[test]
    fn every_shipped_script_passes_its_own_trials() {
        let set = compile_scripts(&list_shipped_scripts()).unwrap_or_else(|problems| panic!("{problems:?}"));
        assert!(run_trials(&set).len() >= 25);
        prove_scripts(set).unwrap_or_else(|problems| panic!("{problems:?}"));
    }

    /// A machine that makes parts, with the shipped scripts beside it and nothing written to it.
    struct Shop {
        host: Host,
        loads: LoadEstimator,
        sample: Sample,
        estimates: Estimates,
        /// Alarm and seconds since the part began.
        told: Vec<(String, f64)>,
        /// Ticks at which another feed was asked for.
        asked: u32,
    }

    impl Shop {
        fn new() -> Self {
            let mut host = Host::new();
            host.load_scripts(&list_shipped_scripts()).expect("the shipped scripts");
            let (sample, estimates) = (Sample::new_empty(0), Estimates::without_samples(0));
            Self { host, loads: LoadEstimator::default(), sample, estimates, told: Vec::new(), asked: 0 }
        }

        fn set(&mut self, name: &str, value: Value) {
            let id = ChannelId::from_name(name).expect("a channel");
            self.sample.set_slot(id, Slot { value: Ok(value), age_ns: 0 });
        }

        fn pass(&mut self, state: State, power_w: f64, feed: f64, seconds: u32, began_ns: i64) {
            for _ in 0..10 * seconds {
                self.sample.at_ns += SECOND_NS / 10;
                self.estimates.at_ns = self.sample.at_ns;
                if state != self.estimates.state {
                    (self.estimates.state, self.estimates.since_ns) = (state, self.sample.at_ns);
                }
                self.set("feed_mm_min", Value::Number(feed));
                self.estimates.cutting_power_w = Ok(Estimate { value: power_w, sd: 10.0 });
                self.loads.step(&self.sample, &mut self.estimates, &self.host.settings().clone());
                let decision = self.host.run_due_scripts(&self.sample, &self.estimates);
                let at_s = (self.sample.at_ns - began_ns) as f64 / SECOND_NS as f64;
                let raised = decision.alarms.iter().filter(|alarm| alarm.raised);
                self.told.extend(raised.map(|alarm| (alarm.name.to_string(), at_s)));
                self.asked += u32::from(decision.request.as_ref().is_some_and(|it| (it.pct - 100.0).abs() > 0.5));
            }
        }

        /// A part: 8 s without feed, 3 s of approach through the air, 30 s of cut, which after `good_s` is as given.
        fn make_part(&mut self, part: i32, coolant: f64, good_s: u32, (state, power_w): (State, f64)) {
            for (name, text) in [("program", "O1"), ("tool", "T1"), ("execution", "ACTIVE"), ("mode", "AUTOMATIC")] {
                self.set(name, Value::Text(text.into()));
            }
            self.set("part_count", Value::Number(f64::from(part)));
            for (name, number) in [
                ("feed_programmed_mm_min", 200.0),
                ("feed_override_pct", 100.0),
                ("coolant_on", coolant),
                ("spindle_speed_rpm", 1000.0),
            ] {
                self.set(name, Value::Number(number));
            }
            let began_ns = self.sample.at_ns + 11 * SECOND_NS;
            self.pass(State::Idle, 0.0, 0.0, 8, began_ns);
            self.pass(State::Idle, 0.0, 200.0, 3, began_ns);
            self.pass(State::Cutting, 1000.0, 200.0, good_s, began_ns);
            self.pass(state, power_w, 200.0, 30 - good_s, began_ns);
        }
    }

    /// Told in shadow: a part of air, six times the power from the tenth second on, a part without coolant; and nothing in healthy parts.
    #[test]
    fn air_a_multiple_and_missing_coolant_are_told_in_shadow() {
        let mut shop = Shop::new();
        let cut = (State::Cutting, 1000.0);
        (0..9).for_each(|part| shop.make_part(part, 1.0, 30, cut));
        assert_eq!((&shop.told[..], shop.asked), (&[][..], 0), "healthy parts");
        shop.make_part(9, 1.0, 0, (State::Idle, 0.0));
        let air = std::mem::take(&mut shop.told);
        assert!(matches!(&air[..], [(name, at_s)] if name == "undercut" && (0.0..6.0).contains(at_s)), "{air:?}");
        shop.make_part(10, 1.0, 10, (State::Cutting, 6000.0));
        let multiple = std::mem::take(&mut shop.told);
        let seen = multiple.iter().find(|(name, _)| name == "power_multiple");
        assert!(seen.is_some_and(|(_, at_s)| (10.0..11.3).contains(at_s)), "{multiple:?}");
        shop.make_part(11, 0.0, 30, cut);
        let dry = std::mem::take(&mut shop.told);
        assert!(matches!(&dry[..], [(name, at_s)] if name == "coolant_missing" && *at_s < 4.0), "{dry:?}");
        shop.make_part(12, 1.0, 30, cut);
        assert_eq!(shop.told, [], "all is as it was");
        assert!(shop.host.alarms().is_empty(), "{:?}", shop.host.alarms());
    }
}
