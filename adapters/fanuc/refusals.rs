//! What a control refuses although it answers, in words: one sentence per return code, with everything that it costs.

use super::answer::Refusal;
use super::code::{Consequence, FocasReturnCode};
use super::generation::Generation;
use super::item::{FocasItem, Question};
use super::request;
use super::table::TABLE;
use adapter_core::driver::SourceProblem;
use std::collections::BTreeMap;

/// At most so many items are named in a sentence.
const NAMED: usize = 6;

/// What is wrong. `asked` is how many questions there were; with `essential` they are about what a machine is read for, where a
/// missing option costs more than a detail.
#[must_use]
pub(super) fn list_problems(refusals: &[(Question, Refusal)], asked: usize, essential: bool) -> Vec<SourceProblem> {
    let mut by_code: BTreeMap<i16, Vec<FocasItem>> = BTreeMap::new();
    for (question, refusal) in refusals {
        by_code.entry(refusal.code.0).or_default().push(question.item);
    }
    let of_code = |(code, items): (i16, Vec<FocasItem>)| {
        let code = FocasReturnCode(code);
        is_worth_reporting(code, items.len() * 2 > asked, essential).then(|| describe_refusals(code, &items))
    };
    by_code.into_iter().filter_map(of_code).collect()
}

/// A function that a series does not have is no trouble; an option that is missing is one where it costs motion and states, or
/// most of what is asked; what the state of the machine forbids always is.
fn is_worth_reporting(code: FocasReturnCode, most: bool, essential: bool) -> bool {
    match code.consequence() {
        Consequence::State => true,
        Consequence::NotSupported => most || (essential && code == FocasReturnCode::NOOPT),
        Consequence::Wrong => most,
        Consequence::Again | Consequence::Reconnect => false,
    }
}

fn describe_refusals(code: FocasReturnCode, items: &[FocasItem]) -> SourceProblem {
    let mut names: Vec<String> = Vec::new();
    for name in items.iter().map(|item| name_item(*item)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let more = names.len().saturating_sub(NAMED);
    let mut list = names.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ");
    if more > 0 {
        list.push_str(&format!(" and {more} more"));
    }
    SourceProblem { what: format!("{code}: {list}"), next: code.next().to_owned() }
}

/// What the table of the wire calls an item.
fn name_item(item: FocasItem) -> String {
    if let FocasItem::Pmc(stretch) = item {
        return format!("PMC memory {}{}", stretch.area.letter(), stretch.from);
    }
    let asked = request::build_read_request(item, Generation::Newer(4));
    let row = TABLE.iter().find(|row| row.function == asked.function);
    row.map_or_else(|| format!("{item:?}"), |row| row.name.to_lowercase().replace('_', " "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::item::{BlockWord, Stretch};
    use crate::pmc::Area;

    fn refused(items: &[FocasItem], code: i16) -> Vec<(Question, Refusal)> {
        items.iter().map(|item| (item.to_question(1), Refusal { code: FocasReturnCode(code), detail: 0 })).collect()
    }

    #[test]
    fn one_sentence_per_code_with_what_it_costs() {
        let all = refused(&[FocasItem::Feed, FocasItem::SpindleSpeed, FocasItem::ModalWord(BlockWord::F)], 6);
        let told = list_problems(&all, 20, true);
        assert_eq!(told.len(), 1);
        assert!(
            told[0].what.contains("EW_NOOPT 6") && told[0].what.ends_with("feed, spindle speed, modal word"),
            "{told:?}"
        );
        assert!(list_problems(&all, 20, false).is_empty(), "of a detail");
        assert_eq!(list_problems(&all, 3, false).len(), 1, "of everything");
        let memory = refused(&[FocasItem::Pmc(Stretch::from_byte_range(Area::G, 6, 25))], 7);
        let told = list_problems(&memory, 20, true);
        assert!(told[0].what.contains("EW_PROT 7") && told[0].what.contains("PMC memory G6"), "{told:?}");
    }

    #[test]
    fn what_a_series_does_not_have_and_what_passes_is_no_trouble() {
        assert!(list_problems(&refused(&[FocasItem::Feed], 1), 20, true).is_empty());
        assert!(list_problems(&refused(&[FocasItem::Feed], -1), 1, true).is_empty());
    }
}
