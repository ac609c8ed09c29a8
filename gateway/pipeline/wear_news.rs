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
                    "all tools take {:+.1} % more than before, which is taken for another lot of material; the wear that is believed goes \
                     from {}. If the material is the same, the edges have changed instead",
                    100.0 * change,
                    edges.join(", ")
                ),
            )
        }
        WearNews::LimitByMaterial { edge, wear_mm, material } => (
            "wear_limit_by_material",
            format!(
                "edge {edge} takes more than the limit of the wear model, but is believed to have {wear_mm:.2} mm of wear, far less than its \
                 criterion: harder material ({:+.1} % by all tools), or a cut that takes more than the model says. Look at the edge if \
                 neither is so",
                100.0 * material
            ),
        ),
    };
    Notice::new(Severity::Info, kind, text)
}
