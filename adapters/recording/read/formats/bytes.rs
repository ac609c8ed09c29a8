//! Numbers out of bytes, in either order, never beyond the end.

/// A place in a file that is held in memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct ByteReader<'a> {
    pub(super) left: &'a [u8],
    pub(super) is_big: bool,
}

macro_rules! number {
    ($name:ident, $kind:ty) => {
        pub(super) fn $name(&mut self) -> Option<$kind> {
            let bytes = self.take_bytes(size_of::<$kind>())?.try_into().ok()?;
            Some(if self.is_big { <$kind>::from_be_bytes(bytes) } else { <$kind>::from_le_bytes(bytes) })
        }
    };
}

impl<'a> ByteReader<'a> {
    pub(super) fn new(left: &'a [u8], is_big: bool) -> Self {
        Self { left, is_big }
    }

    /// The next bytes; `None` where there are fewer.
    pub(super) fn take_bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, left) = self.left.split_at_checked(count)?;
        self.left = left;
        Some(taken)
    }

    number!(u32, u32);
    number!(u64, u64);
    number!(i64, i64);

    /// A text after its length.
    pub(super) fn read_text(&mut self) -> Option<String> {
        let length = usize::try_from(self.u32()?).ok()?;
        Some(String::from_utf8_lossy(self.take_bytes(length)?).into_owned())
    }
}

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NumberKind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl NumberKind {
    pub(super) fn byte_size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Every number of these bytes.
    #[expect(clippy::cast_precision_loss, reason = "counts of a recording are far below 2^53")]
    pub(super) fn decode_numbers(self, bytes: &[u8], is_big: bool) -> Vec<f64> {
        macro_rules! of {
            ($kind:ty, $convert:expr) => {
                bytes
                    .chunks_exact(size_of::<$kind>())
                    .filter_map(|chunk| chunk.try_into().ok())
                    .map(|chunk| if is_big { <$kind>::from_be_bytes(chunk) } else { <$kind>::from_le_bytes(chunk) })
                    .map($convert)
                    .collect()
            };
        }
        match self {
            Self::I8 => of!(i8, f64::from),
            Self::U8 => of!(u8, f64::from),
            Self::I16 => of!(i16, f64::from),
            Self::U16 => of!(u16, f64::from),
            Self::I32 => of!(i32, f64::from),
            Self::U32 => of!(u32, f64::from),
            Self::I64 => of!(i64, |x| x as f64),
            Self::U64 => of!(u64, |x| x as f64),
            Self::F32 => of!(f32, f64::from),
            Self::F64 => of!(f64, |x| x),
        }
    }
}
