"""What keeps the robot from going on, and when that is a reason to try another way."""


class Hindrance:
    """Something in the way is waited for, a while; where there is no way on, nothing is."""

    def __init__(self) -> None:
        self._is_held = False  # by something that may go, since the last view
        self._since: float | None = None  # stamp
        self._reason = ""  # why there is no way on, since the last view

    def hold(self) -> None:
        """Note that the robot cannot go on just now."""
        self._is_held = True

    def obstruct(self, reason: str) -> None:
        """Note that there is no way on."""
        self._reason = reason

    def end(self) -> None:
        """Wait no longer: something else is to be done."""
        self._is_held, self._since = False, None

    def skip(self, seconds: float) -> None:
        """Do not count a time in which nothing was to be seen."""
        self._since = None if self._since is None else self._since + seconds

    def reason_to_turn(self, stamp: float, *, has_come_on: bool, patience_s: float) -> str:
        """Why another way is to be tried, told once; empty as long as there is no reason."""
        if self._is_held and self._since is None:
            self._since = stamp
        if has_come_on:
            self._since = None
        self._is_held = False
        reason = self._reason
        if not reason and self._since is not None and stamp - self._since > patience_s:
            reason = "something stands in the way"
        if reason:
            self._reason, self._since = "", None
        return reason
