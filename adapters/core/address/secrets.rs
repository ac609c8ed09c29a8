//! Addresses without secrets: none is taken, and none is repeated in a message.

/// Said of an address that holds a user or a password.
pub const NO_SECRETS: &str = "a user or a password does not stand in an address, because addresses are shown and logged; write \
                              user=NAME and password_file=FILE among its keys, where the receiver asks for them";

/// Keys in the query of an address whose values are masked.
const SECRET: [&str; 5] = ["password", "token", "secret", "key", "passphrase"];

/// Does the body `//USER:PASSWORD@HOST...` of an address name somebody? A path of files may hold an `@`.
pub(super) fn names_somebody(body: &str) -> bool {
    body.strip_prefix("//").is_some_and(|rest| !rest.starts_with('/') && rest.contains('@'))
}

/// The text with stars in the place of what stands before `@`, and of what a key of a secret holds. Names of files stay.
#[must_use]
pub fn mask_secrets(text: &str) -> String {
    let (before, query) = text.split_once('?').unwrap_or((text, ""));
    let mut told = without_user(before);
    let hidden = |pair: &str| match pair.split_once('=') {
        // The private key of TLS is named by its file.
        Some(("key", file)) if file.contains('/') => pair.to_owned(),
        Some((key, _)) if SECRET.contains(&key) => format!("{key}=***"),
        _ => pair.to_owned(),
    };
    if text.contains('?') {
        told.push('?');
        told.push_str(&query.split('&').map(hidden).collect::<Vec<_>>().join("&"));
    }
    told
}

/// A password may hold a slash or an `@`: everything before the last `@` is hidden, unless a path begins there.
fn without_user(before: &str) -> String {
    let Some((scheme, rest)) = before.split_once(':') else { return before.to_owned() };
    let slashes = if rest.starts_with("//") { "//" } else { "" };
    let place = &rest[slashes.len()..];
    match place.rsplit_once('@') {
        Some((_, host)) if !place.starts_with('/') => format!("{scheme}:{slashes}***@{host}"),
        _ => before.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_could_be_a_secret_is_masked() {
        assert_eq!(
            mask_secrets("mqtt://user:wo/rd@broker:1883/plant?password=x/y&qos=1"),
            "mqtt://***@broker:1883/plant?password=***&qos=1"
        );
        assert_eq!(mask_secrets("modbus-tcp:b:word@meter"), "modbus-tcp:***@meter");
        assert_eq!(
            mask_secrets("nclinks://broker/S?password_file=/etc/pw&key=/etc/box.key"),
            "nclinks://broker/S?password_file=/etc/pw&key=/etc/box.key"
        );
        assert_eq!(mask_secrets("replay:/data/a@b.csv"), "replay:/data/a@b.csv");
        assert_eq!(mask_secrets("127.0.0.1:8080"), "127.0.0.1:8080");
    }
}
