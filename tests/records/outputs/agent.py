"""An MTConnect agent that is not ours (PyPI mtconnect): reads devices.xml, takes the lines of an adapter, prints what it knows.

Arguments: DEVICES_XML PORT SECONDS. Prints one JSON document: the values of the agent by data item, everything that was
pushed with its time, unknown names, the answer to a ping, and assets.
"""

import json
import socket
import sys
import time

# The agent was written for a Python whose elements had `getchildren`; the class in Python can be given it back.
sys.modules["_elementtree"] = None
from xml.etree import ElementTree  # noqa: E402

ElementTree.Element.getchildren = lambda element: list(element)

from mtconnect.agent import MTConnect  # noqa: E402


def plain(devices):
    """This agent reads the devices alone, without namespaces."""
    root = ElementTree.parse(devices).getroot()
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    ElementTree.ElementTree(root.find("Devices")).write(devices + ".plain")
    return devices + ".plain"


def main():
    devices, port, seconds = plain(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    agent = MTConnect(loc=devices, hostname="http://127.0.0.1:5000")
    # Lines have names; this agent wants the identifiers, which begin with the digits of the box.
    ids = {item.name: item.id for item in agent.item_dict.values()}
    known = set(ids)
    line = socket.create_connection(("127.0.0.1", port), timeout=10)
    line.sendall(b"* PING\r\n")
    heard, pushed, unknown, conditions, assets, pong = b"", [], [], [], [], None
    until = time.monotonic() + seconds
    line.settimeout(0.2)
    while time.monotonic() < until:
        try:
            part = line.recv(65536)
        except TimeoutError:
            continue
        if not part:
            break
        heard += part
    for text in heard.decode().split("\n")[:-1]:
        if text.startswith("* PONG"):
            pong = text
        if text.startswith("*") or not text:
            continue
        at, *cells = text.split("|")
        if cells[0] == "@ASSET@":
            assets.append({"id": cells[1], "type": cells[2], "root": ElementTree.fromstring(cells[3]).tag})
            continue
        if cells[0] in known and agent.item_dict[ids[cells[0]]].category == "CONDITION":
            conditions.append({"at": at, "name": cells[0], "level": cells[1], "code": cells[2], "text": cells[-1]})
            agent.push_data(ids[cells[0]], cells[1])
            continue
        for name, value in zip(cells[::2], cells[1::2]):
            if name not in known:
                unknown.append(name)
                continue
            sample = agent.item_dict[ids[name]].category == "SAMPLE" and value != "UNAVAILABLE"
            agent.push_data(ids[name], float(value) if sample else value)
            pushed.append([name, at, value])
    current = ElementTree.fromstring(agent.current().get_xml())
    names = {identifier: name for name, identifier in ids.items()}
    values = {names[entry.get("dataItemId")]: entry.text for entry in current.iter() if entry.get("dataItemId")}
    print(
        json.dumps(
            {
                "known": sorted(known),
                "values": values,
                "pushed": pushed,
                "unknown": unknown,
                "conditions": conditions,
                "assets": assets,
                "pong": pong,
            }
        )
    )


main()
