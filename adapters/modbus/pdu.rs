//! What is asked and what is answered, whatever carries it.
//!
//! Source: Modbus Application Protocol Specification V1.1b3: 6.3 (03), 6.4 (04), 7 (exceptions).

use adapter_core::integer::convert_bounded;

/// At most so many registers in one answer (6.3).
pub const REGISTERS_MAX: u16 = 125;

/// Which table of registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum RegisterTable {
    /// Holding registers, read by function 3.
    Holding,
    /// Input registers, read by function 4.
    Input,
}

impl RegisterTable {
    /// The function code that reads it.
    #[must_use]
    pub fn function_code(self) -> u8 {
        match self {
            Self::Holding => 3,
            Self::Input => 4,
        }
    }
}

/// A run of registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RegisterBlock {
    /// The table in which they stand.
    pub table: RegisterTable,
    /// Protocol address of the first one, counted from 0.
    pub start: u16,
    /// How many, 1 to 125.
    pub count: u16,
}

impl RegisterBlock {
    /// The request for it.
    #[must_use]
    pub fn encode_request(&self) -> [u8; 5] {
        let ([start_high, start_low], [count_high, count_low]) = (self.start.to_be_bytes(), self.count.to_be_bytes());
        [self.table.function_code(), start_high, start_low, count_high, count_low]
    }

    /// Bytes of the answer without address and check.
    #[must_use]
    pub fn answer_bytes(&self) -> usize {
        2 + 2 * usize::from(self.count)
    }

    /// The registers of an answer.
    ///
    /// # Errors
    /// See [`NoRegisters`].
    pub fn parse_answer(&self, answer: &[u8]) -> Result<Vec<u16>, NoRegisters> {
        match answer {
            [function, code] if *function == self.table.function_code() | 0x80 => Err(NoRegisters::Refused(*code)),
            [function, bytes, data @ ..]
                if *function == self.table.function_code()
                    && usize::from(*bytes) == data.len()
                    && data.len() == 2 * usize::from(self.count) =>
            {
                Ok(data.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect())
            }
            other => Err(NoRegisters::Other(other.len())),
        }
    }

    /// What it asks for, for messages.
    #[must_use]
    pub fn describe_block(&self) -> String {
        let table = if self.table == RegisterTable::Holding { "holding" } else { "input" };
        format!("{} {table} registers from {} (0x{:04X})", self.count, self.start, self.start)
    }
}

/// Why an answer holds no registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoRegisters {
    /// An exception with this code.
    Refused(u8),
    /// An answer of so many bytes to something else.
    Other(usize),
}

/// What an exception code means (7), and what to do about it.
#[must_use]
pub fn describe_exception(code: u8) -> (&'static str, &'static str) {
    match code {
        1 => ("illegal function", "The meter keeps its values in the other table: see registers= in the profile"),
        2 => (
            "illegal data address",
            "None of the registers of the profile exists: choose the profile of this very model",
        ),
        3 => (
            "illegal data value",
            "The meter gives none of the registers of the profile, not even one number at a time",
        ),
        4 => ("device failure", "Look at the meter's own display"),
        6 => ("device busy", "It will be asked again"),
        10 | 11 => {
            ("the gateway does not reach the device", "Check the unit number and the RS-485 side of the gateway")
        }
        _ => ("an exception that is not in the specification", "See the meter's manual"),
    }
}

/// A request as a server understands it.
///
/// # Errors
/// The exception code to answer with.
pub fn parse_request(request: &[u8]) -> Result<RegisterBlock, u8> {
    let table = match request.first() {
        Some(3) => RegisterTable::Holding,
        Some(4) => RegisterTable::Input,
        _ => return Err(1),
    };
    let [_, a, b, c, d] = *request else { return Err(3) };
    let (start, count) = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
    let fits = (1..=REGISTERS_MAX).contains(&count);
    if fits { Ok(RegisterBlock { table, start, count }) } else { Err(3) }
}

/// The answer that carries these registers (at most 125).
#[must_use]
pub fn encode_answer(table: RegisterTable, registers: &[u16]) -> Vec<u8> {
    let bytes = convert_bounded(2 * registers.len(), u8::MAX);
    let mut answer = vec![table.function_code(), bytes];
    answer.extend(registers.iter().flat_map(|register| register.to_be_bytes()));
    answer
}

/// The answer that refuses.
#[must_use]
pub fn encode_refusal(function: u8, code: u8) -> Vec<u8> {
    vec![function | 0x80, code]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_specification() {
        // 6.3: registers 108 to 110 hold 02 2B, 00 00, 00 64.
        let block = RegisterBlock { table: RegisterTable::Holding, start: 0x6B, count: 3 };
        assert_eq!(block.encode_request(), [0x03, 0x00, 0x6B, 0x00, 0x03]);
        let bytes = [0x03, 0x06, 0x02, 0x2B, 0x00, 0x00, 0x00, 0x64];
        assert_eq!(block.parse_answer(&bytes), Ok(vec![0x022B, 0x0000, 0x0064]));
        assert_eq!(parse_request(&block.encode_request()), Ok(block));
        assert_eq!(encode_answer(RegisterTable::Holding, &[0x022B, 0, 0x64]), bytes);
    }

    #[test]
    fn an_exception_and_an_answer_to_something_else_are_no_registers() {
        let block = RegisterBlock { table: RegisterTable::Input, start: 0, count: 2 };
        assert_eq!(block.parse_answer(&[0x84, 2]), Err(NoRegisters::Refused(2)));
        assert_eq!(block.parse_answer(&[0x83, 2]), Err(NoRegisters::Other(2)));
        assert_eq!(block.parse_answer(&[4, 2, 0, 0]), Err(NoRegisters::Other(4)));
        assert_eq!(parse_request(&[6, 0, 0, 0, 1]), Err(1));
        assert_eq!(parse_request(&[3, 0, 0, 0, 126]), Err(3));
    }

    proptest::proptest! {
        #[test]
        fn no_answer_makes_it_panic(bytes in proptest::collection::vec(0_u8.., 0..300), count in 1_u16..126) {
            let _ = RegisterBlock { table: RegisterTable::Input, start: 0, count }.parse_answer(&bytes);
            let _ = parse_request(&bytes);
        }
    }
}
