"""The command line: ``hedgebed <experiment> [case.toml] [--option value ...] [--out DIR]``.

The options of an experiment are made from its settings class: same names (with hyphens), types, defaults and units.
Exit status: 0 done, 1 failed (state saved, reason said), 2 bad input, 3 stopped (``hedgebed resume DIR`` finishes it).
Results go to stdout, everything else to stderr.
"""

import inspect
import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

from cyclopts import App, CycloptsError, Group, Parameter

from experiments.cli.benching import spelled_out
from experiments.cli.grounds import on_another_ground
from experiments.cli.options import as_typed, option_of, reserved_option, with_parameters
from experiments.cli.runs import BAD_INPUT, DONE, FAILED, STOPPED, carry_out, redraw_old_report, show_folder
from experiments.runs import registry
from experiments.runs.folder import RunFolder, fresh_path, write_json
from experiments.runs.progress import Progress, make_progress
from experiments.runs.reading import Layer, find_case, gravities_told, option, read_case, settings_from
from experiments.runs.registry import Experiment, find_experiment
from experiments.runs.result import Result
from experiments.runs.streams import (
    RefusedError,
    fault_words,
    file_words,
    is_number,
    naming,
    refusing,
    say,
    stdout_to_stderr,
    terminate_like_ctrl_c,
)
from experiments.runs.version import __version__
from hedgebed_taichi import chosen

__all__ = ["BAD_INPUT", "DONE", "FAILED", "GROUPS", "STOPPED", "build_app", "main"]

GROUPS = {
    name: Group(title, sort_key=place)
    for place, (name, title) in enumerate({
        "simulate": "Simulate",
        "measure": "Explain measured trials",
        "compare": "Compare and verify",
        "prepare": "Prepare beds",
        "keep": "Manage runs and installation",
    }.items())
}  # fmt: skip
"""Headings of ``hedgebed --help``, by the name that registry.toml gives to the group of an experiment."""


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line on `tokens` (``sys.argv[1:]`` by default) and return the exit status."""
    try:
        with terminate_like_ctrl_c():
            with refusing():
                chosen()
            tokens = spelled_out(sys.argv[1:] if tokens is None else tokens)
            return build_app()(tokens, exit_on_error=False, print_error=False) or DONE
    except (CycloptsError, ValueError) as error:
        if not isinstance(error, CycloptsError | RefusedError):
            traceback.print_exc()
            return FAILED
        say(fault_words(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        say("stopped")
        return STOPPED
    except BrokenPipeError:  # the reader of stdout has gone, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:
        say(f"failed: {file_words(error, 'a file')}")
        return FAILED


_SUBJECTS = (".npz", ".xml", ".urdf", ".mjb")
"""Files that are what an experiment is about, and no case file."""


def _experiment_command(experiment: Experiment) -> Callable[..., int]:
    """The function behind ``hedgebed <experiment>``, with one parameter per setting.

    Only what was typed arrives in `given`, so that a case file can lie between the defaults and the command line.
    """
    settings_class, presets = experiment.settings_class(), experiment.presets
    fields = settings_class.model_fields
    below = [name.split(" ")[-1] for name in registry.EXPERIMENTS if name.startswith(f"{experiment.name} ")]
    hint = fields[experiment.subject].annotation if experiment.subject else None
    many = get_origin(hint) is tuple and get_args(hint)[-1] is Ellipsis
    pair = get_origin(hint) is tuple and not many

    def command(
        case: Path | None = None,
        *others: Path | None,
        out: Path | None = None,
        json: bool = False,
        quiet: bool = False,
        verbose: bool = False,
        **given: Any,
    ) -> int:
        with refusing():
            named = tuple(str(path) for path in (case, *others) if path is not None)
            if (pair and len(named) == 2) or (many and named and (len(named) > 1 or not Path(named[0]).is_file())):
                case, given[experiment.subject] = None, named
            elif experiment.subject and case is not None and (not case.is_file() or case.suffix in _SUBJECTS):
                case, given[experiment.subject] = None, str(case)
            if experiment.subject and case is None and fields[experiment.subject].is_required():
                _refuse_swallowed(experiment, given)
            if case is not None and is_number(str(case)):
                # As the second of ``--mu-s 0.4 0.5``.
                several = "; to try several values, --sweep KEY=FROM:TO:STEP" if "sweep" in fields else ""
                raise ValueError(f"{case} belongs to no option: an option that describes one number takes one{several}")
            layers = [read_case(registry.CASES / preset.case) for preset in presets if given.pop(preset.option, False)]
            layers += [read_case(find_case(case, registry.CASES, below))] if case is not None else []
            typed = Layer(None, as_typed(given, fields))
            layers, left_out = on_another_ground(settings_class, layers, typed)
            settings = settings_from(settings_class, [*layers, typed])
            with stdout_to_stderr():
                experiment.check(settings)
                code = experiment.code()
            folder = RunFolder.create(out or fresh_path(experiment.name), experiment.name, settings, code=code)
            for text in [*left_out, *gravities_told(settings, [*layers, typed])]:
                say(text)

        def work(progress: Progress) -> Result:
            return experiment.run(settings, folder.path, progress=progress)

        return carry_out(folder, work, as_json=json, quiet=quiet, verbose=verbose)

    quiet_flag = reserved_option("quiet")
    flags = [
        quiet_flag.replace(
            name=preset.option,
            annotation=Annotated[bool, Parameter(help=preset.summary, negative="", show_default=False)],
        )
        for preset in presets
    ]
    first = reserved_option("case")
    if experiment.subject:
        about = Parameter(help=fields[experiment.subject].description, negative="", show_default=False)
        first = first.replace(name=experiment.subject, annotation=Annotated[Path | None, about])
    parameters = [first]
    if pair:
        about = Parameter(help="Folder of the second run.", negative="", show_default=False)
        parameters.append(first.replace(name="other", annotation=Annotated[Path | None, about]))
    if many:
        about = Parameter(help="Further folders of the same kind.", negative="", show_default=False)
        further = inspect.Parameter("others", inspect.Parameter.VAR_POSITIONAL, annotation=Annotated[Path, about])
        parameters.append(further)
    parameters += [option_of(name, field) for name, field in fields.items() if name != experiment.subject]
    parameters += [*flags, *map(reserved_option, ("out", "json", "quiet"))]
    parameters += [reserved_option("verbose")] if experiment.answer or experiment.headline else []
    command.__name__ = experiment.name.replace(" ", "_")
    return with_parameters(command, parameters)


def _refuse_swallowed(experiment: Experiment, given: Mapping[str, Any]) -> None:
    """Raise ValueError where an option of several words may have taken the first argument as one of its words."""
    words = {name: value for name, value in given.items() if isinstance(value, tuple) and len(value) > 0}
    if experiment.subject in given or not words:
        return
    name, value = max(words.items(), key=lambda item: len(item[1]))
    raise ValueError(
        f"{experiment.subject} is missing: it must stand before the options, as in hedgebed {experiment.name} "
        f"{value[-1]} {option(name)} ...; here {option(name)} took all words up to the next option "
        f"({' '.join(map(str, value))})"
    )


def _damage(run: RunFolder) -> str:
    """What is wrong with the files of a finished run; empty where nothing is."""
    try:
        run.read_result()
    except ValueError as error:
        return str(error)
    return ""


_Json = Annotated[bool, Parameter(help="Print the result as JSON on stdout and nothing else.", negative="")]
_Quiet = Annotated[bool, Parameter(help="Show no progress.", negative="")]
_Verbose = Annotated[bool, Parameter(help="Print every number and finding of the report.", negative="")]


def _resume(
    folder: Annotated[Path, Parameter(help="The folder of a run that was stopped, failed or killed.")],
    /,
    *,
    json: _Json = False,
    quiet: _Quiet = False,
    verbose: _Verbose = False,
) -> int:
    """Continue a run that was stopped, failed or killed from its last checkpoint."""
    with refusing():
        run = RunFolder.open(folder)
        experiment = find_experiment(run.command)
        kept = run.status is None and (folder / "result.json").exists()  # as docs/results has them: not to be written
        if not kept:
            with naming(folder / "run.toml"):
                settings_from(experiment.settings_class(), [Layer(str(folder / "run.toml"), run.settings)])
            with run.lock():
                pass
        done = kept or (run.status == "done" and (folder / "result.json").exists())
        if done and (fault := _damage(run)):
            if kept:
                raise ValueError(fault)
            say(f"{fault}; it is made again")
            done = False
    if done:
        say(f"the run in {folder} is done")
        redraw_old_report(run, quiet=quiet)
        return show_folder(run, as_json=json, verbose=verbose)
    if run.version != __version__:
        say(f"warning: the run was begun by version {run.version}, this is {__version__}")

    def work(progress: Progress) -> Result:
        return experiment.resume(run.path, progress=progress)

    return carry_out(run, work, as_json=json, quiet=quiet, verbose=verbose)


def _bench(
    what: Annotated[
        str, Parameter(help="What to measure: bed, answer, constants, diagnose, feet, gpu, planar or view.")
    ] = "bed",
    /,
    *,
    out: Annotated[Path | None, Parameter(help="Folder for bench.json; runs/bench-<time> if not given.")] = None,
    json: _Json = False,
    quiet: _Quiet = False,
    **options: Annotated[str, Parameter(help="Options of the benchmark: docs/commands.md.")],
) -> int:
    """Measure speed or reliability, also of other codes that are installed (needs a checkout)."""
    from experiments.cli.benching import benchmark_options, goes_on, load_benchmark

    with refusing():
        run = load_benchmark(what)
        settings = benchmark_options(run, options)
        out = out or fresh_path("bench")
        if out.exists() and (not out.is_dir() or (any(out.iterdir()) and not goes_on(run, out))):
            raise ValueError(f"out = {str(out)!r} is in use: name a folder that is empty or does not exist yet")
        out.mkdir(parents=True, exist_ok=True)
    with stdout_to_stderr():
        try:
            with make_progress(quiet=quiet) as progress:
                result = run(out, progress=progress, **settings)
        except (RuntimeError, ValueError) as error:
            failed = isinstance(error, RuntimeError)  # else a setting that cannot be, in an option or the environment
            say(f"failed: {error}" if failed else str(error))
            return FAILED if failed else BAD_INPUT
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
    kind: Annotated[
        Literal["tumble", "penetration"] | None, Parameter(help="Kind of trials of a template.", show_default=False)
    ] = None,
    recordings: Annotated[
        Path | None,
        Parameter(name="--from", help="Folder of CSV files: pushes and drops, a trial each.", show_default=False),
    ] = None,
) -> int:
    """Write a template with every key explained, or with --from a campaign of your own recordings.

    Of recordings the columns are recognised by their headings (force [N], z_mm). They are copied, with the names of
    the format in the first line. What they do not show is "unknown" in campaign.toml and listed.
    """
    from experiments.campaign.files import new_campaign, new_from_recordings

    with refusing():
        if recordings is not None:
            if kind == "tumble":
                raise ValueError("--from reads pushes and drops, which are --kind penetration: found --kind tumble")
            found = new_from_recordings(folder, recordings)
            print(f"campaign: {folder / 'campaign.toml'}")
            for line in found.columns:
                say(line)
            say("to fill in:")
            for line in found.unknown:
                say(f"  - {line}")
            say(f"then `hedgebed campaign check {folder}`")
            return DONE
        if kind is None:
            raise ValueError("--kind is missing: tumble or penetration was expected, or --from FOLDER of recordings")
        new_campaign(folder, kind=kind)
    print(f"campaign: {folder / 'campaign.toml'}")
    made_up = ", ".join(sorted(str(path.relative_to(folder)) for path in folder.rglob("*.csv")))
    say(f"example recordings, to delete or replace: {made_up}")
    say(f"fill in campaign.toml, then `hedgebed campaign check {folder}`")
    return DONE


def _campaign_from_run() -> Callable[..., int]:
    """The function behind ``hedgebed campaign from-run``, with one parameter per setting of the sensors."""
    from experiments.penetrate.recorded import SpikeSensors, write_run_campaign
    from experiments.tumble.recorded import TumbleRecording, write_tumbles_campaign

    of_spikes, of_tumbles = SpikeSensors.model_fields, TumbleRecording.model_fields
    fields = of_spikes | of_tumbles

    def command(run: Path, folder: Path, **given: Any) -> int:
        with refusing():
            kind = RunFolder.open(run).command
            tumbled = kind == "tumble"
            if kind not in ("tumble", "penetrate"):
                raise ValueError(
                    f"{str(run)!r} is a run of {kind!r}: one of 'penetrate', or of 'tumble' in the plane, was "
                    f"expected; campaigns and `hedgebed diagnose` know no others"
                )
            stray = sorted(set(given) & (set(of_spikes) - {"seed"} if tumbled else set(of_tumbles)))
            if stray:
                of_what = "a tumble" if tumbled else "a spike"
                raise ValueError(f"{option(stray[0])} is given, and {str(run)!r} is a run of {of_what}: without it")
            typed = as_typed(given, fields)
            of_spike = {name: value for name, value in typed.items() if name == "seed" or not tumbled}
            sensors = settings_from(SpikeSensors, [Layer(None, of_spike)])
            if tumbled:
                own = {name: value for name, value in typed.items() if name in of_tumbles}
                recording = settings_from(TumbleRecording, [Layer(None, own)])
                campaign = write_tumbles_campaign(run, folder, recording=recording, seed=sensors.seed)
            else:
                campaign = write_run_campaign(run, folder, sensors=sensors)
        print(f"campaign: {folder / 'campaign.toml'}")
        say(f"{len(campaign.tables.trial)} trials; `hedgebed diagnose {folder}` finds what the spring-damper omits")
        return DONE

    places = {"run": "Folder of a finished run of penetrate, or of tumble."}
    places["folder"] = "Where to write it; must be new or empty."
    hints = {name: Annotated[Path, Parameter(help=text, negative="")] for name, text in places.items()}
    kind = inspect.Parameter.POSITIONAL_ONLY
    parameters = [inspect.Parameter(name, kind, annotation=hint) for name, hint in hints.items()]
    return with_parameters(command, [*parameters, *(option_of(name, field) for name, field in fields.items())])


def _effects(
    names: Annotated[
        tuple[str, ...],
        Parameter(help="Effects to show in detail: parameters, source, limits.", negative="", show_default=False),
    ] = (),
    /,
) -> int:
    """List the effects that --effects of `tumble` and `campaign` adds to the base model."""
    from experiments.cli.effects import show_effects

    with refusing():
        show_effects(names)
    return DONE


def _doctor(*, json: _Json = False) -> int:
    """Check this machine and state what to install."""
    from experiments.cli.doctor import TRIES, examine, show

    print(TRIES, file=sys.stderr)
    findings = examine()
    show(findings, as_json=json)
    return DONE if all(finding.ok for finding in findings if finding.required) else FAILED


def build_app() -> App:
    """The command line as a cyclopts App; a command returns its exit status."""
    app = App(
        name="hedgebed",
        help="Simulate robots that hop and tumble on asteroids: spikes in beds of grains, the spring-damper that "
        "replaces such a bed, tumbles and hops of the platform, and the diagnosis of measured trials. "
        "Each command has its own --help; docs/commands.md describes all.",
        help_epilogue="Numbers are in the unit in brackets, or have a unit of their own: 16mm, 0.5N, 1e-3g.",
        help_format="plaintext",
        group_commands=Group("Other", sort_key=len(GROUPS)),
        version=__version__,
        result_action="return_value",
    )
    if "bed make" in registry.EXPERIMENTS:
        from experiments.cli.bed_commands import add_bed_commands

        about = "Prepare, list, show, share, refine, test and calibrate beds of grains."
        app.command(App(name="bed", help=about, group=GROUPS["prepare"]))
        add_bed_commands(app["bed"])
        app["bed"].command(
            App(name="test", help="Test beds as in a laboratory: shear, repose, cone, vertical cut, plates.")
        )
    for place, experiment in enumerate(registry.EXPERIMENTS.values()):
        *above, name = experiment.name.split(" ")
        home = app
        for word in above:
            home = home[word]
        group = GROUPS.get(experiment.group)
        command = _experiment_command(experiment)
        about = f"{experiment.summary}\n\n{experiment.details}".strip()
        home.command(command, name=name, help=about, group=group, sort_key=place)
    if "campaign" in registry.EXPERIMENTS:
        app["campaign"].command(_campaign_new, name="new")
        app["campaign"].command(
            _campaign_from_run(),
            name="from-run",
            help="Write finished runs of penetrate or tumble as a campaign of trials.",
        )
    app.command(_resume, name="resume", group=GROUPS["keep"])
    if "tumble" in registry.EXPERIMENTS:
        from experiments.cli.fmu import VARIABLES, fmu_command
        from experiments.cli.render import render
        from experiments.cli.view import view

        about = "Write platform, rig and ground as an FMU (FMI 3, co-simulation) for another simulation program."
        app.command(fmu_command(), name="fmu", help=f"{about}\n\n{VARIABLES}", group=GROUPS["simulate"])
        app.command(render, name="render", group=GROUPS["keep"])
        app.command(view, name="view", group=GROUPS["keep"])
        from experiments.suite.commands import add_suite_commands

        about = "List and run the cases that ship: the platform on beds of grains."
        app.command(App(name="experiments", help=about, group=GROUPS["simulate"]))
        add_suite_commands(app["experiments"])
    app.command(_bench, name="bench", group=GROUPS["compare"])
    app.command(_effects, name="effects", group=GROUPS["measure"])
    app.command(_doctor, name="doctor", group=GROUPS["keep"])
    about = "Install the completion of commands and options by Tab, for bash, zsh, fish or PowerShell."
    app.register_install_completion_command(help=about)
    return app
