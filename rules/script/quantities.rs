//! The estimated quantities and figures that a script sees: name, unit, texts, value.

use estimators::loads::Figure;
use estimators::{Estimated, Estimates};

/// Name, name of the standard deviation, unit, texts, value.
pub(super) type QuantityRow =
    (&'static str, &'static str, &'static str, &'static str, &'static str, fn(&Estimates) -> Estimated);

pub(super) const QUANTITIES: [QuantityRow; 11] = [
    (
        "filtered_power_w",
        "filtered_power_sd_w",
        "W",
        "Spindle power after the anti-pulse moving average",
        "滤波后的主轴功率",
        |it| it.filtered_power_w,
    ),
    (
        "no_load_power_w",
        "no_load_power_sd_w",
        "W",
        "Power the spindle would take at this speed without cutting",
        "当前转速下的空载功率",
        |it| it.no_load_power_w,
    ),
    ("cutting_power_w", "cutting_power_sd_w", "W", "Power that removes material", "切削功率", |it| {
        it.cutting_power_w
    }),
    (
        "load_loss_w",
        "load_loss_sd_w",
        "W",
        "Additional loss that exists only under load",
        "附加载荷损耗功率",
        |it| it.load_loss_w,
    ),
    (
        "visible_cutting_power_w",
        "visible_cutting_power_sd_w",
        "W",
        "Least cutting power that stands out of no-load power and noise",
        "可分辨的最小切削功率",
        |it| it.visible_cutting_power_w,
    ),
    (
        "wear_limit_w",
        "wear_limit_sd_w",
        "W",
        "Cutting power at which the edge in use would be worn in this cut, from the library of wear models",
        "当前切削参数下的磨损阈值功率",
        |it| it.wear_limit_w,
    ),
    (
        "tool_wear_mm",
        "tool_wear_sd_mm",
        "mm",
        "Flank wear of the edge in use after its last part; with a learned model of the wear only",
        "当前刀刃的后刀面磨损量（需磨损模型）",
        |it| it.tool_wear_mm,
    ),
    (
        "tool_growth_pct",
        "tool_growth_sd_pct",
        "%",
        "Rise of the cutting power by the wear of the edge in use, at a feed of 0.2 mm/rev; also without a model",
        "磨损引起的切削功率增量（进给量 0.2 mm/r）",
        |it| it.tool_growth_pct,
    ),
    (
        "tool_worn_probability",
        "tool_worn_probability_sd",
        "1",
        "Probability that the edge in use passes its criterion by the end of the next part",
        "当前刀刃在下一件结束前超过磨钝标准的概率",
        |it| it.tool_worn_probability,
    ),
    (
        "tool_parts_left",
        "tool_parts_left_sd",
        "1",
        "Parts until the edge in use passes its criterion",
        "当前刀刃剩余可加工件数",
        |it| it.tool_parts_left,
    ),
    (
        "material_level_pct",
        "material_level_sd_pct",
        "%",
        "By how much the material takes more than usual: what all tools have in common, as with another lot",
        "材料比平常多耗的切削功率（各刀具共同部分）",
        |it| it.material_level_pct,
    ),
];

/// Name, unit, texts, value.
pub(super) type FigureRow = (&'static str, &'static str, &'static str, &'static str, fn(&Estimates) -> Figure);

/// Figures of the load and of the last part, which have no standard deviation of their own.
pub(super) const FIGURES: [FigureRow; 17] = [
    (
        "feed_in_force_pct",
        "%",
        "Feed override in force at the machine, percent of the programmed feed: the greater one of what the control says and of actual \
         over programmed feed",
        "机床当前生效的进给倍率（取数控显示与实际/编程进给之较大者）",
        |it| it.loads.feed_in_force_pct,
    ),
    ("load_share", "1", "Load over the target of constant load, as it is", "当前负荷与目标之比", |it| {
        it.loads.load_share
    }),
    (
        "load_override_pct",
        "%",
        "Feed override that brings the load to the target of constant load: down at once, up only from a steady load; no value where the \
         programmed feed is right",
        "达到目标负荷所需的进给倍率（无需调整时无值）",
        |it| it.loads.load_override_pct,
    ),
    (
        "learned_power_w",
        "W",
        "Cutting power that this place of the program took in the first parts, at the feed in force",
        "程序此处在示教工件中的切削功率（按当前进给换算）",
        |it| it.loads.learned_power_w,
    ),
    (
        "learned_band_w",
        "W",
        "Half width of the band in which unchanged parts vary about learned_power_w",
        "示教功率的允许带（半宽）",
        |it| it.loads.learned_band_w,
    ),
    (
        "learned_peak_w",
        "W",
        "Greatest cutting power of the first parts at this place",
        "程序此处示教工件的最大切削功率",
        |it| it.loads.learned_peak_w,
    ),
    (
        "learned_multiple",
        "1",
        "Cutting power, less two standard deviations, over the greatest of the first parts at this place, in a cut that is under way there; the least of the last samples, twice as many as the power filter has",
        "切削功率（减两倍标准差）与示教最大功率之比；取最近若干采样（功率滤波长度的两倍）中的最小值",
        |it| it.loads.learned_multiple,
    ),
    (
        "learned_air_share",
        "1",
        "Path fed through the air at this place beyond what the first parts did, over half of the cut there (5 s at most): from 1 on the \
         cut is missing",
        "此处空切路径超出示教部分之比：达到 1 即切削缺失",
        |it| it.loads.learned_air_share,
    ),
    (
        "learned_coolant_share",
        "1",
        "Share of the time in the cut at this place in which the coolant ran in the first parts",
        "示教工件在此处切削时冷却液开启的时间比例",
        |it| it.loads.learned_coolant_share,
    ),
    (
        "learned_fall_share",
        "1",
        "By how much the tool in use has suddenly come to take less power than before, on the same work and beside the other tools; 0: it has \
         not; no value before eight parts at learned places show what is usual",
        "当前刀具功率突然下降的比例（0：未下降；学习后八件之前无值）",
        |it| it.loads.learned_fall_share,
    ),
    (
        "learned_visible_fall_share",
        "1",
        "The least sudden fall of the power of the tool in use that would be told, in the middle of a part",
        "当前刀具可察觉的最小功率突降比例",
        |it| it.loads.learned_visible_fall_share,
    ),
    (
        "learned_override_pct",
        "%",
        "Feed override that brings the cutting power back into the learned band; no value inside the band",
        "使切削功率回到示教带内所需的进给倍率（带内无值）",
        |it| it.loads.learned_override_pct,
    ),
    (
        "tool_limit_parts",
        "1",
        "Parts in a row in which the edge in use took more than its limit (wear_limit_w) in every operation that has one",
        "当前刀刃连续超过磨损阈值功率的工件数",
        |it| it.tool_limit_parts,
    ),
    (
        "tool_life_share",
        "1",
        "What the edge in use has cut over what the edges of this tool before it had cut when they were changed; from two of them on",
        "当前刀刃切削量与以往换刀时切削量之比",
        |it| it.tool_life_share,
    ),
    (
        "part_energy_j",
        "J",
        "Energy of the part finished last: of the whole machine where it is measured, else of the spindle",
        "上一工件的能耗",
        |it| it.part.energy_j,
    ),
    (
        "part_cutting_energy_j",
        "J",
        "Energy of the part finished last that removed material",
        "上一工件的切削能耗",
        |it| it.part.cutting_energy_j,
    ),
    (
        "part_idle_s",
        "s",
        "Time in the part finished last in which the spindle turned without cutting",
        "上一工件的空转时间",
        |it| it.part.idle_s,
    ),
];
