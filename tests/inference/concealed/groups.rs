//! The groups of cases, and how many of which effect they hold.

use crate::concealed::baseline::Process;
use crate::concealed::case::{Case, Expect};
use crate::concealed::dice::Dice;
use crate::concealed::law::Entry;
use crate::concealed::laws;
use crate::concealed::noise::Noise;
use crate::concealed::real::inject;
use crate::concealed::schedule::{Mode, Needs};
use crate::concealed::spindle_case::CaseSpec;
use crate::concealed::{drive, thermal};

/// A case that can be built.
pub(crate) enum Order {
    Spindle(Box<CaseSpec>),
    Drive(drive::Order),
    Thermal(thermal::Order),
    Injected(inject::Order),
}

impl Order {
    pub(crate) fn build(&self) -> Option<Case> {
        match self {
            Self::Spindle(spec) => spec.build(),
            Self::Drive(order) => drive::build(order),
            Self::Thermal(order) => thermal::build(order),
            Self::Injected(order) => order.build(),
        }
    }

    /// Group and name of the case.
    pub(crate) fn label(&self) -> String {
        match self {
            Self::Spindle(spec) => format!("{}/{}", spec.group, spec.name),
            Self::Drive(order) => format!("{}/{}", order.group, order.name),
            Self::Thermal(order) => format!("{}/{}", order.group, order.name),
            Self::Injected(order) => format!("{}/{}", order.group(), order.name()),
        }
    }

    pub(crate) fn group(&self) -> String {
        match self {
            Self::Spindle(spec) => spec.group.clone(),
            Self::Drive(order) => order.group.clone(),
            Self::Thermal(order) => order.group.clone(),
            Self::Injected(order) => order.group(),
        }
    }
}

/// Every case of one seed.
pub(crate) fn orders(seed: u64) -> Vec<Order> {
    let mut list = singles(seed);
    list.extend(several(seed));
    list.extend(unlisted(seed));
    list.extend(nothing(seed));
    list.extend(alike(seed));
    list.extend(absorbed(seed));
    list.extend(faulty(seed));
    let mut orders: Vec<Order> = list.into_iter().map(|w| Order::Spindle(Box::new(w))).collect();
    orders.extend(drive::orders(seed).into_iter().map(Order::Drive));
    orders.extend(thermal::orders(seed).into_iter().map(Order::Thermal));
    orders.extend(inject::orders(seed).into_iter().map(Order::Injected));
    orders
}

/// How many times as long as usual recordings are: `CONCEALED_LENGTH`, 1 where it is not set.
fn length() -> f64 {
    std::env::var("CONCEALED_LENGTH").map_or(1.0, |text| text.trim().parse().expect("CONCEALED_LENGTH is a number"))
}

fn spec(group: String, name: String, seed: u64, mode: Mode, entries: Vec<Entry>, rho: f64) -> CaseSpec {
    let mut dice = Dice::seeded(&format!("{group}/{name}/wish"), seed);
    CaseSpec {
        noise: Noise::draw(&mut dice),
        process: Process::Turning,
        seconds: length() * dice.uniform(1900.0, 2100.0),
        expect: Expect::Named,
        needs: Needs::default(),
        current: false,
        name: format!("{name}-s{seed}"),
        group,
        seed,
        mode,
        entries,
        rho,
    }
}

/// Names of the effects that a spindle-power recording can show.
fn names() -> Vec<&'static str> {
    let mut names: Vec<&str> = laws::listed().iter().map(|e| e.name).collect();
    names.dedup();
    names
}

/// One form of `name`, another with every seed.
fn form(name: &str, seed: u64) -> Entry {
    let forms = laws::named(name);
    forms[seed as usize % forms.len()].clone()
}

fn singles(seed: u64) -> Vec<CaseSpec> {
    let mut list = Vec::new();
    let plain = [
        (Mode::Rich, &[0.25, 0.5, 1.0, 2.0][..]),
        (Mode::Production, &[0.25, 0.5, 1.0, 2.0]),
        (Mode::Mono, &[1.0]),
        (Mode::ClosedLoop, &[1.0]),
    ];
    for (mode, strengths) in plain {
        for rho in strengths {
            let group = format!("single-{}-rho{rho}", mode.name());
            list.extend(
                names()
                    .iter()
                    .map(|name| spec(group.clone(), name.to_string(), seed, mode, vec![form(name, seed)], *rho)),
            );
        }
    }
    list.extend(other_processes(seed));
    list.extend(special(seed));
    list
}

fn other_processes(seed: u64) -> Vec<CaseSpec> {
    let milling =
        ["flank_wear", "hardness_batch", "bearing_warm_up", "auxiliary_switch", "clock_lag", "spindle_inertia"];
    let drilling = ["flank_wear", "hardness_batch", "meter_window", "zero_drift"];
    let one = |process: Process, label: &str, name: &&str| {
        let mut spec =
            spec(format!("single-{label}-rho1"), name.to_string(), seed, Mode::Rich, vec![form(name, seed)], 1.0);
        spec.process = process;
        spec
    };
    let mills = milling.iter().map(|n| one(Process::Milling, "milling", n));
    mills.chain(drilling.iter().map(|n| one(Process::Drilling, "drilling", n))).collect()
}

fn special(seed: u64) -> Vec<CaseSpec> {
    let group = "single-special-rho1";
    let one = |name: &str, mode: Mode| spec(group.into(), name.into(), seed, mode, vec![form(name, seed)], 1.0);
    let mut list = vec![
        one("runout", Mode::Rich),
        one("inverter_loss", Mode::Rich),
        one("constant_load_control", Mode::ClosedLoop),
    ];
    for name in ["sensor_gain", "clock_lag", "zero_drift", "bearing_warm_up", "flank_wear"] {
        let mut spec = spec("single-current-rho1".into(), name.into(), seed, Mode::Rich, vec![form(name, seed)], 1.0);
        spec.current = true;
        list.push(spec);
    }
    list
}

fn several(seed: u64) -> Vec<CaseSpec> {
    let mut list = Vec::new();
    let mut dice = Dice::seeded("several", seed);
    for (mode, rho, count) in [(Mode::Rich, 1.0, 10), (Mode::Rich, 0.5, 4), (Mode::Production, 1.0, 6)] {
        let group = format!("pair-{}-rho{rho}", mode.name());
        list.extend((0..count).map(|i| together(&group, i, seed, mode, 2, rho, &mut dice)));
    }
    list.extend((0..4).map(|i| together("triple-rich-rho1", i, seed, Mode::Rich, 3, 1.0, &mut dice)));
    let opposites = [
        ("bearing_warm_up", "preload_growth"),
        ("flank_wear", "speed_softening"),
        ("flank_wear", "sensor_gain"),
        ("hardness_batch", "flank_wear"),
    ];
    for (a, b) in opposites {
        let pair = vec![form(a, seed), form(b, seed / 2)];
        list.push(spec("opposite-rich-rho1".into(), format!("{a}+{b}"), seed, Mode::Rich, pair, 1.0));
    }
    list
}

/// Effects that are found together often and whose sum says something.
fn together(group: &str, index: usize, seed: u64, mode: Mode, count: usize, rho: f64, dice: &mut Dice) -> CaseSpec {
    let clerks = ["engagement_timing", "recipe_error", "override_delay"];
    let excluded = ["regeneration", "saturation", "stribeck", "ripple_alias"];
    let pool: Vec<&str> = names().into_iter().filter(|n| !clerks.contains(n) && !excluded.contains(n)).collect();
    let mut chosen: Vec<&str> = Vec::new();
    while chosen.len() < count {
        let name = *dice.pick(&pool);
        if !chosen.contains(&name) {
            chosen.push(name);
        }
    }
    let entries = chosen.iter().map(|n| form(n, dice.whole(0, 5) as u64)).collect();
    spec(group.into(), format!("{index}-{}", chosen.join("+")), seed, mode, entries, rho)
}

fn unlisted(seed: u64) -> Vec<CaseSpec> {
    let mut list = Vec::new();
    for (mode, rho) in [(Mode::Rich, 1.0), (Mode::Rich, 0.5), (Mode::Production, 1.0)] {
        for entry in laws::unlisted() {
            let name = entry.form.replace([' ', ','], "_");
            let group = format!("unlisted-{}-rho{rho}", mode.name());
            let mut spec = spec(group, name, seed, mode, vec![entry], rho);
            spec.expect = Expect::Unknown;
            list.push(spec);
        }
    }
    list
}

fn nothing(seed: u64) -> Vec<CaseSpec> {
    let mut list = Vec::new();
    for noise in Noise::ALL {
        for mode in [Mode::Rich, Mode::Production, Mode::Mono, Mode::ClosedLoop] {
            let mut spec = spec(format!("nothing-{}", noise.name()), mode.name().into(), seed, mode, Vec::new(), 1.0);
            (spec.noise, spec.expect) = (noise, Expect::Nothing);
            list.push(spec);
        }
    }
    list
}

/// Not to be told apart by construction.
fn alike(seed: u64) -> Vec<CaseSpec> {
    let one_speed = Needs { one_speed: true, ..Needs::default() };
    let lots_with_tools = Needs { lots_with_tools: true, ..Needs::default() };
    let kinds = [
        ("copper_loss", "one_speed", Mode::Rich, one_speed),
        ("load_loss", "one_speed", Mode::Rich, one_speed),
        ("hardness_batch", "lot_is_edge", Mode::Production, lots_with_tools),
        ("speed_softening", "mono", Mode::Mono, Needs::default()),
        ("field_weakening", "one_speed", Mode::Rich, one_speed),
    ];
    let mut list = Vec::new();
    for (name, why, mode, needs) in kinds {
        let mut spec = spec("alike-by-plan".into(), format!("{name}-{why}"), seed, mode, vec![form(name, seed)], 1.0);
        (spec.needs, spec.expect) = (needs, Expect::Class);
        list.push(spec);
    }
    list
}

/// What the refit of the nominal law swallows: silence is right, and so is a class with the truth in it.
fn absorbed(seed: u64) -> Vec<CaseSpec> {
    let one = |entry: Entry| {
        let mut spec = spec("absorbed".into(), entry.name.into(), seed, Mode::Rich, vec![entry], 0.0);
        spec.expect = Expect::Class;
        spec
    };
    laws::absorbed().into_iter().map(one).collect()
}

/// Effects under spikes, dropouts, zeros and repeats.
fn faulty(seed: u64) -> Vec<CaseSpec> {
    let names =
        ["flank_wear", "hardness_batch", "bearing_warm_up", "auxiliary_switch", "speed_softening", "zero_drift"];
    let one = |name: &&str| {
        let mut spec = spec("faulty-rich-rho1".into(), name.to_string(), seed, Mode::Rich, vec![form(name, seed)], 1.0);
        spec.noise = Noise::Faulty;
        spec
    };
    names.iter().map(one).collect()
}
