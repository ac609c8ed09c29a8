"""An independent meter: pymodbus over TCP or a serial line.

Arguments: tcp PORT | rtu DEVICE BAUD. Standard input: JSON, [[address, struct format, number], ...]; the numbers stand in
holding and input registers alike. Says "ready" when it listens.
"""
import json
import struct
import sys
import threading

import pymodbus.datastore as store
from pymodbus import FramerType
from pymodbus.server import StartSerialServer, StartTcpServer

registers = [0] * 4096
for address, form, number in json.loads(sys.stdin.readline()):
    raw = struct.pack(">" + form, number)
    for index in range(0, len(raw), 2):
        registers[address + index // 2] = int.from_bytes(raw[index:index + 2], "big")


def block():
    # Address 0 of the protocol is the second cell of a block that begins at 0.
    return store.ModbusSequentialDataBlock(1, registers)


device = store.ModbusDeviceContext(ir=block(), hr=block())
context = store.ModbusServerContext(devices={1: device}, single=False)
threading.Timer(0.3, lambda: print("ready", flush=True)).start()
if sys.argv[1] == "tcp":
    StartTcpServer(context=context, address=("127.0.0.1", int(sys.argv[2])))
else:
    StartSerialServer(context=context, port=sys.argv[2], baudrate=int(sys.argv[3]), framer=FramerType.RTU)
