"""The process of a virtual controller: options and orders come as JSON lines on standard input, answers go out."""

from __future__ import annotations

import asyncio
import json
import logging
import sys
from typing import Any

from truepath.errors import InputError
from truepath.virtual.controller.options import ControllerOptions
from truepath.virtual.controller.precise_loop import run_precisely
from truepath.virtual.controller.service import Service

MOST_ORDER = 1 << 16


def main() -> None:
    """Until standard input ends: whoever started the controller has gone."""
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(levelname)s %(message)s")
    try:
        service = Service(ControllerOptions.from_json(sys.stdin.readline()))
        run_precisely(_serve(service))
    except InputError as error:
        _answer({"error": str(error)})
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)


async def _serve(service: Service) -> None:
    orders = asyncio.StreamReader(limit=MOST_ORDER)
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(orders), sys.stdin)
    await service.open()
    _answer({"ready": True, "address": service.options.address, "tracker_port": service.options.tracker_port})
    try:
        while line := await orders.readline():
            _answer(_obeyed(service, line))
    finally:
        service.close()


def _obeyed(service: Service, line: bytes) -> dict[str, Any]:
    try:
        order = json.loads(line)
        if not isinstance(order, dict):
            raise InputError("an order is a JSON object")
        return service.obey(order)
    except InputError as error:
        return {"error": str(error)}
    except (ValueError, TypeError) as error:
        return {"error": f"no order: {error}"}


def _answer(content: dict[str, Any]) -> None:
    print(json.dumps(content), flush=True)


if __name__ == "__main__":
    main()
