// The view "Thermal": temperatures, errors, offsets, the choice of points. Key, English, Chinese.
export const THERMAL = {
  thermal_points: ["Which temperatures predict the error, and why", "用哪些测点预测热误差及原因"],
  chosen: ["chosen", "选用"],
  not_chosen: ["left out", "未选"],
  correlation: ["Correlation", "相关系数"],
  grade: ["Grey grade", "灰色关联度"],
  inflation: ["Variance inflation", "方差膨胀"],
  held_out_error: ["Error in blocks left out", "留出误差"],
  no_thermal_points: [
    "Which ones were chosen and why stands here as soon as a thermal law is learned for this box: `cnc-gateway commission --write`, or `cnc-gateway identify thermal --data-dir {0}`",
    "为本机学习热误差规律后，此处显示测点选择及原因：`cnc-gateway commission --write`，或 `cnc-gateway identify thermal --data-dir {0}`",
  ],
  thermal_now: ["Temperatures now", "当前温度"],
  thermal_offsets: ["Correction of the machine", "对机床的补偿"],
  thermal_error_figure: [
    "Thermal error: how far warmth moves the tool from the work",
    "热误差：温升使刀具偏离工件的距离",
  ],
  thermal_measured: ["measured", "实测"],
  thermal_predicted: ["predicted from the temperatures", "由温度预测"],
  thermal_left: ["measured minus predicted", "实测减预测"],
  last_eight_hours: ["last eight hours", "最近八小时"],
  all_recorded_so_far: ["all that is recorded so far: {0}", "目前全部记录：{0}"],
  temperatures: ["Temperatures", "温度"],
  thermal_collecting: [
    "Collecting: {0} s so far; the figure begins after {1} s.",
    "正在采集：已有{0} s；{1} s后开始绘图。",
  ],
  offset_mode: ["Offsets are", "补偿方式"],
  only_noted: ["only noted", "仅记录"],
  no_proposal: ["nothing proposed", "无建议"],
  proposed: ["proposed {0}", "建议 {0}"],
  no_thermal: [
    "No thermal error was measured or predicted in the last eight hours. It is measured where a probe or a gauge delivers `thermal_error_um`. It is predicted by a law: learn one with `cnc-gateway identify thermal --model FILE` and name the file as `model` under `[thermal]`.",
    "最近八小时没有实测或预测的热误差。实测需测头或千分表提供 `thermal_error_um`；预测需规律：用 `cnc-gateway identify thermal --model FILE` 学习，并在 `[thermal]` 下以 `model` 指定该文件。",
  ],
  no_offsets: [
    "The machine is not corrected: offsets are switched off (`[gate.offset]` in the configuration).",
    "机床未被补偿：补偿功能关闭（配置中的 `[gate.offset]`）。",
  ],
  thermal_words: [
    "Warmth makes the machine grow, so that the tool stands elsewhere than the control believes. The law predicts by how much.",
    "机床受热伸长，刀具位置与数控系统所认为的不同；规律预测其大小。",
  ],
};
