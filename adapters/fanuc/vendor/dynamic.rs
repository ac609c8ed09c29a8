//! The call for the positions of every axis, and what it says besides.

use super::layout::OdbDy2;
use super::structure::{Bytes, scale_decimal};
use crate::answer::FocasAnswer;
use crate::item::{FocasItem, Position};
use std::mem::{offset_of, size_of};

/// What the call for the positions of every axis says besides: it asks for all of this in one frame. `places` are the places
/// after the point of every axis.
pub(super) fn decode_item(item: FocasItem, dynamic: &Bytes, axes_max: usize, places: &[i16]) -> Option<FocasAnswer> {
    let whole = |at| dynamic.read_i32(at);
    let number = |at| FocasAnswer::Number(Some(f64::from(whole(at))));
    Some(match item {
        // Without its unit and decimals: only where `cnc_rdspeed` is not to be had.
        FocasItem::Feed => number(offset_of!(OdbDy2, actf)),
        FocasItem::SpindleSpeed => number(offset_of!(OdbDy2, acts)),
        FocasItem::Sequence => FocasAnswer::Whole(whole(offset_of!(OdbDy2, seqnum))),
        FocasItem::AlarmBits => FocasAnswer::Whole(whole(offset_of!(OdbDy2, alarm))),
        FocasItem::Program => FocasAnswer::Program {
            running: whole(offset_of!(OdbDy2, prgnum)),
            main: whole(offset_of!(OdbDy2, prgmnum)),
        },
        FocasItem::Position(what, -1) => {
            let place = match what {
                Position::Absolute => 0,
                Position::Machine => 1,
                Position::Relative => 2,
                Position::ToGo => 3,
            };
            let at = |axis: usize| size_of::<OdbDy2>() + 4 * (place * axes_max + axis);
            FocasAnswer::Numbers(
                (0..axes_max)
                    .map(|axis| scale_decimal(whole(at(axis)), places.get(axis).copied().unwrap_or(0)))
                    .collect(),
            )
        }
        _ => return None,
    })
}
