"""A client of OPC UA that is not ours (PyPI asyncua). Prints one JSON document.

make DIRECTORY NAME [DAYS]: a certificate for a client; it began 400 days ago and is valid for DAYS of them (4000).
try URL DIRECTORY NAME [USER PASSWORD]: connects, and says what the server said.
plain URL: the same without security.
look URL DIRECTORY NAME USER PASSWORD SECONDS: browses the machine, reads every value, listens for so long, tries to write.
"""

import asyncio
import calendar
import datetime
import json
import logging
import sys

from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

logging.disable(logging.CRITICAL)
MACHINE_TOOL = "http://opcfoundation.org/UA/MachineTool/"
MACHINERY = "http://opcfoundation.org/UA/Machinery/"
DEVICES = "http://opcfoundation.org/UA/DI/"
LISTENED = ("spindle_speed_rpm", "spindle_power_w", "total_power_w", "feed_mm_min")


def uri(name):
    return f"urn:example:{name}"


def make(directory, name, days="4000"):
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    began = datetime.datetime.now() - datetime.timedelta(days=400)
    usage = x509.KeyUsage(True, True, True, True, False, True, False, False, False)
    names = [x509.UniformResourceIdentifier(uri(name)), x509.DNSName("localhost")]
    builder = x509.CertificateBuilder(subject, subject, key.public_key(), x509.random_serial_number(), began)
    builder = builder.not_valid_after(began + datetime.timedelta(days=int(days)))
    builder = builder.add_extension(x509.SubjectAlternativeName(names), False).add_extension(usage, True)
    builder = builder.add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH]), False)
    with open(f"{directory}/{name}.der", "wb") as file:
        file.write(builder.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.DER))
    with open(f"{directory}/{name}.pem", "wb") as file:
        plain = serialization.NoEncryption()
        file.write(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, plain))
    return {"made": name}


async def client(url, directory, name, user=None, password=None):
    made = Client(url, timeout=10)
    made.application_uri = uri(name)
    if user:
        made.set_user(user)
        made.set_password(password)
    await made.set_security(
        SecurityPolicyBasic256Sha256,
        certificate=f"{directory}/{name}.der",
        private_key=f"{directory}/{name}.pem",
        mode=ua.MessageSecurityMode.SignAndEncrypt,
    )
    return made


async def attempt(made):
    """What the server says to it."""
    try:
        async with made:
            await made.nodes.server.get_children()
        return {"connected": True}
    except Exception as error:  # noqa: BLE001: what it is, is the result
        return {"connected": False, "error": f"{type(error).__name__} {error}"}


def milliseconds(moment):
    return calendar.timegm(moment.timetuple()) * 1000 + moment.microsecond // 1000


def shown(value):
    plain = value.Value.Value if value.Value is not None else None
    if isinstance(plain, ua.LocalizedText):
        plain = plain.Text
    at = milliseconds(value.SourceTimestamp) if value.SourceTimestamp else None
    return {"value": plain, "status": value.StatusCode.name, "at_ms": at}


class Listener:
    """Keeps every change and every event that the server sends."""

    def __init__(self, names):
        self.names, self.changes, self.events = names, [], []

    def event_notification(self, event):
        told = {name: getattr(event, name) for name in ("Identifier", "Severity", "SourceName")}
        self.events.append(told | {"text": event.Message.Text, "type": event.EventType.Identifier})

    def datachange_notification(self, node, _value, data):
        entry = shown(data.monitored_item.Value)
        self.changes.append([self.names[node.nodeid], entry["at_ms"], entry["value"]])


async def walk(node, path, spaces, found):
    """Everything below it: path without namespaces, class, type, namespace of the name."""
    for child in await node.get_children():
        name = await child.read_browse_name()
        kind = await child.read_type_definition()
        below = f"{path}/{name.Name}".lstrip("/")
        found[below] = {
            "node": child,
            "space": spaces[name.NamespaceIndex],
            "type": [spaces[kind.NamespaceIndex], kind.Identifier],
            "class": (await child.read_node_class()).name,
        }
        await walk(child, below, spaces, found)


async def refused_writes(nodes):
    said = set()
    for node in nodes:
        value = ua.DataValue(ua.Variant(1.0, ua.VariantType.Double))
        attribute = ua.WriteValue(NodeId=node.nodeid, AttributeId=ua.AttributeIds.Value, Value=value)
        results = await node.session.write(ua.WriteParameters(NodesToWrite=[attribute]))
        said.update(result.name for result in results)
    return sorted(said)


async def look(url, directory, name, user, password, seconds):
    async with await client(url, directory, name, user, password) as made:
        spaces = await made.get_namespace_array()
        numbers = [spaces.index(space) for space in (MACHINERY, MACHINE_TOOL, DEVICES)]
        machines = await made.nodes.objects.get_child([f"{numbers[0]}:Machines"])
        machine = (await machines.get_children())[0]
        found = {}
        await walk(machine, "", spaces, found)
        kind = await machine.read_type_definition()
        variables = {path: entry for path, entry in found.items() if entry["class"] == "Variable"}
        values = await made.uaclient.read_attributes(
            [entry["node"].nodeid for entry in variables.values()], ua.AttributeIds.Value
        )
        units = {}
        for path, entry in variables.items():
            if path.endswith("/EngineeringUnits"):
                unit = await entry["node"].read_value()
                units[path.removesuffix("/EngineeringUnits")] = [unit.DisplayName.Text, unit.UnitId]
        listened = {variables[f"Values/{name}"]["node"].nodeid: name for name in LISTENED}
        listener = Listener(listened)
        subscription = await made.create_subscription(100, listener)
        nodes = [made.get_node(node) for node in listened]
        await subscription.subscribe_data_change(nodes, queuesize=100)
        messages = found["Notification/Messages"]["node"]
        own = made.get_node(ua.NodeId("GatewayMessageEventType", spaces.index("urn:cnc-gateway:machine")))
        await subscription.subscribe_events(messages, own)
        await asyncio.sleep(float(seconds))
        await subscription.delete()
        refused = await refused_writes([entry["node"] for entry in variables.values()])
        return {
            "machine": (await machine.read_browse_name()).Name,
            "type": [spaces[kind.NamespaceIndex], kind.Identifier],
            "nodes": {path: {k: v for k, v in entry.items() if k != "node"} for path, entry in found.items()},
            "values": {path: shown(value) for path, value in zip(variables, values)},
            "units": units,
            "changes": listener.changes,
            "events": listener.events,
            "writes": refused,
            "methods": [path for path, entry in found.items() if entry["class"] == "Method"],
        }


async def main(what, *rest):
    if what == "make":
        return make(*rest)
    if what == "try":
        return await attempt(await client(*rest))
    if what == "plain":
        return await attempt(Client(rest[0], timeout=10))
    return await look(*rest)


print(json.dumps(asyncio.run(main(*sys.argv[1:])), default=str))
