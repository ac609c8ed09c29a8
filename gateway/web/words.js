// Every text of the page in both languages. Names of channels, states and reasons come from the gateway itself.
const TEXTS = {
  en: {
    state: "Machine state", for: "for", power: "Power", alarms: "Alarms", gate: "Feed override", sources: "Sources",
    scripts: "Rules", history: "History", channels: "All channels", noAlarm: "No alarm.", connected: "live",
    lost: "connection lost", reconnecting: "connection to the gateway lost; trying again …", program: "Program", tool: "Tool",
    operation: "Operation", part: "Part", simulated: "simulated machine", shadow: "shadow: nothing is written",
    armed: "armed: writing to the machine", off: "off", times: "× real time", maxSpeed: "as fast as possible",
    wanted: "Rules ask for", permitted: "The gate would let through", written: "Written to the machine", nothing: "nothing", noProposal: "nothing is proposed", proposed: "proposed",
    age: "age", estimate: "estimated", readings: "readings", late: "late", failures: "failed polls", period: "every", jitter: "jitter p99",
    trip: "round trip", rows: "samples stored", size: "size on disk", lasts: "At this rate the disk lasts", days: "days",
    since: "since", oldest: "oldest", ticks: "Ticks", lateness: "lateness p99", skipped: "skipped", version: "version",
    parts: "Parts finished", min: "min", h: "h", noData: "No history in this range yet.", lastGood: "the last good version stays in charge",
    spindle_speed_rpm: "Spindle speed", feed_mm_min: "Feed", spindle_power_w: "Spindle power", cutting_power_w: "Cutting power",
    no_load_power_w: "No-load power", feed_override_pct: "Feed override", total_power_w: "Machine power",
    bearing_temperature_c: "Bearing",
    twin: "Simulation beside the machine", expected: "Expected", residual: "Recorded minus expected", learning: "learning what is usual", watching: "watched, usual", differing: "differs",
    regime_standby: "Standstill", regime_idle: "Idling", regime_cutting: "Cutting", regime_moving: "Moving", diagnosing: "Diagnosis under way", diagnosis: "Diagnosis",
    none: "–", meterLag: "Meter lag", window: "averages over", drift: "drift", putBack: "readings put back by", lag: "delay", running: "in charge", waiting: "in charge, waiting for a value", reverted: "failed: the version before it is in charge", suspended: "failed: asks for nothing until it is changed", refused: "refused", because: "because", missing: "no value", decisions: "Latest decisions",
    offset: "Thermal offset", armedBy: "Armed by", until: "until", audit: "Audit", noAudit: "Nothing was asked for or written yet.",
  },
  zh: {
    state: "机床状态", for: "已持续", power: "功率", alarms: "报警", gate: "进给倍率", sources: "数据源",
    scripts: "规则", history: "历史记录", channels: "全部通道", noAlarm: "无报警。", connected: "实时",
    lost: "连接中断", reconnecting: "与网关的连接中断，正在重试……", program: "程序", tool: "刀具",
    operation: "工序", part: "工件", simulated: "模拟机床", shadow: "影子模式：不写入机床",
    armed: "已启用：正在写入机床", off: "关闭", times: "倍速", maxSpeed: "最快速度",
    wanted: "规则请求", permitted: "闸门允许", written: "已写入机床", nothing: "无", noProposal: "无补偿建议", proposed: "建议",
    age: "时延", estimate: "估计值", readings: "读数", late: "迟到", failures: "失败轮询", period: "周期", jitter: "抖动 p99",
    trip: "往返", rows: "已存采样", size: "占用磁盘", lasts: "按此速率磁盘可用", days: "天",
    since: "自", oldest: "最早", ticks: "节拍", lateness: "延迟 p99", skipped: "跳过", version: "版本",
    parts: "已完成工件", min: "分", h: "时", noData: "该时段尚无历史记录。", lastGood: "仍由上一个有效版本控制",
    spindle_speed_rpm: "主轴转速", feed_mm_min: "进给速度", spindle_power_w: "主轴功率", cutting_power_w: "切削功率",
    no_load_power_w: "空载功率", feed_override_pct: "进给倍率", total_power_w: "整机功率", bearing_temperature_c: "轴承温度",
    twin: "仿真对照", expected: "仿真值", residual: "实测减仿真", learning: "正在学习正常范围", watching: "监视中，正常范围", differing: "出现偏差",
    regime_standby: "静止", regime_idle: "空转", regime_cutting: "切削", regime_moving: "轴运动", diagnosing: "正在诊断", diagnosis: "诊断结果",
    none: "–", meterLag: "功率计滞后", window: "平均时间", drift: "漂移", putBack: "已校正", lag: "延迟", running: "生效中", waiting: "生效中，等待数值", reverted: "运行出错：仍由上一版本控制", suspended: "运行出错：修改前不再请求", refused: "未被接受", because: "原因", missing: "无数值", decisions: "最近的决定",
    offset: "热补偿量", armedBy: "允许者", until: "至", audit: "审计记录", noAudit: "尚无请求或写入。",
  },
};

let language = localStorage.getItem("language") ?? document.documentElement.dataset.opens ?? (navigator.language.startsWith("zh") ? "zh" : "en");

export const current = () => language;
export const text = (key) => TEXTS[language][key] ?? key;
/** The text of something that carries `en` and `zh` itself. */
export const own = (thing) => thing?.[language] ?? thing?.en ?? "";

export function setLanguage(next) {
  language = next;
  document.documentElement.lang = next === "zh" ? "zh-CN" : "en";
  for (const element of document.querySelectorAll("[data-text]")) element.textContent = text(element.dataset.text);
}

/** 1234.5 as "1,235", 0.1234 as "0.123": about four figures, never more than the meter gives. */
export function number(value) {
  const size = Math.abs(value);
  const digits = size >= 1000 ? 0 : size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  const shown = value.toFixed(Number.isInteger(value) ? 0 : digits);
  return Number(shown).toLocaleString(language === "zh" ? "zh-CN" : "en-US", { maximumFractionDigits: digits });
}

export function duration(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const two = (n) => String(n).padStart(2, "0");
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  if (h >= 48) return `${Math.floor(h / 24)} ${text("days")}`;
  return h > 0 ? `${h}:${two(m)}:${two(s)}` : `${m}:${two(s)}`;
}

export function bytes(count) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  while (count >= 1000 && unit < 4) { count /= 1000; unit += 1; }
  return `${count.toFixed(unit > 0 && count < 100 ? 1 : 0)} ${units[unit]}`;
}

export const clock = (ms) => new Date(ms).toLocaleTimeString(language === "zh" ? "zh-CN" : "en-GB");
export const dateTime = (ms) =>
  new Date(ms).toLocaleString(language === "zh" ? "zh-CN" : "en-GB", { dateStyle: "medium", timeStyle: "medium" });
