//! The table in memory, and the look-up.

use std::fmt;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// One stretch of one NC program, and how it cuts.
#[derive(Debug, Clone, PartialEq)]
pub struct Operation {
    /// Name in the process plan.
    pub name: Arc<str>,
    /// NC program, as the controller names it.
    pub program: Arc<str>,
    /// Sequence numbers, both ends included; `None`: every block that no other operation of the program names.
    pub blocks: Option<RangeInclusive<u32>>,
    /// Depth of cut ap, mm.
    pub depth_of_cut_mm: Option<f64>,
    /// Width of cut ae, mm; milling only.
    pub width_of_cut_mm: Option<f64>,
    /// Diameter of the work (turning) or of the tool (milling), mm.
    pub diameter_mm: Option<f64>,
    /// Teeth of the tool; milling only.
    pub teeth: Option<f64>,
    /// Tool of the operation; `None` where the file names none.
    pub tool: Option<Arc<str>>,
    /// Work material; `None` where the file does not say.
    pub work_material: Option<Arc<str>>,
    /// Line of the file, from 1.
    pub line: usize,
    /// What the channel `recipe` says where this operation was used: its name and the version of the table.
    pub mark: Arc<str>,
}

impl Operation {
    /// The number of a quantity by its key.
    #[must_use]
    pub fn find_quantity(&self, key: &str) -> Option<f64> {
        match key {
            "depth_of_cut_mm" => self.depth_of_cut_mm,
            "width_of_cut_mm" => self.width_of_cut_mm,
            "diameter_mm" => self.diameter_mm,
            "teeth" => self.teeth,
            _ => None,
        }
    }

    fn covers_block(&self, block: Option<u32>) -> bool {
        self.blocks.as_ref().is_none_or(|blocks| block.is_some_and(|block| blocks.contains(&block)))
    }
}

/// What the table says of a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lookup<'a> {
    /// The block belongs to this operation.
    Found(&'a Operation),
    /// The controller does not say which program runs.
    ProgramUnknown,
    /// No operation of this program.
    NoProgram,
    /// The program is there; the controller does not say which block runs, and no operation covers all of them.
    BlockUnknown,
    /// The program is there, no operation covers this block.
    NoBlock,
}

impl Lookup<'_> {
    /// Why there is no operation, where there is none.
    #[must_use]
    pub fn explain_missing(&self) -> Option<&'static str> {
        Some(match self {
            Self::Found(_) => return None,
            Self::ProgramUnknown => "the controller does not say which program runs",
            Self::NoProgram => "the recipe has no operation of this program",
            Self::BlockUnknown => {
                "the controller does not say which block runs, and no operation covers the whole program"
            }
            Self::NoBlock => "the recipe has operations of this program, but none covers this block",
        })
    }
}

impl fmt::Display for Lookup<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Found(operation) => f.write_str(&operation.mark),
            other => f.write_str(other.explain_missing().unwrap_or_default()),
        }
    }
}

/// The operations of one machine.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    operations: Vec<Operation>,
    version: Arc<str>,
}

impl Recipe {
    pub(super) fn new(operations: Vec<Operation>, version: Arc<str>) -> Self {
        Self { operations, version }
    }

    /// Every operation, in the order of the file.
    #[must_use]
    pub fn operations(&self) -> &[Operation] {
        &self.operations
    }

    /// Eight hexadecimal digits that change with the text.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The operation of a block. One that names the block goes before one that covers the whole program. Upper and lower
    /// case are one; `block` is a sequence number with or without its N.
    #[must_use]
    pub fn find_operation(&self, program: Option<&str>, block: Option<&str>) -> Lookup<'_> {
        let Some(program) = program.map(str::trim).filter(|program| !program.is_empty()) else {
            return Lookup::ProgramUnknown;
        };
        let block = block.and_then(block_number);
        let mut of_program =
            self.operations.iter().filter(|operation| operation.program.eq_ignore_ascii_case(program)).peekable();
        if of_program.peek().is_none() {
            return Lookup::NoProgram;
        }
        let covering = of_program.filter(|operation| operation.covers_block(block));
        match covering.max_by_key(|operation| operation.blocks.is_some()) {
            Some(operation) => Lookup::Found(operation),
            None if block.is_none() => Lookup::BlockUnknown,
            None => Lookup::NoBlock,
        }
    }
}

/// The sequence number in `N120` or `120`.
#[must_use]
pub fn block_number(block: &str) -> Option<u32> {
    let block = block.trim();
    block.strip_prefix(['N', 'n']).unwrap_or(block).parse().ok()
}
