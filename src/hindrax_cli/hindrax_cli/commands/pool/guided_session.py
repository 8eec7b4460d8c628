"""`hindrax pool-test --session`: a pool day step by step, with a person beside the pool or in mock."""

import argparse
import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hindrax_analysis.coefficients_file import as_yaml
from hindrax_analysis.identification.bag_identification import (
    Identified,
    recorded_conditions,
    show,
    write,
    write_report,
)
from hindrax_analysis.identification.pool_session import (
    LEGS,
    SESSION_FILE,
    PoolSession,
    drag_goal,
    farthest_motion,
    load,
    meets,
    next_sentence,
    planned_steps,
    run_steps,
    save,
)
from hindrax_analysis.next_step import quoted_share
from hindrax_analysis.terminal import print_answer, print_table, print_what_fits
from hindrax_bag.run_folder import RunFolder, make_run_folder
from hindrax_bringup.share_files import vehicle_word
from hindrax_bringup.stack import MockOptions, environment, world_of_pool_test
from hindrax_cli.commands.experiment.weigh import check_load, require_tty
from hindrax_cli.commands.operate.up_stop import require_known
from hindrax_cli.commands.pool.session_steps import StackStepRunner
from hindrax_control.maneuver.goal import PLATEAUS, motions_to_fly
from hindrax_core.errors import INTERRUPTED, HindraxError, UsageError
from hindrax_core.text.refusals import NOTHING
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.vehicle import load_vehicle

if TYPE_CHECKING:
    from hindrax_operator.nodes.session_server import SessionServer

OF_OTHER_FLIGHTS = ("plan", "until", "minutes", "fault", "simulator", "start", "autopilot", "params", "set")
"""Options of a single flight, which a session does not keep."""


def guide(arguments: argparse.Namespace) -> int:
    """Begin a session or go on with one.

    Parameters
    ----------
    arguments
        Of `pool-test`.

    Returns
    -------
    int
        0 when every step was done and every motion identified; INTERRUPTED after Ctrl-C.

    Raises
    ------
    UsageError
        Names options that a session has no use for.
    HindraxError
        When no legs were flown, so that there is no estimate.
    """
    check_options(arguments)
    return guided(arguments, *opened(arguments))


def check_options(arguments: argparse.Namespace) -> None:
    """UsageError names what would fail every step: an option without use, a folder named twice, an impossible graph."""
    found = [f"--{name}" for name in OF_OTHER_FLIGHTS if getattr(arguments, name) not in (None, [], "", False)]
    found += [f"--excitation {arguments.excitation}"] if arguments.excitation != PLATEAUS else []
    if found:
        raise UsageError(f"--session: found {', '.join(found)}, which it has no use for: it plans its own legs")
    if arguments.session and arguments.out:
        raise UsageError(f"--out {arguments.out}: --session {arguments.session} names the folder already")
    environment(mock=arguments.mock, domain=None)


def guided(
    arguments: argparse.Namespace, session: PoolSession, folder: RunFolder, client: "SessionServer | None" = None
) -> int:
    """Do the steps that are left, identify over all legs, and print.

    Parameters
    ----------
    arguments
        Of `pool-test`.
    session, folder
        As of `opened`.
    client
        Shows the session to the client that began it; None: it was begun in this terminal.

    Returns
    -------
    int
        As of `guide`.

    Raises
    ------
    HindraxError
        When no legs were flown, so that there is no estimate.
    """

    def report(session: PoolSession) -> None:
        _report(folder.path, session)
        if client is not None:
            client.show(session, folder.path)

    runner = StackStepRunner(arguments, session, folder)
    save(session, folder.path)
    print_stderr(f"session {folder.path}: {', '.join(session.left) or 'all steps are done'}")
    try:
        if client is not None:
            client.show(session, folder.path)
            runner.confirm(session)
        session = run_steps(session, folder.path, runner, report)
        if not session.folders:
            why = next((step.remark for step in reversed(session.done) if step.kind == LEGS), "none were planned")
            raise HindraxError(f"{folder.path}: no legs were flown ({why}), so there is no estimate")
        bags_of = {folder.path / name: volts for name, volts in session.folders.items()}
        identified = runner.identified or runner.identify(bags_of, session)
    except KeyboardInterrupt:
        mock = " --mock" if session.settings["mock"] else ""
        print_stderr(f"stopped; `./hindrax pool-test --session {folder.path}{mock}` goes on with the step in hand")
        return INTERRUPTED
    finally:
        runner.questions.close()
    bags = _bags(session, folder)
    conditions = recorded_conditions(identified, bags, bags)
    write(folder.coefficients, as_yaml(identified.results, conditions))
    write_report(folder.report, identified, conditions, None)
    document = identified.document(bags[0], folder.report, None, NOTHING) | session_document(session, folder.path)

    print_answer(document, partial(show_end, identified, session, folder), as_json=arguments.json)
    return 1 if session.aborted or not identified.complete else 0


def goes_on(arguments: argparse.Namespace) -> bool:
    """Whether the folder that is named holds a session, which goes on."""
    return bool(arguments.session) and (Path(arguments.session) / SESSION_FILE).is_file()


def opened(arguments: argparse.Namespace) -> tuple[PoolSession, RunFolder]:
    """The session that is in the folder, or a new one; what it was begun with stays.

    Parameters
    ----------
    arguments
        Of `pool-test`.

    Returns
    -------
    tuple[PoolSession, RunFolder]
        The session, and its folder, which is made for a new one.

    Raises
    ------
    UsageError
        As of `planned_session`.
    """
    session = planned_session(arguments)
    if goes_on(arguments):
        print_stderr("goes on with the vehicle, motions, world and load that the session was begun with")
        return session, RunFolder(Path(arguments.session).resolve())
    vehicle = load_vehicle(arguments.vehicle)
    print_stderr(f"{vehicle.name} {motions_to_fly(arguments.dof, vehicle)}")
    return session, make_run_folder(arguments.session or arguments.out, Path(arguments.vehicle))


def planned_session(arguments: argparse.Namespace) -> PoolSession:
    """The session that is in the folder, or a new one, of which nothing is written yet.

    Parameters
    ----------
    arguments
        Of `pool-test`.

    Returns
    -------
    PoolSession
        With the steps that are left.

    Raises
    ------
    UsageError
        Where it cannot be flown: motions, world, load, nobody at the terminal; or goes on otherwise than it began.
    """
    if goes_on(arguments):
        session = load(Path(arguments.session).resolve())
        if bool(session.settings["mock"]) != arguments.mock:
            began, now = ("with", "without") if session.settings["mock"] else ("without", "with")
            raise UsageError(f"--session {arguments.session}: was begun {began} --mock, found {now}; go on as it began")
        if not arguments.yes and not arguments.mock and session.left:
            require_tty()
        return session
    vehicle = load_vehicle(arguments.vehicle)
    servable = motions_to_fly(arguments.dof, vehicle)
    mock = None
    if arguments.mock:
        mock = MockOptions(arguments.seed, arguments.rate or 0.0, (), world_of_pool_test(arguments.world))
        require_known(mock, vehicle)
    elif arguments.world is not None or arguments.rate is not None:
        raise UsageError("--world and --rate are for --mock only")
    else:
        _check_person(arguments, servable.flown)
    settings = {
        "motions": list(servable.flown),
        "mock": {"seed": mock.seed, "world": mock.world} if mock is not None else None,
        "load_N": arguments.load,
        "lever_m": arguments.lever,
        "vehicle": vehicle_word(Path(arguments.vehicle)),
        "repeats": arguments.repeats,
    }
    return PoolSession(settings, planned_steps(servable.flown, arguments.repeats))


def _check_person(arguments: argparse.Namespace, motions: Sequence[str]) -> None:
    """UsageError where the steps of a person cannot be done."""
    if not arguments.yes:
        require_tty()
    if arguments.load:
        vehicle = load_vehicle(arguments.vehicle)
        for axis in (one for one in ("surge", "sway", "heave") if one in motions):
            check_load(vehicle, axis, arguments.load, 1.0)
        if "yaw" in motions and arguments.lever:
            check_load(vehicle, "yaw", arguments.load, arguments.lever)


def _bags(session: PoolSession, folder: RunFolder) -> list[Path]:
    return [folder.path / one / "bag" for one in session.folders]


# ---- on the terminal


def _report(folder: Path, session: PoolSession) -> None:
    """Tell what the last step bought, and what is next."""
    step = session.done[-1]
    if step.remark:
        print_stderr(f"{step.name}: {step.remark}")
    if step.volts is not None:
        print_stderr(f"{step.name}: thrust is that at {step.volts.before:g} V, falling to {step.volts.after:g} V")
    if step.reached:
        before = replace(session, done=session.done[:-1]).reached
        for motion, one in step.reached.items():
            was = f"{quoted_share(before[motion].drag)} -> " if motion in before else ""
            print_stderr(f"{step.name}: drag of {motion} {was}{quoted_share(one.drag)}, wanted {drag_goal(motion):.0%}")
        print_stderr(f"best next step: {next_sentence(session)}")
    print_stderr(f"{step.name}: kept in {folder}; steps left: {len(session.left)}")


def session_document(session: PoolSession, folder: Path) -> dict[str, object]:
    """What a session adds to the document of `identify`."""
    reached = session.reached
    return {
        "session": str(folder),
        "steps": list(session.done),
        "minutes": session.seconds / 60.0,
        "goal": {motion: {"drag": drag_goal(motion), "met": meets(motion, one)} for motion, one in reached.items()},
        "next": next_sentence(session),
    }


def show_end(identified: Identified, session: PoolSession, folder: RunFolder) -> None:
    """Print what a session found and reached, and what comes next; of many motions only what it reached.

    Parameters
    ----------
    identified
        The estimate over all legs.
    session
        With its finished steps.
    folder
        Of its results.
    """

    def ending(*, short: bool = False) -> None:
        show_session(session, short=short)
        print_whole(f"  {next_command(session, folder)}")
        print_fitted(f"report: {folder.report}")

    def without_tables(*, short: bool) -> None:
        left_out = ["coefficients", "verdicts", "warnings", *(["causes"] if short else [])]
        print_fitted(f"in the report: {', '.join(left_out)}")
        ending(short=short)

    whole = partial(show, identified, reported=True, ending=ending)
    print_what_fits(whole, partial(without_tables, short=False), partial(without_tables, short=True))


def next_command(session: PoolSession, folder: RunFolder) -> str:
    """The command of the next step: the same legs again, those of the motion that is farthest, or the use of it all."""
    motion, settings = farthest_motion(session), session.settings
    known = any(math.isfinite(one.drag) for one in session.reached.values())
    if motion is None and known:
        # What no step flew, such as sway after a session of surge, has the numbers of the vehicle file.
        files = [_as_typed(folder.coefficients), "--vehicle", _as_typed(folder.vehicle)]
        return shlex.join(["./hindrax", "tune", *files])
    words = ["./hindrax", "pool-test", "--session"]
    if (mock := settings["mock"]) is not None:
        words += ["--mock", *(["--world", mock["world"]] if mock["world"] != world_of_pool_test(None) else [])]
    for name, value in (("--load", settings.get("load_N")), ("--lever", settings.get("lever_m"))):
        words += [name, f"{value:g}"] if value else []
    vehicle = settings.get("vehicle", _as_typed(folder.vehicle))
    words += ["--vehicle", vehicle] if vehicle else []
    return shlex.join([*words, "--dof", *([motion.partition("_")[0]] if motion else settings["motions"])])


def _as_typed(file: Path) -> str:
    """Path of a file from here, where it is below."""
    here = Path.cwd()
    return str(file.relative_to(here) if file.is_relative_to(here) else file)


def show_session(session: PoolSession, *, short: bool = False) -> None:
    """Print goal, what is reached, and what is left by the budget; `short`: without the causes of the latter."""
    stages = [step for step in session.done if step.reached]
    names = [step.name for step in stages]
    rows = []
    for motion, last in session.reached.items():
        drags = [one.drag if (one := step.reached.get(motion)) else None for step in stages]
        shares = ["" if one is None else quoted_share(one) for one in (*drags, last.added_mass, last.floor)]
        rows.append((motion, f"{drag_goal(motion):.0%}", *shares, "" if short else last.cause))
    minutes = f"{session.seconds / 60.0:.0f} min of water"
    title = f"Session, {minutes}: std of the drag after each step; at best: weighed, half the noise"
    numbers = ("goal", *names, "added mass", "at best")
    # What came between goes first: the first and the last stage tell what the day has bought.
    spare = ("added mass", *names[1:-1])
    print_table(title, ("motion",), numbers, rows, ("largest left",), spare=spare, dense=short)
    print_fitted(f"best next step: {next_sentence(session)}")
