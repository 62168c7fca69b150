"""What has been sent and not yet answered, and which of it an `ok` answers.

    sent    N1007   N1008   N1009 M105          printer executes in order, one ok each
    reply     ok  --^
    reply     ok N1008  ----^                    says which (ADVANCED_OK)
    reply     ok T:20 /0  ----------^            only an M105 is answered so: what stands before it is done too

An ok that was lost leaves its command here until an answer to a later one passes over it; one too many, in an empty
flight, is nobody's. To be wrong by one costs a resend at most: the printer takes numbered lines in their order only.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from gcodectl.link.replies import OK, Reply

ASK = b"M105"


class Sent(NamedTuple):
    """A numbered line on its way."""

    number: int
    size: int
    command: bytes


class Flight:
    """Lines on their way, oldest first."""

    def __init__(self) -> None:
        self._sent: deque[Sent] = deque()
        self.count = 0
        """Lines on their way."""
        self.size = 0
        """Bytes on their way."""
        self._asks = 0
        self.tells = False
        """This printer answers M105, and M105 alone, with `ok T:`."""

    def __len__(self) -> int:
        return self.count

    @property
    def oldest(self) -> Sent | None:
        """What the printer is probably at."""
        return self._sent[0] if self._sent else None

    def add(self, number: int, size: int, command: bytes) -> None:
        """Note that a line was sent."""
        self._sent.append(Sent(number, size, command))
        self.count += 1
        self.size += size
        self._asks += command == ASK

    def drop(self, number: int) -> None:
        """Forget line `number` and later ones: the printer has refused them."""
        self._keep([one for one in self._sent if one.number < number])

    def clear(self) -> None:
        """Forget all."""
        self._keep([])

    def _keep(self, kept: list[Sent]) -> None:
        self._sent = deque(kept)
        self.count = len(kept)
        self.size = sum(one.size for one in kept)
        self._asks = sum(one.command == ASK for one in kept)

    def answered(self, reply: Reply, *, probing: bool) -> int | None:
        """Take what an ok answers; returns the highest line number of it, None where it answers nothing here.

        `probing`: the printer was silent and has been asked by M105; an answer to one is one to the last of them.
        """
        if reply is OK and self.count and not self._asks:  # nearly always
            number, size, _ = self._sent.popleft()
            self.count -= 1
            self.size -= size
            return number
        last: int | None = None
        for _ in range(self._count(reply, probing)):
            last, size, command = self._sent.popleft()
            self.count -= 1
            self.size -= size
            self._asks -= command == ASK
        return last

    def _count(self, reply: Reply, probing: bool) -> int:
        sent = self._sent
        if not sent:
            return 0
        if reply.number is not None and reply.number <= sent[-1].number:
            # Repetier tells its last 16 bits only: one that is below all of these may stand for one of them
            low = (index + 1 for index, one in enumerate(sent) if one.number & 0xFFFF == reply.number)
            return sum(one.number <= reply.number for one in sent) or next(low, 0)
        if not self._asks and reply.heats is None:
            return 1
        asked = [index for index, one in enumerate(sent) if one.command == ASK]
        if reply.heats and asked:
            self.tells = True
            return asked[-1 if probing else 0] + 1
        if reply.heats and self.tells:
            return 0
        if not self.tells and probing and len(asked) == len(sent):
            return len(sent)  # plain answers: one that was lost would else leave a question here for ever
        if not self.tells or not asked:
            return 1
        return next((index + 1 for index, one in enumerate(sent) if one.command != ASK), 0)
