//! Which addresses of a controller may be written. Everything else is refused before it is sent.

use super::focas::FocasError;
use super::item::{Area, Stretch, Write};

/// A stretch of addresses that may be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Allowed {
    /// Bytes of PMC memory, both ends included.
    Memory {
        /// Area of the bytes: R, D or E where the user names it.
        area: Area,
        /// Address of the first byte.
        from: u16,
        /// Address of the last byte, which is included.
        to: u16,
    },
    /// Custom macro variables, both ends included.
    Macros {
        /// Number of the first variable.
        from: u16,
        /// Number of the last variable, which is included.
        to: u16,
    },
    /// The external work offset.
    ExternalOffset,
}

impl Allowed {
    /// `R900`, `R900-R904`, `D10-20`, `#500-#509`, `EXT`. Signals of the machine and of the control (X, F) can never be
    /// written, the interface to the control (G, Y, A, T, K, C) only where the way of writing needs it.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        if text == "EXT" {
            return Some(Self::ExternalOffset);
        }
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        let letter = first.chars().next()?;
        let number = |text: &str| text.trim_start_matches(letter).parse::<u16>().ok();
        let (from, to) = (number(first)?, number(last)?);
        match letter {
            _ if to < from => None,
            '#' => (from >= 100).then_some(Self::Macros { from, to }),
            _ => {
                let area = Area::of_letter(letter).filter(|area| matches!(area, Area::R | Area::D | Area::E))?;
                Some(Self::Memory { area, from, to })
            }
        }
    }

    /// `count` bytes of an area from the address `from`.
    #[must_use]
    pub fn from_byte_range(area: Area, from: u16, count: u16) -> Self {
        let Stretch { from, to, .. } = Stretch::from_byte_range(area, from, count);
        Self::Memory { area, from, to }
    }

    fn covers_write(self, write: &Write) -> bool {
        match (self, write) {
            (Self::Memory { area, from, to }, Write::Pmc { stretch, values }) => {
                let whole = values.len() * usize::from(stretch.width.byte_count()) == stretch.len();
                area == stretch.area && whole && from <= stretch.from && stretch.to <= to && !stretch.is_empty()
            }
            (Self::Macros { from, to }, Write::Macro { number, .. }) => (from..=to).contains(number),
            (Self::ExternalOffset, Write::WorkOffset { number: 0, .. }) => true,
            _ => false,
        }
    }
}

/// Everything that may be written.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AllowList(pub Vec<Allowed>);

impl AllowList {
    /// May this be written?
    ///
    /// # Errors
    /// [`FocasError::NotAllowed`] with the address.
    pub fn check_write(&self, write: &Write) -> Result<(), FocasError> {
        if self.0.iter().any(|allowed| allowed.covers_write(write)) {
            return Ok(());
        }
        Err(FocasError::NotAllowed(format!("{} is not among the addresses that may be written", format_address(write))))
    }
}

/// The address of a write, as a person writes it.
#[must_use]
pub fn format_address(write: &Write) -> String {
    match write {
        Write::Macro { number, .. } => format!("#{number}"),
        Write::Pmc { stretch: Stretch { area, from, to, .. }, .. } if from == to => {
            format!("{}{from}", area.letter())
        }
        Write::Pmc { stretch: Stretch { area, from, to, .. }, .. } => {
            format!("{0}{from}-{0}{to}", area.letter())
        }
        Write::WorkOffset { number: 0, axis, .. } => format!("the external work offset of axis {axis}"),
        Write::WorkOffset { number, axis, .. } => format!("work offset {number} of axis {axis}"),
        Write::ToolOffset { number, kind, .. } => format!("tool offset {number}, value {kind}"),
        Write::PanelSignals { .. } => "the operator's panel".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pmc(area: Area, from: u16, count: u16) -> Write {
        Write::Pmc { stretch: Stretch::from_byte_range(area, from, count), values: vec![0; usize::from(count)] }
    }

    #[test]
    fn addresses_are_read_as_people_write_them() {
        assert_eq!(Allowed::read("R900-R904"), Some(Allowed::from_byte_range(Area::R, 900, 5)));
        assert_eq!(Allowed::read("D10-12"), Some(Allowed::from_byte_range(Area::D, 10, 3)));
        assert_eq!(Allowed::read("#500-#509"), Some(Allowed::Macros { from: 500, to: 509 }));
        assert_eq!(Allowed::read("EXT"), Some(Allowed::ExternalOffset));
        for wrong in ["", "G12", "X1", "F0", "R9-R8", "#5", "R", "R70000", "Ä1"] {
            assert_eq!(Allowed::read(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn only_what_is_listed_may_be_written_and_no_byte_beside_it() {
        let list = AllowList(vec![Allowed::from_byte_range(Area::R, 900, 3), Allowed::Macros { from: 500, to: 500 }]);
        assert!(list.check_write(&pmc(Area::R, 900, 3)).is_ok() && list.check_write(&pmc(Area::R, 901, 1)).is_ok());
        let refused = [
            pmc(Area::R, 899, 2),
            pmc(Area::R, 902, 2),
            pmc(Area::D, 900, 1),
            pmc(Area::G, 12, 1),
            pmc(Area::R, 900, 0),
        ];
        for write in refused {
            assert!(list.check_write(&write).is_err(), "{}", format_address(&write));
        }
        assert!(list.check_write(&Write::Macro { number: 500, mantissa: 1, places: 0 }).is_ok());
        assert!(list.check_write(&Write::Macro { number: 501, mantissa: 1, places: 0 }).is_err());
        assert!(list.check_write(&Write::WorkOffset { number: 0, axis: 1, value: 1 }).is_err());
        let error = list.check_write(&pmc(Area::G, 12, 1)).expect_err("refused");
        assert!(error.to_string().contains("G12") && error.next().contains("allow="));
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[A-Z#]?[0-9]{0,6}(-[A-Z#]?[0-9]{0,6})?|\\PC{0,12}") {
            let _ = Allowed::read(&text);
        }
    }
}
