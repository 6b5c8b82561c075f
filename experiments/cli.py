"""The command line: ``hedgebed <experiment> [case.toml] [--option value ...] [--out DIR]``.

The options of an experiment are made from its settings class: same names (with hyphens), types, defaults and units.
Exit status: 0 done, 1 failed (state saved, reason said), 2 bad input, 3 stopped (``hedgebed resume DIR`` finishes it).
Results go to stdout, everything else to stderr.
"""

import inspect
import math
import os
import re
import shutil
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from types import FrameType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from cyclopts import App, CoercionError, CycloptsError, MissingArgumentError, Parameter
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments import registry
from experiments.progress import Progress, make_progress
from experiments.reading import Layer, find_case, read_case, settings_from
from experiments.registry import Experiment, find_experiment
from experiments.runfolder import RunFolder, fresh_path, write_json, write_text
from experiments.strict import may_be_empty, plain_kinds
from hedgebed import __version__
from vis.numbers import digits_for

__all__ = ["DONE", "FAILED", "BAD_INPUT", "STOPPED", "build_app", "main"]

DONE, FAILED, BAD_INPUT, STOPPED = 0, 1, 2, 3


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line on `tokens` (``sys.argv[1:]`` by default) and return the exit status."""
    # Taichi greets on stdout and has a new version looked for: neither belongs here.
    os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")
    os.environ.setdefault("TI_LOG_LEVEL", "error")
    os.environ.setdefault("TI_SKIP_VERSION_CHECK", "1")
    try:
        with _terminate_like_ctrl_c():
            tokens = sys.argv[1:] if tokens is None else list(tokens)
            return build_app()(tokens, exit_on_error=False, print_error=False) or DONE
    except (CycloptsError, ValueError) as error:
        if not isinstance(error, CycloptsError | _RefusedError):
            traceback.print_exc()
            return FAILED
        _say(_said(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        _say("stopped")
        return STOPPED
    except BrokenPipeError:  # the reader of stdout has gone, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


class _RefusedError(ValueError):
    """Bad input, found before any work."""


def _say(text: str) -> None:
    for line in text.splitlines():
        print(f"hedgebed: {line}", file=sys.stderr, flush=True)


def _said(error: Exception) -> str:
    """What was wrong with the words typed, and what would do."""
    text = str(error)
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        count, got = error.argument.token_count()[0], len(error.tokens_so_far)
        if count > 1:
            typed = " ".join(error.tokens_so_far) or "nothing"
            about = f" ({error.argument.parameter.help.rstrip('.')})" if error.argument.parameter.help else ""
            return f"{error.argument.name} = {typed} will not do: it takes {count} values, not {got}{about}"
    if isinstance(error, CoercionError) and error.target_type is float and error.token and error.argument:
        unit = re.findall(r"\[([^\[\]]+)\]", error.argument.parameter.help or "")[-1:]
        if unit and unit[0] != "1":
            named = _UNIT_NAMES.get(unit[0], unit[0])
            text = f"{text.rstrip('.')}: give a plain number in {named}{_in_metres(error.token.value, unit[0])}"
    return text


_UNIT_NAMES = {"m": "metres", "N": "newtons", "kg": "kilograms", "s": "seconds"}
_LENGTHS = {"mm": 1e-3, "cm": 1e-2, "um": 1e-6, "µm": 1e-6, "m": 1.0}


def _in_metres(typed: str, unit: str) -> str:
    """``, e.g. 0.016`` for ``16mm``; nothing where it is no length with a unit."""
    found = re.fullmatch(r"\s*([0-9.]+(?:e-?[0-9]+)?)\s*([a-zµ]+)\s*", typed)
    if unit != "m" or not found or found[2] not in _LENGTHS:
        return ""
    try:
        return f", e.g. {float(found[1]) * _LENGTHS[found[2]]:.6g}"
    except ValueError:
        return ""


@contextmanager
def _terminate_like_ctrl_c() -> Iterator[None]:
    """Within, SIGTERM raises KeyboardInterrupt, as Ctrl-C does."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not in the main thread: whoever runs us there deals with signals
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _refusing() -> Iterator[None]:
    """Within, a ValueError is bad input."""
    try:
        yield
    except ValueError as error:
        raise _RefusedError(str(error)) from error


@contextmanager
def _stdout_to_stderr() -> Iterator[None]:
    """Within, what anyone writes to stdout, libraries in C included, goes to stderr: stdout is for results."""
    try:
        number = sys.stdout.fileno()
    except (OSError, ValueError):  # stdout is not a file, as where a test captures it
        with redirect_stdout(sys.stderr):
            yield
        return
    sys.stdout.flush()
    kept = os.dup(number)
    os.dup2(sys.stderr.fileno(), number)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, number)
        os.close(kept)


# Options from settings -----------------------------------------------------------------------------------------------

_RESERVED = {
    "case": (Path | None, None, "A TOML file of settings, or the name of a case that ships; options win over it."),
    "out": (Path | None, None, "The run's folder; runs/<command>-<time> if not given."),
    "json": (bool, False, "Print result.json on stdout and nothing else."),
    "quiet": (bool, False, "Show no progress."),
}


def _shown(value: Any) -> str:
    """A default, as one would type it."""
    if isinstance(value, list | tuple):
        return " ".join(map(str, value)) or "none"
    return str(value)


def _bare(hint: Any) -> Any:
    """`hint` without its bounds: pydantic checks these, and its faults become sentences in `experiments.reading`."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _bare(inside[0])
    if hint is int:
        return float  # cyclopts would round 1.5 to 2; `_as_typed` makes whole numbers of it again
    if not inside or origin is Literal:
        return hint
    if origin in (Union, UnionType):
        return Union[tuple(_bare(item) for item in inside)]
    return origin[tuple(_bare(item) for item in inside)]


def _as_typed(given: dict[str, Any], fields: dict[str, FieldInfo]) -> dict[str, Any]:
    """The values as the settings class takes them: a float that is whole is an int, a list of ``none`` is empty."""

    def whole(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(whole(item) for item in value)
        return int(value) if isinstance(value, float) and value.is_integer() else value

    found = {}
    for name, value in given.items():
        field = fields.get(name)
        if field is not None:
            value = () if may_be_empty(field) and value == (None,) else value
            kinds = plain_kinds(field.annotation)
            value = whole(value) if int in kinds and float not in kinds else value
        found[name] = value
    return found


def _option(name: str, field: FieldInfo) -> inspect.Parameter:
    """The command-line parameter of one setting."""
    if name in _RESERVED:
        raise TypeError(f"a setting cannot be called {name!r}: the command line has that already")
    default = None if field.is_required() else field.get_default(call_default_factory=True)
    shown: bool | Callable[[Any], str] = False if default is None or default is PydanticUndefined else _shown
    is_flag = field.annotation is bool
    hint = _bare(field.annotation)
    if may_be_empty(field):
        hint = tuple[get_args(hint)[0] | None, ...]  # type: ignore[misc]
    annotation = Annotated[
        hint,  # type: ignore[valid-type]
        Parameter(help=field.description, show_default=shown, consume_multiple=True, negative=None if is_flag else ""),
    ]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _reserved(name: str) -> inspect.Parameter:
    hint, default, text = _RESERVED[name]
    kind = inspect.Parameter.POSITIONAL_ONLY if name == "case" else inspect.Parameter.KEYWORD_ONLY
    annotation = Annotated[hint, Parameter(help=text, negative="", show_default=False)]  # type: ignore[valid-type]
    return inspect.Parameter(name, kind, default=default, annotation=annotation)


def _experiment_command(experiment: Experiment) -> Callable[..., int]:
    """The function behind ``hedgebed <experiment>``, with one parameter per setting.

    Only what was typed arrives in `given`, so that a case file can lie between the defaults and the command line.
    """
    settings_class = experiment.settings_class()
    presets = experiment.presets

    def command(
        case: Path | None = None, *, out: Path | None = None, json: bool = False, quiet: bool = False, **given: Any
    ) -> int:
        with _refusing():
            if experiment.subject and case is not None and not case.is_file():
                case, given[experiment.subject] = None, str(case)
            layers = [read_case(registry.CASES / preset.case) for preset in presets if given.pop(preset.option, False)]
            layers += [read_case(find_case(case, registry.CASES))] if case is not None else []
            typed = Layer(None, _as_typed(given, settings_class.model_fields))
            settings = settings_from(settings_class, [*layers, typed])
            with _stdout_to_stderr():
                experiment.check(settings)
                code = experiment.code()
            folder = RunFolder.create(out or fresh_path(experiment.name), experiment.name, settings, code=code)

        def work(progress: Progress) -> dict[str, Any]:
            return experiment.run(settings, folder.path, progress=progress)

        return _carry_out(folder, work, as_json=json, quiet=quiet)

    flags = [
        inspect.Parameter(
            preset.option,
            inspect.Parameter.KEYWORD_ONLY,
            default=False,
            annotation=Annotated[bool, Parameter(help=preset.summary, negative="", show_default=False)],
        )
        for preset in presets
    ]
    fields = settings_class.model_fields
    first = _reserved("case")
    if experiment.subject:
        about = Parameter(help=fields[experiment.subject].description, negative="", show_default=False)
        first = first.replace(annotation=Annotated[Path | None, about])
    parameters = [first]
    parameters += [_option(name, field) for name, field in fields.items() if name != experiment.subject]
    parameters += [*flags, _reserved("out"), _reserved("json"), _reserved("quiet")]
    command.__signature__ = inspect.Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    command.__name__ = experiment.name.replace(" ", "_")
    return command


# Carrying a run out --------------------------------------------------------------------------------------------------


def _carry_out(folder: RunFolder, work: Callable[[Progress], dict[str, Any]], *, as_json: bool, quiet: bool) -> int:
    """Do the `work` of a run whose folder is there; keep its status; show what came out."""
    _say(f"run folder {folder.path}")
    fresh = not folder.has_work
    with _stdout_to_stderr():
        try:
            with folder.lock():
                folder.set_status("running")
                try:
                    with make_progress(quiet=quiet) as progress:
                        result = work(progress)
                except KeyboardInterrupt:
                    folder.set_status("stopped", "interrupted")
                    raise
                except BaseException as error:
                    folder.set_status("failed", f"{type(error).__name__}: {error}")
                    raise
                if not (folder.path / "result.json").exists():
                    folder.write_result(result)
                folder.set_status("done")
        except KeyboardInterrupt:
            _say(f"stopped; `hedgebed resume {folder.path}` finishes it")
            return STOPPED
        except RuntimeError as error:
            _say(f"failed: {error}")
            _say(f"what was finished is kept in {folder.path}; the same settings would fail the same way again")
            return FAILED
        except ValueError as error:
            if fresh and not folder.has_work:  # refused before any work: leave nothing behind
                _discard(folder)
                raise _RefusedError(str(error)) from error
            write_text(folder.path / "traceback.txt", traceback.format_exc())
            _say(f"failed: {error}")
            _say(f"what was finished is kept in {folder.path}, and where it failed in traceback.txt there")
            return FAILED
        except Exception:
            traceback.print_exc()
            _say(f"failed; what there was is in {folder.path}")
            return FAILED
    return _show(folder, as_json=as_json)


def _show(folder: RunFolder, *, as_json: bool) -> int:
    if as_json:
        print((folder.path / "result.json").read_text(encoding="utf-8"), end="")
    else:
        _show_result(folder)
    return DONE


def _discard(folder: RunFolder) -> None:
    """Remove a folder that holds nothing but what `RunFolder.create` has written."""
    ours = {"run.toml", "status.json", "lock"}
    if {item.name for item in folder.path.iterdir()} <= ours:
        shutil.rmtree(folder.path)


def _number(value: Any, std: Any = 0.0) -> str:
    """A value to the digits its spread allows, to two where that is unknown (None), to four where it is exact."""
    if not isinstance(value, float) or not math.isfinite(value):
        return "-" if value is None else str(value)
    if std is None:
        whole = value.is_integer() and abs(value) < 1e15
        return f"{value:.0f}" if whole else f"{value:.2g}" if abs(value) < 100 or abs(value) >= 1e6 else f"{value:.0f}"
    if not std or not math.isfinite(std):
        return f"{value:.4g}"
    decimals = digits_for(std)
    return f"{value:.{max(decimals, 0)}f}" if decimals <= 9 else f"{value:.4g}"


def _show_result(folder: RunFolder) -> None:
    """The numbers of result.json in a short table on stdout, the warnings, and where the report is."""
    result = folder.read_result()
    console = Console(file=sys.stdout, highlight=False)
    table = Table(title=result.get("title"), title_justify="left", box=None, pad_edge=False)
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_column("spread (std)", justify="right")
    table.add_column("unit")
    for name, quantity in result.get("quantities", {}).items():
        unit = quantity.get("unit", "")
        table.add_row(
            name,
            _number(quantity.get("value"), quantity.get("std")),
            _number(quantity.get("std"), None),
            "" if unit == "1" else unit,
        )
    console.print(table, markup=False)
    for listed in result.get("tables", []):
        shown = Table(title=listed["title"], title_justify="left", box=None, pad_edge=False)
        for place, heading in enumerate(listed["head"]):
            shown.add_column(heading, no_wrap=place == 0)
        for row in listed["rows"]:
            shown.add_row(*(Text(str(cell)) for cell in row))
        console.print(shown, markup=False)
    for sentence in result.get("departures", {}).get("sentences", []):
        console.print(f"- {sentence}", markup=False)
    for warning in result.get("warnings", []):
        console.print(f"warning: {warning}", markup=False)
    report = folder.path / "report.html"
    print(f"{'report' if report.exists() else 'folder'}: {report if report.exists() else folder.path}")


# Commands ------------------------------------------------------------------------------------------------------------

_Json = Annotated[bool, Parameter(help="Print the result as JSON on stdout and nothing else.", negative="")]
_Quiet = Annotated[bool, Parameter(help="Show no progress.", negative="")]


def _resume(
    folder: Annotated[Path, Parameter(help="The folder of a run that was stopped, failed or killed.")],
    /,
    *,
    json: _Json = False,
    quiet: _Quiet = False,
) -> int:
    """Finish a run that was stopped, failed or killed, from its last checkpoint."""
    with _refusing():
        run = RunFolder.open(folder)
        experiment = find_experiment(run.command)
        settings_from(experiment.settings_class(), [Layer(str(folder / "run.toml"), run.settings)])
        with run.lock():
            pass
    if run.status == "done" and (folder / "result.json").exists():
        _say(f"the run in {folder} is done")
        return _show(run, as_json=json)
    if run.version != __version__:
        _say(f"warning: the run was begun by version {run.version}, this is {__version__}")
    return _carry_out(run, lambda progress: experiment.resume(run.path, progress=progress), as_json=json, quiet=quiet)


def _bench(
    what: Annotated[str, Parameter(help="What to measure: the name of a module in benchmarks/.")] = "bed",
    /,
    *,
    out: Annotated[Path | None, Parameter(help="Folder for bench.json; runs/bench-<time> if not given.")] = None,
    json: _Json = False,
    quiet: _Quiet = False,
    **options: Annotated[str, Parameter(help="What else this benchmark takes: docs say it.")],
) -> int:
    """Measure how fast or how good it is, beside others where they are installed (from a checkout)."""
    from experiments.benching import benchmark_options, goes_on, load_benchmark

    with _refusing():
        run = load_benchmark(what)
        settings = benchmark_options(run, options)
        out = out or fresh_path("bench")
        if out.exists() and (not out.is_dir() or (any(out.iterdir()) and not goes_on(run, out))):
            raise ValueError(f"out = {str(out)!r} is in use: name a folder that is empty or does not exist yet")
        out.mkdir(parents=True, exist_ok=True)
    with _stdout_to_stderr():
        try:
            with make_progress(quiet=quiet) as progress:
                result = run(out, progress=progress, **settings)
        except RuntimeError as error:
            _say(f"failed: {error}")
            return FAILED
        except ValueError as error:  # a setting that cannot be, in an option or in the environment
            _say(str(error))
            return BAD_INPUT
        write_json(out / "bench.json", result)
    if json:
        print((out / "bench.json").read_text(encoding="utf-8"), end="")
    else:
        print(f"bench: {out / 'bench.json'}")
    return DONE


def _campaign_new(
    folder: Annotated[Path, Parameter(help="Where to write it; must be new or empty.")],
    /,
    *,
    kind: Annotated[Literal["tumble", "penetration"], Parameter(help="What kind of trials.", show_default=False)],
) -> int:
    """Write an annotated template: campaign.toml with every key explained, and short recordings to be replaced."""
    from experiments.campaign.templates import new_campaign

    with _refusing():
        new_campaign(folder, kind=kind)
    print(f"campaign: {folder / 'campaign.toml'}")
    _say(f"fill it in, then `hedgebed campaign check {folder}`")
    return DONE


def _campaign_from_run() -> Callable[..., int]:
    """The function behind ``hedgebed campaign from-run``, with one parameter per setting of the sensors."""
    from experiments.run_campaign import SpikeSensors, write_run_campaign

    fields = SpikeSensors.model_fields

    def command(run: Path, folder: Path, **given: Any) -> int:
        with _refusing():
            sensors = settings_from(SpikeSensors, [Layer(None, _as_typed(given, fields))])
            assert isinstance(sensors, SpikeSensors)
            campaign = write_run_campaign(run, folder, sensors=sensors)
        print(f"campaign: {folder / 'campaign.toml'}")
        _say(f"{len(campaign.tables.trial)} trials; `hedgebed diagnose {folder}` says what the spring-damper lacks")
        return DONE

    places = {"run": "Folder of a finished run of penetrate.", "folder": "Where to write it; must be new or empty."}
    parameters = [
        inspect.Parameter(
            name, inspect.Parameter.POSITIONAL_ONLY, annotation=Annotated[Path, Parameter(help=text, negative="")]
        )
        for name, text in places.items()
    ] + [_option(name, field) for name, field in fields.items()]
    command.__signature__ = inspect.Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


def _doctor(*, json: _Json = False) -> int:
    """Say what this machine has and what to install where something lacks."""
    from experiments.doctor import examine, show

    findings = examine()
    show(findings, as_json=json)
    return DONE if all(finding.ok for finding in findings if finding.required) else FAILED


def build_app() -> App:
    """The command line as a cyclopts App; a command returns its exit status."""
    app = App(
        name="hedgebed",
        help="A spike in a bed of grains, beside the spring-damper that stands in for it. SI units throughout.",
        help_format="plaintext",
        version=__version__,
        result_action="return_value",
    )
    for experiment in registry.EXPERIMENTS.values():
        *above, name = experiment.name.split(" ")
        home = app[above[0]] if above else app
        home.command(_experiment_command(experiment), name=name, help=experiment.summary)
    if "campaign" in registry.EXPERIMENTS:
        app["campaign"].command(_campaign_new, name="new")
        app["campaign"].command(
            _campaign_from_run(), name="from-run", help="Write a finished run of penetrate as a campaign of trials."
        )
    app.command(_resume, name="resume")
    app.command(_bench, name="bench")
    app.command(_doctor, name="doctor")
    return app
