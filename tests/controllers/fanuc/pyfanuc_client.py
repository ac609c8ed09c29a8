"""Readings of pyfanuc, for the interop test: `pyfanuc_client.py PYFANUC.PY HOST PORT`. Prints JSON."""

import importlib.util
import json
import sys


def load(path):
    spec = importlib.util.spec_from_file_location("pyfanuc", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.pyfanuc


def tried(read):
    try:
        return read()
    except Exception as error:  # what the client makes of an answer is part of the finding
        return f"{type(error).__name__}: {error}"


def alarms(client):
    found = client.readalarmcode(-1, 2, 8, 64) or []
    text = lambda entry: entry["text"].split(b"\0")[0].decode()
    return [[entry["alarmcode"], entry["alarmtype"], entry["axis"], text(entry)] for entry in found]


def first(found):
    return {str(number): row["data"][0] for number, row in found.items()}


def main():
    path, host, port = sys.argv[1:4]
    client = load(path)(host, int(port))
    if not client.connect():
        sys.exit("no connection")
    axes = ("ABS", "REL", "REF", "DIST")
    every = client.ABS | client.REL | client.REF | client.DIST
    readings = {
        "statinfo": lambda: list(client.statinfo().values()),
        "date": lambda: list(client.getdate()),
        "time": lambda: list(client.gettime()),
        "datetime": lambda: list(client.getdatetime())[:6],
        "axes": lambda: {key: value[:3] for key, value in client.readaxes(every).items() if key in axes},
        "figures": lambda: {"count": client.getformat(0)["count"], "decinput": client.getformat(0)["dec"][0]["decinput"]},
        "macro": lambda: {str(key): value for key, value in client.readmacro(501, 502).items()},
        "pmc": lambda: {str(key): value for key, value in client.readpmc(0, 0, 12).items()},
        "executed": lambda: client.readexecprog()["text"],
        "prognum": client.readprognum,
        "progname": client.readprogname,
        "alarm": client.readalarm,
        "alarms": lambda: alarms(client),
        "programs": lambda: {str(key): [row["size"], row["comment"]] for key, row in client.listprog().items()},
        "feed": client.readactfeed,
        "spindle": client.readactspindlespeed,
        "param": lambda: first(client.readparam(0, 6711)),
        "diagnosis": lambda: first(client.readdiag(1, 308)),
        "folder": client.readdir_current,
        "folder_counts": lambda: client.readdir_info("//CNC_MEM/USER/PATH1/"),
        "files": lambda: [
            [entry["name"], entry["size"], entry["comment"]]
            for entry in client.readdir_complete("//CNC_MEM/USER/PATH1/")
        ],
    }
    found = {name: tried(read) for name, read in readings.items()}
    client.disconnect()
    print(json.dumps(found))


main()
