//! A tool and its edges. A controller or a recipe that names edges writes the edge behind the tool: `T1-2` is the second edge of
//! `T1`. Scripts, tables and keys of models speak of the tool; the edge is a word of its own.

/// Digits that an edge may have behind its dash; longer ones are part of the tool's name (an order number).
const EDGE_DIGITS_MAX: usize = 4;

/// The tool of a name: `T1` of `T1-2`, and the whole name where it ends in no edge.
#[must_use]
pub fn tool_of(name: &str) -> &str {
    split_edge_number(name).0
}

/// The number of the edge in a name: 2 in `T1-2`; `None` where the name has none.
#[must_use]
pub fn edge_of(name: &str) -> Option<u32> {
    split_edge_number(name).1
}

fn split_edge_number(name: &str) -> (&str, Option<u32>) {
    let Some((tool, edge)) = name.rsplit_once('-') else { return (name, None) };
    let digits = !edge.is_empty() && edge.len() <= EDGE_DIGITS_MAX && edge.bytes().all(|byte| byte.is_ascii_digit());
    match edge.parse() {
        Ok(number) if digits && !tool.is_empty() => (tool, Some(number)),
        _ => (name, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_stands_behind_a_dash() {
        let split =
            ["T1-2", "T1", "T0101-12", "VBMT-160404", "-3", "T1-", "T1-a"].map(|name| (tool_of(name), edge_of(name)));
        let expected = [
            ("T1", Some(2)),
            ("T1", None),
            ("T0101", Some(12)),
            ("VBMT-160404", None),
            ("-3", None),
            ("T1-", None),
            ("T1-a", None),
        ];
        assert_eq!(split, expected);
    }
}
