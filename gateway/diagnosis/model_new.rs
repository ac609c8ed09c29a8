//! A first model of a machine, with a word about every line: what `model new` writes and the page offers.

use super::series::series_model_text;
use rules::twin::format_toml_text;
use std::fmt::Write as _;

/// Which quantity of which kind of machine the model describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelKind {
    /// Spindle power of a lathe: no load and the cut.
    Lathe,
    /// Spindle power of a milling machine.
    Mill,
    /// Spindle power in drilling.
    Drill,
    /// Current of a feed axis: friction and inertia.
    Axis,
    /// Spindle power without a cut.
    Spindle,
    /// Thermal error of the tool against the work.
    Thermal,
    /// Only the simulated series that is given beside it.
    Series,
}

/// Every kind with its word and what it is, in both languages.
pub const KINDS: [(ModelKind, &str, &str, &str); 7] = [
    (ModelKind::Lathe, "lathe", "spindle power in turning", "车削主轴功率"),
    (ModelKind::Mill, "mill", "spindle power in milling", "铣削主轴功率"),
    (ModelKind::Drill, "drill", "spindle power in drilling", "钻削主轴功率"),
    (ModelKind::Axis, "axis", "current of a feed axis", "进给轴电流"),
    (ModelKind::Spindle, "spindle", "spindle power without a cut", "主轴空载功率"),
    (ModelKind::Thermal, "thermal", "thermal error", "热误差"),
    (ModelKind::Series, "series", "only my simulated series", "仅使用已有仿真序列"),
];

/// Material, specific cutting force kc1.1 in N/mm2 and exponent mc: König and Essel, Spezifische Schnittkraftwerte, 1973, as handbooks print them.
pub const MATERIALS: [(&str, f64, f64); 8] = [
    ("C45", 2220.0, 0.14),
    ("42CrMo4", 2500.0, 0.26),
    ("16MnCr5", 2100.0, 0.26),
    ("C15", 1820.0, 0.22),
    ("X5CrNi18-10", 2350.0, 0.21),
    ("GG25", 1160.0, 0.26),
    ("AlMgSi1", 830.0, 0.23),
    ("Ti6Al4V", 1370.0, 0.21),
];

/// What a first model is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct NewModel {
    /// Which quantity is modelled; decides the effects that the model begins with.
    pub kind: ModelKind,
    /// Name of the machine.
    pub name: String,
    /// The recorded quantity; without it the usual one of the kind.
    pub output: Option<String>,
    /// A row of [`MATERIALS`]; without it steel.
    pub material: Option<String>,
    /// Axis, `x`, `y` or `z`; without it the only one.
    pub axis: Option<String>,
}

/// The words for a line, both languages.
fn write_comment(text: &mut String, en: &str, zh: &str) {
    let _ = write!(text, "# {en}\n# {zh}\n");
}

impl NewModel {
    /// The quantity that it simulates.
    #[must_use]
    pub fn output_name(&self) -> String {
        let usual = match self.kind {
            ModelKind::Axis => format!("{}axis_current_a", self.axis_prefix()),
            ModelKind::Thermal => "thermal_error_um".to_owned(),
            _ => "spindle_power_w".to_owned(),
        };
        self.output.clone().unwrap_or(usual)
    }

    fn axis_prefix(&self) -> String {
        self.axis.as_ref().map_or_else(String::new, |axis| format!("{axis}_"))
    }

    /// The model as text (model/1), with first guesses and comments in both languages.
    #[must_use]
    pub fn to_toml(&self) -> String {
        if self.kind == ModelKind::Series {
            return series_model_text(&self.output_name());
        }
        let mut text = String::new();
        write_comment(
            &mut text,
            "What the simulation believes (model/1). Numbers are first guesses: diagnose refits all but those in `fixed`.",
            "仿真模型（model/1）。数值只是初值：除fixed外，诊断时都会重新拟合。",
        );
        let _ = write!(text, "schema = \"model/1\"\nname = {}\n", format_toml_text(&self.name));
        write_comment(&mut text, "the recorded quantity that is simulated", "被仿真的实测量");
        let _ = write!(text, "output = {}\n\n", format_toml_text(&self.output_name()));
        match self.kind {
            ModelKind::Lathe | ModelKind::Mill | ModelKind::Drill => {
                no_load(&mut text);
                self.write_cut(&mut text);
                write_loss(&mut text);
            }
            ModelKind::Spindle => no_load(&mut text),
            ModelKind::Axis => self.feed_axis(&mut text),
            ModelKind::Thermal => write_thermal(&mut text),
            ModelKind::Series => {}
        }
        text
    }

    fn write_cut(&self, text: &mut String) {
        let (material, kc11, mc) = self
            .material
            .as_deref()
            .and_then(|name| MATERIALS.into_iter().find(|(known, ..)| known.eq_ignore_ascii_case(name)))
            .unwrap_or(MATERIALS[0]);
        let (process, needs, needs_zh) = match self.kind {
            ModelKind::Mill => (
                "process = \"milling\"\n",
                "needs depth_of_cut_mm, width_of_cut_mm, feed_mm_min, diameter_mm of the tool, teeth, engaged",
                "需要depth_of_cut_mm、width_of_cut_mm、feed_mm_min、刀具diameter_mm、teeth、engaged",
            ),
            ModelKind::Drill => (
                "process = \"drilling\"\n",
                "needs diameter_mm of the drill, feed_mm_min, teeth, engaged",
                "需要钻头diameter_mm、feed_mm_min、teeth、engaged",
            ),
            _ => (
                "",
                "needs depth_of_cut_mm, feed_per_rev_mm (or feed_mm_min), diameter_mm of the work, engaged",
                "需要depth_of_cut_mm、feed_per_rev_mm（或feed_mm_min）、工件diameter_mm、engaged",
            ),
        };
        write_comment(
            text,
            &format!("the cut, by Kienzle: specific cutting force kc1.1 and exponent mc of {material}"),
            &format!("切削功率（Kienzle公式）：{material}的单位切削力kc1.1与指数mc"),
        );
        write_comment(text, needs, needs_zh);
        let _ = write!(
            text,
            "[[effect]]\nkind = \"cutting_power\"\n{process}parameters = {{ kc11_n_per_mm2 = {kc11:.1}, mc = {mc} }}\n\n"
        );
    }

    fn feed_axis(&self, text: &mut String) {
        let prefix = self.axis_prefix();
        let (velocity, position) = (format!("{prefix}axis_velocity_mm_min"), format!("{prefix}axis_position_mm"));
        write_comment(
            text,
            "friction that changes sign with the direction, friction that grows with speed, and a constant",
            "随方向变号的摩擦、随速度增大的摩擦和常量",
        );
        let _ = write!(
            text,
            "[[effect]]\nkind = \"linear\"\ncolumns = {{ \"sign({velocity})\" = 1.0, {velocity} = 5e-5, one = 0.0 }}\n\n"
        );
        write_comment(
            text,
            "which column plays which part for the effects that are looked for",
            "各列在候选效应中的角色",
        );
        let _ = write!(text, "[roles]\nvelocity = {velocity:?}\nposition = {position:?}\n");
        if self.axis.as_deref() == Some("z") {
            text.push_str("vertical = \"z\"\n");
        }
    }
}

fn no_load(text: &mut String) {
    write_comment(
        text,
        "the spindle without a cut: p0 + p1 n + p2 n^2, n in rpm; needs spindle_speed_rpm",
        "主轴空载：p0 + p1 n + p2 n^2，n单位rpm；需要spindle_speed_rpm",
    );
    text.push_str("[[effect]]\nkind = \"no_load_power\"\nparameters = { p0_w = 120.0, p1_w_per_rpm = 0.2, p2_w_per_rpm2 = 2e-5 }\n\n");
}

fn write_loss(text: &mut String) {
    write_comment(
        text,
        "what drive and gears lose under the cut, as a share of it; fixed where it is not known apart from kc1.1",
        "驱动与传动在切削时的损耗占比；无法与kc1.1区分时固定",
    );
    text.push_str("[[effect]]\nkind = \"load_loss\"\nparameters = { linear = 0.15, quadratic_per_w = 0.0 }\nfixed = [\"linear\", \"quadratic_per_w\"]\n");
}

fn write_thermal(text: &mut String) {
    write_comment(
        text,
        "growth with the temperatures that are measured, um per K; name the columns that you have",
        "随实测温度的伸长，um/K；请写上已有的温度列",
    );
    text.push_str("[[effect]]\nkind = \"linear\"\ncolumns = { bearing_temperature_c = 1.0, ambient_temperature_c = -1.0, one = 0.0 }\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use rules::twin::parse_model;

    #[test]
    fn every_kind_is_a_model_that_is_read_back() {
        for (kind, word, ..) in KINDS {
            for axis in [None, Some("z".to_owned())] {
                let new = NewModel {
                    kind,
                    name: "CK6136 \"new\"".to_owned(),
                    output: None,
                    material: Some("GG25".to_owned()),
                    axis,
                };
                let model =
                    parse_model(&new.to_toml()).unwrap_or_else(|wrong| panic!("{word}: {wrong:?}\n{}", new.to_toml()));
                assert_eq!(model.output, new.output_name(), "{word}");
                assert!(!model.parts.is_empty());
            }
        }
    }
}
