"""Meters as they stand in shops, of pymodbus: behind a converter for one client, with limits, holes and other byte orders.

Arguments: tcp PORT | rtu-over-tcp PORT. Standard input, one line of JSON:
    units       {"1": [[address, struct format, number], ...], ...}: numbers of each unit, in input and holding registers alike
    order       abcd, cdab, badc or dcba: the order of the bytes of a number
    most        more registers at once than this are refused with exception `code`
    holes       true: registers that no number stands in do not exist (exception 2)
    zero_reads  these reads of a unit, counted from 0, give nothing but zero
    one_client  true: a converter in front that serves one client and closes the connection of every other one; the meters are
                at port `behind`
Says "ready" when it listens.
"""
import asyncio
import json
import struct
import sys
import threading

from pymodbus import FramerType
from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

shop = json.loads(sys.stdin.readline())
order = shop.get("order", "abcd")


def words(form, number):
    raw = struct.pack(">" + form, number)
    found = [raw[at:at + 2] for at in range(0, len(raw), 2)]
    if order in ("cdab", "dcba"):
        found.reverse()
    if order in ("badc", "dcba"):
        found = [pair[::-1] for pair in found]
    return [int.from_bytes(pair, "big") for pair in found]


def device(unit, cells):
    registers = {} if shop.get("holes") else dict.fromkeys(range(4096), 0)
    for address, form, number in cells:
        registers.update({address + at: word for at, word in enumerate(words(form, number))})
    reads = 0
    kept = {}

    async def look(function, start, address, count, current, _written):
        nonlocal reads
        if count > shop.get("most", 125):
            return ExcCodes(shop.get("code", 3))
        for at, word in kept.items():
            current[at - start] = word
        kept.clear()
        if reads in shop.get("zero_reads", []):
            for at in range(address, address + count):
                kept[at] = current[at - start]
                current[at - start] = 0
        reads += 1
        return None

    data = [SimData(at, values=word, datatype=DataType.REGISTERS) for at, word in sorted(registers.items())]
    return SimDevice(id=unit, simdata=data, action=look)


async def converter(port, behind):
    """One client at a time; everybody else is turned away."""
    busy = False

    async def carry(reader, writer):
        try:
            while data := await reader.read(512):
                writer.write(data)
                await writer.drain()
        except ConnectionError:
            pass
        finally:
            writer.close()

    async def client(reader, writer):
        nonlocal busy
        if busy:
            writer.close()
            return
        busy = True
        try:
            their_reader, their_writer = await asyncio.open_connection("127.0.0.1", behind)
            await asyncio.gather(carry(reader, their_writer), carry(their_reader, writer))
        finally:
            busy = False

    server = await asyncio.start_server(client, "127.0.0.1", port)
    async with server:
        await server.serve_forever()


async def main():
    port = int(sys.argv[2])
    framer = FramerType.RTU if sys.argv[1] == "rtu-over-tcp" else FramerType.SOCKET
    devices = [device(int(unit), cells) for unit, cells in shop["units"].items()]
    inner = shop["behind"] if shop.get("one_client") else port
    server = ModbusTcpServer(devices, framer=framer, address=("127.0.0.1", inner))
    threading.Timer(0.5, lambda: print("ready", flush=True)).start()
    jobs = [server.serve_forever()]
    if shop.get("one_client"):
        jobs.append(converter(port, inner))
    await asyncio.gather(*jobs)


asyncio.run(main())
