//! The hidden laws: one file per family, every form with its public name.

mod auxiliary;
mod electric;
mod engagement;
mod material;
mod meters;
mod record;
mod spindle;
mod unlisted;
mod wear;

pub(crate) use electric::KNOWN_INERTIA_KG_M2;

use crate::concealed::law::Entry;
use crate::concealed::schedule::Needs;

const CREEP: Needs = Needs { creep: true, ..NONE };
const SLOW: Needs = Needs { low_cutting_speed: true, ..NONE };
const SHALLOW: Needs = Needs { shallow: true, ..NONE };
const LADDER: Needs = Needs { idle_ladder: true, ..NONE };
const OVERRIDES: Needs = Needs { overrides: true, ..NONE };
const ONE_FEED: Needs = Needs { one_feed: true, ..NONE };
const ONE_SPEED: Needs = Needs { one_speed: true, ..NONE };
const NONE: Needs = Needs {
    creep: false,
    low_cutting_speed: false,
    shallow: false,
    overrides: false,
    one_speed: false,
    one_feed: false,
    lots_with_tools: false,
    idle_ladder: false,
};

/// Effects of the catalogue that a spindle-power recording can show.
pub(crate) fn listed() -> Vec<Entry> {
    [of_the_cut(), of_the_machine(), of_the_record()].concat()
}

fn of_the_cut() -> Vec<Entry> {
    let new = Entry::new;
    vec![
        new("flank_wear", "three stages by cutting minutes", wear::by_time).reach(0.35, 3.0),
        new("flank_wear", "rate by cutting speed and feed", wear::by_speed).reach(0.35, 3.0),
        new("flank_wear", "with chipping", wear::with_chipping).reach(0.35, 3.0),
        new("hardness_batch", "lots with scatter", material::lots).reach(0.4, 1.3),
        new("hardness_batch", "one odd lot", material::one_lot).reach(0.4, 1.3),
        new("speed_softening", "Johnson-Cook in temperature", material::softening_by_temperature).reach(0.4, 1.6),
        new("speed_softening", "smooth step in cutting speed", material::softening_by_step).reach(0.4, 1.6),
        new("built_up_edge", "bump around 35 m/min", material::built_up_edge).needs(SLOW),
        new("built_up_edge", "window with soft borders", material::built_up_window).needs(SLOW),
        new("edge_force", "whole edge with nose", material::edge_force).reach(0.4, 1.8),
        new("edge_force", "rounded edge", material::rounded_edge).reach(0.4, 1.8),
        new("chip_thinning", "arc of the nose radius", material::nose_radius).needs(SHALLOW).reach(0.6, 1.4),
        new("chip_thinning", "mean chip over the edge", material::mean_chip).needs(SHALLOW).reach(0.6, 1.4),
        new("coolant_regime", "dry zone with inertia", material::coolant).reach(0.4, 1.5).columns(&["coolant_on"]),
        new("coolant_regime", "more at low speed", material::coolant_at_low_speed)
            .reach(0.4, 1.5)
            .columns(&["coolant_on"]),
        new("chatter", "stability lobes", material::chatter).reach(0.5, 1.6),
        new("chatter", "one depth, with memory", material::chatter_with_memory).reach(0.5, 1.6),
        new("entry_exit", "squared sine over a chamfer", engagement::soft_entry).reach(0.5, 1.4),
        new("entry_exit", "chamfered front", engagement::chamfer).reach(0.5, 1.4),
        new("depth_taper", "cantilever", engagement::deflection).reach(0.3, 1.6),
        new("depth_taper", "conical and bowed blank", engagement::conical_blank).reach(0.3, 1.4),
    ]
}

fn of_the_machine() -> Vec<Entry> {
    let new = Entry::new;
    vec![
        new("bearing_warm_up", "Walther, two bodies", spindle::warm_up).reach(0.4, 2.2),
        new("bearing_warm_up", "grease by revolutions", spindle::grease_run_in).reach(0.4, 2.2),
        new("preload_growth", "inner ring before housing", spindle::preload).reach(0.4, 2.2),
        new("windage", "exponent 2.7", spindle::windage).needs(LADDER).reach(0.3, 3.0),
        new("windage", "jaws", spindle::windage_of_jaws).needs(LADDER).reach(0.3, 3.0),
        new("spindle_inertia", "one mass", spindle::inertia).reach(0.3, 2.0),
        new("spindle_inertia", "mass by blank", spindle::inertia_of_blanks).reach(0.3, 2.0),
        new("stribeck", "hyperbolic tangent", spindle::stribeck).needs(CREEP).reach(0.5, 1.6),
        new("stribeck", "sticking seal", spindle::sticking_seal).needs(CREEP).reach(0.5, 1.6),
        new("copper_loss", "warming winding", electric::copper).reach(0.3, 2.0),
        new("copper_loss", "magnetising current", electric::magnetised_copper).reach(0.3, 2.0),
        new("load_loss", "power about two", electric::load_loss).reach(0.4, 2.0),
        new("load_loss", "efficiency rises", electric::load_loss_falling).reach(0.4, 1.6),
        new("field_weakening", "field current above base speed", electric::field_weakening).reach(0.4, 2.0),
        new("field_weakening", "rounded hinge", electric::rounded_hinge).reach(0.4, 2.0),
        new("gear_stage", "churning and mesh curve", electric::gear).reach(0.4, 1.8).columns(&["gear_stage"]),
        new("gear_stage", "extra wheel", electric::extra_wheel).reach(0.4, 1.8).columns(&["gear_stage"]),
        new("regeneration", "chopper above a threshold", electric::regeneration).reach(0.5, 1.2),
        new("auxiliary_switch", "pump with inrush", auxiliary::pump).reach(0.3, 2.5),
        new("auxiliary_switch", "conveyor", auxiliary::conveyor).reach(0.3, 2.5),
        new("auxiliary_switch", "extraction from some part on", auxiliary::extraction).reach(0.3, 2.5),
        new("axis_friction", "tangent and bent viscous", auxiliary::axis_friction)
            .reach(0.4, 2.0)
            .columns(&["axis_velocity_mm_min"]),
        new("axis_friction", "wipers", auxiliary::wipers).reach(0.4, 2.0).columns(&["axis_velocity_mm_min"]),
        new("gravity_axis", "ram", auxiliary::gravity).reach(0.4, 2.5).columns(&["z_axis_velocity_mm_min"]),
    ]
}

fn of_the_record() -> Vec<Entry> {
    let new = Entry::new;
    vec![
        new("clock_lag", "drifting clock", meters::lag).reach(0.35, 1.4),
        new("clock_lag", "constant", meters::constant_lag).reach(0.35, 1.2),
        new("meter_window", "two filters", meters::window).reach(0.35, 1.6),
        new("meter_window", "mean of the last seconds", meters::boxcar).reach(0.4, 1.3),
        new("zero_drift", "cabinet temperature", meters::zero_drift).reach(0.4, 2.0),
        new("zero_drift", "warming cabinet", meters::zero_warm_up).reach(0.3, 1.5),
        new("sensor_gain", "step", meters::gain_step).reach(0.4, 1.4),
        new("sensor_gain", "drift", meters::gain_drift).reach(0.4, 1.4),
        new("supply_voltage", "own exponent", meters::supply).reach(0.4, 1.3).columns(&["supply_voltage_v"]),
        new("supply_voltage", "more at idle", meters::supply_of_idle).reach(0.4, 1.3).columns(&["supply_voltage_v"]),
        new("ripple_alias", "wandering line", meters::ripple).reach(0.3, 2.0),
        new("ripple_alias", "constant size", meters::constant_ripple).reach(0.3, 2.5),
        new("saturation", "ceiling", meters::ceiling).reach(0.4, 2.5),
        new("saturation", "soft ceiling", meters::soft_ceiling).reach(0.4, 2.5),
        new("engagement_timing", "flag late or early", record::engagement_timing).reach(0.4, 1.3),
        new("engagement_timing", "debounced", record::debounced_flag).reach(0.4, 1.3),
        new("recipe_error", "depth of one operation", record::wrong_depth).reach(0.5, 1.6).columns(&["operation"]),
        new("recipe_error", "edited offset", record::edited_offset).reach(0.4, 1.6).columns(&["operation"]),
        new("override_delay", "delay and lag", record::override_delay).needs(OVERRIDES).reach(0.6, 1.4),
    ]
}

/// Listed effects that need a recording of another kind than the usual one.
pub(crate) fn special() -> Vec<Entry> {
    vec![
        Entry::new("runout", "once per revolution", material::runout).reach(0.3, 2.0),
        Entry::new("inverter_loss", "bent in the current", electric::inverter).also(&["copper_loss"]).reach(0.3, 2.0),
        Entry::new("constant_load_control", "only the program's feed recorded", record::programmed_feed),
    ]
}

/// Listed effects that the refit of the nominal law takes away almost whole.
pub(crate) fn absorbed() -> Vec<Entry> {
    vec![
        Entry::new("sensor_gain", "always wrong", meters::constant_gain),
        Entry::new("iron_loss", "hysteresis and eddies", electric::iron),
        Entry::new("dry_friction", "constant torque", spindle::coulomb).also(&["viscous_friction", "no_load_power"]),
        Entry::new("edge_force", "rounded edge", material::rounded_edge).needs(ONE_FEED),
        Entry::new("windage", "exponent 2.7", spindle::windage).needs(ONE_SPEED),
    ]
}

/// Physics outside the catalogue.
pub(crate) fn unlisted() -> Vec<Entry> {
    let new = |form, make| Entry::new("unlisted", form, make).reach(0.25, 3.0);
    vec![
        new("resonance peak over speed", unlisted::resonance),
        new("bump after reversal", unlisted::backlash),
        new("door brake", unlisted::door_brake).columns(&["door_open"]),
        new("chip jam bursts", unlisted::chip_jam),
        new("belt slip, fourth power", unlisted::belt_slip),
        new("rocking insert seat", unlisted::rocking_seat),
        new("filling chip tray", unlisted::filling_tray),
        new("lead screw pitch", unlisted::screw_pitch),
        new("whipping bar", unlisted::whipping_bar),
        new("cold insert", unlisted::cold_insert),
    ]
}

/// The listed forms of `name`.
pub(crate) fn named(name: &str) -> Vec<Entry> {
    listed().into_iter().chain(special()).filter(|e| e.name == name).collect()
}
