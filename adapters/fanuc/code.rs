//! Return codes of FOCAS in words: what happened and what to do next. Numbers as in the vendor's `fwlib32.h`.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A return code; 0 is success and never stands here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct FocasReturnCode(pub i16);

/// What follows from a code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Consequence {
    /// The connection is dead; open another.
    Reconnect,
    /// Ask again at the next poll.
    Again,
    /// This control does not have it; do not ask again on this connection.
    NotSupported,
    /// The question is wrong; say so once.
    Wrong,
    /// The state of the machine forbids it now.
    State,
}

struct CodeRow {
    code: i16,
    name: &'static str,
    what: &'static str,
    next: &'static str,
    consequence: Consequence,
}

const fn define_row(
    code: i16,
    name: &'static str,
    consequence: Consequence,
    what: &'static str,
    next: &'static str,
) -> CodeRow {
    CodeRow { code, name, what, next, consequence }
}

use Consequence::{Again, NotSupported, Reconnect, State, Wrong};

const TABLE: [CodeRow; 35] = [
    define_row(
        -17,
        "EW_PROTOCOL",
        Reconnect,
        "the controller's data make no sense",
        "Is something else on this port? Try again; then look at the Ethernet board",
    ),
    define_row(
        -16,
        "EW_SOCKET",
        Reconnect,
        "no connection",
        "Check power, cable, address and port 8193, and that FOCAS2/Ethernet is enabled",
    ),
    define_row(
        -15,
        "EW_NODLL",
        Reconnect,
        "a part of the vendor's library is missing",
        "Put all files of the library into one directory",
    ),
    define_row(-14, "EW_INIERR", Reconnect, "the library could not start", "Start the gateway again"),
    define_row(-13, "EW_ITLOW", Reconnect, "low-speed interrupt of the HSSB", "Start the gateway again"),
    define_row(-12, "EW_ITHIGHT", Reconnect, "high-speed interrupt of the HSSB", "Start the gateway again"),
    define_row(-11, "EW_BUS", Reconnect, "bus error of the HSSB", "Call the machine's maker"),
    define_row(-10, "EW_SYSTEM2", Reconnect, "system error of the library", "Start the gateway again"),
    define_row(-9, "EW_HSSB", Reconnect, "HSSB communication error", "Check the board"),
    define_row(-8, "EW_HANDLE", Reconnect, "the connection is not valid any more", "A new one is opened by itself"),
    define_row(
        -7,
        "EW_VERSION",
        Reconnect,
        "library and controller do not fit",
        "Use a newer library, or backend=native",
    ),
    define_row(-6, "EW_UNEXP", Reconnect, "abnormal library state", "Start the gateway again"),
    define_row(-5, "EW_SYSTEM", Reconnect, "system error of the controller", "Call the machine's maker"),
    define_row(-4, "EW_PARITY", Reconnect, "parity error of the shared memory", "Call the machine's maker"),
    define_row(-3, "EW_MMCSYS", Reconnect, "the installation of the library is incomplete", "Install it again"),
    define_row(-2, "EW_RESET", Again, "reset or stop was pressed", "Nothing; it is asked again"),
    define_row(-1, "EW_BUSY", Again, "the controller is busy", "Nothing; it is asked again"),
    define_row(
        1,
        "EW_FUNC",
        NotSupported,
        "this controller does not have the function",
        "Nothing; the other values go on",
    ),
    define_row(2, "EW_LENGTH", Wrong, "the length does not fit", "Report this with the series of the controller"),
    define_row(3, "EW_NUMBER", Wrong, "the number or range does not exist", "Check the number in the configuration"),
    define_row(4, "EW_ATTRIB", Wrong, "the type does not fit", "Check the address in the configuration"),
    define_row(5, "EW_DATA", Wrong, "the value is not possible there", "Check the value"),
    define_row(
        6,
        "EW_NOOPT",
        NotSupported,
        "the option is missing on this controller",
        "Ask the machine's maker for the option; the other values go on",
    ),
    define_row(
        7,
        "EW_PROT",
        State,
        "protected",
        "Lift the protection on the controller: data protection key or parameter PWE, for PMC memory the protection of the PMC's data",
    ),
    define_row(8, "EW_OVRFLOW", State, "the memory of the controller is full", "Delete programs"),
    define_row(
        9,
        "EW_PARAM",
        Wrong,
        "a parameter of the controller is set wrongly",
        "Compare the parameters of Ethernet and FOCAS2 with the manual",
    ),
    define_row(10, "EW_BUFFER", Again, "a buffer is empty or full", "Nothing; it is asked again"),
    define_row(11, "EW_PATH", Wrong, "there is no such path", "Check path= in the address"),
    define_row(12, "EW_MODE", State, "not possible in this mode", "Choose another mode on the panel"),
    define_row(13, "EW_REJECT", State, "the controller rejects it now", "Wait until the program has ended"),
    define_row(14, "EW_DTSRVR", State, "data server error", "Check the data server"),
    define_row(15, "EW_ALARM", State, "not possible during an alarm", "Clear the alarm on the machine"),
    define_row(16, "EW_STOP", State, "the controller is stopped", "Clear the stop on the machine"),
    define_row(17, "EW_PASSWD", State, "protected by a password", "Unlock it on the controller"),
    define_row(18, "EW_PMC", State, "an error in the PMC", "Look at the PMC alarm screen"),
];

impl FocasReturnCode {
    /// Code -1: the controller is busy.
    pub const BUSY: Self = Self(-1);
    /// Code 1: there is no such function.
    pub const FUNC: Self = Self(1);
    /// Code 2: the length does not fit.
    pub const LENGTH: Self = Self(2);
    /// Code 3: the number or range does not exist.
    pub const NUMBER: Self = Self(3);
    /// Code 4: the type does not fit.
    pub const ATTRIB: Self = Self(4);
    /// Code 5: the value is not possible there.
    pub const DATA: Self = Self(5);
    /// Code 6: the control lacks the option.
    pub const NOOPT: Self = Self(6);
    /// Code 11: there is no such path.
    pub const PATH: Self = Self(11);
    /// Connection lost, as the vendor's library says it.
    pub const SOCKET: Self = Self(-16);

    fn find_row(self) -> Option<&'static CodeRow> {
        TABLE.iter().find(|row| row.code == self.0)
    }

    /// What the vendor calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.find_row().map_or("EW_?", |row| row.name)
    }

    /// What happened, in words, for messages.
    #[must_use]
    pub fn describe_cause(self) -> &'static str {
        self.find_row().map_or("a return code that is in no manual", |row| row.what)
    }

    /// What to do next.
    #[must_use]
    pub fn next(self) -> &'static str {
        self.find_row().map_or("Report this with the series of the controller", |row| row.next)
    }

    /// What follows from it.
    #[must_use]
    pub fn consequence(self) -> Consequence {
        self.find_row().map_or(Wrong, |row| row.consequence)
    }
}

impl fmt::Display for FocasReturnCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({} {})", self.describe_cause(), self.name(), self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_the_header_has_words() {
        for code in (-17..=18).filter(|code| *code != 0) {
            let code = FocasReturnCode(code);
            assert!(code.name().starts_with("EW_") && code.name() != "EW_?", "{code:?}");
            assert!(!code.describe_cause().is_empty() && !code.next().is_empty());
        }
        assert_eq!(FocasReturnCode(99).name(), "EW_?");
    }

    #[test]
    fn what_follows_from_a_code() {
        assert_eq!(FocasReturnCode::SOCKET.consequence(), Reconnect);
        assert_eq!(FocasReturnCode::NOOPT.consequence(), NotSupported);
        assert_eq!(FocasReturnCode(13).consequence(), State);
        assert_eq!(FocasReturnCode::BUSY.consequence(), Again);
    }
}
