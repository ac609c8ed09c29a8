//! The catalogue: every effect the product knows, in the order in which `effects` lists them.

use super::Effect;

macro_rules! catalogue {
    ($($module:ident :: $effect:ident),* $(,)?) => {
        $(pub mod $module;)*
        /// Every effect, in the order in which `effects` lists them.
        pub static CATALOGUE: &[&dyn Effect] = &[$(&$module::$effect),*];
    };
}

catalogue! {
    no_load_power::NoLoadPower,
    cutting_power::CuttingPower,
    load_loss::LoadLoss,
    copper_loss::CopperLoss,
    iron_loss::IronLoss,
    inverter_loss::InverterLoss,
    field_weakening::FieldWeakening,
    gear_stage::GearStage,
    regeneration::Regeneration,
    windage::Windage,
    bearing_warm_up::BearingWarmUp,
    preload_growth::PreloadGrowth,
    spindle_inertia::SpindleInertia,
    dry_friction::DryFriction,
    viscous_friction::ViscousFriction,
    stribeck::Stribeck,
    direction_asymmetry::DirectionAsymmetry,
    axis_friction::AxisFriction,
    axis_inertia::AxisInertia,
    gravity_axis::GravityAxis,
    edge_force::EdgeForce,
    flank_wear::FlankWear,
    speed_softening::SpeedSoftening,
    hardness_batch::HardnessBatch,
    built_up_edge::BuiltUpEdge,
    runout::Runout,
    chatter::Chatter,
    entry_exit::EntryExit,
    depth_taper::DepthTaper,
    chip_thinning::ChipThinning,
    coolant_regime::CoolantRegime,
    auxiliary_switch::AuxiliarySwitch,
    spindle_growth::SpindleGrowth,
    ambient_drift::AmbientDrift,
    coolant_temperature::CoolantTemperature,
    screw_growth::ScrewGrowth,
    offset::Offset,
    zero_drift::ZeroDrift,
    sensor_gain::SensorGain,
    supply_voltage::SupplyVoltage,
    ripple_alias::RippleAlias,
    clock_lag::ClockLag,
    meter_window::MeterWindow,
    saturation::Saturation,
    engagement_timing::EngagementTiming,
    recipe_error::RecipeError,
    constant_load_control::ConstantLoadControl,
    override_delay::OverrideDelay,
}

/// The effect of this kind.
#[must_use]
pub fn find_effect(kind: &str) -> Option<&'static dyn Effect> {
    CATALOGUE.iter().copied().find(|effect| effect.doc().kind == kind)
}

#[cfg(test)]
mod cut_law_tests;
#[cfg(test)]
mod law_tests;
#[cfg(test)]
mod tests;
