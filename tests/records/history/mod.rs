//! The history of the box: what goes in comes out, whatever happens in between.

mod clock;
mod damage;
mod earlier;
mod figures;
mod full;
mod killed;
mod machine;
mod questions;
mod round_trip;
mod wear_models;
