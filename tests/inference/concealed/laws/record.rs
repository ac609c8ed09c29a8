//! Where the record differs from the world: flags that come late, a recipe that states another depth, a feed that
//! follows the command behind time, a feed column that is only the program's.

use crate::concealed::dice::Dice;
use crate::concealed::law::Planted;
use crate::concealed::schedule::Plan;
use crate::concealed::tick::{STEP_S, Tick};

/// The engaged flag (and with it the geometry) comes late or early.
pub(crate) fn engagement_timing(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let late_s = strength * dice.uniform(0.7, 2.2) * dice.sign();
    let steps = (late_s / STEP_S).round() as isize;
    Planted::clerk(move |world, record| {
        for i in 0..world.len() {
            let from = i as isize - steps;
            let source = usize::try_from(from).ok().and_then(|j| world.get(j)).filter(|s| s.run == world[i].run);
            let (tick, was) = (&mut record[i], source.copied().unwrap_or_default());
            tick.engaged = was.engaged;
            if was.engaged {
                tick.depth_mm = was.depth_mm;
                tick.feed_mm_rev = was.feed_mm_rev;
                tick.diameter_mm = was.diameter_mm;
            }
        }
    })
    // How much later than flagged the tool really cuts.
    .with("delay_s", -(steps as f64) * STEP_S)
}

/// The flag passes a debounce of the controller: late on and later off, by times of its own.
pub(crate) fn debounced_flag(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let on_s = strength * dice.uniform(0.8, 1.6);
    let (on, off) = ((on_s / STEP_S) as usize, (on_s * dice.uniform(1.0, 1.5) / STEP_S) as usize);
    Planted::clerk(move |world, record| {
        let (mut counted, mut flag, mut cut) = (0, false, Tick::default());
        for i in 0..world.len() {
            if world[i].engaged {
                cut = world[i];
            }
            counted = if world[i].engaged == flag { 0 } else { counted + 1 };
            if counted > if flag { off } else { on } {
                (flag, counted) = (!flag, 0);
            }
            record[i].engaged = flag;
            if flag && !world[i].engaged {
                (record[i].depth_mm, record[i].feed_mm_rev, record[i].diameter_mm) =
                    (cut.depth_mm, cut.feed_mm_rev, cut.diameter_mm);
            }
        }
    })
}

/// The offset of one operation was edited and the recipe was not: a length is wrong, not a share.
pub(crate) fn edited_offset(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let operation = if plan.mode == crate::concealed::schedule::Mode::Mono { 1 } else { *dice.pick(&[0, 1, 2, 3]) };
    let edit_mm = strength * dice.sign() * dice.uniform(0.06, 0.16);
    Planted::clerk(move |_, record| {
        for tick in record.iter_mut().filter(|t| t.operation == operation) {
            tick.depth_mm = (tick.depth_mm - edit_mm * (tick.depth_mm / (tick.depth_mm + 0.3))).max(0.05);
        }
    })
}

/// The recipe states another depth than the offset table of the CNC makes.
pub(crate) fn wrong_depth(dice: &mut Dice, plan: &Plan, strength: f64) -> Planted {
    let operation = match plan.mode {
        crate::concealed::schedule::Mode::Mono => 1,
        _ => *dice.pick(&[0, 1, 2, 3]),
    };
    let real = 1.0 + strength * dice.sign() * dice.uniform(0.05, 0.12);
    Planted::clerk(move |_, record| {
        record.iter_mut().filter(|t| t.operation == operation).for_each(|t| t.depth_mm /= real);
    })
    .with("gain", real - 1.0)
}

/// The axis follows an override or a command behind time; the record holds the command.
pub(crate) fn override_delay(dice: &mut Dice, _: &Plan, strength: f64) -> Planted {
    let (delay_s, tau_s) = (strength * dice.uniform(0.8, 2.5), dice.uniform(0.4, 1.2));
    Planted::clerk(move |world, record| {
        let steps = (delay_s / STEP_S).round() as usize;
        let mut real = 0.0;
        for i in 0..world.len() {
            let commanded = record[i].commanded_mm_rev;
            let entering = world[i].engaged && (i == 0 || !world[i - 1].engaged);
            let late = record[i.saturating_sub(steps)];
            let target = if late.pass == record[i].pass && late.engaged { late.commanded_mm_rev } else { commanded };
            let before = if late.pass == record[i].pass && late.engaged { target } else { world[i].programmed_mm_rev };
            real =
                if entering { world[i].programmed_mm_rev } else { before + (real - before) * (-STEP_S / tau_s).exp() };
            world[i].feed_mm_rev = if world[i].engaged { real } else { commanded };
        }
    })
}

/// Only the program's feed is recorded, while a controller changes the real one.
pub(crate) fn programmed_feed(_: &mut Dice, _: &Plan, _: f64) -> Planted {
    Planted::clerk(move |_: &mut [Tick], record: &mut [Tick]| {
        record.iter_mut().for_each(|t| t.feed_mm_rev = t.programmed_mm_rev);
    })
}
