//! What the follower of the wear tells once, as a notice for the log and the history.

use gateway_base::log::{Notice, Severity};
use rules::estimators::wear::WearNews;

pub(super) fn describe_news(news: &WearNews) -> Notice {
    let (kind, text) = match news {
        WearNews::NotObservable { edge } => (
            "wear_not_observable",
            format!(
                "the wear of edge {edge} is not known well enough to be acted upon; further parts, a new edge or a wear model for \
                 these cuts (identify tool-wear) make it known again"
            ),
        ),
        WearNews::Observable { edge } => ("wear_observable", format!("the wear of edge {edge} is known well enough")),
        WearNews::NewEdge { tool } => (
            "wear_new_edge",
            format!("the cutting power of tool {tool} fell as with a new edge: its wear is counted from there"),
        ),
        WearNews::OtherMaterial { change, edges } => {
            let of = |(edge, before, after): &(String, f64, f64)| format!("{edge} {before:.3} to {after:.3} mm");
            let edges: Vec<String> = edges.iter().map(of).collect();
            (
                "wear_other_material",
                format!(
                    "all tools take {} than before, which is taken for another lot of material; the wear that is believed goes \
                     from {}. If the material is the same, the edges have changed instead",
                    describe_change(*change),
                    edges.join(", ")
                ),
            )
        }
        WearNews::LimitByMaterial { edge, wear_mm, material } => (
            "wear_limit_by_material",
            format!(
                "edge {edge} takes more than the limit of the wear model, but is believed to have {wear_mm:.2} mm of wear, far less than its \
                 criterion: harder material (all tools take {} than usual), or a cut that takes more than the model says. Look at the \
                 edge if neither is so",
                describe_change(*material)
            ),
        ),
    };
    Notice::new(Severity::Info, kind, text)
}

/// A change as a share, in words that say which way it goes.
fn describe_change(share: f64) -> String {
    let way = if share < 0.0 { "less" } else { "more" };
    format!("{:.1} % {way}", 100.0 * share.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No change is written with a sign beside a word that says the same, or the contrary.
    #[test]
    fn every_change_is_told_the_way_it_goes() {
        for share in (-500..=500).map(|it| f64::from(it) / 1000.0) {
            let edges = vec![("T1".to_owned(), 0.1, 0.2)];
            for news in [
                WearNews::OtherMaterial { change: share, edges },
                WearNews::LimitByMaterial { edge: "T1".to_owned(), wear_mm: 0.1, material: share },
            ] {
                let text = describe_news(&news).operator;
                let way = if share < 0.0 { "less" } else { "more" };
                let told = format!("all tools take {:.1} % {way} than", 100.0 * share.abs());
                assert!(text.contains(&told) && !text.contains("+") && !text.contains(" -"), "{share}: {text}");
            }
        }
    }
}
