"""The mock cell as a process: announces its addresses and runs until it is stopped."""

import argparse
import asyncio
import os
import signal
import sys
import threading
from contextlib import suppress

from mock_robot.cell import MockCell, Ports
from mock_robot.rapid.controller import DEPLOYED
from mock_robot.rws.world import World
from mock_robot.truth.truth import CellTruth


async def run_cell(options: argparse.Namespace, truth: CellTruth) -> int:
    """Run the cell until SIGTERM, SIGINT or, with --with-parent, the end of standard input. The exit code."""
    cell = MockCell(
        truth,
        time_scale=options.time_scale,
        program=options.controller or ("rapid" if DEPLOYED.is_dir() else "python"),
        home=options.home,
    )
    equip(cell.rws.world, options)
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        with suppress(NotImplementedError):  # Windows: Ctrl-C ends the process
            loop.add_signal_handler(number, stop.set)
    devices = None if options.robot_only else options.devices_port
    ports = Ports(
        options.host,
        options.robot_port,
        devices,
        options.control_port,
        options.serial,
        (options.rws_port, options.rws2_port),
        options.egm,
        options.profiler_port,
    )
    try:
        announcement = await cell.start(ports)
        for fault in options.fault:
            cell.inject_fault(fault)
        if options.ready_file is not None:
            announcement.write(options.ready_file)
        sys.stdout.write(announcement.line() + "\n")
        sys.stdout.flush()
        if options.with_parent:
            threading.Thread(target=_until_input_ends, args=(loop, stop), daemon=True).start()
        await stop.wait()
    finally:
        await cell.close()
    return 0


def equip(world: World, options: argparse.Namespace) -> None:
    """Leave out what the command line says the controller does not have."""
    world.equipment.virtual = options.virtual
    world.equipment.without, world.equipment.denied = frozenset(options.without), frozenset(options.deny)
    if options.bare:
        world.remove_robot_program()


def _until_input_ends(loop: asyncio.AbstractEventLoop, stop: asyncio.Event) -> None:
    while os.read(sys.stdin.fileno(), 4096):  # not sys.stdin.read: its lock would block the exit
        pass
    loop.call_soon_threadsafe(stop.set)
