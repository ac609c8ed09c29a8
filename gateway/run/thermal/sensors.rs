//! Tells of temperatures that are not believed, one alarm for each sensor: the compensation goes on without it, or is taken back.

use super::super::health::Health;
use super::super::report::to_milliseconds;
use adapters::ChannelId;
use adapters::clock::{SECOND_NS, TimeNs};
use gateway_history::{Alarm, AlarmClear};
use gateway_status::AlarmStatus;
use rules::estimators::thermal::{DoubtedSensor, SensorFault, SensorWatch};

/// Who writes the events.
pub(super) const SOURCE: &str = "thermal";

/// A sensor that is silent for a moment is none that is lost, ns.
const LOST_NS: i64 = 30 * SECOND_NS;

/// An alarm of a sensor that stands.
#[derive(Debug, Clone)]
struct StandingAlarm {
    code: String,
    since_ns: TimeNs,
    en: String,
    zh: String,
}

/// The alarms of the sensors of the thermal law.
#[derive(Debug, Default)]
pub(super) struct SensorAlarms {
    /// Without a prediction the offset goes back to zero after this time, s.
    hold_s: f64,
    standing: Vec<StandingAlarm>,
}

impl SensorAlarms {
    pub(super) fn new(hold_s: f64) -> Self {
        Self { hold_s, standing: Vec::new() }
    }

    /// Raises and ends alarms by what the watch says now; `sd_um` is the deviation of the prediction, where there is one.
    pub(super) fn follow_watch(
        &mut self,
        at_ns: TimeNs,
        watch: &SensorWatch,
        sensors: &[ChannelId],
        sd_um: Option<f64>,
        health: &mut Health,
    ) {
        let due = |doubted: &&DoubtedSensor| doubted.fault != SensorFault::Lost || at_ns - doubted.since_ns >= LOST_NS;
        let describe = |doubted: &DoubtedSensor| {
            let channel = sensors.get(doubted.sensor)?;
            let text = self.describe_alarm(doubted, channel.name(), sd_um.is_some());
            Some((format!("thermal_sensor_{}", channel.name()), text))
        };
        let doubted: Vec<(String, [String; 2])> =
            watch.list_doubted().iter().filter(due).filter_map(describe).collect();
        self.standing.retain(|alarm| {
            let stays = doubted.iter().any(|(code, text)| *code == alarm.code && text[0] == alarm.en);
            if !stays {
                let (code, source) = (alarm.code.clone(), SOURCE.to_owned());
                health.keep_record(AlarmClear { at_ns, code, source }.into());
            }
            stays
        });
        for (code, [en, zh]) in doubted {
            if self.standing.iter().any(|alarm| alarm.code == code) {
                continue;
            }
            let (source, severity) = (SOURCE.to_owned(), "warning".to_owned());
            let raised = Alarm { at_ns, code: code.clone(), source, severity, en: en.clone(), zh: zh.clone() };
            health.keep_record(raised.into());
            self.standing.push(StandingAlarm { code, since_ns: at_ns, en, zh });
        }
    }

    /// What the operator reads, English and Chinese. It holds no figure that changes while the alarm stands: another text is another alarm.
    fn describe_alarm(&self, doubted: &DoubtedSensor, name: &str, predicts: bool) -> [String; 2] {
        let (what, zh_what) = match doubted.fault {
            SensorFault::Lost => ("gives no value", "无数据"),
            SensorFault::Jumped => ("has changed faster than heat can", "变化快于热过程"),
            SensorFault::Frozen => ("stands still while the others have moved", "停止变化，而其他温度在变"),
            SensorFault::Contradicted => ("is contradicted by the others", "与其他温度矛盾"),
        };
        let (then, zh_then) = if doubted.stand_in_c.is_some() && predicts {
            (
                "the compensation goes on without it, with a temperature from the others; the page Thermal shows the uncertainty"
                    .to_owned(),
                "补偿不再使用该传感器，改用由其他温度推算的值；不确定度见“热误差”页".to_owned(),
            )
        } else {
            (
                format!(
                    "there is no prediction without it: the offset stands, and goes back to 0 after {:.0} s",
                    self.hold_s
                ),
                format!("缺少该温度无法预测：补偿量保持，{:.0} s后回零", self.hold_s),
            )
        };
        [format!("{name} {what}: {then}; look at the sensor"), format!("{name}{zh_what}：{zh_then}；请检查传感器")]
    }

    /// The alarms that stand.
    pub(super) fn list_standing(&self) -> impl Iterator<Item = AlarmStatus> {
        self.standing.iter().map(|alarm| AlarmStatus {
            code: alarm.code.clone(),
            severity: "warning".to_owned(),
            text: alarm.en.clone(),
            zh: alarm.zh.clone(),
            since_ms: to_milliseconds(alarm.since_ns),
        })
    }
}
