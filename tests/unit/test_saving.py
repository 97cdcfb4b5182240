"""What comes of many who ask to save at once."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from gvgbot.config import load_config
from gvgbot.errors import GvgbotError
from gvgbot.maps.run_directory import RunDirectory
from gvgbot.saving import Saving
from gvgbot.session import Session


@pytest.fixture
def session(tmp_path: Path) -> Session:
    with RunDirectory(tmp_path) as directory:
        return Session(load_config(), directory, None)


def test_a_crowd_that_asks_waits_for_one_more_saving(session: Session) -> None:
    """The one that is under way may have begun before something was found."""
    begun: list[int] = []

    async def slowly(work: Callable[[], None]) -> None:
        begun.append(len(begun))
        for _ in range(3):
            await asyncio.sleep(0.0)

    async def crowd() -> list[str]:
        saving = Saving(session, slowly)
        return await asyncio.gather(*(saving.save() for _ in range(50)))

    assert set(asyncio.run(crowd())) == {str(session.directory.path)}
    assert begun == [0, 1]


def test_who_asks_later_gets_a_saving_of_his_own_and_after_a_failure_another_try(
    session: Session,
) -> None:
    tries: list[str] = []

    async def full_once(work: Callable[[], None]) -> None:
        tries.append("try")
        if len(tries) == 1:
            raise GvgbotError("no space left")

    async def one_after_another() -> None:
        saving = Saving(session, full_once)
        with pytest.raises(GvgbotError):
            await saving.save()
        await saving.save()
        await saving.save()

    asyncio.run(one_after_another())
    assert len(tries) == 3
