"""A worker function that dies over some programs, as one does that runs out of memory. Workers import it from here."""

import os
import signal

from truepath.batch.hands import DaskHands
from truepath.batch.work import correct_parcel

POISON = "# deadly\n"


def correct_or_die(parcel):
    if any(item.content.startswith(POISON.encode()) for item in parcel.items):
        os.kill(os.getpid(), signal.SIGKILL)
    return correct_parcel(parcel)


class DeadlyHands(DaskHands):
    """Hands whose workers die over poison."""

    def _submit(self, parcel):
        return self.client.submit(correct_or_die, parcel, pure=False)
