//! What stands between two cells of a text: found in the file, or said by a map.

use adapter_core::bilingual::Bilingual;

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    /// This character.
    Sign(u8),
    /// Any number of spaces or tabs.
    Space,
}

impl Separator {
    pub(super) fn to_bilingual(self) -> Bilingual {
        match self {
            Self::Sign(b',') => Bilingual::new("comma", "逗号分隔"),
            Self::Sign(b';') => Bilingual::new("semicolon", "分号分隔"),
            Self::Sign(b'\t') => Bilingual::new("tab", "制表符分隔"),
            Self::Sign(b'|') => Bilingual::new("bar |", "竖线分隔"),
            Self::Sign(other) => {
                let other = char::from(other);
                Bilingual::new(format!("separator {other}"), format!("分隔符{other}"))
            }
            Self::Space => Bilingual::new("spaces between the columns", "空格分隔"),
        }
    }

    /// From the text of a map; `None`: no separator.
    pub(super) fn from_text(text: &str) -> Option<Self> {
        match text {
            "space" | " " => Some(Self::Space),
            "tab" => Some(Self::Sign(b'\t')),
            _ => text
                .as_bytes()
                .first()
                .copied()
                .filter(|byte| text.len() == 1 && byte.is_ascii_punctuation() || *byte == b'\t')
                .map(Self::Sign),
        }
    }
}
