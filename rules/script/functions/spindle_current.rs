//! Constant load by the spindle current: curves of a feature over feed, by depth of cut.

use super::{Arguments, Method, MethodParameter, MethodResult, Subject, define_parameter};
use estimators::regression::Refusal;
use estimators::spindle_current::{Cubic, CurveAtDepth, CurveFamily};

pub(super) static SUBJECT: Subject = Subject { en: "Constant load", zh: "恒负荷进给", methods: METHODS };

/// `identify feed-curve --out` writes them.
const CURVES: MethodParameter =
    define_parameter("curves", "[[depth mm, least feed, greatest feed, c0, c1, c2, c3, sd]]");
const FEED: MethodParameter = define_parameter("feed", "that of the curves");
const FEATURE: MethodParameter = define_parameter("feature", "that of the curves");
const DEPTH: MethodParameter = define_parameter("depth_mm", "mm");

static METHODS: &[Method] = &[
    Method {
        name: "feed_curve_depth_mm",
        parameters: &[CURVES, FEED, FEATURE],
        returns: "mm",
        en: "Equivalent depth of cut at which this feed gives this feature; no value outside the curves, as in the air. Wear and hard material look like depth",
        zh: "由进给和特征值反求等效背吃刀量",
        run: |given| {
            Ok(MethodResult::Number(read_family(given)?.infer_depth(given.number(1), given.number(2), 0.0)?.depth_mm))
        },
    },
    Method {
        name: "feed_curve_depth_sd_mm",
        parameters: &[CURVES, FEED, FEATURE, define_parameter("feature_sd", "that of the curves")],
        returns: "mm",
        en: "One standard deviation of that depth, from that of the feature and of the curves",
        zh: "等效背吃刀量的标准不确定度",
        run: |given| {
            Ok(MethodResult::Number(
                read_family(given)?.infer_depth(given.number(1), given.number(2), given.number(3))?.sd_mm,
            ))
        },
    },
    Method {
        name: "feed_curve_feed",
        parameters: &[CURVES, DEPTH, FEATURE],
        returns: "unit of feed of the curves",
        en: "Feed at which a cut of this depth gives the wanted feature; no value below what the spindle takes at the least feed, or beyond the curves",
        zh: "给定背吃刀量下达到目标特征值的进给",
        run: |given| Ok(MethodResult::Number(read_family(given)?.find_feed(given.number(1), given.number(2))?.feed)),
    },
    Method {
        name: "feed_curve_feature",
        parameters: &[CURVES, DEPTH, FEED],
        returns: "unit of the feature of the curves",
        en: "Feature that a cut of this depth gives at this feed; no value outside the curves",
        zh: "给定背吃刀量和进给下的特征值",
        run: |given| {
            let curve = read_family(given)?.interpolate_curve(given.number(1))?;
            check_feed(&curve, given.number(2)).map(|()| MethodResult::Number(curve.evaluate_at(given.number(2))))
        },
    },
];

fn read_family(given: &Arguments<'_>) -> Result<CurveFamily, Refusal> {
    let at = |[depth_mm, feed_min, feed_max, c0, c1, c2, c3, sd]: [f64; 8]| CurveAtDepth {
        depth_mm,
        curve: Cubic { coefficients: [c0, c1, c2, c3], feed_min, feed_max },
        sd,
    };
    CurveFamily::new(given.rows_of::<8>(0)?.into_iter().map(at).collect())
}

fn check_feed(curve: &Cubic, feed: f64) -> Result<(), Refusal> {
    use estimators::regression::RefusalKind::OutOfRange;
    if (curve.feed_min..=curve.feed_max).contains(&feed) {
        return Ok(());
    }
    let what = format!("a feed of {feed} lies outside {} to {}", curve.feed_min, curve.feed_max);
    Err(Refusal::new(OutOfRange, what, "identify the curves over this feed too"))
}
