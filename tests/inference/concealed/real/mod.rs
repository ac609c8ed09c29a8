//! Real recordings, when they lie beside the checkout.

pub(crate) mod inject;
pub(crate) mod machines;
pub(crate) mod sheet;
mod tanks;
mod wear;

/// The table of the real recordings, or a line that says that they are absent.
pub(crate) fn table() -> String {
    let Some(data) = sheet::folder() else {
        return "SKIPPED: real recordings are not beside this checkout (CNC_GATEWAY_SHARED)".into();
    };
    let mut text = String::from("| real recording | expected | got | right |\n|---|---|---|---|\n");
    for line in machines::lines(&data) {
        let mark = if line.right { "yes" } else { "NO" };
        text += &format!("| {} | {} | {} | {mark} |\n", line.recording, line.expected, line.got);
    }
    text
}
