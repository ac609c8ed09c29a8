//! Threading and tapping, recognised from the text of NC blocks.
//!
//! A second line of defence beside the word in the channel `operation`: not every driver can tell. The codes of FANUC
//! lathes and mills and of Huazhong are taken together; where a code means a thread on one of them and something
//! harmless on another, it counts as a thread, because holding 100 % is always safe.

/// What the last blocks have said; modal codes stay until another motion replaces them.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct ThreadCycle(Option<Cycle>);

/// What is being cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cycle {
    Threading,
    Tapping,
}

/// G32-G36 threading, G76 threading cycle, G78 and G92 simple threading cycles.
const THREADING: [u32; 8] = [32, 33, 34, 35, 36, 76, 78, 92];
/// G63 tapping mode, G74 left-hand, G84 right-hand, G88 side tapping.
const TAPPING: [u32; 4] = [63, 74, 84, 88];
/// Motions and G64, G80 that end them.
const ENDING: [u32; 6] = [0, 1, 2, 3, 64, 80];

impl ThreadCycle {
    pub(super) fn follow_block(&mut self, block: &str) {
        let mut ended = false;
        let mut begun = None;
        for code in g_codes(block) {
            ended |= ENDING.contains(&code);
            if THREADING.contains(&code) {
                begun = Some(Cycle::Threading);
            } else if TAPPING.contains(&code) {
                begun = Some(Cycle::Tapping);
            }
        }
        if ended || begun.is_some() {
            self.0 = begun;
        }
    }

    /// The cycle that the control is in.
    pub(super) fn active_cycle(self) -> Option<Cycle> {
        self.0
    }
}

/// The numbers behind every G, without decimals (`G84.2` is 84); comments in brackets do not count.
fn g_codes(block: &str) -> impl Iterator<Item = u32> {
    let mut depth = 0_u32;
    let mut bytes = block.bytes().peekable();
    std::iter::from_fn(move || {
        while let Some(byte) = bytes.next() {
            match byte {
                b'(' => depth += 1,
                b')' => depth = depth.saturating_sub(1),
                b'G' | b'g' if depth == 0 => {
                    let mut number = None;
                    while bytes.peek() == Some(&b' ') {
                        bytes.next();
                    }
                    while let Some(digit) = bytes.peek().filter(|byte| byte.is_ascii_digit()) {
                        number =
                            Some(number.unwrap_or(0_u32).saturating_mul(10).saturating_add(u32::from(digit - b'0')));
                        bytes.next();
                    }
                    if number.is_some() {
                        return number;
                    }
                }
                _ => {}
            }
        }
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_found_as_they_are_written() {
        let codes = |block: &str| g_codes(block).collect::<Vec<_>>();
        assert_eq!(codes("N120 G90G84.2 X1. Z-5 (G33 in a comment) g 01"), [90, 84, 1]);
        assert!(codes("M3 S500").is_empty() && codes("G").is_empty());
        assert_eq!(codes("G99999999999999 G1"), [u32::MAX, 1]);
    }

    #[test]
    fn a_cycle_lasts_until_another_motion() {
        let mut cycle = ThreadCycle::default();
        let mut held = |block: &str| {
            cycle.follow_block(block);
            cycle.active_cycle()
        };
        assert_eq!(held("G0 X10"), None);
        assert_eq!(held("G84 X1 Y1 Z-10 R2 F1.25"), Some(Cycle::Tapping));
        assert_eq!(held("X20"), Some(Cycle::Tapping));
        assert_eq!(held("G80"), None);
        assert_eq!(held("N10 G33 Z-20 F1.5"), Some(Cycle::Threading));
        assert_eq!(held("G1 X0"), None);
    }
}
