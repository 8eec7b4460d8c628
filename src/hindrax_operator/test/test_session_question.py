"""What a session asks of a person: on a page of another process, until it is answered or its asker has ended."""

import json
import multiprocessing
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from web_rig import served

from hindrax_analysis.identification.pool_session import PoolSession, Reached, Step, load, save
from hindrax_operator.session_question import QUESTION_FILE, SessionQuestions, answer, asked
from hindrax_operator.web.day import SessionOfTheDay

LOAD, TETHER = "hang 15 N", "lead the tether away"


@pytest.fixture
def questions(tmp_path: Path) -> Iterator[SessionQuestions]:
    made = SessionQuestions(tmp_path)
    yield made
    made.close()


def test_a_question_is_there_until_it_is_closed(questions: SessionQuestions, tmp_path: Path) -> None:
    assert asked(tmp_path) is None
    questions.ask(TETHER)
    question = asked(tmp_path)
    assert question is not None
    assert question.sentence == TETHER
    assert not questions.answered()
    assert answer(tmp_path, question.number)
    assert questions.answered()
    questions.close()
    assert asked(tmp_path) is None
    assert list(tmp_path.iterdir()) == []


def test_an_answer_to_the_question_before_answers_nothing(questions: SessionQuestions, tmp_path: Path) -> None:
    questions.ask(TETHER)
    before = asked(tmp_path)
    questions.ask(LOAD)
    assert before is not None
    assert not answer(tmp_path, before.number)
    (tmp_path / "answer.json").write_text(json.dumps({"number": before.number}))
    assert not questions.answered()


def test_no_page_gives_the_answer_that_arms(questions: SessionQuestions, tmp_path: Path) -> None:
    questions.ask(TETHER, arms=True)
    question = asked(tmp_path)
    assert question is not None
    assert question.arms
    assert not answer(tmp_path, question.number)
    assert not questions.answered()


def _ask(folder: Path) -> None:
    SessionQuestions(folder).ask(TETHER)


def test_nobody_waits_for_an_answer_when_the_asker_has_ended(tmp_path: Path) -> None:
    asker = multiprocessing.get_context("fork").Process(target=_ask, args=(tmp_path,))
    asker.start()
    asker.join()
    assert asked(tmp_path) is None
    assert not answer(tmp_path, json.loads((tmp_path / QUESTION_FILE).read_text())["number"])


@pytest.mark.parametrize("content", ["", "[]", "{", '{"number": "7", "sentence": 3, "arms": false}', "\x00"])
def test_a_damaged_question_is_none(content: str, questions: SessionQuestions, tmp_path: Path) -> None:
    questions.ask(TETHER)
    (tmp_path / QUESTION_FILE).write_text(content)
    assert asked(tmp_path) is None


def test_the_page_shows_the_session_of_the_day_and_answers_it(tmp_path: Path) -> None:
    reached = {"surge": Reached(0.084, 0.2, 0.06, 0.08, 0.05, "own wake", "")}
    day = tmp_path / "day"
    day.mkdir()
    steps = Step("tether", remark="left out"), Step("legs 1", "legs-1", reached=reached)
    save(PoolSession({"motions": ["surge"]}, ("tether", "legs 1", "weigh surge", "legs 2"), steps), day)
    questions = SessionQuestions(day)
    questions.ask(LOAD)
    question = asked(day)
    assert question is not None
    assert SessionOfTheDay(tmp_path).shown() == {
        "name": "day",
        "steps": [
            {"name": "tether", "state": "done", "remark": "left out"},
            {"name": "legs 1", "state": "done", "remark": ""},
            {"name": "weigh surge", "state": "next", "remark": ""},
            {"name": "legs 2", "state": "left", "remark": ""},
        ],
        "reached": [("surge", "8.4%", "5%")],
        "question": {"number": question.number, "sentence": LOAD, "arms": False},
    }
    with served(tmp_path, read_only=True) as page:
        assert page.order("answer", number=question.number)[0] == 403
    with served(tmp_path) as page:
        assert page.order("answer", number=str(question.number))[0] == 400
        assert page.order("answer", number=question.number + 1)[0] == 409
        assert not questions.answered()
        assert page.order("answer", number=question.number)[0] == 202
        assert questions.answered()
        questions.close()
        gone = page.order("answer", number=question.number)
        assert gone == (409, "answer: no session asks that of a page, or not any more\n")


def test_a_session_is_read_again_only_where_it_was_kept_since(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = list[Path]()

    def noted(folder: Path) -> PoolSession:
        read.append(folder)
        return load(folder)

    monkeypatch.setattr("hindrax_operator.web.day.LOOK_S", -1.0)
    monkeypatch.setattr("hindrax_operator.web.day.load", noted)
    day, page = tmp_path / "day", SessionOfTheDay(tmp_path)
    day.mkdir()
    save(PoolSession({"motions": ["surge"]}, ("tether", "legs 1")), day)
    first = page.shown()
    assert page.shown() == first
    assert read == [day]
    questions = SessionQuestions(day)
    questions.ask(LOAD)
    assert page.shown() != first, "what it asks is looked at each time"
    questions.close()
    save(PoolSession({"motions": ["surge"]}, ("tether", "legs 1"), (Step("tether"),)), day)
    assert page.shown() != first
    assert read == [day, day]


def test_without_a_session_the_page_shows_none(tmp_path: Path) -> None:
    assert SessionOfTheDay(tmp_path / "nowhere").shown() is None
    day = tmp_path / "runs" / "day"
    day.mkdir(parents=True)
    assert SessionOfTheDay(day.parent).shown() is None
    (day / "session.yaml").write_text("planned: 3")
    assert SessionOfTheDay(day.parent).shown() is None
    save(PoolSession({"motions": ["surge"]}, ("tether",)), day)
    assert SessionOfTheDay(day.parent).shown() is not None
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "day").symlink_to(day)
    assert SessionOfTheDay(tmp_path / "linked").shown() is None
    yesterday_s = time.time() - 86400.0
    os.utime(day / "session.yaml", (yesterday_s, yesterday_s))
    assert SessionOfTheDay(day.parent).shown() is None
