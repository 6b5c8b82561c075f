"""``hedgebed bench view``: how many frames a second a page shows while a bed turns, drawn by software in Chromium.

A made-up bed of ``--grains`` on a loose cubic grid, cut open in the middle, in a window of 1280 by 800. SwiftShader
draws, so no graphics card takes part. Beside the rate stands the processor time of all of Chromium's processes for a
frame: it holds on a machine that does other work, where the rate does not. Both are medians of rounds.

Options: --grains, --turns (frames that are drawn at each resolution, in rounds of 4).
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from benchmarks.race.machine import begin_timing, column_table, wide_console
from benchmarks.race.scratch import scratch
from experiments.runs.types import Json
from vis.pictures.frames import FrameWriter
from vis.view.page import write_view

__all__ = ["Browser", "bed_of", "chromium", "run"]

_GRAIN = 0.004
_WINDOW = (1280, 800)
_ROUND = 4  # Frames from one line of progress to the next
_START = """
import fcntl, os, sys
pipes = [fcntl.fcntl(int(pipe), fcntl.F_DUPFD, 10) for pipe in sys.argv[1:3]]
for pipe, place in zip(pipes, (3, 4)):
    os.dup2(pipe, place)
os.execvp(sys.argv[3], sys.argv[3:])
"""
"""Gives Chromium its pipes where it expects them: it reads from descriptor 3 and writes to 4."""
_TURN = """(async () => {{
  const viewer = document.querySelector(".scene").viewer;
  await viewer.ready;
  cancelAnimationFrame(viewer.asked);  // What the page still means to draw by itself, at another resolution
  clearTimeout(viewer.sharpening);
  viewer.draw({ratio});
  const size = {{ wide: viewer.canvas.width, high: viewer.canvas.height }};
  const began = performance.now(), drawn = [];
  for (let k = 0; k < {turns}; k++) {{
    viewer.state.az += 0.1;
    viewer.draw({ratio});
    drawn.push(viewer.picture.drawn);
    await new Promise((done) => setTimeout(done));
  }}
  return {{ seconds: (performance.now() - began) / 1e3, drawn: drawn.reduce((a, b) => a + b) / drawn.length,
    ...size }};
}})()"""


def chromium() -> str | None:
    """The command of an installed Chromium, or None."""
    return next(
        (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
    )


class Browser:
    """Chromium without a window, drawing by software, driven over a pipe by its DevTools protocol.

    ``size``: Of the window [pixels]. ``network``: False: every request to a host fails. A context manager. Raises
    RuntimeError where Chromium does not start, ends, or reports an error; what a page throws is in `errors`.
    """

    def __init__(self, size: tuple[int, int] = _WINDOW) -> None:
        command = chromium()
        if command is None:
            raise RuntimeError("there is no Chromium (Debian: apt install chromium)")
        with ExitStack() as ending:
            self._start(command, size, ending.enter_context(scratch("hedgebed-chromium-")), ending)
            self._ending = ending.pop_all()

    def _start(self, command: str, size: tuple[int, int], home: Path, ending: ExitStack) -> None:
        """Chromium, whose files are all in `home`, with a page; `ending` ends it."""
        ours_in, theirs_out = os.pipe()
        theirs_in, ours_out = os.pipe()
        options = [
            "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--disable-gpu",
            "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run",
            "--host-resolver-rules=MAP * ~NOTFOUND",
            f"--window-size={size[0]},{size[1]}", f"--user-data-dir={home}", "about:blank",
        ]  # fmt: skip
        self._child = subprocess.Popen(
            [sys.executable, "-c", _START, str(theirs_in), str(theirs_out), command, *options],
            pass_fds=(theirs_in, theirs_out), start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=os.environ | {"TMPDIR": str(home)},
        )  # fmt: skip
        ending.callback(self._end, ours_in, ours_out)
        os.close(theirs_in)
        os.close(theirs_out)
        self._in, self._out, self._unread, self._count = ours_in, ours_out, b"", 0
        self._session: str | None = None
        self.errors: list[str] = []
        page = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        for part in ("Page", "Runtime", "Network"):
            self.call(f"{part}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.close()

    def _end(self, *pipes: int) -> None:
        os.killpg(self._child.pid, signal.SIGKILL)
        self._child.wait()
        for pipe in pipes:
            os.close(pipe)

    def call(self, method: str, **parameters: Any) -> Any:
        """The result of a command of the protocol. Raises RuntimeError where it fails."""
        self._count += 1
        message: Json = {"id": self._count, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self._unread:
                if not (more := os.read(self._in, 1 << 20)):
                    raise RuntimeError("Chromium has ended")
                self._unread += more
            text, self._unread = self._unread.split(b"\0", 1)
            answer = json.loads(text)
            if answer.get("method") == "Runtime.exceptionThrown":
                self.errors.append(json.dumps(answer["params"]["exceptionDetails"]))
            if answer.get("method") == "Network.requestWillBeSent":
                url = answer["params"]["request"]["url"]
                if url.startswith("http"):
                    self.errors.append(f"the page asks for {url}")
            if answer.get("id") == self._count:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def open(self, page: Path, part: str = "") -> None:
        """Load a page, with what follows # in its address, and wait until its scene is there."""
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=page.resolve().as_uri() + (f"#{part}" if part else ""))
        while self.value("document.readyState") != "complete":
            time.sleep(0.02)
        self.value("document.querySelector('.scene')?.viewer?.ready.then(() => true)")

    def value(self, script: str) -> Any:
        """What an expression of the page yields, awaited. Raises RuntimeError for what it throws."""
        found = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in found:
            raise RuntimeError(json.dumps(found["exceptionDetails"]))
        return found["result"].get("value")

    def press(self, key: str, *, shift: bool = False) -> None:
        """Press and release a key by its name, such as ArrowLeft or " "."""
        codes = {" ": 32, "PageUp": 33, "PageDown": 34, "Home": 36, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39,
                 "ArrowDown": 40, "Tab": 9}  # fmt: skip
        what = {"key": key, "windowsVirtualKeyCode": codes.get(key, ord(key[0])), "modifiers": 8 if shift else 0}
        self.call("Input.dispatchKeyEvent", type="keyDown", **what)
        self.call("Input.dispatchKeyEvent", type="keyUp", **what)

    def screenshot(self) -> bytes:
        """The window as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def processor_time(self) -> float:
        """Processor time of all its processes so far [s]."""
        ticks = 0
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = stat.read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == self._child.pid:  # its session
                ticks += int(fields[11]) + int(fields[12])
        return ticks / os.sysconf("SC_CLK_TCK")


def bed_of(folder: Path, grains: int, *, frames: int = 2, title: str = "A made-up bed") -> Path:
    """A run folder with frames of so many grains on a loose cubic grid that sinks a little; returns it."""
    edge = int(np.ceil(grains ** (1 / 3)))
    place = np.stack(np.unravel_index(np.arange(grains), (edge, edge, edge)), axis=1)[:, ::-1]
    noise = np.random.default_rng(1).uniform(-0.15, 0.15, (grains, 3))
    at = (place + 0.5 + noise) * _GRAIN
    writer = FrameWriter(folder, name="bed")
    for number in range(frames):
        moved = -0.3 * number * _GRAIN * np.abs(noise)
        fields = {
            "position": at + moved, "radius": np.full(grains, 0.55 * _GRAIN), "velocity": moved, "force": noise,
            "displacement": moved, "id": np.arange(grains),
        }  # fmt: skip
        writer.write(0.1 * number, fields)
    result = {"experiment": "bed make", "version": "0", "title": title, "status": "done", "surface": "sand"}
    (folder / "result.json").write_text(json.dumps(result))
    return folder


def run(out: Path, *, progress: Any, grains: int = 100_000, turns: int = 20) -> Json:
    """Measure, and return what goes into bench.json; nothing is written to `out`.

    Raises RuntimeError where there is no Chromium, ValueError for fewer than 1 grain or turn.
    """
    if min(grains, turns) < 1:
        raise ValueError(f"grains = {grains}, turns = {turns}: both must be at least 1")
    bench, remarks = begin_timing("view")
    for remark in remarks:
        progress.message(remark)
    bench |= {"grains": grains, "turns": turns, "window": list(_WINDOW)}
    progress.plan({"page": 1.0, "frames": 3.0})
    progress.stage("page", total=1.0)
    with scratch() as folder, Browser() as browser:
        page = write_view(bed_of(folder, grains), progress=progress.update)
        bench["page_bytes"] = page.stat().st_size
        progress.stage("frames", total=float(2 * turns))
        browser.open(page)
        for number, (name, ratio) in enumerate((("full", 1.0), ("half", 0.5))):
            bench[name] = _timed(browser, ratio, turns, lambda done, past=number * turns: progress.update(past + done))
    progress.close()
    bench["load_at_the_end"] = os.getloadavg()[0]
    table = column_table(
        ("resolution", "pixels", "grains drawn", "frames/s", "processor time a frame [ms]"),
        title=f"view: {grains:,} grains turn in Chromium, drawn by software",
    )
    for name in ("full", "half"):
        told = bench[name]
        table.add_row(
            name, "{} x {}".format(*told["pixels"]), f"{told['grains_drawn']:,}", f"{told['frames_per_second']:.1f}",
            f"{1e3 * told['processor_time_per_frame_s']:.1f}",
        )  # fmt: skip
    wide_console().print(table)
    return bench


def _timed(browser: Browser, ratio: float, turns: int, progress: Any) -> Json:
    """Rate and processor time of `turns` frames at a share of the resolution; `progress`: called with frames drawn."""
    rounds: list[tuple[float, float]] = []
    done, told = 0, {}
    while done < turns:
        count = min(_ROUND, turns - done)
        before = browser.processor_time()
        told = browser.value(_TURN.format(turns=count, ratio=ratio))
        # The frame that _TURN draws first, so that each round begins with a page that is ready, counts here alone.
        rounds.append((count / told["seconds"], (browser.processor_time() - before) / (count + 1)))
        done += count
        progress(float(done))
    rates, times = zip(*rounds, strict=True)
    return {
        "pixels": [told["wide"], told["high"]], "grains_drawn": round(told["drawn"]),
        "frames_per_second": statistics.median(rates), "processor_time_per_frame_s": statistics.median(times),
        "rounds": {"frames_per_second": list(rates), "processor_time_per_frame_s": list(times)},
    }  # fmt: skip
