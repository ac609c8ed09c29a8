"""Calls of the vendor's own library, for the interop test: `library_client.py LIBRARY HOST PORT`.

Reads a JSON list of calls from standard input and writes a JSON list of results. A call is
    {"call": "cnc_rdspeed", "args": [["h", -1], ["out", 24]], "read": "<ihhhbbihhhbb"}
where an argument is ["h", number] (a short), ["i", number] (32 bits, which `long` is in this library whatever its header
says), ["H", number] (an unsigned short), ["*h", number] or ["*I", number] (a pointer to one), ["in", "hex"] (bytes) or
["out", size] (a buffer that it fills in). A result has the return code, what the pointers hold afterwards, and the numbers
that the format finds in the buffer.
"""

import ctypes
import json
import struct
import sys

KINDS = {"h": ctypes.c_short, "i": ctypes.c_int, "H": ctypes.c_ushort, "I": ctypes.c_uint}
MARGIN = 4096


def argument(kind, value):
    """The C argument, and how to look at it afterwards."""
    if kind == "out":
        buffer = ctypes.create_string_buffer(b"\xcc" * (value + MARGIN), value + MARGIN)
        return buffer, ("out", buffer, value)
    if kind == "in":
        buffer = ctypes.create_string_buffer(bytes.fromhex(value), max(len(value) // 2, 4096))
        return buffer, ("out", buffer, len(value) // 2)
    if kind.startswith("*"):
        pointed = KINDS[kind[1:]](value)
        return ctypes.byref(pointed), ("pointer", pointed, 0)
    return KINDS[kind](value), None


def plain(value):
    return value.split(b"\0")[0].decode("latin-1") if isinstance(value, bytes) else value


def one(library, handle, call):
    found = [argument(*pair) for pair in call["args"]]
    code = ctypes.c_short(getattr(library, call["call"])(handle, *[value for value, _ in found])).value
    result = {"code": code, "pointers": [], "numbers": []}
    for kind, place, size in [look for _, look in found if look]:
        if kind == "pointer":
            result["pointers"].append(place.value)
        elif code == 0:
            if place.raw[size:size + 8] != b"\xcc" * 8 and kind == "out" and len(place.raw) == size + MARGIN:
                result["overrun"] = True
            form = call.get("read", "")
            result["numbers"] = [plain(number) for number in struct.unpack_from(form, place.raw)]
    return result


def main():
    path, host, port = sys.argv[1:4]
    library = ctypes.CDLL(path)
    if library.cnc_startupprocess(0, b"/dev/null") != 0:
        sys.exit("the library does not start")
    handle = ctypes.c_ushort(0)
    code = ctypes.c_short(library.cnc_allclibhndl3(host.encode(), int(port), 5, ctypes.byref(handle))).value
    if code != 0:
        sys.exit(f"no connection: {code}")
    results = [one(library, handle, call) for call in json.load(sys.stdin)]
    library.cnc_freelibhndl(handle)
    library.cnc_exitprocess()
    print(json.dumps(results))


main()
