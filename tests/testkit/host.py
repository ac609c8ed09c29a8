"""A Sparkplug host that is not ours: decodes with pysparkplug what comes over a broker, one JSON line per message.

Arguments: PORT. Standard input: a line "rebirth GROUP NODE" asks that node for its birth, "command GROUP/NODE NAME KIND VALUE"
sends it a metric in an NCMD, "state ONLINE TIMESTAMP" says whether this host is there.
"""

import json
import sys
import threading
import time

import paho.mqtt.client as mqtt
import pysparkplug
from pysparkplug import _protobuf

PROPERTY_FIELDS = {3: "int_value", 10: "double_value", 11: "boolean_value", 12: "string_value"}


def properties(metric):
    names = metric.properties.keys if metric.HasField("properties") else ()
    return {name: getattr(value, PROPERTY_FIELDS[value.type]) for name, value in zip(names, metric.properties.values)}


# Data has no types: they stand in the birth.
TYPES = {}


def show(message):
    topic = message.topic
    kind = topic.split("/")[2]
    decoded = _protobuf.Payload.FromString(message.payload)
    metrics = []
    for raw in decoded.metrics:
        typed = raw.HasField("datatype")
        if typed and raw.HasField("alias"):
            TYPES[raw.alias] = raw.datatype
        elif not typed and raw.alias in TYPES:
            raw.datatype = TYPES[raw.alias]
        metric = pysparkplug.Metric.from_pb(raw)
        metrics.append(
            {
                "name": metric.name,
                "alias": metric.alias,
                "datatype": metric.datatype.name,
                "typed": typed,
                "value": metric.value,
                "null": metric.is_null,
                "historical": metric.is_historical,
                "timestamp": metric.timestamp,
                "properties": properties(raw),
            }
        )
    seq = decoded.seq if decoded.HasField("seq") else None
    shown = {"topic": topic, "kind": kind, "seq": seq, "metrics": metrics, "qos": message.qos, "retain": bool(message.retain)}
    shown["payload"] = message.payload.hex()
    shown["timestamp"] = decoded.timestamp if decoded.HasField("timestamp") else None
    print(json.dumps(shown), flush=True)


def rebirth(client, group, node):
    command = pysparkplug.NCmd(
        timestamp=pysparkplug.get_current_timestamp(),
        metrics=(
            pysparkplug.Metric(
                timestamp=pysparkplug.get_current_timestamp(),
                name="Node Control/Rebirth",
                datatype=pysparkplug.DataType.BOOLEAN,
                value=True,
            ),
        ),
    )
    client.publish(f"spBv1.0/{group}/NCMD/{node}", command.encode(include_dtypes=True), qos=1)


def command(client, node, name, kind, value):
    datatype = pysparkplug.DataType.STRING if kind == "string" else pysparkplug.DataType.DOUBLE
    value = {"double": float, "string": str, "null": lambda _: None}[kind](value)
    now = pysparkplug.get_current_timestamp()
    metric = pysparkplug.Metric(timestamp=now, name=name, datatype=datatype, value=value, is_null=value is None)
    message = pysparkplug.NCmd(timestamp=now, metrics=(metric,))
    group, _, edge = node.partition("/")
    client.publish(f"spBv1.0/{group}/NCMD/{edge}", message.encode(include_dtypes=True), qos=1)


def state(client, online, timestamp):
    says = {"online": online == "true", "timestamp": int(timestamp)}
    client.publish("spBv1.0/STATE/host", json.dumps(says), qos=1, retain=True)


def main():
    # paho-mqtt 2 wants to be told that the callbacks are those of version 1.
    version = [mqtt.CallbackAPIVersion.VERSION1] if hasattr(mqtt, "CallbackAPIVersion") else []
    client = mqtt.Client(*version, client_id="host", clean_session=False)
    topic = "spBv1.0/STATE/host"
    client.will_set(topic, json.dumps({"online": False, "timestamp": 1}), qos=1, retain=True)
    client.on_connect = lambda client, *_: client.subscribe("spBv1.0/+/#", qos=1)
    client.on_subscribe = lambda client, *_: (
        client.publish(topic, json.dumps({"online": True, "timestamp": 1}), qos=1, retain=True),
        print(json.dumps({"kind": "connected"}), flush=True),
    )
    client.on_message = lambda client, _, message: None if "/STATE/" in message.topic else show(message)
    client.reconnect_delay_set(min_delay=1, max_delay=1)
    while True:
        try:
            client.connect("127.0.0.1", int(sys.argv[1]), keepalive=30)
            break
        except OSError:
            time.sleep(0.05)

    def listen():
        for line in sys.stdin:
            what, *words = line.split()
            {"rebirth": rebirth, "command": command, "state": state}[what](client, *words)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        greeted = time.monotonic() + 5
        while client.is_connected() or time.monotonic() < greeted:
            if client.loop(timeout=0.1) != mqtt.MQTT_ERR_SUCCESS:
                break
        try:
            client.reconnect()
        except OSError:
            time.sleep(0.02)


main()
