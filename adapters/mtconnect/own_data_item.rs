//! What the user can have read of a device: any data item that is a value, by its identifier or name.

use adapter_core::own::OwnRead;

/// A data item of a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnDataItem {
    /// Its identifier, or its name where only one has it.
    pub word: String,
}

impl OwnRead for OwnDataItem {
    const EXAMPLES: &'static str =
        "the identifier of a data item as `doctor --all` lists it, or its name, for example `Xload`";

    fn parse(text: &str) -> Option<Self> {
        let mut words = text.split_whitespace();
        let word = words.next()?.to_owned();
        words.next().is_none().then_some(Self { word })
    }

    fn is_text(&self) -> Option<bool> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_read() {
        assert_eq!(OwnDataItem::read(" Xload ").map(|item| item.word), Ok("Xload".to_owned()));
        for wrong in ["", "X load"] {
            assert!(OwnDataItem::read(wrong).is_err_and(|why| why.to_string().contains("doctor --all")), "{wrong}");
        }
    }
}
