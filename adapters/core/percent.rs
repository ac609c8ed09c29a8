//! Texts with `%` and two digits in the place of bytes that mean something else where the text stands (RFC 3986, section 2.1).

/// Letters and digits of ASCII and these marks stay; every other byte is escaped.
#[must_use]
pub fn escape_percent(text: &str, marks: &[u8]) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || marks.contains(&byte);
    text.bytes()
        .map(|byte| if is_plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") })
        .collect()
}

/// `%20` and the like as the bytes they stand for; anything else as it is.
#[must_use]
pub fn unescape_percent(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        match after.first_chunk::<2>().filter(|_| first == b'%').and_then(|pair| parse_hex_pair(*pair)) {
            Some(byte) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            None => {
                bytes.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

fn parse_hex_pair(pair: [u8; 2]) -> Option<u8> {
    let digit = |byte: u8| char::from(byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
    Some(digit(pair[0])? * 16 + digit(pair[1])?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_undone_and_stray_percent_signs_kept() {
        assert_eq!(unescape_percent("a%20b%2"), "a b%2");
        assert_eq!(unescape_percent("100%"), "100%");
    }

    #[test]
    fn what_was_escaped_comes_back() {
        let text = "M 1/车 100%~";
        assert_eq!(escape_percent(text, b"-._"), "M%201%2F%E8%BD%A6%20100%25%7E");
        assert_eq!(unescape_percent(&escape_percent(text, b"-._")), text);
    }
}
