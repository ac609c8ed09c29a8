"""An NC-Link device as another maker builds one, over paho: a nested model with twelve units, Chinese names, and answers in GBK.

Arguments: PORT SERIAL ENCODING (utf-8 or gbk). Says "ready" when it is subscribed.
"""
import json
import sys

import paho.mqtt.client as mqtt

PORT, SERIAL, ENCODING = int(sys.argv[1]), sys.argv[2], sys.argv[3]

# node number, type, unit, value; the components are nested by hand below
VALUES = {}


def item(number, kind, value, units=None, **more):
    VALUES[number] = value
    entry = {"id": number, "type": kind, **more}
    if units is not None:
        entry["units"] = units
    return entry


def axis(number, letter, screw, motor):
    return {
        "type": "AXIS", "number": number, "id": f"axis{number}", "name": f"{letter}轴",
        "configs": [{"id": f"name{number}", "type": "NAME", "value": letter}],
        "components": [
            {"type": "SCREW", "id": f"screw{number}", "name": "丝杠", "dataItems": screw},
            {"type": "MOTOR", "id": f"motor{number}", "name": "电机", "dataItems": motor},
        ],
    }


MODEL = {
    "type": "NC_LINK_ROOT",
    "name": "车间",
    "devices": [{
        "type": "MACHINE", "id": "m", "name": "立式加工中心", "description": "三号机床",
        "dataItems": [item("m1", "STATUS", "自动运行"), item("m2", "PART_COUNT", "1204", "件")],
        "components": [
            {"type": "CONTROLLER", "id": "c", "name": "数控系统", "dataItems": [
                item("c1", "FEED_SPEED", 20, "mm/s"),
                item("c2", "FEED_OVERRIDE", 95, "%"),
                item("c3", "PROGRAM", "O0100 精铣"),
                item("c4", "WARNING", [{"number": 12, "text": "主轴过热"}]),
                item("c5", "TOOL_NUMBER", 7),
            ], "components": [
                {"type": "CHANNEL", "number": "1", "id": "c6", "dataItems": [item("c61", "SPDL_OVERRIDE", 120, "%")]},
                {"type": "COOLANT", "id": "c7", "name": "冷却", "components": [
                    {"type": "PUMP", "id": "c71", "dataItems": [
                        item("c711", "PRESSURE", 2.5, "MPa"),
                        item("c712", "TEMPERATURE", 77, "°F"),
                        item("c713", "RUN_TIME", 90, "min"),
                    ]},
                ]},
            ]},
            {"type": "PANEL", "id": "p", "dataItems": [item("p1", "SPDL_OVERRIDE", 80, "%")]},
            axis("0", "X", [item("x1", "POSITION", 12345, "μm"), item("x2", "SPEED", 100, "inch/min")],
                 [item("x3", "CURRENT", 1500, "mA")]),
            axis("1", "Y", [item("y1", "POSITION", 1.5, "inch"), item("y2", "SPEED", 2, "m/min")],
                 [item("y3", "CURRENT", 4.5, "A")]),
            axis("2", "Z", [item("z1", "POSITION", 3, "furlong"), item("z2", "SPEED", 250)],
                 [item("z3", "CURRENT", 3, "bar")]),
            {"type": "AXIS", "number": "5", "id": "axis5", "configs": [{"id": "name5", "type": "NAME", "value": "S"}],
             "components": [
                 {"type": "SERVO_DRIVER", "id": "s1", "dataItems": [item("s11", "SPEED", 50, "r/s")]},
                 {"type": "MOTOR", "id": "s2", "dataItems": [
                     item("s21", "SPEED", 314.1592653589793, "rad/s"), item("s22", "CURRENT", 0.012, "kA")]},
             ]},
        ],
    }],
}


def send(client, topic, message):
    client.publish(topic, json.dumps(message, ensure_ascii=False).encode(ENCODING))


def on_message(client, _userdata, message):
    asked = json.loads(message.payload)
    if message.topic.startswith("Probe/"):
        send(client, f"Probe/Query/Response/{SERIAL}", {"@id": asked["@id"], "code": "OK", "probe": MODEL})
        return
    answers = []
    for one in asked["ids"]:
        value = VALUES.get(one["id"])
        if value is None:
            answers.append({"id": one["id"], "code": "NG", "reason": "无此数据"})
        else:
            answers.append({"id": one["id"], "code": "OK", "values": value if isinstance(value, list) else [value]})
    send(client, f"Query/Response/{SERIAL}", {"@id": asked["@id"], "values": answers})


def on_subscribe(*_):
    print("ready", flush=True)


# paho 2 wants to know how the callbacks are called; those here take both ways.
version = getattr(mqtt, "CallbackAPIVersion", None)
client = mqtt.Client(version.VERSION2, "foreign device") if version else mqtt.Client("foreign device")
client.on_message = on_message
client.on_subscribe = on_subscribe
client.connect("127.0.0.1", PORT)
client.subscribe([(f"Probe/Query/Request/{SERIAL}", 0), (f"Query/Request/{SERIAL}", 0)])
client.loop_forever()
