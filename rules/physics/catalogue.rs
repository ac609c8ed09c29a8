//! The catalogue: every effect the product knows, in the order in which `effects` lists them.

use super::Effect;

macro_rules! catalogue {
    ($($module:ident :: $effect:ident),* $(,)?) => {
        $(pub mod $module;)*
        /// Every effect.
        pub static CATALOGUE: &[&dyn Effect] = &[$(&$module::$effect),*];
    };
}

catalogue! {
    offset::Offset,
    dry_friction::DryFriction,
    flank_wear::FlankWear,
}

/// The effect of this kind.
#[must_use]
pub fn effect(kind: &str) -> Option<&'static dyn Effect> {
    CATALOGUE.iter().copied().find(|effect| effect.doc().kind == kind)
}
