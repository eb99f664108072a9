"""Free memory of the machine: a solve that does not fit is refused before it starts."""

import psutil


def available_memory() -> int:
    """Bytes that this process can still allocate before the system swaps, caches that it would drop included.

    This is the machine's figure on all systems. The limit of a container (cgroup) or of a user's account is not in it;
    where there is one, set the memory limit by hand.
    """
    return int(psutil.virtual_memory().available)
