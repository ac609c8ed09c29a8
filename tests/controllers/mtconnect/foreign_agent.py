"""An MTConnect agent whose buffer and documents are not ours (PyPI mtconnect), behind a plain HTTP server.

Arguments: DEVICES_XML PORT BUFFER_SIZE [bare]. Says `ready` once it listens. Every line of standard input is a JSON list of pairs
[identifier, value] that are observed at once; it is answered with the number of the newest observation.

The library makes devices, buffer, numbers and documents. It has no server and leaves the numbers out of the head of a document; both are
added here as the standard wants it (`bare`: the numbers stay out, and no answer comes in parts).
"""

import json
import os
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlparse

sys.modules["_elementtree"] = None
from xml.etree import ElementTree  # noqa: E402

# The agent was written for a Python whose elements had `getchildren`.
ElementTree.Element.getchildren = lambda element: list(element)

DEVICES, PORT, BARE = sys.argv[1], int(sys.argv[2]), "bare" in sys.argv[4:]
os.environ["BUFFER_SIZE"] = sys.argv[3]

from mtconnect.agent import MTConnect  # noqa: E402

agent = MTConnect(loc=DEVICES, hostname="http://127.0.0.1")
guard = threading.Lock()
NAMES = {device.name for device in agent.get_device_list()}


def with_numbers(document, following):
    """The document of the library with the numbers that its head lacks."""
    root = ElementTree.fromstring(document)
    head = root.find("Header")
    if not BARE:
        head.set("firstSequence", str(agent.buffer.first_sequence))
        head.set("lastSequence", str(agent.buffer.last_sequence))
        head.set("nextSequence", str(following))
    return ElementTree.tostring(root)


def sample(start, count):
    """Observations from a number on. The library's own `sample` leaves the first one out; the rest is its way."""
    found = {}
    for item in agent.get_item_list():
        of_device = found.setdefault(item.device, {}).setdefault(item.parent_component, {})
        of_device.setdefault(item.category, []).append(item.get_data(start - 1, start - 1 + count))
    root = ElementTree.Element("MTConnectStreams")
    root.append(agent.get_header())
    root.append(agent.format_stream_xml(found))
    following = min(start + count, agent.buffer.last_sequence + 1)
    return with_numbers(ElementTree.tostring(root), following), following


def refuse(code, text):
    root = ElementTree.Element("MTConnectError")
    root.append(agent.get_header())
    error = ElementTree.SubElement(ElementTree.SubElement(root, "Errors"), "Error", {"errorCode": code})
    error.text = text
    return ElementTree.tostring(root)


class Server(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def send_document(self, body, status=200):
        self.send_response(status)
        self.send_header("Content-Type", "text/xml")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)
        self.close_connection = True

    def do_GET(self):
        url = urlparse(self.path)
        words = [unquote(word) for word in url.path.split("/") if word]
        query = {name: int(values[0]) for name, values in parse_qs(url.query).items()}
        if len(words) == 2 and words[0] not in NAMES:
            return self.send_document(refuse("NO_DEVICE", f"no {words[0]}"), 404)
        with guard:
            if words[-1] == "probe":
                return self.send_document(agent.probe().get_xml().encode())
            if words[-1] == "current":
                body = agent.current().get_xml()
                return self.send_document(with_numbers(body, agent.buffer.last_sequence + 1))
            start = query.get("from", agent.buffer.first_sequence)
            too_old = start < agent.buffer.first_sequence
        if too_old:
            return self.send_document(refuse("OUT_OF_RANGE", "from is too small"), 404)
        if BARE or "interval" not in query:
            with guard:
                body, _ = sample(start, query.get("count", 100))
            return self.send_document(body)
        return self.send_parts(start, query.get("count", 100), query["interval"] / 1000)

    def send_parts(self, start, count, interval):
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace;boundary=0f1e2d3c")
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        while True:
            with guard:
                if start < agent.buffer.first_sequence:
                    body, following = refuse("OUT_OF_RANGE", "the client fell too far behind"), start
                else:
                    body, following = sample(start, count)
            head = f"--0f1e2d3c\r\nContent-type: text/xml\r\nContent-length: {len(body)}\r\n\r\n"
            part = head.encode() + body + b"\r\n"
            try:
                self.wfile.write(f"{len(part):x}\r\n".encode() + part + b"\r\n")
            except OSError:
                self.close_connection = True
                return
            full = following - start >= count
            start = following
            time.sleep(0 if full else interval)


server = ThreadingHTTPServer(("127.0.0.1", PORT), Server)
server.daemon_threads = True
threading.Thread(target=server.serve_forever, daemon=True).start()
print("ready", flush=True)
for line in sys.stdin:
    with guard:
        for identifier, value in json.loads(line):
            agent.push_data(identifier, value)
        print(agent.buffer.last_sequence, flush=True)
