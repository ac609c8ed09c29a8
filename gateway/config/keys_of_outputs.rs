//! The rows of the table of keys that concern what leaves the box.

use super::config_key::Absent::{Default, Optional, Required};
use super::config_key::ValueKind::{Flag, Name, Number, SinkAddress, Text};
use super::config_key::{ConfigKey, new_key};

/// Keys of `[[sink]]`, `[sinks]` and `[outbox]`.
pub(super) const OUTPUTS: &[ConfigKey] = &[
    new_key(
        ("sink", "address"),
        SinkAddress,
        Required,
        "Which receiver, and how to reach it: the handbook's chapter on outputs lists the notations",
        "接收端地址",
    ),
    new_key(
        ("sink", "name"),
        Name,
        Optional,
        "Short name in messages; what is delivered is remembered under it; default: the address",
        "接收端名称",
    ),
    new_key(
        ("sink", "allow_requests"),
        Flag,
        Default("false"),
        "Computers on the network of an mqtt or sparkplug sink may ask the gate for a slower feed and acknowledge alarms; the gate decides",
        "允许网络向闸门提出请求",
    ),
    new_key(
        ("sink", "allow_facts"),
        Flag,
        Default("false"),
        "Computers on the network of an mqtt sink may tell orders, scrap, reasons of stops, persons and planned time on PREFIX/fact/add",
        "允许网络在 PREFIX/fact/add 上告知订单、废品、停机原因、人员和计划时间",
    ),
    new_key(
        ("sinks", "drain_s"),
        Number(0.0, 60.0),
        Default("5.0"),
        "When the gateway is stopped, the sinks that are connected may take so long to deliver what waits; the rest follows after the next start",
        "停止时等待发送完成的最长时间（秒）",
    ),
    new_key(
        ("outbox", "every_nth"),
        Number(1.0, 100_000.0),
        Default("1"),
        "Only every so many ticks are sent; whole number",
        "每隔多少个节拍发送一次",
    ),
    new_key(
        ("outbox", "dead_band"),
        Text,
        Optional,
        "A value that differs from the one sent last by at most this is not sent again: \"spindle_power_w=5, feed_mm_min=1\", each in the unit of its name",
        "死区：变化不超过此值时不发送",
    ),
    new_key(
        ("outbox", "ranges"),
        Text,
        Optional,
        "Least and greatest value on this machine, for receivers that draw scales (Sparkplug engLow and engHigh, OPC UA EURange): \"spindle_speed_rpm=0..4500\"",
        "本机的数值范围",
    ),
    new_key(
        ("outbox", "refresh_s"),
        Number(1.0, 86_400.0),
        Default("60.0"),
        "All values are sent this often even if none has changed",
        "全部数值的刷新周期（秒）",
    ),
    new_key(
        ("outbox", "max_gb"),
        Number(0.001, 1000.0),
        Default("1.0"),
        "Size of what waits for the sinks; beyond it the oldest is dropped and counted",
        "待发送数据最大容量（GB）",
    ),
    new_key(
        ("outbox", "max_age_h"),
        Number(0.01, 100_000.0),
        Default("168.0"),
        "What has waited longer than this is dropped and counted",
        "待发送数据最长保留时间（小时）",
    ),
];
