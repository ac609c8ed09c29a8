//! A sentence in both languages of the product.

use std::fmt;

/// English and Chinese, side by side.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Bilingual {
    /// The sentence in English.
    pub en: String,
    /// The sentence in simplified Chinese.
    pub zh: String,
}

impl Bilingual {
    /// Of these two texts.
    #[must_use]
    pub fn new(en: impl Into<String>, zh: impl Into<String>) -> Self {
        Self { en: en.into(), zh: zh.into() }
    }
}

impl fmt::Display for Bilingual {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.en)
    }
}
