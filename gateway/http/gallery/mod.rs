//! Three recordings with one hidden cause each, which anyone can have diagnosed on the page in one click; the truth is told afterwards. They were
//! written by `tests/records/recordings/make_gallery.py`, by laws of its own.

use serde_json::{Value, json};

/// A recording with one hidden cause, and the model that lacks it.
#[derive(Debug, Clone, Copy)]
pub struct Example {
    /// Its name in addresses.
    pub name: &'static str,
    /// What it is, in English.
    pub en: &'static str,
    /// The same in Chinese.
    pub zh: &'static str,
    /// The name of its file.
    pub file: &'static str,
    /// The recording as gzipped CSV.
    pub recording: &'static [u8],
    /// The model that lacks the cause.
    pub model: &'static str,
    /// What is hidden, in English.
    pub truth_en: &'static str,
    /// The same in Chinese.
    pub truth_zh: &'static str,
}

/// The examples, each with its recording and model.
pub const EXAMPLES: [Example; 3] = [
    Example {
        name: "turning",
        en: "Turning, 12 parts with three edges: the spindle takes more power than simulated",
        zh: "车削，三个刀刃加工12件：主轴功率高于仿真",
        file: "example turning.csv.gz",
        recording: include_bytes!("turning.csv.gz"),
        model: include_str!("turning.toml"),
        truth_en: "The flank wears: friction on the land grows with the cutting time of each edge and begins anew with the next one. The second edge wears 1.35 times as fast, the third 0.8 times.",
        truth_zh: "后刀面磨损：摩擦随每个刀刃的切削时间增大，换刃后重新开始。第二个刀刃磨损快1.35倍，第三个为0.8倍。",
    },
    Example {
        name: "milling",
        en: "Milling at several feeds per tooth: the law of the cut fits only some of them",
        zh: "多种每齿进给量的铣削：切削公式只符合其中一部分",
        file: "example milling.csv.gz",
        recording: include_bytes!("milling.csv.gz"),
        model: include_str!("milling.toml"),
        truth_en: "A force along the edge that does not depend on the chip: 28 N per mm of edge in the cut, from rubbing and ploughing.",
        truth_zh: "与切屑厚度无关的刃口力：每毫米参与切削的刃长28 N，来自挤压与摩擦。",
    },
    Example {
        name: "axis",
        en: "A feed axis back and forth at four speeds: its motor draws another current than simulated",
        zh: "进给轴以四种速度往复运动：电机电流与仿真不同",
        file: "example axis.csv.gz",
        recording: include_bytes!("axis.csv.gz"),
        model: include_str!("axis.toml"),
        truth_en: "Dry friction: 1.35 A against the motion, the same at every speed. The model knew friction that grows with speed only.",
        truth_zh: "干摩擦：1.35 A阻力电流，与速度无关。模型只含随速度增大的摩擦。",
    },
];

/// The example of this name.
#[must_use]
pub fn find_example(name: &str) -> Option<&'static Example> {
    EXAMPLES.iter().find(|example| example.name == name)
}

/// Why the model of a diagnosis of this file cannot take the place of the one in charge, in both languages; `None` where it is no example.
pub(super) fn describe_refusal(file: &str) -> Option<Value> {
    of_file(file).map(|_| json!({ "en": REFUSED.0, "zh": REFUSED.1 }))
}

/// The same in words.
pub(super) const REFUSED: (&str, &str) =
    ("this is an example: its machine is not this one", "这是示例：其机床不是本机床");

/// The name of the example that a file is.
#[must_use]
pub fn of_file(file: &str) -> Option<&'static str> {
    EXAMPLES.iter().find(|example| example.file == file).map(|example| example.name)
}
