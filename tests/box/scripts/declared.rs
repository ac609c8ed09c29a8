//! Every setting of the shipped scripts at the ends of its range and at random points: the trials pass, the script stays.

use super::*;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use rules::script::{
    DeclarationPlace, SettingValue, SettingValues, compile_with, list_declarations, list_shipped_scripts,
    prepare_scripts, prepare_with, run_trials,
};

/// What is wrong with one shipped script under these values; empty where nothing is.
fn wrong(script: &ScriptFile, values: &SettingValues) -> String {
    match prepare_with(std::slice::from_ref(script), values) {
        Ok(set) if !set.is_empty() => String::new(),
        Ok(_) => "nothing is in charge".to_owned(),
        Err(problems) => told(&problems),
    }
}

#[test]
fn every_setting_at_the_ends_of_its_range_and_at_twenty_random_points_leaves_its_script_in_charge() {
    let (mut tried, mut failed) = (0, Vec::new());
    let mut random = Pcg64::seed_from_u64(33);
    for script in list_shipped_scripts() {
        let declared = list_declarations(std::slice::from_ref(&script)).expect("readable");
        let mut try_with = |values: &SettingValues, what: &str| {
            tried += 1;
            let found = wrong(&script, values);
            if !found.is_empty() {
                failed.push(format!("{what}: {found}"));
            }
        };
        for setting in &declared {
            let mut put = |value: SettingValue| {
                let mut values = SettingValues::default();
                values.set_value(setting.section(), &setting.name, &DeclarationPlace::Machine, Some(value.clone()));
                try_with(&values, &format!("{} = {value}", setting.path()));
            };
            match setting.range {
                Some((least, greatest)) => [least, greatest].into_iter().for_each(|it| put(SettingValue::Number(it))),
                None => put(SettingValue::Text(setting.one_of.last().cloned().unwrap_or_else(|| "O77".to_owned()))),
            }
        }
        for _ in 0..20 {
            let mut values = SettingValues::default();
            for (setting, (least, greatest)) in declared.iter().filter_map(|it| Some((it, it.range?))) {
                let number: f64 = random.random_range(least..=greatest);
                let number = if setting.whole { number.round() } else { number };
                values.set_value(
                    setting.section(),
                    &setting.name,
                    &DeclarationPlace::Machine,
                    Some(SettingValue::Number(number)),
                );
            }
            try_with(&values, &values.to_toml_text());
        }
    }
    println!("{tried} choices of settings, {} without a script in charge", failed.len());
    assert!(failed.is_empty(), "{} of {tried}:\n{}", failed.len(), failed.join("\n"));
}

const ONE: &str = "const X = setting(\"x_w\", 5.0, #{ unit: \"W\", min: 0, max: 10, per: [\"tool\"], en: \"a power\", zh: \"功率\" });\n\
    alarm_when(\"over\", (cutting_power_w ?? 0.0) > X, 0.0, \"over\");\nfn on_tool_change() { note(`now ${X}`); }\n\
    fn trial_it() { given(#{ cutting_power_w: X + 1.0 }); after_s(1.0); expect_alarm(\"over\"); }";

fn values(text: &str) -> Result<SettingValues, String> {
    SettingValues::parse("settings.toml", text).map_err(|problems| told(&problems))
}

fn refused(text: &str) -> String {
    let values = match values(text) {
        Ok(values) => values,
        Err(told) => return told,
    };
    told(&compile_with(&[file("one.rhai", ONE)], &values).err().unwrap_or_default())
}

#[test]
fn a_value_that_cannot_be_used_is_told_with_line_range_unit_and_the_nearest_word() {
    assert_eq!(refused("[one]\nx_w = 3"), "");
    let outside = refused("[one]\nx_w = 30");
    assert!(outside.starts_with("settings.toml:2:1: one.x_w = 30 is outside 0 to 10 W"), "{outside}");
    assert!(outside.contains("a power; it takes 0 to 10 W, by default 5.0"), "{outside}");
    assert!(refused("[one]\nx_V = 3").contains("did you mean x_w?"));
    assert!(refused("[onee]\nx_w = 3").contains("did you mean [one]?"));
    assert!(refused("[one]\nx_w = \"a\"").contains("needs a number, not a text"));
    assert!(refused("[one.operation.rough]\nx_w = 3").contains("has no values for a single operation"));
    assert!(refused("x_w = 3").contains("outside of every section"));
    assert!(refused("[one]\nx_w = [3]").contains("neither a number nor a text"));
    assert!(refused("[one\nx_w = 3").contains("not TOML"));
    assert_eq!(refused("[thermal]\nlimit_um = 3"), "", "a shipped script that was taken out");
    let written = values("[one.tool.\"T 1\"]\nx_w = 7\n[one]\nx_w = 3").expect("fine").to_toml_text();
    assert_eq!(written, "[one]\nx_w = 3.0\n\n[one.tool.\"T 1\"]\nx_w = 7.0\n");
}

#[test]
fn a_declaration_that_cannot_be_used_is_told() {
    let told = |text: &str| told(&compile_scripts(&[file("one.rhai", text)]).err().unwrap_or_default());
    assert!(
        told("let x = setting(\"x\", 50, #{ unit: \"W\", min: 0, max: 10, en: \"a\", zh: \"b\" });")
            .contains("the default is not allowed")
    );
    assert!(
        told("let x = setting(\"x\", 5, #{ unit: \"W\", min: 0, en: \"a\", zh: \"b\" });")
            .contains("the setting x has no max")
    );
    assert!(
        told("let x = setting(\"x\", 5, #{ unit: \"W\", mim: 0, max: 9, en: \"a\", zh: \"b\" });")
            .contains("did you mean min?")
    );
    assert!(told("let y = 5; let x = setting(\"x\", y, #{});").contains("all written out"));
}

#[test]
fn the_tool_in_use_decides_where_it_has_a_value_of_its_own() {
    let values = values("[one]\nx_w = 3\n[one.tool.T7]\nx_w = 9").expect("fine");
    let set = prepare_with(&[file("one.rhai", ONE)], &values).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    assert_eq!(run_trials(&set).len(), 3, "the defaults, the machine, the tool");
    let mut host = Host::new();
    host.install_set(set);
    let mut over = |at_s: i64, tool: &str| {
        let mut sample = Sample::new_empty(at_s * 1_000_000_000);
        let id = ChannelId::from_name("tool").expect("a channel");
        sample.set_slot(id, Slot { value: Ok(Value::Text(tool.into())), age_ns: 0 });
        let mut estimates = Estimates::without_samples(sample.at_ns);
        estimates.cutting_power_w = Ok(Estimate { value: 5.0, sd: 0.1 });
        let notes = host.run_due_scripts(&sample, &estimates).notes.clone();
        (host.alarms().len(), notes.first().map(|note| note.text.to_string()))
    };
    assert_eq!(over(1, "T1"), (1, None), "above the 3 W of the machine");
    assert_eq!(over(2, "T7"), (0, Some("now 9.0".to_owned())), "below the 9 W of the tool");
    assert_eq!(over(3, "T1"), (1, Some("now 3.0".to_owned())));
}

#[test]
fn two_tools_may_have_the_same_value() {
    let settings = |text: &str| {
        let values = values(&format!("[constant_load]\ntarget_w = 1000\n{text}")).expect("fine");
        let set =
            prepare_with(&list_shipped_scripts(), &values).unwrap_or_else(|problems| panic!("{}", told(&problems)));
        set.settings().clone()
    };
    let (first, second) = ("[constant_load.tool.T1]\ntarget_w = 800\n", "[constant_load.tool.T2]\ntarget_w = 800\n");
    let both = settings(&format!("{first}{second}"));
    assert_ne!(both, settings(first), "the second tool has a value of its own, too");
    assert_ne!(both, settings(second));
    let as_machine = settings("[constant_load.tool.T1]\ntarget_w = 1000\n");
    assert_eq!(as_machine, settings(""), "what a tool says as the machine does is nothing of its own");
}

#[test]
fn what_one_script_publishes_another_reads_in_the_same_tick_and_circles_are_refused() {
    let publish = file("z.rhai", "publish(\"half_w\", 0.5 * (cutting_power_w ?? 0.0), \"W\");");
    let read = file(
        "a.rhai",
        "note(`${half_w}`);\nfn trial_it() { given(#{ half_w: 4.0 }); after_s(0.1); expect_note(\"4.0\"); }",
    );
    let set =
        prepare_scripts(&[read.clone(), publish.clone()]).unwrap_or_else(|problems| panic!("{}", told(&problems)));
    assert_eq!(set.versions().map(|it| it.0).collect::<Vec<_>>(), ["z.rhai", "a.rhai"]);
    let mut host = Host::new();
    host.install_set(set);
    let mut estimates = Estimates::without_samples(0);
    estimates.cutting_power_w = Ok(Estimate { value: 8.0, sd: 0.1 });
    assert_eq!(&*host.run_due_scripts(&Sample::new_empty(0), &estimates).notes[0].text, "4.0");
    let circle = file("z.rhai", "publish(\"half_w\", twice_w, \"W\");");
    let other = file("a.rhai", "publish(\"twice_w\", half_w, \"W\");");
    let told_of = told(&compile_scripts(&[circle, other]).err().expect("a circle"));
    assert!(told_of.contains("a.rhai reads half_w of z.rhai, z.rhai reads twice_w of a.rhai"), "{told_of}");
    let alone =
        told(&compile_scripts(&[file("b.rhai", "note(`${part_energy_kwh}`);")]).err().expect("nobody publishes it"));
    assert!(alone.contains("energy.rhai, which comes with the gateway, publishes it"), "{alone}");
}

#[test]
fn a_script_without_trials_is_run_before_it_comes_into_charge() {
    let told = |text: &str| told(&prepare_scripts(&[file("x.rhai", text)]).err().unwrap_or_default());
    assert!(told("loop {}").contains("did not come to an end"));
    assert!(
        told("if now_s < 0.0 { request_feed_override(\"90 %\", \"x\"); }")
            .contains("needs a number here, not the text")
    );
    assert!(told("let a = \"90 %\"; request_feed_override(a, \"x\");").contains("needs a number, not text"));
    assert!(told("fn on_tool_change() { let a = [1]; a[7] = 1; }").contains("x.rhai:1:"));
    assert_eq!(told("request_feed_override(90, \"x\");"), "");
}

#[test]
fn an_edited_script_that_fails_after_days_gives_way_to_the_one_before_and_a_first_one_to_the_delivered() {
    let late = "if now_s > 5000.0 { let a = [1]; a[7] = 1; }\nrequest_feed_override(80, \"late\");";
    let none = Estimates::without_samples(0);
    let at = |at_s: i64| Sample::new_empty(at_s * 1_000_000_000);
    let mut host = Host::new();
    host.load_scripts(&[file("alarms.rhai", "request_feed_override(90, \"good\");")]).expect("compiles");
    host.run_due_scripts(&at(0), &none);
    host.load_scripts(&[file("alarms.rhai", late)]).expect("compiles");
    (1..300).for_each(|tick| drop(host.run_due_scripts(&at(tick), &none).clone()));
    assert!(host.run_due_scripts(&at(6000), &none).problems.len() == 1);
    assert_eq!(host.run_due_scripts(&at(6001), &none).request.as_ref().map(|it| it.pct), Some(90.0));
    let mut host = Host::new();
    host.load_scripts(&[file("alarms.rhai", late)]).expect("compiles");
    host.run_due_scripts(&at(6000), &none);
    host.run_due_scripts(&at(6001), &none);
    let status = host.status();
    assert_eq!(status.scripts[0].condition.as_word(), "reverted");
    assert!(!status.scripts[0].reads.is_empty(), "the alarms as delivered");
}
